"""The table of collisions from the log of impacts."""

from __future__ import annotations

from collections.abc import Callable, Collection
from functools import cache, cached_property, partial
from itertools import product
from typing import Any

import numpy as np

from vibro_cli.mechanics.laws import LAW_NAMES
from vibro_cli.simulation.geometry import Floats, Places

_EPSILON = 2.0**-52
# An impact whose overlap, had it not happened, would have stayed below this many units in the last
# place of the positions cannot be told from a passing touch.
_GRAZING_UNITS = 16.0

_ENDS = ("a", "b")
_WHEN = ("pre", "post")


def collision_table(
    places: Places,
    log: Any,
    counts: Any = None,
    masses: Any = None,
    wanted: Collection[str] | None = None,
) -> dict[str, Any]:
    """Return the columns of ``collisions.parquet``, of one run or of several of one system.

    Parameters
    ----------
    places
        Geometry of the system.
    log
        Impacts, run by run.
    counts
        How many there are of each run; None for a single run.
    masses
        Masses (kg) of the bodies of each impact's run; None for those of the system.
    wanted
        Names of columns; what no column of these needs is not computed. All of them for None.
    """
    counts = np.array([len(log)]) if counts is None else counts
    impacts = _Impacts(places, log, counts, masses)
    columns = impacts.columns()
    return {name: make() for name, make in columns.items() if wanted is None or name in wanted}


class _Impacts:
    """Columns of impacts, each computed once, when it is first needed."""

    def __init__(self, places: Places, log: Any, counts: Any, masses: Any) -> None:
        trace = places.system.trace
        self._places = places
        self._log = log
        self._sided = trace.closed and len(places.system.bodies) == 2
        self._rows = _Fields(_from_left(log) if self._sided else log)
        self._counts = counts
        self._masses = masses

    def columns(self) -> dict[str, Callable[[], Any]]:
        """Return how each column is made, by their names in order."""
        rows = self._rows
        made: dict[str, Callable[[], Any]] = {
            "n": self._number,
            "t": lambda: rows["t"],
            "t_low": lambda: rows["t_low"],
            "dt": self._intervals,
            "ball_a": lambda: rows["a"] + 1,
            "ball_b": lambda: rows["b"] + 1,
        }
        if self._sided:
            made["side"] = lambda: _side(self._places, self._log)
        made |= {"arc_a": lambda: rows["piece_a"] + 1, "arc_b": lambda: rows["piece_b"] + 1}
        for name, one in (("angle", self._angle), ("s", self._arc_length)):
            made |= {f"{name}_{end}": partial(one, end) for end in _ENDS}
        for end in _ENDS:
            made |= {f"{x}_{end}": partial(self._centre_of, end, i) for i, x in enumerate("xy")}
        for name, when, end in product(("rate", "omega", "speed", "energy"), _WHEN, _ENDS):
            made[f"{name}_{end}_{when}"] = partial(getattr(self, f"_{name}"), end, when)
        return made | {
            "energy_loss": lambda: rows["loss"],
            "impulse_moment": self._impulse_moment,
            "approach_speed": lambda: self._approach,
            "separation_speed": self._separation,
            "gap": lambda: residual_gap(self._places, self._log),
            "law": lambda: np.array(LAW_NAMES, dtype=object)[rows["law"]],
            "admissible": lambda: rows["admissible"] == 1,
            "substituted": lambda: rows["substituted"] == 1,
            "simultaneous": lambda: rows["simultaneous"] == 1,
            "grazing": self._grazing,
            "contact": lambda: rows["contact"] == 1,
        }

    @property
    def _starts(self) -> Any:
        """Index of the first row of each run."""
        return np.cumsum(self._counts) - self._counts

    def _number(self) -> Any:
        return np.arange(len(self._log)) + 1 - np.repeat(self._starts, self._counts)

    def _intervals(self) -> Floats:
        """Time since the row before, from both doubles; nan in the first row of a run."""
        result = np.full(len(self._log), np.nan)
        result[1:] = np.diff(self._rows["t"]) + np.diff(self._rows["t_low"])
        result[self._starts[self._counts > 0]] = np.nan
        return result

    def _state(self, end: str) -> tuple[Any, Floats, Floats]:
        """Piece, S and C of the bodies on one side."""
        rows = self._rows
        return rows[f"piece_{end}"], rows[f"{end}_s"], rows[f"{end}_c"]

    @cache  # noqa: B019 (an object lives as long as its one table is made)
    def _position(self, end: str) -> Floats:
        return self._places.position(*self._state(end))

    def _angle(self, end: str) -> Floats:
        line = self._places.sign[self._rows[f"piece_{end}"]] == 0.0
        return np.where(line, np.nan, self._position(end))

    def _arc_length(self, end: str) -> Floats:
        return self._places.arc_length(self._rows[f"piece_{end}"], self._position(end))

    @cache  # noqa: B019
    def _centre(self, end: str) -> tuple[Floats, Floats]:
        return self._places.centre(self._rows[end], *self._state(end))

    def _centre_of(self, end: str, coordinate: int) -> Floats:
        return self._centre(end)[coordinate]

    def _speed(self, end: str, when: str) -> Floats:
        speed: Floats = self._rows[f"speed_{end}_{when}"]
        return speed

    def _rate(self, end: str, when: str) -> Floats:
        body, piece = self._rows[end], self._rows[f"piece_{end}"]
        return self._places.rate(body, piece, self._speed(end, when))

    def _omega(self, end: str, when: str) -> Floats:
        omega: Floats = self._speed(end, when) / self._places.body_radius[self._rows[end]]
        return omega

    @cache  # noqa: B019
    def _mass(self, end: str) -> Floats:
        body = self._rows[end]
        if self._masses is None:
            mass: Floats = self._places.mass[body]
            return mass
        mass = self._masses[np.arange(len(body)), body]
        return mass

    def _energy(self, end: str, when: str) -> Floats:
        weight = self._mass(end) * self._places.gravity
        energy: Floats = weight * self._rows[f"head_{end}_{when}"]
        return energy

    def _impulse_moment(self) -> Floats:
        b = self._rows["b"]
        inertia = self._places.kappa[b] * self._mass("b") * self._places.body_radius[b]
        moment: Floats = inertia * (self._speed("b", "post") - self._speed("b", "pre"))
        return moment

    @cached_property
    def _approach(self) -> Floats:
        """Along the line of centres, whichever body is named first."""
        log = self._log
        approach: Floats = (
            log["normal_a"] * log["speed_a_pre"] - log["normal_b"] * log["speed_b_pre"]
        )
        return approach

    def _separation(self) -> Floats:
        log = self._log
        parting: Floats = (
            log["normal_b"] * log["speed_b_post"] - log["normal_a"] * log["speed_a_post"]
        )
        return parting

    def _grazing(self) -> Any:
        """Flag impacts whose overlap, had the bodies passed, would be lost in rounding."""
        places, acceleration = self._places, np.zeros(len(self._log))
        for end in _ENDS:
            body, piece = self._rows[end], self._rows[f"piece_{end}"]
            rho = places.path_radius[body, piece]
            speed = self._speed(end, "pre")
            with np.errstate(divide="ignore", invalid="ignore"):
                central = np.where(rho > 0.0, speed * speed / rho, 0.0)
            acceleration += places.gravity / places.kappa[body] + central
        (ax, ay), (bx, by) = self._centre("a"), self._centre("b")
        size = np.abs(ax) + np.abs(ay) + np.abs(bx) + np.abs(by)
        overlap = self._approach * self._approach / (2.0 * acceleration)
        return overlap < _GRAZING_UNITS * _EPSILON * size


class _Fields:
    """The fields of rows, each in one piece of memory once it has been asked for."""

    def __init__(self, rows: Any) -> None:
        self._rows = rows
        self._fields: dict[str, Any] = {}

    def __getitem__(self, name: str) -> Any:
        if name not in self._fields:
            self._fields[name] = self._rows[name].copy()
        return self._fields[name]


def _side(places: Places, log: Any) -> Any:
    """+1 where body 2 is met ahead of body 1, -1 where from behind (two bodies, closed trace)."""
    s_a, s_b = (
        places.arc_length(piece, places.position(piece, log[f"{end}_s"], log[f"{end}_c"]))
        for end, piece in ((end, log[f"piece_{end}"]) for end in _ENDS)
    )
    ahead = np.where(log["a"] == 0, s_b - s_a, s_a - s_b) % places.system.trace.length
    near = np.where(ahead <= 0.5 * places.system.trace.length, 1, -1)
    same = log["piece_a"] == log["piece_b"]
    return np.where(same, np.where(log["a"] == 0, 1, -1), near)


def _from_left(log: Any) -> Any:
    """Rows with body 1 first, whichever pair found the contact."""
    rows = log.copy()
    swap = log["a"] == 1
    names = [name for name in log.dtype.names if _other(name) in log.dtype.names]
    for name in names:
        rows[name][swap] = log[_other(name)][swap]
    return rows


def _other(name: str) -> str:
    """Name of the same quantity of the other body."""
    parts = name.split("_")
    swapped = [{"a": "b", "b": "a"}.get(part, part) for part in parts]
    return "_".join(swapped) if swapped != parts else ""


def residual_gap(places: Places, log: Any) -> Floats:
    """Distance of the surfaces (m) left in the states of the impacts, without cancellation.

    The same operations as ``simulation.tally.residual_gap``, on columns.
    """
    piece = log["piece_a"]
    same, line = piece == log["piece_b"], places.sign[piece] == 0.0
    result = np.empty(len(log))
    for chosen, gap in (
        (same & ~line, _gap_on_arc),
        (same & line, _gap_on_line),
        (~same, _gap_across),
    ):
        if chosen.all():
            return gap(places, _Fields(log))
        if chosen.any():
            result[chosen] = gap(places, _Fields(log[chosen]))
    return result


def _gap_on_arc(places: Places, rows: _Fields) -> Floats:
    a, b, piece = rows["a"], rows["b"], rows["piece_a"]
    radius_a, radius_b = places.body_radius[a], places.body_radius[b]
    # d^2 - (r_a + r_b)^2 = 4 rho_a rho_b sin((delta - beta)/2) sin((delta + beta)/2)
    product = places.path_radius[a, piece] * places.path_radius[b, piece]
    half_sine = np.sqrt(radius_a * radius_b / product)
    half_cosine = np.sqrt(1.0 - np.minimum(half_sine, 1.0) ** 2)
    delta = np.abs(rows["b_s"] * rows["a_c"] - rows["b_c"] * rows["a_s"])
    cosine = np.abs(rows["b_c"] * rows["a_c"] + rows["b_s"] * rows["a_s"])
    less = delta * half_cosine - cosine * half_sine
    more = delta * half_cosine + cosine * half_sine
    gap: Floats = 2.0 * product * less * more / (radius_a + radius_b)
    return gap


def _gap_on_line(places: Places, rows: _Fields) -> Floats:
    radius_a, radius_b = places.body_radius[rows["a"]], places.body_radius[rows["b"]]
    along = rows["b_s"] - rows["a_s"]
    distance = 2.0 * np.sqrt(radius_a * radius_b)
    gap: Floats = (along - distance) * (along + distance) / (2.0 * (radius_a + radius_b))
    return gap


def _gap_across(places: Places, rows: _Fields) -> Floats:
    a, b = rows["a"], rows["b"]
    ax, ay = places.centre(a, rows["piece_a"], rows["a_s"], rows["a_c"])
    bx, by = places.centre(b, rows["piece_b"], rows["b_s"], rows["b_c"])
    dx, dy = bx - ax, by - ay
    gap: Floats = np.sqrt(dx * dx + dy * dy) - (places.body_radius[a] + places.body_radius[b])
    return gap
