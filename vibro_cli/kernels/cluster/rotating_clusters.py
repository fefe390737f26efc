"""Groups in lasting contact on one piece of a rotating trace, in closed form, and their forces.

On an arc the common angle of the bodies obeys ``f'' = w^2 (-sin f + tilt cos f + spread sin f cos f
+ twist cos 2f)``. ``w`` and the origin of f are those of a trace at rest, the tilt that of each
body alone, and ``(spread, 2 twist) = sum m (Omega rho)^2 (cos 2 delta, sin 2 delta)/torque`` with
the angles delta by which the bodies lead. So this is again a motion under a quartic, and forces
between neighbours and of the trace are trigonometric polynomials of degree 2. On a line the motion
is a sum of cosh and sinh, and the forces are linear in the position. Forces are functions of the
angle, or the distance, from the start of the motion. These kernels override those of
``kernels.cluster.clusters`` and ``kernels.cluster.trace_forces``.
"""

from __future__ import annotations

import math

from vibro_cli.compile.kernel import Series, kernel
from vibro_cli.kernels.cluster.clusters import (
    FORCE_ROUNDING,
    begin_on_line,
    lever_of,
    moments_of_body,
    share_of_left,
)
from vibro_cli.kernels.cluster.trace_forces import (
    AT_WAY,
    HALF_COSINES,
    HALF_SINES,
    bodies_of,
    set_forces,
)
from vibro_cli.kernels.contact.contact_kinematics import centres_along_path
from vibro_cli.kernels.flow.flight import LIFT_OFF, half_way_to, is_at
from vibro_cli.kernels.flow.flow import (
    POLYNOMIAL,
    angle_from_start,
    body_of_group,
    group_of_body,
    place_from_start,
    replay_flight,
)
from vibro_cli.kernels.flow.rotating_flight import (
    first_negative,
    harmonics_from_start,
    launch_on_line,
    normal_harmonics_of_one,
    reach,
    square_harmonics,
    torque_harmonics,
    zero_crossing_on_line,
)
from vibro_cli.kernels.flow.rotating_flow import (
    TURNING_LINE,
    half_way,
    heading,
    set_motion,
    time_of_flight,
    torque_of,
)
from vibro_cli.kernels.impact.impulse_chain import keep_release
from vibro_cli.kernels.numerics.conservative_advancement import (
    Harmonics,
    combined,
    harmonic_size,
    harmonic_value,
    least_value,
    scaled,
    turned,
)
from vibro_cli.kernels.numerics.constants import NEVER
from vibro_cli.kernels.numerics.elliptic import twice_angle
from vibro_cli.kernels.numerics.weierstrass_motion import squared_rate
from vibro_cli.kernels.world import (
    BodyForces,
    Flight,
    TrackData,
    World,
    flight_along,
    number_along,
    pair_along,
    track_of,
    track_on,
)


@kernel
def set_group_flow(world: World, first: int, count: int, ball: int) -> None:
    """Set the constants, exit and bounds of a member of a group on an arc, as in ``clusters``."""
    settings = world.settings[0]
    flight = world.flights[ball]
    track = track_of(world, ball)
    flight.tilt = track.tilt
    torque = 0.0
    along = 0.0
    across = 0.0
    for step in range(count):
        member = number_along(world, first, step)
        _, _, x, _ = moments_of_body(world, member)
        lead = world.flights[member]
        sine, cosine = twice_angle(lead.shift_s, lead.shift_c)
        torque += x
        rho = track_of(world, member).path_radius
        strength = world.bodies[member].mass * settings.turning_square * rho * rho
        double_sine, double_cosine = twice_angle(sine, cosine)
        along += strength * double_cosine
        across += strength * double_sine
    flight.spread = along / torque
    flight.twist = 0.5 * across / torque
    set_group_motion(flight)
    flight.s, flight.c, flight.p = body_of_group(
        flight, flight.flow_s, flight.flow_c, flight.flow_p
    )
    if heading(flight) == 0.0:
        flight.at_rest = 1
    _set_bounds(flight, track)
    # Constants of the motion that are logged in the member's row.
    flight.segment = NEVER
    flight.series[0] = flight.spread
    flight.series[1] = flight.twist
    if flight.at_rest == 0:
        _choose_exit(flight, track)


@kernel
def set_group_motion(flight: Flight) -> None:
    """Set the constants of a group's motion on an arc from its initial state."""
    square = square_harmonics(flight)
    moves = flight.flow_p != 0.0
    flight.turns_over = 1 if moves and least_value(square, 2.0 * math.pi) > 0.0 else 0
    set_motion(flight)


@kernel
def _set_bounds(flight: Flight, track: TrackData) -> None:
    w = flight.frequency
    first = math.sqrt(1.0 + flight.tilt * flight.tilt)
    second = math.sqrt(0.25 * flight.spread * flight.spread + flight.twist * flight.twist)
    square = square_harmonics(flight)
    most_rate = 2.0 * w * math.sqrt(harmonic_size(square))
    flight.angular_bound = w * w * (first + second)
    flight.jerk_bound = w * w * (first + 2.0 * second) * most_rate
    flight.snap_bound = w * w * (first + 4.0 * second) * most_rate * most_rate
    flight.snap_bound += w * w * (first + 2.0 * second) * flight.angular_bound
    flight.most_speed = track.path_radius * most_rate
    along = track.path_radius * flight.angular_bound
    central = track.path_radius * most_rate * most_rate
    flight.acceleration_bound = math.sqrt(along * along + central * central)


@kernel
def _choose_exit(flight: Flight, track: TrackData) -> None:
    """Set the end at which a member leaves its piece, and the time."""
    forward = heading(flight)
    for turn in range(2):
        right = (forward > 0.0) == (turn == 0)
        side = 1.0 if right else -1.0
        end_s = track.right_s if right else track.left_s
        end_c = track.right_c if right else track.left_c
        sine = 0.0
        cosine = 1.0
        if not is_at(flight.s, flight.c, end_s, end_c):
            s, c = group_of_body(flight, end_s, end_c)
            sine, cosine = angle_from_start(flight, s, c)
        half = half_way_to(side * math.atan2(sine, cosine))
        if turn == 0 and half <= 0.0:
            _leave(flight, side, flight.flow_p, 0.0)
            return
        squared = squared_rate(flight, sine, cosine)
        # The quartic gives a slow rate to all digits, and so decides where the group turns back.
        if squared > 0.0 and (flight.turns_over == 1 or half_way(flight, side) >= half):
            p = side * math.sqrt(squared)
            s, c = place_from_start(flight, sine, cosine)
            after = time_of_flight(flight, s, c, p)
            if after < NEVER:
                _leave(flight, side, p, after)
                return


@kernel
def _leave(flight: Flight, side: float, p: float, after: float) -> None:
    flight.exit_side = 1 if side > 0.0 else -1
    flight.exit_p = p * flight.rate_ratio
    flight.exit_after = after


@kernel
def _drive(world: World, first: int, start: int, end: int) -> tuple[Harmonics, float]:
    """Return the moment (N m) on some bodies of a group, less that needed for their motion.

    The greatest inertia (kg m^2) is returned too.
    """
    most = 0.0
    flight = world.flights[first]
    w2 = flight.frequency * flight.frequency
    group = 0.0, flight.tilt, -1.0, flight.twist, 0.5 * flight.spread
    total = 0.0, 0.0, 0.0, 0.0, 0.0
    for step in range(start, end):
        ball = number_along(world, first, step)
        track = track_of(world, ball)
        inertia, _, _, _ = moments_of_body(world, ball)
        lead = world.flights[ball]
        sine, cosine = twice_angle(lead.shift_s, lead.shift_c)
        own = turned((0.0, track.tilt, -1.0, 0.0, 0.5 * track.spread), sine, cosine)
        total = combined(total, world.bodies[ball].weight * track.path_radius, own)
        total = combined(total, -inertia * w2, group)
        most = max(most, inertia)
    return total, most


@kernel
def moment_between(world: World, first: int, count: int, bodies_left: int) -> Harmonics:
    """Return the moment (N m) of a group's first bodies on the rest, in the group's angle."""
    left, most_left = _drive(world, first, 0, bodies_left)
    right, most_right = _drive(world, first, bodies_left, count)
    share = share_of_left(most_left, most_right)
    return combined(scaled(share, left), share - 1.0, right)


@kernel
def set_release(world: World, first: int, count: int, bodies_left: int) -> None:
    """Set the time at which the force between a group's first bodies and the rest falls to zero."""
    flight = world.flights[first]
    pair = pair_along(world, first, bodies_left - 1)
    if flight.at_rest == 1:
        keep_release(flight, pair, NEVER)
        return
    h = harmonics_from_start(flight, moment_between(world, first, count, bodies_left))
    left, right = _group_ways(world, first, count)
    keep_release(flight, pair, first_negative(flight, h, left, right))


@kernel
def _group_ways(world: World, first: int, count: int) -> tuple[float, float]:
    """Return the angles (rad) that a group can move to both sides until a body leaves its piece."""
    left = math.inf
    right = math.inf
    for step in range(count):
        ball = number_along(world, first, step)
        flight = world.flights[ball]
        track = track_of(world, ball)
        s, c = group_of_body(flight, track.left_s, track.left_c)
        left = min(left, reach(flight, -1.0, s, c))
        s, c = group_of_body(flight, track.right_s, track.right_c)
        right = min(right, reach(flight, 1.0, s, c))
    return left, right


@kernel
def limit_by_lift_off(world: World, first: int, count: int) -> None:
    """End the flights of a group on an arc where a one-sided trace would have to pull a body."""
    left, right = _group_ways(world, first, count)
    for step in range(count):
        flight = flight_along(world, first, step)
        h = harmonics_from_start(flight, normal_harmonics(world, first, count, step))
        after = NEVER
        if harmonic_value(h, 0.0, 1.0) < -FORCE_ROUNDING * harmonic_size(h):
            after = 0.0
        elif flight.at_rest == 0:
            after = first_negative(flight, h, left, right)
        if after < flight.exit_after:
            flight.exit_kind = LIFT_OFF
            flight.exit_after = after


@kernel
def normal_harmonics(world: World, first: int, count: int, step: int) -> Harmonics:
    """Return the normal force (N) of a member as a function of the group's angle."""
    ball = number_along(world, first, step)
    flight = world.flights[ball]
    track = track_of(world, ball)
    body = world.bodies[ball]
    sine, cosine = twice_angle(flight.shift_s, flight.shift_c)
    own = turned((0.5 * track.spread, 1.0, track.tilt, -0.5 * track.spread, 0.0), sine, cosine)
    # P^2 as a function of the group's angle, from that of the angle from the start.
    sine, cosine = twice_angle(flight.flow_s, flight.flow_c)
    square = turned(square_harmonics(flight), -sine, cosine)
    central = 4.0 * body.mass * track.path_radius * flight.frequency * flight.frequency
    sign = world.pieces[flight.piece].sign
    h = combined(scaled(sign * body.weight, own), sign * central, square)
    if step > 0:
        part = lever_of(world, number_along(world, first, step - 1), ball)
        h = combined(h, -part, moment_between(world, first, count, step))
    if step < count - 1:
        h = combined(h, lever_of(world, ball, ball), moment_between(world, first, count, step + 1))
    return h


@kernel
def launch_group_on_line(world: World, first: int, count: int) -> None:
    """Launch a group on a line: ``v' = a + b^2 x``, means of the bodies weighted by ``kappa m``."""
    settings = world.settings[0]
    inertia = 0.0
    force = 0.0
    growth = 0.0
    momentum = 0.0
    for step in range(count):
        ball = number_along(world, first, step)
        own, own_growth = _alone_on_line(world, ball)
        mass = world.bodies[ball].rolling_mass
        inertia += mass
        force += mass * own
        growth += mass * own_growth
        momentum += mass * world.flights[ball].p
    for step in range(count):
        ball = number_along(world, first, step)
        flight = world.flights[ball]
        track = track_of(world, ball)
        begin_on_line(flight, track, momentum / inertia)
        flight.rate_ratio = 1.0
        flight.frequency = 0.0
        flight.form = TURNING_LINE
        flight.line_acceleration = force / inertia
        flight.line_growth = math.sqrt(growth / inertia)
        launch_on_line(flight, track)
        flight.segment = NEVER
        flight.series[0] = flight.line_growth
    leader = world.flights[first]
    for step in range(count - 1):
        push, push_growth = _push_on_line(world, first, step)
        after = zero_crossing_on_line(leader, push, push_growth)
        keep_release(leader, pair_along(world, first, step), after)
    if settings.one_sided == 1:
        for step in range(count):
            _limit_on_line(world, first, count, step)


@kernel
def _alone_on_line(world: World, ball: int) -> tuple[float, float]:
    """Return the acceleration (m/s^2) of a body alone on a line, and its gradient (1/s^2)."""
    flight = world.flights[ball]
    track = track_of(world, ball)
    square = track.line_growth * track.line_growth
    return track.line_acceleration + square * flight.s, square


@kernel
def _push_on_line(world: World, first: int, step: int) -> tuple[float, float]:
    """Return the force (N) along a line of the first bodies on the rest, and its gradient (N/m)."""
    flight = world.flights[first]
    force = 0.0
    growth = 0.0
    for before in range(step + 1):
        ball = number_along(world, first, before)
        own, own_growth = _alone_on_line(world, ball)
        mass = world.bodies[ball].rolling_mass
        force += mass * (own - flight.line_acceleration)
        growth += mass * (own_growth - flight.line_growth * flight.line_growth)
    return force, growth


@kernel
def _limit_on_line(world: World, first: int, count: int, step: int) -> None:
    """End the flight of a member where a one-sided trace would have to pull it."""
    ball = number_along(world, first, step)
    flight = world.flights[ball]
    track = track_of(world, ball)
    weight = world.bodies[ball].weight
    force = weight * (track.line_normal + track.line_normal_growth * flight.s)
    growth = weight * track.line_normal_growth
    for side in range(2):
        other = step - 1 + side
        if 0 <= other < count - 1:
            j = number_along(world, first, other)
            along, across = centres_along_path(world, j, world.pairs[j].a)
            # The force of the contact normal to the line, per newton along it.
            part = across / along if side == 1 else -(across / along)
            push, push_growth = _push_on_line(world, first, other)
            force += part * push
            growth += part * push_growth
    after = 0.0
    if force >= -FORCE_ROUNDING * weight:
        after = zero_crossing_on_line(flight, force, growth)
    if after < flight.exit_after:
        flight.exit_kind = LIFT_OFF
        flight.exit_after = after


@kernel
def replay_group_motion(flight: Flight, track: TrackData) -> None:
    """Set the form and constants of a flight in lasting contact from its state and series."""
    if track.path_radius == 0.0:
        flight.form = TURNING_LINE
        flight.line_growth = flight.series[0]
        return
    flight.tilt = track.tilt
    flight.spread = flight.series[0]
    flight.twist = flight.series[1]
    set_group_motion(flight)


# The first of the five angles at which the forces of a group are fitted.
FIRST = 3


@kernel
def pendulum_at(flight: Flight, sine: float, cosine: float) -> tuple[float, float, float, float]:
    """Return ``(S, C)``, ``f''`` and ``f'^2`` of a group, at half an angle from its start."""
    s, c = place_from_start(flight, sine, cosine)
    w2 = flight.frequency * flight.frequency
    square = 4.0 * w2 * squared_rate(flight, sine, cosine)
    return s, c, w2 * torque_of(flight, s, c), square


@kernel
def fit_forces(world: World, number: int, scratch: Flight) -> None:
    """Set the forces on every body of a motion as functions of its angle, or distance on a line."""
    row = world.log[number]
    replay_flight(world, row, number, scratch)
    if scratch.at_rest == 1 or scratch.form == POLYNOMIAL:
        return
    if scratch.form == TURNING_LINE:
        _fit_on_line(world, number, scratch)
    elif row.grouped == 1:
        _fit_group(world, number, scratch)
    else:
        body = world.bodies[row.body]
        track = track_on(world, row.body, row.piece)
        one = world.forces[world.settings[0].bodies]
        normal_terms = normal_harmonics_of_one(scratch, track, body.kappa)
        put(one.normal_terms, scaled(body.weight * world.pieces[row.piece].sign, normal_terms))
        torque = torque_harmonics(scratch)
        put(one.friction_terms, scaled(body.weight * (1.0 - 1.0 / body.kappa), torque))


@kernel
def put(series: Series, h: Harmonics) -> None:
    """Store the coefficients of a function in a series."""
    series[0], series[1], series[2], series[3], series[4] = h


@kernel
def kept(series: Series) -> Harmonics:
    """Return the coefficients of a function from a series."""
    return series[0], series[1], series[2], series[3], series[4]


@kernel
def _fit_group(world: World, number: int, scratch: Flight) -> None:
    """Fit the forces on a group from those at five angles."""
    row = world.log[number]
    first, count, base = bodies_of(world, row)
    for place in range(count):
        put(world.forces[base + place].normal_terms, (0.0, 0.0, 0.0, 0.0, 0.0))
    for angle in range(FIRST, FIRST + 5):
        set_forces(world, number, angle, 0.0, scratch)
        sine, cosine = twice_angle(HALF_SINES[angle], HALF_COSINES[angle])
        for place in range(count):
            _add_angle(world.forces[base + place], sine, cosine)
    replay_flight(world, row, number, scratch)
    torque = torque_harmonics(scratch)
    for place in range(count):
        ball = number_along(world, first, place)
        body = world.bodies[ball]
        rho = track_on(world, ball, row.piece).path_radius
        w2 = scratch.frequency * scratch.frequency
        put(
            world.forces[base + place].friction_terms,
            scaled((body.kappa - 1.0) * body.mass * rho * w2, torque),
        )


@kernel
def _add_angle(one: BodyForces, sine: float, cosine: float) -> None:
    """Add the normal force at one of the fitted angles to the fit."""
    normal = one.normal
    one.normal_terms[0] += 0.2 * normal
    one.normal_terms[1] += 0.4 * normal * cosine
    one.normal_terms[2] += 0.4 * normal * sine
    one.normal_terms[3] += 0.4 * normal * ((cosine - sine) * (cosine + sine))
    one.normal_terms[4] += 0.4 * normal * (2.0 * sine * cosine)


@kernel
def _fit_on_line(world: World, number: int, scratch: Flight) -> None:
    """Fit forces linear in the distance, from those at the start and a trace's length further."""
    row = world.log[number]
    first, count, base = bodies_of(world, row)
    way = world.flights[0].size
    for at in range(2):
        set_forces(world, number, AT_WAY, way if at == 0 else 0.0, scratch)
        for place in range(count):
            one = world.forces[base + place]
            body = world.bodies[number_along(world, first, place)]
            force = (body.kappa - 1.0) * body.mass * one.acceleration
            if at == 1:
                one.normal_terms[1] = (one.normal_terms[0] - one.normal) / way
                one.friction_terms[1] = (one.friction_terms[0] - force) / way
            one.normal_terms[0] = one.normal
            one.friction_terms[0] = force
