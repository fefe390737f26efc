"""Tangent maps: the growth of small perturbations of the start of a run, for all systems.

Equations: docs/tangent.md. A kernel of the system carries tangent vectors through the logs of its
event loop. This module provides its workspace and makes columns from its results.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from vibro_cli.kernels.tangent.frame import SCALE, SERIES_ROWS, TERMS, WIDTH, Tangents, TangentState
from vibro_cli.kernels.world import RUNNING
from vibro_cli.numerics import elementwise
from vibro_cli.numerics.elementwise import Floats
from vibro_cli.systems.columns import MOST_EXPONENTS
from vibro_cli.systems.contract import Columns, System
from vibro_cli.systems.driver import called, with_logs, zeros
from vibro_cli.systems.request import NO_LIMITS, Limits
from vibro_cli.systems.run import Run, Stretch, begun

# Relative rounding error of a double, root mean square over significands; at most twice as much.
ROUNDING = 2.0**-54
MOST_DIGITS = 15.95  # of a double
# Number of blocks of a run for the standard errors of its exponents.
BLOCKS = 16


def room_for(
    size: int, impacts: int, times: bool, states: Any, from_start: bool = True
) -> Tangents:
    """Allocate the workspace of a tangent map with `size` numbers and room for `impacts` impacts.

    Without ``from_start`` only the growth of the frame is followed.
    """
    # Upper bound of the pairs that collide at once. Bodies in a row have two numbers each, and
    # fewer pairs than bodies; balls on a plane have four, and at most eight pairs each
    # (`most_touches` of the table).
    pairs = 2 * size
    floats = {
        "frame": (size, size), "product": (size if from_start else 0, size),
        "step": (size, size), "sums": (1, size),
        "arriving": (size // 2, 2), "delay": (size // 2, size),
        "turning": (pairs, WIDTH),
        "amplification": (1, impacts), "times": (impacts if times else 0, size),
        "growth": (impacts, size), "series": (SERIES_ROWS + size // 2, TERMS + 1),
    }  # fmt: skip
    room: dict[str, Any] = {name: np.zeros(shape) for name, shape in floats.items()}
    whole = {"current": (2, size // 2), "smooth": (1, impacts)}
    room |= {name: np.zeros(shape, dtype=np.int64) for name, shape in whole.items()}
    return Tangents(state=states, **room)


@dataclass
class Growth:
    """Growth of the vectors of an orthonormal frame, recorded at every n-th impact.

    At most ``MOST`` rows are kept; beyond that, n doubles and every second row is dropped.
    """

    MOST = MOST_EXPONENTS
    begin: float = 0.0
    """Start of the run (s)."""
    rows: list[tuple[int, float, Floats]] = field(default_factory=list)
    """Number of an impact (from 1), its time (s), and the sums of the logarithms until then."""
    end: tuple[float, Floats] | None = None
    """End of the run (s), and the sums at that time."""
    _every: int = 1
    _impacts: int = 0

    def take(self, times: Any, growth: Floats) -> None:
        """Add further impacts at these times (s), with the sums of logarithms at each."""
        first = self._impacts + 1
        self._impacts += len(times)
        wanted = -(-first // self._every) * self._every
        while wanted <= self._impacts:
            row = wanted - first
            self.rows.append((wanted, float(times[row]), growth[row].copy()))
            if len(self.rows) > self.MOST:
                self._every *= 2
                self.rows = [one for one in self.rows if one[0] % self._every == 0]
            wanted = (wanted // self._every + 1) * self._every

    def exponents(self, per_impact: bool = False) -> tuple[Floats, Floats]:
        """Return exponents (1/s, or per impact), the greatest first, and their standard errors.

        The run is divided into blocks of equal numbers of impacts, whose exponents are taken as
        independent (batch means). NaN without impacts.
        """
        rows = [(number if per_impact else t, sums) for number, t, sums in self.rows]
        if rows:
            rows.insert(0, (0 if per_impact else self.begin, np.zeros_like(rows[0][1])))
            if self.end is not None and not per_impact and self.end[0] > rows[-1][0]:
                rows.append(self.end)  # a run may end with its last impact
        size = len(rows[0][1]) if rows else 0
        if len(rows) < 2 or rows[-1][0] == rows[0][0]:
            return np.full(size, np.nan), np.full(size, np.nan)
        blocks = min(BLOCKS, len(rows) - 1)
        places = np.linspace(0, len(rows) - 1, blocks + 1).astype(int)
        sums = np.array([rows[place][1] for place in places])
        clock = np.array([rows[place][0] for place in places])
        with np.errstate(invalid="ignore", divide="ignore"):
            rates = np.diff(sums, axis=0) / np.diff(clock)[:, None]
            mean = (sums[-1] - sums[0]) / (clock[-1] - clock[0])
            error = (
                np.std(rates, axis=0, ddof=1) / math.sqrt(blocks) if blocks > 1 else mean * np.nan
            )
        order = np.argsort(-np.where(np.isnan(mean), -np.inf, mean), kind="stable")
        error = np.where(np.isfinite(error), error, np.nan)
        return mean[order], error[order]


class TangentMap:
    """The tangent map of a run in progress, computed by the kernel ``follow`` of the system's loop.

    Speeds times ``time_scale`` (s) are comparable with displacements. With `times`, the derivatives
    of the times of impacts are computed too.
    """

    def __init__(self, kind: System, system: Any, times: bool = False) -> None:
        self._loop, self._overrides = kind.loop, kind.overrides(system)
        self._impacts = {table: kind.impact_log(table) for table in kind.impact_tables}
        self._world = kind.world(system, NO_LIMITS)
        self._known = 0
        self.time_scale = float(kind.time_scale(system))
        self._numbers = kind.exponents
        """Dimension of a body's state: displacements (m), then as many speeds (m/s)."""
        self.size = self._numbers * len(system.bodies)
        """Number of exponents."""
        self.growth = Growth()
        self._times = times
        self._state = zeros(1, TangentState)
        self._state["time_scale"] = self.time_scale
        self._kept = room_for(self.size, 0, False, self._state)

    def take(self, stretch: Stretch) -> dict[str, Columns]:
        """Follow a stretch; return ``amplification`` and ``smooth`` of its impacts, by table.

        With `times` also ``times`` ([impact, number]): the derivatives of the times (s) of these
        impacts with respect to displacements (m) and speeds (m/s) at the start. The impacts of
        several logs are followed in the order of their events.
        """
        parts = {table: stretch.logs[log] for table, log in self._impacts.items()}
        instants = np.concatenate([part["t"] for part in parts.values()])
        order = np.arange(len(instants))
        if len(parts) > 1:
            events = np.concatenate([part["event"] for part in parts.values()])
            order = np.argsort(events, kind="stable")
        columns = self._followed(stretch, instants[order])
        found = {name: np.empty_like(values) for name, values in columns.items()}
        for name, values in columns.items():
            found[name][order] = values
        ends = np.cumsum([len(part) for part in parts.values()])[:-1]
        split = {name: np.split(values, ends) for name, values in found.items()}
        return {
            table: {name: values[number] for name, values in split.items()}
            for number, table in enumerate(parts)
        }

    def _followed(self, stretch: Stretch, instants: Any) -> Columns:
        """Follow a stretch whose impacts are at instants (s); return their columns in order."""
        self._world = with_logs(self._loop, self._world, stretch.engine, stretch.logs)
        kept = {name: getattr(self._kept, name) for name in ("frame", "product", "sums")}
        room = room_for(self.size, len(instants), self._times, self._state)
        room = room._replace(**kept)
        end, known = stretch.end, max(self._known, stretch.known)
        of_stretch = self._world, known, stretch.cause, *end, room
        scratch = (zeros(1, record) for record in self._loop.scratch)
        called(self._loop.follow, self._overrides, *of_stretch, *scratch)
        self._known = 1
        amplification, smooth, growth, times = map(
            np.asarray, (room.amplification, room.smooth, room.growth, room.times)
        )
        self.growth.begin = float(self._state["begin_t"][0])
        self.growth.take(instants, growth)
        if stretch.cause != RUNNING:
            self.growth.end = end[0], self.sums
        columns = {"amplification": amplification[0], "smooth": smooth[0] != 0}
        return columns | {"times": times / self.units} if self._times else columns

    @property
    def units(self) -> Floats:
        """Unit of each number of the state, in m or m/s."""
        half = self._numbers // 2
        one = np.repeat([1.0, 1.0 / self.time_scale], half)
        return np.tile(one, self.size // self._numbers)

    def summary(self) -> dict[str, Any]:
        """Return the columns of exponents of a summary, one row."""
        duration = self._state["end_t"] - self._state["begin_t"]
        return exponent_columns(np.asarray(self._kept.sums), duration)

    @property
    def error(self) -> float:
        """Standard error of the greatest exponent (1/s); NaN if there are too few impacts."""
        errors = self.growth.exponents()[1]
        return float(errors[0]) if len(errors) else math.nan

    @property
    def sums(self) -> Floats:
        """Logarithms of the growth so far of the frame's vectors, in the order of the frame."""
        found: Floats = np.array(self._kept.sums)[0]
        return found

    def matrix(self) -> Floats:
        """Return the tangent map from start to end of a run, in m (displacements) and m/s."""
        units = self.units
        exponent = round(math.log2(SCALE)) * int(self._state["scalings"][0])
        with np.errstate(over="ignore", invalid="ignore"):
            found: Floats = np.ldexp(
                np.asarray(self._kept.frame) @ np.asarray(self._kept.product), exponent
            )
        return found * units[:, None] / units[None, :]


def followed(
    kind: System, system: Any, limits: Limits, engine_name: str = "compiled", times: bool = False
) -> tuple[TangentMap, dict[str, Columns], Stretch]:
    """Return the tangent map of a whole run, the columns of its impacts by table, and the run.

    Raises as ``systems.run.begun``.
    """
    whole, _ = begun(kind, system, limits, engine_name).whole()
    found = TangentMap(kind, system, times)
    return found, found.take(whole), whole


def matrix_of(run: Run) -> tuple[Floats, bool]:
    """Return the tangent map of a whole run, in displacements (m) and speeds (m/s).

    Also return whether it is the derivative of the motion: at some impacts there is none.
    """
    found = TangentMap(run.kind, run.system)
    tables = found.take(run.whole).values()
    return found.matrix(), all(bool(np.all(one["smooth"])) for one in tables)


def grown_columns(grown: dict[str, Any], grazing: Any) -> dict[str, Any]:
    """Return ``amplification, digits_left, smooth`` of impacts, from :meth:`TangentMap.take`.

    NaN where unknown. An amplification beyond the greatest double is NaN too, and leaves no digit.
    """
    growth = grown["amplification"]
    digits = -elementwise.each(math.log10, ROUNDING * np.maximum(growth, 1.0))
    return {
        "amplification": np.where(np.isfinite(growth), growth, np.nan),
        "digits_left": np.clip(digits, 0.0, MOST_DIGITS),
        "smooth": grown["smooth"] & ~grazing,
    }


def exponent_columns(sums: Floats, durations: Floats) -> dict[str, Any]:
    """Return the columns of exponents (1/s) of summaries, the greatest first.

    `sums` are the logarithms [run, direction] of the growth of a frame's vectors, `durations` those
    of the runs (s).
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        rates = sums / durations[:, None]
    rates = -np.sort(-np.where(np.isfinite(rates), rates, np.nan), axis=1)
    return {f"lyapunov_{n + 1}": rates[:, n].copy() for n in range(sums.shape[1])}


def exponent_table(tangents: TangentMap) -> dict[str, Any]:
    """Return the columns of ``exponents.parquet``: exponents (1/s) up to each recorded impact."""
    growth = tangents.growth
    times = np.array([t for _, t, _ in growth.rows], dtype=np.float64)
    sums = np.array([sums for _, _, sums in growth.rows]).reshape(-1, tangents.size)
    columns: dict[str, Any] = {"n": np.array([n for n, _, _ in growth.rows], dtype=np.int64)}
    columns |= {"t": times} | exponent_columns(sums, times - growth.begin)
    errors = [
        Growth(growth.begin, growth.rows[: row + 1]).exponents()[1][0] for row in range(len(times))
    ]
    return columns | {"lyapunov_error": np.array(errors, dtype=np.float64)}
