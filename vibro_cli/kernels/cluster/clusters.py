"""Groups of bodies in lasting contact: one pendulum on an arc, one parabola on a line.

On one arc a group is one pendulum ``(sum kappa_i m_i rho_i^2) f'' = -g A sin(f + delta)``; the
force between two neighbours is ``U sin f + V cos f`` in its angle, so that the angle at which they
part is known in closed form. On a line the acceleration and the forces are constant.
"""

from __future__ import annotations

import math

from vibro_cli.compile.kernel import kernel
from vibro_cli.kernels.cluster.cluster_forces import (
    half_of,
    limit_by_lift_off,
    limit_on_line,
    moments_of_body,
    set_release,
)
from vibro_cli.kernels.flow.flight import (
    BOUNDARY,
    choose_exit,
    is_at,
    launch_on_line,
    set_flow_energy,
)
from vibro_cli.kernels.flow.flow import body_of_group, group_of_body
from vibro_cli.kernels.numerics.error_free import add_to_time
from vibro_cli.kernels.structs import NEVER, Flight, TrackData
from vibro_cli.kernels.world import World


@kernel
def launch_group(world: World, first: int, count: int) -> None:
    """Launch ``count`` bodies in contact on one piece, from ``first`` to the right."""
    bodies = world.settings[0].bodies
    piece = world.flights[first].piece
    if world.pieces[piece].sign == 0.0:
        launch_group_on_line(world, first, count)
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
def clear(flight: Flight, track: TrackData) -> None:
    """Forget what a flight had of its motion before it became one of a group."""
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
def launch_group_on_line(world: World, first: int, count: int) -> None:
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
        clear(flight, track)
        flight.p = momentum / inertia
        flight.flow_s = flight.s
        flight.flow_c = flight.c
        flight.flow_p = flight.p
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
    flow_s, flow_c = _turned(middle_s, middle_c, lead_s, lead_c)
    flow_p = momentum / inertia / (2.0 * frequency)
    for step in range(count):
        ball = (first + step) % settings.bodies
        flight = world.flights[ball]
        track = world.tracks[ball * settings.pieces + flight.piece]
        clear(flight, track)
        flight.flow_s = flow_s
        flight.flow_c = flow_c
        flight.flow_p = flow_p
        flight.frequency = frequency
        flight.shift_s, flight.shift_c = _turned(flight.shift_s, flight.shift_c, -lead_s, lead_c)
        flight.rate_ratio = frequency / track.frequency
    for step in range(count):
        set_group_flow(world, first, count, (first + step) % settings.bodies)
    for step in range(count - 1):
        set_release(world, first, count, step + 1)
    if settings.one_sided == 1:
        limit_by_lift_off(world, first, count)


@kernel
def _turned(s: float, c: float, by_s: float, by_c: float) -> tuple[float, float]:
    """Sine and cosine of the sum of two half-angles."""
    return s * by_c + c * by_s, c * by_c - s * by_s


@kernel
def _set_offsets(world: World, first: int, count: int) -> tuple[float, float]:
    """Set ``shift_s, shift_c`` of each body to half its angle from the middle of the group.

    The middle is that of the middle body or, of an even number, that between the two middle ones,
    so that mirror images are treated alike. Returns ``(S, C)`` of it.
    """
    settings = world.settings[0]
    left = (count - 1) // 2
    right = count // 2
    ball = (first + left) % settings.bodies
    s = 0.0
    c = 1.0
    if left < right:
        contact = world.contacts[ball * settings.pieces + world.flights[ball].piece]
        s, c = half_of(contact.cosine, contact.sine)
    _set_shift(world, ball, -s, c)
    _set_shift(world, (first + right) % settings.bodies, s, c)
    left_s, left_c = s, c
    right_s, right_c = s, c
    for step in range(left):
        ball = (first + right + step) % settings.bodies
        contact = world.contacts[ball * settings.pieces + world.flights[ball].piece]
        right_s, right_c = _turned(right_s, right_c, contact.sine, contact.cosine)
        _set_shift(world, (ball + 1) % settings.bodies, right_s, right_c)
        ball = (first + left - step - 1) % settings.bodies
        contact = world.contacts[ball * settings.pieces + world.flights[ball].piece]
        left_s, left_c = _turned(left_s, left_c, contact.sine, contact.cosine)
        _set_shift(world, ball, -left_s, left_c)
    one = world.flights[(first + left) % settings.bodies]
    other = world.flights[(first + right) % settings.bodies]
    one_s, one_c = _turned(one.s, one.c, -one.shift_s, one.shift_c)
    other_s, other_c = _turned(other.s, other.c, -other.shift_s, other.shift_c)
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
    """``sum kappa m rho^2`` (kg m^2), that times the common rate, and ``sum m g rho (cos, sin)``.

    The angles are those from the middle of the group; bodies are taken two by two from its ends.
    """
    bodies = world.settings[0].bodies
    inertia = 0.0
    momentum = 0.0
    x = 0.0
    y = 0.0
    for step in range((count + 1) // 2):
        left_i, left_l, left_x, left_y = moments_of_body(world, (first + step) % bodies)
        other = (first + count - 1 - step) % bodies
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
    """Constants, exit and bounds of a member of a group on an arc."""
    flight = world.flights[ball]
    track = world.tracks[ball * world.settings[0].pieces + flight.piece]
    member_s, member_c, member_p = body_of_group(
        flight, flight.flow_s, flight.flow_c, flight.flow_p
    )
    at_left = is_at(member_s, member_c, track.left_s, track.left_c)
    at_right = is_at(member_s, member_c, track.right_s, track.right_c)
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
