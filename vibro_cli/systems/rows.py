"""Rows of logs as columns, those of impacts with their bodies, and what is summed up of them."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from vibro_cli.compile.kernel import compiled_rows, dtype, interpreted_rows
from vibro_cli.kernels.impact.laws import TRANSLATIONAL
from vibro_cli.kernels.world import BodyData
from vibro_cli.mechanics.system import Body


@dataclass(frozen=True)
class ImpactSystem(ABC):
    """Bodies and the law of their impacts."""

    bodies: tuple[Body, ...]
    law: str
    """`hedrih`, `normal-impulse` or `translational`."""
    inadmissible: str
    """What follows an inadmissible impact: `stop` or `normal-impulse`."""

    @property
    def law_keeps_energy(self) -> bool:
        """Whether impacts with k = 1 take no energy: the translational law needs equal κ."""
        return self.law != "translational" or len({body.kappa for body in self.bodies}) == 1

    @abstractmethod
    def keeps_energy(self, clock: Mapping[str, Any]) -> bool:
        """Whether nothing takes energy in a run, whose clock at its end is given."""


def touching_distance(one: Body, other: Body) -> float:
    """Return 2 √(r_a r_b), the horizontal distance (m) of two touching bodies' centres."""
    if one.radius == other.radius:
        return 2.0 * one.radius
    return 2.0 * math.sqrt(one.radius * other.radius)


class Bodies:
    """The bodies of some systems as arrays: [system, body]."""

    def __init__(self, systems: Sequence[Any]) -> None:
        self.systems: Sequence[Any] = systems

    def of_each(self, value: Callable[[Body], float]) -> Any:
        """Return a value of every body."""
        return np.array([[value(body) for body in system.bodies] for system in self.systems])

    @cached_property
    def radii(self) -> Any:
        """Radii (m)."""
        return self.of_each(lambda body: body.radius)

    @cached_property
    def rolling_inertias(self) -> Any:
        """J_P (kg m²)."""
        return self.of_each(lambda body: body.rolling_inertia)

    @cached_property
    def rolling_masses(self) -> Any:
        """κ m (kg)."""
        return self.of_each(lambda body: body.kappa * body.mass)

    @cached_property
    def masses(self) -> Any:
        """m (kg)."""
        return self.of_each(lambda body: body.mass)

    @cached_property
    def slide(self) -> Any:
        """Which of them are particles."""
        return self.of_each(lambda body: float(body.kappa == 1.0)) == 1.0


class ImpactRows:
    """Rows of a log of impacts, of which the columns of its table are made.

    Parameters
    ----------
    bodies
        Of each run.
    log, run
        The rows, those of one run after those of another, and the number of the run of each row,
        from 0.
    told, before
        How many rows of the first run came before, and the last of them.
    """

    def __init__(
        self, bodies: Bodies, log: Any, run: Any, told: int = 0, before: Any = None
    ) -> None:
        self.bodies, self.run = bodies, run
        self._log, self._told, self._before = log, told, before

    def __getitem__(self, name: str) -> Any:
        return self._log[name]

    def __len__(self) -> int:
        return len(self._log)

    @cached_property
    def number(self) -> Any:
        """Of each row in its run, from 1."""
        return np.arange(1, len(self) + 1) - np.searchsorted(self.run, self.run) + self._told

    @property
    def between(self) -> Any:
        """Time (s) since the row before, nan in a run's first."""
        rows = self._log
        between = np.full(len(rows), np.nan)
        between[1:] = np.diff(rows["t"]) + np.diff(rows["t_low"])
        between[self.number == 1] = np.nan
        if len(rows) and self._before is not None:
            before = self._before
            between[0] = (rows["t"][0] - before["t"]) + (rows["t_low"][0] - before["t_low"])
        return between

    def of_body(self, values: Any, body: Any) -> Any:
        """Return the value [system, body] of the body of each row."""
        return values[self.run, body]

    def inclination(self, one: Any, other: Any) -> Any:
        """Return the cosine between the line of centres of two bodies and the plane."""
        a, b = (self.of_body(self.bodies.radii, body) for body in (one, other))
        return np.where(a == b, 1.0, 2.0 * np.sqrt(a * b) / np.maximum(a + b, 1e-300))


class PairRows(ImpactRows):
    """Impacts of two bodies, whose line of centres is over the line along which the law acts."""

    @abstractmethod
    def body(self, end: str) -> Any:
        """Body `a` or `b` of each row, from 0."""

    @abstractmethod
    def along(self, end: str, when: str) -> Any:
        """Its speed along that line (m/s), `pre` or `post`."""

    @cached_property
    def inclined(self) -> Any:
        """Cosine between the line of centres and the plane."""
        return self.inclination(self.body("a"), self.body("b"))

    @property
    def approach_speed(self) -> Any:
        """Along the line of centres, before (m/s)."""
        return self.inclined * (self.along("a", "pre") - self.along("b", "pre"))

    @property
    def separation_speed(self) -> Any:
        """Along the line of centres, after (m/s)."""
        return self.inclined * (self.along("b", "post") - self.along("a", "post"))

    @property
    def impulse(self) -> Any:
        """On body b (N s), under the law of translation; nan under others, B (6)."""
        change = self.along("b", "post") - self.along("b", "pre")
        impulses = self.of_body(self.bodies.masses, self.body("b")) * change
        return np.where(self["law"] == TRANSLATIONAL, impulses, np.nan)


def events_until(times: Any, instants: Any, side: str) -> Any:
    """Return how many of some events there are by each instant (s), ascending `times` (s).

    `side` is "after" or "before" an event that happens at just such an instant.
    Raises ValueError for another side.
    """
    if side not in ("after", "before"):
        raise ValueError(f'side must be "after" or "before", not {side!r}')
    return np.searchsorted(times, instants, side="right" if side == "after" else "left")


def bodies_at(system: ImpactSystem, instants: Any) -> dict[str, Any]:
    """Return `t` (s), `ball` and `mass` (κ m, kg) of a row for each body at each instant."""
    number = len(system.bodies)
    masses = [body.kappa * body.mass for body in system.bodies]
    return {
        "t": np.repeat(instants, number),
        "ball": np.tile(np.arange(1, number + 1), len(instants)),
        "mass": np.tile(masses, len(instants)),
    }


class Totals:
    """What the summary says of a run, gathered stretch by stretch."""

    def __init__(self, energy_start: float) -> None:
        self.energy_start = energy_start
        self.first_time = self.last_time = self.largest_gap = float("nan")

    def take(self, log: Any) -> None:
        """Take some more impacts of two bodies."""
        if not len(log):
            return
        times = log["t"]
        if self.first_time != self.first_time:
            self.first_time = float(times[0])
        self.last_time = float(times[-1])
        self.largest_gap = float(np.nanmax([self.largest_gap, np.max(np.abs(log["gap"]))]))

    def finish(
        self,
        system: ImpactSystem,
        end_cause: str,
        end_time: float,
        clock: Mapping[str, Any],
        last: Mapping[str, Any],
    ) -> None:
        """Take the end of the run: `last` are the columns of its motion table then."""
        self.system, self.end_cause, self.end_time = system, end_cause, end_time
        self.clock, self.last = clock, last
        self.energy_end = float(np.sum(last["energy"]))

    @property
    def energy_drift(self) -> float:
        """Relative change of the energy, where it should be kept; else nan."""
        start = self.energy_start
        kept = self.system.keeps_energy(self.clock)
        return (self.energy_end - start) / start if start > 0.0 and kept else float("nan")


class Log:
    """Rows of one record type, gathered chunk by chunk from either engine."""

    def __init__(self, cls: type) -> None:
        self._type = dtype(cls)
        self._names = tuple(cls.fields)  # type: ignore[attr-defined]
        self._chunks: list[Any] = []

    def take(self, rows: Any, count: int) -> None:
        """Take the first ``count`` rows; those of an array are not copied, and stay as they are."""
        if count == 0:
            return
        if isinstance(rows, np.ndarray):
            self._chunks.append(rows[:count])
            return
        values: Iterable[Any] = (
            tuple([getattr(row, name) for name in self._names]) for row in rows[:count]
        )
        self._chunks.append(np.array(list(values), dtype=self._type))

    def __len__(self) -> int:
        return sum(len(chunk) for chunk in self._chunks)

    def drain(self) -> Any:
        """Return all rows as :meth:`table` does, and keep none."""
        rows = self.table()
        self._chunks = []
        return rows

    def table(self) -> Any:
        """Return all rows as one structured array."""
        if not self._chunks:
            return np.zeros(0, dtype=self._type)
        if len(self._chunks) > 1:
            self._chunks = [joined(self._chunks)]
        return self._chunks[0]


# numpy copies records field by field: as bytes it takes a third of the time, and with `take` a
# twentieth of what an index takes.


def joined(parts: Sequence[Any]) -> Any:
    """Return arrays of records of one type as one array."""
    return np.concatenate([part.view(np.uint8) for part in parts]).view(parts[0].dtype)


def chosen(rows: Any, flags: Any) -> Any:
    """Return the records that are flagged."""
    return rows.take(np.flatnonzero(flags))


def record_array(rows: Any, cls: type) -> Any:
    """Return a structured array of its own with the contents of records of either engine."""
    if isinstance(rows, np.ndarray):
        return rows.copy()
    return compiled_rows(rows, cls)


def plain_rows(rows: Any, cls: type) -> list[list[Any]]:
    """Return records of either engine as plain values, which `set_rows` takes back exactly."""
    if isinstance(rows, np.ndarray):
        return [[_plain(value) for value in row.tolist()] for row in rows]
    names = tuple(cls.fields)  # type: ignore[attr-defined]
    return [[_plain(getattr(row, name)) for name in names] for row in rows]


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.tolist()
    return list(value) if isinstance(value, list) else value


def rows_of(cls: type, values: Sequence[Sequence[Any]]) -> list[Any]:
    """Return interpreted records with the values that `plain_rows` has returned."""
    rows = interpreted_rows(cls, len(values))
    set_rows(rows, cls, values)
    return rows


def set_rows(rows: Sequence[Any], cls: type, values: Sequence[Sequence[Any]]) -> None:
    """Give interpreted records the values that `plain_rows` has returned.

    Raises
    ------
    ValueError
        If there are others than these records have.
    """
    names = tuple(cls.fields)  # type: ignore[attr-defined]
    if len(rows) != len(values) or any(len(value) != len(names) for value in values):
        raise ValueError(f"the state of {cls.__name__} does not belong to this scenario")
    for row, value in zip(rows, values, strict=True):
        for field, number in zip(names, value, strict=True):
            setattr(row, field, _plain(number))


def body_record(body: Body, gravity: float = 0.0) -> BodyData:
    """Return the record of a body; without gravity (m/s²), where it plays no part, no weight."""
    data = BodyData()
    data.radius = body.radius
    data.kappa = body.kappa
    data.mass = body.mass
    data.rolling_mass = body.kappa * body.mass
    data.weight = body.mass * gravity
    return data
