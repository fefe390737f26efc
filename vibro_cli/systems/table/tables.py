"""The tables of a run on the table: their columns, and the sources of the columns."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cache
from itertools import pairwise
from operator import attrgetter, methodcaller
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibro_cli.numerics.elementwise import Floats
from vibro_cli.systems.columns import (
    ENDS,
    WHEN,
    Column,
    Table,
    Value,
    count,
    flag,
    grazing,
    impact_head,
    impact_tail,
    impulse,
    made,
    number,
    of_clock,
    of_last,
    of_log,
    summary_balance,
    summary_head,
)
from vibro_cli.systems.contract import ImpactLog
from vibro_cli.systems.driver import angles_of
from vibro_cli.systems.run import Stretch
from vibro_cli.systems.table.system import TableSystem
from vibro_cli.systems.tables import ImpactRows, PairRows, bodies_at, events_until

_AXES = ("x", "y")
_ANGLES = {"pre": "arrival", "post": "outgoing"}
_SKEW = 1e-12
"""An impact is skew if the component across the line of centres exceeds this fraction of speed."""


def _rolling(rows: ImpactRows, ball: Any, vx: Any, vy: Any) -> Any:
    """Return |v|/r (rad/s) of each row's ball, nan if it slides."""
    radii, speed = rows.of_body("radius", ball), _size(vx, vy)
    omega = np.divide(speed, radii, out=np.zeros_like(speed), where=radii > 0.0)
    return np.where(rows.of_body("slides", ball), np.nan, omega)


def _size(x: Any, y: Any) -> Any:
    """Return the lengths of vectors, rounded equally on every processor, unlike C's hypot."""
    return np.sqrt(x * x + y * y)


def inclination_of(along: Any, across: Any) -> Any:
    """Return the angle (rad, 0 to π/2) of velocities with a line; nan at rest."""
    moves = (along != 0.0) | (across != 0.0)
    return np.where(moves, angles_of(np.abs(across), np.abs(along)), np.nan)


class Collisions(PairRows):
    """Impacts of two balls."""

    def body(self, end: str) -> Any:
        """Ball `a` or `b` of each row, from 0."""
        return self[end]

    def along(self, end: str, when: str) -> Any:
        """Velocity component along the line of centres (m/s), `pre` or `post` impact."""
        return self[f"normal_{end}_{when}"]

    def tangential_speed(self, ball: str) -> Any:
        """Velocity component across the line of centres (m/s), of ball `a` or `b`."""
        across = self[f"vy_{ball}_pre"] * self["normal_x"]
        return across - self[f"vx_{ball}_pre"] * self["normal_y"]

    def omega(self, ball: str, when: str) -> Any:
        """Angular speed of rolling (rad/s) of ball `a` or `b`, nan for a particle."""
        return _rolling(self, self[ball], self[f"vx_{ball}_{when}"], self[f"vy_{ball}_{when}"])

    def angle(self, ball: str, when: str) -> Any:
        """Angle between the path and the line of centres (rad, 0 to π/2), nan at rest."""
        return inclination_of(self.along(ball, when), self.tangential_speed(ball))

    @property
    def central(self) -> Any:
        """Whether both velocities before the impact lie along the line of centres."""
        return ~(self._skew("a") | self._skew("b"))

    def _skew(self, ball: str) -> Any:
        along, across = self.along(ball, "pre"), self.tangential_speed(ball)
        return np.abs(across) > _SKEW * _size(along, across)

    def energy(self, ball: str, when: str) -> Any:
        """Kinetic energy (J) of ball `a` or `b`, `pre` or `post`."""
        square = self[f"vx_{ball}_{when}"] ** 2 + self[f"vy_{ball}_{when}"] ** 2
        return 0.5 * self.of_body("rolling_mass", self[ball]) * square


class Bounces(ImpactRows):
    """Impacts of a ball on the wall."""

    @property
    def edge(self) -> Any:
        """Number of the straight side, from 1; null for a curve, which is negative in the log."""
        return np.ma.MaskedArray(self["edge"] + 1, mask=self["edge"] < 0)

    def along(self, when: str) -> Any:
        """Velocity component towards the wall (m/s), `pre` or `post` impact."""
        return self[f"vx_{when}"] * self["normal_x"] + self[f"vy_{when}"] * self["normal_y"]

    def omega(self, when: str) -> Any:
        """Angular speed of rolling (rad/s), nan for a particle."""
        return _rolling(self, self["ball"], self[f"vx_{when}"], self[f"vy_{when}"])

    def angle(self, when: str) -> Any:
        """Angle between the path and the wall's normal (rad, 0 to π/2)."""
        return inclination_of(self.along(when), self.tangential_speed)

    @property
    def tangential_speed(self) -> Any:
        """Velocity component along the wall (m/s)."""
        return self["vy_pre"] * self["normal_x"] - self["vx_pre"] * self["normal_y"]


def _from_1(name: str) -> Value:
    return lambda rows: rows[name] + 1


def _normal_angle(rows: Any) -> Any:
    return angles_of(rows["normal_y"], rows["normal_x"])


def _of_ends(
    name: str, unit: str, text: str, method: str, nullable: bool = False
) -> Iterator[Column]:
    """Yield a quantity of both balls before and after the impact; `text` has fields for these."""
    for ball, when, words in ENDS:
        what, value = text.format(ball, words), methodcaller(method, ball, when)
        yield number(f"{name}_{ball}_{when}", unit, what, nullable, value)


def _impact_columns() -> Iterator[Column]:
    yield from impact_head()
    yield count("ball_a", "one ball of the pair, from 1", value=_from_1("a"))
    yield count("ball_b", "the other ball, from 1", value=_from_1("b"))
    for ball in "ab":
        for axis in _AXES:
            name, text = f"{axis}_{ball}", f"{axis} coordinate of the centre of ball {ball}"
            yield number(name, "m", text, value=of_log(name))
    text = "direction from the centre of ball a to that of ball b, measured from the x axis"
    yield number("normal_angle", "rad", text, value=_normal_angle)
    for ball, when, words in ENDS:
        for axis in _AXES:
            text = f"{axis} component of the velocity of ball {ball} {words} the impact"
            value = of_log(f"v{axis}_{ball}_{when}")
            yield number(f"velocity_{axis}_{ball}_{when}", "m/s", text, value=value)
    text = "velocity component of ball {} along the line of centres, {} the impact"
    yield from _of_ends("normal_speed", "m/s", text, "along")
    for ball in "ab":
        text = f"velocity component of ball {ball} across the line of centres, which is conserved"
        value = methodcaller("tangential_speed", ball)
        yield number(f"tangential_speed_{ball}", "m/s", text, value=value)
    yield from _of_ends("energy", "J", "kinetic energy of ball {} {} the impact", "energy")
    yield from impact_tail()
    text = "angular speed of ball {}, speed / radius, {} the impact (null if it slides)"
    yield from _of_ends("omega", "rad/s", text, "omega", nullable=True)
    for ball, when, words in ENDS:
        text = (
            f"angle between the path of ball {ball} {words} the impact and the line of centres, "
            "0 to π/2 (null at rest)"
        )
        value = methodcaller("angle", ball, when)
        yield number(f"{_ANGLES[when]}_angle_{ball}", "rad", text, True, value)
    text = (
        "whether the impact is central (velocities along the line of centres) rather than skew (C)"
    )
    yield flag("central", text, attrgetter("central"))
    yield impulse()


def _bounce_columns() -> Iterator[Column]:
    yield from impact_head()
    yield count("ball", "the ball, from 1", value=_from_1("ball"))
    text = (
        "straight side of the wall, or the corner at which it begins, from 1 in the order of the "
        "corners (of a rectangle from the lower left one, anticlockwise; null on a curve)"
    )
    yield count("edge", text, True, attrgetter("edge"))
    for axis in _AXES:
        yield number(axis, "m", f"{axis} coordinate of the centre", value=of_log(axis))
    text = "direction from the centre to the wall, measured from the x axis"
    yield number("normal_angle", "rad", text, value=_normal_angle)
    for when, words in WHEN:
        for axis in _AXES:
            text = f"{axis} component of the velocity {words} the impact"
            value = of_log(f"v{axis}_{when}")
            yield number(f"velocity_{axis}_{when}", "m/s", text, value=value)
    for when, words in WHEN:
        text = f"velocity component towards the wall {words} the impact"
        yield number(f"normal_speed_{when}", "m/s", text, value=methodcaller("along", when))
    text = "velocity component along the wall, which is conserved"
    yield number("tangential_speed", "m/s", text, value=attrgetter("tangential_speed"))
    yield number("energy_loss", "J", "energy lost in the impact", value=of_log("loss"))
    yield grazing()
    for when, words in WHEN:
        text = f"angular speed of rolling, speed / radius, {words} the impact (null if it slides)"
        yield number(f"omega_{when}", "rad/s", text, True, methodcaller("omega", when))
    for when, words in WHEN:
        text = (
            f"angle between the path {words} the impact and the normal of the wall, 0 to π/2 (null "
            "at rest)"
        )
        value = methodcaller("angle", when)
        yield number(f"{_ANGLES[when]}_angle", "rad", text, True, value)


COLLISIONS = Table("table.collisions", "one impact of two balls", tuple(_impact_columns()))
BOUNCES = Table("table.bounces", "one impact of a ball on the wall", tuple(_bounce_columns()))
MOTION = Table(
    "table.motion",
    "the state of one ball at one sampled time",
    (
        number("t", "s", "time", value=of_log("t")),
        count("ball", "ball, from 1", value=of_log("ball")),
        number("x", "m", "x coordinate of the centre", value=of_log("x")),
        number("y", "m", "y coordinate of the centre", value=of_log("y")),
        number("velocity_x", "m/s", "x component of the velocity", value=of_log("vx")),
        number("velocity_y", "m/s", "y component of the velocity", value=of_log("vy")),
        number("speed", "m/s", "speed of the centre", value=lambda m: np.sqrt(m["square"])),
        number("energy", "J", "kinetic energy", value=lambda m: 0.5 * m["mass"] * m["square"]),
    ),
)
OTHER_TABLES = (MOTION,)
_WALL = ("Impacts on the wall", "impacts on the wall", "was no impact on the wall")
IMPACT_LOGS = {
    "collisions": ImpactLog("pair_log", COLLISIONS, Collisions),
    "bounces": ImpactLog("bounce_log", BOUNCES, Bounces, *_WALL),
}
_CAUSES = (
    "time, collisions, bounces, no_more_collisions, inadmissible, wall_contact (a ball began to "
    "roll along the wall, which is not solved) or accumulation (infinitely many impacts in finite "
    "time, which are not solved)"
)


SUMMARY = Table(
    "table.summary",
    "one run",
    (
        *summary_head(_CAUSES),
        count("collisions", "number of impacts of two balls", True, of_clock("collisions")),
        count("bounces", "number of impacts on the wall", True, of_clock("bounces")),
        *summary_balance(),
    ),
)


@cache  # every point of a grid asks for them
def final_state(ball: int | str) -> tuple[Column, ...]:
    """Return the summary's columns of a ball, counted from 1."""
    kinds = [(axis, "m", "coordinate of the centre") for axis in _AXES]
    kinds += [(f"velocity_{axis}", "m/s", "component of the velocity") for axis in _AXES]
    return tuple(
        number(
            f"{name}_{ball}",
            unit,
            f"final {name[-1]} {text} of ball {ball}",
            True,
            of_last(name, ball),
        )
        for name, unit, text in kinds
    )


_NAMES = ("t", "t_low", "x", "y", "vx", "vy")


class Motion:
    """Positions and velocities of every ball at its events, in order of time.

    `before` is :attr:`last` of the preceding stretch, None for the first one.
    """

    def __init__(self, system: TableSystem, stretch: Stretch, before: Floats | None = None) -> None:
        self._system = system
        number = len(system.bodies)
        if before is None:
            starts = [(0.0, 0.0, 0.0, *one.place, *one.velocity) for one in system.initial]
            before = np.array(starts)
        balls, rows = _events(stretch.logs["pair_log"], stretch.logs["bounce_log"])
        balls = np.concatenate([np.arange(number), balls])
        rows = np.concatenate([before, rows])
        order = np.lexsort((rows[:, 0], balls))
        rows = rows[order]
        firsts = np.searchsorted(balls[order], np.arange(number + 1))
        self.last: Floats = rows[firsts[1:] - 1]
        """The last event of each ball, one row per ball."""
        columns = np.ascontiguousarray(rows.T[1:])
        self.balls: list[dict[str, Floats]] = [
            dict(zip(_NAMES, columns[:, low:high], strict=True))
            for low, high in pairwise(firsts.tolist())
        ]
        """Events of each ball, from its start: `t`, `t_low` (s), `x`, `y` (m), `vx`, `vy` (m/s)."""

    def go_on(self, later: Sequence[Motion]) -> None:
        """Append the motion in the following stretches."""
        for ball, events in enumerate(self.balls):
            for name, own in events.items():
                more = (motion.balls[ball][name][1:] for motion in later)
                events[name] = np.concatenate([own, *more])

    def at(self, ball: int, times: Floats, side: str = "after") -> dict[str, Floats]:
        """Return columns x, y (m), vx, vy (m/s) of a ball at some times (s).

        `side`, "after" or "before", selects the state at the very instant of an event. Raises
        ValueError for another side.
        """
        events = self.balls[ball]
        row = np.maximum(events_until(events["t"], times, side) - 1, 0)
        past = times - events["t"][row] - events["t_low"][row]
        return {
            "x": events["x"][row] + past * events["vx"][row],
            "y": events["y"][row] + past * events["vy"][row],
            "vx": events["vx"][row],
            "vy": events["vy"][row],
        }

    def sample(self, instants: Floats, side: str = "after") -> dict[str, NDArray[Any]]:
        """Return the columns of the motion table, see ``systems.contract.Trajectory``."""
        each = [self.at(ball, instants, side) for ball in range(len(self.balls))]
        column = {key: np.stack([one[key] for one in each], axis=1).ravel() for key in each[0]}
        return _motion_columns(self._system, instants, column)


def states_at(system: TableSystem, records: Any, time: float) -> dict[str, NDArray[Any]]:
    """Return the columns of the motion table at a time (s), from the last events of the balls."""
    balls = records["balls"]
    past = time - balls["t"] - balls["t_low"]
    x, y = (balls[axis] + past * balls[f"v{axis}"] for axis in "xy")
    column = {"x": x, "y": y, "vx": balls["vx"], "vy": balls["vy"]}
    return _motion_columns(system, np.array([time]), column)


def _motion_columns(
    system: TableSystem, instants: Floats, column: dict[str, Floats]
) -> dict[str, NDArray[Any]]:
    square = column["vx"] ** 2 + column["vy"] ** 2
    return MOTION.filled(bodies_at(system, instants) | column | {"square": square})


def _events(pairs: Any, bounces: Any) -> tuple[Any, Floats]:
    """Return the balls that take part in events, and their states after these, one per row."""
    # An inadmissible impact under `stop` changes nothing.
    pairs = pairs[made(pairs)]
    balls, parts = [pairs["a"], pairs["b"], bounces["ball"]], []
    for end in "ab":
        own = [f"{name}_{end}" for name in ("x", "y", "vx", "vy")]
        names = ["event", "t", "t_low", *own[:2], *(f"{name}_post" for name in own[2:])]
        parts.append(np.column_stack([pairs[name] for name in names]))
    names = ["event", "t", "t_low", "x", "y", "vx_post", "vy_post"]
    parts.append(np.column_stack([bounces[name] for name in names]))
    return np.concatenate(balls), np.concatenate(parts)
