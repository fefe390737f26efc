"""Derivatives of the times of impacts with respect to numbers of a system, for a trace at rest.

The numbers are any on which the system depends: its dependence on them is given, the dependence of
the motion follows from event to event. For a flight of duration t from ``(T0, x0, v0)``, at a fixed
time

``dx = J (dx0, dv0) - xdot dT0 + (dx/dw) dw``,  ``x(t) = X(w t; x0, v0/w)`` on an arc, so that
``dx/dw = (xdot t - J12 v0)/w,   dv/dw = (v + t vdot - J22 v0)/w``,

with x an angle and v its rate. The time of an event with ``g(x, p) = 0`` changes by
``dT = -dg/gdot``, which adds ``xdot dT`` and ``vdot dT`` to the changes of x and v.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from vibro_cli.compile.kernel import FloatMatrix, IntMatrix, kernel, struct
from vibro_cli.kernels.contact.contact_kinematics import centre_position, centre_tangent
from vibro_cli.kernels.flow.flow import acceleration_at, replay_flight
from vibro_cli.kernels.impact.laws import NORMAL_IMPULSE, law_approach, weight_and_response
from vibro_cli.kernels.numerics.double_double import time_between
from vibro_cli.kernels.tangent.flight_jacobian import flight_jacobian
from vibro_cli.kernels.tangent.follow import curvature_jump, end_at, has_kink, leans
from vibro_cli.kernels.world import WALL, Flight, World, track_on


@struct
class TrackChange:
    """Derivatives of the path of a body's centre on a piece, with respect to one number."""

    x: float  # centre of the arc; on a line, centre of the body at the line's left end, m
    y: float
    path_radius: float  # rho, m; 0 on a line
    slope: float  # of a line, rad; 0 on an arc
    pace: float  # of w, divided by w; on a line, of the acceleration, m/s^2
    left: float  # positions of the body at the ends or walls: rad on an arc, m on a line
    right: float


@struct
class MotionChange:
    """Derivatives of the start of a body's present flight with respect to one number."""

    t: float  # s
    place: float  # angle (rad) on an arc, distance (m) on a line
    speed: float  # m/s


@struct
class Arrival:
    """One body at the end of its flight; from ``tangent_x`` on, at an impact."""

    piece: int
    row: int  # of the log, after the flight
    scale: float  # rho (m) on an arc, 1 on a line
    speed: float  # of the centre along its path, m/s
    acceleration: float  # along the path, m/s^2
    tangent_x: float
    tangent_y: float
    sign: float  # of the curvature
    along: float  # distance from the left end of a line (m), 0 on an arc
    weight: float  # q and h, see kernels.impact.laws
    response: float
    turning: float  # the derivatives of q and h with respect to n t
    yielding: float
    normal: float  # scratch: the derivative of n t
    kink: int  # 1: it differs on either side of the junction at which the body is


class Changes(NamedTuple):
    """Derivatives of a system and of its motion with respect to numbers.

    Structs are those of the first number, then of the second one ...
    """

    tracks: Sequence[TrackChange]
    """for each number those of body 0 on each piece, then of body 1 ..."""
    weight: FloatMatrix
    """[body, or body + bodies under the next law ..., number]: derivatives of q at a constant n t,
    divided by q, see ``kernels.impact.laws``"""
    response: FloatMatrix
    """likewise of h"""
    radius: FloatMatrix
    """[body, number], m"""
    restitution: FloatMatrix
    """[pair, number]"""
    walls: FloatMatrix
    """[0 left, 1 right, number]: restitution"""
    motion: Sequence[MotionChange]
    """for each number those of each body; at first, of its start"""
    current: IntMatrix
    """[0, body] row of the log with the body's flight; at first, of its start"""
    arrivals: Sequence[Arrival]
    """two, as scratch"""
    flight: Sequence[Flight]
    """one, as scratch"""
    series: FloatMatrix
    """scratch, see ``flight_jacobian``"""
    times: FloatMatrix
    """[impact, number] output: derivatives of the times of impacts, s"""
    one_sided: IntMatrix
    """[0, number] output: 1 + row of the log of a body at a junction at which the curvature jumps,
    if derivatives are different on either side of it; 0 if there is none"""


@kernel
def differentiate_impacts(world: World, events: IntMatrix, changes: Changes, numbers: int) -> None:
    """Fill in the derivatives of the times of impacts of a whole run.

    ``events`` has a row for each event, in order: the rows of the log of its body or of its bodies
    a and b, and the number of the impact; the last two are -1 at a junction or a wall.
    """
    for event in range(len(events)):
        if events[event, 2] < 0:
            _leave(world, events[event, 0], changes, numbers)
        else:
            _collide(world, events, event, changes, numbers)


@kernel
def _carry(world: World, number: int, arrival: Arrival, changes: Changes, numbers: int) -> None:
    """Carry the derivatives of a body to the end of its flight, at a fixed time; set the arrival.

    ``number`` is the row of the log that follows the flight.
    """
    row = world.log[number]
    last = changes.current[0, row.body]
    before = world.log[last]
    track = track_on(world, row.body, before.piece)
    flight = changes.flight[0]
    replay_flight(world, before, last, flight)
    age = time_between(row.t, row.t_low, before.t, before.t_low)
    way_way, way_speed, speed_way, speed_speed = flight_jacobian(flight, age, changes.series)
    scale = _scale(world, row.body, before.piece)
    arrival.piece = before.piece
    arrival.row = number
    arrival.scale = scale
    arrival.speed = track.speed_factor * row.before_p
    arrival.acceleration = acceleration_at(
        flight, track.path_radius, age, row.before_s, row.before_c
    )
    if before.at_rest == 1 and _rest(world, last, changes, numbers):
        arrival.acceleration = 0.0
        return
    begun = track.speed_factor * before.p / scale
    rate = arrival.speed / scale
    pull = arrival.acceleration / scale
    further = rate * age - way_speed * begun
    faster = rate + pull * age - speed_speed * begun
    if track.path_radius == 0.0:
        further = 0.5 * age * age
        faster = age
    for each in range(numbers):
        of_track = _track(world, changes, row.body, before.piece, each)
        motion = _motion(world, changes, row.body, each)
        way = motion.place
        speed = (motion.speed - begun * of_track.path_radius) / scale
        motion.place = way_way * way + way_speed * speed
        motion.place += further * of_track.pace - rate * motion.t
        spin = speed_way * way + speed_speed * speed
        spin += faster * of_track.pace - pull * motion.t
        motion.speed = scale * spin + rate * of_track.path_radius


@kernel
def _rest(world: World, number: int, changes: Changes, numbers: int) -> bool:
    """Carry the derivatives of a body at rest if a wall holds it; return whether one does.

    In equilibrium at a junction a body beside it stays on its side of it.
    """
    row = world.log[number]
    track = track_on(world, row.body, row.piece)
    right = end_at(track, row.s, row.c) > 0
    held = leans(world, row)
    kink = curvature_jump(world, row.body, row.piece, row.s, row.c) != 0.0
    for each in range(numbers):
        of_track = _track(world, changes, row.body, row.piece, each)
        motion = _motion(world, changes, row.body, each)
        end = of_track.right if right else of_track.left
        pull = of_track.pace if track.path_radius == 0.0 else 0.0
        if held:
            motion.place = end
            motion.speed = 0.0
        elif kink and (motion.place != end or motion.speed != 0.0 or pull != 0.0):
            changes.one_sided[0, each] = number + 1
    return held


@kernel
def _track(world: World, changes: Changes, body: int, piece: int, number: int) -> TrackChange:
    settings = world.settings[0]
    return changes.tracks[(number * settings.bodies + body) * settings.pieces + piece]


@kernel
def _motion(world: World, changes: Changes, body: int, number: int) -> MotionChange:
    return changes.motion[number * world.settings[0].bodies + body]


@kernel
def _scale(world: World, body: int, piece: int) -> float:
    """Return the ratio of speed to rate of position: rho (m) on an arc, 1 on a line."""
    radius = track_on(world, body, piece).path_radius
    return radius if radius > 0.0 else 1.0


@kernel
def _leave(world: World, number: int, changes: Changes, numbers: int) -> None:
    """Carry the derivatives of a body past a junction or a wall."""
    row = world.log[number]
    arrival = changes.arrivals[0]
    _carry(world, number, arrival, changes, numbers)
    right = arrival.speed > 0.0
    wall = world.settings[0].right_wall if right else world.settings[0].left_wall
    for each in range(numbers):
        of_track = _track(world, changes, row.body, arrival.piece, each)
        motion = _motion(world, changes, row.body, each)
        motion.t = 0.0  # nothing jumps at a junction, not even the acceleration
        if row.cause == WALL:
            end = of_track.right if right else of_track.left
            motion.t = (end - motion.place) * arrival.scale / arrival.speed
            motion.place = end
            motion.speed += arrival.acceleration * motion.t
            change = changes.walls[1 if right else 0, each]
            motion.speed = -wall * motion.speed - change * arrival.speed
    _begin(world, row.body, number, changes, numbers)


@kernel
def _begin(world: World, body: int, number: int, changes: Changes, numbers: int) -> None:
    """Begin the flight of a row; a body that changes pieces is at their junction."""
    before = world.log[changes.current[0, body]].piece
    row = world.log[number]
    right = end_at(track_on(world, body, row.piece), row.s, row.c) < 0
    ratio = _scale(world, body, before) / _scale(world, body, row.piece)
    changes.current[0, body] = number
    if row.piece == before:
        return
    for each in range(numbers):
        one = _track(world, changes, body, before, each)
        other = _track(world, changes, body, row.piece, each)
        motion = _motion(world, changes, body, each)
        if right:
            motion.place = other.left + (motion.place - one.right) * ratio
        else:
            motion.place = other.right + (motion.place - one.left) * ratio


@kernel
def _arrive(world: World, number: int, impact: int, arrival: Arrival) -> tuple[float, float]:
    """Set the rest of an arrival at an impact; return the position of the body's centre (m)."""
    row = world.log[number]
    piece = world.pieces[arrival.piece]
    arrival.tangent_x, arrival.tangent_y = centre_tangent(piece, row.before_s, row.before_c)
    arrival.sign = piece.sign
    arrival.along = row.before_s if piece.sign == 0.0 else 0.0
    hit = world.impacts[impact]
    body = world.bodies[row.body]
    normal = hit.normal_a if row.body == hit.a else hit.normal_b
    arrival.weight, arrival.response = weight_and_response(hit.law, body, normal)
    arrival.turning = 1.0 if hit.law == NORMAL_IMPULSE else 0.0
    arrival.yielding = arrival.turning / body.rolling_mass
    arrival.kink = 1 if has_kink(world, hit, 0 if row.body == hit.a else 1) else 0
    track = track_on(world, row.body, arrival.piece)
    return centre_position(piece, track, row.before_s, row.before_c)


@kernel
def _collide(world: World, events: IntMatrix, event: int, changes: Changes, numbers: int) -> None:
    """Carry the derivatives of two bodies across their impact."""
    row_a = events[event, 0]
    row_b = events[event, 1]
    impact = events[event, 2]
    row = world.impacts[impact]
    a = changes.arrivals[0]
    b = changes.arrivals[1]
    _carry(world, row_a, a, changes, numbers)
    _carry(world, row_b, b, changes, numbers)
    ax, ay = _arrive(world, row_a, impact, a)
    bx, by = _arrive(world, row_b, impact, b)
    for number in range(numbers):
        _meet(world, impact, changes, number, bx - ax, by - ay)
        _strike(world, impact, changes, number)
    _begin(world, row.a, row_a, changes, numbers)
    _begin(world, row.b, row_b, changes, numbers)


@kernel
def _centre(arrival: Arrival, of_track: TrackChange, place: float) -> tuple[float, float]:
    """Return the derivative of the position of a body's centre."""
    along = arrival.scale * place
    across = arrival.along * of_track.slope - arrival.sign * of_track.path_radius
    return (
        of_track.x + along * arrival.tangent_x - across * arrival.tangent_y,
        of_track.y + along * arrival.tangent_y + across * arrival.tangent_x,
    )


@kernel
def _meet(world: World, impact: int, changes: Changes, number: int, x: float, y: float) -> None:
    """Move the derivatives of two bodies to their impact; set those of its time and of n t.

    ``(x, y)`` (m) leads from the centre of a to that of b.
    """
    row = world.impacts[impact]
    a = changes.arrivals[0]
    b = changes.arrivals[1]
    of_a = _track(world, changes, row.a, a.piece, number)
    of_b = _track(world, changes, row.b, b.piece, number)
    motion_a = _motion(world, changes, row.a, number)
    motion_b = _motion(world, changes, row.b, number)
    distance = world.pairs[row.pair].distance
    nx = x / distance
    ny = y / distance
    ax, ay = _centre(a, of_a, motion_a.place)
    bx, by = _centre(b, of_b, motion_b.place)
    gap = nx * (bx - ax) + ny * (by - ay)
    gap -= changes.radius[row.a, number] + changes.radius[row.b, number]
    delay = gap / (row.normal_a * row.speed_a_pre - row.normal_b * row.speed_b_pre)
    changes.times[impact, number] = delay
    _delay(a, motion_a, delay)
    _delay(b, motion_b, delay)
    _note_kink(world, a, of_a, motion_a, changes, number)
    _note_kink(world, b, of_b, motion_b, changes, number)
    ax, ay = _centre(a, of_a, motion_a.place)
    bx, by = _centre(b, of_b, motion_b.place)
    turned = (nx * (by - ay) - ny * (bx - ax)) / distance
    slope_a = of_a.slope + a.sign * motion_a.place
    slope_b = of_b.slope + b.sign * motion_b.place
    a.normal = (turned - slope_a) * (nx * a.tangent_y - ny * a.tangent_x)
    b.normal = (turned - slope_b) * (nx * b.tangent_y - ny * b.tangent_x)


@kernel
def _delay(arrival: Arrival, motion: MotionChange, delay: float) -> None:
    """Move the derivatives of a body to the time of its impact."""
    motion.t = delay
    motion.place += arrival.speed / arrival.scale * delay
    motion.speed += arrival.acceleration * delay


@kernel
def _note_kink(
    world: World,
    arrival: Arrival,
    of_track: TrackChange,
    motion: MotionChange,
    changes: Changes,
    number: int,
) -> None:
    """Note an impact at a junction that has other derivatives on either side of it."""
    if arrival.kink == 1:
        row = world.log[arrival.row]
        right = end_at(track_on(world, row.body, arrival.piece), row.before_s, row.before_c) > 0
        if motion.place != (of_track.right if right else of_track.left):
            changes.one_sided[0, number] = arrival.row + 1


@kernel
def _strike(world: World, impact: int, changes: Changes, number: int) -> None:
    """Carry the derivatives of the speeds of two bodies across their impact."""
    row = world.impacts[impact]
    a = changes.arrivals[0]
    b = changes.arrivals[1]
    of_a = row.law * world.settings[0].bodies + row.a
    of_b = row.law * world.settings[0].bodies + row.b
    motion_a = _motion(world, changes, row.a, number)
    motion_b = _motion(world, changes, row.b, number)
    weight_a = changes.weight[of_a, number] * a.weight + a.turning * a.normal
    weight_b = changes.weight[of_b, number] * b.weight + b.turning * b.normal
    response_a = changes.response[of_a, number] * a.response + a.yielding * a.normal
    response_b = changes.response[of_b, number] * b.response + b.yielding * b.normal
    k = world.pairs[row.pair].restitution
    inertia = a.weight * a.response + b.weight * b.response
    approach = law_approach(
        row.law, world.bodies[row.a], world.bodies[row.b], row.normal_a, row.normal_b,
        row.speed_a_pre, row.speed_b_pre,
    )  # fmt: skip
    impulse = (1.0 + k) * approach / inertia
    change = weight_a * a.speed + a.weight * motion_a.speed
    change = (1.0 + k) * (change - weight_b * b.speed - b.weight * motion_b.speed)
    change += changes.restitution[row.pair, number] * approach
    change -= impulse * (weight_a * a.response + a.weight * response_a)
    change -= impulse * (weight_b * b.response + b.weight * response_b)
    change /= inertia
    motion_a.speed -= change * a.response + impulse * response_a
    motion_b.speed += change * b.response + impulse * response_b
