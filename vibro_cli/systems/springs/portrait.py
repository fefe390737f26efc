"""Phase portrait of a body on a spring, with its energies below (C fig. 5).

The portrait shows level curves, separatrix, singular points, the branches of the run between events
and the jumps at impacts. Below it are the energy of the spring over the same displacement, and the
body's total energy, which is constant between impacts and jumps with the speed.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from vibro_cli.analysis.levels import LevelCurve
from vibro_cli.analysis.singular import SADDLE, SingularPoint
from vibro_cli.figures import style
from vibro_cli.figures.labels import draw_legend, rows_of
from vibro_cli.figures.portraits import layers
from vibro_cli.figures.portraits.energies import (
    POTENTIAL,
    close_up,
    draw_energies,
    energy_limits,
    limit_energies,
    panels_over,
    saddle_shown,
)
from vibro_cli.figures.portraits.family import Member, draw_family, name_points, shown_of
from vibro_cli.figures.portraits.layers import (
    EIGHT,
    Background,
    behind_entries,
    coloured_until,
    level_energies,
    saddle_energies,
)
from vibro_cli.figures.portraits.panels import Panel, Symbols, Window, straight
from vibro_cli.figures.portraits.portrait import (
    FAR,
    draw_motion,
    framed_rate,
    greatest_rate,
    legend_rows,
    seen,
    stays_at_rest,
)
from vibro_cli.figures.portraits.trajectory import (
    MOST_BRANCHES,
    Branches,
    Own,
    Trajectory,
    jumps_of,
    points_each,
)
from vibro_cli.figures.source import Array, Flags, Integers, kept
from vibro_cli.figures.style import width_of
from vibro_cli.figures.ticks import limits_apart
from vibro_cli.progress import WORK
from vibro_cli.systems.columns import made
from vibro_cli.systems.run import Run
from vibro_cli.systems.springs.phase_plane import (
    TYPES,
    Level,
    SpringsLandscape,
    point_names,
    spring_periods,
    springs_record,
)
from vibro_cli.systems.springs.system import SpringsSystem, singular_points


@dataclass(frozen=True)
class Motions:
    """Motions of a body between the events in which it takes part; arrays of shape (motions,)."""

    first: Integers
    """Leftmost body (from 0) of the group that moves as one with it."""
    last: Integers
    """Rightmost body of the group."""
    start: Array
    """Time (s)."""
    end: Array
    states: tuple[Array, Array, Array, Array]
    """Displacement (m) and speed (m/s) at the start and at the end."""

    @cached_property
    def contact(self) -> Flags:
        """Whether the body is in lasting contact."""
        return self.last > self.first

    def some(self, rows: Any) -> Motions:
        """Return some of the motions, selected by a slice, indices or a boolean array."""
        x, v, x_end, v_end = (column[rows] for column in self.states)
        start, end = self.start[rows], self.end[rows]
        return Motions(self.first[rows], self.last[rows], start, end, (x, v, x_end, v_end))


@kept
def motions(run: Run) -> list[Motions]:
    """Return the motions of each body between events, in order of time."""
    motion: Any = run.trajectory
    # The last event of each instant, as indices: whole rows of all bodies would need much memory.
    final = np.flatnonzero(np.append(np.diff(motion.times) > 0.0, True))
    times, held = motion.times[final], motion.states["held"][final]
    return [_motions_of(run, body, final, times, held) for body in range(held.shape[1])]


def _motions_of(run: Run, body: int, final: Integers, times: Array, held: Any) -> Motions:
    first, last = _groups(held, body)
    arriving = _arriving(run, times, first, last)
    changed = np.append(True, (np.diff(first) != 0) | (np.diff(last) != 0))
    begins = np.flatnonzero(changed | np.isfinite(arriving))
    states: Any = run.trajectory.states  # type: ignore[attr-defined]
    x, v = states["x"][final, body], states["v"][final, body]
    ends = np.append(begins[1:], -1)
    speed = np.where(np.isfinite(arriving[ends]), arriving[ends], v[ends])
    reached, ending = x[ends], run.sample([run.end_time])
    reached[-1], speed[-1] = ending["displacement"][body], ending["speed"][body]
    until = np.append(times[begins[1:]], run.end_time)
    states = x[begins], v[begins], reached, speed
    found = Motions(first[begins], last[begins], times[begins], until, states)
    lasts = found.end > found.start
    lasts[0] = True
    return found.some(lasts)


def _groups(held: Any, body: int) -> tuple[Integers, Integers]:
    """Return the outermost bodies of the group that moves as one with a body, after each event."""
    left = np.logical_and.accumulate(held[:, :body][:, ::-1] == 1, axis=1)
    right = np.logical_and.accumulate(held[:, body:-1] == 1, axis=1)
    return body - left.sum(axis=1), body + right.sum(axis=1)


def _arriving(run: Run, times: Array, first: Integers, last: Integers) -> Array:
    """Return the speed of a body before each instant at which it or its group has an impact.

    NaN at other instants. Of several impacts at one instant the first gives the speed. Impacts that
    were not carried out do not count.
    """
    table = run.collisions
    speeds = np.full(len(first), math.nan)
    event: Any = np.searchsorted(times, table["t"], side="left")
    before = np.maximum(event - 1, 0)
    struck = {side: np.asarray(table[f"ball_{side}"], dtype=np.int64) - 1 for side in "ab"}
    own = [(body >= first[before]) & (body <= last[before]) for body in struck.values()]
    speed = np.where(own[0], table["speed_a_pre"], table["speed_b_pre"])
    mine = np.flatnonzero((own[0] | own[1]) & made(table))[::-1]
    speeds[event[mine]] = speed[mine]
    return speeds


def springs_trajectory(run: Run, ball: int) -> Trajectory:
    """Return the phase trajectory of a body (from 1): displacement (m) and speed (m/s).

    Every branch is a curve of constant energy: of the body alone or, in lasting contact, of its
    group.
    """
    body = ball - 1
    all_of = motions(run)[body]
    every = max(1, math.ceil(len(all_of.start) / MOST_BRANCHES))
    shown = all_of.some(slice(None, None, every))
    count = points_each(len(shown.start))
    place, speed = (np.empty((len(shown.start), count)) for _ in range(2))
    for group in set(zip(shown.first.tolist(), shown.last.tolist(), strict=True)):
        rows = np.flatnonzero((shown.first == group[0]) & (shown.last == group[1]))
        hills = SpringsLandscape.of(run.system, *group)
        shift = hills.offsets[body - group[0]]
        x, v, x_end, v_end = (column[rows] for column in shown.states)
        lasts = shown.end[rows] - shown.start[rows]
        q, v = hills.branches((x - shift, v), (x_end - shift, v_end), lasts, count)
        place[rows], speed[rows] = q + shift, v
    branches = Branches(place, speed, shown.start, shown.contact)
    first = run.system.initial[body]
    at = first.position - run.system.springs[body].foot
    jumps = jumps_of(run.collisions, ball, every, _states)
    return Trajectory((branches,), *jumps, (0, at, first.speed), run.end_time, every)


_MARGIN = 1.08
_SMALL = 0.1
"""Share of the extent of the singular points below which a motion is too small to be read."""
_ROUNDING = 1e-12
"""Share of its displacement within which a body at rest appears to move."""
_ABOVE = 1.35
"""Greatest energy of level curves without a run, as a multiple of the saddle's energy."""
_COUNT = 129
"""Points of a level curve between turning points and crests."""


def springs_portrait(run: Run, ball: int, width: str = "single") -> Figure:
    """Draw speed and energies against displacement for a body (from 1) of a run."""
    path = springs_trajectory(run, ball)
    (branches,) = path.branches
    hills = SpringsLandscape.of(run.system, ball - 1, ball - 1)
    energies = hills.mass * hills.energy(branches.position, branches.rate)
    if stays_at_rest(path) or _is_rounding(branches.position):
        # No range to show: draw the portrait as without a run.
        behind = _at_rest(run.system, ball - 1)
        window = _whole(behind, path.start[1], rate=greatest_rate(path, [0]))
        spring = run.system.springs[ball - 1]
        ends = (spring.energy(end) for end in (window.low, window.high))
        limits = 1.15 * max(float(np.max(energies)), *ends), 0.0
    else:
        behind = springs_background(run.system, ball - 1, float(np.max(energies)))
        window = _around(path, behind)
        behind = seen(behind, [window])
        below = hills.mass * hills.potential(branches.position)
        limits = energy_limits(energies, below, saddle_shown(behind, below, hills.mass, window))
    with style.journal():
        rows, bar = legend_rows(path, behind, width, [("spring's energy", POTENTIAL)])
        figure, upper, lower = panels_over(width, window, rows, _symbols(ball))
        draw_motion([upper], path, behind)
        _draw_spring_energy(lower, run.system, ball - 1, window)
        draw_energies(lower, path, energies, coloured_until(path))
        limit_energies(lower, *limits)
        draw_legend(figure, rows, bar)
    return figure


def springs_structure(system: SpringsSystem, ball: int, width: str = "single") -> Figure:
    """Draw the portrait of a body (from 1) without a run: levels, separatrix, singular points.

    Below it is the energy of the spring, with the energies of the singular points.
    """
    spring = system.springs[ball - 1]
    behind = _at_rest(system, ball - 1)
    window = _whole(behind)
    entries = [("spring's energy", POTENTIAL), *behind_entries(behind)]
    with style.journal():
        rows = rows_of(entries, width_of(width))
        figure, upper, lower = panels_over(width, window, rows, _symbols(ball))
        layers.draw_background(upper, behind)
        _draw_spring_energy(lower, system, ball - 1, window)
        name_points(upper, point_names(system, ball - 1), behind)
        for point in behind.points:
            if point.kind == SADDLE:
                lower.axes.axhline(point.energy, zorder=1.2, **(EIGHT | {"linewidth": 0.6}))
            look = layers.POINT | {"marker": layers.MARKER[point.kind]}
            lower.axes.plot(point.position, point.energy, **look)
        limit_energies(lower, max(spring.energy(window.low), spring.energy(window.high)))
        draw_legend(figure, rows)
    return figure


def family_type(system: SpringsSystem, ball: int) -> str:
    """Return the type of the portrait of a body (from 1)."""
    return str(springs_record(system, ball - 1)["type"])


def family_figure(members: Sequence[tuple[str, SpringsSystem]], ball: int, width: str) -> Figure:
    """Draw the portraits of a body (from 1) of a family, each under its title and type.

    All have the same axes, which shows how the saddle splits the centre (C, part 3: l ≶ b).
    `members` are titles and systems; of many members an even selection is drawn.
    """
    shown = shown_of(members)
    behind = [_at_rest(system, ball - 1) for _, system in shown]
    windows = [_whole(one) for one in behind]
    low, high = min(one.low for one in windows), max(one.high for one in windows)
    window = straight(low, high, max(one.top for one in windows))
    drawn = []
    for (title, system), one in zip(shown, behind, strict=True):
        names = point_names(system, ball - 1)
        drawn.append(Member(title, TYPES[len(names)], one, names, window))
    figure, _ = draw_family(drawn, width, _symbols(ball))
    return figure


def _is_rounding(position: Array) -> bool:
    """Return whether displacements (m) of a body differ by rounding only."""
    return bool(np.ptp(position) <= _ROUNDING * np.max(np.abs(position)))


def _at_rest(system: SpringsSystem, body: int) -> Background:
    """Return the background of the portrait of a body (from 0) without a run."""
    spring = system.springs[body]
    saddles = [spring.energy(at) for at, kind in singular_points(spring) if kind == "saddle"]
    highest = _ABOVE * max([*saddles, spring.energy(1.7 * spring.height)])
    return springs_background(system, body, highest)


def _states(own: Own) -> tuple[Array, Array, Array, Array]:
    """Return piece (always 0), displacement, and speeds before and after impacts of a body."""
    place = own("displacement")
    return np.zeros(len(place)), place, own("speed", "_pre"), own("speed", "_post")


def springs_background(system: SpringsSystem, body: int, highest: float) -> Background:
    """Return the background of a body's portrait (from 0) with energies up to `highest` (J)."""
    hills = SpringsLandscape.of(system, body, body)
    points = tuple(
        SingularPoint(kind, 0, at, 0.0, at, 0.0, system.springs[body].energy(at))
        for at, kind in singular_points(system.springs[body])
    )
    # Given by its state, the level of the saddle is one curve, however its energy is rounded.
    through = [Level(crest, np.zeros(())) for crest in hills.crests]
    energies = level_energies(points, max(highest, *saddle_energies(points), 0.0))
    levels = [hills.level_of(energy / hills.mass) for energy in energies]
    return Background(levels=_curves(hills, levels), points=points, eights=_curves(hills, through))


def _curves(hills: SpringsLandscape, levels: Sequence[Level]) -> tuple[LevelCurve, ...]:
    return tuple(
        LevelCurve(0, place, speed)
        for level in levels
        for place, speed in hills.upper_half(level, _COUNT)
    )


def _around(path: Trajectory, behind: Background) -> Window:
    """Return a window that holds the motion, the singular points and any nearby separatrix.

    A motion on a small part of it is shown close up.
    """
    (branches,), reached = path.branches, greatest_rate(path, [0])
    points = [point.position for point in behind.points]
    low = min(float(np.min(branches.position)), *points)
    high = max(float(np.max(branches.position)), *points)
    if np.ptp(branches.position) < _SMALL * (high - low):
        return straight(*limits_apart(*close_up(branches.position)), _MARGIN * reached)
    for curve in behind.eights:
        if np.ptp(curve.position) <= FAR * (high - low):
            low = min(low, float(curve.position[0]))
            high = max(high, float(curve.position[-1]))
        reached = framed_rate(reached, float(np.max(curve.rate)), 0.0)
    return _window(low, high, reached)


def _whole(behind: Background, *places: float, rate: float = 0.0) -> Window:
    """Return a window that holds all level curves, the given displacements and a speed."""
    curves = (*behind.levels, *behind.eights)
    low = min([*places, *(float(curve.position[0]) for curve in curves)])
    high = max([*places, *(float(curve.position[-1]) for curve in curves)])
    return _window(low, high, max([rate, *(float(np.max(curve.rate)) for curve in curves)]))


def _window(low: float, high: float, top: float) -> Window:
    room = 0.04 * (high - low) or 1.0
    return straight(low - room, high + room, _MARGIN * (top or 1.0))


def _symbols(ball: int) -> Symbols:
    after = ", from the foot of its spring"
    return Symbols(rf"$x_{{{ball}}}$", rf"$\dot{{x}}_{{{ball}}}$", after)


def _draw_spring_energy(lower: Panel, system: SpringsSystem, body: int, window: Window) -> None:
    spring = system.springs[body]
    x = np.linspace(window.low, window.high, 600)
    lower.axes.plot(x, [spring.energy(place) for place in x.tolist()], zorder=1.5, **POTENTIAL)


def swings(system: SpringsSystem) -> Iterator[dict[str, float | None]]:
    """Yield ω₀ (1/s) of each body and its periods (s); an infinite period is None."""
    for ball in range(1, len(system.bodies) + 1):
        small, own = (
            period if math.isfinite(period) else None for period in spring_periods(system, ball)
        )
        yield {"omega_0": system.frequencies[ball - 1], "small_period": small, "period": own}


def swing_line(swing: dict[str, float | None]) -> str:
    """Return the constants of a swing on a spring, C (4), as text."""
    small, own = (
        "none" if swing[key] is None else f"{swing[key]:.9g} s"
        for key in ("small_period", "period")
    )
    return (
        f"          ω₀ = {swing['omega_0']:.9g} 1/s; period of small oscillations {small}, "
        f"of this motion {own}"
    )


def portrait(
    system: SpringsSystem, width: str, drawn: Collection[int]
) -> tuple[dict[str, Any], dict[str, Figure]]:
    """Return the singular points of all bodies, and figures of the bodies `drawn` (from 1)."""
    bodies = [springs_record(system, body) for body in range(len(system.bodies))]
    figures = {}
    for ball in drawn:
        name = f"portrait_{ball}"
        WORK.report(name)
        figures[name] = springs_structure(system, ball, width)
    return {"system": "springs", "bodies": bodies}, figures


def point_lines(body: dict[str, Any]) -> Iterator[str]:
    """Return the singular points of a body as lines of text."""
    yield "  point  kind       from foot [m]         x [m]         E [J]  spring"
    for point in body["points"]:
        state = "stressed" if point["stressed"] else "unstressed"
        yield (
            f"  {point['name']:5}  {point['kind']:6}  {point['displacement']:16.10g}  "
            f"{point['x']:12.7g}  {point['energy']:12.6g}  {state}"
        )
    yield f"  ω₀ = {body['frequency']:.9g} 1/s"
    if body["separatrix_speed"] is not None:
        yield f"  on the separatrix at most {body['separatrix_speed']:.9g} m/s, over the centres"
