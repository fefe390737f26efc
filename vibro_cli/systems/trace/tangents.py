"""The tangent map of a run, stretch by stretch: how a small change of its start has grown.

Equations: docs/tangent.md. The state of a body is the way along the path of its centre (m) and its
speed (m/s); both are continuous at junctions.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibro_cli.compile import kernel as engine
from vibro_cli.compile.native import compiled
from vibro_cli.errors import VibroError
from vibro_cli.kernels.structs import Flight
from vibro_cli.kernels.tangent.follow import follow_tangents
from vibro_cli.kernels.tangent.impacts import WIDTH
from vibro_cli.kernels.tangent.world import SCALE, Tangents, TangentState
from vibro_cli.kernels.world import END_NAMES, RUNNING, ImpactRow, World
from vibro_cli.mechanics.system import System
from vibro_cli.systems.driver import Driver
from vibro_cli.systems.trace.event_loop import LOOP, TraceStretches
from vibro_cli.systems.trace.summary import with_logs
from vibro_cli.systems.trace.world import make_world

Floats = NDArray[np.float64]

# A number of the start is rounded by at most this share.
ROUNDING = 2.0**-53
# Into so many blocks a run is cut for the error of its exponents.
BLOCKS = 16


class NoTangents(VibroError, ValueError):
    """The tangent map of a system is not known; the message says of which."""


def time_scale(system: System) -> Any:
    """Time (s) by which speeds are compared with ways: that of a body's swing on the widest arc.

    On lines alone, that of a fall through ten of its radii. Of a system of arrays, an array.
    """
    body = system.bodies[0]
    arcs = [piece for piece in system.trace.pieces if not piece.is_line]
    length: Any = 10.0 * body.radius
    if arcs:
        length = np.max([piece.path_radius(body.radius) for piece in arcs], axis=0)
    return np.sqrt(body.kappa * length / system.gravity)


def room_for(
    size: int, impacts: int, times: bool, states: Any, from_start: bool = True
) -> Tangents:
    """Return what a tangent map is followed with: its size, and the impacts there is room for.

    Without ``from_start`` the growth of the frame is followed only.
    """
    floats = {
        "frame": (size, size), "product": (size if from_start else 0, size),
        "step": (size, size), "sums": (1, size),
        "arriving": (size // 2, 2), "delay": (1, size), "turning": (size // 2, WIDTH),
        "amplification": (1, impacts), "times": (impacts if times else 0, size),
        "growth": (impacts, size),
    }  # fmt: skip
    room: dict[str, Any] = {name: np.zeros(shape) for name, shape in floats.items()}
    whole = {"current": (1, size // 2), "smooth": (1, impacts)}
    room |= {name: np.zeros(shape, dtype=np.int64) for name, shape in whole.items()}
    return Tangents(state=states, **room)


@dataclass
class Growth:
    """What the vectors of an orthonormal frame have grown by, at impacts equally far apart.

    There are at most ``MOST`` of them: of more every second one is left out.
    """

    MOST = 256
    begin: float = 0.0
    """Of the run, s"""
    rows: list[tuple[int, float, Floats]] = field(default_factory=list)
    """Number of an impact (from 1), its time (s), and the sums of the logarithms until then"""
    end: tuple[float, Floats] | None = None
    """When the run ended (s), and the sums then"""
    _every: int = 1
    _told: int = 0

    def take(self, impacts: Any, growth: Floats) -> None:
        """Go on through some more impacts (rows of the solver's log)."""
        first = self._told + 1
        self._told += len(impacts)
        wanted = -(-first // self._every) * self._every
        while wanted <= self._told:
            row = wanted - first
            self.rows.append((wanted, float(impacts["t"][row]), growth[row].copy()))
            if len(self.rows) > self.MOST:
                self._every *= 2
                self.rows = [one for one in self.rows if one[0] % self._every == 0]
            wanted = (wanted // self._every + 1) * self._every

    def exponents(self, per_impact: bool = False) -> tuple[Floats, Floats]:
        """Exponents (1/s, or for one impact), the greatest first, and their standard errors.

        The run is cut into blocks of equal numbers of impacts, whose exponents are taken as
        independent of one another (batch means). NaN without impacts.
        """
        rows = [(number if per_impact else t, sums) for number, t, sums in self.rows]
        if rows:
            rows.insert(0, (0 if per_impact else self.begin, np.zeros_like(rows[0][1])))
        if self.end is not None and not per_impact:
            rows.append(self.end)
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
    """The tangent map of a run in progress.

    Parameters
    ----------
    system
        What is solved.
    times
        Whether derivatives of the impacts' times are wanted.

    Raises
    ------
    NoTangents
        For a trace that turns.
    """

    def __init__(self, system: System, times: bool = False) -> None:
        if system.turning is not None:
            raise NoTangents("found a trace that turns, expected one at rest for tangent maps")
        self.time_scale = float(time_scale(system))
        self.size = 2 * len(system.bodies)
        """Number of exponents: two for each body."""
        self.growth = Growth()
        self._times = times
        state = TangentState()
        state.time_scale = self.time_scale
        self._state: Any = [state]
        self._kept = room_for(self.size, 0, False, None)

    def take(
        self, world: World, known: int, cause: int, end: tuple[float, float]
    ) -> dict[str, Any]:
        """Go on through the logs of a world; arguments as of ``summary.Tally.take``.

        Returns
        -------
        ``amplification``, ``smooth`` and, if wanted, ``times`` (impact, 2 body + 0 or 1): the
        derivatives of the times of its impacts (s) to ways (m) and speeds (m/s) at the start.
        """
        room = room_for(self.size, len(world.impacts), self._times, None)
        kept = {name: getattr(self._kept, name) for name in ("frame", "product", "sums")}
        compiles = isinstance(world.log, np.ndarray)
        state = engine.compiled_rows(self._state, TangentState) if compiles else self._state
        tangents = room._replace(state=state, **kept)
        follow: Any = compiled(follow_tangents) if compiles else follow_tangents
        scratch: Any = np.zeros(1, dtype=engine.dtype(Flight)) if compiles else [Flight()]
        follow(world, known, cause, *end, tangents, scratch)
        if compiles:
            self._state = engine.interpreted_copies(state, TangentState)
        amplification: Any = tangents.amplification
        smooth: Any = tangents.smooth
        times: Any = tangents.times
        growth: Any = tangents.growth
        columns: dict[str, Any] = {"amplification": amplification[0], "smooth": smooth[0] != 0}
        if self._times:
            columns["times"] = times / self._units()
        told = world.impacts if compiles else engine.compiled_rows(world.impacts, ImpactRow)
        self.growth.begin = self._state[0].begin_t
        self.growth.take(told, growth)
        if cause != RUNNING:
            self.growth.end = end[0], self.sums
        return columns

    def _units(self) -> Floats:
        """What one unit of each component of a change is in m and m/s: its reciprocal scale."""
        return np.tile([1.0, 1.0 / self.time_scale], self.size // 2)

    def summary(self) -> dict[str, Any]:
        """Return the columns of a summary that tell of exponents, one row."""
        duration = self._state[0].end_t - self._state[0].begin_t
        return exponent_columns(np.asarray(self._kept.sums), np.array([duration]))

    @property
    def sums(self) -> Floats:
        """Logarithms of the growth of an orthonormal frame's vectors so far, in its order."""
        found: Floats = np.array(self._kept.sums)[0]
        return found

    def matrix(self) -> Floats:
        """The tangent map in ways (m) and speeds (m/s), after the end of a run at that instant."""
        units = self._units()
        exponent = round(math.log2(SCALE)) * int(self._state[0].scalings)
        with np.errstate(over="ignore"):
            found: Floats = np.ldexp(
                np.asarray(self._kept.frame) @ np.asarray(self._kept.product), exponent
            )
        return found * units[:, None] / units[None, :]


def grown_columns(grown: dict[str, Any], grazing: Any) -> dict[str, Any]:
    """Return ``amplification, digits_left, smooth`` of impacts, from :meth:`TangentMap.take`.

    NaN where nothing is known; beyond the greatest double no digit is left.
    """
    growth = grown["amplification"]
    digits = -np.log10(ROUNDING * np.maximum(growth, 1.0))
    return {
        "amplification": np.where(np.isfinite(growth), growth, np.nan),
        "digits_left": np.maximum(digits, 0.0),
        "smooth": grown["smooth"] & ~grazing,
    }


def exponent_columns(sums: Floats, durations: Floats) -> dict[str, Any]:
    """Return the columns of summaries that tell of exponents (1/s), the greatest first.

    Parameters
    ----------
    sums
        [run, direction] logarithms of the growth of a frame's vectors.
    durations
        [run] s.
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        rates = sums / durations[:, None]
    rates = -np.sort(-np.where(np.isfinite(rates), rates, np.nan), axis=1)
    return {f"lyapunov_{n + 1}": rates[:, n].copy() for n in range(sums.shape[1])}


def exponent_table(tangents: TangentMap) -> dict[str, Any]:
    """Return the columns of ``exponents.parquet``: exponents (1/s) of the run until its impacts."""
    growth = tangents.growth
    times = np.array([t for _, t, _ in growth.rows], dtype=np.float64)
    sums = np.array([sums for _, _, sums in growth.rows]).reshape(-1, tangents.size)
    columns: dict[str, Any] = {"n": np.array([n for n, _, _ in growth.rows], dtype=np.int64)}
    columns |= {"t": times} | exponent_columns(sums, times - growth.begin)
    errors = [
        Growth(growth.begin, growth.rows[: row + 1]).exponents()[1][0] for row in range(len(times))
    ]
    return columns | {"lyapunov_error": np.array(errors, dtype=np.float64)}


@dataclass(frozen=True)
class TangentRun:
    """The tangent map of a run that is over."""

    system: System
    end_cause: str
    end_time: float
    """s"""
    impacts: Any
    """The solver's own rows of impacts"""
    amplification: Floats
    smooth: NDArray[np.bool_]
    times: Floats
    """[impact, 2 body + 0 or 1]: derivatives of their times (s) to ways and speeds (m, m/s)"""
    matrix: Floats
    """Derivative of ways and speeds of all bodies at the end to those at the start"""
    sums: Floats
    """Logarithms of the growth of an orthonormal frame's vectors until the end"""
    growth: Growth
    flights: Any
    """The flight that each body is in at the end: rows of the solver's log"""


def follow_system(
    system: System,
    stop_time: float | None,
    stop_collisions: int | None,
    engine_name: str = "compiled",
) -> TangentRun:
    """Solve a system and its tangent map; arguments as of ``systems.trace.run.simulate_system``."""
    driver = Driver(LOOP, make_world(system, stop_time, stop_collisions), engine_name)
    stretches = TraceStretches(LOOP, driver, stop_time)
    tangents = TangentMap(system, times=True)
    own = make_world(system, None, None)
    found: list[dict[str, Any]] = []
    for stretch in stretches:
        world = with_logs(own, stretch.engine, stretch.logs, stretch.clock)
        last = tangents.take(world, stretch.known, stretch.cause, stretch.end)
        if len(last["smooth"]):
            found.append(last | {"impacts": stretch.logs["impacts"]})
        end = stretch.end[0]
    size = 2 * len(system.bodies)
    empty = last | {"impacts": stretch.logs["impacts"][:0], "times": np.empty((0, size))}
    joined = {name: np.concatenate([one[name] for one in found or [empty]]) for name in empty}
    return TangentRun(
        system=system,
        end_cause=END_NAMES[stretches.cause],
        end_time=end,
        matrix=tangents.matrix(),
        sums=tangents.sums,
        growth=tangents.growth,
        flights=stretches.under_way,
        **joined,
    )
