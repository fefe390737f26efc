"""Points of a grid over a trace, many solved at a time: summaries, and columns of impacts."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

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
from vibro_cli.kernels.ensemble.records import Points, Stack
from vibro_cli.kernels.statistics.run_statistics import Results
from vibro_cli.kernels.world import LOG_FULL, ImpactRow, World
from vibro_cli.mechanics.system import TraceSystem
from vibro_cli.scenario.problems import KeyPath
from vibro_cli.storage.tables import record_batch
from vibro_cli.systems.columns import Table
from vibro_cli.systems.contract import Columns
from vibro_cli.systems.driver import compiled_world, zeros
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
from vibro_cli.systems.trace.system_template import (
    Reader,
    Starts,
    Systems,
    SystemTemplate,
    is_of_system,
    is_quick,
)
from vibro_cli.systems.trace.tables import ImpactTable, runs_of, sidedness, summary_columns
from vibro_cli.systems.trace.tangents import time_scale
from vibro_cli.systems.trace.world import make_world

_ROWS_AT_LEAST = 1 << 14


@dataclass(frozen=True)
class Logged:
    """Impacts of some points that share a template, as the solver has logged them."""

    system: TraceSystem
    world: World
    """The records of the system, of either engine."""
    points: Array
    """Numbers of the points, from 0 in the grid, ascending."""
    counts: Array
    """How many impacts each has."""
    log: Any
    """The impacts, point by point."""
    masses: Array | None = None
    """[point, ball] (kg); those of the system for None."""
    stack: Stack | None = None
    """The systems of the points, if there are several."""


class LogSpace:
    """Room for the logs of a stretch, one after another; used again for the next stretch.

    Memory that is written to for the first time costs more than what is written.
    """

    def __init__(self) -> None:
        self._rows: Any = zeros(0, ImpactRow)
        self._used = 0

    def clear(self) -> None:
        """Take all logs for done with."""
        self._used = 0

    def take(self, rows: int) -> Any:
        """Return a log with room for at least some rows."""
        if len(self._rows) - self._used < rows:
            # Logs that are in use keep what was there before.
            self._rows = zeros(max(rows + rows // 4, _ROWS_AT_LEAST), ImpactRow)
            self._used = 0
        return self._rows[self._used :]

    def keep(self, log: Any, rows: int) -> Any:
        """Return the first rows of the log that was taken last, perhaps grown; they are kept."""
        if not np.shares_memory(log, self._rows):
            self._rows, self._used = log, 0
        self._used += rows
        return log[:rows]


def impact_columns(table: Table, logged: Sequence[Logged], points: Array) -> dict[str, Any]:
    """Return the columns of a table of impacts, all `logged` of some points, in order of these.

    `points` are their numbers, from 0, one after another.
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


# Settings whose records are kept ready; a grid seldom needs many at once.
_READY = 1024
_ROWS_AT_FIRST = 1 << 12


@dataclass(frozen=True)
class Task:
    """Points for a batch: how they start, and of which systems they are."""

    starts: Starts
    system: TraceSystem
    """One system, or several as one of arrays."""
    of_points: Array | None
    """Then the number of the system of each point."""
    stack: Stack | None
    """And the records of the systems."""
    points: Array
    """Numbers of the points, from 0 in the grid."""

    @staticmethod
    def of(starts: Starts, systems: Systems, points: Array) -> Task:
        """Return the task of those points whose starts are sure."""
        sure, of_points, stack = starts.sure, systems.of_points, None
        if of_points is not None:
            of_points = of_points[sure]
            stack = stack_of(systems.system, systems.count, of_points)
        return Task(starts.at(sure), systems.system, of_points, stack, points[sure])

    def entries(self) -> Points:
        """Return what a batch starts with."""
        starts = self.starts
        return make_points(
            starts.stop_t, starts.stop_collisions, starts.piece, starts.s, starts.c, starts.p,
            starts.mass, starts.restitution,
        )  # fmt: skip

    def time_scales(self) -> Any:
        """Return the scale of time (s) of the tangent map of each point."""
        scales = time_scale(self.system)
        return scales if self.of_points is None or np.ndim(scales) == 0 else scales[self.of_points]

    def places(self, which: Array) -> Places:
        """Return the geometry of the systems of some of the points."""
        return Places(self.system, None if self.of_points is None else self.of_points[which])


class TraceSolver:
    """Solves stretches of a grid's points, in one thread.

    With the engine ``"python"`` every point by itself, interpreted, to the same bits.
    """

    def __init__(self, grid: Grid, engine: str = "compiled") -> None:
        self.interrupted: Callable[[], bool] = lambda: False
        self._grid = grid
        self._engine = engine
        self._templates: OrderedDict[tuple[Any, ...], SystemTemplate] = OrderedDict()
        self._batches: OrderedDict[tuple[Any, ...], Batch] = OrderedDict()
        self._room = 0.0
        self._logs = LogSpace()
        self._table = impact_table_of(grid) if grid.keep.collisions else None
        self._wanted = OutputRequest(lyapunov=is_followed(grid))
        self._sums: Any = None
        self._reader = Reader(grid.base)
        self._indices: Array = np.zeros(0, dtype=np.int64)
        self._summaries: list[tuple[Array, Columns]] = []
        """Each with the points it is of (from 0 in the stretch)."""
        self._logged: list[Logged] = []
        paths = grid.design.paths
        self._of_systems = [path for path in paths if is_of_system(path)]
        self._slow = [path for path in paths if not is_quick(path) and not is_of_system(path)]

    def solve(self, indices: Array) -> Solved:
        """Solve some points, given by their numbers from 0."""
        self._indices, self._summaries, self._logged = indices, [], []
        self._logs.clear()
        values = self._grid.design.columns(indices)
        for key, rows in self._groups(values, len(indices)):
            self._solve_group(key, rows, {path: values[path][rows] for path in values})
        summary = _in_order(self._summaries, len(indices))
        impacts = int(np.ma.filled(summary["collisions"], 0).sum())
        if self._table is None:
            return Solved(summary, impacts, {})
        logged, self._logged = self._logged, []  # those of long runs are not held any longer
        columns = impact_columns(self._table, logged, indices)
        kept = {"collisions": record_batch(self._table, columns)}
        return Solved(summary, impacts, kept)

    def _groups(
        self, values: dict[KeyPath, Array], count: int
    ) -> list[tuple[tuple[Any, ...], Array]]:
        """The points of each template: what they have in common, and their rows."""
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
            # The first point that is valid shows the template.
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
        """Solve points of a known template: first all that are surely valid, then the others."""
        template = self._templates[key]
        systems = template.systems(values, len(rows))
        sure = np.zeros(len(rows), dtype=bool)
        if len(systems.points):
            # What the points have in common is in the template's scenario.
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
                # Systems of which nothing was known before are made one by one.
                own = (*key, *(one[path].item() for path in self._of_systems))
                found.setdefault(own, []).append((rows[at], point))
        for own, points in found.items():
            self._solve_read(own, points)

    def _solve_read(self, key: tuple[Any, ...], points: list[tuple[int, SystemTemplate]]) -> None:
        """Solve valid points of one system that were read alone."""
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
        # What a batch leaves out: runs too long for its logs.
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
        # A little more room than the points before have needed.
        results = empty_results(count, bodies, 0)
        if self._grid.keep.collisions:
            rows = int(self._room * count) + _ROWS_AT_FIRST
            results = results._replace(impacts=self._logs.take(rows))
        if self._wanted.lyapunov and not self._grid.keep.collisions:
            return results  # they come with the tangent maps
        results = batch.run_all(points, results, task.stack)
        taken: Any = results.outcomes
        self._room = max(self._room, 1.1 * float(np.mean(taken["kept"])))
        return results

    def _take(self, task: Task, rows: Array, whole: Array, results: Results, world: World) -> None:
        """Turn results of a batch into columns."""
        starts, bodies = task.starts, task.starts.piece.shape[1]
        every: Any = results.outcomes
        states: Any = results.finals
        outcomes, finals = every[whole], states.reshape(-1, bodies)[whole]
        table = summary_columns(task.places(whole), starts.restitution[whole], outcomes, finals)
        if self._wanted.lyapunov:
            table |= exponent_columns(self._sums[whole], outcomes["end_t"])
        self._summaries.append((rows[whole], table))
        if not self._grid.keep.collisions:
            return
        # A point that is left out has no rows here.
        counts = every["kept"].copy()
        log = self._logs.keep(results.impacts, int(counts.sum()))
        self._logged.append(
            Logged(
                system=task.system,
                world=world if task.stack is None else own_records(world),
                points=task.points,
                counts=counts,
                log=log,
                masses=starts.mass,
                stack=task.stack,
            )
        )

    def _solve_alone(self, number: int, point: SystemTemplate | str) -> None:
        """Solve one point by itself, or take down why it cannot be solved."""
        row = np.array([number])
        table = SYSTEM.summary(ball_count(self._grid), self._wanted.lyapunov)
        if isinstance(point, str):
            record = {"status": "invalid", "reason": point}
            self._summaries.append((row, columns_of_records([record], table)))
            return
        stop, system = point.scenario.stop, point.system
        limits = Limits(stop.time, stop.collisions)
        logs = ("impacts",) if self._grid.keep.collisions else ()
        try:
            summary, kept = summed_up(
                SYSTEM, system, limits, self._engine, self._wanted, logs, self.interrupted
            )
        except (ArithmeticError, ValueError, IndexError, RuntimeError) as error:
            record = {"status": "failed", "reason": f"{type(error).__name__}: {error}"}
            self._summaries.append((row, columns_of_records([record], table)))
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
    """One summary for all points, in their order."""
    if len(parts) == 1:  # which has all of them
        return parts[0][1]
    rows = np.concatenate([rows for rows, _ in parts])
    order = np.empty(count, dtype=np.int64)
    order[rows] = np.arange(count)
    names = parts[0][1]
    return {name: end_to_end([table[name] for _, table in parts])[order] for name in names}
