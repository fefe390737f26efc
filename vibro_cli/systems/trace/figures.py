"""The kinds of figure of a run on a trace, and the frames of its film."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from vibro_cli.figures import style
from vibro_cli.figures.chart import MANY
from vibro_cli.figures.film import LARGER, Frames, Ground, Panel, States, trails_of
from vibro_cli.figures.kinds import (
    ENERGY_CAPTION,
    EXPONENTS,
    INTERVALS,
    MET,
    MET_TWICE,
    PORTRAIT,
    Kind,
)
from vibro_cli.figures.portraits.energies import energy_portrait
from vibro_cli.figures.portraits.portrait import phase_portrait
from vibro_cli.figures.runs.contact_points import POINTS_CAPTION, POINTS_TITLE, contact_points
from vibro_cli.figures.runs.over_impacts import accuracy, impact_map
from vibro_cli.figures.runs.over_time import energies, space_time
from vibro_cli.figures.runs.scene import draw_axis, draw_ends, plan, scene, trace_points
from vibro_cli.figures.runs.velocities import velocities
from vibro_cli.figures.source import Array, Recorded
from vibro_cli.mechanics.system import Body, TraceSystem
from vibro_cli.mechanics.trace import Trace

_FILM_WALL = 0.06
"""Height of a wall at an end of the trace, as a fraction of half the width."""
_SMALL = 0.2
"""A motion within this share of the trace is shown close up, ..."""
_BESIDE = 0.1
"""... with this share of its extent on both sides."""


def film(run: Any, times: Array) -> Frames:
    """Return the states of all bodies at the times of frames (s).

    Each state is exact, from the closed form of its flight. On a closed trace the rotation of the
    bodies is right only if they travel less than half of it between frames.
    """
    bodies, times = run.system.bodies, np.asarray(times)
    motion = run.sample(times)

    def table(name: str) -> Array:
        return np.asarray(motion[name], dtype=np.float64).reshape(len(times), len(bodies))

    arc = np.asarray(motion["arc"]).reshape(len(times), len(bodies)) - 1
    seam = 0.5 * run.system.trace.length if run.system.trace.closed else math.inf
    periods = _small_periods(run.system)
    s, speed, trails, span = trails_of(run, times, "s", periods, _at_walls, seam)
    turn = np.column_stack(
        [_turned(run.system.trace, body, arc[:, n], s[:, n]) for n, body in enumerate(bodies)]
    )
    x, y = table("x"), table("y")
    return Frames(_ground(run, x, y), times, x, y, turn, s, speed, trails, span)


def _ground(run: Recorded, x: Array, y: Array) -> Ground:
    """Return the trace with its walls, or the small part that the bodies visit, and the plane."""
    surface = trace_points(run.system.trace)
    radii = tuple(body.radius for body in run.system.bodies)
    room = 1.1 * max(radii) + 0.01 * float(np.max(np.ptp(surface, axis=0)))
    turning = run.system.turning
    reach = surface if turning is None else [*surface, (turning.x, surface[0, 1])]
    low, high = np.min(reach, axis=0) - room, np.max(reach, axis=0) + room
    visited = np.column_stack([x.ravel(), y.ravel()])
    extent = float(np.max(np.ptp(visited, axis=0)))
    beside = _BESIDE * extent + 2.2 * max(radii)
    if extent > 0.0 and extent + 2.0 * beside < _SMALL * float(np.max(high - low)):
        low, high = visited.min(axis=0) - beside, visited.max(axis=0) + beside

    def draw(axes: Axes, half: float) -> None:
        axes.plot(surface[:, 0], surface[:, 1], color=style.BLACK, linewidth=1.0)
        draw_ends(axes, run.system, _FILM_WALL * half)
        if turning is not None and low[0] < turning.x < high[0]:
            draw_axis(axes, turning, LARGER)

    junctions = tuple(piece.start_s for piece in run.system.trace.pieces[1:])
    panel = Panel("s", "speed against arc length", junctions)
    return Ground(radii, low, high, draw, "the trace", panel)


def _small_periods(system: TraceSystem) -> list[float]:
    """Return the periods (s) of small oscillations on the arcs, shorter if the trace rotates.

    Without an arc, return the period of a pendulum as long as the trace.
    """
    turning = 0.0 if system.turning is None else system.turning.square
    rates = [
        system.fastest_rate(body, piece)
        for piece in system.trace.pieces
        for body in system.bodies
        if not piece.is_line
    ] or [math.sqrt(turning + system.gravity / system.trace.length)]
    return [2.0 * math.pi / rate for rate in rates]


def _turned(trace: Trace, body: Body, arc: Any, s: Array) -> Array:
    """Return the rotation of a body (rad): the path length of its centre over its radius."""
    if body.slides:
        return np.zeros(len(s))
    scales = np.array(
        [1.0 if p.is_line else p.path_radius(body.radius) / p.radius for p in trace.pieces]
    )
    lengths = scales * [piece.length for piece in trace.pieces]
    before = np.concatenate([[0.0], np.cumsum(lengths)])
    starts = np.array([piece.start_s for piece in trace.pieces])
    way = before[arc] + scales[arc] * (s - starts[arc])
    if trace.closed:
        way = np.unwrap(way, period=before[-1])
    turned: Array = (way - way[0]) / body.radius
    return turned


def _at_walls(run: Recorded, body: int) -> Iterator[States]:
    """Yield the states of a body before and after its impacts on walls."""
    flights, pieces = run.flights(), run.system.trace.pieces
    scales = np.array([piece.path_scale(run.system.bodies[body].radius) for piece in pieces])
    mine = flights["ball"] == body + 1
    for order, end in enumerate(("end", "start")):
        rows = np.flatnonzero(mine & (flights[f"cause_{end}"] == "wall"))
        arc = flights["arc"][rows] - 1
        places = flights[f"angle_{end}"][rows]
        along = [pieces[n].arc_length(place) for n, place in zip(arc, places, strict=True)]
        speed = scales[arc] * flights[f"rate_{end}"][rows]
        yield np.asarray(flights[f"t_{end}"])[rows], np.array(along, dtype=np.float64), speed, order


_PORTRAIT_CAPTION = (
    "Rate against angle on each arc (speed against distance on lines): the branches that the body "
    "follows and its jumps at the impacts; lasting contact has its own colour, and branches are "
    "coloured by time up to the last impact if there are many. Behind them are separatrices, level "
    "curves of energy, centres (+), saddles (×), and the walls that the body meets. If not all "
    "arcs fit a page, those around the start are shown. As A figs 1b and 2, B fig. 8, D fig. 1."
)
FIGURES = {
    "scene": Kind(
        scene,
        "The trace and the bodies at the start",
        "To scale: the pieces of the trace, separated by dots, with their numbers below, the "
        "centres O and radii R of the arcs, and the bodies with their centres C, contact points P "
        "and angles φ (in a valley) or ψ (on a hump); arrows show initial speeds. "
        "As A fig. 2a, B fig. 6, D fig. 1a, b.",
    ),
    PORTRAIT: Kind(phase_portrait, "Phase portrait of body", _PORTRAIT_CAPTION, of_bodies=True),
    "energy_portrait": Kind(
        energy_portrait,
        "Phase portrait and energies along the trace of body",
        "Above, the speed of the centre against arc length: the branches that the body follows and "
        "its jumps, figure eights as single closed curves, separatrices, level curves, centres "
        "(+), saddles (×), and the walls that it meets. Below, the potential energy and, for each "
        "branch, the total energy of the body. As A (abstract), B III.3.6, D.",
        of_bodies=True,
    ),
    "plan": Kind(
        plan,
        "Configurations at the impacts",
        "The trace with the bodies at the start, at the first impacts and at the last one; bodies "
        "that are not involved in the impact are pale. As B fig. 9.",
        needs=MET,
    ),
    "velocities": Kind(
        velocities,
        "Plan of velocities",
        "The bodies of the first impacts as they touch, before and after: the velocities of the "
        "centres C; the velocities at T, where the bodies touch, and the part of them that is due "
        "to rolling; and the components of the centres' velocities along the line of centres, "
        "which determine approach and separation. Arcs show the angular velocities about the "
        "contact points P, the greatest of each impact as three quarters of a turn; the tangent is "
        "common to both bodies. As A fig. 1a, B figs 1, 5 and 7.",
        needs=MET,
    ),
    "contact_points": Kind(
        contact_points, POINTS_TITLE, POINTS_CAPTION + " As B figs 2–4.", needs=MET
    ),
    "energy": Kind(
        energies,
        "Energies",
        f"{ENERGY_CAPTION} The energy of each body is measured from its least potential energy on "
        "the trace; steps too close to distinguish are drawn as bands from the least to the "
        "greatest value.",
    ),
    "space_time": Kind(
        space_time,
        "Motion along the trace",
        "Arc length of the contact points against time, with the impacts; horizontal lines are the "
        "junctions of the trace, unless they would merge. Only the first part of a long run is "
        "shown.",
    ),
    "impact_map": Kind(
        impact_map,
        "Impact map",
        f"Approach speed along the line of centres against the position of the impact.{MANY}",
        needs=MET_TWICE,
    ),
    "intervals": INTERVALS,
    "accuracy": Kind(
        accuracy,
        "Accuracy",
        "Distance left between the surfaces at each impact, and the relative change in energy "
        f"along each free flight; both would be 0 in exact arithmetic.{MANY}",
    ),
    "exponents": EXPONENTS,
}
