"""Figures of analyses: residuals of a fit, families of periodic orbits, basins of a grid."""

from __future__ import annotations

from collections import ChainMap
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from matplotlib.figure import Figure

from vibro_cli.analysis.basins import (
    FEWEST,
    Basins,
    NoBasins,
    Outcomes,
    basins_of,
    outcomes_of,
)
from vibro_cli.analysis.orbit_branch import ENERGY
from vibro_cli.analysis.orbits import PARTED
from vibro_cli.figures import style
from vibro_cli.figures.chart import (
    BAND,
    BAND_KEY,
    count_axis,
    is_wide,
    log_axis,
    stacked,
    value_axis,
)
from vibro_cli.figures.labels import Entry
from vibro_cli.figures.maps import (
    Categories,
    ParameterMap,
    category_map,
    ended,
    parameter_map,
    words_of,
)
from vibro_cli.figures.style import Look, line, mark, panel_size
from vibro_cli.figures.ticks import Ticks, axis_words, label_axis, number_ticks
from vibro_cli.scenario.fields import unit_at
from vibro_cli.scenario.models import Scenario
from vibro_cli.scenario.problems import parsed_path
from vibro_cli.systems.request import STOPS

if TYPE_CHECKING:
    from vibro_cli.storage.stored import StoredGrid

_FIT_HEIGHT = 24.0
_POINT = mark("o", 2.2, style.BLUE)
_BEFORE = mark("s", 2.2, style.VERMILLION) | {"fillstyle": "none"}
_SPREAD = 2.0
_MANY = 0.05
"""Fraction of runs ended by a stop above which the outcomes of a grid are doubtful."""
_LABEL = 8.5
"""Distance of a vertical axis' label from the axis (mm)."""


def fit_figure(found: dict[str, Any]) -> Figure:
    """Draw the residuals (ms) before and after a fit over the number of the impact.

    Error bars are one standard deviation of the noise, the band is two. `found` has the columns of
    ``residuals.parquet``.
    """
    number = np.asarray(found["n"])
    noise = 1e3 * np.asarray(found["noise"])
    entries: list[Entry] = [
        ("before the fit", _BEFORE),
        ("after the fit", _POINT),
        (r"$\pm 2\sigma$", BAND_KEY),
    ]
    with style.journal():
        figure, panels = stacked("single", [_FIT_HEIGHT] * 2, entries=entries)
        for axes, name, look in zip(panels, ("first", "residual"), (_BEFORE, _POINT), strict=True):
            late = 1e3 * np.asarray(found[name], dtype=np.float64)
            spread = _SPREAD * noise
            around = np.concatenate([[number[0] - 1], number, [number[-1] + 1]])
            wide = np.concatenate([spread[:1], spread, spread[-1:]])
            axes.fill_between(around, -wide, wide, step="mid", **BAND)
            axes.axhline(0.0, color=style.FRAME_GREY, linewidth=0.4)
            axes.errorbar(number, late, noise, elinewidth=0.6, **look)
            reached = np.concatenate([late - noise, late + noise, -spread, spread])
            value_axis(axes, reached, r"$t_{n}-T_{n}$", "ms")
            axes.yaxis.set_label_coords(-_LABEL / panel_size(axes)[0], 0.5)
            count_axis(axes, number, axes is panels[-1])
    return figure


_BESIDE = 0.03
"""Horizontal margin beside a family, as a share of its width."""
_BRANCH_HEIGHTS = {"single": 32.0, "double": 42.0}
STABLE = line(style.BLUE, 1.2)
UNSTABLE = line(style.VERMILLION, 0.9, (3.0, 1.2))
_MARKS = {
    "doubling": ("s", "doubling"), "fold": ("D", "fold"), "exchange": ("^", "exchange"),
    "torus": ("v", "torus"), "halving": ("<", "half the period"),
    "grazing": ("x", "grazing"), "coincidence": ("+", "simultaneous events"),
}  # fmt: skip
_OTHER = ("o", "end")
_ROUNDING = 1e-9
"""Values whose relative differences are smaller than this are drawn as equal.

So are multipliers that all lie within `PARTED` of 1.
"""


def branch_figure(found: dict[str, Any], label: str, width: str) -> Figure:
    """Draw the period and the magnitude of the largest multiplier over a number of the scenario.

    `found` has the columns of ``orbits.parquet``; `label` names the number, with its unit.
    """
    value = np.asarray(found["value"], dtype=np.float64)
    stable = np.asarray(found["stable"], dtype=np.bool_)
    whole = stable[:-1] & stable[1:]  # a segment with an unstable end is drawn as unstable
    kinds = found["special"]
    marks = dict.fromkeys(_MARKS.get(kind, _OTHER) for kind in kinds if kind)
    entries: list[Entry] = [
        *([("stable", STABLE)] if np.any(whole) else ()),
        *([("unstable", UNSTABLE)] if not np.all(whole) else ()),
        *((label, _look(marker)) for marker, label in marks),
    ]  # fmt: skip
    with style.journal():
        figure, panels = stacked(width, [_BRANCH_HEIGHTS[width]] * 2, entries=entries)
        names = (("period", "$T$", "s"), ("multiplier", r"$|\mu|$", ""))
        for axes, (name, symbol, unit) in zip(panels, names, strict=True):
            height = np.asarray(found[name])
            near_one = name == "multiplier" and np.all(np.abs(height - 1.0) <= PARTED)
            if near_one or np.ptp(height) <= _ROUNDING * np.max(np.abs(height)):
                height = np.full_like(height, np.median(height))
            for look, shown in ((STABLE, whole), (UNSTABLE, ~whole)):
                gaps = np.flatnonzero(~shown) + 1
                axes.plot(*(np.insert(one, gaps, np.nan) for one in (value, height)), **look)
            for kind, x, y in zip(kinds, value, height, strict=True):
                if kind:
                    axes.plot([x], [y], **_look(_MARKS.get(kind, _OTHER)[0]))
            logarithmic = name == "multiplier" and is_wide(height)
            (log_axis if logarithmic else value_axis)(axes, height, symbol, unit)
            low, high = float(np.min(value)), float(np.max(value))
            # Leave room beside the values, so that a fold is visible.
            room = _BESIDE * (high - low) or 0.5 * (abs(high) or 1.0)
            span = low - room, high + room
            axes.set_xlim(span)
            ticks = number_ticks(*span, panel_size(axes)[0])
            label_axis(axes.xaxis, ticks, label, "", axes is panels[-1])
    return figure


def label_of_number(path: str) -> str:
    """Return the axis label, with its unit, of the number at a path."""
    if path == ENERGY:
        return "energy [J]"
    return axis_words(words_of(path), unit_at(parsed_path(path), Scenario), Ticks((), ()))


def _look(marker: str) -> Look:
    return mark(marker, 3.4, style.BLACK) | {"fillstyle": "none", "clip_on": False, "zorder": 4.0}


# Distinguishable in grey, too.
_COLOURS = (
    "#F0E442", "#00579A", style.PURPLE, "#9FD9B4", "#C04A00", "#7CC7F0", "#3A1466", style.ORANGE,
    "#00463A",
)  # fmt: skip
_OTHERS = "#8a8a8a"
_SHARE_POINT = mark("o", 3.2, style.BLUE)
_LINE = line(style.BLACK, 0.8)
_MOST = 1.25
"""Upper limit of the axis of shares: the fitted line may exceed 1 slightly."""
_SCALING_HEIGHTS = {"single": 42.0, "double": 56.0}


def coloured(outcomes: Outcomes) -> Categories:
    """Return outcomes with colours and shares of points; the rarest outcomes share one colour."""
    code = np.minimum(outcomes.code, len(_COLOURS))
    rest = len(outcomes.names) - len(_COLOURS)
    others = "1 other" if rest == 1 else f"{rest} others"
    names = [*outcomes.names[: len(_COLOURS)], *([others] if rest > 0 else [])]
    shares = np.bincount(code, minlength=len(names)) / len(code)
    texts = [f"{name} ({100.0 * share:.3g} %)" for name, share in zip(names, shares, strict=True)]
    return Categories(code, tuple(texts), (*_COLOURS, _OTHERS)[: len(names)])


@dataclass(frozen=True)
class Mapped:
    """The basins of a grid and the map that shows them."""

    shown: ParameterMap
    outcomes: Outcomes
    basins: Basins
    stopped: float = 0.0
    """Fraction of the runs that a stop ended, while bodies were still moving."""

    @property
    def doubt(self) -> str:
        """Why outcomes may not be final; empty if few runs were ended by a stop."""
        if self.stopped <= _MANY:
            return ""
        return (
            f"{100.0 * self.stopped:.3g} % of the runs were stopped while bodies were still "
            "moving: their outcome is that at the stop, and a later stop may give another"
        )

    def map(self, width: str) -> Figure | None:
        """Draw the map of the outcomes; return None for a grid over one axis."""
        style.width_of(width)
        if len(self.shown.coordinates) < 2:
            return None
        return category_map(self.shown, width, coloured(self.outcomes))

    def scaling(self, width: str) -> Figure | None:
        """Draw the fraction of points with another outcome within a distance, over the distance.

        Returns None without an exponent.
        """
        style.width_of(width)
        found = self.basins
        if found.exponent is None:
            return None
        slope = found.exponent.value
        away = np.log(found.distances) - np.log(found.distances).mean()
        fitted = np.exp(np.log(found.uncertain).mean() + slope * away)
        entries: list[Entry] = [
            ("points with another outcome within that distance", _SHARE_POINT),
            (f"slope {found.exponent}".replace("-", "−"), _LINE),
        ]
        with style.journal():
            figure, (axes,) = stacked(width, [_SCALING_HEIGHTS[width]], entries=entries)
            axes.plot(found.distances, fitted, **_LINE)
            axes.plot(found.distances, found.uncertain, **_SHARE_POINT)
            log_axis(axes, np.concatenate([found.uncertain, fitted]), "fraction of the points", "")
            axes.set_ylim(top=min(axes.get_ylim()[1], _MOST))  # no share is greater than 1
            axes.set_xscale("log", base=2)
            axes.set_xlim(found.distances[0] / 1.3, found.distances[-1] * 1.3)
            axes.set_xticks(found.distances, [f"{step:.0f}" for step in found.distances])
            axes.minorticks_off()
            axes.set_xlabel("distance [cells]")
        return figure


def mapped_basins(grid: StoredGrid, outcome: Sequence[str]) -> Mapped:
    """Return the basins over the two axes with the most values, or over one axis.

    `outcome` are the columns of the summary that define an outcome together; if empty, those of how
    a run ends and, on several arcs, of the arc on which each body ends. Raises `NoBasins` if no
    axis has enough evenly spaced numbers, if points are missing, or if an outcome is not a column
    of words or whole numbers.
    """
    shown = _evenly(grid)
    if not shown.is_full:
        found = "found no point, or several, for some values of the axes"
        raise NoBasins(f"{found}, expected one for every pair of them")
    columns = ChainMap({"end_cause": ended(grid)}, cast(dict[str, Any], grid.summary))
    arcs = [name for name in grid.summary if name.startswith("arc_") and len(grid.shapes) > 1]
    outcomes = outcomes_of(columns, outcome or ["end_cause", *arcs], shown.rows)
    cells = shown.cells(outcomes.code.astype(np.float64)).astype(np.int64)
    causes = grid.summary["end_cause"][shown.rows].tolist()
    stopped = sum(cause in STOPS for cause in causes) / len(causes)
    return Mapped(shown, outcomes, basins_of(outcomes, cells), stopped)


def _evenly(grid: StoredGrid) -> ParameterMap:
    """Return the map over two evenly spaced axes, else over one; raise `NoBasins` without any."""
    maps = [found for size in (2, 1) if (found := parameter_map(grid, size)) is not None]
    for shown in maps:
        if all(one.is_even and len(one.different) >= FEWEST for one in shown.coordinates):
            return shown
    axes = [
        f"{one.path} ({len(one.different)}{'' if one.is_even else ', uneven'})"
        for one in (maps[0].coordinates if maps else ())
    ]
    raise NoBasins(
        f"expected an axis of at least {FEWEST} evenly spaced numbers, found "
        f"{' and '.join(axes) or 'no axis that changes'}"
    )
