"""The plan of a run on the table: wall, paths of the balls, velocities at impacts (C fig. 1, 4)."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Ellipse, Polygon
from numpy.typing import NDArray

from vibro_cli.figures import style
from vibro_cli.figures.numbering import leader, place_numbers
from vibro_cli.systems.table.run import TableRun
from vibro_cli.systems.table.system import POLYGON, Wall

MOST_ARROWS = 40
"""Events up to which the velocities before and after each are drawn."""
MOST_LINES = 20_000
"""Flights of a ball that are drawn at most; the figure says how many there are."""
_ARROW = 0.09
"""Length of the arrow of the fastest ball, as a share of the figure's width."""
_COLORS = (style.BLUE, style.VERMILLION, style.GREEN, style.BLACK, "#CC79A7", "#E69F00")
_DASHES: tuple[tuple[int, tuple[float, ...]], ...] = (
    (0, ()),
    (0, (5.0, 1.5)),
    (0, (1.0, 1.0)),
    (0, (5.0, 1.5, 1.0, 1.5)),
)

Floats = NDArray[np.float64]


def table_plan(run: TableRun, width: str = "single") -> Figure:
    """Return the plan of a run: the wall, each ball's path, arrows of velocity at its events.

    The balls are drawn where they start (filled) and where they collide (outlined). `width` is
    `single` (85 mm) or `double` (170 mm).
    """
    paths = [_path(run, ball) for ball in range(len(run.system.bodies))]
    low, high = _extent(run, paths)
    millimetres = style.WIDTHS[width]
    height = min(max((high[1] - low[1]) / (high[0] - low[0]), 0.25), 1.5) * (millimetres - 12.0)
    with style.journal():
        figure = Figure(figsize=(millimetres * style.MM, (height + 16.0) * style.MM))
        axes = figure.add_axes((10.0 / millimetres, 9.0 / (height + 16.0), 0.0, 0.0))
        box = (millimetres - 12.0) / millimetres, height / (height + 16.0)
        axes.set_position((10.0 / millimetres, 9.0 / (height + 16.0), *box))
        axes.set_aspect("equal", adjustable="datalim")
        axes.set_xlim(low[0], high[0])
        axes.set_ylim(low[1], high[1])
        axes.set_xlabel("$x$ [m]")
        axes.set_ylabel("$y$ [m]")
        if run.system.wall is not None:
            _draw_wall(axes, run.system.wall)
        for ball, path in enumerate(paths):
            _draw_path(axes, run, ball, path)
        _draw_impacts(axes, run)
        _draw_velocities(axes, run, paths, _ARROW * (high[0] - low[0]))
        _draw_numbers(axes, run, paths, (box[0] * millimetres, box[1] * (height + 16.0)))
        axes.set_title(_title(run, paths), pad=2.0, color=style.FRAME_GREY)
    return figure


def _path(run: TableRun, ball: int) -> Floats:
    """Places of a ball at its start, its events and the end, a row each."""
    events = run.paths.balls[ball]
    last = run.paths.at(ball, np.array([run.end_time]))
    x = np.append(events["x"], last["x"])
    return np.column_stack([x, np.append(events["y"], last["y"])])[: MOST_LINES + 1]


def _extent(run: TableRun, paths: list[Floats]) -> tuple[Floats, Floats]:
    """The corners of what is drawn."""
    radii = [body.radius for body in run.system.bodies]
    low = np.min([path.min(axis=0) - r for path, r in zip(paths, radii, strict=True)], axis=0)
    high = np.max([path.max(axis=0) + r for path, r in zip(paths, radii, strict=True)], axis=0)
    wall = run.system.wall
    if wall is not None:
        points = np.array(wall.corners or [wall.center])
        axes = np.array(wall.semi_axes)
        low = np.minimum(low, points.min(axis=0) - axes)
        high = np.maximum(high, points.max(axis=0) + axes)
    margin = 0.05 * float(np.max(high - low)) or 1.0
    return low - margin, high + margin


def _draw_wall(axes: Axes, wall: Wall) -> None:
    look: dict[str, Any] = {"edgecolor": style.FRAME_GREY, "linewidth": 1.4, "zorder": 1.0}
    filled = "none" if wall.inside else style.LEVEL_GREY
    if wall.shape == POLYGON:
        axes.add_patch(Polygon(list(wall.corners), facecolor=filled, **look))
    else:
        a, b = wall.semi_axes
        axes.add_patch(Ellipse(wall.center, 2.0 * a, 2.0 * b, facecolor=filled, **look))


def _draw_path(axes: Axes, run: TableRun, ball: int, path: Floats) -> None:
    color = _COLORS[ball % len(_COLORS)]
    dashes = _DASHES[ball % len(_DASHES)]
    lines = LineCollection(
        [path], colors=color, linewidths=0.8 if len(path) < 500 else 0.3, zorder=2.0,
        linestyles=[dashes], rasterized=len(path) > 2000,
    )  # fmt: skip
    axes.add_collection(lines)
    radius = run.system.bodies[ball].radius
    axes.add_patch(Circle(tuple(path[0]), radius, facecolor=color, alpha=0.25, edgecolor=color))
    axes.plot(*path[0], marker=".", markersize=3.0, color=color, zorder=4.0)


def _draw_numbers(
    axes: Axes, run: TableRun, paths: list[Floats], size: tuple[float, float]
) -> None:
    """Write each ball's number beside its start, where it covers least (`size` in mm)."""
    axes.apply_aspect()
    corner, scale = _millimetres(axes, size)
    starts = [(path[:1] - corner) * scale for path in paths]
    passed = np.concatenate([_points_along(path) for path in paths])
    around = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    ring = np.column_stack([np.cos(around), np.sin(around)])
    ring = np.concatenate([share * ring for share in (0.25, 0.5, 0.75, 1.0)])
    circles = [
        path[0] + body.radius * ring for path, body in zip(paths, run.system.bodies, strict=True)
    ]
    obstacles = (np.concatenate([passed, *circles]) - corner) * scale
    texts = [str(ball) for ball in range(1, len(paths) + 1)]
    places = place_numbers(texts, starts, obstacles, size)
    for ball, (text, place) in enumerate(zip(texts, places, strict=True)):
        color = _COLORS[ball % len(_COLORS)]
        line = leader(place, starts[ball])
        if line is not None:
            axes.plot(*(line / scale + corner).T, color=color, linewidth=0.4, zorder=5.0)
        at = np.array(place) / scale + corner
        axes.text(
            float(at[0]), float(at[1]), text, color=color, fontsize=style.SMALL, zorder=6.5,
            ha="center", va="center_baseline",
        )  # fmt: skip


def _millimetres(axes: Axes, size: tuple[float, float]) -> tuple[Floats, Floats]:
    """The lower left corner of the panel in m, and millimetres in a metre along both axes."""
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    return np.array([left, bottom]), np.array([size[0] / (right - left), size[1] / (top - bottom)])


def _points_along(path: Floats) -> Floats:
    """Points of the first flights of a path, close enough for numbers to keep clear of them."""
    first = path[:MOST_ARROWS]
    share = np.linspace(0.0, 1.0, 60)[:, None]
    pieces = [a + share * (b - a) for a, b in pairwise(first)]
    return np.concatenate(pieces) if pieces else first


def _draw_impacts(axes: Axes, run: TableRun) -> None:
    """The balls where they touch, and their common tangent."""
    table = run.collisions
    for row in range(min(len(table["n"]), MOST_ARROWS)):
        for letter in "ab":
            ball = int(table[f"ball_{letter}"][row]) - 1
            place = (float(table[f"x_{letter}"][row]), float(table[f"y_{letter}"][row]))
            color = _COLORS[ball % len(_COLORS)]
            radius = run.system.bodies[ball].radius
            axes.add_patch(Circle(place, radius, fill=False, edgecolor=color, linewidth=0.6))


def _draw_velocities(axes: Axes, run: TableRun, paths: list[Floats], length: float) -> None:
    """Arrows of the velocity at the start and before (open) and after (full) each impact."""
    arrows = _arrows(run)
    if not arrows:
        return
    fastest = max(float(np.hypot(*velocity)) for _, _, velocity, _ in arrows)
    for ball, place, velocity, before in arrows:
        step = np.array(velocity) * (length / fastest) if fastest > 0.0 else np.zeros(2)
        end = np.array(place) if before else np.array(place) + step
        axes.annotate(
            "", xy=tuple(end), xytext=tuple(end - step), zorder=6.0,
            arrowprops={
                "arrowstyle": "->" if before else "-|>", "color": _COLORS[ball % len(_COLORS)],
                "linewidth": 0.7, "shrinkA": 0.0, "shrinkB": 0.0, "mutation_scale": 6.0,
            },
        )  # fmt: skip


Arrow = tuple[int, tuple[float, float], tuple[float, float], bool]


def _arrows(run: TableRun) -> list[Arrow]:
    """Ball, place and velocity at the start and at each impact, and whether it is that before."""
    found: list[Arrow] = []
    for ball, state in enumerate(run.system.initial):
        if state.velocity != (0.0, 0.0):
            found.append((ball, state.place, state.velocity, False))
    if len(run.collisions["n"]) + len(run.bounces["n"]) > MOST_ARROWS:
        return found
    for row in range(len(run.collisions["n"])):
        for letter in "ab":
            found += _at(run.collisions, row, "ball_" + letter, "_" + letter)
    for row in range(len(run.bounces["n"])):
        found += _at(run.bounces, row, "ball", "")
    return found


def _at(table: dict[str, NDArray[np.float64]], row: int, ball: str, end: str) -> list[Arrow]:
    place = float(table[f"x{end}"][row]), float(table[f"y{end}"][row])
    arrows: list[Arrow] = []
    for when in ("pre", "post"):
        names = [f"velocity_{axis}{end}_{when}" for axis in "xy"]
        velocity = float(table[names[0]][row]), float(table[names[1]][row])
        if velocity != (0.0, 0.0):
            arrows.append((int(table[ball][row]) - 1, place, velocity, when == "pre"))
    return arrows


def _title(run: TableRun, paths: list[Floats]) -> str:
    count = len(run.collisions["n"])
    words = f"{count} {'impact' if count == 1 else 'impacts'}, {len(run.bounces['n'])} on the wall"
    if any(len(path) > MOST_LINES for path in paths):
        return f"{words}; the first {MOST_LINES} flights of a ball"
    return words
