"""How much a change of the inputs grows up to each collision."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

from vibro_cli.mechanics.system import System
from vibro_cli.mechanics.trace import ArcShape, Trace

# Large against the solver's rounding errors, small enough for the response to stay linear.
CHANGE = 2.0**-30

Columns = dict[str, list[float]]
Solve = Callable[[System], Columns]


def neighbouring(system: System, change: float = CHANGE) -> Iterator[System]:
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


def amplification(system: System, solve: Solve) -> Columns:
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
