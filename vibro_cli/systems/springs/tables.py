"""The tables of a run of bodies on springs: their columns, and what these are made of."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import cached_property
from typing import Any

import numpy as np

from vibro_cli.kernels.springs.world import CONTACT_CLOSED, CONTACT_OPENED
from vibro_cli.kernels.statistics.impact_columns import EIGHTS, REGIMES
from vibro_cli.systems.columns import (
    KINETIC,
    Column,
    Table,
    Value,
    count,
    exponents,
    flag,
    impact_head,
    impact_tail,
    impulse,
    is_one,
    number,
    of_clock,
    of_log,
    phases,
    summary_balance,
    summary_head,
    word,
)
from vibro_cli.systems.rows import Bodies, ImpactRows

_ENERGY = "kinetic energy and energy of the spring"
_OMEGA = "angular velocity of rolling (null for a particle, which slides)"
_DISPLACEMENT = "place of the centre from that of its spring's foot"
_REGIME = "always oscillating, as the energy of a spring has no bound"
_EIGHT = "side of the figure eight: left loop, right loop, on it, or outside (none: there is none)"
_WHEN = (("pre", "before"), ("post", "after"))


class SpringBodies(Bodies):
    """The bodies and springs of some systems as arrays: [system, body]."""

    @cached_property
    def feet(self) -> Any:
        """Places of the springs' feet (m)."""
        return np.array([[spring.foot for spring in system.springs] for system in self.systems])

    @cached_property
    def springs(self) -> Any:
        """Stiffness (N/m), height and length (m): [system, body, which]."""
        return np.array(
            [[(s.stiffness, s.height, s.length) for s in one.springs] for one in self.systems]
        )


class Collisions(ImpactRows):
    """Impacts of two neighbours."""

    bodies: SpringBodies

    def body(self, end: str) -> Any:
        """Body `a` or `b` of each row, from 0."""
        return self["pair"] if end == "a" else self["pair"] + 1

    def displacement(self, end: str) -> Any:
        """From the foot's place (m)."""
        return self[f"x_{end}"] - self.of_body(self.bodies.feet, self.body(end))

    def omega(self, end: str, when: str) -> Any:
        """Angular velocity (rad/s), nan of a particle."""
        body = self.body(end)
        turned = self[f"v_{end}_{when}"] / self.of_body(self.bodies.radii, body)
        return np.where(self.of_body(self.bodies.slide, body), np.nan, turned)

    @cached_property
    def _stored(self) -> dict[str, Any]:
        """Energy of the springs (J)."""
        stored = {}
        for end in "ab":
            springs = self.of_body(self.bodies.springs, self.body(end))
            stiffness, height, length = springs.reshape(-1, 3).T
            stored[end] = 0.5 * stiffness * (np.hypot(height, self.displacement(end)) - length) ** 2
        return stored

    def energy(self, end: str, when: str) -> Any:
        """Kinetic energy and that of the spring (J)."""
        masses = self.of_body(self.bodies.rolling_masses, self.body(end))
        return 0.5 * masses * self[f"v_{end}_{when}"] ** 2 + self._stored[end]

    def kinetic(self, end: str, when: str) -> Any:
        """Kinetic energy (J)."""
        masses = self.of_body(self.bodies.rolling_masses, self.body(end))
        return 0.5 * masses * self[f"v_{end}_{when}"] ** 2

    def eight(self, end: str, when: str) -> Any:
        """Numbers in ``EIGHTS``: the saddle is under the foot, where the spring is longer."""
        springs = self.of_body(self.bodies.springs, self.body(end))
        stiffness, height, length = springs.reshape(-1, 3).T
        saddle, energy = 0.5 * stiffness * (length - height) ** 2, self.energy(end, when)
        side = np.where(energy < saddle, np.where(self.displacement(end) < 0.0, 1, 2), 4)
        side = np.where(np.abs(energy - saddle) <= 1e-12 * saddle, 3, side)
        return np.where(length > height, side, 0)

    @property
    def impulse(self) -> Any:
        """On the right body (N s), under the law of translation."""
        return self.impulse_of(self.body("b"), self["v_b_post"] - self["v_b_pre"])

    @property
    def impulse_moment(self) -> Any:
        """J_Pb (ω_b⁺ - ω_b⁻), N m s."""
        radii = self.of_body(self.bodies.radii, self.body("b"))
        change = self["v_b_post"] / radii - self["v_b_pre"] / radii
        return self.of_body(self.bodies.rolling_inertias, self.body("b")) * change

    @cached_property
    def inclined(self) -> Any:
        """Cosine between the line of centres and the plane."""
        return self.inclination(self.body("a"), self.body("b"))

    @property
    def approach_speed(self) -> Any:
        """Along the line of centres, before (m/s)."""
        return self.inclined * (self["v_a_pre"] - self["v_b_pre"])

    @property
    def separation_speed(self) -> Any:
        """Along the line of centres, after (m/s)."""
        return self.inclined * (self["v_b_post"] - self["v_a_post"])


def _displacement(end: str) -> Value:
    return lambda rows: rows.displacement(end)


def _omega(end: str, when: str) -> Value:
    return lambda rows: rows.omega(end, when)


def _speed(end: str, when: str) -> Value:
    return of_log(f"v_{end}_{when}")


def _kinetic(end: str, when: str) -> Value:
    return lambda rows: rows.kinetic(end, when)


def _never_progressive(rows: Any) -> Any:
    return np.zeros(len(rows), dtype=np.int64)


def _eight(end: str, when: str) -> Value:
    return lambda rows: rows.eight(end, when)


def _energy(end: str, when: str) -> Value:
    return lambda rows: rows.energy(end, when)


def _impact_columns() -> Iterator[Column]:
    yield from impact_head()
    yield count("ball_a", "left body, from 1", value=lambda rows: rows.body("a") + 1)
    yield count("ball_b", "right body", value=lambda rows: rows.body("b") + 1)
    for end in "ab":
        text = f"place of the centre along the line, of body {end}"
        yield number(f"x_{end}", "m", text, value=of_log(f"x_{end}"))
    for end in "ab":
        text = f"{_DISPLACEMENT}, of body {end}"
        yield number(f"displacement_{end}", "m", text, value=_displacement(end))
    for text, name, unit, value in (
        (_OMEGA, "omega", "rad/s", _omega),
        ("signed speed of the centre", "speed", "m/s", _speed),
        (_ENERGY, "energy", "J", _energy),
    ):
        for when, words in _WHEN:
            for end in "ab":
                what = f"{text}, {words} the impact, of body {end}"
                null = name == "omega"
                yield number(f"{name}_{end}_{when}", unit, what, null, value(end, when))
    yield from impact_tail()
    yield flag("contact", "whether lasting contact of the pair begins here", is_one("contact"))
    for when, words in _WHEN:
        for end in "ab":
            text = f"{KINETIC}, {words} the impact, of body {end}"
            yield number(f"kinetic_energy_{end}_{when}", "J", text, value=_kinetic(end, when))
    yield impulse()
    yield from phases("regime", _REGIME, REGIMES, lambda *_: _never_progressive)
    yield from phases("eight", _EIGHT, EIGHTS, _eight)


COLLISIONS = Table("springs.collisions", "one impact of two neighbours", tuple(_impact_columns()))


class Contacts:
    """Rows of the log of states that are beginnings or ends of lasting contact: [event, body]."""

    def __init__(self, states: Any, bodies: int) -> None:
        rows = states.reshape(-1, bodies)
        cause = rows["cause"][:, 0]
        self._rows = rows[(cause == CONTACT_CLOSED) | (cause == CONTACT_OPENED)]
        self.closed = self._rows["cause"][:, 0] == CONTACT_CLOSED

    def __getitem__(self, name: str) -> Any:
        return self._rows[name][:, 0]

    @property
    def speed(self) -> Any:
        """Of the left body of the pair (m/s)."""
        return self._rows["v"][np.arange(len(self._rows)), self["pair"]]


EVENTS = Table(
    "springs.events",
    "one beginning or end of a lasting contact",
    (
        number("t", "s", "time of the event", value=of_log("t")),
        word(
            "event", "contact_closed or contact_opened", ("contact_opened", "contact_closed"),
            value=lambda rows: rows.closed.astype(np.int64),
        ),
        count("ball", "left body of the pair, from 1", value=lambda rows: rows["pair"] + 1),
        count("other", "right body of the pair", value=lambda rows: rows["pair"] + 2),
        number("speed", "m/s", "speed of the left body after the event", False, lambda r: r.speed),
        number(
            "value", "s", "contact_closed: how long the bounces left out would last", True,
            lambda rows: np.where(rows.closed, rows["value"], np.nan),
        ),
    ),
)  # fmt: skip
MOTION = Table(
    "springs.motion",
    "one body at one sampled time",
    (
        number("t", "s", "time", value=of_log("t")),
        count("ball", "body, from 1", value=of_log("ball")),
        number("x", "m", "place of the centre along the line", False, lambda m: m["x"] + m["foot"]),
        number("displacement", "m", _DISPLACEMENT, value=of_log("x")),
        number("speed", "m/s", "signed speed of the centre", value=of_log("v")),
        number("energy", "J", _ENERGY, value=lambda m: m["energy"] * m["mass"]),
    ),
)


def _summary_columns(bodies: Iterable[int | str]) -> Iterator[Column]:
    yield from summary_head("time, collisions, no_more_collisions or inadmissible")
    yield count("collisions", "number of impacts", True, of_clock("collisions"))
    yield count("contacts", "number of lasting contacts begun", True, of_clock("contacts"))
    yield from summary_balance()
    for body in bodies:
        yield number(f"x_{body}", "m", f"final place of body {body}", True, _last("x", body))
        text = f"the same of body {body} from its spring's foot"
        yield number(f"displacement_{body}", "m", text, True, _last("displacement", body))
        text = f"final speed of body {body}"
        yield number(f"speed_{body}", "m/s", text, True, _last("speed", body))


def _last(name: str, body: int | str) -> Value:
    return lambda totals: totals.last[name][int(body) - 1]


def summary(bodies: Iterable[int | str], grown: int | str = 0) -> Table:
    """The table of summaries of runs with these bodies: numbers from 1, or a letter for any.

    `grown` with so many exponents.
    """
    columns = (*_summary_columns(bodies), *exponents(grown))
    return Table("springs.summary", "one run", columns)
