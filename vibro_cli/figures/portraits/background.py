"""What stands behind a phase portrait: separatrices, level curves of energy, singular points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from vibro_cli.analysis.landscape import Array, Landscape
from vibro_cli.analysis.levels import (
    LevelCurve,
    arc_separatrix,
    level_curves,
    separatrix_curves,
)
from vibro_cli.analysis.singular import CENTRE, SADDLE, SingularPoint, singular_points
from vibro_cli.mechanics.trace import Piece

_SAME = 1e-9
"""Separatrices closer than this fraction of the highest are drawn as one."""
_APART = 0.05
"""Between energies closer than this fraction of the highest there are no level curves."""
_FRACTIONS = (1.0 / 3.0, 2.0 / 3.0)
"""Where level curves lie between two energies, by the root of the energy: evenly in rate."""


@dataclass(frozen=True)
class Background:
    """Curves behind the branches, each list for the whole trace."""

    separatrices: tuple[LevelCurve, ...]
    """Level curves through the saddles of the trace."""
    arc_separatrices: tuple[LevelCurve, ...]
    """On a trace without a saddle, those of the full circles of which the arcs are parts."""
    levels: tuple[LevelCurve, ...]
    points: tuple[SingularPoint, ...]


def background(landscape: Landscape, highest: float) -> Background:
    """Return the curves behind a portrait whose branches have energies up to `highest` (J)."""
    points = singular_points(landscape)
    saddles = saddle_energies(points)
    pieces = landscape.trace.pieces
    own = [] if saddles else [arc_separatrix(landscape, piece) for piece in pieces]
    return Background(
        separatrices=tuple(
            curve
            for energy in saddles
            for curve in separatrix_curves(landscape, energy, saddles_of(points, energy))
        ),
        arc_separatrices=tuple(curve for curve in own if curve is not None),
        levels=_curves(landscape, level_energies(points, highest)),
        points=points,
    )


def _curves(landscape: Landscape, energies: Sequence[float]) -> tuple[LevelCurve, ...]:
    return tuple(
        curve
        for energy in energies
        for piece in landscape.trace.pieces
        for curve in level_curves(landscape, piece, energy)
    )


def _distinct(energies: Sequence[float], share: float) -> list[float]:
    """Return energies in order, without those closer to one before than a share of the highest."""
    chosen: list[float] = []
    for energy in sorted(energies):
        if not chosen or energy - chosen[-1] > share * max(energies):
            chosen.append(energy)
    return chosen


def saddle_energies(points: Sequence[SingularPoint]) -> list[float]:
    """Return the energies (J) of the separatrices: of all saddles, those that are equal once."""
    return _distinct([point.energy for point in points if point.kind == SADDLE], _SAME)


def saddles_of(points: Sequence[SingularPoint], energy: float) -> list[float]:
    """Return the arc lengths (m) of the saddles of an energy (J) of `saddle_energies`."""
    saddles = [point for point in points if point.kind == SADDLE]
    highest = max(abs(point.energy) for point in saddles)
    return [point.s for point in saddles if abs(point.energy - energy) <= _SAME * highest]


def level_energies(points: Sequence[SingularPoint], highest: float) -> list[float]:
    """Return energies of level curves: between the singular ones, and above up to the highest."""
    saddles = saddle_energies(points)
    centres = [point.energy for point in points if point.kind == CENTRE]
    bounds = _distinct([0.0, *centres, *saddles, highest], _APART)
    return [
        low + fraction**2 * (high - low)
        for low, high in pairwise(bounds)
        for fraction in _FRACTIONS
    ]


def both_halves(curve: LevelCurve) -> list[Array]:
    """Return a level curve with its mirror image as lines of points, each of shape (n, 2).

    The halves are one line where the body turns; at a junction they stay apart.
    """
    upper = np.column_stack([curve.position, curve.rate])
    lower = upper[::-1] * (1.0, -1.0)
    if curve.rate[-1] == 0.0:
        return [np.concatenate([upper, lower])]
    if curve.rate[0] == 0.0:
        return [np.concatenate([lower, upper])]
    return [upper, lower]


def on_piece(curves: Sequence[LevelCurve], piece: Piece) -> list[LevelCurve]:
    """Return the curves of one piece."""
    return [curve for curve in curves if curve.piece == piece.index]
