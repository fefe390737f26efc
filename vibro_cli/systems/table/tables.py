"""The tables of a run on the table: their columns, and what these are made of."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import cached_property
from typing import Any

import numpy as np

from vibro_cli.systems.columns import (
    Column,
    Table,
    Value,
    count,
    exponents,
    flag,
    grazing,
    impact_head,
    impact_tail,
    impulse,
    number,
    of_clock,
    of_log,
    summary_balance,
    summary_head,
)
from vibro_cli.systems.table.system import POLYGON
from vibro_cli.systems.tables import ImpactRows

_AXES = ("x", "y")
_WHEN = (("pre", "before"), ("post", "after"))
_ANGLES = ("arrival", "outgoing")
_SKEW = 1e-12
"""Least share of the component across the line of centres that makes an impact skew."""


class RollingRows(ImpactRows):
    """Impacts of balls that roll."""

    def rolling(self, ball: Any, vx: Any, vy: Any) -> Any:
        """Return |v|/r (rad/s) of the ball of each row, nan where it slides."""
        radii, speed = self.of_body(self.bodies.radii, ball), np.hypot(vx, vy)
        omega = np.divide(speed, radii, out=np.zeros_like(speed), where=radii > 0.0)
        return np.where(self.of_body(self.bodies.slide, ball), np.nan, omega)


def inclination_of(along: Any, across: Any) -> Any:
    """Return the angle (rad, 0 to π/2) of velocities with a line; nan at rest."""
    moves = (along != 0.0) | (across != 0.0)
    return np.where(moves, np.arctan2(np.abs(across), np.abs(along)), np.nan)


class Collisions(RollingRows):
    """Impacts of two balls."""

    @cached_property
    def inclined(self) -> Any:
        """Cosine between the line of centres and the plane."""
        return self.inclination(self["a"], self["b"])

    @property
    def approach_speed(self) -> Any:
        """Along the line of centres, before (m/s)."""
        return self.inclined * (self["normal_a_pre"] - self["normal_b_pre"])

    @property
    def separation_speed(self) -> Any:
        """Along the line of centres, after (m/s)."""
        return self.inclined * (self["normal_b_post"] - self["normal_a_post"])

    @property
    def impulse_moment(self) -> Any:
        """J_Pb (ω_b⁺ - ω_b⁻), N m s; 0 for a point."""
        values = self.of_body(self.bodies.rolling_inertias, self["b"]) * (
            self["normal_b_post"] - self["normal_b_pre"]
        )
        radii = self.of_body(self.bodies.radii, self["b"])
        return np.divide(values, radii, out=np.zeros_like(values), where=radii > 0.0)

    def tangential_speed(self, ball: str) -> Any:
        """Across the line of centres (m/s), of ball `a` or `b`."""
        across = self[f"vy_{ball}_pre"] * self["normal_x"]
        return across - self[f"vx_{ball}_pre"] * self["normal_y"]

    def omega(self, ball: str, when: str) -> Any:
        """Angular speed of rolling (rad/s) of ball `a` or `b`, nan of a particle."""
        return self.rolling(self[ball], self[f"vx_{ball}_{when}"], self[f"vy_{ball}_{when}"])

    def angle(self, ball: str, when: str) -> Any:
        """Between the path and the line of centres (rad, 0 to π/2), nan at rest."""
        return inclination_of(self[f"normal_{ball}_{when}"], self.tangential_speed(ball))

    @property
    def central(self) -> Any:
        """Whether both velocities before lie along the line of centres."""
        return ~(self._skew("a") | self._skew("b"))

    def _skew(self, ball: str) -> Any:
        along, across = self[f"normal_{ball}_pre"], self.tangential_speed(ball)
        return np.abs(across) > _SKEW * np.hypot(along, across)

    @property
    def impulse(self) -> Any:
        """On ball b along the line of centres (N s), under the law of translation."""
        return self.impulse_of(self["b"], self["normal_b_post"] - self["normal_b_pre"])

    def energy(self, ball: str, when: str) -> Any:
        """Kinetic energy (J) of ball `a` or `b`, `pre` or `post`."""
        square = self[f"vx_{ball}_{when}"] ** 2 + self[f"vy_{ball}_{when}"] ** 2
        return 0.5 * self.of_body(self.bodies.rolling_masses, self[ball]) * square


class Bounces(RollingRows):
    """Impacts of a ball on the wall."""

    @property
    def edge(self) -> Any:
        """Side of a polygon, from 1."""
        walls = [system.wall for system in self.bodies.systems]
        curved = np.array([wall is None or wall.shape != POLYGON for wall in walls])
        return np.ma.MaskedArray(self["edge"] + 1, mask=curved[self.run])

    def normal_speed(self, when: str) -> Any:
        """Towards the wall (m/s), `pre` or `post`."""
        return self[f"vx_{when}"] * self["normal_x"] + self[f"vy_{when}"] * self["normal_y"]

    def omega(self, when: str) -> Any:
        """Angular speed of rolling (rad/s), nan of a particle."""
        return self.rolling(self["ball"], self[f"vx_{when}"], self[f"vy_{when}"])

    def angle(self, when: str) -> Any:
        """Between the path and the normal of the wall (rad, 0 to π/2)."""
        return inclination_of(self.normal_speed(when), self.tangential_speed)

    @property
    def tangential_speed(self) -> Any:
        """Along the wall (m/s)."""
        return self["vy_pre"] * self["normal_x"] - self["vx_pre"] * self["normal_y"]


def _from_1(name: str) -> Value:
    return lambda rows: rows[name] + 1


def _normal_angle(rows: Any) -> Any:
    return np.arctan2(rows["normal_y"], rows["normal_x"])


def _tangential(ball: str) -> Value:
    return lambda rows: rows.tangential_speed(ball)


def _energy(ball: str, when: str) -> Value:
    return lambda rows: rows.energy(ball, when)


def _omega(ball: str, when: str) -> Value:
    return lambda rows: rows.omega(ball, when)


def _angle(ball: str, when: str) -> Value:
    return lambda rows: rows.angle(ball, when)


def _wall_omega(when: str) -> Value:
    return lambda rows: rows.omega(when)


def _wall_angle(when: str) -> Value:
    return lambda rows: rows.angle(when)


def _towards_wall(when: str) -> Value:
    return lambda rows: rows.normal_speed(when)


def _impact_columns() -> Iterator[Column]:
    yield from impact_head()
    yield count("ball_a", "one ball, from 1", value=_from_1("a"))
    yield count("ball_b", "the other, from 1", value=_from_1("b"))
    for ball in "ab":
        for axis in _AXES:
            name = f"{axis}_{ball}"
            yield number(name, "m", f"place of the centre of ball {ball}", value=of_log(name))
    text = "direction from the centre of ball a to that of ball b, from the x axis"
    yield number("normal_angle", "rad", text, value=_normal_angle)
    for when, words in _WHEN:
        for ball in "ab":
            for axis in _AXES:
                text = f"component of the velocity of ball {ball} {words} the impact"
                value = of_log(f"v{axis}_{ball}_{when}")
                yield number(f"velocity_{axis}_{ball}_{when}", "m/s", text, value=value)
    for when, words in _WHEN:
        for ball in "ab":
            text = f"component along the line of centres of ball {ball}, {words} the impact"
            value = of_log(f"normal_{ball}_{when}")
            yield number(f"normal_speed_{ball}_{when}", "m/s", text, value=value)
    for ball in "ab":
        text = f"component of ball {ball} across the line of centres, which stays"
        yield number(f"tangential_speed_{ball}", "m/s", text, value=_tangential(ball))
    for when, words in _WHEN:
        for ball in "ab":
            text = f"kinetic energy of ball {ball} {words} the impact"
            yield number(f"energy_{ball}_{when}", "J", text, value=_energy(ball, when))
    yield from impact_tail()
    for when, words in _WHEN:
        for ball in "ab":
            text = f"angular speed of ball {ball}, speed / radius, {words} (null: it slides)"
            yield number(f"omega_{ball}_{when}", "rad/s", text, True, _omega(ball, when))
    for (when, words), name in zip(_WHEN, _ANGLES, strict=True):
        for ball in "ab":
            text = f"angle of the path of ball {ball} with the line of centres, 0 to π/2, {words}"
            null = f"{text} (null at rest)"
            yield number(f"{name}_angle_{ball}", "rad", null, True, _angle(ball, when))
    text = "whether it is direct central, velocities along the line of centres: else it is skew (C)"
    yield flag("central", text, lambda rows: rows.central)
    yield impulse()


def _bounce_columns() -> Iterator[Column]:
    yield from impact_head()
    yield count("ball", "the ball, from 1", value=_from_1("ball"))
    text = "side of the polygon or rectangle, from 1 (null on a curve)"
    yield count("edge", text, True, lambda rows: rows.edge)
    for axis in _AXES:
        yield number(axis, "m", "place of the centre", value=of_log(axis))
    text = "direction from the centre to the wall, from the x axis"
    yield number("normal_angle", "rad", text, value=_normal_angle)
    for when, words in _WHEN:
        for axis in _AXES:
            text = f"component of the velocity {words} the impact"
            value = of_log(f"v{axis}_{when}")
            yield number(f"velocity_{axis}_{when}", "m/s", text, value=value)
    for when, words in _WHEN:
        text = f"component towards the wall {words} the impact"
        yield number(f"normal_speed_{when}", "m/s", text, value=_towards_wall(when))
    text = "component along the wall, which stays"
    yield number("tangential_speed", "m/s", text, value=lambda rows: rows.tangential_speed)
    yield number("energy_loss", "J", "energy lost in the impact", value=of_log("loss"))
    yield grazing()
    for when, words in _WHEN:
        text = f"angular speed of rolling, speed / radius, {words} the impact (null: it slides)"
        yield number(f"omega_{when}", "rad/s", text, True, _wall_omega(when))
    for (when, words), name in zip(_WHEN, _ANGLES, strict=True):
        text = f"angle of the path with the normal of the wall, 0 to π/2, {words} (null at rest)"
        yield number(f"{name}_angle", "rad", text, True, _wall_angle(when))


COLLISIONS = Table("table.collisions", "one impact of two balls", tuple(_impact_columns()))
BOUNCES = Table("table.bounces", "one impact of a ball on the wall", tuple(_bounce_columns()))
MOTION = Table(
    "table.motion",
    "one ball at one sampled time",
    (
        number("t", "s", "time", value=of_log("t")),
        count("ball", "ball, from 1", value=of_log("ball")),
        number("x", "m", "place of the centre", value=of_log("x")),
        number("y", "m", "place of the centre", value=of_log("y")),
        number("velocity_x", "m/s", "component of the velocity of the centre", value=of_log("vx")),
        number("velocity_y", "m/s", "component of the velocity of the centre", value=of_log("vy")),
        number("speed", "m/s", "speed of the centre", value=lambda m: np.sqrt(m["square"])),
        number("energy", "J", "kinetic energy", value=lambda m: 0.5 * m["mass"] * m["square"]),
    ),
)
_CAUSES = (
    "time, collisions, bounces, no_more_collisions, inadmissible, wall_contact (a ball comes "
    "to roll along the wall, which is not solved) or accumulation (impacts without end in "
    "finite time, which are not solved)"
)


def _summary_columns(balls: Iterable[int | str]) -> Iterator[Column]:
    yield from summary_head(_CAUSES)
    yield count("collisions", "number of impacts of two balls", True, of_clock("collisions"))
    yield count("bounces", "number of impacts on the wall", True, of_clock("bounces"))
    yield from summary_balance()
    for ball in balls:
        for axis in _AXES:
            text = f"final place of ball {ball}"
            yield number(f"{axis}_{ball}", "m", text, True, _last(axis, ball))
        for axis in _AXES:
            name, text = f"velocity_{axis}", f"final component of the velocity of ball {ball}"
            yield number(f"{name}_{ball}", "m/s", text, True, _last(name, ball))


def _last(name: str, ball: int | str) -> Value:
    return lambda totals: totals.last[name][int(ball) - 1]


def summary(balls: Iterable[int | str], grown: int | str = 0) -> Table:
    """The table of summaries of runs with these balls: numbers from 1, or a letter for any.

    `grown` with so many exponents.
    """
    columns = (*_summary_columns(balls), *exponents(grown))
    return Table("table.summary", "one run", columns)
