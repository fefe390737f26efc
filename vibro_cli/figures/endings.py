"""How the runs of a grid end: one colour for each cause, told apart in grey too."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.colors import BoundaryNorm, ListedColormap
from numpy.typing import NDArray

from vibro_cli.figures.lattice import Swept

COLOURS = {
    "time": "#F0E442",
    "collisions": "#7CC7F0",
    "bounces": "#9FD9B4",
    "no_more_collisions": "#00579A",
    "rest": "#f0f0f0",
    "end_of_trace": "#E69F00",
    "inadmissible": "#C04A00",
    "lift_off": "#CC79A7",
    "wall_contact": "#3A1466",
    "accumulation": "#00463A",
    "invalid": "#7a7a7a",
    "failed": "#000000",
}
"""Of causes and, where there is none, of states: near Okabe and Ito's, each with its own grey."""
WORDS = {
    "time": "time reached",
    "collisions": "number of impacts reached",
    "bounces": "number of impacts on the wall reached",
    "no_more_collisions": "no more impacts",
    "inadmissible": "inadmissible impact",
}
"""Of causes that do not say by themselves what they mean."""


@dataclass(frozen=True)
class Endings:
    """The endings of some points."""

    causes: tuple[str, ...]
    """Those that occur, in the order of `COLOURS`."""
    code: NDArray[np.int64]
    """Index of the cause of each point."""

    @staticmethod
    def of(grid: Swept, rows: NDArray[np.int64]) -> Endings:
        """Return the endings of the points in rows of the summary."""
        status, cause = (grid.summary[name][rows] for name in ("status", "end_cause"))
        found = np.where(status == "ok", cause, status)
        code = np.full(len(rows), -1)
        causes: list[str] = []
        for name in COLOURS:
            here = found == name
            if np.any(here):
                code[here] = len(causes)
                causes.append(name)
        if np.any(code < 0):
            raise ValueError(f"there is no colour for the ending {found[code < 0][0]!r}")
        return Endings(tuple(causes), code)

    def colours(self) -> ListedColormap:
        """Return the colours of the causes that occur."""
        return ListedColormap([COLOURS[cause] for cause in self.causes])

    def norm(self) -> BoundaryNorm:
        """Return the map from codes to colours."""
        number = len(self.causes)
        return BoundaryNorm(np.arange(number + 1) - 0.5, number)

    def entries(self) -> list[tuple[str, dict[str, Any]]]:
        """Return the legend: each cause with the number of its points."""
        counts = np.bincount(self.code, minlength=len(self.causes))
        return [
            (
                f"{WORDS.get(cause, cause.replace('_', ' '))} ({grouped(count)})",
                patch(COLOURS[cause]),
            )
            for cause, count in zip(self.causes, counts.tolist(), strict=True)
        ]


def patch(colour: str) -> dict[str, Any]:
    """Return the look of a colour in a legend."""
    return {
        "marker": "s",
        "markersize": 4.5,
        "markerfacecolor": colour,
        "markeredgecolor": "#303030",
        "markeredgewidth": 0.3,
        "linestyle": "none",
    }


def grouped(count: int) -> str:
    """Return a whole number, in groups of three digits from 10 000 on."""
    return f"{count:,}".replace(",", "\u2009") if count >= 10_000 else str(count)
