"""Basins of a grid: which outcome each start leads to, and how the boundary scales."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

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
from vibro_cli.figures import style
from vibro_cli.figures.chart import log_axis, stacked
from vibro_cli.figures.grids.maps import Categories, Lattice, Swept, category_map, ended, lattice
from vibro_cli.figures.labels import Entry

# Told apart in grey too.
_COLOURS = (
    "#F0E442", "#00579A", "#CC79A7", "#9FD9B4", "#C04A00", "#7CC7F0", "#3A1466", "#E69F00",
    "#00463A",
)  # fmt: skip
_OTHERS = "#8a8a8a"
_POINT: dict[str, Any] = {
    "marker": "o", "markersize": 3.2, "linestyle": "none", "color": style.BLUE,
}  # fmt: skip
_LINE: dict[str, Any] = {"color": style.BLACK, "linewidth": 0.8}
_HIGH = {"single": 42.0, "double": 56.0}


def coloured(outcomes: Outcomes) -> Categories:
    """Return outcomes with their colours and shares of the points; the rarest share one colour."""
    code = np.minimum(outcomes.code, len(_COLOURS))
    rest = len(outcomes.names) - len(_COLOURS)
    names = [*outcomes.names[: len(_COLOURS)], *([f"{rest} others"] if rest > 0 else [])]
    shares = np.bincount(code, minlength=len(names)) / len(code)
    told = [f"{name} ({100.0 * share:.3g} %)" for name, share in zip(names, shares, strict=True)]
    return Categories(code, tuple(told), (*_COLOURS, _OTHERS)[: len(names)])


@dataclass(frozen=True)
class Mapped:
    """The basins of a grid on its lattice."""

    shown: Lattice
    outcomes: Outcomes
    basins: Basins

    def map(self, width: str) -> Figure | None:
        """Return the map of the outcomes, None over one axis."""
        if len(self.shown.coordinates) < 2:
            return None
        return category_map(self.shown, width, coloured(self.outcomes))

    def scaling(self, width: str) -> Figure | None:
        """Return the share of uncertain starts over the distance, None without any."""
        found = self.basins
        if found.exponent is None:
            return None
        slope = found.exponent.value
        line = np.log(found.distances) - np.log(found.distances).mean()
        fitted = np.exp(np.log(found.uncertain).mean() + slope * line)
        entries: list[Entry] = [
            ("starts with another outcome within the distance", _POINT),
            (rf"slope ${slope:.3f}\pm{found.exponent.error:.3f}$", _LINE),
        ]
        with style.journal():
            figure, (axes,), _ = stacked(width, [_HIGH[width]], entries=entries)
            axes.plot(found.distances, fitted, **_LINE)
            axes.plot(found.distances, found.uncertain, **_POINT)
            log_axis(axes, np.concatenate([found.uncertain, fitted]), "share of the starts", "")
            axes.set_xscale("log", base=2)
            axes.set_xlim(found.distances[0] / 1.3, found.distances[-1] * 1.3)
            axes.set_xticks(found.distances, [f"{step:.0f}" for step in found.distances])
            axes.minorticks_off()
            axes.set_xlabel("distance [cells]")
        return figure


def default_outcome(grid: Swept) -> list[str]:
    """Return the columns that tell how a run ends and on which arc each body then is."""
    arcs = [name for name in grid.summary if name.startswith("arc_")]
    return ["end_cause", *(arcs if len(grid.shapes) > 1 else ())]


def mapped_basins(grid: Swept, outcome: Sequence[str]) -> Mapped:
    """Return the basins over the two axes with the most values, or over the one that has enough.

    Parameters
    ----------
    grid
        All of its points.
    outcome
        Columns of the summary that tell an outcome together; none: `default_outcome`.

    Raises `NoBasins` where no axis has enough numbers at even distances, or points are missing, and
    for an outcome that is no column of words or whole numbers.
    """
    shown = _evenly(grid)
    if not shown.is_full:
        raise NoBasins("found no point for some values of the axes, expected every pair of them")
    told = dict(grid.summary) | {"end_cause": ended(grid)}
    outcomes = outcomes_of(told, outcome or default_outcome(grid), shown.rows)
    cells = shown.cells(outcomes.code.astype(np.float64)).astype(np.int64)
    return Mapped(shown, outcomes, basins_of(outcomes, cells))


def _evenly(grid: Swept) -> Lattice:
    """The lattice over two axes that can be measured, else over one."""
    lattices = [found for size in (2, 1) if (found := lattice(grid, size)) is not None]
    for shown in lattices:
        if all(one.is_even and len(one.different) >= FEWEST for one in shown.coordinates):
            return shown
    told = [
        f"{one.path} ({len(one.different)}{'' if one.is_even else ', uneven'})"
        for one in (lattices[0].coordinates if lattices else ())
    ]
    raise NoBasins(
        f"expected an axis of at least {FEWEST} numbers at even distances, found "
        f"{' and '.join(told) or 'no axis that changes'}"
    )
