"""The kinds of figure of a run on a table, and the frames of its film."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vibro_cli.figures import style
from vibro_cli.figures.chart import body_look
from vibro_cli.figures.film import Frames, Ground, States, trail
from vibro_cli.figures.kinds import ENERGY_CAPTION, EXPONENTS, INTERVALS, Kind
from vibro_cli.figures.labels import (
    Named,
    draw_legend,
    in_black,
    ring,
    rows_of,
    short_number,
    write_names,
)
from vibro_cli.figures.runs.contact_points import (
    ASIDE,
    POINTS_CAPTION,
    POINTS_TITLE,
    Rolling,
    figure_of,
)
from vibro_cli.figures.runs.over_time import energy_chart, losses_of
from vibro_cli.figures.runs.velocities import (
    CENTRE,
    NORMAL,
    ROLLING,
    arrow,
    draw_disc,
    draw_scale,
    sheet,
    write_over,
    write_value,
    write_values,
)
from vibro_cli.figures.source import Array, first_of
from vibro_cli.figures.style import line, panel_size, width_of
from vibro_cli.systems.columns import made
from vibro_cli.systems.run import Run
from vibro_cli.systems.table.plan import draw_wall, table_plan, with_wall

_IMPACTS = {"single": 2, "double": 4}
_HIGH, _WORDS = 36.0, 14.5
_COLUMNS = (0.0, 17.0)
_AROUND = 2.9
"""Half the height of a panel, in radii of the larger ball."""
_LONGEST, _TURNING = 1.7, 1.0
"""Greatest lengths of arrows of velocity and angular velocity, in radii of the larger ball."""
_APART = 0.1
_LEAST = math.radians(1.0)
_LEAST_ASIDE = math.radians(3.0)
_PATH = line(None, 0.5, (1, 1.2))
_TANGENT = line(style.BLACK, 0.5)
_LEGEND = in_black(
    ("velocity", CENTRE),
    ("along the normal", NORMAL),
    (r"$\omega$", ROLLING),
    ("path", _PATH),
    ("tangent", _TANGENT),
    ("normal", style.AXIS),
)
_RING = ring(90)


@dataclass(frozen=True)
class Arriving:
    """A ball at an impact; pairs are (before, after), positions and velocities of shape (2,)."""

    number: int
    radius: float
    """Radius (m)."""
    centre: Array
    velocity: tuple[Array, Array]
    """Velocity (m/s)."""
    omega: tuple[float, float]
    """Angular speed of rolling (rad/s), nan if it slides."""
    angle: tuple[float, float]
    """Arrival and outgoing angle (rad), nan at rest."""

    @property
    def speed(self) -> tuple[float, float]:
        """Speed (m/s)."""
        before, after = (float(np.hypot(*velocity)) for velocity in self.velocity)
        return before, after


@dataclass(frozen=True)
class Met:
    """An impact of two balls, or of one on the wall."""

    title: str
    time: float
    touch: Array
    """Position of the contact (m), seen from above."""
    normal: Array
    balls: tuple[Arriving, ...]
    made: bool = True
    """False for an inadmissible impact, which ended the run instead."""

    @property
    def largest(self) -> float:
        """Radius of the largest ball (m), or a substitute if all are points."""
        radius = max(ball.radius for ball in self.balls)
        return radius or 0.02 * float(np.max(np.abs(self.touch)))

    @property
    def fastest(self) -> float:
        """Greatest speed (m/s), 1 if all are at rest."""
        return max(speed for ball in self.balls for speed in ball.speed) or 1.0


def table_velocities(run: Run, width: str = "single") -> Figure | None:
    """Draw velocities, paths and angles before and after the first impacts; None without any."""
    wide = width_of(width)
    impacts = _first_met(run, _IMPACTS[width])
    if not impacts:
        return None
    with style.journal():
        rolling = any(not np.isnan(ball.omega[0]) for one in impacts for ball in one.balls)
        lines = rows_of(_LEGEND if rolling else [*_LEGEND[:2], *_LEGEND[3:]], wide)
        figure, panels = sheet(width, len(impacts), lines, _HIGH, _WORDS)
        for number, one in enumerate(impacts):
            for when in (0, 1):
                axes = panels[2 * number + when]
                _draw(axes, run, one, when)
                _write_heading(axes, one, when)
            draw_scale(panels[2 * number + 1], _LONGEST * one.largest / one.fastest, 3)
        draw_legend(figure, lines)
    return figure


def _first_met(run: Run, most: int) -> list[Met]:
    """Return the first impacts, of two balls or on the wall, in order of time."""
    pairs, walls = first_of(run.collisions, most), first_of(run.bounces, most)
    found = [
        *(
            _met(run, pairs, "impact", ("_a", "_b"), row, there)
            for row, there in enumerate(made(pairs).tolist())
        ),
        *(_met(run, walls, "wall", ("",), row) for row in range(len(walls["n"]))),
    ]
    return sorted(found, key=attrgetter("time"))[:most]


def _met(
    run: Run, table: Any, words: str, ends: Sequence[str], row: int, happened: bool = True
) -> Met:
    """Return an impact from a row of a table.

    `ends` are the suffixes of the columns of its balls. `happened` is false for an inadmissible
    impact that ended the run.
    """
    balls = tuple(_ball(run, table, row, end) for end in ends)
    angle = float(table["normal_angle"][row])
    normal = np.array([math.cos(angle), math.sin(angle)])
    one, other = balls[0].radius, balls[-1].radius
    reach = 2.0 * one * math.sqrt(one * other) / (one + other) if one + other > 0.0 else 0.0
    title, touch = f"{words} {int(table['n'][row])}", balls[0].centre + reach * normal
    return Met(title, float(table["t"][row]), touch, normal, balls, happened)


def _ball(run: Run, table: Any, row: int, end: str) -> Arriving:
    number = int(table[f"ball{end}"][row])

    def value(name: str) -> float:
        return float(table[name][row])

    before, after = (
        np.array([value(f"velocity_{axis}{end}_{when}") for axis in "xy"])
        for when in ("pre", "post")
    )
    return Arriving(
        number=number,
        radius=run.system.bodies[number - 1].radius,
        centre=np.array([value(f"x{end}"), value(f"y{end}")]),
        velocity=(before, after),
        omega=(value(f"omega{end}_pre"), value(f"omega{end}_post")),
        angle=(value(f"arrival_angle{end}"), value(f"outgoing_angle{end}")),
    )


def _draw(axes: Axes, run: Run, one: Met, when: int) -> None:
    """Draw one panel: balls, wall, normal and tangent, paths and arrows."""
    largest = one.largest
    wide, high = panel_size(axes)
    reach = _AROUND * largest
    centre = one.touch if len(one.balls) > 1 else one.touch - 1.2 * largest * one.normal
    axes.set_xlim(centre[0] - reach * wide / high, centre[0] + reach * wide / high)
    axes.set_ylim(centre[1] - reach, centre[1] + reach)
    if run.system.wall is not None:
        draw_wall(axes, run.system.wall)
    across = np.array([-one.normal[1], one.normal[0]])
    far = 2.0 * reach
    axes.plot(*_line(one.touch, one.normal, far), zorder=1.5, **style.AXIS)
    axes.plot(*_line(one.touch, across, 1.35 * largest), zorder=2.0, **_TANGENT)
    fastest = one.fastest
    drawn = [np.linspace(one.touch - far * one.normal, one.touch + far * one.normal, 80)]
    names = [Named("$T$", one.touch)]
    spinning = np.nanmax([*(omega for ball in one.balls for omega in ball.omega), 1e-300])
    for ball, side in zip(one.balls, (1.0, -1.0), strict=False):
        colour = str(body_look(ball.number)["color"])
        velocity = ball.velocity[when]
        draw_disc(axes, ball.centre, ball.radius, colour, 0.16)
        drawn += _draw_motion(axes, ball, when, largest, fastest, float(spinning))
        component = float(velocity @ one.normal) * one.normal * (_LONGEST * largest / fastest)
        offset = side * _APART * largest * across
        arrow(axes, one.touch + offset, component, colour, NORMAL)
        names.append(Named(rf"$C_{{{ball.number}}}$", ball.centre))
        names += _draw_angle(axes, one, ball, when, 1.25 * ball.radius, colour)
    axes.plot(*one.touch, marker="o", markersize=1.6, color=style.BLACK, zorder=4.0)
    write_names(axes, names, np.concatenate(drawn))


def _line(middle: Array, along: Array, reach: float) -> Array:
    return np.transpose([middle - reach * along, middle + reach * along])


def _draw_motion(
    axes: Axes, ball: Arriving, when: int, largest: float, fastest: float, spinning: float
) -> list[Array]:
    """Draw the path and the arrows of one ball; return points along them.

    The angular velocity lies along the horizontal axis of rolling, to the left of the velocity.
    """
    velocity, colour = ball.velocity[when], str(body_look(ball.number)["color"])
    speed = float(np.hypot(*velocity))
    if not speed:
        return [ball.centre + ball.radius * _RING]
    along = velocity / speed
    path = np.array([ball.centre, ball.centre + (8.0 if when else -8.0) * largest * along])
    axes.plot(*path.T, color=colour, zorder=1.9, **_PATH)
    reach = _LONGEST * largest / fastest * velocity
    drawn = [arrow(axes, ball.centre, reach, colour, CENTRE), np.linspace(path[0], path[1], 40)]
    if not math.isnan(ball.omega[when]):
        turned = np.array([-along[1], along[0]])
        turned = _TURNING * largest * ball.omega[when] / spinning * turned
        drawn.append(arrow(axes, ball.centre, turned, colour, ROLLING))
    return [*drawn, ball.centre + ball.radius * _RING]


def _draw_angle(
    axes: Axes, one: Met, ball: Arriving, when: int, radius: float, colour: str
) -> list[Named]:
    """Draw the angle between the path and the normal as an arc; return its label."""
    angle = ball.angle[when]
    if math.isnan(angle) or angle < _LEAST:
        return []
    velocity = ball.velocity[when] if when else -ball.velocity[when]
    nearest = one.normal if float(velocity @ one.normal) >= 0.0 else -one.normal
    start = math.atan2(nearest[1], nearest[0])
    turn = float(nearest[0] * velocity[1] - nearest[1] * velocity[0])
    angles = start + math.copysign(1.0, turn) * np.linspace(0.0, angle, 40)
    points = ball.centre + radius * np.column_stack([np.cos(angles), np.sin(angles)])
    axes.plot(*points.T, color=colour, linewidth=0.5, zorder=2.4)
    return [Named(_angle_symbol(ball.number, when), points[len(points) // 2], colour)]


def _angle_symbol(number: int, when: int) -> str:
    """Return α₁ or, after the impact, α₁′.

    The prime is no part of the formula, where it would be small and too high, and push the index
    down to the panel.
    """
    return rf"$\alpha_{{{number}}}$" + "′" * when


def _write_heading(axes: Axes, one: Met, when: int) -> None:
    after = "after" if one.made else "after (inadmissible)"
    write_over(axes, 0.0, 3, after if when else f"{one.title}, {short_number(one.time)} s: before")
    rows = (
        (2, "v", "m/s", [ball.speed for ball in one.balls]),
        (1, r"\omega", "rad/s", [ball.omega for ball in one.balls]),
    )
    for level, symbol, unit, values in rows:
        symbols = [rf"${symbol}_{{{ball.number}}}$" for ball in one.balls]
        write_values(axes, _COLUMNS, level, symbols, values, when, unit)
    for ball, left in zip(one.balls, _COLUMNS, strict=False):
        angle = math.degrees(ball.angle[when])
        if not math.isnan(angle):
            symbol = _angle_symbol(ball.number, when)
            write_value(axes, left, 0, symbol, f"{short_number(angle, 3)}°")


def table_contact_points(run: Run, width: str = "single") -> Figure | None:
    """Draw the possible contact points of the first impact, of balls or on the wall (C figs 2a, 3).

    α is the arrival angle of each ball, unless it arrives along the normal.
    """
    found = _first_met(run, 1)
    if not found:
        return None
    met, bodies = found[0], []
    for ball, other in zip(met.balls, met.balls[::-1], strict=True):
        both = ball.radius + other.radius
        above = (other.radius - ball.radius) / both if both > 0.0 else 0.0
        ahead = math.sqrt(max(1.0 - above * above, 0.0))
        aside = ball.angle[0] if ball.angle[0] >= _LEAST_ASIDE else ASIDE
        body = run.system.bodies[ball.number - 1]
        bodies.append(Rolling(body, ball.number, ball.speed[0], ahead, above, aside))
    return figure_of(bodies, width)


_ROOM = 0.03
"""Margin, as a fraction of the size of the scene."""


def film(run: Any, times: Array) -> Frames:
    """Return the positions of all balls at the times of frames (s).

    Paths are straight between events, so a trail needs points at frames and events only.
    """
    bodies, times = run.system.bodies, np.asarray(times)
    sampled = run.sample(times)
    x, y = (np.asarray(sampled[name]).reshape(len(times), len(bodies)) for name in "xy")
    trails = tuple(
        trail(times, math.inf, [(times, x[:, n], y[:, n], 2), *_events(run, n)])
        for n in range(len(bodies))
    )
    span = float(times[-1] - times[0])
    return Frames(_ground(run, x, y), times, x, y, None, x, y, trails, span)


def _events(run: Any, ball: int) -> Iterator[States]:
    """Yield the positions of a ball (from 0) at its impacts on other balls and on the wall."""
    bounces = run.table("bounces")
    for table, end in ((run.collisions, "_a"), (run.collisions, "_b"), (bounces, "")):
        rows = np.flatnonzero(np.asarray(table[f"ball{end}"]) == ball + 1)
        time, x, y = (
            np.asarray(table[name], dtype=np.float64)[rows] for name in ("t", f"x{end}", f"y{end}")
        )
        yield time, x, y, 0


def _ground(run: Any, x: Array, y: Array) -> Ground:
    """Return the wall, or without one the part of the table that the balls visit."""
    wall, radii = run.system.wall, tuple(body.radius for body in run.system.bodies)
    low = np.array([np.min(x - radii), np.min(y - radii)])
    high = np.array([np.max(x + radii), np.max(y + radii)])
    low, high = with_wall(wall, low, high)
    room = _ROOM * float(np.max(high - low))

    def draw(axes: Axes, half: float) -> None:
        if wall is not None:
            draw_wall(axes, wall)

    return Ground(radii, low - room, high + room, draw, "the table from above", None)


def table_energies(run: Run, width: str = "single") -> Figure | None:
    """Draw the energy of each ball and of all against time, and the losses of the impacts.

    Returns None for a single ball that loses no energy.
    """
    lost = losses_of(run.collisions, run.bounces)
    if len(run.system.bodies) == 1 and not np.any(lost[1] > 0.0):
        return None
    times = run.end_time, run.end_time
    return energy_chart(run, _energy, lost, [], times, width)


def _energy(run: Run, ball: int, until: float) -> tuple[Array, Array]:
    """Return times (s) up to `until` and the energies (J) of a ball (from 1) at these times.

    Jumps have two equal times.
    """
    motion: Any = run.trajectory
    events, body = motion.balls[ball - 1], run.system.bodies[ball - 1]
    energy = 0.5 * body.rolling_mass * (events["vx"] ** 2 + events["vy"] ** 2)
    ends = np.append(events["t"][1:], until)
    return np.column_stack([events["t"], ends]).ravel(), np.repeat(energy, 2)


FIGURES = {
    "plan": Kind(
        table_plan,
        "Plan of the table",
        "The wall, the path of every ball from its start, where its number stands, and the balls "
        "as they touch; if there are few impacts, black arrows show the velocities at the start, "
        "and before (open) and after (filled) each impact. As C figs 1 and 4.",
    ),
    "velocities": Kind(
        table_velocities,
        "Plan of velocities and angles",
        "The first impacts from above, before and after: velocities and paths of the centres C, "
        "components along the normal, angular velocities along the axes of rolling, the tangent at "
        "the impact point T, and the arrival angle α and the outgoing angle α′ between the path "
        "and the normal. As C figs 1, 2b, 2c and 4.",
        needs="there is an impact",
    ),
    "contact_points": Kind(
        table_contact_points,
        POINTS_TITLE,
        POINTS_CAPTION + " As C figs 2a and 3.",
        needs="there is an impact",
    ),
    "energy": Kind(
        table_energies,
        "Energies",
        ENERGY_CAPTION,
        needs="there are several balls, or one loses energy",
    ),
    "intervals": INTERVALS,
    "exponents": EXPONENTS,
}
