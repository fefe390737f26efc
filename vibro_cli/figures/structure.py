"""The phase portrait of a body without a run: level curves, separatrices, singular points (D)."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from vibro_cli.analysis.levels import level_curves
from vibro_cli.analysis.portrait_type import Portrait, condition
from vibro_cli.analysis.singular import FIGURE_EIGHT, SADDLE
from vibro_cli.figures import strokes, style
from vibro_cli.figures.along import EIGHT, REST, curves_of, draw_along, highest_energy, name_points
from vibro_cli.figures.background import Background, background, both_halves
from vibro_cli.figures.frame import label
from vibro_cli.figures.legend import line_of_entries
from vibro_cli.figures.panels import BOTTOM, LEFT, RIGHT, Panel, Window, lay_out
from vibro_cli.figures.style import MM, WIDTHS

_MARGIN = 1.08
_HIGH = {"single": 44.0, "double": 50.0}
"""Height of the panel along the trace (mm)."""
_LINE = 3.1
"""Height of a line of words (mm)."""
_CHARACTER = 1.03
"""Mean width of a character of the words (mm)."""
_MOST_LINES = 6


def structure(portrait: Portrait, width: str = "single", bodies: str = "") -> Figure:
    """Return the phase portrait of a body on the whole trace, in both coordinates.

    Above, branch by branch as in the papers: φ̇ against φ, ψ̇ against ψ, speed against arc length on
    lines. Below, speed against arc length along the trace, over it the values E/(m g) of centres
    and saddles. `bodies` stands as index of the symbols. Raises ValueError for an unknown width.
    """
    behind = background(portrait.landscape, highest_energy(portrait))
    words = _words(portrait, WIDTHS.get(width, 0.0) - LEFT - RIGHT)
    below = _HIGH.get(width, 0.0) + BOTTOM + _LINE * len(words) + 1.0
    with style.journal():
        figure, panels = lay_out(_windows(portrait, behind), width, below)
        for one in panels:
            strokes.draw_background(one, behind)
            _draw_eights(one, portrait)
        label(panels, bodies)
        _draw_below(figure, portrait, width, words)
        _draw_legend(figure, behind, portrait)
    return figure


def _windows(portrait: Portrait, behind: Background) -> list[Window]:
    tops = {}
    for lines in (False, True):
        curves = (*behind.levels, *behind.separatrices)
        rates = [
            float(np.max(curve.rate))
            for curve in curves
            if portrait.landscape.trace.pieces[curve.piece].is_line == lines
        ]
        tops[lines] = _MARGIN * max(rates, default=1.0) or 1.0
    return [
        Window(piece, piece.angle_start, piece.angle_end, tops[piece.is_line])
        for piece in portrait.landscape.trace.pieces
    ]


def _draw_eights(one: Panel, portrait: Portrait) -> None:
    """Draw over the separatrices those parts that belong to a figure eight."""
    lines = []
    for trigger in portrait.triggers:
        if trigger.orbit != FIGURE_EIGHT:
            continue
        assert trigger.turning_left is not None
        assert trigger.turning_right is not None
        for curve in level_curves(portrait.landscape, one.piece, trigger.saddle.energy):
            middle = one.piece.arc_length(0.5 * float(curve.position[0] + curve.position[-1]))
            if trigger.turning_left <= middle <= trigger.turning_right:
                lines += [line + np.array([one.shift, 0.0]) for line in both_halves(curve)]
    one.axes.add_collection(LineCollection(lines, zorder=1.25, **EIGHT), autolim=False)


def _draw_below(figure: Figure, portrait: Portrait, width: str, words: Sequence[str]) -> None:
    """Draw the panel along the trace, under its words."""
    wide, high = figure.get_size_inches() / MM
    size = (WIDTHS[width] - LEFT - RIGHT, _HIGH[width])
    axes = figure.add_axes((LEFT / wide, BOTTOM / high, size[0] / wide, size[1] / high))
    curves = curves_of(portrait)
    draw_along(axes, portrait, curves, size)
    name_points(axes, portrait, curves, size)
    look: dict[str, Any] = {"fontsize": style.SMALL, "color": style.FRAME_GREY, "va": "baseline"}
    for number, line in enumerate(reversed(words)):
        height = BOTTOM + size[1] + 1.2 + number * _LINE
        figure.text(LEFT / wide, height / high, line, **look)


def _words(portrait: Portrait, width: float) -> list[str]:
    """Return what is said of the triggers, in lines of a width (mm)."""
    said = []
    for trigger in portrait.triggers:
        names = "–".join(portrait.name(p) for p in (trigger.left, trigger.saddle, trigger.right))
        said.append(f"{names}: trigger of coupled singular points, {_named(trigger.orbit)}")
        said.append(condition(portrait, trigger))
    said = said or ["no trigger of coupled singular points"]
    named = zip(portrait.names, portrait.points, strict=True)
    heights = ", ".join(f"{name} {portrait.height(point.energy):.4g} m" for name, point in named)
    meant = "height above the lowest place"
    if portrait.landscape.turning is not None:
        meant = "effective potential above its least value"
    values = [f"E/(m g), {meant}: {heights}"] if heights else []
    return [*_wrapped(said, width), *_wrapped(values, width)]


def _wrapped(said: Sequence[str], width: float) -> list[str]:
    """Return sentences in lines of a width (mm), not too many."""
    characters = max(20, int(width / _CHARACTER))
    lines = [line for one in said for line in textwrap.wrap(one, characters)]
    return lines if len(lines) <= _MOST_LINES else [*lines[: _MOST_LINES - 1], "…"]


def _named(orbit: str) -> str:
    return {FIGURE_EIGHT: "homoclinic figure eight"}.get(orbit, f"{orbit} separatrix")


def _draw_legend(figure: Figure, behind: Background, portrait: Portrait) -> None:
    entries: list[tuple[str, dict[str, Any]]] = []
    eights = [trigger for trigger in portrait.triggers if trigger.orbit == FIGURE_EIGHT]
    if eights:
        entries.append(("figure eight", EIGHT))
    if any(p.kind == SADDLE and all(p != one.saddle for one in eights) for p in behind.points):
        entries.append(("separatrix", strokes.SEPARATRIX))
    elif behind.arc_separatrices:
        entries.append(("separatrix of the full circle", strokes.ARC_SEPARATRIX))
    entries.append(("level", strokes.LEVEL))
    for kind, marker in strokes.MARKER.items():
        if any(point.kind == kind for point in portrait.points):
            entries.append((kind, strokes.POINT | {"marker": marker}))
    if any(point.extent for point in portrait.points):
        entries.append(("level line", REST))
    line_of_entries(figure, entries)
