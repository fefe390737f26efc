"""The tables of a run of bodies on springs: their columns, and the sources of the columns."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cache, cached_property, partial
from operator import methodcaller
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibro_cli.compile.kernel import NO_OVERRIDES, dtype
from vibro_cli.kernels.springs.series import Found, Sample, sample_states
from vibro_cli.kernels.springs.world import CONTACT_CLOSED, CONTACT_OPENED, ImpactRow, SpringBody
from vibro_cli.kernels.statistics.impact_columns import EIGHTS, REGIMES
from vibro_cli.numerics.elementwise import Floats
from vibro_cli.systems.columns import (
    KINETIC,
    Column,
    Table,
    before_and_after,
    count,
    flag,
    impact_head,
    impact_tail,
    impulse,
    is_one,
    number,
    of_clock,
    of_last,
    of_log,
    summary_balance,
    summary_head,
    word,
)
from vibro_cli.systems.contract import ImpactLog
from vibro_cli.systems.driver import called, joined, with_logs, zeros
from vibro_cli.systems.run import Stretch
from vibro_cli.systems.springs.system import LOOP, SpringsSystem, make_world
from vibro_cli.systems.tables import PairRows, bodies_at, events_until

_ENERGY = "kinetic energy of {} plus energy of its spring"
_OMEGA = "angular velocity of rolling of {} (null for a particle, which slides)"
_DISPLACEMENT = "displacement of the centre of {} from the foot of its spring"
_REGIME = "regime of {}: always oscillating, as the energy of a spring has no bound"
_EIGHT = (
    "position of {} relative to the figure eight: left loop, right loop, on it, or outside (none: "
    "there is no figure eight)"
)


class Collisions(PairRows):
    """Impacts of two neighbours."""

    def body(self, end: str) -> Any:
        """Body `a` or `b` of each row, from 0."""
        return self["pair"] if end == "a" else self["pair"] + 1

    def along(self, end: str, when: str) -> Any:
        """Speed (m/s) of that body, `pre` or `post` impact."""
        return self[f"v_{end}_{when}"]

    def displacement(self, end: str) -> Any:
        """Displacement from the foot (m)."""
        return self[f"x_{end}"] - self.of_body("foot", self.body(end), "springs")

    def spring(self, end: str) -> Iterator[Any]:
        """Yield the stiffness (N/m), height and natural length (m) of the body's spring."""
        for name in ("stiffness", "height", "length"):
            yield self.of_body(name, self.body(end), "springs")

    def omega(self, end: str, when: str) -> Any:
        """Angular velocity (rad/s), nan for a particle."""
        body = self.body(end)
        turned = self.along(end, when) / self.of_body("radius", body)
        return np.where(self.of_body("slides", body), np.nan, turned)

    @cached_property
    def _stored(self) -> dict[str, Any]:
        """Energy of the springs (J)."""
        stored = {}
        for end in "ab":
            stiffness, height, length = self.spring(end)
            extent = np.sqrt(height * height + self.displacement(end) ** 2)
            stored[end] = 0.5 * stiffness * (extent - length) ** 2
        return stored

    def energy(self, end: str, when: str) -> Any:
        """Kinetic energy plus energy of the spring (J)."""
        return self.kinetic(end, when) + self._stored[end]

    def kinetic(self, end: str, when: str) -> Any:
        """Kinetic energy (J)."""
        masses = self.of_body("rolling_mass", self.body(end))
        return 0.5 * masses * self[f"v_{end}_{when}"] ** 2

    def eight(self, end: str, when: str) -> Any:
        """Indices into ``EIGHTS``; a spring longer than its height has a saddle below the foot."""
        stiffness, height, length = self.spring(end)
        saddle, energy = 0.5 * stiffness * (length - height) ** 2, self.energy(end, when)
        side = np.where(energy < saddle, np.where(self.displacement(end) < 0.0, 1, 2), 4)
        side = np.where(np.abs(energy - saddle) <= 1e-12 * saddle, 3, side)
        return np.where(length > height, side, 0)

    def regime(self, end: str, when: str) -> Any:
        """Indices into ``REGIMES``: always the first, oscillating."""
        return np.zeros(len(self), dtype=np.int64)

    @property
    def impulse_moment(self) -> Any:
        """J_Pb (ω_b⁺ - ω_b⁻), N m s."""
        radii = self.of_body("radius", self.body("b"))
        change = self["v_b_post"] / radii - self["v_b_pre"] / radii
        return self.of_body("rolling_inertia", self.body("b")) * change


def _impact_columns() -> Iterator[Column]:
    yield from impact_head()
    yield count("ball_a", "left body of the pair, from 1", value=lambda rows: rows.body("a") + 1)
    yield count("ball_b", "right body of the pair, from 1", value=lambda rows: rows.body("b") + 1)
    for end in "ab":
        text = f"position of the centre of body {end} along the line"
        yield number(f"x_{end}", "m", text, value=of_log(f"x_{end}"))
    for end in "ab":
        text, value = _DISPLACEMENT.format(f"body {end}"), methodcaller("displacement", end)
        yield number(f"displacement_{end}", "m", text, value=value)
    for text, name, unit, method in (
        (_OMEGA, "omega", "rad/s", "omega"),
        ("signed speed of the centre of {}", "speed", "m/s", "along"),
        (_ENERGY, "energy", "J", "energy"),
    ):
        of_method = partial(methodcaller, method)
        yield from before_and_after(name, unit, text, name == "omega", of_method)
    yield from impact_tail()
    yield flag("contact", "whether lasting contact of the pair begins here", is_one("contact"))
    kinetic = partial(methodcaller, "kinetic")
    yield from before_and_after("kinetic_energy", "J", KINETIC, value=kinetic)
    yield impulse()
    for name, text, words in (("regime", _REGIME, REGIMES), ("eight", _EIGHT, EIGHTS)):
        of_method = partial(methodcaller, name)
        yield from before_and_after(name, "", text, value=of_method, words=words)


COLLISIONS = Table("springs.collisions", "one impact of two neighbours", tuple(_impact_columns()))


class Contacts:
    """Beginnings and ends of lasting contact in the log of states: [event, body]."""

    def __init__(self, states: Any, bodies: int) -> None:
        rows = states.reshape(-1, bodies)
        cause = rows["cause"][:, 0]
        self._rows = rows[(cause == CONTACT_CLOSED) | (cause == CONTACT_OPENED)]
        self.closed = self._rows["cause"][:, 0] == CONTACT_CLOSED

    def __getitem__(self, name: str) -> Any:
        return self._rows[name][:, 0]

    @property
    def speed(self) -> Any:
        """Speed of the left body of the pair (m/s)."""
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
        count("other", "right body of the pair, from 1", value=lambda rows: rows["pair"] + 2),
        number("speed", "m/s", "speed of the left body after the event", False, lambda r: r.speed),
        number(
            "value", "s", "contact_closed: duration of the bounces left out; otherwise null", True,
            lambda rows: np.where(rows.closed, rows["value"], np.nan),
        ),
    ),
)  # fmt: skip
MOTION = Table(
    "springs.motion",
    "the state of one body at one sampled time",
    (
        number("t", "s", "time", value=of_log("t")),
        count("ball", "body, from 1", value=of_log("ball")),
        number(
            "x", "m", "position of the centre along the line", False, lambda m: m["x"] + m["foot"]
        ),
        number("displacement", "m", _DISPLACEMENT.format("the body"), value=of_log("x")),
        number("speed", "m/s", "signed speed of the centre", value=of_log("v")),
        number("energy", "J", _ENERGY.format("the body"), value=lambda m: m["energy"] * m["mass"]),
    ),
)


OTHER_TABLES = (EVENTS, MOTION)
IMPACT_LOGS = {"collisions": ImpactLog("impacts", COLLISIONS, Collisions)}


SUMMARY = Table(
    "springs.summary",
    "one run",
    (
        *summary_head("time, collisions, no_more_collisions or inadmissible"),
        count("collisions", "number of impacts", True, of_clock("collisions")),
        count("contacts", "number of lasting contacts begun", True, of_clock("contacts")),
        *summary_balance(),
    ),
)


@cache  # every point of a grid asks for them
def final_state(body: int | str) -> tuple[Column, ...]:
    """Return the summary's columns of a body, counted from 1."""
    kinds = (
        ("x", "m", f"final position of body {body} along the line"),
        ("displacement", "m", f"final displacement of body {body} from the foot of its spring"),
        ("speed", "m/s", f"final signed speed of the centre of body {body}"),
    )
    return tuple(
        number(f"{name}_{body}", unit, text, True, of_last(name, body))
        for name, unit, text in kinds
    )


class Motion:
    """States at the start and after every event, of shape (events, bodies).

    `before` is :attr:`last` of the preceding stretch, None for the first one.
    """

    def __init__(self, system: SpringsSystem, stretch: Stretch, before: Any = None) -> None:
        self._system, self._engine = system, stretch.engine
        states = stretch.logs["states"]
        self._take(states if before is None else joined([before, states]))

    def _take(self, log: Any) -> None:
        bodies = len(self._system.bodies)
        self._log, self.last = log, log[-bodies:].copy()
        """The states after the last event."""
        self.states = log.reshape(-1, bodies)
        self.times = self.states["t"][:, 0]

    def go_on(self, later: Sequence[Motion]) -> None:
        """Append the motion in the following stretches."""
        bodies = len(self._system.bodies)
        self._take(joined([self._log, *(motion._log[bodies:] for motion in later)]))

    def sample(self, instants: Floats, side: str = "after") -> dict[str, NDArray[Any]]:
        """Return the columns of the motion table, see ``systems.contract.Trajectory``."""
        events, bodies = events_until(self.times, instants, side), len(self._system.bodies)
        samples = zeros(len(instants), Sample)
        samples["row"] = np.maximum(events - 1, 0) * bodies
        # Before the start: the motion from the start with all speeds reversed.
        samples["way"] = np.where(instants < 0.0, -1.0, 1.0)
        samples["t"] = np.abs(instants)
        order = np.lexsort((samples["t"], samples["row"], samples["way"]))
        found = np.empty((len(instants), bodies), dtype=dtype(Found))
        found[order] = self._sampled(samples[order]).reshape(-1, bodies)
        return _motion_columns(self._system, instants, found)

    def _sampled(self, samples: Any) -> Any:
        """Return the states at some instants, grouped by instant."""
        bodies = len(self._system.bodies)
        logs = {"impacts": zeros(0, ImpactRow), "states": self._log}
        world = with_logs(LOOP, make_world(self._system), self._engine, logs)
        found = zeros(len(samples) * bodies, Found)
        scratch = zeros(bodies, SpringBody)
        called(sample_states, NO_OVERRIDES, world, samples, len(samples), found, scratch)
        return found


def states_at(system: SpringsSystem, records: Any, time: float) -> dict[str, NDArray[Any]]:
    """Return the columns of the motion table at the time (s) of the records."""
    springs = records["springs"]
    found = np.empty((1, len(springs)), dtype=dtype(Found))
    found["x"], found["v"] = springs["x"], springs["v"]
    # The same bits as `kernels.springs.series.energy_of`.
    length = np.sqrt(springs["height"] * springs["height"] + springs["x"] * springs["x"])
    stretch = length - springs["length"]
    square = springs["v"] * springs["v"] + springs["square"] * stretch * stretch
    found["energy"] = 0.5 * square
    return _motion_columns(system, np.array([time]), found)


def _motion_columns(system: SpringsSystem, instants: Floats, found: Any) -> dict[str, NDArray[Any]]:
    """Return columns from states [time, body]."""
    feet = np.tile([spring.foot for spring in system.springs], len(instants))
    values = {name: found[name].ravel() for name in ("x", "v", "energy")}
    return MOTION.filled(bodies_at(system, instants) | values | {"foot": feet})
