"""A group in lasting contact across several pieces: one degree of freedom, by collocation.

Across pieces the geometry of a contact changes as the group moves, and no closed form is known. The
equations of the chain are solved on short segments by collocation at Gauss nodes, to rounding. They
take the contact forces from the second derivative of each distance, and so include the change of
the normals. Accelerations and forces are then polynomials in time, whose first roots are certified.
"""

from __future__ import annotations

import math

from vibro_cli.compile.kernel import SERIES_LENGTH, Series, kernel
from vibro_cli.kernels.cluster.trace_forces import normal_force_now
from vibro_cli.kernels.contact.contact_kinematics import free_acceleration, set_normals
from vibro_cli.kernels.flow.flight import AT_END, BOUNDARY, LIFT_OFF, half_way_to, set_exit_time
from vibro_cli.kernels.flow.flow import POLYNOMIAL, path_on_segment, polynomial_flow
from vibro_cli.kernels.impact.impulse_chain import contact_forces, keep_release
from vibro_cli.kernels.numerics.conservative_advancement import safe_step_second_order
from vibro_cli.kernels.numerics.constants import NEVER
from vibro_cli.kernels.numerics.elliptic import angle_difference
from vibro_cli.kernels.world import (
    Flight,
    TrackData,
    World,
    flight_along,
    number_along,
    pair_along,
    track_of,
)

Row = tuple[float, ...]


# A negative force below this share of the weights is zero up to rounding.
FORCE_ROUNDING = 1.0e-12
# A force that vanishes this near the end of a segment vanishes there, up to the rounding of the
# positions (a share of the length of the trace), but at most this share of the segment before it.
AT_END_ROUNDING = 1.0e-14
AT_ONCE = 1.0e-6
# Gauss nodes: the zeros of the Legendre polynomial of degree 8, mapped to [0, 1].
NODES = (
    0.01985507175123188, 0.10166676129318664, 0.23723379504183550, 0.40828267875217510,
    0.59171732124782490, 0.76276620495816450, 0.89833323870681336, 0.98014492824876812,
)  # fmt: skip


def _to_powers() -> tuple[Row, ...]:
    """Return the matrix from values at the nodes to coefficients in powers of t, rounded once."""
    unit = 2**60  # the nodes are integer multiples of its reciprocal
    nodes = [int(node * unit) for node in NODES]
    columns = []
    for node in nodes:
        powers, divisor = [1], 1
        for other in nodes:
            if other != node:
                shifted = zip([0, *powers], [*powers, 0], strict=True)
                powers = [low * unit - other * high for low, high in shifted]
                divisor *= node - other
        columns.append([power / divisor for power in powers])
    return tuple(zip(*columns, strict=True))


TO_POWERS = _to_powers()

SEGMENT_END = 2  # an exit kind of flights, besides BOUNDARY and LIFT_OFF
# Longest segment in units of the shortest time scale.
LONGEST = 0.1
# Relative change of the accelerations below which the iteration has converged.
CONVERGED = 2.0e-15
ITERATIONS = 30


@kernel
def launch_across(world: World, first: int, count: int) -> None:
    """Launch ``count`` bodies in contact on several pieces for one segment of time."""
    h = _first_length(world, first, count)
    while not _integrate(world, first, count, h):
        h *= 0.5
    end = h
    for step in range(count):
        ball = number_along(world, first, step)
        flight = world.flights[ball]
        _set_end(world, ball, h)
        if world.settings[0].one_sided == 1:
            _limit_by_lift_off(flight, h)
        end = min(end, flight.exit_after)
    for step in range(count - 1):
        ball = number_along(world, first, step)
        pair = world.pairs[ball]
        weights = world.bodies[pair.a].weight + world.bodies[pair.b].weight
        after = first_root_of_series(pair.series, h, FORCE_ROUNDING * weights)
        # Where the force vanishes at the end itself, as where both are on one slope, the next
        # launch decides.
        flight = world.flights[ball]
        rounding = AT_END_ROUNDING * flight.size
        at_once = rounding / max(abs(flight.flow_p), rounding / (AT_ONCE * h))
        keep_release(flight, pair, after if after < end - at_once else NEVER)


@kernel
def _first_length(world: World, first: int, count: int) -> float:
    """Return the length (s) of a segment, short against the time scales of gravity and motion."""
    fastest = 0.0
    for step in range(count):
        ball = number_along(world, first, step)
        flight = world.flights[ball]
        track = track_of(world, ball)
        size = world.bodies[ball].radius
        if track.path_radius > 0.0:
            size = min(size, track.path_radius)
        speed = abs(track.speed_factor * flight.p)
        fastest = max(fastest, math.sqrt(track.gravity_rate / size) + speed / size)
    return LONGEST / fastest


@kernel
def _start_member(world: World, ball: int, h: float) -> None:
    flight = world.flights[ball]
    track = track_of(world, ball)
    flight.form = POLYNOMIAL
    flight.grouped = 1
    flight.at_rest = 0
    flight.separatrix_piece = -1
    flight.saddle_root = NEVER
    flight.segment = h
    flight.own_frequency = track.frequency
    flight.frequency = track.frequency
    flight.line_acceleration = 0.0
    flight.flow_s = flight.s
    flight.flow_c = flight.c
    flight.flow_p = track.speed_factor * flight.p
    flight.rate_ratio = 1.0 / track.speed_factor
    flight.half_curvature = 0.5 / track.path_radius if track.path_radius > 0.0 else 0.0
    for k in range(SERIES_LENGTH):
        flight.series[k] = 0.0


@kernel
def _integrate(world: World, first: int, count: int, h: float) -> bool:
    """Solve a segment of length ``h`` (s) by collocation; return whether it converges."""
    for step in range(count):
        _start_member(world, number_along(world, first, step), h)
    change = NEVER
    for _ in range(ITERATIONS):
        change = _iterate(world, first, count, h)
        if change < CONVERGED:
            if world.settings[0].one_sided == 1:
                _set_normal_forces(world, first, count, h)
            break
    _restore_members(world, first, count)
    return change < CONVERGED and _resolved(world, first, count)


@kernel
def _restore_members(world: World, first: int, count: int) -> None:
    for step in range(count):
        flight = flight_along(world, first, step)
        flight.s = flight.flow_s
        flight.c = flight.flow_c
        flight.p = flight.flow_p * flight.rate_ratio
        flight.speed = flight.flow_p


@kernel
def _set_normal_forces(world: World, first: int, count: int, h: float) -> None:
    """Set the polynomials of the normal forces (N) of all members on a solved segment."""
    for step in range(count):
        for i in range(SERIES_LENGTH):
            flight_along(world, first, step).normal[i] = 0.0
    for k in range(SERIES_LENGTH):
        _force_members(world, first, count, NODES[k] * h)
        for step in range(count):
            force = normal_force_now(world, first, count, step)
            for i in range(SERIES_LENGTH):
                flight_along(world, first, step).normal[i] += TO_POWERS[i][k] * force


@kernel
def _limit_by_lift_off(flight: Flight, h: float) -> None:
    """End a segment where a one-sided trace would have to pull the body."""
    after = 0.0 if flight.normal[0] < 0.0 else first_root_of_series(flight.normal, h, 0.0)
    if after < min(h, flight.exit_after):
        flight.exit_kind = LIFT_OFF
        flight.exit_after = after
        _, _, flight.exit_p = polynomial_flow(flight, after)
        set_exit_time(flight)


@kernel
def _force_members(world: World, first: int, count: int, t: float) -> None:
    """Set the members' states and contact forces at a time of the segment."""
    for step in range(count):
        flight = flight_along(world, first, step)
        flight.s, flight.c, flight.p = polynomial_flow(flight, t)
        flight.speed = flight.p / flight.rate_ratio
    for step in range(count - 1):
        set_normals(world, number_along(world, first, step))
    contact_forces(world, first, count - 1)


@kernel
def _iterate(world: World, first: int, count: int, h: float) -> float:
    """Make one sweep over the nodes; return the largest relative change, as a displacement."""
    size = _acceleration_size(world, first, count)
    for k in range(SERIES_LENGTH):
        _force_members(world, first, count, NODES[k] * h)
        for step in range(count):
            ball = number_along(world, first, step)
            world.flights[ball].nodal[k] = _acceleration(world, first, count, step)
            if step < count - 1:
                world.pairs[ball].nodal[k] = world.pairs[ball].solution
    change = 0.0
    for step in range(count):
        ball = number_along(world, first, step)
        flight = world.flights[ball]
        for i in range(SERIES_LENGTH):
            value = 0.0
            force = 0.0
            for k in range(SERIES_LENGTH):
                value += TO_POWERS[i][k] * flight.nodal[k]
            if step < count - 1:
                for k in range(SERIES_LENGTH):
                    force += TO_POWERS[i][k] * world.pairs[ball].nodal[k]
                world.pairs[ball].series[i] = force
            # The position matters: a coefficient enters it divided by (i + 1)(i + 2).
            moved = abs(value - flight.series[i]) * (h * h / ((i + 1.0) * (i + 2.0)))
            change = max(change, moved / (size * h * h + abs(flight.flow_p) * h))
            flight.series[i] = value
    return change


@kernel
def _acceleration(world: World, first: int, count: int, step: int) -> float:
    """Return a member's acceleration (m/s^2) along its path, by gravity and contact forces."""
    ball = number_along(world, first, step)
    force = 0.0
    if step > 0:
        before = pair_along(world, first, step - 1)
        force += before.solution * before.normal_b
    if step < count - 1:
        pair = world.pairs[ball]
        force -= pair.solution * pair.normal_a
    return free_acceleration(world, ball) + force / world.bodies[ball].rolling_mass


@kernel
def _acceleration_size(world: World, first: int, count: int) -> float:
    """Return the magnitude (m/s^2) of the members' accelerations, the largest for all.

    A member alone may have hardly any, as on a level line near the axis of a rotating trace.
    """
    size = 0.0
    for step in range(count):
        size = max(size, track_of(world, number_along(world, first, step)).gravity_rate)
    return size


@kernel
def _resolved(world: World, first: int, count: int) -> bool:
    """Return whether the last coefficients no longer matter for the positions."""
    size = _acceleration_size(world, first, count)
    for step in range(count):
        flight = flight_along(world, first, step)
        # The coefficients are those of powers of t/h: terms at the end of the segment.
        last = abs(flight.series[SERIES_LENGTH - 1]) + abs(flight.series[SERIES_LENGTH - 2])
        if last > 1.0e-5 * size:
            return False
    return True


@kernel
def _set_end(world: World, ball: int, h: float) -> None:
    """Set the exit of a member: where it leaves its piece, else the end of the segment."""
    flight = world.flights[ball]
    track = track_of(world, ball)
    to_left, to_right = _ways(flight, track)
    jerk = _bound_member(flight, track)
    right = _time_to_end(flight, to_right, 1.0, h, jerk)
    left = _time_to_end(flight, to_left, -1.0, h, jerk)
    flight.exit_side = 0
    flight.exit_kind = SEGMENT_END
    flight.exit_after = h
    if min(left, right) < h:
        flight.exit_kind = BOUNDARY
        flight.exit_side = 1 if right < left else -1
        flight.exit_after = min(left, right)
    _, _, flight.exit_p = polynomial_flow(flight, flight.exit_after)
    set_exit_time(flight)


@kernel
def _ways(flight: Flight, track: TrackData) -> tuple[float, float]:
    """Return the lengths (m) of the centre's path to the left and right end of the piece."""
    if track.path_radius == 0.0:
        return flight.s - track.left_s, track.right_s - flight.s
    left_s, left_c = angle_difference(flight.s, flight.c, track.left_s, track.left_c)
    right_s, right_c = angle_difference(track.right_s, track.right_c, flight.s, flight.c)
    left, right = math.atan2(left_s, left_c), math.atan2(right_s, right_c)
    return 2.0 * track.path_radius * half_way_to(left), 2.0 * track.path_radius * half_way_to(right)


@kernel
def _bound_member(flight: Flight, track: TrackData) -> float:
    """Set the bounds of a flight over the segment, from the coefficients.

    Return the bound (m/s^3) of the rate of the acceleration along the path.
    """
    acceleration = 0.0
    jerk = 0.0
    snap = 0.0
    for k in range(SERIES_LENGTH):
        acceleration += abs(flight.series[k])
        jerk += k * abs(flight.series[k])
        snap += k * (k - 1) * abs(flight.series[k])
    jerk /= flight.segment
    flight.snap_bound = 2.0 * flight.half_curvature * (snap / flight.segment / flight.segment)
    flight.jerk_bound = jerk
    speed = abs(flight.flow_p) + acceleration * flight.segment
    central = 0.0
    flight.angular_bound = 0.0
    if track.path_radius > 0.0:
        central = speed * speed / track.path_radius
        flight.angular_bound = acceleration / track.path_radius
        flight.jerk_bound /= track.path_radius
    flight.acceleration_bound = math.sqrt(acceleration * acceleration + central * central)
    flight.parameter = 0.0
    flight.complementary_modulus = 0.0
    return jerk


@kernel
def _time_to_end(flight: Flight, way: float, side: float, h: float, jerk: float) -> float:
    """Return the first time (s) on the segment at which a member has moved by ``way``, or ``h``.

    ``way`` (m) is the distance to the end of the piece on a side (+1 right, -1 left).
    """
    bound = flight.acceleration_bound
    t = 0.0
    if way <= AT_END * flight.size:
        # The member is at this end: it leaves only if it moves, or is accelerated, outwards.
        outwards = side * flight.flow_p
        if outwards > 0.0 or (outwards == 0.0 and side * flight.series[0] > 0.0):
            return 0.0
        way = 0.0
        t = _time_inside(flight, side, h, jerk)
    while t < h:
        moved, speed = path_on_segment(flight, t)
        left = way - side * moved
        if left <= 1.0e-15 * (abs(way) + abs(moved)):
            return t
        following = t + safe_step_second_order(left, -side * speed, bound)
        if following == t:
            return t  # the rest is below the resolution of time
        t = following
    return h


@kernel
def _time_inside(flight: Flight, side: float, h: float, jerk: float) -> float:
    """Return a time (s) for which a member at an end, not driven outwards, is certainly inside.

    With speed u and acceleration a inwards, it has moved by at least ``u t - A t^2/2``, and if
    a > 0 by at least ``a t^2/2 - J t^3/6``, even from rest.
    """
    bound = flight.acceleration_bound
    if bound == 0.0:
        return h
    by_speed = 2.0 * abs(flight.flow_p) / bound
    inwards = -side * flight.series[0]
    if inwards <= 0.0:
        return by_speed
    # Half of the bound 3 a/J, so that the displacement is not zero by rounding either.
    return max(by_speed, 1.5 * inwards / jerk if jerk > 0.0 else h)


@kernel
def first_root_of_series(series: Series, h: float, least: float) -> float:
    """Return the first time (s) at which an initially positive force falls through zero, or ``h``.

    A force of at most ``least`` (N) throughout is zero up to rounding. The second derivative on the
    segment is bounded by ``sum k (k-1) |c_k|/h^2``.
    """
    bound = 0.0
    size = 0.0
    for k in range(SERIES_LENGTH):
        bound += k * (k - 1.0) * abs(series[k])
        size += abs(series[k])
    if size <= least:
        return h
    t = 0.0
    while t < 1.0:
        value = 0.0
        slope = 0.0
        for k in range(SERIES_LENGTH - 1, -1, -1):
            slope = slope * t + value
            value = value * t + series[k]
        if value <= 1.0e-14 * size:
            if slope < 0.0:
                return t * h
            value = 1.0e-14 * size
        t += safe_step_second_order(value, slope, bound + 1.0e-9 * size)
    return h
