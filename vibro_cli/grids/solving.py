"""Solving a stretch of points: their summaries, and their impacts if they are kept."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from vibro_cli.grids.axes import Column
from vibro_cli.grids.document import Grid
from vibro_cli.grids.impacts import Logged, LogSpace
from vibro_cli.grids.points import Point, Reader, is_quick
from vibro_cli.grids.setting import Setting, Starts
from vibro_cli.mechanics.records import NEVER
from vibro_cli.scenario.problems import KeyPath
from vibro_cli.simulation.batch import Batch, make_points
from vibro_cli.simulation.entry import empty_results
from vibro_cli.simulation.geometry import Places
from vibro_cli.simulation.points import Results
from vibro_cli.simulation.run import simulate_system
from vibro_cli.simulation.summary import summary_columns
from vibro_cli.simulation.world import LOG_FULL, World
from vibro_cli.storage.schema import summary

Table = dict[str, Any]

# Settings whose records are kept ready; a grid seldom needs many at once.
_READY = 1024
_ROWS_AT_FIRST = 1 << 12


@dataclass
class Solved:
    """A stretch of points, solved."""

    summary: Table
    logged: Sequence[Any]
    """Their impacts, if they are kept, as the system's columns are made from them."""
    impacts: int
    """Number of impacts, kept or not."""


@dataclass
class _Parts:
    """What is solved of a stretch, as it comes."""

    summaries: list[tuple[Column, Table]] = field(default_factory=list)
    """Each with the points it is of (from 0 in the stretch)."""
    logged: list[Logged] = field(default_factory=list)


class Solver:
    """Solves stretches of a grid's points, in one thread.

    Parameters
    ----------
    grid
        The grid.
    engine
        ``"numba"``, or ``"python"``: every point by itself, interpreted. Both give the same bits.
    """

    def __init__(self, grid: Grid, engine: str = "numba") -> None:
        self._grid = grid
        self._engine = engine
        self._settings: OrderedDict[tuple[Any, ...], Setting] = OrderedDict()
        self._batches: OrderedDict[tuple[Any, ...], Batch] = OrderedDict()
        self._room = 0.0
        self._logs = LogSpace()
        self._reader = Reader(grid.base)
        self._indices: Column = np.zeros(0, dtype=np.int64)
        self._slow = [path for path in grid.design.paths if not is_quick(path)]

    def compile(self) -> None:
        """Make or load the machine code now."""
        two = len(self._grid.base.data.get("balls", ())) == 2
        Batch.compile(in_lanes=two and not self._grid.keep.collisions)

    def solve(self, indices: Column) -> Solved:
        """Solve some points, given by their numbers from 0."""
        self._indices = indices
        values = self._grid.design.columns(indices)
        parts = _Parts()
        for key, rows in self._groups(values, len(indices)):
            self._solve_group(key, rows, {path: values[path][rows] for path in values}, parts)
        summary = _in_order(parts.summaries, len(indices))
        impacts = summary["collisions"]
        return Solved(summary, parts.logged, int(np.ma.filled(impacts, 0).sum()))

    def _groups(
        self, values: dict[KeyPath, Column], count: int
    ) -> list[tuple[tuple[Any, ...], Column]]:
        """The points of each setting: what they have in common, and their rows."""
        if not self._slow:
            return [((), np.arange(count))]
        groups: dict[tuple[Any, ...], list[int]] = {}
        for row, key in enumerate(zip(*(values[p].tolist() for p in self._slow), strict=True)):
            groups.setdefault(key, []).append(row)
        return [(key, np.array(rows)) for key, rows in groups.items()]

    def _solve_group(
        self, key: tuple[Any, ...], rows: Column, values: dict[KeyPath, Column], parts: _Parts
    ) -> None:
        """Solve points of one setting."""
        if self._engine == "python":
            for at, row in enumerate(rows):
                self._solve_alone(row, self._reader.read(_row(values, at)), parts)
            return
        at = 0
        while key not in self._settings and at < len(rows):
            # The first point that is valid shows the setting.
            point = self._reader.read(_row(values, int(at)))
            if point.scenario is not None and point.system is not None:
                self._remember(key, Setting(point.scenario, point.system))
            else:
                self._solve_alone(rows[at], point, parts)
                at += 1
        if at < len(rows):
            self._settings.move_to_end(key)
            self._solve_setting(key, rows[at:], _taken(values, slice(at, None)), parts)

    def _remember(self, key: tuple[Any, ...], setting: Setting) -> None:
        self._settings[key] = setting
        while len(self._settings) > _READY:
            oldest, _ = self._settings.popitem(last=False)
            self._batches.pop(oldest, None)

    def _solve_setting(
        self, key: tuple[Any, ...], rows: Column, values: dict[KeyPath, Column], parts: _Parts
    ) -> None:
        """Solve points of a known setting: first all that are surely valid, then the others."""
        setting = self._settings[key]
        starts = setting.starts(values, len(rows))
        if starts.sure.any():
            self._solve_batch(key, starts.at(starts.sure), rows[starts.sure], parts)
        found: list[tuple[int, Point]] = []
        for at in np.flatnonzero(~starts.sure):
            point = self._reader.read(_row(values, int(at)))
            if point.system is None:
                self._solve_alone(rows[at], point, parts)
            else:
                found.append((rows[at], point))
        if found:
            read = setting.starts_of([point for _, point in found])
            self._solve_batch(key, read, np.array([row for row, _ in found]), parts)

    def _solve_batch(
        self, key: tuple[Any, ...], starts: Starts, rows: Column, parts: _Parts
    ) -> None:
        """Solve valid points of a setting with the compiled kernels."""
        setting = self._settings[key]
        if key not in self._batches:
            self._batches[key] = Batch(setting.system, next(iter(self._batches.values()), None))
        results = self._run(self._batches[key], starts)
        outcomes: Any = results.outcomes
        # What a batch leaves out: runs too long for its logs.
        whole = outcomes["end_cause"] != LOG_FULL
        if whole.any():
            self._take(setting, starts, rows, whole, results, self._batches[key].world, parts)
        for row in rows[~whole]:
            values = self._grid.design.columns(self._indices[[row]])
            self._solve_alone(row, self._reader.read(_row(values, 0)), parts)

    def _run(self, batch: Batch, starts: Starts) -> Results:
        count, bodies = starts.piece.shape
        stop_t = np.where(np.isnan(starts.stop_t), NEVER, starts.stop_t)
        most = np.where(starts.stop_collisions == 0, 2**62, starts.stop_collisions)
        points = make_points(
            stop_t, most, starts.piece, starts.s, starts.c, starts.p, starts.mass,
            starts.restitution,
        )  # fmt: skip
        # A little more room than the points before have needed.
        results = empty_results(count, bodies, 0)
        if self._grid.keep.collisions:
            rows = int(self._room * count) + _ROWS_AT_FIRST
            results = results._replace(impacts=self._logs.take(rows))
        results = batch.run_all(points, results)
        taken: Any = results.outcomes
        self._room = max(self._room, 1.1 * float(np.mean(taken["kept"])))
        return results

    def _take(
        self, setting: Setting, starts: Starts, rows: Column, whole: Column, results: Results,
        world: World, parts: _Parts,
    ) -> None:  # fmt: skip
        """Turn results of a batch into columns."""
        bodies = starts.piece.shape[1]
        places = Places(setting.system)
        every: Any = results.outcomes
        states: Any = results.finals
        outcomes, finals = every[whole], states.reshape(-1, bodies)[whole]
        restitution = starts.restitution[whole]
        table = summary_columns(places, restitution, outcomes, finals)
        parts.summaries.append((rows[whole], table))
        if not self._grid.keep.collisions:
            return
        # A point that is left out has no rows here.
        counts = every["kept"].copy()
        used = int(counts.sum())
        log: Any = results.impacts[:used]
        points, give_back = self._indices[rows], self._logs.keep(results.impacts, used)
        parts.logged.append(
            Logged(setting.system, world, self._engine, points, counts, log, starts.mass, give_back)
        )

    def _solve_alone(self, number: int, point: Point, parts: _Parts) -> None:
        """Solve one point by itself, or take down why it cannot be solved."""
        row = np.array([number])
        bodies = len(self._grid.base.data.get("balls", ()))
        if point.system is None or point.scenario is None:
            parts.summaries.append((row, not_solved("invalid", point.reason, bodies)))
            return
        stop = point.scenario.stop
        engine = "python" if self._engine == "python" else "auto"
        try:
            run = simulate_system(point.system, stop.time, stop.collisions, engine)
            summary = run.summary
        except (ArithmeticError, ValueError, IndexError, RuntimeError) as error:
            text = f"{type(error).__name__}: {error}"
            parts.summaries.append((row, not_solved("failed", text, bodies)))
            return
        parts.summaries.append((row, summary))
        if self._grid.keep.collisions:
            log = run.history()["impacts"]
            counts, points = np.array([len(log)]), self._indices[row]
            parts.logged.append(Logged(run.system, run.world, run.engine, points, counts, log))


def not_solved(status: str, reason: str | None, bodies: int) -> Table:
    """Return the summary of a point without a run."""
    table: Table = {}
    for column in summary(bodies).columns:
        if column.type == "string":
            table[column.name] = np.array([None], dtype=object)
        elif column.type == "int64":
            table[column.name] = np.ma.MaskedArray([0], mask=True)
        else:
            table[column.name] = np.array([np.nan])
    table["status"][0] = status
    table["reason"][0] = reason
    return table


def _taken(values: dict[KeyPath, Column], at: Any) -> dict[KeyPath, Column]:
    return {path: column[at] for path, column in values.items()}


def _row(values: dict[KeyPath, Column], at: int) -> dict[KeyPath, Any]:
    return {path: column[at] for path, column in values.items()}


def _in_order(parts: list[tuple[Column, Table]], count: int) -> Table:
    """One summary for all points, in their order."""
    rows = np.concatenate([rows for rows, _ in parts])
    order = np.empty(count, dtype=np.int64)
    order[rows] = np.arange(count)
    names = parts[0][1]
    return {name: _concatenated([table[name] for _, table in parts])[order] for name in names}


def _concatenated(columns: list[Any]) -> Any:
    if any(np.ma.isMaskedArray(column) for column in columns):
        return np.ma.concatenate(columns)  # type: ignore[no-untyped-call]
    return np.concatenate(columns)
