"""Groups of bodies in lasting contact: one pendulum on an arc, one parabola on a line.

On one arc a group is one pendulum ``(sum kappa_i m_i rho_i^2) f'' = -g A sin(f + delta)``; the
force between two neighbours is ``U sin f + V cos f`` in its angle, so that the angle at which they
part is known in closed form. On a line the acceleration and the forces are constant.
"""

from __future__ import annotations

import math

from vibro_cli.mechanics.flight import (
    BOUNDARY,
    choose_exit,
    launch_on_line,
    set_flow_energy,
    squared_rate_at,
)
from vibro_cli.mechanics.flow import body_of_group, group_of_body, time_to
from vibro_cli.mechanics.records import NEVER, Flight, PairData, TrackData
from vibro_cli.numerics.double import add_to_time
from vibro_cli.numerics.engine import kernel
from vibro_cli.simulation.world import World

# A state within this of an end of its piece, in S C - C S, is at that end.
AT_END = 1.0e-14


@kernel
def launch_group(world: World, first: int, count: int) -> None:
    """Launch ``count`` bodies in contact on one piece, from ``first`` to the right."""
    bodies = world.settings[0].bodies
    piece = world.flights[first].piece
    if world.pieces[piece].sign == 0.0:
        _launch_on_line(world, first, count)
    else:
        _launch_on_arc(world, first, count)
    for step in range(count):
        flight = world.flights[(first + step) % bodies]
        if flight.exit_after < NEVER:
            flight.exit_t, flight.exit_t_low = add_to_time(
                flight.t, flight.t_low, flight.exit_after
            )
        else:
            flight.exit_t = NEVER
            flight.exit_t_low = 0.0


@kernel
def _clear(flight: Flight, track: TrackData) -> None:
    flight.at_rest = 0
    flight.wall_side = 0
    flight.exit_kind = BOUNDARY
    flight.exit_side = 0
    flight.exit_after = NEVER
    flight.exit_p = 0.0
    flight.anchor = -1
    flight.segment = 0.0
    flight.own_frequency = track.frequency
    flight.grouped = 1


@kernel
def _launch_on_line(world: World, first: int, count: int) -> None:
    """Common parabola: ``v' = -g sin(alpha) sum m/sum kappa m``."""
    settings = world.settings[0]
    weight = 0.0
    inertia = 0.0
    momentum = 0.0
    for step in range(count):
        ball = (first + step) % settings.bodies
        body = world.bodies[ball]
        weight += body.weight
        inertia += body.rolling_mass
        momentum += body.rolling_mass * world.flights[ball].p
    for step in range(count):
        ball = (first + step) % settings.bodies
        flight = world.flights[ball]
        track = world.tracks[ball * settings.pieces + flight.piece]
        _clear(flight, track)
        flight.p = momentum / inertia
        flight.flow_s = flight.s
        flight.flow_c = flight.c
        flight.flow_p = flight.p
        flight.line_acceleration = -track.line_rise * weight / inertia
        launch_on_line(flight, track.left_s, track.right_s)
        if step < count - 1:
            world.pairs[ball].release_t = NEVER


@kernel
def _launch_on_arc(world: World, first: int, count: int) -> None:
    settings = world.settings[0]
    shift_s, shift_c = _lead(world, first, count)
    inertia, torque, rate = _moments(world, first, count)
    frequency = math.sqrt(torque / inertia)
    lead = world.flights[first]
    flow_s = lead.s * shift_c + lead.c * shift_s
    flow_c = lead.c * shift_c - lead.s * shift_s
    flow_p = rate / (2.0 * frequency)
    offset_s = -shift_s
    offset_c = shift_c
    for step in range(count):
        ball = (first + step) % settings.bodies
        flight = world.flights[ball]
        track = world.tracks[ball * settings.pieces + flight.piece]
        _clear(flight, track)
        flight.flow_s = flow_s
        flight.flow_c = flow_c
        flight.flow_p = flow_p
        flight.frequency = frequency
        flight.shift_s = offset_s
        flight.shift_c = offset_c
        flight.rate_ratio = frequency / track.frequency
        _set_group_flow(flight, track)
        if step < count - 1:
            contact = world.contacts[ball * settings.pieces + flight.piece]
            offset_s, offset_c = (
                offset_s * contact.cosine + offset_c * contact.sine,
                offset_c * contact.cosine - offset_s * contact.sine,
            )
    for step in range(count - 1):
        _set_release(world, first, step + 1)


@kernel
def _lead(world: World, first: int, count: int) -> tuple[float, float]:
    """Sine and cosine of half the angle by which the group's pendulum leads its first body."""
    settings = world.settings[0]
    s = 0.0
    c = 1.0
    x = 0.0
    y = 0.0
    for step in range(count):
        ball = (first + step) % settings.bodies
        piece = world.flights[ball].piece
        rho = world.tracks[ball * settings.pieces + piece].path_radius
        moment = world.bodies[ball].weight * rho
        x += moment * ((c - s) * (c + s))
        y += moment * (2.0 * s * c)
        if step < count - 1:
            contact = world.contacts[ball * settings.pieces + piece]
            s, c = s * contact.cosine + c * contact.sine, c * contact.cosine - s * contact.sine
    size = math.sqrt(x * x + y * y)
    cosine = math.sqrt(0.5 * (1.0 + x / size))
    return y / (2.0 * size * cosine), cosine


@kernel
def _moments(world: World, first: int, count: int) -> tuple[float, float, float]:
    """``sum kappa m rho^2`` (kg m^2), ``g A`` (N m) and the common rate (rad/s) of a group."""
    settings = world.settings[0]
    inertia = 0.0
    momentum = 0.0
    s = 0.0
    c = 1.0
    x = 0.0
    y = 0.0
    for step in range(count):
        ball = (first + step) % settings.bodies
        flight = world.flights[ball]
        track = world.tracks[ball * settings.pieces + flight.piece]
        rho = track.path_radius
        part = world.bodies[ball].rolling_mass * rho * rho
        inertia += part
        momentum += part * (2.0 * track.frequency * flight.p)
        moment = world.bodies[ball].weight * rho
        x += moment * ((c - s) * (c + s))
        y += moment * (2.0 * s * c)
        if step < count - 1:
            contact = world.contacts[ball * settings.pieces + flight.piece]
            s, c = s * contact.cosine + c * contact.sine, c * contact.cosine - s * contact.sine
    return inertia, math.sqrt(x * x + y * y), momentum / inertia


@kernel
def _set_group_flow(flight: Flight, track: TrackData) -> None:
    """Constants, exit and bounds of a member of a group on an arc."""
    member_s, member_c, member_p = body_of_group(
        flight, flight.flow_s, flight.flow_c, flight.flow_p
    )
    at_left = abs(member_s * track.left_c - member_c * track.left_s) < AT_END
    at_right = abs(member_s * track.right_c - member_c * track.right_s) < AT_END
    flight.s = member_s
    flight.c = member_c
    flight.p = member_p
    set_flow_energy(flight)
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
    tangential = track.path_radius * w2
    central = 4.0 * track.path_radius * w2 * flight.parameter
    flight.acceleration_bound = math.sqrt(tangential * tangential + central * central)


@kernel
def force_coefficients(world: World, first: int, bodies_left: int) -> tuple[float, float]:
    """``(U, V)`` of the moment ``U sin f + V cos f`` between a group's first bodies and the rest.

    From the balance of the first ``bodies_left`` bodies; f is the angle of the group's pendulum.
    """
    settings = world.settings[0]
    u = 0.0
    v = 0.0
    for step in range(bodies_left):
        ball = (first + step) % settings.bodies
        flight = world.flights[ball]
        rho = world.tracks[ball * settings.pieces + flight.piece].path_radius
        sine = 2.0 * flight.shift_s * flight.shift_c
        cosine = (flight.shift_c - flight.shift_s) * (flight.shift_c + flight.shift_s)
        moment = world.bodies[ball].weight * rho
        inertia = world.bodies[ball].rolling_mass * rho * rho
        u += inertia * flight.frequency * flight.frequency - moment * cosine
        v -= moment * sine
    return u, v


@kernel
def _set_release(world: World, first: int, bodies_left: int) -> None:
    """Find when the force between a group's first bodies and the rest turns negative."""
    bodies = world.settings[0].bodies
    flight = world.flights[first]
    pair = world.pairs[(first + bodies_left - 1) % bodies]
    pair.release_t = NEVER
    pair.release_t_low = 0.0
    u, v = force_coefficients(world, first, bodies_left)
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
    _keep_release(flight, pair, after)


@kernel
def _keep_release(flight: Flight, pair: PairData, after: float) -> None:
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
