"""What a referee would see at once: texts cut off or over one another."""

from __future__ import annotations

from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text

from vibro_cli.figures.style import journal


def texts(figure: Figure) -> list[Text]:
    """Every text that shows on a figure."""
    found = (artist for artist in figure.findobj(Text) if isinstance(artist, Text))
    return [text for text in found if text.get_text() and text.get_visible()]


def assert_texts_are_apart(figure: Figure) -> None:
    """Draw a figure and compare the boxes of all its texts."""
    canvas: Any = FigureCanvasAgg(figure)  # its methods have no types
    with journal():
        canvas.draw()
        boxes = [(text, text.get_window_extent(canvas.get_renderer())) for text in texts(figure)]
    across, along = figure.bbox.width, figure.bbox.height
    for number, (text, box) in enumerate(boxes):
        inside = box.x0 >= 0 and box.y0 >= 0 and box.x1 <= across and box.y1 <= along
        assert inside, f"{text.get_text()!r} is cut off"
        for other, space in boxes[:number]:
            apart = not box.overlaps(space)
            assert apart, f"{text.get_text()!r} and {other.get_text()!r} overlap"
