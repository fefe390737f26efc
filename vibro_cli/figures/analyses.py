"""What a fit leaves, and a family of periodic orbits over a number."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from vibro_cli.figures import style
from vibro_cli.figures.chart import BAND, count_axis, stacked, value_axis
from vibro_cli.figures.labels import Entry
from vibro_cli.figures.ticks import number_ticks

_FIT_HEIGHTS = {"single": 24.0, "double": 32.0}
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
        figure, panels, widths = stacked(width, [_FIT_HEIGHTS[width]] * 2, entries=entries)
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
            value_axis(axes, low, high, _FIT_HEIGHTS[width], r"$t_{n}-T_{n}$", "ms")
            axes.yaxis.set_label_coords(-_LABEL / widths[0], 0.5)
            count_axis(axes, number, widths[0], axes is panels[-1])
    return figure


_BRANCH_HEIGHTS = {"single": 32.0, "double": 42.0}
STABLE: dict[str, Any] = {"color": style.BLUE, "linewidth": 1.2, "linestyle": "solid"}
UNSTABLE: dict[str, Any] = {
    "color": style.VERMILLION,
    "linewidth": 0.9,
    "linestyle": (0, (3.0, 1.2)),
}
_MARKS = {
    "doubling": ("s", "doubling"), "fold": ("D", "fold"), "exchange": ("^", "exchange"),
    "grazing": ("x", "grazing end"), "coincidence": ("+", "two events at once"),
}  # fmt: skip
_OTHER = ("o", "end")
_ROUNDING = 1e-9
"""Values that differ by less than this share of them are drawn as one."""


def branch_figure(found: dict[str, Any], label: str, width: str) -> Figure:
    """Return period and size of the largest multiplier over a number of the scenario.

    Parameters
    ----------
    found
        Columns of ``orbits.parquet``.
    label
        Of the number, with its unit.
    width
        "single" or "double".
    """
    value, stable = np.asarray(found["value"]), np.asarray(found["stable"])
    kinds = [str(kind) for kind in found["special"]]
    marks = dict.fromkeys(_MARKS.get(kind, _OTHER) for kind in kinds if kind)
    entries: list[Entry] = [
        ("stable", STABLE), ("unstable", UNSTABLE),
        *((label, _look(marker)) for marker, label in marks),
    ]  # fmt: skip
    with style.journal():
        figure, panels, widths = stacked(width, [_BRANCH_HEIGHTS[width]] * 2, entries=entries)
        names = (("period", "$T$", "s"), ("multiplier", r"$|\mu|$", ""))
        for axes, (name, symbol, unit) in zip(panels, names, strict=True):
            height = np.asarray(found[name])
            if np.ptp(height) <= _ROUNDING * np.max(np.abs(height)):
                height = np.full_like(height, np.median(height))
            for look, shown in ((STABLE, stable), (UNSTABLE, ~stable)):
                # A piece of the curve has the look of its unstable end.
                joined = shown if look is STABLE else shown | np.roll(shown, 1) | np.roll(shown, -1)
                axes.plot(value, np.where(joined, height, np.nan), **look)
            for kind, x, y in zip(kinds, value, height, strict=True):
                if kind:
                    axes.plot([x], [y], **_look(_MARKS.get(kind, _OTHER)[0]))
            value_axis(
                axes,
                float(np.min(height)),
                float(np.max(height)),
                _BRANCH_HEIGHTS[width],
                symbol,
                unit,
            )
            low, high = float(np.min(value)), float(np.max(value))
            axes.set_xlim(low, high if high > low else low + 1.0)
            ticks = number_ticks(low, high if high > low else low + 1.0, widths[0])
            last = axes is panels[-1]
            axes.set_xticks(ticks.places, ticks.labels if last else [""] * len(ticks.places))
        panels[-1].set_xlabel(label)
    return figure


def _look(marker: str) -> dict[str, Any]:
    return {
        "marker": marker, "color": style.BLACK, "linestyle": "none", "markersize": 3.4,
        "fillstyle": "none", "clip_on": False, "zorder": 4.0,
    }  # fmt: skip
