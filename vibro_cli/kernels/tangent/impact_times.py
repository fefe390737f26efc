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
from vibro_cli.kernels.impact.laws import NORMAL_IMPULSE, law_approach, weight_and_response
from vibro_cli.kernels.tangent.flight_jacobian import Arrival
from vibro_cli.kernels.world import WALL, World, track_on


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
class StruckBody:
    """One body at an impact."""

    piece: int  # before the impact
    tangent_x: float
    tangent_y: float
    sign: float  # of the curvature
    scale: float  # rho (m) on an arc, 1 on a line
    along: float  # distance from the left end of a line (m), 0 on an arc
    speed: float  # before the impact, m/s
    acceleration: float
    weight: float  # q and h, see kernels.impact.laws
    response: float
    turning: float  # the derivatives of q and h with respect to n t
    yielding: float
    normal: float  # scratch: the derivative of n t


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
    struck: Sequence[StruckBody]
    """two, as scratch"""
    times: FloatMatrix
    """[impact, number] output: derivatives of the times of impacts, s"""


@kernel
def differentiate_impacts(
    world: World, arrivals: Sequence[Arrival], events: IntMatrix, changes: Changes, numbers: int
) -> None:
    """Fill in the derivatives of the times of impacts of a whole run.

    ``events`` has a row for each event, in order: the rows of the log of its body or of its bodies
    a and b, and the number of the impact; the last two are -1 at a junction or a wall.
    """
    for event in range(len(events)):
        if events[event, 2] < 0:
            _leave(world, arrivals[events[event, 0]], events[event, 0], changes, numbers)
        else:
            _collide(world, arrivals, events, event, changes, numbers)


@kernel
def _carry(world: World, arrival: Arrival, body: int, changes: Changes, numbers: int) -> None:
    """Carry the derivatives of a body to the end of its flight, at a fixed time."""
    before = world.log[changes.current[0, body]]
    track = track_on(world, body, before.piece)
    scale = _scale(world, body, before.piece)
    begun = track.speed_factor * before.p / scale
    rate = arrival.speed / scale
    pull = arrival.acceleration / scale
    further = rate * arrival.age - arrival.way_speed * begun
    faster = rate + pull * arrival.age - arrival.speed_speed * begun
    if track.path_radius == 0.0:
        further = 0.5 * arrival.age * arrival.age
        faster = arrival.age
    for number in range(numbers):
        of_track = _track(world, changes, body, before.piece, number)
        motion = _motion(world, changes, body, number)
        way = motion.place
        speed = (motion.speed - begun * of_track.path_radius) / scale
        motion.place = arrival.way_way * way + arrival.way_speed * speed
        motion.place += further * of_track.pace - rate * motion.t
        spin = arrival.speed_way * way + arrival.speed_speed * speed
        spin += faster * of_track.pace - pull * motion.t
        motion.speed = scale * spin + rate * of_track.path_radius


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
def _leave(world: World, arrival: Arrival, number: int, changes: Changes, numbers: int) -> None:
    """Carry the derivatives of a body past a junction or a wall."""
    row = world.log[number]
    piece = world.log[changes.current[0, row.body]].piece
    right = arrival.speed > 0.0
    wall = world.settings[0].right_wall if right else world.settings[0].left_wall
    _carry(world, arrival, row.body, changes, numbers)
    for each in range(numbers):
        of_track = _track(world, changes, row.body, piece, each)
        motion = _motion(world, changes, row.body, each)
        end = of_track.right if right else of_track.left
        motion.t = (end - motion.place) * _scale(world, row.body, piece) / arrival.speed
        motion.place = end
        motion.speed += arrival.acceleration * motion.t
        if row.cause == WALL:
            change = changes.walls[1 if right else 0, each]
            motion.speed = -wall * motion.speed - change * arrival.speed
    _begin(world, row.body, number, changes, numbers)


@kernel
def _begin(world: World, body: int, number: int, changes: Changes, numbers: int) -> None:
    """Begin the flight of a row; a body that changes pieces is at their junction."""
    before = world.log[changes.current[0, body]].piece
    row = world.log[number]
    right = row.piece == (before + 1) % world.settings[0].pieces and row.p > 0.0
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
def _arrive(
    world: World, arrival: Arrival, number: int, impact: int, struck: StruckBody, changes: Changes
) -> tuple[float, float]:
    """Set one of the bodies of an impact; return the position of its centre (m)."""
    row = world.log[number]
    struck.piece = world.log[changes.current[0, row.body]].piece
    piece = world.pieces[struck.piece]
    struck.tangent_x, struck.tangent_y = centre_tangent(piece, row.before_s, row.before_c)
    struck.sign = piece.sign
    struck.scale = _scale(world, row.body, struck.piece)
    struck.along = row.before_s if piece.sign == 0.0 else 0.0
    struck.speed = arrival.speed
    struck.acceleration = arrival.acceleration
    hit = world.impacts[impact]
    body = world.bodies[row.body]
    normal = hit.normal_a if row.body == hit.a else hit.normal_b
    struck.weight, struck.response = weight_and_response(hit.law, body, normal)
    struck.turning = 1.0 if hit.law == NORMAL_IMPULSE else 0.0
    struck.yielding = struck.turning / body.rolling_mass
    track = track_on(world, row.body, struck.piece)
    return centre_position(piece, track, row.before_s, row.before_c)


@kernel
def _collide(
    world: World,
    arrivals: Sequence[Arrival],
    events: IntMatrix,
    event: int,
    changes: Changes,
    numbers: int,
) -> None:
    """Carry the derivatives of two bodies across their impact."""
    row_a = events[event, 0]
    row_b = events[event, 1]
    impact = events[event, 2]
    row = world.impacts[impact]
    a = changes.struck[0]
    b = changes.struck[1]
    _carry(world, arrivals[row_a], row.a, changes, numbers)
    _carry(world, arrivals[row_b], row.b, changes, numbers)
    ax, ay = _arrive(world, arrivals[row_a], row_a, impact, a, changes)
    bx, by = _arrive(world, arrivals[row_b], row_b, impact, b, changes)
    for number in range(numbers):
        _meet(world, impact, changes, number, bx - ax, by - ay)
        _strike(world, impact, changes, number)
    _begin(world, row.a, row_a, changes, numbers)
    _begin(world, row.b, row_b, changes, numbers)


@kernel
def _centre(struck: StruckBody, of_track: TrackChange, place: float) -> tuple[float, float]:
    """Return the derivative of the position of a body's centre."""
    along = struck.scale * place
    across = struck.along * of_track.slope - struck.sign * of_track.path_radius
    return (
        of_track.x + along * struck.tangent_x - across * struck.tangent_y,
        of_track.y + along * struck.tangent_y + across * struck.tangent_x,
    )


@kernel
def _meet(world: World, impact: int, changes: Changes, number: int, x: float, y: float) -> None:
    """Move the derivatives of two bodies to their impact; set those of its time and of n t.

    ``(x, y)`` (m) leads from the centre of a to that of b.
    """
    row = world.impacts[impact]
    a = changes.struck[0]
    b = changes.struck[1]
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
    ax, ay = _centre(a, of_a, motion_a.place)
    bx, by = _centre(b, of_b, motion_b.place)
    turned = (nx * (by - ay) - ny * (bx - ax)) / distance
    slope_a = of_a.slope + a.sign * motion_a.place
    slope_b = of_b.slope + b.sign * motion_b.place
    a.normal = (turned - slope_a) * (nx * a.tangent_y - ny * a.tangent_x)
    b.normal = (turned - slope_b) * (nx * b.tangent_y - ny * b.tangent_x)


@kernel
def _delay(struck: StruckBody, motion: MotionChange, delay: float) -> None:
    """Move the derivatives of a body to the time of its impact."""
    motion.t = delay
    motion.place += struck.speed / struck.scale * delay
    motion.speed += struck.acceleration * delay


@kernel
def _strike(world: World, impact: int, changes: Changes, number: int) -> None:
    """Carry the derivatives of the speeds of two bodies across their impact."""
    row = world.impacts[impact]
    a = changes.struck[0]
    b = changes.struck[1]
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
