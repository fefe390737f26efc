"""The look of every figure: sizes, fonts, colours and lines."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import matplotlib
import numpy as np
from matplotlib.colors import Colormap, ListedColormap

WIDTHS = {"single": 85.0, "double": 170.0}
"""Width of a figure (mm) for one column or two columns of a journal."""

MM = 1.0 / 25.4
"""One millimetre in inches."""

TEXT = 8.0
"""Size of axis labels (pt)."""
SMALL = 7.0
"""Size of tick labels, panel titles and legends (pt)."""

# Okabe and Ito's palette: told apart by colour-blind readers; every use has its own line or marker
# as well, so that nothing is lost in grey.
BLUE = "#0072B2"
VERMILLION = "#D55E00"
GREEN = "#009E73"
BLACK = "#000000"

LEVEL_GREY = "#c9c9c9"
SEPARATRIX_GREY = "#5a5a5a"
FRAME_GREY = "#303030"

_RC: Any = {  # the stubs want each key as a literal
    "font.family": "STIXGeneral",  # shipped with matplotlib: the same glyphs on every machine
    "mathtext.fontset": "stix",
    "font.size": TEXT,
    "axes.labelsize": TEXT,
    "axes.titlesize": SMALL,
    "xtick.labelsize": SMALL,
    "ytick.labelsize": SMALL,
    "legend.fontsize": SMALL,
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
    "figure.dpi": 300.0,
    "savefig.dpi": 300.0,
    "pdf.fonttype": 42,
    "pdf.compression": 6,
    "svg.fonttype": "path",
    "svg.hashsalt": "vibro",
}

_SIZES = ("font.size", "axes.labelsize", "xtick.labelsize", "ytick.labelsize")


@contextmanager
def journal(larger: float = 1.0) -> Iterator[None]:
    """Draw within this context: the style of the figures, whatever the reader's own settings are.

    Letters are `larger` by this factor. Figures are made as `matplotlib.figure.Figure`, without
    pyplot and its global state.
    """
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        sizes = {name: size * larger for name, size in _RC.items() if name in _SIZES}
        matplotlib.rcParams.update(_RC | sizes)
        yield


def time_colours() -> Colormap:
    """Return the colours of time, dark to light: viridis without its palest end."""
    return ListedColormap(matplotlib.colormaps["viridis"](np.linspace(0.0, 0.88, 256)))
