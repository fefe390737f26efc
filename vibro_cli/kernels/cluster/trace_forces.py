"""Forces of the trace: normal force and friction of bodies on one motion, alone or in contact.

The contact forces of a group follow from its motion, body by body from the left (from the right if
the group rests against a wall on the left): ``f_i c_a = f_{i-1} c_b - m g sin(alpha) - M v'``. The
normal force is ``m g cos(alpha) +- m v^2/rho`` less the contact forces along the normal, and
friction is ``(kappa - 1) m |v'|``. On one arc the normal force is ``a + b cos f + c sin f`` in the
angle of the group's pendulum, and is fitted from three angles; on a line it is constant. A body
alone is a group of one.
"""

from __future__ import annotations

import math

from vibro_cli.compile.kernel import kernel
from vibro_cli.kernels.contact.contact_kinematics import (
    centre_position,
    centre_tangent,
    centres_along_path,
    parts_of_weight,
    tangent,
)
from vibro_cli.kernels.flow.flow import (
    POLYNOMIAL,
    acceleration_at,
    body_of_group,
    flow,
    replay_flight,
)
from vibro_cli.kernels.world import (
    BodyForces,
    Flight,
    FlightRow,
    World,
    number_along,
    track_of,
    track_on,
)

# Half the angles of a motion at which forces are fitted: thirds of a turn, then fifths, for a
# rotating trace.
_HALVES = [math.pi * k / n for n in (3, 5) for k in range(n)]
HALF_SINES = tuple(math.sin(half) for half in _HALVES)
HALF_COSINES = tuple(math.cos(half) for half in _HALVES)
COSINES = (1.0, -0.5, -0.5)
SINES = (0.0, 0.5 * math.sqrt(3.0), -0.5 * math.sqrt(3.0))
# Used in place of the number of such an angle: forces after a time, or at a distance along a line.
AT_TIME = -1
AT_WAY = -2


@kernel
def row_of(world: World, number: int, ball: int) -> int:
    """Return the row of the flight of ``ball`` that began together with that of row ``number``.

    A group is logged body by body; flights in progress are at the front of a log, in order of
    bodies.
    """
    row = world.log[number]
    bodies = world.settings[0].bodies
    place = (ball - row.group_first) % bodies
    index = number + place - (row.body - row.group_first) % bodies
    if 0 <= index < world.clock[0].flight_rows:
        other = world.log[index]
        if other.body == ball and other.t == row.t and other.t_low == row.t_low:
            return index
    return ball


@kernel
def bodies_of(world: World, row: FlightRow) -> tuple[int, int, int]:
    """Return the first body of a motion, the number of bodies, and the index of their forces."""
    if row.grouped == 1:
        return row.group_first, row.group_count, 0
    return row.body, 1, world.settings[0].bodies


@kernel
def is_pendulum(flight: Flight) -> bool:
    """Return whether a motion is on an arc, with forces harmonic in its angle."""
    return flight.form != POLYNOMIAL and flight.frequency != 0.0 and flight.at_rest == 0


# Forces of a body that is heavier than another by this have too much rounding to count for it.
UNEQUAL = 50.0


@kernel
def set_forces(world: World, number: int, angle: int, t: float, scratch: Flight) -> None:
    """Set the normal force and friction (N) of every body of a motion, in ``world.forces``.

    ``number`` is the row of the flight of one of the bodies. ``angle`` is the index of a fitted
    angle, ``AT_TIME`` for a time ``t`` (s) after the start, or ``AT_WAY`` for a distance ``t`` (m)
    along a line. For a body alone ``scratch`` must be the flight of its row.
    """
    row = world.log[number]
    first, count, base = bodies_of(world, row)
    for place in range(count):
        ball = number_along(world, first, place)
        index = number
        if row.grouped == 1:
            index = row_of(world, number, ball)
            replay_flight(world, world.log[index], index, scratch)
        _set_motion(world, index, world.forces[base + place], angle, t, scratch)
    for place in range(count):
        one = world.forces[base + place]
        body = world.bodies[number_along(world, first, place)]
        _, onto = parts_of_weight(world, one.x, one.sine, one.cosine)
        one.normal = body.mass * (onto + one.bend)
        one.friction = (body.kappa - 1.0) * body.mass * abs(one.acceleration)
    last = _last_summed(world, row, first, count, base)
    _sum_forces(world, first, base, 0, last, 1)
    _sum_forces(world, first, base, count - 1, last, -1)


@kernel
def _last_summed(world: World, row: FlightRow, first: int, count: int, base: int) -> int:
    """Return the body of a motion up to which the forces are summed from both of its ends."""
    if row.at_rest == 1:
        # At rest against a wall on the left, whose force is unknown: start from the free end.
        one = world.forces[base]
        back, _ = parts_of_weight(world, one.x, one.sine, one.cosine)
        return 0 if back > 0.0 else count - 1
    # The rounding of a heavy body's forces is passed on to the bodies after it.
    heaviest = 0
    most = 0.0
    for place in range(count):
        mass = world.bodies[number_along(world, first, place)].mass
        if mass > most:
            heaviest = place
            most = mass
    end = world.bodies[number_along(world, first, count - 1)]
    return heaviest if most > UNEQUAL * end.mass else count - 1


@kernel
def _sum_forces(world: World, first: int, base: int, place: int, last: int, step: int) -> None:
    """Add the forces of contacts to the normal forces, from one end of a motion to a body."""
    pushed = 0.0
    while place != last:
        one = world.forces[base + place]
        other = world.forces[base + place + step]
        body = world.bodies[number_along(world, first, place)]
        back, _ = parts_of_weight(world, one.x, one.sine, one.cosine)
        nx, ny = _direction(one, other)
        along = pushed - body.mass * (back + body.kappa * one.acceleration)
        force = along / (nx * one.cosine + ny * one.sine)
        one.normal += force * (ny * one.cosine - nx * one.sine)
        other.normal -= force * (ny * other.cosine - nx * other.sine)
        pushed = force * (nx * other.cosine + ny * other.sine)
        place += step


@kernel
def _direction(a: BodyForces, b: BodyForces) -> tuple[float, float]:
    """Return the unit vector from one centre to the other."""
    dx = b.x - a.x
    dy = b.y - a.y
    distance = math.sqrt(dx * dx + dy * dy)
    return dx / distance, dy / distance


@kernel
def _set_motion(
    world: World, index: int, one: BodyForces, angle: int, t: float, scratch: Flight
) -> None:
    """Set the centre, slope, ``v^2/rho`` and ``v'`` of a body, see :func:`set_forces`."""
    row = world.log[index]
    piece = world.pieces[row.piece]
    track = track_on(world, row.body, row.piece)
    rho = track.path_radius
    if angle == AT_TIME:
        s, c, p = flow(scratch, t)
        one.acceleration = acceleration_at(scratch, rho, t, s, c)
        speed = track.speed_factor * p
        squared = speed * speed
    elif angle == AT_WAY:
        s = scratch.flow_s + t
        c = scratch.flow_c
        one.acceleration = acceleration_at(scratch, rho, 0.0, s, c)
        squared = 0.0
    else:
        s, c, bend, squared = pendulum_at(scratch, HALF_SINES[angle], HALF_COSINES[angle])
        s, c, _ = body_of_group(scratch, s, c, 0.0)
        one.acceleration = rho * bend
        squared *= rho * rho
    one.x, one.y = centre_position(piece, track, s, c)
    one.cosine, one.sine = centre_tangent(piece, s, c)
    one.bend = piece.sign * squared / rho if rho > 0.0 else 0.0


@kernel
def pendulum_at(flight: Flight, sine: float, cosine: float) -> tuple[float, float, float, float]:
    """Return ``(S, C)``, ``f''`` and ``f'^2`` of a group's pendulum at a fitted angle."""
    w2 = flight.frequency * flight.frequency
    square = 4.0 * w2 * (flight.parameter - sine * sine)
    return sine, cosine, -w2 * (2.0 * sine * cosine), square


@kernel
def set_ends(world: World, number: int, duration: float, scratch: Flight) -> None:
    """Set the forces on every body of a motion at its start, and after its duration (s)."""
    _, count, base = bodies_of(world, world.log[number])
    set_forces(world, number, AT_TIME, duration, scratch)
    note_forces(world, number, 2)
    for place in range(count):
        one = world.forces[base + place]
        one.end_normal = one.normal
        one.end_friction = one.friction
    set_forces(world, number, AT_TIME, 0.0, scratch)
    note_forces(world, number, 0)
    for place in range(count):
        one = world.forces[base + place]
        one.start_normal = one.normal
        one.start_friction = one.friction


@kernel
def fit_forces(world: World, number: int, scratch: Flight) -> None:
    """Set the forces on every body of a motion as functions of its angle, if it has one.

    ``normal_terms`` has the coefficients of ``a + b cos f + c sin f``, ``friction_terms`` those of
    ``q sin f``, where f is the angle of the pendulum.
    """
    row = world.log[number]
    first, count, base = bodies_of(world, row)
    for place in range(count):
        one = world.forces[base + place]
        for k in range(5):
            one.normal_terms[k] = 0.0
            one.friction_terms[k] = 0.0
    replay_flight(world, row, number, scratch)
    if not is_pendulum(scratch):
        return
    for angle in range(3):
        set_forces(world, number, angle, 0.0, scratch)
        for place in range(count):
            one = world.forces[base + place]
            one.normal_terms[0] += one.normal / 3.0
            one.normal_terms[1] += one.normal * COSINES[angle] * (2.0 / 3.0)
            one.normal_terms[2] += one.normal * SINES[angle] * (2.0 / 3.0)
    for place in range(count):
        ball = number_along(world, first, place)
        body = world.bodies[ball]
        rho = track_on(world, ball, row.piece).path_radius
        friction_terms = (body.kappa - 1.0) * body.mass * rho * row.frequency * row.frequency
        world.forces[base + place].friction_terms[2] = friction_terms


@kernel
def note_forces(world: World, number: int, part: int) -> None:
    """Store the present forces as those at the start (0), middle (1) or end (2) of a segment."""
    _, count, base = bodies_of(world, world.log[number])
    for place in range(count):
        one = world.forces[base + place]
        one.normal_terms[part] = one.normal
        one.friction_terms[part] = math.copysign(one.friction, one.acceleration)


@kernel
def extreme_on_segment(one: BodyForces, side: float, weight: float) -> tuple[float, float]:
    """Return the share of a segment at which ``side F - weight N`` is extreme, or 0, and its value.

    This is the vertex of the parabola through the three stored values.
    """
    start = side * one.friction_terms[0] - weight * one.normal_terms[0]
    middle = side * one.friction_terms[1] - weight * one.normal_terms[1]
    end = side * one.friction_terms[2] - weight * one.normal_terms[2]
    bend = start - 2.0 * middle + end
    rise = end - start
    if abs(rise) < 2.0 * abs(bend):
        return 0.5 - 0.25 * rise / bend, middle - 0.125 * rise * rise / bend
    return 0.0, start


@kernel
def normal_force_now(world: World, first: int, count: int, step: int) -> float:
    """Return the normal force (N) of a member, from its state, speed and contact forces.

    The contact forces are the ``solution`` of the pairs.
    """
    ball = number_along(world, first, step)
    flight = world.flights[ball]
    piece = world.pieces[flight.piece]
    track = track_of(world, ball)
    tx, ty = tangent(world, ball)
    x, _ = centre_position(piece, track, flight.s, flight.c)
    _, onto = parts_of_weight(world, x, ty, tx)
    force = world.bodies[ball].mass * onto
    if piece.sign != 0.0:
        central = flight.speed * flight.speed / track.path_radius
        force += piece.sign * world.bodies[ball].mass * central
    if step > 0:
        force -= _pushed_across(world, number_along(world, first, step - 1), ball)
    if step < count - 1:
        force += _pushed_across(world, ball, ball)
    return force


@kernel
def _pushed_across(world: World, j: int, ball: int) -> float:
    """Return the component (N) of a contact's force along the normal of a body's path."""
    _, across = centres_along_path(world, j, ball)
    return world.pairs[j].solution * across / world.pairs[j].distance
