"""The mirror image of any system, and whether its motion is the mirror image of the motion."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from vibro_cli.mechanics.system import System
from vibro_cli.mechanics.trace import ArcShape, Trace
from vibro_cli.simulation.run import Run
from vibro_cli.stress.highprecision.sensitivity import neighbouring

# Instants at which a motion and its mirror image are compared.
INSTANTS = 24
# Of the trace's length: what is not looked into any further.
NEAR = 1.0e-9
# The same under laws that do not act along the line of centres: what would come of bounces lower
# than the rounding of the places (1e-7 m/s) is not known there.
FAINT = 1.0e-7
# Rounding of places and speeds, as a relative change of the inputs.
ROUNDING = 2.0**-40
# Of the trace's length: where such a change does as much, nothing is told from rounding.
LOST = 1.0e-3

Solve = Any  # a function of a system that returns its run


def mirrored_system(system: System) -> System:
    """The mirror image of any system: right for left."""
    pieces = system.trace.pieces
    shapes = [
        ArcShape(piece.shape, length=piece.length)
        if piece.is_line
        else ArcShape(piece.shape, radius=piece.radius, end_slope=-piece.start_slope)
        for piece in reversed(pieces)
    ]
    starts = []
    for state in reversed(system.initial):
        piece = pieces[state.piece]
        place = piece.length - state.position if piece.is_line else -state.position
        starts.append(
            replace(state, piece=len(pieces) - 1 - state.piece, position=place, speed=-state.speed)
        )
    count = len(system.bodies)
    pairs, seam = system.restitution[: count - 1], system.restitution[count - 1 :]
    turning = system.turning
    if turning is not None:
        turning = replace(turning, x=pieces[-1].end[0] - turning.x)
    return replace(
        system,
        trace=Trace.chain(-pieces[-1].end_slope, shapes, system.trace.closed),
        bodies=system.bodies[::-1], initial=tuple(starts), restitution=(*pairs[::-1], *seam),
        left_end=system.right_end, right_end=system.left_end, turning=turning,
    )  # fmt: skip


def _places(run: Run, times: Any) -> Any:
    """Arc lengths (m) at some instants: a row for each, a column for each body."""
    count = len(run.system.bodies)
    return run.sample(times)["s"].reshape(-1, count)


def _distances(run: Run, one: Any, other: Any) -> Any:
    """How far apart (m) two motions are at every instant."""
    apart = np.abs(one - other)
    if run.system.trace.closed:
        apart = np.minimum(apart, run.system.trace.length - apart)
    return apart.max(axis=1)


def distance_from_image(run: Run, solve: Solve) -> tuple[float, float]:
    """How far (m) the motion of the mirror image is from the mirror image of the motion, and when.

    Zero as long as it is no more than what the rounding of the inputs does, which changes of that
    size of every input in turn tell: where contact begins or ends it grows with their square root.
    """
    system, length = run.system, run.system.trace.length
    image = solve(mirrored_system(system))
    end = min(float(one.checkpoint()["end_time"]) for one in (run, image))
    times = np.linspace(0.0, end, INSTANTS + 1)[1:]
    ours = _places(run, times)
    off = _distances(run, ours, length - _places(image, times)[:, ::-1])
    near = length * (NEAR if system.law == "normal-impulse" else FAINT)
    if not (off > near).any():
        return 0.0, 0.0
    moved = np.zeros(len(times))
    for other in neighbouring(system, ROUNDING):
        changed = solve(other)
        there = float(changed.checkpoint()["end_time"])
        known = times <= there
        places = _distances(run, ours[known], _places(changed, times[known]))
        moved[known] = np.maximum(moved[known], places)
        if there < end * (1.0 - NEAR):
            moved[~known] = np.inf  # it ends otherwise: nothing is told of what comes later
        bad = (off > near + moved) & (moved < LOST * length)
        if not bad.any():
            return 0.0, 0.0
    row = int(np.argmax(bad))
    return float(off[row]), float(times[row])
