"""Figures inside a page: SVG, or PNG where that is too much, as addresses that hold their data."""

from __future__ import annotations

import base64
from collections.abc import Iterator, Sequence
from typing import Any

from matplotlib.figure import Figure

from vibro_cli.figures.grids.kinds import draw_grid
from vibro_cli.figures.runs.kinds import Drawn, draw_all
from vibro_cli.figures.style import has_rasters, render
from vibro_cli.storage.stored import StoredGrid

_DPI = 192.0
"""Resolution of figures with too many points for SVG: two pixels for each of a plain screen."""
_TYPES = {"png": "png", "svg": "svg+xml"}


def figures_of_run(run: Any, name: str) -> Iterator[dict[str, Any]]:
    """Return every figure of a run as the page has it, with its words."""
    both = (draw_all(run, None, width) for width in ("double", "single"))
    return _shown(zip(*both, strict=True), f"run {name}")


def figures_of_grid(grid: StoredGrid, columns: Sequence[str] = ()) -> Iterator[dict[str, Any]]:
    """Return every figure of a grid as the page has it, with its words.

    `columns` are those of the summary whose maps are drawn too.
    """
    both = (draw_grid(grid, width, columns) for width in ("double", "single"))
    return _shown(zip(*both, strict=True), f"grid {grid.name}")


def _shown(both: Iterator[tuple[Drawn, Drawn]], of: str) -> Iterator[dict[str, Any]]:
    """Return figures of two columns' width and of one's for narrow screens, with words."""
    for wide, narrow in both:
        yield {
            "title": wide.title,
            "caption": wide.caption,
            "alternative": f"{wide.title}, {of}. {wide.caption}",
            "wide": image(wide.figure),
            "narrow": image(narrow.figure),
        }


def image(figure: Figure) -> dict[str, str]:
    """Return a figure as the address of an image with its size (CSS pixels)."""
    form = "png" if has_rasters(figure) else "svg"
    content = base64.b64encode(render(figure, form, _DPI)).decode()
    width, height = figure.get_size_inches() * 96.0
    return {
        "source": f"data:image/{_TYPES[form]};base64,{content}",
        "width": f"{width:.0f}",
        "height": f"{height:.0f}",
    }
