"""Numbers beside points, placed where they cover least."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib import patheffects
from matplotlib.axes import Axes

from vibro_cli.figures import style
from vibro_cli.figures.source import Array

_CHARACTER = 1.25
"""Width of a figure (mm)."""
_HIGH = 2.5
"""Height of a figure (mm)."""
LEADER = 3.9
"""A number further than this from its point (mm) wants a line to it."""
_CLEAR = 0.5
"""Room between two numbers side by side, and between a number and the frame (mm)."""
_DISTANCES = (1.9, 2.6, 3.4, 4.4, 5.8, 7.4)
"""Distances of a number from its point that are tried (mm)."""
_DIRECTIONS = 12
_FAR = 2.0
"""Points of curves that may be covered to come 1 mm nearer."""
_OTHER = 15.0
"""Points of curves that may be covered to stand beside the preferred point."""
_AMBIGUOUS = 40.0
"""Points of curves that may be covered not to stand nearer to another point than to one's own."""
_FORBIDDEN = 1e6


def place_numbers(
    texts: Sequence[str],
    anchors: Sequence[Array],
    obstacles: Array,
    size: tuple[float, float],
    reserved: Sequence[tuple[float, float, float]] = (),
) -> list[tuple[float, float]]:
    """Return where to centre each text so that it covers as little as possible.

    All in mm from the lower left corner of a panel of the given size: `anchors` holds for each text
    the points it may stand beside, shape (k, 2), the preferred one first; `obstacles` are points of
    everything drawn, shape (n, 2); `reserved` are the middles and half widths of texts that stand
    already. Greedy, in the order of the texts.
    """
    taken = [*reserved]
    places = []
    for number, (text, points) in enumerate(zip(texts, anchors, strict=True)):
        half = 0.5 * _CHARACTER * len(text) + 0.15
        candidates, costs = _candidates(points, half)
        costs = costs + _covered(candidates, half, obstacles)
        others = [*anchors[:number], *anchors[number + 1 :]]
        costs += _AMBIGUOUS * _nearer_to(candidates, others, points)
        costs += _FORBIDDEN * _outside(candidates, half, size)
        for x, y, other in taken:
            near = (np.abs(candidates[:, 0] - x) < half + other + _CLEAR) & (
                np.abs(candidates[:, 1] - y) < _HIGH
            )
            costs += _FORBIDDEN * near
        best = candidates[int(np.argmin(costs))]
        places.append((float(best[0]), float(best[1])))
        taken.append((float(best[0]), float(best[1]), half))
    return places


def leader(place: tuple[float, float], points: Array) -> Array | None:
    """Return the line from a number to its nearest point, shape (2, 2); None if it is near."""
    nearest = points[np.argmin(np.hypot(*(points - place).T))]
    reach = nearest - place
    length = float(np.hypot(*reach))
    if length <= LEADER:
        return None
    return np.stack([place + reach * (0.6 * _HIGH / length), nearest])


def _candidates(points: Array, half: float) -> tuple[Array, Array]:
    """Return places around points, and the cost of their distance and of the point's rank."""
    angles = 2.0 * math.pi * np.arange(_DIRECTIONS) / _DIRECTIONS
    ring = np.column_stack([np.cos(angles), np.sin(angles)])
    places, costs = [], []
    for rank, point in enumerate(points):
        for distance in _DISTANCES:
            reach = np.array([distance + half - 0.5, distance])
            places.append(point + ring * reach)
            costs.append(np.full(_DIRECTIONS, _FAR * distance + _OTHER * rank))
    return np.concatenate(places), np.concatenate(costs)


def _nearer_to(candidates: Array, others: Sequence[Array], own: Array) -> Array:
    """Return 1 for each place that is about as near to another text's points as to its own."""
    if not others:
        return np.zeros(len(candidates))
    nearer = _nearest(candidates, np.concatenate(others)) < 1.2 * _nearest(candidates, own)
    return np.where(nearer, 1.0, 0.0)


def _nearest(places: Array, points: Array) -> Array:
    between = places[:, None, :] - points[None, :, :]
    nearest: Array = np.hypot(between[..., 0], between[..., 1]).min(axis=1)
    return nearest


def _covered(candidates: Array, half: float, obstacles: Array) -> Array:
    reach = np.array([half, 0.5 * _HIGH])
    low, high = candidates.min(axis=0) - reach, candidates.max(axis=0) + reach
    obstacles = obstacles[((obstacles >= low) & (obstacles <= high)).all(axis=1)]
    across = np.abs(candidates[:, 0, None] - obstacles[None, :, 0]) < half
    along = np.abs(candidates[:, 1, None] - obstacles[None, :, 1]) < 0.5 * _HIGH
    covered: Array = (across & along).sum(axis=1).astype(np.float64)
    return covered


def _outside(candidates: Array, half: float, size: tuple[float, float]) -> Array:
    margin = np.array([half + _CLEAR, 0.5 * _HIGH + _CLEAR])
    beyond = (candidates < margin) | (candidates > np.array(size) - margin)
    outside: Array = beyond.any(axis=1).astype(np.float64)
    return outside


@dataclass(frozen=True)
class Named:
    """A point of a drawing with its name."""

    text: str
    """As it is written, perhaps a formula."""
    point: tuple[float, float]
    """In the panel's units."""
    colour: str = style.BLACK


def write_names(
    axes: Axes,
    names: Sequence[Named],
    obstacles: Array,
    size: tuple[float, float],
    figures: Sequence[tuple[float, float]] = (),
) -> None:
    """Write names beside their points, where they cover least of `obstacles`, shape (n, 2).

    Points in the units of the axes, `size` of the panel in mm. Names that stand far get lines.
    `figures` are the middles of single figures that are written already.
    """
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    corner = np.array([left, low])
    scale = np.array([size[0] / (right - left), size[1] / (high - low)])
    anchors = [((np.array([name.point]) - corner) * scale) for name in names]
    marks = np.concatenate([*anchors, *anchors, *anchors]) if anchors else np.zeros((0, 2))
    covered = np.concatenate([(np.reshape(obstacles, (-1, 2)) - corner) * scale, marks])
    plain = [_plain(name.text) for name in names]
    halo = [patheffects.withStroke(linewidth=1.4, foreground="white")]
    written = (np.reshape(figures, (-1, 2)) - corner) * scale
    reserved = [(float(x), float(y), _CHARACTER) for x, y in written]
    places = place_numbers(plain, anchors, covered, size, reserved)
    for name, place, anchor in zip(names, places, anchors, strict=True):
        line = leader(place, anchor)
        if line is not None:
            ends = line / scale + corner
            axes.plot(ends[:, 0], ends[:, 1], color=name.colour, linewidth=0.35, zorder=4.5)
        at = np.array(place) / scale + corner
        axes.text(
            float(at[0]), float(at[1]), name.text, color=name.colour, path_effects=halo,
            fontsize=style.SMALL, ha="center", va="center", zorder=5.0,
        )  # fmt: skip


def _plain(text: str) -> str:
    """Return about as many characters as a formula is wide."""
    bare = re.sub(r"\\(?:mathrm|dot|,|;)|[${}_^']", "", text)
    return re.sub(r"\\[a-zA-Z]+", "w", bare)
