"""A family of periodic orbits over a number: period and largest multiplier."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from vibro_cli.figures import style
from vibro_cli.figures.chart import stacked, value_axis
from vibro_cli.figures.legend import Entry
from vibro_cli.figures.ticks import number_ticks

_HIGH = {"single": 32.0, "double": 42.0}
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
        figure, panels, widths = stacked(width, [_HIGH[width]] * 2, entries=entries)
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
                axes, float(np.min(height)), float(np.max(height)), _HIGH[width], symbol, unit
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
