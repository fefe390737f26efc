"""A family of phase portraits side by side, along the trace, for values of a parameter."""

from __future__ import annotations

import math
from collections.abc import Sequence

from matplotlib.figure import Figure

from vibro_cli.analysis.portrait_type import Portrait
from vibro_cli.figures import style
from vibro_cli.figures.along import curves_of, draw_along, name_points
from vibro_cli.figures.legend import text_width
from vibro_cli.figures.panels import BOTTOM, LEFT, RIGHT
from vibro_cli.figures.style import MM, WIDTHS

MOST_MEMBERS = 12
_COLUMNS = {"single": 1, "double": 2}
_HIGH = 27.0
"""Height of a panel (mm)."""
_TITLE = 7.4
_LINE = 3.0


def family(members: Sequence[tuple[str, Portrait]], width: str = "single") -> Figure:
    """Return the portraits along the trace of a family, each under its title and its type.

    `members` are titles (`r = 0.05`) and portraits; of more than `MOST_MEMBERS` an even choice is
    drawn. Raises ValueError for no member.
    """
    if not members:
        raise ValueError("a family needs at least one portrait")
    step = math.ceil(len(members) / MOST_MEMBERS)
    shown = members[::step]
    columns = min(_COLUMNS[width], len(shown))
    rows = math.ceil(len(shown) / columns)
    cell = _TITLE + _HIGH + BOTTOM
    wide, high = WIDTHS[width], rows * cell
    size = (wide / columns - LEFT - RIGHT, _HIGH)
    with style.journal():
        figure = Figure(figsize=(wide * MM, high * MM))
        for number, (title, portrait) in enumerate(shown):
            row, column = divmod(number, columns)
            left = column * wide / columns + LEFT
            bottom = high - row * cell - _TITLE - _HIGH
            axes = figure.add_axes((left / wide, bottom / high, size[0] / wide, size[1] / high))
            curves = curves_of(portrait, 65)
            draw_along(axes, portrait, curves, size)
            name_points(axes, portrait, curves, size)
            over = (bottom + _HIGH + 1.0) / high
            words = _type(portrait, size[0])
            figure.text(left / wide, over, words, fontsize=style.SMALL, va="baseline")
            above = over + _LINE / high
            figure.text(left / wide, above, title, fontsize=style.TEXT, va="baseline")
    return figure


def _type(portrait: Portrait, width: float) -> str:
    """Return the type in words, with names for kinds of points where it needs more than a width."""
    if text_width(portrait.type) <= width:
        return portrait.type
    return "; ".join([", ".join(portrait.names), *portrait.type.split("; ")[1:]])
