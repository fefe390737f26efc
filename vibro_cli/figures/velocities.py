"""The plan of velocities of impacts, before and after (A fig. 1a, B figs 5 and 7)."""

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
from vibro_cli.figures.chart import body_look, legend
from vibro_cli.figures.source import Array, Recorded
from vibro_cli.figures.style import MM, WIDTHS
from vibro_cli.mechanics.body import Body
from vibro_cli.mechanics.trace import Piece

_IMPACTS = {"single": 2, "double": 4}
_BESIDE = {"single": 1, "double": 2}
"""Impacts side by side, each with its two panels."""
_HIGH = 30.0
_TOP = 5.5
_WORDS = 10.5
"""Room for the words above a panel (mm)."""
_COLUMNS = (0.0, 17.0)
"""Where the values of the two bodies stand (mm from the edge of a panel)."""
_SYMBOL = 3.7
"""Room for a symbol before its value (mm)."""
_GAP = 2.0
_BOTTOM = 2.0
_AROUND = 2.6
"""Half the width of a panel, in radii of the larger body."""
_LONGEST = 1.5
"""Length of the longest arrow, in the same radii."""
_APART = 0.11
"""Distance of the components from the line of centres, in the same radii."""
_DENSE = 721
"""Points of each piece of the trace."""
_TINY = 2e-3
"""An arrow shorter than this share of the panel is left out."""
_HEAD = 0.05
"""Length of an arrow's head, as a share of the panel."""
_SLIM = 0.36
"""Half its width, as a share of its length."""
_BUTT: dict[str, Any] = {"solid_capstyle": "butt", "dash_capstyle": "butt"}
CENTRE: dict[str, Any] = {"linewidth": 1.1, "linestyle": "solid"}
TOUCHING: dict[str, Any] = {"linewidth": 0.7, "linestyle": (0, (2.5, 1.2))}
NORMAL: dict[str, Any] = {"linewidth": 1.8, "linestyle": "solid"}
_SURFACE: dict[str, Any] = {"color": style.BLACK, "linewidth": 0.7}
_AXIS: dict[str, Any] = {
    "color": style.FRAME_GREY,
    "linewidth": 0.4,
    "linestyle": (0, (6, 1.5, 1, 1.5)),
}
_SAY: dict[str, Any] = {"fontsize": style.SMALL, "color": style.FRAME_GREY}


@dataclass(frozen=True)
class Striking:
    """One of the two bodies of an impact; vectors in the plane, shape (2,)."""

    body: Body
    number: int
    centre: Array
    """Place of the centre (m)."""
    resting: Array
    """The point of the trace it rolls on (m)."""
    tangent: Array
    """Unit tangent of the trace there."""
    speed: tuple[float, float]
    """Speed of the centre before and after (m/s)."""
    omega: tuple[float, float]
    """Angular velocity about the contact point before and after (rad/s)."""

    def velocity(self, point: Array, when: int) -> Array:
        """Return the velocity (m/s) of the body's point there, before (0) or after (1)."""
        if self.body.kind == "particle":  # it slides and does not turn
            return self.speed[when] * self.tangent
        reach = point - self.resting
        return self.speed[when] / self.body.radius * np.array([reach[1], -reach[0]])


def velocities(run: Recorded, width: str = "single") -> Figure | None:
    """Return the velocities before and after the first impacts, of centres and touching points.

    Arrows at the centres are their velocities; where the bodies touch, those of the touching points
    (as points of the rolling bodies) and their components along the line of centres. None without
    an impact. Raises ValueError for a width that is neither `single` nor `double`.
    """
    if width not in WIDTHS:
        raise ValueError(f"unknown width {width!r}, expected one of {', '.join(WIDTHS)}")
    rows = range(min(_IMPACTS[width], len(run.collisions["n"])))
    if not rows:
        return None
    with style.journal():
        figure, panels = _sheet(width, len(rows))
        surface = _surface(run)
        for row in rows:
            pair = striking(run, row)
            scale = _arrow_scale(pair)
            for when in (0, 1):
                axes = panels[2 * row + when]
                _draw(axes, surface, pair, when, scale)
                _say(axes, run, row, pair, when)
        _draw_legend(figure)
    return figure


def striking(run: Recorded, row: int) -> tuple[Striking, Striking]:
    """Return the two bodies of the impact in a row of the table (from 0), the left one first."""
    one, other = (_striking(run, row, side) for side in "ab")
    return one, other


def _striking(run: Recorded, row: int, side: str) -> Striking:
    table = {name: column[row] for name, column in run.collisions.items()}
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


def _arrow_scale(pair: Sequence[Striking]) -> float:
    """Return the length on the plan (m) of 1 m/s, for all arrows of an impact."""
    touch, _ = touching_point(pair)
    lengths = [
        float(np.hypot(*one.velocity(point, when)))
        for one in pair
        for point in (one.centre, touch)
        for when in (0, 1)
    ]
    largest = max(one.body.radius for one in pair)
    return _LONGEST * largest / (max(lengths) or 1.0)


def _sheet(width: str, impacts: int) -> tuple[Figure, list[Axes]]:
    """Return a figure with two empty panels for each impact, in the order of the impacts."""
    beside = min(_BESIDE[width], impacts)
    rows = math.ceil(impacts / beside)
    wide = WIDTHS[width]
    cell = (wide - _GAP) / (2 * _BESIDE[width]) - _GAP
    total = _TOP + rows * (_WORDS + _HIGH + _GAP) + _BOTTOM
    figure = Figure(figsize=(wide * MM, total * MM))
    panels = []
    for place in range(2 * impacts):
        row, column = divmod(place, 2 * beside)
        left = _GAP + column * (cell + _GAP)
        bottom = total - _TOP - (row + 1) * (_WORDS + _HIGH) - row * _GAP
        axes = figure.add_axes((left / wide, bottom / total, cell / wide, _HIGH / total))
        axes.set_xticks([])
        axes.set_yticks([])
        panels.append(axes)
    return figure, panels


def _surface(run: Recorded) -> Array:
    """Return points of the trace (m), dense enough for a close view, also on lines."""
    points = [
        piece.contact_point(float(place))
        for piece in run.system.trace.pieces
        for place in np.linspace(piece.angle_start, piece.angle_end, _DENSE)
    ]
    return np.array(points)


def _draw(axes: Axes, surface: Array, pair: Sequence[Striking], when: int, scale: float) -> None:
    """Draw trace, bodies and arrows of one panel."""
    touch, normal = touching_point(pair)
    largest = max(one.body.radius for one in pair)
    _frame(axes, 0.5 * (pair[0].centre + pair[1].centre), largest)
    _draw_trace(axes, surface)
    along = np.array([touch - _AROUND * largest * normal, touch + _AROUND * largest * normal])
    axes.plot(along[:, 0], along[:, 1], zorder=1.5, **_AXIS)
    across = np.array([-normal[1], normal[0]]) * _APART * largest
    for one, offset in zip(pair, (across, -across), strict=True):
        colour = body_look(one.number)["color"]
        _draw_body(axes, one, colour)
        _arrow(axes, one.centre, scale * one.velocity(one.centre, when), colour, CENTRE)
        there = one.velocity(touch, when)
        _arrow(axes, touch, scale * there, colour, TOUCHING)
        component = float(there @ normal) * normal
        _arrow(axes, touch + offset, scale * component, colour, NORMAL)
    axes.plot(*touch, marker="o", markersize=1.6, color=style.BLACK, zorder=4.0)


def _frame(axes: Axes, middle: Array, largest: float) -> None:
    figure = axes.get_figure(root=True)
    assert figure is not None
    box = axes.get_position()
    shape = box.height * figure.get_figheight() / (box.width * figure.get_figwidth())
    reach = _AROUND * largest
    axes.set_xlim(middle[0] - reach, middle[0] + reach)
    axes.set_ylim(middle[1] - reach * shape, middle[1] + reach * shape)


def _draw_trace(axes: Axes, surface: Array) -> None:
    """Draw what of the trace is near; the rest would only make the file larger."""
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    centre, half = np.array([left + right, low + high]) / 2.0, np.array([right - left, high - low])
    near = np.all(np.abs(surface - centre) < 1.5 * half, axis=1)
    near[1:] |= near[:-1].copy()  # with the neighbours, for a long line has no point within
    near[:-1] |= near[1:].copy()
    shown = np.where(near[:, None], surface, np.nan)
    axes.plot(shown[:, 0], shown[:, 1], zorder=2.0, **_SURFACE)


def _draw_body(axes: Axes, one: Striking, colour: str) -> None:
    look: dict[str, Any] = {"facecolor": colour, "alpha": 0.18, "edgecolor": "none"}
    axes.add_patch(Circle(tuple(one.centre), one.body.radius, zorder=1.8, **look))
    edge: dict[str, Any] = {"facecolor": "none", "edgecolor": style.BLACK, "linewidth": 0.5}
    axes.add_patch(Circle(tuple(one.centre), one.body.radius, zorder=2.1, **edge))
    axes.plot(*one.centre, marker="o", markersize=1.6, color=style.BLACK, zorder=4.0)
    axes.plot(*one.resting, marker="o", markersize=1.6, color=style.BLACK, zorder=4.0)


def _arrow(axes: Axes, tail: Array, reach: Array, colour: str, look: dict[str, Any]) -> None:
    """Draw an arrow, its head whole whatever the dashes of its shaft."""
    low, high = axes.get_xlim()
    length = float(np.hypot(*reach))
    if length < _TINY * (high - low):
        return
    along = reach / length
    side = np.array([-along[1], along[0]])
    head = min(_HEAD * (high - low), 0.6 * length)
    tip, neck = tail + reach, tail + reach - head * along
    axes.plot(*np.transpose([tail, neck]), color=colour, zorder=3.0, **look, **_BUTT)
    corners = np.array([tip, neck + _SLIM * head * side, neck - _SLIM * head * side])
    axes.add_patch(Polygon(corners, facecolor=colour, edgecolor="none", zorder=3.1))


def _say(axes: Axes, run: Recorded, row: int, pair: Sequence[Striking], when: int) -> None:
    """Write the values above a panel."""
    number, time = int(run.collisions["n"][row]), float(run.collisions["t"][row])
    sides = "before" if when == 0 else "after"
    made = bool(run.collisions["admissible"][row]) or bool(run.collisions["substituted"][row])
    if when == 1 and not made:
        sides = "after (inadmissible)"
    title = f"impact {number}, {time:.4g} s: {sides}" if when == 0 else sides
    _write(axes, 0.0, 2, title)
    for line, symbol, unit in ((1, "v", "m/s"), (0, r"\omega", "rad/s")):
        for one, left in zip(pair, _COLUMNS, strict=True):
            value = one.speed[when] if symbol == "v" else one.omega[when]
            _write(axes, left, line, f"${symbol}_{{{one.number}}}$")
            after = f" {unit}" if one is pair[1] else ""
            _write(axes, left + _SYMBOL, line, f"= {_number(value)}{after}")


def _write(axes: Axes, left: float, line: int, text: str) -> None:
    """Write above a panel, `left` mm from its edge, in a line counted from below.

    Symbols stand alone: a formula takes long to set, and equal ones are set once.
    """
    figure = axes.get_figure(root=True)
    assert figure is not None
    wide = axes.get_position().width * figure.get_figwidth() / MM
    high = 1.0 + (0.9 + 3.3 * line) / _HIGH
    axes.text(left / wide, high, text, transform=axes.transAxes, va="baseline", **_SAY)


def _number(value: float) -> str:
    """Return a number with three digits, the minus a minus."""
    return f"{value:.3g}".replace("-", "−")


def _draw_legend(figure: Figure) -> None:
    black = {"color": style.BLACK}
    legend(
        figure,
        [
            ("centre", CENTRE | black),
            ("touching point", TOUCHING | black),
            ("along the line of centres", NORMAL | black),
        ],
    )
