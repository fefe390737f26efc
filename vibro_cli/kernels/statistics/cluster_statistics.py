"""Extremes of the normal force and the friction demand of flights in lasting contact.

On one arc the normal force is ``a + b cos f + c sin f`` in the angle of the group's pendulum
(``kernels.cluster.trace_forces``), so its extremes are exact; on a short segment across pieces the
ends are taken, on a line it is constant.
"""

from __future__ import annotations

import math

from vibro_cli.compile.kernel import kernel
from vibro_cli.kernels.cluster.trace_forces import (
    AT_TIME,
    fit_forces,
    is_pendulum,
    set_forces,
)
from vibro_cli.kernels.flow.replay import half_period, recall_flight
from vibro_cli.kernels.structs import BodyForces, Flight
from vibro_cli.kernels.world import World

TURN = 2.0 * math.pi


@kernel
def friction_demand(force: float, normal: float) -> float:
    """Coefficient of friction that a friction force needs; infinite for N <= 0."""
    if force == 0.0:
        return 0.0 if normal >= 0.0 else math.inf
    return force / normal if normal > 0.0 else math.inf


@kernel
def group_extremes(
    world: World,
    number: int,
    duration: float,
    end: tuple[float, float, float],
    scratch: Flight,
) -> tuple[float, float]:
    """Least normal force (N) and greatest demand of friction of a group on one of its motions.

    Parameters
    ----------
    world
        With the logs of the run.
    number
        Row of the flight of the group's first body.
    duration
        Of the motion, s.
    end
        ``(S, C, P)`` of the first body at its end.
    scratch
        A flight to work with.
    """
    row = world.log[number]
    recall_flight(world, row, number, scratch)
    least = math.inf
    demand = 0.0
    if not is_pendulum(scratch):
        turn = turning_time(scratch, duration)
        for place in range(3):
            t = 0.0 if place == 0 else (duration if place == 1 else turn)
            if place == 0 or t > 0.0:
                set_forces(world, number, AT_TIME, t, scratch)
                least, demand = _counted_in(world, row.group_count, least, demand)
        return least, demand
    low, high = pendulum_range(world, number, duration, end, scratch)
    fit_forces(world, number, scratch)
    for place in range(row.group_count):
        normal, needed = extremes_on_arc(world.forces[place], low, high)
        least = min(least, normal)
        demand = max(demand, needed)
    return least, demand


@kernel
def _counted_in(world: World, count: int, least: float, demand: float) -> tuple[float, float]:
    """Count in the forces on the bodies of a group at one instant."""
    for place in range(count):
        one = world.forces[place]
        least = min(least, one.normal)
        demand = max(demand, friction_demand(one.friction, one.normal))
    return least, demand


@kernel
def turning_time(flight: Flight, duration: float) -> float:
    """Time (s) at which the forces of a group on a line are extreme between its ends, or 0.

    At rest they are constant on a line.
    """
    return 0.0


@kernel
def extremes_on_arc(one: BodyForces, low: float, high: float) -> tuple[float, float]:
    """Extremes of the normal force (N) and the demand of friction between two angles (rad)."""
    a = one.press[0]
    b = one.press[1]
    c = one.press[2]
    q = one.drag[2]
    least, demand = _at_angle(a, b, c, q, low, math.inf, 0.0)
    least, demand = _at_angle(a, b, c, q, high, least, demand)
    lowest = _turned(math.atan2(c, b) + math.pi, low)
    if lowest <= high:
        least, demand = _at_angle(a, b, c, q, lowest, least, demand)
    if abs(a) > abs(b):
        steepest = math.acos(-b / a)
        for sign in range(2):
            f = _turned(steepest if sign == 0 else -steepest, low)
            if f <= high:
                least, demand = _at_angle(a, b, c, q, f, least, demand)
    return least, demand


@kernel
def _at_angle(
    a: float, b: float, c: float, q: float, f: float, least: float, demand: float
) -> tuple[float, float]:
    """Count in the forces at one angle of the pendulum."""
    normal = a + b * math.cos(f) + c * math.sin(f)
    needed = friction_demand(abs(q * math.sin(f)), normal)
    return min(least, normal), max(demand, needed)


@kernel
def _turned(angle: float, low: float) -> float:
    """The first angle from ``low`` on that is equal up to whole turns."""
    return angle + TURN * math.ceil((low - angle) / TURN)


@kernel
def pendulum_range(
    world: World, number: int, duration: float, end: tuple[float, float, float], flight: Flight
) -> tuple[float, float]:
    """Least and greatest angle (rad) of a group's pendulum on a motion."""
    end_s, end_c, end_p = end
    s = flight.flow_s
    c = flight.flow_c
    p = flight.flow_p
    start = 2.0 * math.atan2(s, c)
    stop = 2.0 * math.atan2(
        end_s * flight.shift_c - end_c * flight.shift_s,
        end_c * flight.shift_c + end_s * flight.shift_s,
    )
    if p == 0.0:
        # From rest it moves downwards.
        p = -s * c
    # The half angles of both are within a turn: on from the start, not round by the other way.
    if flight.root_complement < 0.0:
        if (stop - start) * p < 0.0:
            stop += math.copysign(2.0 * TURN, p)
        return min(start, stop), max(start, stop)
    if abs(stop - start) > TURN:
        stop += math.copysign(2.0 * TURN, start)
    low = min(start, stop)
    high = max(start, stop)
    if flight.at_rest == 1:
        return low, high
    turn = 2.0 * math.atan2(math.sqrt(flight.parameter), flight.root_complement)
    centre = 0.0 if c > 0.0 else math.copysign(TURN, s)
    half = half_period(world.log[number], flight.frequency, duration)
    twice = duration >= half and p * end_p > 0.0
    if duration >= 2.0 * half or twice or (p > 0.0 and end_p < 0.0):
        high = centre + turn
    if duration >= 2.0 * half or twice or (p < 0.0 and end_p > 0.0):
        low = centre - turn
    return low, high
