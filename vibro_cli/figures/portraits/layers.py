"""Layers of a portrait: background curves, branches, jumps at impacts, marks, the legend."""

from __future__ import annotations

import math
from bisect import bisect
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize
from matplotlib.patches import Rectangle

from vibro_cli.analysis.levels import (
    Landscape,
    LevelCurve,
    arc_separatrix,
    level_curves,
    separatrix_curves,
)
from vibro_cli.analysis.singular import CENTRE, SADDLE, SingularPoint, singular_points
from vibro_cli.figures import style
from vibro_cli.figures.chart import MOST_VECTOR_POINTS
from vibro_cli.figures.labels import Entry, Named, ring, write_names
from vibro_cli.figures.portraits.panels import Panel, Window
from vibro_cli.figures.portraits.trajectory import MOST_NUMBERS, Branches, Jumps, Trajectory
from vibro_cli.figures.source import Array, why_not_made
from vibro_cli.figures.style import Look, line, mark
from vibro_cli.mechanics.trace import Piece


def legend_of(path: Trajectory, behind: Background, others: Sequence[Entry]) -> list[Entry]:
    """Return the legend entries of a portrait: run, then background, then `others`."""
    jumps, marked = path.jumps, coloured_until(path) is None
    entries = [("start", START)]
    if np.any(path.first.made):
        first = "" if marked else f" 1–{path.first.number[-1]}"
        entries += [("before", BEFORE), (f"after impact{first}", AFTER)]
    if not marked and np.any(jumps.made):
        share = f" (1 in {path.every})" if path.every > 1 else ""
        entries.append((f"jump{share}", many_jumps(1)))
    if not np.all(jumps.made):
        entries.append((why_not_made(jumps.through[~jumps.made]), NOT_MADE))
    if any(np.any(branches.contact) for branches in path.branches):
        entries.append(("lasting contact", CONTACT))
    return [*entries, *behind_entries(behind), *others]


def behind_entries(*behind: Background) -> list[Entry]:
    """Return the legend entries of the backgrounds of one or several panels."""
    kinds = {point.kind for one in behind for point in one.points}
    return [
        *(
            (words, look)
            for curves, words, look, _ in CURVES
            if any(getattr(one, curves) for one in behind)
        ),
        *((kind, POINT | {"marker": mark}) for kind, mark in MARKER.items() if kind in kinds),
        *([("wall", WALL)] if any(one.walls for one in behind) else []),
    ]


def coloured_until(path: Trajectory) -> float | None:
    """Return the last time (s) of the colour bar: that of the body's last impact.

    Returns None if the impacts are few enough to be numbered individually; then there is only one
    colour.
    """
    if len(path.jumps.number) <= MOST_NUMBERS:
        return None
    made = path.jumps.time[path.jumps.made]
    return float(np.max(made)) if len(made) else path.end


_SAME = 1e-9
"""Separatrices closer in energy than this fraction of the highest are drawn as one."""
_APART = 0.05
"""No level curves are drawn between energies closer than this fraction of the highest."""
_FRACTIONS = (1.0 / 3.0, 2.0 / 3.0)
"""Level curves between two energies, as fractions of the root of the energy (evenly in rate)."""


@dataclass(frozen=True)
class Background:
    """Curves behind the branches, on the whole trace or on some of its pieces."""

    levels: tuple[LevelCurve, ...]
    points: tuple[SingularPoint, ...]
    separatrices: tuple[LevelCurve, ...] = ()
    """Level curves through the saddles of the trace."""
    eights: tuple[LevelCurve, ...] = ()
    """Figure eights, if they are drawn separately from other separatrices."""
    arc_separatrices: tuple[LevelCurve, ...] = ()
    """On a trace without a saddle, the separatrices of the full circles that contain the arcs."""
    walls: tuple[tuple[int, float], ...] = ()
    """Index of the piece and position at which the body touches a wall, for each wall it meets."""


def background(
    landscape: Landscape, pieces: Sequence[Piece], highest: float, passed: float = 0.0
) -> Background:
    """Return the curves on some pieces behind branches with energies up to `highest` (J).

    `passed` is as in `level_energies`.
    """
    points = singular_points(landscape)
    saddles = saddle_energies(points)
    levels = level_energies(points, highest, passed)
    reached = max([0.0, *levels, *saddles])
    marked = {point.piece for point in points if point.kind in MARKER}
    for piece in (one for one in pieces if one.index not in marked):
        levels += _beyond(landscape, piece, reached)
    own = [] if saddles else [arc_separatrix(landscape, piece) for piece in pieces]
    return Background(
        separatrices=through_saddles(points, partial(separatrix_curves, landscape, pieces)),
        arc_separatrices=tuple(curve for curve in own if curve is not None),
        levels=curves_at(landscape, pieces, levels),
        points=points,
    )


def _beyond(landscape: Landscape, piece: Piece, reached: float) -> list[float]:
    """Return energies (J) of level curves that turn back on a piece which no other curve reaches.

    Without them its panel would be empty: if the trace rotates about a distant axis, or climbs,
    curves with energies up to `reached` (J) may exist on only some of its pieces.
    """
    ends = np.array([piece.angle_start, piece.angle_end])
    if float(landscape.potential(piece, np.mean(ends))) <= reached:
        return []
    low, high = np.sort(landscape.potential(piece, ends)).tolist()
    rise = (high - low) or min(low, reached) or low  # curves cross a level piece, as fast as others
    return [low + fraction**2 * rise for fraction in _FRACTIONS]


def curves_at(
    landscape: Landscape, pieces: Sequence[Piece], energies: Sequence[float]
) -> tuple[LevelCurve, ...]:
    """Return the level curves of the given energies (J) on some pieces, piece by piece."""
    return tuple(
        curve
        for energy in energies
        for piece in pieces
        for curve in level_curves(landscape, piece, energy)
    )


def _distinct(energies: Sequence[float], share: float) -> list[float]:
    """Return sorted energies, spaced by more than a share of the highest."""
    chosen: list[float] = []
    apart = share * max(energies, default=0.0)
    for energy in sorted(energies):
        if not chosen or energy - chosen[-1] > apart:
            chosen.append(energy)
    return chosen


def saddle_energies(points: Sequence[SingularPoint]) -> list[float]:
    """Return the distinct energies (J) of the saddles, which are those of the separatrices."""
    return _distinct([point.energy for point in points if point.kind == SADDLE], _SAME)


def through_saddles(
    points: Sequence[SingularPoint], curves: Callable[[float, list[float]], Sequence[LevelCurve]]
) -> tuple[LevelCurve, ...]:
    """Return the separatrices through the saddles among some points.

    `curves` gives the separatrices of an energy (J) through saddles at arc lengths (m).
    """
    saddles = sorted((point.energy, point.s) for point in points if point.kind == SADDLE)
    near = _SAME * max((abs(energy) for energy, _ in saddles), default=0.0)
    found: list[LevelCurve] = []
    for energy in saddle_energies(points):
        first, last = bisect(saddles, (energy - near,)), bisect(saddles, (energy + near, math.inf))
        found += curves(energy, sorted(s for _, s in saddles[first:last]))
    return tuple(found)


def level_energies(
    points: Sequence[SingularPoint], highest: float, passed: float = 0.0
) -> list[float]:
    """Return energies (J) of level curves between those of singular points, and up to the highest.

    Without a saddle, curves lie below and above the energy `passed` (J) as well, unless it is 0.
    """
    saddles = saddle_energies(points)
    centres = [point.energy for point in points if point.kind == CENTRE]
    bounds = _distinct([0.0, *centres, *(saddles or [passed]), highest], _APART)
    return [
        low + fraction**2 * (high - low)
        for low, high in pairwise(bounds)
        for fraction in _FRACTIONS
    ]


def both_halves(curve: LevelCurve) -> list[Array]:
    """Return a level curve and its mirror image as lines of points, each of shape (n, 2).

    The halves form one line if the body turns back; at a junction they are separate.
    """
    upper = np.column_stack([curve.position, curve.rate])
    lower = upper[::-1] * (1.0, -1.0)
    if curve.rate[-1] == 0.0:
        return [np.concatenate([upper, lower])]
    if curve.rate[0] == 0.0:
        return [np.concatenate([lower, upper])]
    return [upper, lower]


_HAIR = 0.008
"""Greatest distance of a drawn curve from the true one (mm)."""
_MARK = 0.7
"""Radius of a mark with some room around it (mm)."""
_MOST_LINES = 500
"""Number of jumps on one piece above which they are an image in vector files."""
_FEW = 60
_FEW_SADDLES = 8
"""Number of curves through saddles on one piece above which lines of a background are thinner."""
_THINNEST = 0.3
_MANY = 150
_FAINTEST = 0.15
_OVERVIEW = 0.6
_HINDERING = 200
"""Number of branches, evenly chosen, that numbers keep clear of."""

SEPARATRIX = line(style.SEPARATRIX_GREY, 0.6, (6.0, 2.0))
EIGHT = line(style.VERMILLION, 1.0)
LEVEL = line(style.LEVEL_GREY, 0.45)
ARC_SEPARATRIX = line(style.SEPARATRIX_GREY, 0.45, (1.0, 2.0))
BRANCH = line(style.BLUE, 0.9)
CONTACT = line(style.PURPLE, 1.1)
JUMP = line(style.VERMILLION, 0.8, (2.0, 1.2))
BEFORE = mark("o", 2.8, "white", style.VERMILLION)
AFTER = mark("o", 2.8, style.VERMILLION, style.VERMILLION)
NOT_MADE = mark("X", 4.0, "white", style.VERMILLION)
START = mark("s", 3.6, style.GREEN, style.BLACK, 0.5)
WALL = line(style.SEPARATRIX_GREY, 2.0)
WINDOW: Look = {"facecolor": "#ececec", "edgecolor": style.FRAME_GREY, "linewidth": 0.35}
POINT = mark("+", 3.2, style.SEPARATRIX_GREY) | {"markeredgewidth": 0.6}
MARKER = {CENTRE: "+", SADDLE: "x"}
CURVES = (
    ("eights", "figure eight", EIGHT, 1.25),
    ("separatrices", "separatrix", SEPARATRIX, 1.2),
    ("arc_separatrices", "separatrix of the full circle", ARC_SEPARATRIX, 1.1),
    ("levels", "level", LEVEL, 1.0),
)
"""The curves of a background: attribute, name in the legend, style and drawing order."""


def by_time(look: Look, times: Array, until: float) -> Look:
    """Return the style of lines coloured by their times (s), from 0 to `until`."""
    coloured = {"array": times, "cmap": style.time_colours(), "norm": Normalize(0.0, until)}
    return {name: value for name, value in look.items() if name != "color"} | coloured


def thinner(width: float, lines: int, few: int = _FEW) -> float:
    """Return the width (pt) of each of many lines, given the width for a few lines."""
    return float(np.clip(width * math.sqrt(few / max(lines, 1)), _THINNEST, width))


def fainter(lines: int) -> float:
    """Return the opacity of each of many lines, low enough to show where they are dense."""
    return float(np.clip(0.9 * math.sqrt(_MANY / max(lines, 1)), _FAINTEST, 0.9))


def draw_background(one: Panel, behind: Background) -> None:
    """Draw the separatrices, level curves and singular points of one piece."""
    through = Counter(curve.piece for curve in (*behind.eights, *behind.separatrices))
    most = max(through.values(), default=0)
    for curves, _, look, order in CURVES:
        thin = {"linewidth": thinner(look["linewidth"], most, _FEW_SADDLES)}
        draw_curves(one, getattr(behind, curves), order, look | thin)
    draw_points(one, behind.points, 1.3)
    draw_walls(one, behind)


def draw_walls(one: Panel, behind: Background) -> None:
    """Draw the positions of a piece at which the body touches a wall."""
    for piece, position in behind.walls:
        if piece == one.piece.index:
            one.axes.axvline(position + one.shift, zorder=1.8, **WALL)


def draw_curves(one: Panel, curves: Sequence[LevelCurve], order: float, look: Look) -> None:
    """Draw the level curves that lie on one piece; `order` is their drawing order."""
    shift = np.array([one.shift, 0.0])
    own = [curve for curve in curves if curve.piece == one.piece.index]
    lines = [line + shift for curve in own for line in both_halves(curve)]
    if lines:
        one.axes.add_collection(LineCollection(lines, zorder=order, **look), autolim=False)


def draw_points(one: Panel, points: Sequence[SingularPoint], order: float) -> None:
    """Mark the singular points that lie on one piece."""
    for point in points:
        if point.piece == one.piece.index and point.kind in MARKER:
            place, marker = point.position + one.shift, MARKER[point.kind]
            one.axes.plot(place, 0.0, zorder=order, **(POINT | {"marker": marker}))


def draw_branches(one: Panel, path: Trajectory, until: float | None) -> None:
    """Draw branches, with a separate colour for those of lasting contact.

    With `until`, the others are coloured by the time at which they begin, from 0 to `until` (s),
    and all are the thinner the more there are.
    """
    branches = path.branches[one.piece.index]
    if not len(branches.time):
        return
    order, lines = _thinned(one, branches)
    total = sum(len(each.time) for each in path.branches)
    contact = branches.contact[order]
    for chosen, own in ((~contact, BRANCH), (contact, CONTACT)):
        rows = np.flatnonzero(chosen)
        if not len(rows):
            continue
        look: Look = dict(own)
        if until is not None:
            look |= {"linewidth": thinner(own["linewidth"], total), "alpha": fainter(total)}
            if own is BRANCH:
                look = by_time(look, branches.time[order][rows], until)
        if one.window.overview:
            look["linewidth"] *= _OVERVIEW
        collection = LineCollection([lines[n] for n in rows], zorder=2.0, **look)
        collection.set_rasterized(sum(len(lines[n]) for n in rows) > MOST_VECTOR_POINTS)
        one.axes.add_collection(collection, autolim=False)


def _thinned(one: Panel, branches: Branches) -> tuple[list[int], list[Array]]:
    """Return the order of the branches in time, and their lines without superfluous points.

    Of 2ⁿ + 1 points every second, fourth, … is kept, as long as the others lie within `_HAIR` of
    the line through these.
    """
    lines = np.stack([branches.position + one.shift, branches.rate], axis=-1)
    scaled, intervals = lines * one.scale, lines.shape[1] - 1
    stride, straight = np.ones(len(lines), dtype=np.int64), np.arange(len(lines))
    step = 2
    while step <= intervals and intervals % step == 0:
        straight = straight[_stray(scaled[straight], step) <= _HAIR]
        stride[straight] = step
        step *= 2
    order = np.argsort(branches.time, kind="stable").tolist()
    return order, [lines[n, :: stride[n]] for n in order]


def _stray(lines: Array, step: int) -> Array:
    """Return the greatest distance (mm) of points from lines through every `step`-th point.

    The shape is (lines,).
    """
    kept = lines[:, ::step]
    share = (np.arange(step) / step)[:, None]
    between = kept[:, :-1, None] * (1.0 - share) + kept[:, 1:, None] * share
    off = lines[:, :-1].reshape(between.shape) - between
    strayed: Array = np.max(np.hypot(off[..., 0], off[..., 1]), axis=(1, 2))
    return strayed


def draw_jumps(one: Panel, jumps: Jumps, marked: bool) -> None:
    """Draw the jumps on one piece: at constant angle, from the rate before to the one after."""
    here = jumps.piece == one.piece.index
    made = here & jumps.made
    position = jumps.position + one.shift
    ends = [np.column_stack([position[made], rate[made]]) for rate in (jumps.before, jumps.after)]
    collection = LineCollection(list(np.stack(ends, axis=1)), zorder=2.2, **JUMP)
    if not marked:
        collection.set(zorder=1.9, **many_jumps(len(jumps.made)))
        collection.set_rasterized(int(np.sum(made)) > _MOST_LINES)
    one.axes.add_collection(collection, autolim=False)
    if marked:
        for rate, look in ((jumps.before, BEFORE), (jumps.after, AFTER)):
            one.axes.plot(position[made], rate[made], zorder=2.4, clip_on=False, **look)
    refused = here & ~jumps.made
    one.axes.plot(position[refused], jumps.before[refused], zorder=2.5, **NOT_MADE)


def many_jumps(number: int) -> Look:
    """Return the style of jumps that are too many to be marked individually."""
    width = thinner(JUMP["linewidth"], number) * 0.7
    return JUMP | {"linewidth": width, "linestyle": "solid", "alpha": 0.5 * fainter(number)}


def draw_start(one: Panel, position: float, rate: float) -> None:
    """Mark the start of the body, smaller on the overview."""
    size = START["markersize"] * (0.5 if one.window.overview else 1.0)
    look = START | {"markersize": size}
    one.axes.plot(position + one.shift, rate, zorder=2.6, clip_on=False, **look)


def draw_window(one: Panel, close: Window) -> None:
    """Draw the frame of the close-up view behind the curves of the overview of its piece."""
    low, high = close.low + one.shift, close.high + one.shift
    frame = Rectangle((low, -close.top), high - low, 2.0 * close.top, zorder=0.8, **WINDOW)
    one.axes.add_patch(frame)


def draw_numbers(one: Panel, branches: Branches, jumps: Jumps, marks: Array) -> None:
    """Write the number of each impact beside its representative points.

    The numbers also keep clear of other `marks`, positions and rates of shape (n, 2).
    """
    here = np.flatnonzero(jumps.piece == one.piece.index)
    if not len(here):
        return
    arrived = np.where(jumps.made[here], jumps.after[here], jumps.before[here])
    before, after = (
        np.column_stack([jumps.position[here], rate]) for rate in (jumps.before[here], arrived)
    )
    some = slice(None, None, -(-len(branches.time) // _HINDERING) or 1)
    curves = np.column_stack([branches.position[some].ravel(), branches.rate[some].ravel()])
    # A number may cross a curve, but not a mark, which is covered by points.
    disc = _MARK * ring(13)[:-1] / one.scale
    around = [
        points + offset for points in (before, after, marks) for offset in (*disc, *0.5 * disc)
    ]
    segments = np.linspace(before, after, 25).reshape(-1, 2)
    shift = np.array([one.shift, 0.0])
    named = [
        Named(str(number), np.stack(pair) + shift)
        for number, *pair in zip(jumps.number[here], after, before, strict=True)
    ]
    write_names(one.axes, named, np.concatenate([curves, segments, *around]) + shift, order=2.8)
