"""The style of all figures, and their export to PNG, PDF and SVG with reproducible bytes."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from io import BytesIO
from threading import RLock
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Colormap, ListedColormap
from matplotlib.figure import Figure

WIDTHS = {"single": 85.0, "double": 170.0}
"""Width of a figure (mm) for one column or two columns of a journal."""


def width_of(width: str) -> float:
    """Return the width (mm) of a `single` or `double` figure; raise ValueError for others."""
    if not isinstance(width, str) or width not in WIDTHS:
        raise ValueError(f"unknown width {width!r}, expected one of {', '.join(WIDTHS)}")
    return WIDTHS[width]


MM = 1.0 / 25.4
"""One millimetre in inches."""


def panel_size(axes: Axes) -> tuple[float, float]:
    """Return width and height of a panel (mm), rounded to remove errors of its relative size."""
    figure, box = axes.get_figure(root=True), axes.get_position()
    assert figure is not None
    wide, high = figure.get_size_inches() / MM * (box.width, box.height)
    return round(float(wide), 9), round(float(high), 9)


DPI = 300.0
"""Pixels per inch of a PNG."""
TEXT = 8.0
"""Size of axis labels (pt)."""
SMALL = 7.0
"""Size of tick labels, panel titles and legends (pt)."""

# Okabe and Ito's palette, which colour-blind readers can distinguish. Every use has its own line or
# marker as well, so that nothing is lost in grey.
BLUE = "#0072B2"
VERMILLION = "#D55E00"
GREEN = "#009E73"
PURPLE = "#CC79A7"
ORANGE = "#E69F00"
SKY = "#56B4E9"
BLACK = "#000000"

BAND_GREY = "#e3e3e3"
LEVEL_GREY = "#c9c9c9"
SEPARATRIX_GREY = "#5a5a5a"
FRAME_GREY = "#303030"

Look = dict[str, Any]
"""Style of a line, mark or text, as keyword arguments of matplotlib."""


def line(colour: str | None, width: float, dashes: tuple[float, ...] = ()) -> Look:
    """Return the style of a line of a width (pt); `dashes` are lengths and gaps in line widths.

    Without a colour, the line takes the colour of the body that it belongs to.
    """
    look: Look = {"linewidth": width, "linestyle": (0, dashes) if dashes else "solid"}
    return look if colour is None else look | {"color": colour}


def mark(
    shape: str, size: float, colour: str, edge: str | None = None, edge_width: float = 0.7
) -> Look:
    """Return the style of marks (pt) without a line, in one colour or with an edge of another."""
    look: Look = {"marker": shape, "markersize": size, "linestyle": "none"}
    if edge is None:
        return look | {"color": colour}
    edges = {"markeredgecolor": edge, "markeredgewidth": edge_width}
    return look | edges | {"markerfacecolor": colour}


AXIS_DASHES = (6.0, 1.5, 1.0, 1.5)
"""Dashes of axes and normals: long and short alternately."""
AXIS = line(FRAME_GREY, 0.4, AXIS_DASHES)
"""Style of axes, normals and verticals in drawings to scale."""
POINT = mark("o", 1.6, BLACK)
"""Style of points in drawings to scale: centres, contact points."""

_RC: Any = {  # the stubs want each key as a literal
    "font.family": "STIXGeneral",  # shipped with matplotlib: the same glyphs on every machine
    "mathtext.fontset": "stix",
    "font.size": TEXT,
    "axes.labelsize": TEXT,
    "axes.titlesize": SMALL,
    "xtick.labelsize": SMALL,
    "ytick.labelsize": SMALL,
    "legend.fontsize": SMALL,
    "axes.titley": 1.0,  # otherwise matplotlib measures all labels to find the place of a title
    "axes.linewidth": 0.5,
    "axes.edgecolor": FRAME_GREY,
    "axes.labelpad": 2.0,
    "axes.unicode_minus": True,
    "xtick.major.width": 0.5,
    "ytick.major.width": 0.5,
    "xtick.major.size": 2.5,
    "ytick.major.size": 2.5,
    "xtick.major.pad": 2.5,
    "ytick.major.pad": 2.0,
    "xtick.direction": "in",
    "ytick.direction": "in",
    "xtick.top": True,
    "ytick.right": True,
    "lines.linewidth": 0.9,
    "lines.solid_capstyle": "round",
    "legend.frameon": False,
    "figure.dpi": DPI,
    "savefig.dpi": DPI,
    "pdf.fonttype": 42,
    "pdf.compression": 6,
    "svg.fonttype": "path",
    "svg.hashsalt": "vibro",
}

_SIZES = ("font.size", "axes.labelsize", "xtick.labelsize", "ytick.labelsize")


_ONE_AT_A_TIME = RLock()
"""All threads share the settings of matplotlib."""


@contextmanager
def journal(larger: float = 1.0) -> Iterator[None]:
    """Provide a context for drawing in the style of the figures, whatever the user's settings.

    `larger` magnifies all letters. Figures are made as `matplotlib.figure.Figure`, without pyplot
    and its global state. Other threads wait until the context ends.
    """
    with _ONE_AT_A_TIME, matplotlib.rc_context():
        matplotlib.rcdefaults()
        sizes = {name: size * larger for name, size in _RC.items() if name in _SIZES}
        matplotlib.rcParams.update(_RC | sizes)
        yield


def time_colours() -> Colormap:
    """Return the colour map of time, dark to light: viridis without its palest end."""
    return ListedColormap(matplotlib.colormaps["viridis"](np.linspace(0.0, 0.88, 256)))


_COMPRESSION = 3
"""Compression level of PNG: higher levels take twice the time to save a twentieth of the bytes."""

# Metadata that would differ from run to run or from machine to machine are left out.
_METADATA: dict[str, dict[str, str | None]] = {
    "png": {"Software": None},
    "pdf": {"CreationDate": None, "Creator": "vibro", "Producer": None},
    "svg": {"Date": None, "Creator": "vibro"},
}
FORMATS = tuple(_METADATA)


def render(figure: Figure, form: str, dpi: float = DPI) -> bytes:
    """Return a figure as the bytes of a file in one of `FORMATS`.

    `dpi` holds for PNG and for rasters in vector files. Raises ValueError for another format.
    """
    if form not in FORMATS:
        raise ValueError(f"unknown figure format {form!r}, expected one of {', '.join(FORMATS)}")
    options: dict[str, Any] = {"format": form, "dpi": dpi, "metadata": _METADATA[form]}
    if form == "png":
        options["pil_kwargs"] = {"compress_level": _COMPRESSION}
    buffer = BytesIO()
    with journal():
        figure.savefig(buffer, **options)
    return buffer.getvalue()


def has_rasters(figure: Figure) -> bool:
    """Return whether parts of a figure are rasterised in vector files."""
    # They lie directly in their panels; deeper down a search would make ticks for every axis.
    return any(artist.get_rasterized() for axes in figure.axes for artist in axes.get_children())


def render_pages(figures: Iterable[Figure]) -> bytes:
    """Return figures as one PDF file, one per page."""
    from matplotlib.backends.backend_pdf import PdfPages

    buffer = BytesIO()
    with journal(), PdfPages(buffer, metadata=_METADATA["pdf"]) as pages:
        for figure in figures:
            pages.savefig(figure)
    return buffer.getvalue()
