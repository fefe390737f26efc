"""What ends the motion of a group on one arc: a contact force, or the trace's, that turns negative.

The force between two neighbours and the normal force of each body are sums of a constant, a sine
and a cosine of the angle of the group's pendulum, so that their zeros are known in closed form.
"""

from __future__ import annotations

import math

from vibro_cli.compile.kernel import kernel
from vibro_cli.kernels.contact.contact_kinematics import (
    line_of_centres,
    parts_of_weight,
    set_normals,
    set_speed,
    tangent,
)
from vibro_cli.kernels.contact.gap import centre_position
from vibro_cli.kernels.flow.flight import LIFT_OFF, squared_rate_at
from vibro_cli.kernels.flow.time_of_flight import time_to
from vibro_cli.kernels.impact.impulse_chain import contact_forces
from vibro_cli.kernels.numerics.error_free import add_to_time
from vibro_cli.kernels.structs import NEVER, Flight, PairData
from vibro_cli.kernels.world import World

# A normal force above -this share of its terms is zero up to rounding.
FORCE_ROUNDING = 1.0e-14


@kernel
def half_of(cosine: float, sine: float) -> tuple[float, float]:
    """Sine and cosine of half an angle in (-pi, pi)."""
    if cosine >= 0.0:
        c = math.sqrt(0.5 * (1.0 + cosine))
        return 0.5 * sine / c, c
    s = math.sqrt(0.5 * (1.0 - cosine))
    if sine < 0.0:
        s = -s
    return s, 0.5 * sine / s


@kernel
def moments_of_body(world: World, ball: int) -> tuple[float, float, float, float]:
    """``kappa m rho^2`` (kg m^2) of a body, that times its rate, and ``m g rho (cos, sin)``.

    The angle is that by which the body leads its group (``shift_s, shift_c`` is half of it).
    """
    flight = world.flights[ball]
    track = world.tracks[ball * world.settings[0].pieces + flight.piece]
    rho = track.path_radius
    inertia = world.bodies[ball].rolling_mass * rho * rho
    moment = world.bodies[ball].weight * rho
    cosine = (flight.shift_c - flight.shift_s) * (flight.shift_c + flight.shift_s)
    sine = 2.0 * flight.shift_s * flight.shift_c
    momentum = inertia * (2.0 * track.frequency * flight.p)
    return inertia, momentum, moment * cosine, moment * sine


@kernel
def force_coefficients(
    world: World, first: int, count: int, bodies_left: int
) -> tuple[float, float]:
    """``(U, V)`` of the moment ``U sin f + V cos f`` between a group's first bodies and the rest.

    Half from the balance of the first ``bodies_left`` bodies, half from that of the others; f is
    the angle of the group's pendulum.
    """
    left_u, left_v = _balance(world, first, 0, bodies_left)
    right_u, right_v = _balance(world, first, bodies_left, count)
    return 0.5 * (left_u - right_u), 0.5 * (left_v - right_v)


@kernel
def _balance(world: World, first: int, start: int, end: int) -> tuple[float, float]:
    """``(U, V)`` of the moment that some bodies of a group need beside their weight.

    The sum runs from the end of the group inwards.
    """
    bodies = world.settings[0].bodies
    u = 0.0
    v = 0.0
    for number in range(end - start):
        step = number if start == 0 else end - 1 - number
        ball = (first + step) % bodies
        inertia, _, x, y = moments_of_body(world, ball)
        u += inertia * world.flights[ball].frequency * world.flights[ball].frequency - x
        v -= y
    return u, v


@kernel
def set_release(world: World, first: int, count: int, bodies_left: int) -> None:
    """Find when the force between a group's first bodies and the rest turns negative."""
    bodies = world.settings[0].bodies
    flight = world.flights[first]
    pair = world.pairs[(first + bodies_left - 1) % bodies]
    pair.release_t = NEVER
    pair.release_t_low = 0.0
    u, v = force_coefficients(world, first, count, bodies_left)
    size = math.sqrt(u * u + v * v)
    if size == 0.0 or flight.at_rest == 1:
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
def keep_release(flight: Flight, pair: PairData, after: float) -> None:
    """Keep when a contact force falls through zero (s after the flight's start), if it does."""
    if after < NEVER:
        pair.release_t, pair.release_t_low = add_to_time(flight.t, flight.t_low, after)


@kernel
def _release_at(flight: Flight, s: float, c: float, slope: float) -> float:
    """Time (s) to the passage of a zero of the force in the direction in which it falls.

    ``slope`` is the derivative of the force's moment with the angle at that place.
    """
    if flight.root_complement >= 0.0 and flight.flow_c * c < 0.0:
        return NEVER
    square = squared_rate_at(flight, s, c)
    if square <= 0.0:
        return NEVER
    p = math.sqrt(square)
    if slope > 0.0:
        p = -p
    if flight.root_complement < 0.0 and p * flight.flow_p < 0.0:
        return NEVER
    return time_to(flight, s, c, p)


@kernel
def limit_by_lift_off(world: World, first: int, count: int) -> None:
    """End the flights of a group on an arc where a one-sided trace would have to pull a body."""
    bodies = world.settings[0].bodies
    for step in range(count):
        ball = (first + step) % bodies
        flight = world.flights[ball]
        a, b, c = _normal_force(world, first, count, step)
        after = _first_negative(flight, a, b, c)
        if after < flight.exit_after:
            flight.exit_kind = LIFT_OFF
            flight.exit_after = after


@kernel
def _normal_force(world: World, first: int, count: int, step: int) -> tuple[float, float, float]:
    """``(A, B, C)`` of the normal force ``A + B cos f + C sin f`` (N) of a member of a group."""
    settings = world.settings[0]
    ball = (first + step) % settings.bodies
    flight = world.flights[ball]
    sign = world.pieces[flight.piece].sign
    rho = world.tracks[ball * settings.pieces + flight.piece].path_radius
    _, _, x, y = moments_of_body(world, ball)
    # m v^2/rho = m rho w^2 (4 m - 2 + 2 cos f)
    central = world.bodies[ball].mass * rho * flight.frequency * flight.frequency
    a = sign * central * (4.0 * flight.parameter - 2.0)
    b = sign * (2.0 * central + x / rho)
    c = -sign * y / rho
    if step > 0:
        lever = lever_of(world, (first + step - 1) % settings.pairs, ball)
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
def normal_force_now(world: World, first: int, count: int, step: int) -> float:
    """Normal force (N) of a member whose state, speed and contact forces (``solution``) are set."""
    settings = world.settings[0]
    ball = (first + step) % settings.bodies
    flight = world.flights[ball]
    piece = world.pieces[flight.piece]
    track = world.tracks[ball * settings.pieces + flight.piece]
    tx, ty = tangent(world, ball)
    x, _ = centre_position(piece, track, flight.s, flight.c)
    _, onto = parts_of_weight(world, x, ty, tx)
    force = world.bodies[ball].mass * onto
    if piece.sign != 0.0:
        central = flight.speed * flight.speed / track.path_radius
        force += piece.sign * world.bodies[ball].mass * central
    if step > 0:
        force -= _pushed_across(world, (first + step - 1) % settings.pairs, ball)
    if step < count - 1:
        force += _pushed_across(world, ball, ball)
    return force


@kernel
def _pushed_across(world: World, j: int, ball: int) -> float:
    """Part of the force of a contact (N) along the normal of a body's path."""
    pair = world.pairs[j]
    dx, dy = line_of_centres(world, j)
    tx, ty = tangent(world, ball)
    return pair.solution * (dy * tx - dx * ty) / pair.distance


@kernel
def limit_on_line(world: World, first: int, count: int) -> None:
    """End the flights of a group on a line at once if a one-sided trace would have to pull."""
    bodies = world.settings[0].bodies
    for step in range(count - 1):
        set_normals(world, (first + step) % bodies)
    for step in range(count):
        set_speed(world, (first + step) % bodies)
    contact_forces(world, first, count - 1)
    for step in range(count):
        flight = world.flights[(first + step) % bodies]
        weight = world.bodies[(first + step) % bodies].weight
        if normal_force_now(world, first, count, step) < -FORCE_ROUNDING * weight:
            flight.exit_kind = LIFT_OFF
            flight.exit_after = 0.0


@kernel
def lever_of(world: World, j: int, ball: int) -> float:
    """Part of a contact's force across the path of a body, for one newton metre between a pair."""
    pair = world.pairs[j]
    rho = world.tracks[ball * world.settings[0].pieces + world.flights[ball].piece].path_radius
    dx, dy = line_of_centres(world, j)
    tx, ty = tangent(world, ball)
    along = dx * tx + dy * ty
    return (dy * tx - dx * ty) / (along * rho) if pair.held == 1 else 0.0


@kernel
def _first_negative(flight: Flight, a: float, b: float, c: float) -> float:
    """Time (s) from which ``a + b cos f + c sin f`` is negative on a group's flight, or NEVER."""
    size = math.sqrt(b * b + c * c)
    s = flight.flow_s
    k = flight.flow_c
    now = a + b * ((k - s) * (k + s)) + c * (2.0 * s * k)
    if now < -FORCE_ROUNDING * (abs(a) + size):
        return 0.0
    if size <= abs(a) or flight.at_rest == 1:
        return NEVER
    # Positive around the angle of (b, c), up to the angle of this cosine to both sides.
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
