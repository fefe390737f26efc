"""What a scenario of a trace is made into, once it is known that it can be.

The numbers of the scenario may be arrays (see ``numerics.alike``): then so are those of the system.
"""

from __future__ import annotations

from vibro_cli.mechanics import placement
from vibro_cli.mechanics.body import Body
from vibro_cli.mechanics.system import InitialState, System, Wall
from vibro_cli.mechanics.trace import ArcShape, Piece, Trace
from vibro_cli.mechanics.turning import Turning
from vibro_cli.numerics import alike
from vibro_cli.scenario.models import Ball, Scenario
from vibro_cli.scenario.models import Wall as WallTable


def trace_of(scenario: Scenario) -> Trace:
    """Return the trace; raises ``ValueError`` if the pieces do not make a chain."""
    table = scenario.trace
    shapes = [ArcShape(arc.shape, arc.radius, arc.length, arc.end_slope) for arc in table.arcs]
    return Trace.chain(table.start_slope, shapes, table.closed)


def speed_of(ball: Ball, body: Body, piece: Piece) -> float:
    """Return the speed (m/s) with which the centre of a body starts on a piece."""
    if ball.speed is not None:
        return ball.speed
    if ball.omega is not None:
        return placement.speed_of_omega(body, ball.omega)
    if ball.rate is None or not alike.occurs(ball.rate != 0.0):
        return 0.0
    speed = placement.speed_of_rate(piece, body, ball.rate)
    return alike.choose(ball.rate != 0.0, speed, 0.0)  # type: ignore[no-any-return]


def system_of(
    scenario: Scenario,
    trace: Trace,
    bodies: tuple[Body, ...],
    initial: tuple[InitialState, ...],
    turning: Turning | None,
) -> System:
    """Return the system of a scenario from its parts."""
    left, right = scenario.ends.left, scenario.ends.right
    return System(
        gravity=scenario.gravity,
        trace=trace,
        bodies=bodies,
        initial=initial,
        restitution=scenario.collision.k,
        law=scenario.collision.law,
        inadmissible=scenario.collision.inadmissible,
        surface=scenario.trace.surface,
        left_end=Wall(left.wall) if isinstance(left, WallTable) else None,
        right_end=Wall(right.wall) if isinstance(right, WallTable) else None,
        turning=turning,
    )
