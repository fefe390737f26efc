"""What a fit leaves: measured less computed instants, before it and after it."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from vibro_cli.figures import style
from vibro_cli.figures.chart import BAND, count_axis, stacked, value_axis
from vibro_cli.figures.legend import Entry

_HIGH = {"single": 24.0, "double": 32.0}
_POINT: dict[str, Any] = {
    "marker": "o", "markersize": 2.2, "linestyle": "none", "color": style.BLUE, "elinewidth": 0.6,
}  # fmt: skip
_BEFORE = _POINT | {"marker": "s", "color": style.VERMILLION, "fillstyle": "none"}
_SPREAD = 2.0
_LABEL = 8.5
"""Distance of a vertical axis' label from the axis (mm)."""


def fit_figure(found: dict[str, Any], width: str) -> Figure:
    """Return the residuals (ms) over the number of the impact: before the fit, and after it.

    Bars are one standard deviation of the noise, the band two.

    Parameters
    ----------
    found
        Columns of ``residuals.parquet``.
    width
        "single" or "double".
    """
    number = np.asarray(found["n"])
    noise = 1e3 * np.asarray(found["noise"])
    points = {key: value for key, value in _POINT.items() if key != "elinewidth"}
    before = {key: value for key, value in _BEFORE.items() if key != "elinewidth"}
    entries: list[Entry] = [
        ("before the fit", before),
        ("after it", points),
        (
            r"$\pm 2\sigma$",
            {"color": BAND["color"], "linewidth": 4.0, "solid_capstyle": "butt"},
        ),
    ]
    with style.journal():
        figure, panels, widths = stacked(width, [_HIGH[width]] * 2, entries=entries)
        for axes, name, look in zip(panels, ("first", "residual"), (_BEFORE, _POINT), strict=True):
            late = 1e3 * np.asarray(found[name], dtype=np.float64)
            spread = _SPREAD * noise
            around = np.concatenate([[number[0] - 1], number, [number[-1] + 1]])
            wide = np.concatenate([spread[:1], spread, spread[-1:]])
            axes.fill_between(around, -wide, wide, step="mid", **BAND)
            axes.axhline(0.0, color=style.FRAME_GREY, linewidth=0.4)
            axes.errorbar(number, late, noise, **look)
            low = float(np.nanmin([*(late - noise), *-spread]))
            high = float(np.nanmax([*(late + noise), *spread]))
            value_axis(axes, low, high, _HIGH[width], r"$t_{n}-T_{n}$", "ms")
            axes.yaxis.set_label_coords(-_LABEL / widths[0], 0.5)
            count_axis(axes, number, widths[0], axes is panels[-1])
    return figure
