"""Diagrams of velocities before and after impacts (A fig. 1a, B figs 5 and 7)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon

from vibro_cli.figures import style
from vibro_cli.figures.chart import Cell, body_look, in_rows
from vibro_cli.figures.labels import (
    SMALL_TEXT,
    Entry,
    Named,
    Rows,
    draw_legend,
    in_black,
    ring,
    room_for,
    rows_of,
    short_number,
    text_width,
    write_names,
)
from vibro_cli.figures.runs.scene import trace_points
from vibro_cli.figures.source import Array, Recorded, first_of, goes_through, why_not_made
from vibro_cli.figures.style import Look, line, panel_size, width_of
from vibro_cli.figures.ticks import round_below
from vibro_cli.mechanics.system import Body
from vibro_cli.mechanics.trace import Piece
from vibro_cli.systems.columns import made

_IMPACTS = {"single": 2, "double": 4}
_BESIDE = {"single": 1, "double": 2}
"""Number of impacts side by side, each with its two panels."""
_HIGH = 33.0
_TOP = 5.0
"""Room for the first row of the legend (mm)."""
_WORDS = 10.5
"""Room for the words above a panel (mm)."""
_COLUMNS = (0.0, 18.5)
"""Left edges of the values of the two bodies (mm from the edge of a panel)."""
_SYMBOL, _DIGIT = 3.7, 1.0
"""Room for a symbol before its value, and for each digit of its index from the third on (mm)."""
_PLAIN = (1e-3, 1e3)
"""Range of the greatest value whose unit has no prefix."""
_SMALL = 1e-4
"""A scaled value below this is written with one digit and a power of ten."""
_PREFIX = {-12: "p", -9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G", 12: "T"}
_GAP = 2.0
_BOTTOM = 2.0
_AROUND = 2.6
"""Half the width of a panel, in radii of the larger body."""
_LONGEST = 1.5
"""Length of the longest arrow, in the same radii."""
_APART = 0.11
"""Distance of the components from the line of centres, in the same radii."""
_DENSE = 721
"""Points of each piece of the trace: enough for a close view, also on lines."""
_ALONG = 1.0 - 1e-9
"""Least cosine of the angle between a path and the line of centres that count as parallel."""
_TINY = 2e-3
"""An arrow shorter than this share of the panel is left out."""
_HEAD = 0.05
"""Length of an arrow's head, as a share of the panel."""
_SCALE = 8.0
"""Greatest length of the scale arrow (mm)."""
_RING = ring(90)
_SLIM = 0.36
"""Half the width of an arrow's head, as a share of its length."""
_BUTT: dict[str, Any] = {"solid_capstyle": "butt", "dash_capstyle": "butt"}
CENTRE = line(None, 1.1)
TOUCHING = line(None, 0.7, (2.5, 1.2))
ROLLING = line(None, 0.7, (0.9, 0.9))
TURNING = line(None, 0.9)
NORMAL = line(None, 1.8)
TANGENT = line(None, 0.6)
_SURFACE = line(style.BLACK, 0.7)
_LEGEND = in_black(
    ("centre $C$", CENTRE),
    ("due to rolling at $T$", ROLLING),
    ("impact point $T$", TOUCHING),
    ("along the line of centres", NORMAL),
    (r"$\omega$", TURNING),
    ("tangent", TANGENT),
)
_SLIDING = [_LEGEND[0], _LEGEND[3], _LEGEND[-1]]
"""The legend if no body rolls."""
_IN_LINE = [_LEGEND[0], _LEGEND[-1]]
"""The legend if all bodies are in translation along the line of centres."""


@dataclass(frozen=True)
class Striking:
    """One of the two bodies of an impact; vectors have shape (2,)."""

    body: Body
    number: int
    centre: Array
    """Place of the centre (m)."""
    resting: Array
    """Its contact point with the trace (m)."""
    tangent: Array
    """Unit tangent of the trace there."""
    speed: tuple[float, float]
    """Speed of the centre before and after (m/s)."""
    omega: tuple[float, float]
    """Angular velocity about the contact point before and after (rad/s); NaN for a particle."""

    def velocity(self, point: Array, when: int) -> Array:
        """Return the velocity (m/s) of the body at a point, before (0) or after (1) the impact."""
        if self.body.slides:  # all of its points have the same velocity
            return self.speed[when] * self.tangent
        reach = point - self.resting
        return self.speed[when] / self.body.radius * np.array([reach[1], -reach[0]])

    def rolling(self, point: Array, when: int) -> Array:
        """Return the velocity at a point relative to the centre (m/s), due to rotation."""
        return self.velocity(point, when) - self.speed[when] * self.tangent


def velocities(run: Recorded, width: str = "single") -> Figure | None:
    """Draw the velocities of centres and impact points before and after the first impacts.

    Arrows at the centres are the velocities of the centres. Arrows at the impact point are the
    velocities there of both bodies, the parts due to rolling, and the components along the line of
    centres. Arcs around the centres are angular velocities. Returns None without an impact.
    """
    width_of(width)
    rows = range(min(_IMPACTS[width], len(run.collisions["n"])))
    if not rows:
        return None
    width = "single" if len(rows) == 1 else width
    pairs = [striking(run, row) for row in rows]
    with style.journal():
        lines = rows_of(_legend(pairs), width_of(width))
        figure, panels = sheet(width, len(rows), lines, _HIGH, _WORDS)
        surface = trace_points(run.system.trace, _DENSE, _DENSE)
        for row, pair in zip(rows, pairs, strict=True):
            scale = _arrow_scale(pair)
            for when in (0, 1):
                axes = panels[2 * row + when]
                _draw(axes, surface, pair, when, scale)
                _write_heading(axes, run, row, pair, when)
            draw_scale(panels[2 * row + 1], scale)
        draw_legend(figure, lines)
    return figure


def striking(run: Recorded, row: int) -> tuple[Striking, Striking]:
    """Return the two bodies of the impact in a row of the table (from 0), the left one first."""
    one, other = (_striking(run, row, side) for side in "ab")
    return one, other


def _striking(run: Recorded, row: int, side: str) -> Striking:
    impacts = first_of(run.collisions, row + 1)
    table = {name: column[row] for name, column in impacts.items()}
    number = int(table[f"ball_{side}"])
    piece: Piece = run.system.trace.pieces[int(table[f"arc_{side}"]) - 1]
    position = float(table[f"angle_{side}"])
    if piece.is_line:
        position = float(table[f"s_{side}"]) - piece.start_s
    slope = piece.slope(position)
    return Striking(
        body=run.system.bodies[number - 1],
        number=number,
        centre=np.array([table[f"x_{side}"], table[f"y_{side}"]], dtype=np.float64),
        resting=np.array(piece.contact_point(position)),
        tangent=np.array([math.cos(slope), math.sin(slope)]),
        speed=(float(table[f"speed_{side}_pre"]), float(table[f"speed_{side}_post"])),
        omega=(float(table[f"omega_{side}_pre"]), float(table[f"omega_{side}_post"])),
    )


def touching_point(pair: Sequence[Striking]) -> tuple[Array, Array]:
    """Return where two bodies touch (m) and the unit vector from the left one to the other."""
    one, other = pair
    line = other.centre - one.centre
    normal = line / float(np.hypot(*line))
    return one.centre + one.body.radius * normal, normal


def _in_line(pair: Sequence[Striking]) -> bool:
    """Return whether both bodies are in translation along their line of centres (B fig. 1)."""
    _, normal = touching_point(pair)
    return all(one.body.slides and abs(float(one.tangent @ normal)) > _ALONG for one in pair)


def _legend(pairs: Sequence[Sequence[Striking]]) -> list[Entry]:
    if all(map(_in_line, pairs)):
        return _IN_LINE
    return _SLIDING if all(one.body.slides for pair in pairs for one in pair) else _LEGEND


def _arrow_scale(pair: Sequence[Striking]) -> float:
    """Return the length (m) of an arrow of 1 m/s, for all arrows of an impact."""
    touch, _ = touching_point(pair)
    lengths = [
        float(np.hypot(*one.velocity(point, when)))
        for one in pair
        for point in (one.centre, touch)
        for when in (0, 1)
    ]
    largest = max(one.body.radius for one in pair)
    return _LONGEST * largest / (max(lengths) or 1.0)


def sheet(
    width: str, impacts: int, legend: Rows, high: float, words: float
) -> tuple[Figure, list[Axes]]:
    """Return a figure with two empty panels for each impact, in the order of the impacts.

    Room is left for `legend` above them. `high` is the height of a panel, `words` the room above
    each (mm).
    """
    wide, beside = width_of(width), min(_BESIDE[width], impacts)
    inner = (wide - _GAP) / (2 * _BESIDE[width]) - _GAP
    cell = Cell(inner, high, words, _GAP, _GAP)
    top = room_for(legend, _TOP)
    sheet, corners = in_rows(cell, 2 * impacts, 2 * beside, wide, _GAP, top, _BOTTOM)
    return sheet.figure, [sheet.blank(*corner, inner, high) for corner in corners]


def _draw(axes: Axes, surface: Array, pair: Sequence[Striking], when: int, scale: float) -> None:
    """Draw the trace, bodies and arrows of one panel."""
    touch, normal = touching_point(pair)
    largest = max(one.body.radius for one in pair)
    _frame(axes, 0.5 * (pair[0].centre + pair[1].centre), largest)
    axes.plot(*surface.T, zorder=2.0, **_SURFACE)
    along = np.array([touch - _AROUND * largest * normal, touch + _AROUND * largest * normal])
    axes.plot(along[:, 0], along[:, 1], zorder=1.5, **style.AXIS)
    across = np.array([-normal[1], normal[0]]) * _APART * largest
    fastest = max(abs(omega) for one in pair for omega in one.omega)
    aside = np.array([-normal[1], normal[0]]) * 1.3 * largest
    axes.plot(*np.transpose([touch - aside, touch + aside]), color=style.BLACK, zorder=2.0,
              **TANGENT)  # fmt: skip
    drawn = [along, np.linspace(touch - aside, touch + aside, 20)]
    for one, offset in zip(pair, (across, -across), strict=True):
        colour = body_look(one.number)["color"]
        draw_disc(axes, one.centre, one.body.radius, colour, 0.18)
        axes.plot(*one.resting, marker="o", markersize=1.6, color=style.BLACK, zorder=4.0)
        arrows = [(one.centre, one.velocity(one.centre, when), CENTRE)]
        if not one.body.slides:
            arrows += [
                (touch, one.rolling(touch, when), ROLLING),
                (touch, one.velocity(touch, when), TOUCHING),
            ]
        if not _in_line(pair):
            component = float(one.velocity(touch, when) @ normal) * normal
            arrows.append((touch + offset, component, NORMAL))
        for tail, velocity, look in arrows:
            drawn.append(arrow(axes, tail, scale * velocity, colour, look))
        drawn.append(_draw_turning(axes, one, when, fastest, colour))
    axes.plot(*touch, marker="o", markersize=1.6, color=style.BLACK, zorder=4.0)
    _name_points(axes, pair, touch, np.concatenate(drawn))


def _draw_turning(axes: Axes, one: Striking, when: int, fastest: float, colour: str) -> Array:
    """Draw the angular velocity as an arc around the centre; return its points.

    The arc begins above the centre. The greatest angular velocity of the impact is three quarters
    of a turn.
    """
    omega = one.omega[when]
    if not omega or math.isnan(omega) or abs(omega) < _TINY * fastest:
        return np.zeros((0, 2))
    reach = -1.5 * math.pi * omega / fastest  # rolling to the right is clockwise
    angles = 0.5 * math.pi + np.linspace(0.0, reach, 60)
    radius = 0.45 * one.body.radius
    points: Array = one.centre + radius * np.column_stack([np.cos(angles), np.sin(angles)])
    low, high = axes.get_xlim()
    head = min(0.7 * _HEAD * (high - low), 0.6 * radius * abs(reach))
    last = int(np.searchsorted(np.abs(angles - angles[0]), abs(reach) - head / radius))
    axes.plot(*points[: last + 1].T, color=colour, zorder=2.8, **TURNING, **_BUTT)
    along = points[-1] - points[last]
    draw_head(axes, points[-1], along / float(np.hypot(*along)), head, colour)
    return points


def _name_points(axes: Axes, pair: Sequence[Striking], touch: Array, drawn: Array) -> None:
    """Write the papers' names of centres, contact points and the impact point."""
    rings = [one.centre + one.body.radius * _RING for one in pair]
    names = [
        Named(f"${letter}_{{{one.number}}}$", point)
        for one in pair
        for letter, point in (("C", one.centre), ("P", one.resting))
    ]
    names.append(Named("$T$", touch))
    write_names(axes, names, np.concatenate([drawn, *rings]))


def draw_scale(axes: Axes, scale: float, line: int = 2) -> None:
    """Draw the scale, an arrow of a round speed, above the right end of a panel.

    `scale` is the length (m) of an arrow of 1 m/s; `line` counts the lines of text from below.
    """
    wide, high = panel_size(axes)
    (low, end), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    each = (end - low) / wide  # m for 1 mm
    speed = round_below(_SCALE * each / scale)
    text = with_unit(speed, "m/s")
    level = 1.0 + (1.9 + 3.3 * line) / high
    tip = np.array([end - (text_width(text) + 1.7) * each, bottom + level * (top - bottom)])
    along, reach = np.array([1.0, 0.0]), scale * speed
    head = min(1.8 * each, 0.6 * reach)
    shaft = np.array([tip - reach * along, tip - head * along])
    axes.plot(*shaft.T, clip_on=False, **CENTRE | {"color": style.BLACK} | _BUTT)
    draw_head(axes, tip, along, head, style.BLACK)
    axes.patches[-1].set_clip_on(False)
    axes.text(1.0, level, text, ha="right", va="center", transform=axes.transAxes, **SMALL_TEXT)


def _frame(axes: Axes, middle: Array, largest: float) -> None:
    wide, high = panel_size(axes)
    reach = _AROUND * largest
    axes.set_xlim(middle[0] - reach, middle[0] + reach)
    axes.set_ylim(middle[1] - reach * high / wide, middle[1] + reach * high / wide)


def draw_disc(axes: Axes, centre: Array, radius: float, colour: str, opacity: float) -> None:
    """Draw a body around its centre, shape (2,), with its edge and its centre (all in m)."""
    draw_circle(axes, centre, radius, colour, opacity)
    axes.plot(*centre, marker="o", markersize=1.6, color=style.BLACK, zorder=4.0)


def draw_circle(axes: Axes, centre: Array, radius: float, colour: str, opacity: float) -> None:
    """Draw a body around its centre, shape (2,), with its edge."""
    look: dict[str, Any] = {"facecolor": colour, "alpha": opacity, "edgecolor": "none"}
    axes.add_patch(Circle(tuple(centre), radius, zorder=1.8, **look))
    edge: dict[str, Any] = {"facecolor": "none", "edgecolor": style.BLACK, "linewidth": 0.5}
    axes.add_patch(Circle(tuple(centre), radius, zorder=2.1, **edge))


def arrow(axes: Axes, tail: Array, reach: Array, colour: str, look: Look) -> Array:
    """Draw an arrow whose head is solid even if its shaft is dashed.

    Returns points along it and along the edges of a strip half as wide as its head, shape (n, 2).
    """
    low, high = axes.get_xlim()
    points = np.linspace(tail, tail + reach, 20)
    length = float(np.hypot(*reach))
    if length < _TINY * (high - low):
        return points
    along = reach / length
    head = min(_HEAD * (high - low), 0.6 * length)
    tip, neck = tail + reach, tail + reach - head * along
    axes.plot(*np.transpose([tail, neck]), color=colour, zorder=3.0, **look, **_BUTT)
    draw_head(axes, tip, along, head, colour)
    side = 0.5 * _SLIM * head * np.array([-along[1], along[0]])
    return np.concatenate([points, points + side, points - side])


def draw_head(axes: Axes, tip: Array, along: Array, head: float, colour: str) -> None:
    """Draw the head of an arrow; `along` is its direction as a unit vector."""
    neck, side = tip - head * along, np.array([-along[1], along[0]])
    corners = np.array([tip, neck + _SLIM * head * side, neck - _SLIM * head * side])
    axes.add_patch(Polygon(corners, facecolor=colour, edgecolor="none", zorder=3.1))


def _write_heading(
    axes: Axes, run: Recorded, row: int, pair: Sequence[Striking], when: int
) -> None:
    number, time = int(run.collisions["n"][row]), float(run.collisions["t"][row])
    sides = "before" if when == 0 else "after"
    known = first_of(run.collisions, row + 1)
    if when == 1 and not made(known)[row]:
        sides = f"after ({why_not_made(goes_through(known)[row])})"
    title = f"impact {number}, {short_number(time)} s: {sides}" if when == 0 else sides
    write_over(axes, 0.0, 2, title)
    for level, symbol, unit in ((1, "v", "m/s"), (0, r"\omega", "rad/s")):
        symbols = [f"${symbol}_{{{one.number}}}$" for one in pair]
        values = [one.speed if symbol == "v" else one.omega for one in pair]
        write_values(axes, _COLUMNS, level, symbols, values, when, unit)
    impulse = float(run.collisions["impulse"][row])
    if when == 1 and all(one.body.slides for one in pair) and not math.isnan(impulse):
        write_value(axes, 0.0, 0, "$K$", f"{short_number(impulse, 3)} N s")


def write_values(
    axes: Axes,
    columns: Sequence[float],
    line: int,
    symbols: Sequence[str],
    values: Sequence[tuple[float, float]],
    when: int,
    unit: str,
) -> None:
    """Write the values of bodies before (0) or after (1) an impact above a panel, with their unit.

    The unit has a prefix if the greatest value, before or after, is long. NaN, such as the angular
    velocity of a particle, is left out. `columns` are the left edges of the symbols (mm from the
    edge of the panel).
    """
    there = [number for number, value in enumerate(values) if not math.isnan(value[when])]
    sizes = [abs(size) for value in values for size in value if not math.isnan(size)]
    power = _prefixed(max(sizes, default=0.0))
    for number in there:
        value = values[number][when] / 10.0**power
        text = short_number(value, 3 if abs(value) >= _SMALL else 1)
        after = f" {_PREFIX[power]}{unit}" if number == there[-1] else ""
        write_value(axes, columns[number], line, symbols[number], text + after)


def _prefixed(greatest: float) -> int:
    """Return the power of ten of the unit's prefix for the greatest of some values."""
    greatest = float(f"{greatest:.3g}")
    if not greatest or _PLAIN[0] <= greatest < _PLAIN[1]:
        return 0
    return min(max(3 * math.floor(math.log10(greatest) / 3.0), min(_PREFIX)), max(_PREFIX))


def with_unit(value: float, unit: str) -> str:
    """Return a value in three digits with its unit, with a prefix if the number is long."""
    power = _prefixed(abs(value))
    return f"{short_number(value / 10.0**power, 3)} {_PREFIX[power]}{unit}"


def write_value(axes: Axes, left: float, line: int, symbol: str, value: str) -> None:
    """Write a symbol and its value above a panel, `left` mm from its edge.

    The symbol is a text of its own: formulas are slow to typeset, and equal ones are cached.
    """
    digits = sum(map(str.isdigit, symbol))
    write_over(axes, left, line, symbol)
    write_over(axes, left + _SYMBOL + _DIGIT * max(digits - 2, 0), line, f"= {value}")


def write_over(axes: Axes, left: float, line: int, text: str) -> None:
    """Write a text above a panel, `left` mm from its edge, in a line counted from below."""
    wide, high = panel_size(axes)
    level = 1.0 + (0.9 + 3.3 * line) / high
    axes.text(left / wide, level, text, transform=axes.transAxes, va="baseline", **SMALL_TEXT)
