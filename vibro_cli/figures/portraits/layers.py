"""What is drawn on a portrait: curves behind, branches, jumps at impacts, marks, the legend."""

from __future__ import annotations

import math
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
from vibro_cli.figures.labels import HALO, Entry, place_numbers, ring, tied
from vibro_cli.figures.portraits.panels import Panel, Window
from vibro_cli.figures.portraits.trajectory import MOST_NUMBERS, Branches, Jumps, Trajectory
from vibro_cli.figures.source import Array, why_not_made
from vibro_cli.figures.style import Look, line, mark
from vibro_cli.mechanics.trace import Piece


def legend_of(path: Trajectory, behind: Background, others: Sequence[Entry]) -> list[Entry]:
    """Return names and looks of everything on a portrait, `others` after what is of the run."""
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
    return [*entries, *others, *behind_entries(behind)]


def behind_entries(*behind: Background) -> list[Entry]:
    """Return names and looks of what stands behind the branches, of one panel or of several."""
    kinds = {point.kind for one in behind for point in one.points}
    return [
        *(
            (words, look)
            for curves, words, look, _ in CURVES
            if any(getattr(one, curves) for one in behind)
        ),
        *((kind, POINT | {"marker": mark}) for kind, mark in MARKER.items() if kind in kinds),
    ]


def coloured_until(path: Trajectory) -> float | None:
    """Return the time (s) with which the colours of time end: of the body's last impact.

    None for so few impacts that they are numbered and marked one by one: then there is one colour.
    """
    if len(path.jumps.number) <= MOST_NUMBERS:
        return None
    made = path.jumps.time[path.jumps.made]
    return float(np.max(made)) if len(made) else path.end


_SAME = 1e-9
"""Separatrices closer than this fraction of the highest are drawn as one."""
_APART = 0.05
"""Between energies closer than this fraction of the highest there are no level curves."""
_FRACTIONS = (1.0 / 3.0, 2.0 / 3.0)
"""Where level curves lie between two energies, by the root of the energy: evenly in rate."""


@dataclass(frozen=True)
class Background:
    """Curves behind the branches, each list for the whole trace."""

    levels: tuple[LevelCurve, ...]
    points: tuple[SingularPoint, ...]
    separatrices: tuple[LevelCurve, ...] = ()
    """Level curves through the saddles of the trace."""
    eights: tuple[LevelCurve, ...] = ()
    """Those that are a figure eight, where they are told apart."""
    arc_separatrices: tuple[LevelCurve, ...] = ()
    """On a trace without a saddle, those of the full circles of which the arcs are parts."""


def background(landscape: Landscape, highest: float, passed: float = 0.0) -> Background:
    """Return the curves behind a portrait whose branches have energies up to `highest` (J).

    `passed` as in `level_energies`.
    """
    points = singular_points(landscape)
    saddles = saddle_energies(points)
    pieces = landscape.trace.pieces
    levels = level_energies(points, highest, passed)
    reached, own_points = max([0.0, *levels, *saddles]), {point.piece for point in points}
    for piece in (one for one in pieces if one.index not in own_points):
        levels += _beyond(landscape, piece, reached)
    own = [] if saddles else [arc_separatrix(landscape, piece) for piece in pieces]
    return Background(
        separatrices=through_saddles(points, partial(separatrix_curves, landscape)),
        arc_separatrices=tuple(curve for curve in own if curve is not None),
        levels=curves_at(landscape, levels),
        points=points,
    )


def _beyond(landscape: Landscape, piece: Piece, reached: float) -> list[float]:
    """Return energies (J) of level curves that turn back on a piece which the others do not cross.

    Without them its panel would be empty: on a trace that rotates about a distant axis, or climbs,
    curves with energies up to the one `reached` (J) may be on one of its pieces only.
    """
    ends = np.array([piece.angle_start, piece.angle_end])
    if float(landscape.potential(piece, np.mean(ends))) <= reached:
        return []
    low, high = np.sort(landscape.potential(piece, ends)).tolist()
    rise = (high - low) or low  # over a level piece they pass
    return [low + fraction**2 * rise for fraction in _FRACTIONS]


def curves_at(landscape: Landscape, energies: Sequence[float]) -> tuple[LevelCurve, ...]:
    """Return the level curves of some energies (J), piece by piece."""
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


def through_saddles(
    points: Sequence[SingularPoint], curves: Callable[[float, list[float]], Sequence[LevelCurve]]
) -> tuple[LevelCurve, ...]:
    """Return the separatrices of those of some points that are saddles.

    `curves` gives those of an energy (J) through saddles at arc lengths (m).
    """
    saddles = [point for point in points if point.kind == SADDLE]
    near = _SAME * max((abs(point.energy) for point in saddles), default=0.0)
    found: list[LevelCurve] = []
    for energy in saddle_energies(saddles):
        found += curves(energy, [one.s for one in saddles if abs(one.energy - energy) <= near])
    return tuple(found)


def level_energies(
    points: Sequence[SingularPoint], highest: float, passed: float = 0.0
) -> list[float]:
    """Return energies of level curves: between the singular ones, and above up to the highest.

    Where there is no saddle also below and above one that is to be `passed` (J), if it is not 0.
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


_HAIR = 0.008
"""How far a curve that is drawn may lie from the true one (mm)."""
_MARK = 0.7
"""Radius of a mark with some room around it (mm)."""
_FEW = 60
_THINNEST = 0.3
_MANY = 150
_FAINTEST = 0.15
_OVERVIEW = 0.6
_HINDERING = 200
"""Branches that numbers keep clear of; of more an even choice."""

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
NUMBER: Look = {"fontsize": style.SMALL, "ha": "center", "va": "center_baseline"}
LEADER = line(style.FRAME_GREY, 0.35)
WINDOW: Look = {"facecolor": "#ececec", "edgecolor": style.FRAME_GREY, "linewidth": 0.35}
POINT = mark("+", 3.2, style.SEPARATRIX_GREY) | {"markeredgewidth": 0.6}
MARKER = {CENTRE: "+", SADDLE: "x"}
CURVES = (
    ("eights", "figure eight", EIGHT, 1.25),
    ("separatrices", "separatrix", SEPARATRIX, 1.2),
    ("arc_separatrices", "separatrix of the full circle", ARC_SEPARATRIX, 1.1),
    ("levels", "level", LEVEL, 1.0),
)
"""The curves of a background, in words, how they look, and which lie over others."""


def by_time(look: Look, times: Array, until: float) -> Look:
    """Return the look of lines in the colours of their times (s), from 0 to a last one."""
    coloured = {"array": times, "cmap": style.time_colours(), "norm": Normalize(0.0, until)}
    return {name: value for name, value in look.items() if name != "color"} | coloured


def thinner(width: float, lines: int) -> float:
    """Return the width (pt) of one of many lines, for the width of one of a few."""
    return float(np.clip(width * math.sqrt(_FEW / max(lines, 1)), _THINNEST, width))


def fainter(lines: int) -> float:
    """Return the opacity of one of many lines, so that where they lie dense is seen as denser."""
    return float(np.clip(0.9 * math.sqrt(_MANY / max(lines, 1)), _FAINTEST, 0.9))


def draw_background(one: Panel, behind: Background) -> None:
    """Draw separatrices, level curves and singular points of one piece."""
    for curves, _, look, order in CURVES:
        draw_curves(one, getattr(behind, curves), order, look)
    draw_points(one, behind.points, 1.3)


def draw_curves(one: Panel, curves: Sequence[LevelCurve], order: float, look: Look) -> None:
    """Draw those level curves that are on one piece; `order` is their height over others."""
    shift = np.array([one.shift, 0.0])
    own = [curve for curve in curves if curve.piece == one.piece.index]
    lines = [line + shift for curve in own for line in both_halves(curve)]
    if lines:
        one.axes.add_collection(LineCollection(lines, zorder=order, **look), autolim=False)


def draw_points(one: Panel, points: Sequence[SingularPoint], order: float) -> None:
    """Mark those singular points that are on one piece."""
    for point in points:
        if point.piece == one.piece.index and point.kind in MARKER:
            place, marker = point.position + one.shift, MARKER[point.kind]
            one.axes.plot(place, 0.0, zorder=order, **(POINT | {"marker": marker}))


def draw_branches(one: Panel, path: Trajectory, until: float | None) -> None:
    """Draw branches, those of lasting contact in a colour of their own.

    The others have one colour or, with `until`, those of the time at which they begin, from 0 to
    then (s). The more there are in all, the thinner they are.
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
    """Return the branches in order of time, each with only the points that its shape needs.

    Of 2ⁿ + 1 points every second, fourth, … is kept, as long as the rest lies within a hair's
    breadth of the line through them.
    """
    lines = np.stack([branches.position + one.shift, branches.rate], axis=-1)
    scale = np.array(
        [one.width / (one.window.high - one.window.low), 0.5 * one.height / one.window.top]
    )
    intervals = lines.shape[1] - 1
    stride = np.ones(len(lines), dtype=np.int64)
    step = 2
    while step <= intervals and intervals % step == 0:
        strayed = _stray(lines * scale, step)
        stride = np.where((strayed <= _HAIR) & (stride == step // 2), step, stride)
        step *= 2
    order = np.argsort(branches.time, kind="stable").tolist()
    return order, [lines[n, :: stride[n]] for n in order]


def _stray(lines: Array, step: int) -> Array:
    """Return how far points (mm) lie from those between every `step`-th; shape (lines,)."""
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
        collection.set_rasterized(True)
    one.axes.add_collection(collection, autolim=False)
    if marked:
        for rate, look in ((jumps.before, BEFORE), (jumps.after, AFTER)):
            one.axes.plot(position[made], rate[made], zorder=2.4, clip_on=False, **look)
    refused = here & ~jumps.made
    one.axes.plot(position[refused], jumps.before[refused], zorder=2.5, **NOT_MADE)


def many_jumps(number: int) -> Look:
    """Return the look of jumps that are too many to be marked one by one."""
    width = thinner(JUMP["linewidth"], number) * 0.7
    return JUMP | {"linewidth": width, "linestyle": "solid", "alpha": 0.5 * fainter(number)}


def draw_start(one: Panel, position: float, rate: float) -> None:
    """Mark where the body starts, smaller on the overview."""
    size = START["markersize"] * (0.5 if one.window.overview else 1.0)
    look = START | {"markersize": size}
    one.axes.plot(position + one.shift, rate, zorder=2.6, clip_on=False, **look)


def draw_window(one: Panel, close: Window) -> None:
    """Draw the frame of a closer view behind the curves of the overview of its piece."""
    low, high = close.low + one.shift, close.high + one.shift
    frame = Rectangle((low, -close.top), high - low, 2.0 * close.top, zorder=0.8, **WINDOW)
    one.axes.add_patch(frame)


def draw_numbers(one: Panel, branches: Branches, jumps: Jumps, marks: Array) -> None:
    """Write the number of each impact beside its representative points.

    Clear of other `marks` too (mm), shape (n, 2).
    """
    here = np.flatnonzero(jumps.piece == one.piece.index)
    if not len(here):
        return
    before = one.millimetres(jumps.position[here], jumps.before[here])
    arrived = np.where(jumps.made[here], jumps.after[here], jumps.before[here])
    after = one.millimetres(jumps.position[here], arrived)
    shares = np.linspace(0.0, 1.0, 25)[None, :, None]
    segments = (before[:, None, :] * (1.0 - shares) + after[:, None, :] * shares).reshape(-1, 2)
    some = slice(None, None, -(-len(branches.time) // _HINDERING) or 1)
    curves = one.millimetres(branches.position[some].ravel(), branches.rate[some].ravel())
    obstacles = np.concatenate([curves, segments, *_around([before, after, marks])])
    texts = [str(number) for number in jumps.number[here]]
    anchors = [np.stack(pair) for pair in zip(after, before, strict=True)]
    places = place_numbers(texts, anchors, obstacles, (one.width, one.height))
    for number, place, tie in tied(places, anchors):
        at = one.from_millimetres(place)
        one.axes.text(*at, texts[number], path_effects=HALO, zorder=3.0, **NUMBER)
        if tie is not None:
            ends = np.array([one.from_millimetres((x, y)) for x, y in tie])
            one.axes.plot(ends[:, 0], ends[:, 1], zorder=2.3, **LEADER)


def _around(marks: list[Array]) -> list[Array]:
    """Return points all over marks (mm): a number may cross a curve, not a mark."""
    around = _MARK * ring(13)[:-1]
    return [points + offset for points in marks for offset in (*around, *0.5 * around)]
