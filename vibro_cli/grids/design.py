"""From axes to points: any stretch of the points of a grid as columns."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from vibro_cli.grids.axes import Axis, Column
from vibro_cli.scenario.problems import KeyPath

SAMPLED = ("latin-hypercube", "sobol")
"""Modes that draw a number of points from the axes."""
MODES = ("product", "zip", *SAMPLED)


@dataclass(frozen=True)
class Design:
    """The points of a grid, numbered from 0; the last axis changes fastest."""

    axes: tuple[Axis, ...]
    mode: str
    points: int
    seed: int

    @property
    def paths(self) -> tuple[KeyPath, ...]:
        """The path of every column."""
        return tuple(path for axis in self.axes for path in axis.paths)

    def resolved(self) -> dict[str, Any]:
        """Return the design as plain data."""
        return {
            "mode": self.mode,
            "n": self.points,
            "seed": self.seed,
            "axes": [axis.resolved for axis in self.axes],
        }

    def columns(self, indices: Column) -> dict[KeyPath, Column]:
        """Return the value of every path at some points."""
        found: dict[KeyPath, Column] = {}
        for number, axis in enumerate(self.axes):
            if self.mode in ("product", "zip"):
                values = axis.at(self._index(number, indices))
            else:
                values = axis.drawn(self._shares(indices)[:, number])
            found.update(zip(axis.paths, values, strict=True))
        return found

    def _index(self, number: int, indices: Column) -> Column:
        """Index on one axis of some points."""
        if self.mode == "zip":
            return indices
        inner = 1
        for axis in self.axes[number + 1 :]:
            inner *= len(axis)
        return (indices // inner) % len(self.axes[number])

    def _shares(self, indices: Column) -> Column:
        """Points of the unit cube, a row for each, from scipy's quasi-random designs."""
        if self.mode == "latin-hypercube":
            return np.asarray(self._hypercube[indices])
        from scipy.stats import qmc

        if not len(indices):
            return np.zeros((0, len(self.axes)))
        first, last = int(indices.min()), int(indices.max())
        engine = qmc.Sobol(len(self.axes), scramble=True, rng=np.random.default_rng(self.seed))
        if first:
            engine.fast_forward(first)
        # The first draw is of one point: of any other number it would warn of lost balance.
        stretch: Column = engine.random(1)
        if last > first:
            stretch = np.concatenate([stretch, engine.random(last - first)])
        return np.asarray(stretch[indices - first])

    @cached_property
    def _hypercube(self) -> Column:
        from scipy.stats import qmc

        rng = np.random.default_rng(self.seed)
        return np.asarray(qmc.LatinHypercube(len(self.axes), rng=rng).random(self.points))
