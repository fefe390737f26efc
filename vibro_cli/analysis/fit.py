"""Fit parameters of a scenario to measured times of impacts: least squares with exact derivatives.

The sum of squares of ``(T_n(p) - t_n)/sigma_n`` over the measured impacts is minimised by the
trust-region method of ``scipy.optimize.least_squares``, with the derivatives of
``analysis.impact_times``. Fits use the first impacts, then twice as many and so on, so that the
initial values need to be good for the first impacts only. The covariance of the parameters is
``(J^T J)^-1`` at the solution, times the variance of the residuals if the noise is unknown. If the
start of the motion is not 0 on the clock of the measurements, it is a parameter, ``START_TIME``,
with ``T_n(p)`` later by as much.

Measured times come from a file or from a table in Python.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr
from scipy.optimize import least_squares
from scipy.special import chdtrc, chdtri, fdtri, stdtrit

from vibro_cli.analysis.event_words import by_body
from vibro_cli.analysis.impact_times import ImpactTimes, NoDerivative, impact_times, number_at
from vibro_cli.assemble import build_system
from vibro_cli.errors import VibroError, counted, exhausted, listing
from vibro_cli.kernels.numerics.constants import EPSILON
from vibro_cli.numerics.elementwise import Floats, outside
from vibro_cli.progress import WORK
from vibro_cli.scenario.fields import unit_at, written
from vibro_cli.scenario.models import Scenario
from vibro_cli.scenario.problems import (
    KeyPath,
    ScenarioError,
    parsed_path,
    path_text,
    shown,
)

_BODIES = ("ball_a", "ball_b")
COLUMNS = ("t", "n", "error", *_BODIES)
START_TIME = "start_time"
"""Stands for the path of the time (s) at which the motion starts on the measurements' clock."""
_DOUBTFUL = 1.0e-6
"""Likelihood below which a fit is doubtful."""
_NAMED = 6
"""Number of columns of a table without times that its message names."""


class NotMeasured(VibroError, ValueError):
    """A table without valid times of impacts; the message says which row and why."""


@dataclass(frozen=True)
class Measured:
    """Measured times of impacts."""

    number: NDArray[np.int64]
    """Number of each impact in the motion, from 1."""
    t: Floats
    """Times (s)."""
    error: Floats | None = None
    """Standard deviation of each time (s)."""
    pairs: NDArray[np.int64] | None = None
    """[row, 2] numbers of the bodies, from 1, if known."""


def read_measured(file: str | Path, from_start: bool = True) -> Measured:
    """Return the measured times in a CSV or Parquet file, distinguished by its suffix.

    Arguments as for :func:`measured_of`; the ``collisions.parquet`` of a run is such a file. Raises
    `NotMeasured` with the file, the row and what was expected, `OSError` if it cannot be read.
    """
    import pyarrow as pa

    from vibro_cli.storage.frame import cell, read_table

    path = Path(file)
    try:
        table = read_table(path)
    except pa.ArrowException as error:
        if exhausted(error):
            raise
        why = " ".join(str(error).split())
        if why.startswith("CSV parse error"):
            why += "; expected fields separated by commas, and . as decimal point"
        raise NotMeasured(f"{path}: cannot be read as a table: {why}") from error
    read = cell if path.suffix.lower() == ".csv" else lambda value: value
    try:
        _check_times(table.column_names)
        return measured_of(
            {
                name: [*map(read, table[name].to_pylist())]
                for name in COLUMNS
                if name in table.column_names
            },
            from_start,
        )
    except NotMeasured as error:
        raise NotMeasured(f"{path}: {error}") from error


def measured_of(columns: Mapping[str, Any], from_start: bool = True) -> Measured:
    """Return the measured times in a table.

    `columns` are ``t``, ascending times (s), and optionally ``n``, the number of each impact from
    1, if not all were measured; ``error``, the standard deviation of each time (s); ``ball_a`` and
    ``ball_b``, the numbers of the bodies from 1. `from_start` tells whether times count from the
    start of the motion, so that they are greater than 0. Raises `NotMeasured` with the row and what
    was expected.
    """
    _check_times(columns)
    t = _numbers(columns, "t")
    if not len(t):
        raise NotMeasured("found no rows, expected the times of impacts (s)")
    if from_start:
        expected = f"a time after the start, greater than 0, or {START_TIME} among the parameters"
        _check(t > 0.0, t, "t", expected)
    _check_growing(t, "t")
    number = np.arange(1, len(t) + 1)
    if "n" in columns:
        number = _counts(columns, "n")
        _check_growing(number, "n")
    error = None
    if "error" in columns:
        error = _numbers(columns, "error")
        _check(error > 0.0, error, "error", "a standard deviation (s), greater than 0")
    bodies = {name: _counts(columns, name) for name in _BODIES if name in columns}
    if len(bodies) == 1:
        raise NotMeasured(
            f"found {next(iter(bodies))} alone, expected both {' and '.join(_BODIES)}"
        )
    others = [column for column in (number, error, *bodies.values()) if column is not None]
    if any(len(column) != len(t) for column in others):
        raise NotMeasured("found columns of unequal lengths, expected a row for each impact")
    pairs = np.stack(list(bodies.values()), axis=1) if bodies else None
    return Measured(number, t, error, pairs)


def _check_times(names: Iterable[str]) -> None:
    """Raise `NotMeasured` unless there is a column of times among these."""
    given = list(map(str, names))
    if "t" not in given:
        names = listing(map(shown, given[:_NAMED]), "and") or "none"
        raise NotMeasured(f"found no column 't' but {names}, expected the times of impacts (s)")


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float, np.number)) and not isinstance(value, bool)


def _numbers(columns: Mapping[str, Any], name: str) -> Floats:
    found = []
    column = columns[name]
    no_rows = not hasattr(column, "__iter__") or getattr(column, "shape", None) == ()
    if isinstance(column, (str, bytes)) or no_rows:
        raise NotMeasured(f"{name}: found {column!r}, expected a column of numbers")
    for row, entry in enumerate(column, 1):
        # A float32 cannot be compared with the greatest double.
        value = entry.item() if isinstance(entry, np.number) else entry
        if not _is_number(value) or not abs(value) <= sys.float_info.max:
            raise NotMeasured(f"row {row}: {name}: found {entry!r}, expected a number")
        found.append(float(value))
    return np.array(found, dtype=np.float64)


def _counts(columns: Mapping[str, Any], name: str) -> NDArray[np.int64]:
    values = _numbers(columns, name)
    whole = (values >= 1.0) & (values == np.round(values)) & (values < 2.0**63)
    _check(whole, values, name, "a whole number from 1")
    return values.astype(np.int64)


def _check(right: Any, values: Any, name: str, expected: str) -> None:
    wrong = np.flatnonzero(~right)
    if len(wrong):
        row = int(wrong[0])
        raise NotMeasured(f"row {row + 1}: {name}: found {values[row]:g}, expected {expected}")


def _check_growing(values: Any, name: str) -> None:
    right = np.concatenate([[True], values[1:] > values[:-1]])
    _check(right, values, name, "one greater than in the row before")


# Computed impacts may occur up to this many times later than measured.
PATIENCE = 10.0
# Relative singular values of the normalised Jacobian below this are rounding.
LEAST_INDEPENDENT = 1.0e-9
# Relative step, and relative change of the sum of squares, at convergence.
TOLERANCE = 1.0e-12
# Greatest noise of a time (s): squares of derivatives divided by a greater one underflow.
MOST_NOISE = 1.0e100
CONFIDENCE = 0.95


class NoFit(VibroError, ValueError):
    """Numbers cannot be fitted to these times; the message says why."""


@dataclass(frozen=True)
class Free:
    """A number to be fitted."""

    path: KeyPath
    low: float = -math.inf
    high: float = math.inf

    @staticmethod
    def of(path: str, low: float = -math.inf, high: float = math.inf) -> Free:
        """Return a number given by its path, such as ``balls[1].mass``, or ``START_TIME``.

        Raises ``ValueError`` if the text is not a path or the bounds leave no interval.
        """
        if not (_is_number(low) and _is_number(high) and low < high):
            raise ValueError(f"{path}: found {low!r} to {high!r}, expected ascending bounds")
        found = Free(parsed_path(path), low, high)
        if not found.bounds[0] < found.bounds[1]:
            raise ValueError(
                f"{path}: found {low!r} to {high!r}, expected bounds that overlap the range 0 to 1"
            )
        return found

    @property
    def name(self) -> str:
        """Path as text."""
        return path_text(self.path)

    @property
    def is_start_time(self) -> bool:
        """Whether this is the time of the start, not a number of the scenario."""
        return self.name == START_TIME

    @property
    def unit(self) -> str:
        """Unit of the number, empty for a ratio."""
        return "s" if self.is_start_time else written(unit_at(self.path, Scenario))

    def with_unit(self, text: str) -> str:
        """Return a text with the unit after it, if there is one."""
        return f"{text} {self.unit}".rstrip()

    @property
    def bounds(self) -> tuple[float, float]:
        """Bounds; those of a coefficient of restitution are limited to 0 and 1, inclusive."""
        if self.path[:2] == ("collision", "k") or self.path[-1] == "wall":
            return max(self.low, 0.0), min(self.high, 1.0)
        return self.low, self.high


def has_start_time(free: Iterable[Free]) -> bool:
    """Whether the time of the start is among the numbers to be fitted."""
    return any(one.is_start_time for one in free)


@dataclass(frozen=True)
class Fit:
    """Fitted parameters and their uncertainty."""

    scenario: Scenario
    """Scenario with the fitted parameters."""
    free: tuple[Free, ...]
    start: Floats
    """Initial values of the parameters."""
    values: Floats
    """Fitted values, in SI units."""
    covariance: Floats
    measured: Measured
    first: Floats
    """[row] initial residuals, measured minus computed times (s); NaN for impacts not computed."""
    residuals: Floats
    """[row] residuals, measured minus computed times (s)."""
    noise: Floats
    """[row] standard deviation of the times (s), given or estimated from the residuals."""
    noise_known: bool
    word: tuple[str, ...]
    """Sequence of events up to the last measured impact, see ``ImpactTimes``."""
    same_events: bool
    """Whether this sequence holds in the confidence region; else the errors assume it."""
    evaluations: int

    def __repr__(self) -> str:
        numbers = zip(self.free, self.values, self.errors, strict=True)
        texts = [f"{one.name} = {value:.10g} ± {error:.2g}" for one, value, error in numbers]
        doubt = f"; warning: {self.doubt}" if self.doubt else ""
        return f"<Fit {self.scenario.name}: {', '.join(texts)}{doubt}>"

    @property
    def errors(self) -> Floats:
        """Standard errors."""
        found: Floats = np.sqrt(np.diag(self.covariance))
        return found

    @property
    def correlation(self) -> Floats:
        """Correlation matrix of the parameters."""
        found: Floats = self.covariance / np.outer(self.errors, self.errors)
        np.fill_diagonal(found, 1.0)  # rounding gives 1.0000000000000002
        return found

    @property
    def freedom(self) -> int:
        """Degrees of freedom: number of times minus number of fitted parameters."""
        return len(self.residuals) - len(self.free)

    @property
    def interval(self) -> Floats:
        """[number, end] of the 95 % confidence intervals."""
        level = 0.5 + 0.5 * CONFIDENCE
        width = stdtrit(math.inf if self.noise_known else self.freedom, level) * self.errors
        return np.stack([self.values - width, self.values + width], axis=1)

    @property
    def chi_square(self) -> float:
        """Sum of squares of the residuals, each divided by its noise."""
        return float(np.sum((self.residuals / self.noise) ** 2))

    @property
    def likelihood(self) -> float | None:
        """Probability of a sum of squares at least as large; None if the noise is unknown."""
        if not self.noise_known or self.freedom < 1:
            return None
        return float(chdtrc(self.freedom, self.chi_square))

    @property
    def misplaced(self) -> int:
        """Number of computed times that are nearer to another measured impact than to their own.

        If the bodies are known, only impacts of the same ones count.
        """
        pairs, groups, found = self.measured.pairs, np.zeros(len(self.residuals), dtype=int), 0
        if pairs is not None:
            groups = np.unique(np.sort(pairs, axis=1), axis=0, return_inverse=True)[1].ravel()
        for group in np.unique(groups):
            measured = self.measured.t[groups == group]
            middles = 0.5 * (measured[1:] + measured[:-1])
            nearest = np.searchsorted(middles, measured - self.residuals[groups == group])
            found += int(np.sum(nearest != np.arange(len(measured))))
        return found

    @property
    def doubt(self) -> str:
        """Why values and errors cannot be trusted; empty if there is no reason."""
        if self.likelihood is not None and self.likelihood < _DOUBTFUL:
            return (
                "model or noise is wrong, impacts missed or counted twice (give n), or this is not "
                "the lowest minimum (fit fewer, then all from there)"
            )
        if self.likelihood is not None or not self.misplaced:
            return ""
        clock = "seconds from the start of the motion (fit start_time)"
        if has_start_time(self.free):
            clock = "seconds"
        return (
            f"{self.misplaced} of {len(self.residuals)} computed impacts are nearer to another "
            "measured one than to their own: this is a wrong minimum, impacts were missed or "
            f"counted twice (give n), or the times are not in {clock}"
        )


def fit_impacts(
    scenario: Scenario, measured: Measured, free: Sequence[Free], noise: float | None = None
) -> Fit:
    """Fit parameters of a scenario of a trace at rest to measured times of its impacts.

    The scenario has the initial values; its ``stop`` is ignored. `free` are the numbers to fit and
    their bounds. `noise` is the standard deviation (s) of the times, unless they have their own; by
    default it is estimated from the residuals. Raises `NoFit` if there are fewer times than
    parameters, if the motion lacks a measured impact, if the times do not determine a parameter or
    all parameters independently, or without convergence; `ValueError` if the noise is not greater
    than 0.
    """
    if noise is not None and not (_is_number(noise) and 0.0 < noise < math.inf):
        raise ValueError(f"noise: found {noise!r}, expected seconds, greater than 0")
    problem = _Problem(scenario, measured, tuple(free), noise)
    problem.check()
    start = problem.values_at_start()
    first = problem.first_residuals(start)
    values = start
    for rows in problem.stages():
        values = problem.solved(values, rows)
    return problem.result(start, first, values)


def _independent(jacobian: Floats) -> NDArray[np.int64]:
    """Return the indices of parameters that the times determine independently, by pivoted QR."""
    sizes = np.linalg.norm(jacobian, axis=0)
    shown = np.flatnonzero(sizes > 0.0)
    if not len(shown):
        return shown
    upper, order = qr(jacobian[:, shown] / sizes[shown], mode="r", pivoting=True)
    shares = np.abs(np.diag(upper))
    determined = shares >= LEAST_INDEPENDENT * shares[0]
    return np.sort(shown[order[: len(shares)][determined]])


class _Problem:
    def __init__(
        self, scenario: Scenario, measured: Measured, free: tuple[Free, ...], noise: float | None
    ) -> None:
        self._scenario, self._measured, self._free = scenario, measured, free
        self._known = noise is not None or measured.error is not None
        self._noise = np.full(len(measured.t), 1.0 if noise is None else float(noise))
        if measured.error is not None:
            self._noise = measured.error
        self._clock = np.array([one.is_start_time for one in free], dtype=bool)
        # The solver's values are differences from these: as a start_time may be of any size, it is
        # the difference from the first guess.
        self._origin = np.zeros(len(free))
        self._last: tuple[tuple[Any, ...], ImpactTimes] | None = None
        self.evaluations = 0

    @property
    def _t(self) -> Floats:
        """Measured times (s) from the start of the motion, or from the first guess of it."""
        found: Floats = self._measured.t - self._origin[self._clock].sum()
        return found

    @property
    def _bounds(self) -> Floats:
        """[end, number] of the bounds of the solver's values."""
        found: Floats = np.array([one.bounds for one in self._free]).T - self._origin
        return found

    def check(self) -> None:
        """Raise ``NoFit`` for faults that are known without solving anything."""
        rows, free = len(self._measured.t), len(self._free)
        if len(self._scenario.balls) == 1:
            raise NoFit("found one body, expected two or more: impacts on walls are not fitted")
        rounding = EPSILON * np.abs(self._measured.t)
        lost = np.flatnonzero(self._noise < rounding)
        if self._known and len(lost):
            row, least = lost[0], rounding[lost[0]]
            raise NoFit(
                f"impact {self._measured.number[row]}: found a noise of {self._noise[row]:.2g} s, "
                f"expected no less than the rounding of its time, {least:.2g} s"
            )
        row = int(np.argmax(self._noise))
        if self._noise[row] > MOST_NOISE:
            raise NoFit(
                f"impact {self._measured.number[row]}: found a noise of {self._noise[row]:.2g} s, "
                f"expected at most {MOST_NOISE:.0e} s"
            )
        if not free:
            raise NoFit("found no free parameter, expected one or more")
        names = [one.name for one in self._free]
        for name in names:
            if names.count(name) > 1:
                raise NoFit(f"{name}: found {names.count(name)} times among the free parameters")
        if rows < free + (not self._known):
            least = f"{free + 1} or more, as their noise is not known" if rows == free else free
            times, parameters = counted(rows, "measured time"), counted(free, "free parameter")
            raise NoFit(f"found {times} for {parameters}, expected {least}")

    def values_at_start(self) -> Floats:
        """Return the values in the scenario, and the start time that gives the first impact."""
        found = np.zeros(len(self._free))
        for n, one in enumerate(self._free):
            if one.is_start_time:
                continue
            try:
                found[n] = number_at(self._scenario, one.path, START_TIME)
            except NoDerivative as error:
                raise NoFit(str(error)) from error
            if not one.low <= found[n] <= one.high:
                value = one.with_unit(f"{found[n]:g}")
                ends = one.with_unit(f"{one.low:g} to {one.high:g}")
                raise NoFit(
                    f"{one.name}: found {value} in the scenario, expected a number from {ends}"
                )
        if np.any(self._clock):
            first = int(self._measured.number[0])
            guess = self._measured.t[0] - self._impacts(found, first, None).t[first - 1]
            self._origin = np.where(self._clock, guess, 0.0)
            found[self._clock] = np.clip(0.0, *self._bounds[:, self._clock])
        return found

    def stages(self) -> list[int]:
        """Return the numbers of rows to fit in successive stages."""
        rows, found = 2 * len(self._free) + 2, []
        while rows < len(self._measured.t):
            found.append(rows)
            rows *= 2
        return [*found, len(self._measured.t)]

    def changed(self, values: Floats) -> Scenario:
        pairs = zip(self._free, values, strict=True)
        numbers = {one.name: float(value) for one, value in pairs if not one.is_start_time}
        return self._scenario.replace(numbers)

    def motion(self, values: Floats, rows: int) -> ImpactTimes:
        """Return the computed impacts of the first `rows` rows.

        Raises ``NoFit`` if the motion lacks some of them or has no derivative.
        """
        key = (rows, *values[~self._clock])
        if self._last is not None and self._last[0] == key:
            return self._last[1]
        count, stop_time = int(self._measured.number[rows - 1]), PATIENCE * float(self._t[rows - 1])
        found = self._impacts(values, count, stop_time)
        places, more = self._places(found, rows), 0
        while len(lacking := np.flatnonzero(places >= len(found.t))):
            before, more = found, max(len(lacking), 2 * more)
            with suppress(NoFit):
                found = self._computed(values, len(before.t) + more, stop_time)
            if len(found.t) == len(before.t):  # the motion ends, or its derivative, without them
                raise self._of_others(lacking[0], found.pairs[lacking[0]])
            places = self._places(found, rows)
        parts = {name: getattr(found, name)[places] for name in ("t", "pairs", "derivative")}
        self._last = key, replace(found, **parts)
        return self._last[1]

    def _places(self, found: ImpactTimes, rows: int) -> NDArray[np.int64]:
        """Return the indices of the measured impacts in the motion, its length for those beyond.

        Impacts without a common body may change their order. So if none was missed, they are the
        first, second ... impacts of their bodies. Raises ``NoFit`` if those are of other bodies.
        """
        numbers, theirs = self._measured.number[:rows], self._measured.pairs
        if theirs is None:
            return numbers - 1
        if np.max(theirs) > len(self._scenario.balls) or numbers[-1] != rows:
            self._check_pairs(found.pairs[numbers - 1], theirs[:rows])
            return numbers - 1
        theirs = theirs[:rows]
        places = np.zeros((rows, 2), dtype=np.int64)
        for body in np.unique(theirs):
            own, ours = theirs == body, np.flatnonzero(np.any(found.pairs == body, axis=1))
            beyond = np.full(rows, len(found.t))
            places[own] = np.concatenate([ours, beyond])[: np.sum(own)]
        other = np.flatnonzero(places[:, 0] != places[:, 1])
        if len(other):
            raise self._of_others(other[0], found.pairs[np.min(places[other[0]])])
        return places[:, 0]

    def _impacts(self, values: Floats, count: int, stop_time: float | None) -> ImpactTimes:
        """Return so many impacts; raise ``NoFit`` if some are lacking or have no derivative."""
        found = self._computed(values, count, stop_time)
        if len(found.t) < count:
            raise NoFit(
                f"found {counted(len(found.t), 'impact')} in the motion, which then ends "
                f"({found.end_cause.replace('_', ' ')}), expected {count}, as measured"
            )
        return found

    def _computed(self, values: Floats, count: int, stop_time: float | None) -> ImpactTimes:
        """Return up to so many impacts; raise ``NoFit`` if one has no derivative."""
        self.evaluations += 1
        WORK.report(f"motion {self.evaluations}, up to impact {count:,}")
        paths = [one.path for one in self._free if not one.is_start_time]
        try:
            scenario = self.changed(values)
            return impact_times(scenario, build_system(scenario), paths, count, stop_time)
        except ScenarioError as error:
            raise NoFit("; ".join(str(one) for one in error.problems)) from error
        except NoDerivative as error:
            raise NoFit(str(error)) from error

    def _check_pairs(self, ours: NDArray[np.int64], theirs: NDArray[np.int64]) -> None:
        other = np.flatnonzero(np.any(np.sort(theirs) != np.sort(ours), axis=1))
        if len(other):
            raise self._of_others(other[0], ours[other[0]])

    def _of_others(self, row: int, ours: NDArray[np.int64]) -> NoFit:
        """Return the error for an impact that is of other bodies in the motion."""
        assert self._measured.pairs is not None
        theirs = self._measured.pairs[row]
        return NoFit(
            f"impact {self._measured.number[row]} is of bodies {ours[0]} and {ours[1]} in the "
            f"motion, expected {theirs[0]} and {theirs[1]}, as measured"
        )

    def _late(self, values: Floats, rows: int) -> Floats:
        """Return computed minus measured times, divided by their noise."""
        instants = self.motion(values, rows).t + values[self._clock].sum()
        late: Floats = (instants - self._t[:rows]) / self._noise[:rows]
        return late

    @np.errstate(over="ignore", invalid="ignore")  # such derivatives are refused
    def _jacobian(self, values: Floats, rows: int) -> Floats:
        """Return the derivatives of the residuals."""
        derivative = np.ones((rows, len(self._free)))
        derivative[:, ~self._clock] = self.motion(values, rows).derivative
        jacobian: Floats = derivative / self._noise[:rows, None]
        # Their squares are summed.
        lost = np.argwhere(~(np.abs(jacobian) < math.sqrt(sys.float_info.max / rows)))
        if len(lost):
            row, number = lost[0]
            raise self._unresolved(row, number, "any time")
        return jacobian

    def _unresolved(self, row: int, number: int, by: str) -> NoFit:
        """Return the error for an impact that moves too far when a number is rounded."""
        return NoFit(
            f"impact {self._measured.number[row]} moves by more than {by} when "
            f"{self._free[number].name} is rounded to a double: it carries no information, "
            f"expected only the {row} before it"
        )

    def first_residuals(self, start: Floats) -> Floats:
        """Return the initial residuals, NaN beyond the computed motion.

        Raises ``NoFit`` if the motion lacks impacts of the first stage.
        """
        rows = len(self._measured.t)
        found = np.full(rows, np.nan)
        least = self.stages()[0]
        while True:
            try:
                found[:rows] = -self._late(start, rows) * self._noise[:rows]
                return found
            except NoFit:
                if rows == least:
                    raise
                rows = max(rows // 2, least)

    def solved(self, values: Floats, rows: int) -> Floats:
        """Return the parameters fitted to the first rows; undetermined ones keep their values."""
        try:
            jacobian = self._jacobian(values, rows)
        except NoFit as error:
            raise NoFit(f"{error}; the impacts before led to {self._in_words(values)}") from error
        last = rows == len(self._measured.t)
        if last:
            self._covariance(jacobian)  # raises if a number is undetermined
        shown = np.arange(len(values)) if last else _independent(jacobian)
        if not len(shown):
            return values

        found = self._least(values, shown, rows, TOLERANCE if last else 1e-6)
        values = values.copy()
        values[shown] = found.x
        if last and not found.success:
            raise NoFit(
                f"the method does not converge: {found.nfev} motions led to "
                f"{self._in_words(values)}; start nearer, or with fewer impacts"
            )
        return values

    def _in_words(self, values: Floats) -> str:
        pairs = zip(self._free, values + self._origin, strict=True)
        return ", ".join(one.with_unit(f"{one.name} = {value:.4g}") for one, value in pairs)

    def _least(self, values: Floats, shown: NDArray[np.int64], rows: int, tolerance: float) -> Any:
        """Minimise the sum of squares of the first rows over the parameters `shown`."""
        free = [self._free[n] for n in shown]
        ends = self._bounds[:, shown]
        beyond = False

        def whole(some: Floats) -> Floats:
            found = values.copy()
            found[shown] = some
            return found

        def late(some: Floats) -> Floats:
            nonlocal beyond
            beyond = beyond or bool(np.any(outside(some, *ends)))
            try:
                self._jacobian(whole(some), rows)  # raises where derivatives overflow
                return self._late(whole(some), rows)
            except NoFit:  # the step is made shorter
                return np.full(rows, np.nan)

        # The bounds 0 and 1 of restitution apply only if a step without them violates them.
        given = np.array([(one.low, one.high) for one in free]).T - self._origin[shown]
        for bounds in (given, ends):
            found = least_squares(
                late, values[shown], jac=lambda some: self._jacobian(whole(some), rows)[:, shown],
                bounds=bounds, x_scale="jac", xtol=tolerance, ftol=tolerance, gtol=None,
                max_nfev=200,
            )  # fmt: skip
            if not beyond:
                break
        return found

    def _covariance(self, jacobian: Floats) -> Floats:
        """Return ``(J^T J)^-1``, computed from ``J`` as the product would lose twice the digits.

        Raises ``NoFit`` if the times do not determine a parameter or a combination of parameters.
        """
        sizes = np.linalg.norm(jacobian, axis=0)
        for one, size in zip(self._free, sizes, strict=True):
            if size == 0.0:
                raise NoFit(f"{one.name}: the measured times do not depend on it")
        # With fewer times than parameters some directions have no singular value.
        few = len(jacobian) < len(sizes)
        _, shares, directions = np.linalg.svd(jacobian / sizes, full_matrices=few)
        if len(shares) < len(sizes) or shares[-1] < LEAST_INDEPENDENT * shares[0]:
            weights = np.abs(directions[-1])
            names = [one.name for one, w in zip(self._free, weights, strict=True) if w > 1e-3]
            raise NoFit(f"{', '.join(names)}: the times determine only a combination of them")
        axes = directions.T / shares / sizes[:, None]
        covariance: Floats = axes @ axes.T
        return covariance

    def _check_resolved(self, values: Floats, jacobian: Floats) -> None:
        """Raise ``NoFit`` if rounding a number moves an impact by more than its noise."""
        lost = np.argwhere(EPSILON * np.abs(jacobian * values) > 1.0)
        if self._known and len(lost):
            row, number = lost[0]
            raise self._unresolved(row, number, f"its noise of {self._noise[row]:.2g} s")

    def result(self, start: Floats, first: Floats, values: Floats) -> Fit:
        rows = len(self._measured.t)
        late, jacobian = self._late(values, rows), self._jacobian(values, rows)
        covariance: Any = self._covariance(jacobian)
        self._check_resolved(values, jacobian)
        found = self.motion(values, rows)
        noise = self._noise
        if not self._known:
            rounding = EPSILON * float(np.max(np.abs(self._measured.t)))
            variance = max(float(late @ late) / (rows - len(self._free)), rounding**2)
            covariance, noise = covariance * variance, noise * math.sqrt(variance)
        return Fit(
            scenario=self.changed(values), free=self._free, start=start + self._origin,
            values=values + self._origin, covariance=covariance, measured=self._measured,
            first=first, residuals=-late * self._noise, noise=noise, noise_known=self._known,
            word=found.word, same_events=self._stays(values, covariance, found.word),
            evaluations=self.evaluations,
        )  # fmt: skip

    def _stays(self, values: Floats, covariance: Floats, word: tuple[str, ...]) -> bool:
        """Whether the same happens at the ends of the axes of the confidence region."""
        size, bodies = len(values), len(self._scenario.balls)
        square = chdtri(size, 1.0 - CONFIDENCE)
        if not self._known:
            square = size * fdtri(size, len(self._measured.t) - size, CONFIDENCE)
        radius = math.sqrt(square)
        sizes = np.sqrt(np.diag(covariance))
        lengths, axes = np.linalg.eigh(covariance / np.outer(sizes, sizes))
        for length, axis in zip(lengths, axes.T, strict=True):
            for sign in (1.0, -1.0):
                step = sign * radius * math.sqrt(max(length, 0.0)) * axis * sizes
                try:
                    at = np.clip(values + step, *self._bounds)
                    other = self.motion(at, len(self._measured.t)).word
                except NoFit:
                    return False
                # What follows the last measured impact of a body has no effect on the times.
                for one, two in zip(by_body(other, bodies), by_body(word, bodies), strict=True):
                    if one[: len(two)] != two[: len(one)]:
                        return False
        return True
