"""Faults that a referee would see at once: texts that are cut off or overlap."""

from __future__ import annotations

from typing import Any

import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text

from vibro_cli.figures.style import journal

WIDTHS = ["single", pytest.param("double", marks=pytest.mark.long)]
"""Widths of figures: one column is where room is short, two are for the longer tests."""


def texts(figure: Figure) -> list[Text]:
    """Return every visible text of a figure."""
    found = (artist for artist in figure.findobj(Text) if isinstance(artist, Text))
    return [text for text in found if text.get_text() and text.get_visible()]


def assert_texts_are_apart(figure: Figure) -> None:
    """Lay out a figure and check that the boxes of its texts do not overlap."""
    canvas: Any = FigureCanvasAgg(figure)  # its methods have no types
    with journal():
        figure.draw_without_rendering()
        boxes = [(text, text.get_window_extent(canvas.get_renderer())) for text in texts(figure)]
    across, along = figure.bbox.width, figure.bbox.height
    for number, (text, box) in enumerate(boxes):
        inside = box.x0 >= 0 and box.y0 >= 0 and box.x1 <= across and box.y1 <= along
        assert inside, f"{text.get_text()!r} is cut off"
        for other, space in boxes[:number]:
            apart = not box.overlaps(space)
            assert apart, f"{text.get_text()!r} and {other.get_text()!r} overlap"
