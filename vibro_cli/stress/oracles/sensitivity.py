"""How much a change of the inputs grows: at each collision, and as the tangent map in 50 digits.

Both by differences of neighbouring motions: the solver's for the growth, those of the reference
solver for the map.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibro_cli.mechanics.system import TraceSystem
from vibro_cli.mechanics.trace import ArcShape, Trace
from vibro_cli.stress.oracles.reference_solver import Happening, Impact, Twin
from vibro_cli.stress.oracles.scene import Scene
from vibro_cli.stress.oracles.taylor import mp

# Large against the solver's rounding errors, small enough for the response to stay linear.
CHANGE = 2.0**-30

Columns = dict[str, list[float]]
Solve = Callable[[TraceSystem], Columns]


def neighbouring(system: TraceSystem, change: float = CHANGE) -> Iterator[TraceSystem]:
    """The system with each of its inputs in turn changed by a relative ``change``."""
    factor = 1.0 + change
    yield replace(system, gravity=system.gravity * factor)
    for number, body in enumerate(system.bodies):
        for changed in (
            replace(body, radius=body.radius * factor),
            replace(body, mass=body.mass * factor),
            replace(body, inertia_ratio=body.kappa * factor - 1.0),
        ):
            yield replace(system, bodies=_with(system.bodies, number, changed))
    for number, state in enumerate(system.initial):
        for start in (
            replace(state, position=state.position * factor),
            replace(state, speed=state.speed * factor),
        ):
            if start != state:
                yield replace(system, initial=_with(system.initial, number, start))
    for number, k in enumerate(system.restitution):
        if k > 0.0:
            yield replace(system, restitution=_with(system.restitution, number, k / factor))
    for number in range(len(system.trace.pieces)):
        yield replace(system, trace=_stretched(system.trace, number, factor))


def _with(items: tuple[Any, ...], number: int, item: Any) -> tuple[Any, ...]:
    return (*items[:number], item, *items[number + 1 :])


def _stretched(trace: Trace, number: int, factor: float) -> Trace:
    """The trace with one piece larger."""
    shapes = []
    for piece in trace.pieces:
        size = factor if piece.index == number else 1.0
        if piece.is_line:
            shapes.append(ArcShape(piece.shape, length=piece.length * size))
        else:
            radius = piece.radius * size
            shapes.append(ArcShape(piece.shape, radius=radius, end_slope=piece.end_slope))
    return Trace.chain(trace.pieces[0].start_slope, shapes, trace.closed)


def amplification(system: TraceSystem, solve: Solve) -> Columns:
    """Greatest change of every quantity of every collision for a relative change of 1 of an input.

    At least the quantity itself, which is what the rounding of the result alone would change.
    ``solve`` returns the columns of a system's collisions.
    """
    base = solve(system)
    greatest = {name: [abs(value) for value in column] for name, column in base.items()}
    for other in neighbouring(system):
        for name, column in solve(other).items():
            if len(column) != len(base[name]):
                raise ArithmeticError("a small change of an input changes the number of collisions")
            for row, value in enumerate(column):
                change = abs(value - base[name][row]) / CHANGE
                greatest[name][row] = max(greatest[name][row], change)
    return greatest


# Small enough for an error of the second order to be none, large against rounding in 50 digits.
STEP = mp.mpf(10) ** -18


def ways_per_place(twin: Twin, ball: int, piece: int) -> mp.mpf:
    """Way (m) of the centre of a body for a unit of its place on a piece."""
    return twin.path_radius(ball, piece) if twin.scene.pieces[piece].sign else mp.one


def neighbour(scene: Scene, component: int, change: mp.mpf) -> Scene:
    """A scene with the way (m) or the speed (m/s) of one body changed at its start."""
    ball, part = divmod(component, 2)
    starts = list(scene.starts)
    piece, place, speed = starts[ball]
    if part == 0:
        place += change / ways_per_place(Twin(scene), ball, piece)
    else:
        speed += change
    starts[ball] = (piece, place, speed)
    return replace(scene, starts=tuple(starts))


def differences(
    scene: Scene, happenings: Sequence[Happening], end: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the derivative of the state at an instant (s), and of the times of all impacts.

    Parameters
    ----------
    scene
        What is run.
    happenings
        Its events, which are those of its neighbours too.
    end
        Instant (s) after all of them.

    Returns
    -------
    Derivatives to ways and speeds of all bodies at the start, ``[2 body + 0 or 1, component]`` of
    ways and speeds (m, m/s) and ``[impact, component]`` of times (s).
    """
    columns, times = [], []
    for component in range(2 * len(scene.bodies)):
        ahead = _motion(neighbour(scene, component, STEP), happenings, end)
        back = _motion(neighbour(scene, component, -STEP), happenings, end)
        columns.append([(b - a) / (2 * STEP) for a, b in zip(back[0], ahead[0], strict=True)])
        times.append([
            (b.t - a.t) / (2 * STEP) for a, b in zip(back[1], ahead[1], strict=True)
        ])  # fmt: skip
    return np.array(columns, dtype=float).T, np.array(times, dtype=float).T


def _motion(
    scene: Scene, happenings: Sequence[Happening], end: float
) -> tuple[list[mp.mpf], list[Impact]]:
    """Way and speed of every body at an instant, and the impacts before it."""
    twin = Twin(scene)
    impacts = twin.follow(happenings)
    found = []
    for ball in range(len(scene.bodies)):
        now = twin.at(ball, mp.mpf(end))
        found += [now.place * ways_per_place(twin, ball, now.piece), now.speed]
    return found, impacts
