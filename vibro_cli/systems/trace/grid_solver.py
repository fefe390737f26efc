"""Solve the points of a grid on a trace in batches: summaries, and columns of impacts."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from vibro_cli.compile.kernel import dtype
from vibro_cli.grids.axes import Array
from vibro_cli.grids.document import Grid
from vibro_cli.grids.solving import (
    Solved,
    ball_count,
    columns_of_records,
    end_to_end,
    impact_table_of,
    is_followed,
)
from vibro_cli.grids.workers import spread
from vibro_cli.kernels.ensemble.records import Points, Stack
from vibro_cli.kernels.statistics.run_statistics import Results
from vibro_cli.kernels.world import LOG_FULL, ImpactRow, World
from vibro_cli.mechanics.system import TraceSystem
from vibro_cli.scenario.base import plain
from vibro_cli.scenario.problems import KeyPath
from vibro_cli.storage.tables import record_batch
from vibro_cli.systems.columns import Table
from vibro_cli.systems.contract import Columns
from vibro_cli.systems.driver import chosen, compiled_world
from vibro_cli.systems.request import Limits, OutputRequest
from vibro_cli.systems.run import summed_up
from vibro_cli.systems.tangents import exponent_columns
from vibro_cli.systems.trace import SYSTEM
from vibro_cli.systems.trace.ensemble import (
    Batch,
    empty_results,
    make_points,
    own_records,
    stack_of,
)
from vibro_cli.systems.trace.motion import Places
from vibro_cli.systems.trace.system import time_scale
from vibro_cli.systems.trace.system_template import (
    Reader,
    Starts,
    Systems,
    SystemTemplate,
    is_of_system,
    is_quick,
)
from vibro_cli.systems.trace.tables import ImpactTable, runs_of, sidedness, summary_columns
from vibro_cli.systems.trace.world import make_world


@dataclass(frozen=True)
class Logged:
    """Logged impacts of points that share a template."""

    system: TraceSystem
    world: World
    """The records of the system, of either engine."""
    points: Array
    """Indices of the points in the grid, from 0, ascending."""
    counts: Array
    """Number of impacts of each point."""
    log: Any
    """The impacts, point by point."""
    masses: Array | None = None
    """[point, ball] (kg); None for the masses of the system."""
    stack: Stack | None = None
    """The systems of the points, if there are several."""


def first_rows(log: Any, rows: int) -> Any:
    """Return the first rows of a log: copies of few rows, so that they do not keep it in memory."""
    return log[:rows] if 16 * rows > len(log) else log[:rows].copy()


def impact_columns(table: Table, logged: Sequence[Logged], points: Array) -> dict[str, Any]:
    """Return the columns of the table of all `logged` impacts, in the order of `points`.

    `points` are the consecutive indices of the points, from 0 in the grid.
    """
    counts = np.zeros(len(points), dtype=np.int64)
    for one in logged:
        counts[np.searchsorted(points, one.points)] = one.counts
    rows = np.cumsum(counts) - counts
    filled = ImpactTable(int(counts.sum()), [column.name for column in table.columns])
    for one in logged:
        firsts = rows[np.searchsorted(points, one.points)]
        runs = runs_of(one.system, one.points + 1, one.counts, firsts, one.masses)
        filled.fill(one.world, one.log, runs, sidedness(one.system), one.stack)
    columns = filled.columns()
    if "side" in columns:
        columns["side"] = np.ma.masked_equal(columns["side"], 0)
    return columns


# Size of the cache of templates; a grid seldom needs many at once.
_READY = 1024
_ROWS_AT_FIRST = 1 << 12
# Number of points tried, at most, before the first stretch.
_TRIED = 32


@dataclass(frozen=True)
class Task:
    """Points for a batch, with their initial data and systems."""

    starts: Starts
    system: TraceSystem
    """A single system, or several systems with arrays for numbers."""
    of_points: Array | None
    """For several systems: the index of each point's system."""
    stack: Stack | None
    """For several systems: their records."""
    points: Array
    """Indices of the points in the grid, from 0."""

    @staticmethod
    def of(starts: Starts, systems: Systems, points: Array) -> Task:
        """Return the task of the points that are certainly valid."""
        sure, of_points, stack = starts.sure, systems.of_points, None
        if of_points is not None:
            of_points = of_points[sure]
            stack = stack_of(systems.system, systems.count, of_points)
        return Task(starts.at(sure), systems.system, of_points, stack, points[sure])

    def entries(self) -> Points:
        """Return the initial data as records for a batch."""
        starts = self.starts
        return make_points(
            starts.stop_t, starts.stop_collisions, starts.piece, starts.s, starts.c, starts.p,
            starts.mass, starts.restitution,
        )  # fmt: skip

    def time_scales(self) -> Any:
        """Return the time scale (s) of the tangent map: a number for all points, or an array."""
        scales = time_scale(self.system)
        return scales if self.of_points is None or np.ndim(scales) == 0 else scales[self.of_points]

    def places(self, which: Array) -> Places:
        """Return the geometry of the systems of some of the points."""
        return Places(self.system, None if self.of_points is None else self.of_points[which])


class TraceSolver:
    """Solves stretches of a grid's points, in one thread.

    The engine ``"python"`` solves each point on its own, interpreted, with the same bits.
    """

    def __init__(self, grid: Grid, engine: str = "compiled") -> None:
        self.interrupted: Callable[[], bool] = lambda: False
        self._grid = grid
        self._engine = engine
        self._templates: OrderedDict[tuple[Any, ...], SystemTemplate] = OrderedDict()
        self._batches: OrderedDict[tuple[Any, ...], Batch] = OrderedDict()
        self._room = 0.0
        self._table = impact_table_of(grid) if grid.keep.collisions else None
        self._wanted = OutputRequest(lyapunov=is_followed(grid))
        self._summary = SYSTEM.summary(ball_count(grid), self._wanted.lyapunov)
        self._sums: Any = None
        self._reader = Reader(grid.base)
        self._indices: Array = np.zeros(0, dtype=np.int64)
        self._summaries: list[tuple[Array, Columns]] = []
        """Each with the indices of its points (from 0 in the stretch)."""
        self._refused: dict[int, str] = {}
        """Reasons of invalid points, by the indices of these."""
        self._logged: list[Logged] = []
        paths = grid.design.paths
        self._of_systems = [path for path in paths if is_of_system(path)]
        self._slow = [path for path in paths if not is_quick(path) and not is_of_system(path)]
        # Shuffled, as the first half of an axis may be invalid.
        self._try(np.random.default_rng(0).permutation(spread(grid, _TRIED)))

    def _try(self, indices: Array) -> None:
        """Take the template of the first valid one of some points.

        With it invalid points are read in half the time, and a stretch may begin with many.
        """
        values = self._grid.design.columns(indices)
        for at in range(len(indices)):
            one = _taken(values, at)
            point = self._reader.read(one)
            if isinstance(point, SystemTemplate):
                self._remember(tuple(plain(one[path]) for path in self._slow), point)
                return

    def solve(self, indices: Array) -> Solved:
        """Solve the points with these indices, from 0."""
        self._indices, self._summaries, self._refused, self._logged = indices, [], {}, []
        values = self._grid.design.columns(indices)
        for key, rows in self._groups(values, len(indices)):
            self._solve_group(key, rows, {path: values[path][rows] for path in values})
        if self._refused:
            rows = np.array(list(self._refused))
            records = [{"status": "invalid", "reason": why} for why in self._refused.values()]
            self._summaries.append((rows, columns_of_records(records, self._summary)))
        summary = _in_order(self._summaries, len(indices))
        impacts = int(np.ma.filled(summary["collisions"], 0).sum())
        if self._table is None:
            return Solved(summary, impacts, {})
        logged, self._logged = self._logged, []  # release the logs of long runs
        columns = impact_columns(self._table, logged, indices)
        kept = {"collisions": record_batch(self._table, columns)}
        return Solved(summary, impacts, kept)

    def _groups(
        self, values: dict[KeyPath, Array], count: int
    ) -> list[tuple[tuple[Any, ...], Array]]:
        """Group the points by template: the values that they share, and their rows."""
        if not self._slow:
            return [((), np.arange(count))]
        groups: dict[tuple[Any, ...], list[int]] = {}
        for row, key in enumerate(zip(*(values[p].tolist() for p in self._slow), strict=True)):
            groups.setdefault(key, []).append(row)
        return [(key, np.array(rows)) for key, rows in groups.items()]

    def _solve_group(self, key: tuple[Any, ...], rows: Array, values: dict[KeyPath, Array]) -> None:
        """Solve points of one template."""
        if self._engine == "python":
            for at, row in enumerate(rows):
                self._solve_alone(row, self._reader.read(_taken(values, at)))
            return
        at = 0
        while key not in self._templates and at < len(rows):
            # The first valid point gives the template.
            point = self._reader.read(_taken(values, int(at)))
            if isinstance(point, SystemTemplate):
                self._remember(key, point)
            else:
                self._solve_alone(rows[at], point)
                at += 1
        if at < len(rows):
            self._templates.move_to_end(key)
            self._solve_template(key, rows[at:], _taken(values, slice(at, None)))

    def _remember(self, key: tuple[Any, ...], template: SystemTemplate) -> None:
        self._templates[key] = template
        while len(self._templates) > _READY:
            oldest, _ = self._templates.popitem(last=False)
            self._batches.pop(oldest, None)

    def _solve_template(
        self, key: tuple[Any, ...], rows: Array, values: dict[KeyPath, Array]
    ) -> None:
        """Solve points of a known template: first the certainly valid ones, then the others."""
        template = self._templates[key]
        systems = template.systems(values, len(rows))
        sure = np.zeros(len(rows), dtype=bool)
        if len(systems.points):
            # The template's scenario has the values that the points share.
            own_values = {path: one for path, one in values.items() if path not in self._slow}
            starts = template.starts(_taken(own_values, systems.points), systems)
            sure[systems.points] = starts.sure
            if starts.sure.any():
                self._solve_batch(key, starts, systems, rows[systems.points])
        found: dict[tuple[Any, ...], list[tuple[int, SystemTemplate]]] = {}
        for at in np.flatnonzero(~sure):
            one = _taken(values, int(at))
            point = self._reader.read(one)
            if isinstance(point, str):
                self._solve_alone(rows[at], point)
            else:
                # Group points of other systems by system.
                own = (*key, *(one[path].item() for path in self._of_systems))
                found.setdefault(own, []).append((rows[at], point))
        for own, points in found.items():
            self._solve_read(own, points)

    def _solve_read(self, key: tuple[Any, ...], points: list[tuple[int, SystemTemplate]]) -> None:
        """Solve valid points of one system that were read one by one."""
        if key not in self._templates:
            self._remember(key, points[0][1])
        template = self._templates[key]
        starts = template.starts_of([point for _, point in points])
        systems = Systems(np.arange(len(points)), template.system, None)
        self._solve_batch(key, starts, systems, np.array([row for row, _ in points]))

    def _solve_batch(
        self, key: tuple[Any, ...], starts: Starts, systems: Systems, rows: Array
    ) -> None:
        """Solve valid points of a template with the compiled kernels."""
        template = self._templates[key]
        if key not in self._batches:
            self._batches[key] = Batch(template.system, next(iter(self._batches.values()), None))
        task = Task.of(starts, systems, self._indices[rows])
        results = self._run(self._batches[key], task)
        if self._wanted.lyapunov:
            self._sums = self._batches[key].follow(
                task.entries(), results, task.time_scales(), task.stack
            )
        outcomes: Any = results.outcomes
        # A batch leaves out runs that are too long for its logs.
        whole = outcomes["end_cause"] != LOG_FULL
        rows = rows[starts.sure]
        if whole.any():
            self._take(task, rows, whole, results, self._batches[key].world)
        for row in rows[~whole]:
            values = self._grid.design.columns(self._indices[[row]])
            self._solve_alone(row, self._reader.read(_taken(values, 0)))

    def _run(self, batch: Batch, task: Task) -> Results:
        count, bodies = task.starts.piece.shape
        points = task.entries()
        # A little more room than earlier points needed.
        results = empty_results(count, bodies, 0)
        if self._grid.keep.collisions:
            rows = int(self._room * count) + _ROWS_AT_FIRST
            room: Any = np.empty(rows, dtype(ImpactRow))
            results = results._replace(impacts=room)
        if self._wanted.lyapunov and not self._grid.keep.collisions:
            return results  # filled in with the tangent maps
        results = batch.run_all(points, results, task.stack)
        taken: Any = results.outcomes
        self._room = max(self._room, 1.1 * float(np.mean(taken["kept"])))
        return results

    def _take(self, task: Task, rows: Array, whole: Array, results: Results, world: World) -> None:
        """Store the results of a batch as columns."""
        starts, bodies = task.starts, task.starts.piece.shape[1]
        every: Any = results.outcomes
        states: Any = results.finals
        outcomes, finals = chosen(every, whole), chosen(states.reshape(-1, bodies), whole)
        table = summary_columns(task.places(whole), starts.restitution[whole], outcomes, finals)
        if self._wanted.lyapunov:
            table |= exponent_columns(self._sums[whole], outcomes["end_t"])
        self._summaries.append((rows[whole], table))
        if not self._grid.keep.collisions:
            return
        # A point that is left out has no rows here.
        counts = every["kept"].copy()
        self._logged.append(
            Logged(
                system=task.system,
                world=world if task.stack is None else own_records(world),
                points=task.points,
                counts=counts,
                log=first_rows(results.impacts, int(counts.sum())),
                masses=starts.mass,
                stack=task.stack,
            )
        )

    def _solve_alone(self, number: int, point: SystemTemplate | str) -> None:
        """Solve one point on its own, or record why it cannot be solved."""
        if isinstance(point, str):
            self._refused[number] = point
            return
        row = np.array([number])
        stop, system = point.scenario.stop, point.system
        limits = Limits(stop.time, stop.collisions)
        logs = ("impacts",) if self._grid.keep.collisions else ()
        try:
            summary, kept = summed_up(
                SYSTEM, system, limits, self._engine, self._wanted, logs, self.interrupted
            )
        except (ArithmeticError, ValueError, IndexError, RuntimeError) as error:
            record = {"status": "failed", "reason": f"{type(error).__name__}: {error}"}
            self._summaries.append((row, columns_of_records([record], self._summary)))
            return
        self._summaries.append((row, summary))
        for log in kept.values():
            counts, points = np.array([len(log)]), self._indices[row]
            world = make_world(system)
            world = world if self._engine == "python" else compiled_world(SYSTEM.loop, world)
            self._logged.append(Logged(system, world, points, counts, log))


def _taken(values: dict[KeyPath, Array], at: Any) -> dict[KeyPath, Array]:
    return {path: column[at] for path, column in values.items()}


def _in_order(parts: list[tuple[Array, Columns]], count: int) -> Columns:
    """Join summaries into one for all points, in their order."""
    if len(parts) == 1:  # complete and in order
        return parts[0][1]
    rows = np.concatenate([rows for rows, _ in parts])
    order = np.empty(count, dtype=np.int64)
    order[rows] = np.arange(count)
    names = parts[0][1]
    return {name: end_to_end([table[name] for _, table in parts])[order] for name in names}
