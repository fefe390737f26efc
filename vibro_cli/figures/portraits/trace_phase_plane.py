"""Phase portraits without a run: of a body on its trace, of several bodies, of a family.

The portrait of one body, or of several overlaid (particle, disk and ball), is drawn piece by piece
and along the whole trace, as speed of the centre against arc length. A family shows the latter side
by side for values of a parameter.
"""

from __future__ import annotations

from collections.abc import Sequence, Sized
from dataclasses import replace
from functools import lru_cache, partial
from itertools import chain

import numpy as np
from matplotlib.figure import Figure

from vibro_cli.analysis.levels import LevelCurve, separatrix_curves, speed_curves
from vibro_cli.analysis.singular import (
    FIGURE_EIGHT,
    SADDLE,
    Portrait,
    SingularPoint,
    condition,
)
from vibro_cli.figures import style
from vibro_cli.figures.chart import Sheet, body_look, distinct_lines
from vibro_cli.figures.labels import SMALL_TEXT, Entry, draw_legend, in_powers, rows_of, text_width
from vibro_cli.figures.portraits.family import Member, draw_family, name_points, shown_of
from vibro_cli.figures.portraits.layers import (
    Background,
    background,
    behind_entries,
    curves_at,
    draw_background,
    draw_curves,
    draw_points,
    level_energies,
    saddle_energies,
    through_saddles,
)
from vibro_cli.figures.portraits.panels import (
    BOTTOM,
    LEFT,
    RIGHT,
    Panel,
    Symbols,
    Window,
    label,
    lay_out,
    on_a_page,
    plane,
    straight,
)
from vibro_cli.figures.style import line, width_of
from vibro_cli.mechanics.trace import Piece, Trace

_ABOVE = 1.35
"""Level curves reach this multiple of the potential of the highest saddle or end of the trace."""
_MARGIN = 1.08
_MARGIN_ALONG = 1.04
_SYMBOLS = Symbols("$s$", "$v$")
JUNCTION = line(style.LEVEL_GREY, 0.4, (1, 2))
REST = line(style.SEPARATRIX_GREY, 1.6)
"""A level line: the body stays at rest anywhere on it."""
_HIGH = {"single": 44.0, "double": 50.0}
"""Height of the panel along the trace (mm)."""
_LINE = 3.1
"""Height of a line of text (mm)."""
_MOST_LINES = 6
_MOST_POINTS, _LEAST_POINTS = 97, 5
"""Points of a curve along the trace on each piece, ..."""
_ACROSS = 4000
"""... fewer if there would be more than this in all."""


def structure(portrait: Portrait, width: str = "single", bodies: str = "") -> Figure:
    """Draw the phase portrait of a body on the whole trace, in both coordinates.

    Above, piece by piece as in the papers: φ̇ against φ, ψ̇ against ψ, speed against arc length on
    lines; of very many pieces only the first. Below, speed against arc length along the trace, with
    the values E/(m g) of centres and saddles above it. `bodies` is the index of the symbols.
    """
    inner = width_of(width) - LEFT - RIGHT
    words = _words(portrait, inner)
    below = _HIGH[width] + BOTTOM + _LINE * len(words) + 1.0
    whole = portrait.landscape.trace.pieces
    pieces, others = on_a_page(whole, width, below=below)
    behind = _behind(portrait, pieces)
    along = behind_along(portrait)
    entries = [*behind_entries(behind, along), *_rest_entry([portrait]), *others]
    rows = rows_of(entries, width_of(width) - RIGHT)
    with style.journal():
        curves = (*behind.levels, *behind.separatrices, *behind.eights)
        shown = _windows(pieces, curves)
        sheet, panels = lay_out(shown, width, rows, below)
        for one in panels:
            draw_background(one, behind)
            _draw_rest(one, behind.points)
        label(panels, bodies)
        panel = _panel_below(sheet, width, _whole(portrait, along))
        draw_background(panel, along)
        _draw_trace(panel, portrait)
        name_points(panel, portrait.names, along)
        for number, line in enumerate(reversed(words)):
            height = BOTTOM + _HIGH[width] + 1.2 + number * _LINE
            sheet.write(LEFT, height, line, va="baseline", **SMALL_TEXT)
        draw_legend(sheet.figure, rows)
    return sheet.figure


def _behind(portrait: Portrait, pieces: Sequence[Piece]) -> Background:
    """Return curves and points of a portrait on some pieces, with separate figure eights."""
    landscape, (on_eight, others) = portrait.landscape, _saddles(portrait)
    behind = background(landscape, pieces, highest_energy(portrait), highest_place(portrait))
    eights = through_saddles(on_eight, partial(separatrix_curves, landscape, pieces))
    return replace(behind, eights=eights, separatrices=behind.separatrices if others else ())


def _saddles(portrait: Portrait) -> tuple[list[SingularPoint], list[SingularPoint]]:
    """Return the saddles of figure eights, and the others."""
    orbits = {trigger.saddle: trigger.orbit for trigger in portrait.triggers}
    saddles = [point for point in portrait.points if point.kind == SADDLE]
    on_eight = [point for point in saddles if orbits.get(point) == FIGURE_EIGHT]
    return on_eight, [point for point in saddles if orbits.get(point) != FIGURE_EIGHT]


def _windows(pieces: Sequence[Piece], curves: Sequence[LevelCurve]) -> list[Window]:
    """Return windows on pieces, as high as the curves on those that are arcs or lines."""
    lines = {piece.index: piece.is_line for piece in pieces}
    tops = {False: 0.0, True: 0.0}
    for curve in curves:
        is_line = lines[curve.piece]
        tops[is_line] = max(tops[is_line], float(np.max(curve.rate)))
    return [
        Window(piece, piece.angle_start, piece.angle_end, _MARGIN * (tops[piece.is_line] or 1.0))
        for piece in pieces
    ]


def _panel_below(sheet: Sheet, width: str, window: Window) -> Panel:
    """Return the panel along the trace, below those of the pieces."""
    size = width_of(width) - LEFT - RIGHT, _HIGH[width]
    return plane(sheet.panel(LEFT, BOTTOM, *size), window, _SYMBOLS)


def _words(portrait: Portrait, width: float) -> list[str]:
    """Return the text about triggers and heights in lines of a width (mm)."""
    said = []
    for trigger in portrait.triggers:
        names = "–".join(portrait.name(p) for p in (trigger.left, trigger.saddle, trigger.right))
        is_eight = trigger.orbit == FIGURE_EIGHT
        orbit = "homoclinic figure eight" if is_eight else f"{trigger.orbit} separatrix"
        said.append(f"{names}: trigger of coupled singular points, {orbit}")
        said.append(condition(portrait, trigger))
    said = said or ["no trigger of coupled singular points"]
    named = zip(portrait.names, portrait.points, strict=True)
    heights = ", ".join(f"{name} {portrait.height(point.energy):.4g} m" for name, point in named)
    meant = "height above the lowest position"
    if portrait.landscape.turning is not None:
        meant = "effective potential above its least value"
    values = [f"E/(m g), {meant}: {heights}"] if heights else []
    return [*_wrapped(said, width), *_wrapped(values, width)]


def _wrapped(said: Sequence[str], width: float) -> list[str]:
    """Return sentences in at most `_MOST_LINES` lines of a width (mm)."""
    lines: list[str] = []
    for one in said:
        first, *words = in_powers(one).split(" ")
        lines.append(first)
        for word in words:
            if len(lines) > _MOST_LINES:
                break
            longer = f"{lines[-1]} {word}"
            lines[-1:] = [longer] if text_width(longer) <= width else [lines[-1], word]
    return lines if len(lines) <= _MOST_LINES else [*lines[: _MOST_LINES - 1], "…"]


def highest_energy(portrait: Portrait) -> float:
    """Return the energy (J) up to which level curves are drawn."""
    landscape = portrait.landscape
    scale = landscape.weight * landscape.trace.length
    return _ABOVE * highest_place(portrait) or 0.1 * scale or landscape.body.mass


def highest_place(portrait: Portrait) -> float:
    """Return the greatest potential (J) of the saddles and ends of the trace.

    Some curve must pass it; otherwise the pieces beside it may have none.
    """
    landscape = portrait.landscape
    pieces = landscape.trace.pieces
    ends = (pieces[0], pieces[0].angle_start), (pieces[-1], pieces[-1].angle_end)
    barriers = [float(landscape.potential(piece, position)) for piece, position in ends]
    return max([*barriers, *(point.energy for point in portrait.points)])


@lru_cache(maxsize=1)  # for the other width of a figure
def behind_along(
    portrait: Portrait, most: int = _MOST_POINTS, shown: range | None = None
) -> Background:
    """Return curves and points of a portrait along the trace, with at most `most` points per piece.

    The curves are those on the pieces `shown`, given by their indices, by default on all.
    """
    landscape, (on_eight, others) = portrait.landscape, _saddles(portrait)
    count = _points_on_each(landscape.trace.pieces if shown is None else shown, most)
    curves = partial(speed_curves, landscape, count, shown=shown)
    highest, passed = highest_energy(portrait), highest_place(portrait)
    levels = level_energies(portrait.points, highest, passed)
    return Background(
        levels=tuple(chain.from_iterable(map(curves, levels))),
        points=_points_along(portrait),
        separatrices=through_saddles(others, curves),
        eights=through_saddles(on_eight, curves),
    )


def _points_on_each(pieces: Sized, most: int) -> int:
    return min(most, max(_LEAST_POINTS, _ACROSS // len(pieces)))


def _points_along(portrait: Portrait) -> tuple[SingularPoint, ...]:
    """Return the singular points with their places along the trace (m)."""
    return tuple(replace(point, piece=0, position=point.s) for point in portrait.points)


def _whole(portrait: Portrait, along: Background) -> Window:
    """Return the window that contains the whole trace and all curves along it."""
    curves = (*along.levels, *along.separatrices, *along.eights)
    return _along_window(portrait.landscape.trace, curves)


def _along_window(trace: Trace, curves: Sequence[LevelCurve]) -> Window:
    top = max((float(np.max(curve.rate)) for curve in curves), default=1.0) or 1.0
    return straight(0.0, trace.length, _MARGIN_ALONG * top)


def draw_junctions(panel: Panel, trace: Trace) -> None:
    """Draw the junctions of the pieces of a trace on a panel along it."""
    starts = (piece.start_s for piece in trace.pieces[1:])
    for place in distinct_lines(starts, panel.span, panel.width):
        panel.axes.axvline(place, zorder=0.9, **JUNCTION)


def _draw_trace(panel: Panel, portrait: Portrait) -> None:
    """Draw junctions and level lines on a panel along the trace."""
    draw_junctions(panel, portrait.landscape.trace)
    _draw_rest(panel, _points_along(portrait))


def _draw_rest(panel: Panel, points: Sequence[SingularPoint]) -> None:
    """Draw the level lines that lie on one piece, where a body can rest anywhere."""
    for point in points:
        if point.extent and point.piece == panel.piece.index:
            ends = np.array([0.0, point.extent]) + point.position + panel.shift
            panel.axes.plot(ends, [0.0, 0.0], zorder=1.3, **REST)


def _rest_entry(portraits: Sequence[Portrait]) -> list[Entry]:
    extended = any(point.extent for portrait in portraits for point in portrait.points)
    return [("line of equilibria", REST)] if extended else []


MOST = 6
"""Number of bodies that can be distinguished."""


def comparison(members: Sequence[tuple[str, Portrait]], width: str = "single") -> Figure:
    """Draw curves of equal height E/(m g) of several bodies, in both coordinates.

    For each body the separatrices and one level curve below and above them are drawn in its line
    style. Bodies that differ only in κ have the same curves, with rates proportional to 1/√κ.
    `members` are names and portraits on one trace. Raises ValueError for none and more than `MOST`.
    """
    if not 1 <= len(members) <= MOST:
        raise ValueError(f"a comparison has 1 to {MOST} members, found {len(members)}")
    first = members[0][1]
    trace = first.landscape.trace
    energies = [_energies(portrait, first) for _, portrait in members]
    landscapes = [portrait.landscape for _, portrait in members]
    below = _HIGH[width] + BOTTOM + 1.0
    pieces, others = on_a_page(trace.pieces, width, below=below)
    curves = [curves_at(one, pieces, at) for one, at in zip(landscapes, energies, strict=True)]
    count = _points_on_each(trace.pieces, 121)
    along = [
        [*chain.from_iterable(speed_curves(one, count, energy) for energy in at)]
        for one, at in zip(landscapes, energies, strict=True)
    ]
    entries = [
        (f"{name}, $\\kappa = {portrait.landscape.body.kappa:.4g}$", body_look(number))
        for number, (name, portrait) in enumerate(members, 1)
    ]
    rows = rows_of([*entries, *others], width_of(width) - RIGHT)
    with style.journal():
        shown = _windows(pieces, [*chain(*curves)])
        sheet, panels = lay_out(shown, width, rows, below)
        panel = _panel_below(sheet, width, _along_window(trace, [*chain(*along)]))
        for number, (_, portrait) in enumerate(members, 1):
            for one in panels:
                draw_curves(one, curves[number - 1], 2.0, body_look(number))
                draw_points(one, portrait.points, 2.5)
            draw_curves(panel, along[number - 1], 2.0, body_look(number))
        label(panels, "")
        draw_junctions(panel, trace)
        draw_points(panel, _points_along(first), 2.5)
        draw_legend(sheet.figure, rows)
    return sheet.figure


def _energies(portrait: Portrait, first: Portrait) -> list[float]:
    """Return the energies (J) of a body's curves: its saddles, and heights from the first body."""
    saddles = saddle_energies(portrait.points)
    tops = [first.height(energy) for energy in saddle_energies(first.points)]
    highest = first.height(highest_energy(first))
    heights = [0.5 * min(tops, default=highest), highest]
    return [*saddles, *(portrait.landscape.weight * height for height in heights)]


def family(members: Sequence[tuple[str, Portrait]], width: str = "single") -> Figure:
    """Draw the portraits along the trace of a family, each with its title and type above it.

    `members` are titles (`r = 0.05`) and portraits; if there are many, evenly chosen ones are
    drawn. Raises ValueError for no member.
    """
    if not members:
        raise ValueError("a family needs at least one portrait")
    shown = shown_of(members)
    drawn = []
    for title, portrait in shown:
        along = behind_along(portrait, most=65)
        window = _whole(portrait, along)
        # The names of the points replace their kinds, the first part of the type.
        words = "; ".join([", ".join(portrait.names), *portrait.type.split("; ")[1:]])
        drawn.append(Member(title, words, along, portrait.names, window))
    portraits = [portrait for _, portrait in shown]
    figure, panels = draw_family(drawn, width, _SYMBOLS, _rest_entry(portraits))
    for panel, portrait in zip(panels, portraits, strict=True):
        _draw_trace(panel, portrait)
    return figure
