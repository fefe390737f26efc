"""Groups of bodies in lasting contact on one piece: their motion, and the forces that end it.

On one arc a group is one pendulum ``(sum kappa_i m_i rho_i^2) f'' = -g A sin(f + delta)``. In its
angle the moment between two neighbours is ``U sin f + V cos f``, and the normal force of each body
has an additional constant, so that their zeros have a closed form. On a line the acceleration and
the forces are constant.
"""

from __future__ import annotations

import math

from vibro_cli.compile.kernel import kernel
from vibro_cli.kernels.cluster.trace_forces import UNEQUAL, normal_force_now
from vibro_cli.kernels.contact.contact_kinematics import centres_along_path
from vibro_cli.kernels.flow.flight import (
    LIFT_OFF,
    choose_exit,
    clear,
    energy_of_state,
    is_at,
    launch_on_line,
    passing_rate,
    set_exit_time,
    snap_of_pendulum,
    start_from_state,
)
from vibro_cli.kernels.flow.flow import body_of_group, group_of_body, time_of_flight
from vibro_cli.kernels.impact.impulse_chain import (
    contact_forces,
    keep_release,
    set_speeds_and_normals,
)
from vibro_cli.kernels.numerics.constants import NEVER
from vibro_cli.kernels.numerics.elliptic import angle_sum, set_theta_constants, twice_angle
from vibro_cli.kernels.world import (
    Flight,
    TrackData,
    World,
    contact_of,
    flight_along,
    number_along,
    pair_along,
    track_of,
)

# A negative normal force below this share of its terms is zero up to rounding.
FORCE_ROUNDING = 1.0e-14


@kernel
def half_of(cosine: float, sine: float) -> tuple[float, float]:
    """Return the sine and cosine of half an angle in (-pi, pi)."""
    if cosine >= 0.0:
        c = math.sqrt(0.5 * (1.0 + cosine))
        return 0.5 * sine / c, c
    s = math.sqrt(0.5 * (1.0 - cosine))
    if sine < 0.0:
        s = -s
    return s, 0.5 * sine / s


@kernel
def moments_of_body(world: World, ball: int) -> tuple[float, float, float, float]:
    """Return ``kappa m rho^2`` (kg m^2) of a body, that times its rate, ``m g rho (cos, sin)``.

    The angle is that by which the body leads its group; ``shift_s, shift_c`` are for half of it.
    """
    flight = world.flights[ball]
    track = track_of(world, ball)
    rho = track.path_radius
    inertia = world.bodies[ball].rolling_mass * rho * rho
    moment = world.bodies[ball].weight * rho
    sine, cosine = twice_angle(flight.shift_s, flight.shift_c)
    momentum = inertia * (2.0 * track.frequency * flight.p)
    return inertia, momentum, moment * cosine, moment * sine


@kernel
def force_coefficients(
    world: World, first: int, count: int, bodies_left: int
) -> tuple[float, float]:
    """Return ``(U, V)`` of the moment ``U sin f + V cos f`` between the first bodies and the rest.

    It follows from the balance of the first ``bodies_left`` bodies of a group, and from that of the
    others (see :func:`share_of_left`); f is the angle of the group's pendulum.
    """
    left_u, left_v, most_left = _balance(world, first, 0, bodies_left)
    right_u, right_v, most_right = _balance(world, first, bodies_left, count)
    share = share_of_left(most_left, most_right)
    rest = 1.0 - share
    return share * left_u - rest * right_u, share * left_v - rest * right_v


@kernel
def share_of_left(left: float, right: float) -> float:
    """Return the share of the balance of a group's first bodies in the moment between both sides.

    ``left`` and ``right`` are the greatest inertias (kg m^2) of their bodies. A balance is a
    difference of moments as large as these: beside a heavy body nothing would be left of the moment
    on a light one. The moment is the mean of both balances if both sides are alike.
    """
    if left > UNEQUAL * right:
        return 0.0
    return 1.0 if right > UNEQUAL * left else 0.5


@kernel
def _balance(world: World, first: int, start: int, end: int) -> tuple[float, float, float]:
    """Return ``(U, V)`` of the moment that some bodies of a group need besides their weight.

    The sum runs from the end of the group inwards. The greatest inertia (kg m^2) is returned too.
    """
    u = 0.0
    v = 0.0
    most = 0.0
    for number in range(end - start):
        step = number if start == 0 else end - 1 - number
        ball = number_along(world, first, step)
        inertia, _, x, y = moments_of_body(world, ball)
        u += inertia * world.flights[ball].frequency * world.flights[ball].frequency - x
        v -= y
        most = max(most, inertia)
    return u, v, most


@kernel
def set_release(world: World, first: int, count: int, bodies_left: int) -> None:
    """Set the time when the force between a group's first bodies and the rest turns negative."""
    flight = world.flights[first]
    pair = pair_along(world, first, bodies_left - 1)
    u, v = force_coefficients(world, first, count, bodies_left)
    size = math.sqrt(u * u + v * v)
    if size == 0.0 or flight.at_rest == 1:
        keep_release(flight, pair, NEVER)
        return
    # Zeros of U sin f + V cos f: sin f = -+ V/size, cos f = +- U/size.
    after = NEVER
    for turn in range(2):
        sign = 1.0 if turn == 0 else -1.0
        c2 = 0.5 * (1.0 + sign * u / size)
        s2 = 0.5 * (1.0 - sign * u / size)
        c = math.sqrt(max(c2, 0.0))
        s = math.sqrt(max(s2, 0.0))
        if -sign * v < 0.0:
            s = -s
        after = min(after, _release_at(flight, s, c, sign * size))
        after = min(after, _release_at(flight, -s, -c, sign * size))
    keep_release(flight, pair, after)


@kernel
def _release_at(flight: Flight, s: float, c: float, slope: float) -> float:
    """Return the time (s) until a group passes a zero of the force while it falls, or NEVER.

    ``slope`` is the derivative of the moment with respect to the angle at the zero ``(s, c)``.
    """
    p = passing_rate(flight, s, c, -slope)
    return time_of_flight(flight, s, c, p) if p != 0.0 else NEVER


@kernel
def limit_by_lift_off(world: World, first: int, count: int) -> None:
    """End the flights of a group on an arc where a one-sided trace would have to pull a body."""
    for step in range(count):
        ball = number_along(world, first, step)
        flight = world.flights[ball]
        a, b, c = _normal_force(world, first, count, step)
        after = _first_negative(flight, a, b, c)
        if after < flight.exit_after:
            flight.exit_kind = LIFT_OFF
            flight.exit_after = after


@kernel
def _normal_force(world: World, first: int, count: int, step: int) -> tuple[float, float, float]:
    """Return ``(A, B, C)`` of the normal force ``A + B cos f + C sin f`` (N) of a member."""
    ball = number_along(world, first, step)
    flight = world.flights[ball]
    sign = world.pieces[flight.piece].sign
    rho = track_of(world, ball).path_radius
    _, _, x, y = moments_of_body(world, ball)
    # m v^2/rho = m rho w^2 (4 m - 2 + 2 cos f)
    central = world.bodies[ball].mass * rho * flight.frequency * flight.frequency
    a = sign * central * (4.0 * flight.parameter - 2.0)
    b = sign * (2.0 * central + x / rho)
    c = -sign * y / rho
    if step > 0:
        lever = lever_of(world, number_along(world, first, step - 1), ball)
        u, v = force_coefficients(world, first, count, step)
        b -= v * lever
        c -= u * lever
    if step < count - 1:
        lever = lever_of(world, ball, ball)
        u, v = force_coefficients(world, first, count, step + 1)
        b += v * lever
        c += u * lever
    return a, b, c


@kernel
def limit_on_line(world: World, first: int, count: int) -> None:
    """End a member's flight on a line at once if a one-sided trace would have to pull it."""
    set_speeds_and_normals(world, first, count - 1)
    contact_forces(world, first, count - 1)
    for step in range(count):
        flight = flight_along(world, first, step)
        weight = world.bodies[number_along(world, first, step)].weight
        if normal_force_now(world, first, count, step) < -FORCE_ROUNDING * weight:
            flight.exit_kind = LIFT_OFF
            flight.exit_after = 0.0


@kernel
def lever_of(world: World, j: int, ball: int) -> float:
    """Return the force (N) of a contact normal to a body's path, per newton metre of the moment."""
    along, across = centres_along_path(world, j, ball)
    return across / (along * track_of(world, ball).path_radius)


@kernel
def _first_negative(flight: Flight, a: float, b: float, c: float) -> float:
    """Return the time (s) when ``a + b cos f + c sin f`` turns negative on a flight, or NEVER."""
    size = math.sqrt(b * b + c * c)
    s = flight.flow_s
    k = flight.flow_c
    now = a + b * ((k - s) * (k + s)) + c * (2.0 * s * k)
    if now < -FORCE_ROUNDING * (abs(a) + size):
        return 0.0
    if size <= abs(a) or flight.at_rest == 1:
        return NEVER
    # Positive around the angle of (b, c), up to the angle with this cosine on both sides.
    cosine = -a / size
    sine = math.sqrt((1.0 - cosine) * (1.0 + cosine))
    after = NEVER
    for turn in range(2):
        side = 1.0 if turn == 0 else -1.0
        zero_cosine = (b * cosine - side * c * sine) / size
        zero_sine = (c * cosine + side * b * sine) / size
        zero_s, zero_c = half_of(zero_cosine, zero_sine)
        after = min(after, _release_at(flight, zero_s, zero_c, -side))
        after = min(after, _release_at(flight, -zero_s, -zero_c, -side))
    return after


@kernel
def launch_group(world: World, first: int, count: int) -> None:
    """Launch ``count`` bodies in contact on one piece or lines in a row, from ``first`` on."""
    piece = world.flights[first].piece
    if world.pieces[piece].sign == 0.0:
        launch_group_on_line(world, first, count)
    else:
        _launch_on_arc(world, first, count)
    for step in range(count):
        set_exit_time(flight_along(world, first, step))


@kernel
def begin_member(flight: Flight, track: TrackData) -> None:
    """Clear a flight of its earlier motion, before the body joined a group."""
    clear(flight, track, 1)
    flight.separatrix_piece = -1
    flight.saddle_root = NEVER


@kernel
def begin_on_line(flight: Flight, track: TrackData, speed: float) -> None:
    """Begin a flight of a group on a line at the common speed (m/s)."""
    begin_member(flight, track)
    flight.p = speed
    start_from_state(flight)


@kernel
def launch_group_on_line(world: World, first: int, count: int) -> None:
    """Launch a group on a line: ``v' = -g sin(alpha) sum m/sum kappa m``."""
    settings = world.settings[0]
    weight = 0.0
    inertia = 0.0
    momentum = 0.0
    for step in range(count):
        ball = number_along(world, first, step)
        body = world.bodies[ball]
        weight += body.weight
        inertia += body.rolling_mass
        momentum += body.rolling_mass * world.flights[ball].p
    for step in range(count):
        ball = number_along(world, first, step)
        flight = world.flights[ball]
        track = track_of(world, ball)
        begin_on_line(flight, track, momentum / inertia)
        flight.line_acceleration = -track.line_rise * weight / inertia
        launch_on_line(flight, track.left_s, track.right_s)
        if step < count - 1:
            world.pairs[ball].release_t = NEVER
    if settings.one_sided == 1:
        limit_on_line(world, first, count)


@kernel
def _launch_on_arc(world: World, first: int, count: int) -> None:
    settings = world.settings[0]
    middle_s, middle_c = _set_offsets(world, first, count)
    inertia, momentum, x, y = _moments(world, first, count)
    torque = math.sqrt(x * x + y * y)
    frequency = math.sqrt(torque / inertia)
    lead_s, lead_c = half_of(x / torque, y / torque)
    flow_s, flow_c = angle_sum(middle_s, middle_c, lead_s, lead_c)
    flow_p = momentum / inertia / (2.0 * frequency)
    for step in range(count):
        ball = number_along(world, first, step)
        flight = world.flights[ball]
        track = track_of(world, ball)
        begin_member(flight, track)
        flight.flow_s = flow_s
        flight.flow_c = flow_c
        flight.flow_p = flow_p
        flight.frequency = frequency
        flight.shift_s, flight.shift_c = angle_sum(flight.shift_s, flight.shift_c, -lead_s, lead_c)
        flight.rate_ratio = frequency / track.frequency
    for step in range(count):
        set_group_flow(world, first, count, number_along(world, first, step))
    for step in range(count - 1):
        set_release(world, first, count, step + 1)
    if settings.one_sided == 1:
        limit_by_lift_off(world, first, count)


@kernel
def _set_offsets(world: World, first: int, count: int) -> tuple[float, float]:
    """Set ``shift_s, shift_c`` of each body to half its angle from the middle of the group.

    The middle is the middle body or, for an even number, between the two middle bodies, so that
    mirror images are treated alike. Return its ``(S, C)``.
    """
    left = (count - 1) // 2
    right = count // 2
    ball = number_along(world, first, left)
    s = 0.0
    c = 1.0
    if left < right:
        contact = contact_of(world, ball)
        s, c = half_of(contact.cosine, contact.sine)
    _set_shift(world, ball, -s, c)
    _set_shift(world, number_along(world, first, right), s, c)
    left_s, left_c = s, c
    right_s, right_c = s, c
    for step in range(left):
        ball = number_along(world, first, right + step)
        contact = contact_of(world, ball)
        right_s, right_c = angle_sum(right_s, right_c, contact.sine, contact.cosine)
        _set_shift(world, number_along(world, ball, 1), right_s, right_c)
        ball = number_along(world, first, left - step - 1)
        contact = contact_of(world, ball)
        left_s, left_c = angle_sum(left_s, left_c, contact.sine, contact.cosine)
        _set_shift(world, ball, -left_s, left_c)
    one = flight_along(world, first, left)
    other = flight_along(world, first, right)
    one_s, one_c = angle_sum(one.s, one.c, -one.shift_s, one.shift_c)
    other_s, other_c = angle_sum(other.s, other.c, -other.shift_s, other.shift_c)
    s = 0.5 * (one_s + other_s)
    c = 0.5 * (one_c + other_c)
    scale = 1.5 - 0.5 * (s * s + c * c)
    return s * scale, c * scale


@kernel
def _set_shift(world: World, ball: int, s: float, c: float) -> None:
    world.flights[ball].shift_s = s
    world.flights[ball].shift_c = c


@kernel
def _moments(world: World, first: int, count: int) -> tuple[float, float, float, float]:
    """Return ``sum kappa m rho^2`` (kg m^2), that times the rate, ``sum m g rho (cos, sin)``.

    The angles are those from the middle of the group; bodies are summed in pairs from its ends.
    """
    inertia = 0.0
    momentum = 0.0
    x = 0.0
    y = 0.0
    for step in range((count + 1) // 2):
        left_i, left_l, left_x, left_y = moments_of_body(world, number_along(world, first, step))
        other = number_along(world, first, count - 1 - step)
        if 2 * step == count - 1:
            return inertia + left_i, momentum + left_l, x + left_x, y + left_y
        right_i, right_l, right_x, right_y = moments_of_body(world, other)
        inertia += left_i + right_i
        momentum += left_l + right_l
        x += left_x + right_x
        y += left_y + right_y
    return inertia, momentum, x, y


@kernel
def set_group_flow(world: World, first: int, count: int, ball: int) -> None:
    """Set the constants, exit and bounds of a member of a group on an arc."""
    flight = world.flights[ball]
    track = track_of(world, ball)
    member_s, member_c, member_p = body_of_group(
        flight, flight.flow_s, flight.flow_c, flight.flow_p
    )
    at_left = is_at(member_s, member_c, track.left_s, track.left_c)
    at_right = is_at(member_s, member_c, track.right_s, track.right_c)
    flight.s = member_s
    flight.c = member_c
    flight.p = member_p
    m, root = energy_of_state(flight.flow_s, flight.flow_c, flight.flow_p)
    set_theta_constants(flight, m, root)
    if flight.flow_p == 0.0 and (flight.flow_s == 0.0 or flight.flow_c == 0.0):
        flight.at_rest = 1
    left_s, left_c = group_of_body(flight, track.left_s, track.left_c)
    right_s, right_c = group_of_body(flight, track.right_s, track.right_c)
    if at_left:
        left_s = flight.flow_s
        left_c = flight.flow_c
    if at_right:
        right_s = flight.flow_s
        right_c = flight.flow_c
    choose_exit(flight, left_s, left_c, right_s, right_c)
    flight.exit_p *= flight.rate_ratio
    w2 = flight.frequency * flight.frequency
    flight.angular_bound = w2
    flight.jerk_bound = 2.0 * w2 * flight.frequency * math.sqrt(flight.parameter)
    flight.snap_bound = snap_of_pendulum(w2, flight.parameter)
    tangential = track.path_radius * w2
    central = 4.0 * track.path_radius * w2 * flight.parameter
    flight.acceleration_bound = math.sqrt(tangential * tangential + central * central)
