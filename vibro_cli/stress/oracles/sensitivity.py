"""Growth of changes of the inputs: at each collision, and as the tangent map in 50 digits.

Both come from differences of neighbouring motions: of the solver for the growth, of the oracle for
the map, where its scenes can describe the system.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibro_cli.mechanics.system import TraceSystem
from vibro_cli.mechanics.trace import ArcShape, Trace
from vibro_cli.scenario.loading import any_scenario_of
from vibro_cli.stress.oracles.oracle import Oracle
from vibro_cli.stress.oracles.scene import Path, Scene, mp, scene_of_system
from vibro_cli.stress.scenes import Document, Finding, Plan
from vibro_cli.systems import system_named
from vibro_cli.systems.run import Run, Stretch
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
# Greatest difference (s) between the end of a run and its last impact, at which it ends.
NEARBY = 1.0e-9


def derivative(
    follow: Callable[[Sequence[Any]], Sequence[Any]], start: Sequence[Any]
) -> NDArray[np.float64]:
    """Return the derivative of the end of a motion with respect to its start.

    `follow` is the function from the numbers of a start to those of the end.
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


Neighbours = tuple[Sequence[Any], Callable[[Sequence[Any]], Sequence[Any]]]
"""The numbers of a motion's start, and the function from those of a start nearby to the end's."""


def neighbours(
    system: Any, scene: Scene, pairs: Sequence[Collection[int]], end: float
) -> Neighbours:
    """Return the start of a motion, and the oracle's map from starts nearby.

    `pairs` are the bodies (from 0) of every impact of the motion, in order; its `end` (s) is after
    the last impact or, up to rounding, at it. The start has the displacement (m) and speed (m/s) of
    each body. The map returns those at the end followed by the instants (s) of the impacts.
    """
    until = mp.mpf(end)

    def per_length(ball: int, piece: int) -> Any:
        return Path(scene, ball, piece).per_length

    def numbers_of(states: Iterable[Any]) -> list[Any]:
        return [
            number
            for ball, (piece, place, speed) in enumerate(states)
            for number in (place / per_length(ball, piece), speed)
        ]

    def follow(numbers: Sequence[Any]) -> list[Any]:
        starts = tuple(
            (piece, numbers[2 * ball] * per_length(ball, piece), numbers[2 * ball + 1])
            for ball, (piece, _, _) in enumerate(scene.starts)
        )
        oracle = Oracle.of(system, scene=replace(scene, starts=starts))
        oracle.allow(pairs)
        met, instants = oracle.impacts(len(pairs), until + 1), []
        for pair in pairs:  # those of one instant may come in another order
            one = next(one for one in met if set(one.bodies) == set(pair))
            met.remove(one)
            instants.append(one.t)
        if until > oracle.t + NEARBY:  # the motion ends later than with its last impact
            oracle.run(until)
        return [*numbers_of(oracle.at(until)), *instants]

    return numbers_of(scene.starts), follow


def differences(run: Run) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the derivative of the state at the end of a run, and of the times of its impacts.

    They are derivatives with respect to displacements and speeds of all bodies at the start:
    ``[2 body + 0 or 1, component]`` of displacements and speeds (m, m/s), and
    ``[impact, component]`` of times (s).
    """
    sides = (run.collisions[name].tolist() for name in ("ball_a", "ball_b"))
    pairs = [(a - 1, b - 1) for a, b in zip(*sides, strict=True)]
    end = run.checkpoint()["end_time"]
    start, follow = neighbours(run.system, scene_of_system(run.system), pairs, end)
    found = derivative(follow, start)
    return found[: len(start)], found[len(start) :]


# Growth beyond which the rounding of the motion itself affects its derivatives.
MOST_GROWTH = 1.0e4


def error_of(found: NDArray[np.float64], exact: NDArray[np.float64]) -> float:
    """Return the greatest error of derivatives, relative to the largest of them."""
    return float(np.max(np.abs(found - exact)) / np.max(np.abs(exact)))


def check_maps(
    plan: Plan,
    drawn: Callable[[np.random.Generator], Document],
    neighbours: Callable[[Any, Stretch], Neighbours],
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


def map_error(document: Document, neighbours: Callable[[Any, Stretch], Neighbours]) -> float | None:
    """Return the error of the tangent map of a scene, given its system, run and neighbours.

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
    exact = derivative(follow, start)[: len(start)]
    maps = (one / units[:, None] * units[None, :] for one in (matrix, exact))
    return error_of(*maps)
