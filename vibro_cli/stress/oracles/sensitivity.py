"""Growth of changes of the inputs: at each collision, and as the tangent map in 50 digits.

Both come from differences of neighbouring motions: of the solver for the growth, and of twins (on a
trace, the reference solver) for the map.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibro_cli.mechanics.system import TraceSystem
from vibro_cli.mechanics.trace import ArcShape, Trace
from vibro_cli.scenario.loading import any_scenario_of
from vibro_cli.stress.oracles.reference_solver import ReferenceSolver, SolverEvent
from vibro_cli.stress.oracles.scene import Path, Scene, mp
from vibro_cli.stress.scenes import Document, Finding, Plan
from vibro_cli.systems import system_named
from vibro_cli.systems.run import Stretch
from vibro_cli.systems.tangents import followed

# Large compared with the solver's rounding errors, small enough for a linear response.
CHANGE = 2.0**-30

Columns = dict[str, list[float]]
Solve = Callable[[TraceSystem], Columns]


def neighbouring(system: TraceSystem, change: float = CHANGE) -> Iterator[TraceSystem]:
    """Yield the system with each of its inputs changed by a relative ``change`` in turn."""
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
    """Return the trace with one piece enlarged by a factor."""
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
    """Return the greatest change of each quantity and collision per relative change of an input.

    It is at least the quantity itself, which accounts for the rounding of the result. ``solve``
    returns the columns of a system's collisions.
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


# Small enough to make second-order errors negligible, large compared with rounding in 50 digits.
STEP = mp.mpf(10) ** -18


def derivative(
    follow: Callable[[Sequence[Any]], Sequence[Any]], start: Sequence[Any]
) -> NDArray[np.float64]:
    """Return the derivative of the end of a motion with respect to its start.

    Parameters
    ----------
    follow
        Function from the numbers of a start to those of the end.
    start
        Numbers of the start at which the derivative is taken.
    """
    columns = []
    for number in range(len(start)):
        ends = []
        for sign in (1, -1):
            moved = [mp.mpf(value) for value in start]
            moved[number] += sign * STEP
            ends.append(follow(moved))
        columns.append([float((p - q) / (2 * STEP)) for p, q in zip(*ends, strict=True)])
    return np.array(columns).T


def differences(
    scene: Scene, events: Sequence[SolverEvent], end: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the derivative of the state at an instant (s), and of the times of all impacts.

    Parameters
    ----------
    scene
        The scene to compute.
    events
        Its events, which are also those of its neighbours.
    end
        Instant (s) after all events.

    Returns
    -------
    Derivatives with respect to displacements and speeds of all bodies at the start:
    ``[2 body + 0 or 1, component]`` of displacements and speeds (m, m/s), and
    ``[impact, component]`` of times (s).
    """
    count = len(scene.bodies)

    def per_length(ball: int, piece: int) -> Any:
        return Path(scene, ball, piece).per_length

    def follow(numbers: Sequence[Any]) -> list[Any]:
        starts = tuple(
            (piece, numbers[2 * ball] * per_length(ball, piece), numbers[2 * ball + 1])
            for ball, (piece, _, _) in enumerate(scene.starts)
        )
        twin = ReferenceSolver(replace(scene, starts=starts))
        impacts = twin.follow(events)
        now = [twin.at(ball, mp.mpf(end)) for ball in range(count)]
        ends = [
            number
            for ball, one in enumerate(now)
            for number in (one.place / per_length(ball, one.piece), one.speed)
        ]
        return [*ends, *(impact.t for impact in impacts)]

    start = [
        number
        for ball, (piece, place, speed) in enumerate(scene.starts)
        for number in (place / per_length(ball, piece), speed)
    ]
    found = derivative(follow, start)
    return found[: 2 * count], found[2 * count :]


# Growth beyond which the rounding of the motion itself affects its derivatives.
MOST_GROWTH = 1.0e4

Neighbours = Callable[
    [Any, Stretch], tuple[Sequence[float], Callable[[Sequence[Any]], Sequence[Any]]]
]
"""Function of a system and its run: the numbers of its start, and the function from the numbers of
a start, with the same events, to those of the end."""


def error_of(found: NDArray[np.float64], exact: NDArray[np.float64]) -> float:
    """Return the greatest error of derivatives, relative to the largest of them."""
    return float(np.max(np.abs(found - exact)) / np.max(np.abs(exact)))


def check_maps(
    plan: Plan,
    drawn: Callable[[np.random.Generator], Document],
    neighbours: Neighbours,
    tried: str,
) -> Finding:
    """Return the greatest error of the tangent maps of random scenes."""
    worst, number = Finding("error of the map, of its largest element", tried, 1e-10), 0
    while worst.cases < plan.scenes(6, 200):
        document = drawn(np.random.default_rng([plan.seed, 6, number]))
        number += 1
        error = map_error(document, neighbours)
        if error is not None:
            worst.take(error, document)
    return worst


def map_error(document: Document, neighbours: Neighbours) -> float | None:
    """Return the error of the tangent map of a scene.

    Returns None if there is no tangent map or no impact, or if rounding grows too much.
    """
    scenario = any_scenario_of(document)
    kind = system_named(scenario.system)
    system = kind.build(scenario)
    found, columns, whole = followed(kind, system, kind.limits(scenario))
    smooth = all(bool(np.all(rows["smooth"])) for rows in columns.values())
    impacts = sum(len(rows["smooth"]) for rows in columns.values())
    matrix = found.matrix()
    if not smooth or not impacts or np.max(np.abs(matrix)) > MOST_GROWTH:
        return None
    start, follow = neighbours(system, whole)
    units = found.units
    maps = (one / units[:, None] * units[None, :] for one in (matrix, derivative(follow, start)))
    return error_of(*maps)
