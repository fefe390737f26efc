"""The plan of a run on the table: wall, paths of the balls, velocities at impacts (C fig. 1, 4)."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PatchCollection
from matplotlib.colors import to_rgba_array
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Ellipse, Polygon
from numpy.typing import NDArray

from vibro_cli.errors import counted
from vibro_cli.figures import style
from vibro_cli.figures.chart import LEFT, Sheet, body_look, first_part, plane_axes
from vibro_cli.figures.labels import LINE, Entry, Named, draw_legend, ring, write_names
from vibro_cli.figures.portraits import layers
from vibro_cli.figures.runs.velocities import draw_scale
from vibro_cli.figures.style import line, mark, width_of
from vibro_cli.numerics.elementwise import Floats
from vibro_cli.systems.columns import made
from vibro_cli.systems.run import Run
from vibro_cli.systems.table.system import POLYGON, Wall

MOST_ARROWS = 40
"""Greatest number of impacts for which velocities before and after are drawn."""
MOST_LINES = 600
"""Total number of flights after which paths end, as more would merge into a blot."""
_FLIGHTS = 2
"""Flights per ball, on average, that are drawn in any case."""
MOST_NUMBERS = 100
"""Greatest number of balls that are drawn with their numbers."""
_MANY = 150
"""Number of flights of a ball above which the lines of all balls are thin and faint."""
_ARROW, _BETWEEN = 0.09, 1.5
"""Length of the longest velocity arrow, as a fraction of the figure's width; for very many arrows,
as a multiple of their spacing if they were arranged in a square."""
_HEAD = {"before": "white", "after": style.BLACK, "at the start": style.BLACK}
"""Colours of the heads of velocity arrows, by the time of the velocity."""
_SIDE = {"before": "pre", "after": "post"}
_RIGHT, _TOP, _BOTTOM = 2.5, 5.0, 8.5
"""Margins to the right of, above and below the panel (mm)."""
_KEEN = 6
"""Weight of the edge of a ball among the obstacles that its number should not cover."""
_SHAPES = (0.25, 1.35)
"""Least and greatest ratio of height to width of the panel: journals allow 234 mm."""


def table_plan(run: Run, width: str = "single") -> Figure:
    """Draw the plan of a run: the wall, the path of each ball, velocity arrows at its events.

    The balls are drawn at the start (filled) and at their impacts (outlined).
    """
    until = _shown_until(run)
    paths = [_path(run, ball, until) for ball in range(len(run.system.bodies))]
    low, high = _extent(run, paths)
    low, high = _fitted(low, high)
    wide = width_of(width)
    inner = wide - LEFT - _RIGHT
    tall = inner * float((high[1] - low[1]) / (high[0] - low[0]))
    arrows = _arrows(run)
    entries = _legend(arrows)
    with style.journal():
        sheet = Sheet(wide, _BOTTOM + tall + _TOP + (LINE if entries else 0.0))
        axes = sheet.panel(LEFT, _BOTTOM, inner, tall)
        plane_axes(axes, low, high, after=first_part(until, run.end_time))
        if run.system.wall is not None:
            draw_wall(axes, run.system.wall)
        many = max(map(len, paths)) > _MANY
        for ball, path in enumerate(paths):
            _draw_path(axes, ball, path, many)
        _draw_starts(axes, run, [path[0] for path in paths])
        _draw_impacts(axes, run, until)
        covered = _draw_velocities(axes, arrows, float(high[0] - low[0]))
        if len(paths) <= MOST_NUMBERS:
            _draw_numbers(axes, run, paths, covered)
        axes.set_title(_title(run, until), pad=2.0, color=style.FRAME_GREY)
        if entries:
            draw_legend(sheet.figure, [entries], scale=True)
    return sheet.figure


def _fitted(low: Floats, high: Floats) -> tuple[Floats, Floats]:
    """Return the corners of a panel around the drawing, neither too flat nor too tall."""
    extent = high - low
    shape = np.clip(extent[1] / extent[0], *_SHAPES)
    wanted = np.maximum(extent, [extent[1] / shape, extent[0] * shape])
    middle = 0.5 * (low + high)
    return middle - 0.5 * wanted, middle + 0.5 * wanted


def _shown_until(run: Run) -> float:
    """Return the time (s) up to which paths are drawn: the end, or earlier for many flights."""
    motion: Any = run.trajectory
    most = max(MOST_LINES, _FLIGHTS * len(motion.balls))
    starts = np.sort(np.concatenate([events["t"][: most + 1] for events in motion.balls]))
    return float(starts[most]) if len(starts) > most else run.end_time


def _path(run: Run, ball: int, until: float) -> Floats:
    """Return the positions (n, 2) of a ball at the start, at its events and at `until` (s)."""
    motion: Any = run.trajectory
    events, last = motion.balls[ball], motion.at(ball, np.array([until]))
    shown = events["t"] <= until
    x = np.append(events["x"][shown], last["x"])
    return np.column_stack([x, np.append(events["y"][shown], last["y"])])


def _extent(run: Run, paths: list[Floats]) -> tuple[Floats, Floats]:
    """Return the corners of the drawing."""
    radii = [body.radius for body in run.system.bodies]
    low = np.min([path.min(axis=0) - r for path, r in zip(paths, radii, strict=True)], axis=0)
    high = np.max([path.max(axis=0) + r for path, r in zip(paths, radii, strict=True)], axis=0)
    low, high = with_wall(run.system.wall, low, high)
    margin = 0.05 * float(np.max(high - low)) or 1.0
    return low - margin, high + margin


def with_wall(wall: Wall | None, low: Floats, high: Floats) -> tuple[Floats, Floats]:
    """Return the lower left and upper right corners (m) of a box, enlarged to hold the wall."""
    if wall is None:
        return low, high
    points, axes = np.array(wall.points), np.array(wall.semi_axes)
    return np.minimum(low, points.min(axis=0) - axes), np.maximum(high, points.max(axis=0) + axes)


def draw_wall(axes: Axes, wall: Wall) -> None:
    """Draw the wall of a table."""
    look: dict[str, Any] = {"edgecolor": style.FRAME_GREY, "linewidth": 1.4, "zorder": 1.0}
    filled = "none" if wall.inside else style.LEVEL_GREY
    if wall.shape == POLYGON:
        axes.add_patch(Polygon(list(wall.corners), facecolor=filled, **look))
    else:
        a, b = wall.semi_axes
        axes.add_patch(Ellipse(wall.centre, 2.0 * a, 2.0 * b, facecolor=filled, **look))


def _draw_path(axes: Axes, ball: int, path: Floats, many: bool) -> None:
    color, dashes = _colour(ball), body_look(ball + 1)["linestyle"]
    look: dict[str, Any] = {"colors": color, "zorder": 2.0, "rasterized": len(path) > 2000}
    if many:  # translucent lines show the density of flights
        each = list(np.stack([path[:-1], path[1:]], axis=1))
        lines = LineCollection(each, linewidths=0.3, alpha=layers.fainter(len(path)), **look)
    else:
        lines = LineCollection([path], linewidths=0.8, linestyles=[dashes], **look)
    axes.add_collection(lines, autolim=False)


def _draw_starts(axes: Axes, run: Run, places: list[Floats]) -> None:
    """Draw the balls at the start, with their centres, in two artists for any number of balls."""
    colours = [_colour(ball) for ball in range(len(places))]
    balls = zip(places, run.system.bodies, strict=True)
    discs = [Circle((float(x), float(y)), body.radius) for (x, y), body in balls]
    faint = to_rgba_array(colours, 0.25)
    axes.add_collection(PatchCollection(discs, color=faint, zorder=1.0), autolim=False)
    x, y = np.transpose(places)
    axes.scatter(x, y, s=9.0, c=colours, marker=".", linewidths=1.0, zorder=4.0)


def _colour(ball: int) -> str:
    """Return the colour of a ball (from 0), the same as in charts of energy."""
    return str(body_look(ball + 1)["color"])


def _draw_numbers(axes: Axes, run: Run, paths: list[Floats], covered: Floats) -> None:
    """Write each ball's number beside its start, where it overlaps least with other parts."""
    passed = [_points_along(path) for path in paths]
    discs = np.concatenate([share * ring(24) for share in (0.25, 0.5, 0.75, *[1.0] * _KEEN)])
    circles = [
        path[0] + body.radius * discs for path, body in zip(paths, run.system.bodies, strict=True)
    ]
    names = [Named(str(ball + 1), path[0], _colour(ball)) for ball, path in enumerate(paths)]
    write_names(axes, names, np.concatenate([*passed, *circles, covered]))


def _points_along(path: Floats) -> Floats:
    """Return points along the first flights of a path, dense enough for labels to avoid them."""
    first = path[:MOST_ARROWS]
    share = np.linspace(0.0, 1.0, 60)[:, None]
    pieces = [a + share * (b - a) for a, b in pairwise(first)]
    return np.concatenate(pieces) if pieces else first


def _draw_impacts(axes: Axes, run: Run, until: float) -> None:
    """Draw the balls where they touch one another or the wall, up to a time (s)."""
    sides = ((run.collisions, "_a"), (run.collisions, "_b"), (run.bounces, ""))
    for table, end in sides:
        for row in range(min(_within(table, until), MOST_ARROWS)):
            ball = int(table[f"ball{end}"][row]) - 1
            place = (float(table[f"x{end}"][row]), float(table[f"y{end}"][row]))
            color, radius = _colour(ball), run.system.bodies[ball].radius
            axes.add_patch(Circle(place, radius, fill=False, edgecolor=color, linewidth=0.6))


def _draw_velocities(axes: Axes, arrows: list[Arrow], extent: float) -> Floats:
    """Draw arrows of velocity at the start and before (open) and after (full) each impact.

    They are black to stand out from the paths; `extent` (m) is the panel's width. Returns points
    along them, shape (n, 2).
    """
    covered = [np.zeros((0, 2))]
    if not arrows:
        return covered[0]
    share = min(_ARROW, _BETWEEN / math.sqrt(len(arrows)))
    scale = share * extent / max(float(np.hypot(*velocity)) for _, velocity, _ in arrows)
    for place, velocity, when in arrows:
        step = scale * np.array(velocity)
        end = np.array(place) if when == "before" else np.array(place) + step
        covered.append(np.linspace(end - step, end, 20))
        axes.annotate(
            "", xy=tuple(end), xytext=tuple(end - step), zorder=6.0, annotation_clip=False,
            arrowprops={
                "arrowstyle": "-|>", "edgecolor": style.BLACK, "facecolor": _HEAD[when],
                "linewidth": 0.5, "shrinkA": 0.0, "shrinkB": 0.0,
                "mutation_scale": 5.0 * share / _ARROW,
            },
        )  # fmt: skip
    draw_scale(axes, scale, 1)
    return np.concatenate(covered)


def _legend(arrows: list[Arrow]) -> list[Entry]:
    """Return the legend of the velocity arrows; "after" includes the equal ones at the start."""
    seen = {when for _, _, when in arrows}
    if "after" in seen:
        seen.discard("at the start")
    look = mark(">", 3.0, style.BLACK) | line(style.BLACK, 0.5) | {"markeredgewidth": 0.5}
    return [
        (f"velocity {when}", look | {"markerfacecolor": head})
        for when, head in _HEAD.items()
        if when in seen
    ]


Arrow = tuple[tuple[float, float], tuple[float, float], str]


def _arrows(run: Run) -> list[Arrow]:
    """Return positions and velocities of balls at the start and at impacts, and when they apply."""
    found: list[Arrow] = []
    for state in run.system.initial:
        if state.velocity != (0.0, 0.0):
            found.append((state.place, state.velocity, "at the start"))
    if len(run.collisions["n"]) + len(run.bounces["n"]) > MOST_ARROWS:
        return found
    for row, happened in enumerate(made(run.collisions)):
        for letter in "ab":
            found += _at(run.collisions, row, "_" + letter, happened)
    for row in range(len(run.bounces["n"])):
        found += _at(run.bounces, row, "")
    return found


def _at(
    table: dict[str, NDArray[np.float64]], row: int, end: str, happened: bool = True
) -> list[Arrow]:
    place = float(table[f"x{end}"][row]), float(table[f"y{end}"][row])
    arrows: list[Arrow] = []
    for when in ("before", "after") if happened else ("before",):
        names = [f"velocity_{axis}{end}_{_SIDE[when]}" for axis in "xy"]
        velocity = float(table[names[0]][row]), float(table[names[1]][row])
        if velocity != (0.0, 0.0):
            arrows.append((place, velocity, when))
    return arrows


def _title(run: Run, until: float) -> str:
    count, bounces = len(run.collisions["n"]), len(run.bounces["n"])
    words = counted(count, "impact")
    if run.system.wall is not None:
        words += f", {bounces:,} on the wall"
    if not count and bounces:
        words = f"{counted(bounces, 'impact')} on the wall"
    if any(_within(table, until) > MOST_ARROWS for table in (run.collisions, run.bounces)):
        words += f"; circles: the first {MOST_ARROWS}"
    return words


def _within(table: Any, until: float) -> int:
    """Return the number of rows of a table of impacts up to a time (s)."""
    return int(np.searchsorted(table["t"], until, side="right"))
