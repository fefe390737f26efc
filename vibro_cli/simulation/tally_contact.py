"""Normal force and friction demand of flights in lasting contact, gathered by kernels.

The contact forces of a group follow from its motion, body by body from the left: ``f_i c_a =
f_{i-1} c_b - m g sin(alpha) - M v'``; the trace then carries ``m g cos(alpha) +- m v^2/rho`` less
the contact forces along its normal, and friction is ``(kappa - 1) m |v'|``. On one arc the normal
force is ``a + b cos f + c sin f`` in the angle of the group's pendulum, so its extremes are exact;
on a short segment across pieces the ends are taken, on a line it is constant.
"""

from __future__ import annotations

import math

from vibro_cli.mechanics.flow import POLYNOMIAL, acceleration_at, body_of_group, flow
from vibro_cli.mechanics.gap import centre_position
from vibro_cli.mechanics.records import Flight
from vibro_cli.numerics.engine import kernel
from vibro_cli.simulation.recall import half_period, recall_flight
from vibro_cli.simulation.touching import parts_of_weight
from vibro_cli.simulation.world import World

TURN = 2.0 * math.pi
# Angles of a group's pendulum at which its forces are fitted, halved: the thirds of a turn, and
# after them the fifths, for a turning trace.
_HALVES = [math.pi * k / n for n in (3, 5) for k in range(n)]
HALF_SINES = tuple(math.sin(half) for half in _HALVES)
HALF_COSINES = tuple(math.cos(half) for half in _HALVES)
COSINES = (1.0, -0.5, -0.5)
SINES = (0.0, 0.5 * math.sqrt(3.0), -0.5 * math.sqrt(3.0))
AT_TIME = -1  # in place of the number of such an angle


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
    last: int,
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
    last
        Rows of the log before this one are searched for those of the other bodies.
    duration
        Of the motion, s.
    end
        ``(S, C, P)`` of the first body at its end.
    scratch
        A flight to work with.
    """
    row = world.log[number]
    recall_flight(world, row, number, scratch)
    pendulum = scratch.form != POLYNOMIAL and scratch.frequency != 0.0 and row.at_rest == 0
    low = 0.0
    high = 0.0
    turn = turning_time(scratch, duration)
    if pendulum:
        low, high = pendulum_range(world, number, duration, end, scratch)
    least = math.inf
    demand = 0.0
    for member in range(row.group_count):
        if pendulum:
            normal, needed = member_of_pendulum(world, number, last, member, low, high, scratch)
        else:
            normal, force = member_force(world, number, last, member, AT_TIME, 0.0, scratch)
            needed = friction_demand(force, normal)
            for place in range(2):
                t = duration if place == 0 else turn
                if t > 0.0:
                    other, force = member_force(world, number, last, member, AT_TIME, t, scratch)
                    needed = max(needed, friction_demand(force, other))
                    normal = min(normal, other)
        least = min(least, normal)
        demand = max(demand, needed)
    return least, demand


@kernel
def turning_time(flight: Flight, duration: float) -> float:
    """Time (s) at which the forces of a group on a line are extreme between its ends, or 0.

    At rest they are constant on a line.
    """
    return 0.0


@kernel
def row_of(world: World, number: int, last: int, member: int) -> int:
    """The row of a member's flight: the last one of its body that began with the first body's."""
    row = world.log[number]
    ball = (row.group_first + member) % world.settings[0].bodies
    for index in range(last - 1, -1, -1):
        other = world.log[index]
        if other.body == ball and other.t == row.t and other.t_low == row.t_low:
            return index
    return number


@kernel
def member_force(
    world: World, number: int, last: int, member: int, angle: int, t: float, scratch: Flight
) -> tuple[float, float]:
    """Normal force and friction (N) of the ``member``-th body of a group.

    At one of the fitted angles of its pendulum, or (``AT_TIME``) a time (s) after its launch.
    """
    row = world.log[number]
    before = 0.0
    normal = 0.0
    friction = 0.0
    before_x = 0.0
    before_y = 0.0
    # At rest on a wall to the left, whose force is not known: from the free end on.
    place, step = _free_end(world, number, last, scratch)
    x, y, sine, cosine, bend, acceleration = _motion(world, number, last, place, angle, t, scratch)
    for i in range(row.group_count):
        ball = (row.group_first + place) % world.settings[0].bodies
        mass = world.bodies[ball].mass
        kappa = world.bodies[ball].kappa
        back, onto = parts_of_weight(world, x, sine, cosine)
        normal = mass * (onto + bend)
        along = -mass * (back + kappa * acceleration)
        friction = (kappa - 1.0) * mass * abs(acceleration)
        if i > 0:
            nx, ny = _direction(before_x, before_y, x, y)
            along += before * (nx * cosine + ny * sine)
            normal -= before * (ny * cosine - nx * sine)
        following = place + step
        if following < 0 or following >= row.group_count:
            break
        other = _motion(world, number, last, following, angle, t, scratch)
        nx, ny = _direction(x, y, other[0], other[1])
        before = along / (nx * cosine + ny * sine)
        normal += before * (ny * cosine - nx * sine)
        if place == member:
            break
        before_x = x
        before_y = y
        place = following
        x, y, sine, cosine, bend, acceleration = other
    return normal, friction


@kernel
def _free_end(world: World, number: int, last: int, scratch: Flight) -> tuple[int, int]:
    """The body of a group from which its forces follow one after another, and the way on."""
    row = world.log[number]
    if row.at_rest == 1:
        x, _, sine, cosine, _, _ = _motion(world, number, last, 0, AT_TIME, 0.0, scratch)
        back, _ = parts_of_weight(world, x, sine, cosine)
        if back > 0.0:
            return row.group_count - 1, -1
    return 0, 1


@kernel
def _direction(ax: float, ay: float, bx: float, by: float) -> tuple[float, float]:
    dx = bx - ax
    dy = by - ay
    distance = math.sqrt(dx * dx + dy * dy)
    return dx / distance, dy / distance


@kernel
def _motion(
    world: World, number: int, last: int, member: int, angle: int, t: float, scratch: Flight
) -> tuple[float, float, float, float, float, float]:
    """Centre (m), sine and cosine of the slope, ``v^2/rho`` and ``v'`` (m/s^2) of a body."""
    index = row_of(world, number, last, member)
    row = world.log[index]
    piece = world.pieces[row.piece]
    track = world.tracks[row.body * world.settings[0].pieces + row.piece]
    recall_flight(world, row, index, scratch)
    rho = track.path_radius
    if angle == AT_TIME:
        s, c, p = flow(scratch, t)
        acceleration = acceleration_at(scratch, rho, t, s, c)
        speed = track.speed_factor * p
        squared = speed * speed
    else:
        s, c, bend, squared = pendulum_at(scratch, HALF_SINES[angle], HALF_COSINES[angle])
        s, c, _ = body_of_group(scratch, s, c, 0.0)
        acceleration = rho * bend
        squared *= rho * rho
    x, y = centre_position(piece, track, s, c)
    if rho == 0.0:
        return x, y, piece.tangent_y, piece.tangent_x, 0.0, acceleration
    slope = piece.sign * ((c - s) * (c + s))
    return x, y, 2.0 * s * c, slope, piece.sign * squared / rho, acceleration


@kernel
def pendulum_at(flight: Flight, sine: float, cosine: float) -> tuple[float, float, float, float]:
    """``(S, C)``, ``f''`` and ``f'^2`` of a group's pendulum at one of the fitted angles."""
    w2 = flight.frequency * flight.frequency
    square = 4.0 * w2 * (flight.parameter - sine * sine)
    return sine, cosine, -w2 * (2.0 * sine * cosine), square


@kernel
def member_of_pendulum(
    world: World, number: int, last: int, member: int, low: float, high: float, scratch: Flight
) -> tuple[float, float]:
    """Extremes on one arc, from ``N = a + b cos f + c sin f`` fitted at three angles."""
    a = 0.0
    b = 0.0
    c = 0.0
    for angle in range(3):
        normal, _ = member_force(world, number, last, member, angle, 0.0, scratch)
        a += normal / 3.0
        b += normal * COSINES[angle] * (2.0 / 3.0)
        c += normal * SINES[angle] * (2.0 / 3.0)
    row = world.log[row_of(world, number, last, member)]
    body = world.bodies[row.body]
    rho = world.tracks[row.body * world.settings[0].pieces + row.piece].path_radius
    q = (body.kappa - 1.0) * body.mass * rho * row.frequency * row.frequency
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
    low = min(start, stop)
    high = max(start, stop)
    if flight.root_complement < 0.0 or flight.at_rest == 1:
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
