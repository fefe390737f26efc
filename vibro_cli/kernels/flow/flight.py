"""Flights: their constants, start and end, and the bounds that the contact search needs."""

from __future__ import annotations

import math

from vibro_cli.compile.kernel import SERIES_LENGTH, any_lane, kernel
from vibro_cli.kernels.flow.flow import LINE, flow, time_ahead, time_of_flight
from vibro_cli.kernels.numerics.constants import EPSILON, NEVER
from vibro_cli.kernels.numerics.double_double import add_to_time, time_between
from vibro_cli.kernels.numerics.elliptic import set_theta_constants
from vibro_cli.kernels.world import (
    BodyData,
    Flight,
    FlightRow,
    PieceData,
    TrackData,
    World,
    pair_beside,
    track_of,
    track_on,
)

BOUNDARY = 0
LIFT_OFF = 1
# Below this share of the whole energy the kinetic energy has lost digits: the speed is kept instead
# of being computed from it.
SLOW = 1.0e-2
# Where C^2 + P^2 is below this, the energy is also taken from the state, relative to the crest.
CREST_NEIGHBOURHOOD = 0.05
# A libration that turns below both ends of its piece by this share reaches neither.
END_ROUNDING = 1.0e-9
# A body moved to an end of its piece may be beyond it by this much (S, C), by rounding.
BEYOND_END = 1.0e-12
# ... or short of it, by this share of the products whose difference is the sine.
SHORT_OF_END = 4.0 * EPSILON
# A state within this of an end of its piece, in S C - C S or as a share of the trace's length, is
# at that end.
AT_END = 1.0e-14


@kernel
def launch(
    flight: Flight, body: BodyData, piece: PieceData, track: TrackData, one_sided: int
) -> None:
    """Set up the flight that starts from the state, piece and energy held in ``flight``."""
    clear(flight, track, 0)
    start_from_state(flight)
    launch_on_piece(flight, body, piece, track, one_sided)
    set_exit_time(flight)


@kernel
def clear(flight: Flight, track: TrackData, grouped: int) -> None:
    """Reset what a flight holds of its previous motion; the next one is alone or in a group."""
    flight.at_rest = 0
    flight.exit_kind = BOUNDARY
    flight.exit_side = 0
    flight.exit_after = NEVER
    flight.exit_p = 0.0
    flight.grouped = grouped
    flight.wall_side = 0
    flight.segment = 0.0
    flight.own_frequency = track.frequency


@kernel
def start_from_state(flight: Flight) -> None:
    """Start the flow of a flight from the body's own state."""
    flight.flow_s = flight.s
    flight.flow_c = flight.c
    flight.flow_p = flight.p


@kernel
def set_exit_time(flight: Flight) -> None:
    """Set the instant of the exit from the duration of the flight."""
    flight.exit_t = NEVER
    flight.exit_t_low = 0.0
    if flight.exit_after < NEVER:
        flight.exit_t, flight.exit_t_low = add_to_time(flight.t, flight.t_low, flight.exit_after)


@kernel
def launch_on_piece(
    flight: Flight, body: BodyData, piece: PieceData, track: TrackData, one_sided: int
) -> None:
    """Set the form, the bounds, the exit and the duration of a flight on its piece."""
    if piece.sign == 0.0:
        flight.line_acceleration = track.line_acceleration
        launch_on_line(flight, track.left_s, track.right_s)
    else:
        _launch_on_arc(flight, track)
    if one_sided == 1:
        _limit_by_lift_off(flight, body, piece)


@kernel
def specific_energy_of_state(world: World, ball: int) -> float:
    """Return energy over weight, m above the body's lowest position (B (33) multiplied out)."""
    flight = world.flights[ball]
    track = track_of(world, ball)
    if track.path_radius == 0.0:
        height = track.bottom + track.line_rise * flight.s
        kappa = world.bodies[ball].kappa
        return height + 0.5 * kappa * flight.p * flight.p / world.settings[0].gravity
    return specific_energy_on_arc(track, flight.s, flight.c, flight.p)


@kernel
def specific_energy_on_arc(track: TrackData, s: float, c: float, p: float) -> float:
    """Return energy over weight (m) in a state on an arc."""
    s2 = s * s
    return (
        track.top - track.twice_radius * ((c - p) * (c + p))
        if s2 > 0.5
        else track.bottom + track.twice_radius * (s2 + p * p)
    )


@kernel
def refer_to_separatrix(flight: Flight, track: TrackData) -> None:
    """Measure the energy also relative to the crest of the piece if the state is near it."""
    flight.separatrix_piece = -1
    near = flight.c * flight.c + flight.p * flight.p < CREST_NEIGHBOURHOOD
    if near and track.path_radius > 0.0:
        flight.separatrix_piece = flight.piece
        flight.separatrix_root = root_of_state(flight.c, flight.p)


@kernel
def root_of_state(c: float, p: float) -> float:
    """Return ``sign(1-m) sqrt|1-m|`` from the factors of ``1 - m = (C - P)(C + P)``."""
    root = size_of_root(c, p)
    return -root if abs(p) > abs(c) else root


@kernel
def size_of_root(c: float, p: float) -> float:
    """Return ``sqrt|1 - m|`` as the product of the roots of ``|C - P|`` and ``|C + P|``."""
    return math.sqrt(abs(c - p)) * math.sqrt(abs(c + p))


@kernel
def energy_on_piece(
    flight: Flight, track: TrackData, separatrix_track: TrackData
) -> tuple[float, float]:
    """Return the parameter ``m`` and the complementary modulus on an arc from the carried energy.

    ``separatrix_track`` is the body's track on the piece of ``flight.separatrix_piece``, unused if
    there is none.
    """
    if flight.separatrix_piece < 0:
        complement = (track.top - flight.specific_energy) / track.twice_radius
        root = _signed_root(complement)
    else:
        root = flight.separatrix_root
        if flight.separatrix_piece != flight.piece:
            scale = separatrix_track.twice_radius / track.twice_radius
            lift = (track.top - separatrix_track.top) / track.twice_radius
            if lift == 0.0:
                root *= math.sqrt(scale)
            else:
                root = _signed_root(lift + root * abs(root) * scale)
        complement = root * abs(root)
    if complement < 0.5:
        return 1.0 - complement, root
    return max((flight.specific_energy - track.bottom) / track.twice_radius, 0.0), root


@kernel
def _signed_root(complement: float) -> float:
    root = math.sqrt(abs(complement))
    return root if complement >= 0.0 else -root


@kernel
def launch_on_line(flight: Flight, left: float, right: float) -> None:
    """Set up a parabolic flight between two ends, its exit by the stable quadratic formula."""
    flight.form = LINE
    flight.frequency = 0.0
    a = flight.line_acceleration
    flight.angular_bound = 0.0
    flight.jerk_bound = 0.0
    flight.acceleration_bound = abs(a)
    v = flight.flow_p
    if v == 0.0 and a == 0.0:
        flight.at_rest = 1
        return
    to_right = right - flight.flow_s
    to_left = flight.flow_s - left
    if v > 0.0 or (v == 0.0 and a > 0.0):
        side = 1 if a >= 0.0 or v * v > -2.0 * a * to_right else -1
    else:
        side = -1 if a <= 0.0 or v * v > 2.0 * a * to_left else 1
    flight.exit_side = side
    length = to_right if side == 1 else to_left
    speed = v if side == 1 else -v  # towards the exit
    pull = a if side == 1 else -a
    end_speed = speed  # on a level line, even where its square would be zero
    if pull != 0.0:
        end_speed = math.sqrt(max(speed * speed + 2.0 * pull * length, 0.0))
    if speed >= 0.0:
        flight.exit_after = 2.0 * length / (speed + end_speed) if length > 0.0 else 0.0
    else:
        flight.exit_after = (end_speed - speed) / pull
    flight.exit_p = end_speed if side == 1 else -end_speed


@kernel
def _launch_on_arc(flight: Flight, track: TrackData) -> None:
    flight.frequency = track.frequency
    flight.line_acceleration = 0.0
    if flight.p == 0.0 and (flight.s == 0.0 or flight.c == 0.0):
        flight.at_rest = 1
    m = flight.parameter
    nearer_end = min(track.left_s * track.left_s, track.right_s * track.right_s)
    if track.lowest_s2 > 0.0 or m >= nearer_end * (1.0 - END_ROUNDING):
        choose_exit(flight, track.left_s, track.left_c, track.right_s, track.right_c)
    low = track.lowest_s2
    high = min(m, track.highest_s2)
    x_low = 4.0 * low * (1.0 - low)
    x_high = 4.0 * high * (1.0 - high)
    sine = 1.0 if low < 0.5 < high else math.sqrt(max(x_low, x_high))
    w2 = track.frequency * track.frequency
    flight.angular_bound = w2 * sine
    flight.jerk_bound = 2.0 * w2 * track.frequency * math.sqrt(max(m - low, 0.0))
    flight.snap_bound = snap_of_pendulum(w2, m)
    # |A|^2 = (g/kappa)^2 (4 S^2 C^2 + 16 P^4) is convex in S^2: its ends bound it.
    p2_low = m - low
    p2_high = m - high
    flight.acceleration_bound = track.gravity_rate * math.sqrt(
        max(x_low + 16.0 * p2_low * p2_low, x_high + 16.0 * p2_high * p2_high)
    )


@kernel
def snap_of_pendulum(w2: float, m: float) -> float:
    """Return a bound on the fourth derivative (rad/s^4) of f, ``w^2 (f'^2 + w^2)``."""
    return w2 * (4.0 * w2 * (1.0 + m))


@kernel
def angular_bound_of_libration(frequency: float, m: float) -> float:
    """Return a bound on ``|f''|`` (rad/s^2) of a libration about the bottom of an arc."""
    sine = 1.0 if m > 0.5 else math.sqrt(max(4.0 * m * (1.0 - m), 0.0))
    return frequency * frequency * sine


@kernel
def largest_libration(track: TrackData) -> float:
    """Return a parameter below which a libration stays clear of the ends of its piece."""
    nearer_end = min(track.left_s * track.left_s, track.right_s * track.right_s)
    return nearer_end * (1.0 - 2.0 * END_ROUNDING)


@kernel
def squared_rate_at(flight: Flight, s: float, c: float) -> float:
    """Return ``P^2`` where the flow passes ``(S, C)``: ``m - S^2``, or ``C^2 - (1 - m)`` on top."""
    if s == flight.flow_s and c == flight.flow_c:
        return flight.flow_p * flight.flow_p
    if s * s > 0.5:
        return c * c - flight.complementary_modulus * abs(flight.complementary_modulus)
    return flight.parameter - s * s


@kernel
def _reaches(flight: Flight, s: float, c: float) -> bool:
    """Return whether the flow passes an end ``(S, C)``, over a top if one lies between."""
    if flight.flow_c * c < 0.0 and flight.complementary_modulus >= 0.0:
        return False
    return squared_rate_at(flight, s, c) > 0.0


@kernel
def passing_rate(flight: Flight, s: float, c: float, direction: float) -> float:
    """Return the ``P`` with which the flow passes ``(S, C)`` in a direction (a sign).

    Returns 0 if it never does.
    """
    complement = flight.complementary_modulus
    if complement <= 0.0 and direction * flight.flow_p < 0.0:
        return 0.0  # neither a rotation nor motion on the separatrix turns back
    square = squared_rate_at(flight, s, c)
    if square <= 0.0 or (complement >= 0.0 and c * flight.flow_c < 0.0):
        return 0.0
    return math.copysign(math.sqrt(square), direction)


@kernel
def leaves_at_once(flight: Flight, right: bool, s: float, c: float) -> bool:
    """End a flight at once if it starts at the end of its path ahead; return whether it does.

    It may start short of the end or beyond it, by rounding.
    """
    if abs(flight.flow_s - s) > BEYOND_END or abs(flight.flow_c - c) > BEYOND_END:
        return False
    ahead = flight.flow_s * c
    behind = flight.flow_c * s
    side = 1 if right else -1
    if (ahead - behind) * side < -SHORT_OF_END * (abs(ahead) + abs(behind)):
        return False
    flight.exit_side = side
    flight.exit_p = flight.flow_p
    flight.exit_after = 0.0
    return True


@kernel
def choose_exit(
    flight: Flight, left_s: float, left_c: float, right_s: float, right_c: float
) -> None:
    """Find at which end of its path a flight leaves, and when.

    The ends are ``(S, C)`` of its flow.
    """
    if flight.at_rest == 1:
        return
    pull = -flight.flow_s * flight.flow_c
    right = flight.flow_p > 0.0 or (flight.flow_p == 0.0 and pull > 0.0)
    end_s = right_s if right else left_s
    end_c = right_c if right else left_c
    if leaves_at_once(flight, right, end_s, end_c):
        return
    reaches_right = _reaches(flight, right_s, right_c)
    reaches_left = _reaches(flight, left_s, left_c)
    if flight.complementary_modulus == 0.0 and flight.flow_p != 0.0:
        # On the separatrix a body never turns: it leaves ahead or creeps up to the crest for ever.
        reaches_right = reaches_right and right
        reaches_left = reaches_left and not right
    to_right = reaches_right and (right or not reaches_left)
    if not to_right and not reaches_left:
        return
    flight.exit_side = 1 if to_right else -1
    s = right_s if to_right else left_s
    c = right_c if to_right else left_c
    p = flight.exit_side * math.sqrt(squared_rate_at(flight, s, c))
    flight.exit_p = p
    if to_right == right:
        flight.exit_after = time_ahead(flight, s, c, p)
    else:
        flight.exit_after = time_of_flight(flight, s, c, p)


@kernel
def energy_of_state(s: float, c: float, p: float) -> tuple[float, float]:
    """Return the parameter ``m`` and the complementary modulus of a pendulum in a state."""
    return s * s + p * p, root_of_state(c, p)


@kernel
def _limit_by_lift_off(flight: Flight, body: BodyData, piece: PieceData) -> None:
    """End the flight where the normal force of a one-sided trace would turn negative.

    N = 0 at ``S^2 = (1 + 4 m/kappa)/(2 + 4/kappa)``; a valley supports the body below that, a hump
    above. On a line N = m g cos(alpha) throughout.
    """
    if piece.sign == 0.0:
        if piece.tangent_x < 0.0:
            _lift_off_now(flight)
        return
    limit = (1.0 + 4.0 * flight.parameter / body.kappa) / (2.0 + 4.0 / body.kappa)
    s2 = flight.s * flight.s
    outside = s2 > limit if piece.sign > 0.0 else s2 < limit
    if outside:
        _lift_off_now(flight)
        return
    if limit >= 1.0 or limit >= flight.parameter:
        return
    risen = flight.s * flight.c * flight.p >= 0.0
    if piece.sign < 0.0 and flight.complementary_modulus == 0.0 and risen:
        return  # it rests on the crest, or approaches it for ever
    s = math.sqrt(limit)
    c = math.sqrt(1.0 - limit)
    p = math.sqrt(max(flight.parameter - limit, 0.0))
    forward = flight.p if flight.p != 0.0 else -flight.s * flight.c
    if piece.sign < 0.0:
        # Below the crest's energy it leaves on the side where it is, else on the side it moves to.
        s = math.copysign(s, flight.s)
        to_right = flight.c * s < 0.0 if flight.complementary_modulus >= 0.0 else forward > 0.0
        c = -math.copysign(c, s) if to_right else math.copysign(c, s)
    else:
        to_right = forward > 0.0
        s = s if to_right else -s
        if flight.c < 0.0:
            s = -s
            c = -c
    p = p if to_right else -p
    after = time_of_flight(flight, s, c, p)
    if after < flight.exit_after:
        flight.exit_kind = LIFT_OFF
        flight.exit_after = after
        flight.exit_p = p


@kernel
def _lift_off_now(flight: Flight) -> None:
    flight.exit_kind = LIFT_OFF
    flight.exit_after = 0.0
    flight.exit_p = flight.p


@kernel
def is_at(s: float, c: float, end_s: float, end_c: float) -> bool:
    """Return whether a position is at an end of its arc, not at the other end of a full circle."""
    return abs(s * end_c - c * end_s) < AT_END and s * end_s + c * end_c > 0.0


@kernel
def half_way_to(half: float) -> float:
    """Return half the angle (rad) from a position to an end of its arc, made continuous.

    ``half`` is in (-pi, pi], from an arc tangent. Values below 0 are due to rounding: beyond the
    end, or, near -pi, at the other end of a full circle.
    """
    return half + 2.0 * math.pi if half < -0.5 * math.pi else half


# Where ``P^2 + (SC)^2`` is below this, the energy does not determine a state on the circle.
LEAST_SIZE = 1.0e-8
# Projection moves a state near a bottom by at most this, which is its rounding.
MOST_TURN = 8.0 * EPSILON
# A displacement below this share of the positions is lost in their rounding.
NOWHERE = 16.0 * EPSILON


@kernel
def begin_flight(world: World, ball: int, cause: int, from_state: int) -> None:
    """Launch and log the flight whose state is set, with the state's energy or the carried one."""
    flight = world.flights[ball]
    if world.pieces[flight.piece].sign != 0.0:
        m, root = arc_energy(world, ball, from_state)
        set_theta_constants(flight, m, root)
    elif from_state == 1:
        take_energy(world, ball)
    launch_and_log(world, ball, cause)


@kernel
def take_energy(world: World, ball: int) -> None:
    """Take the energy of a body from its state.

    Near a crest it is also taken relative to the crest, where it keeps full accuracy.
    """
    flight = world.flights[ball]
    flight.specific_energy = specific_energy_of_state(world, ball)
    refer_to_separatrix(flight, track_of(world, ball))


@kernel
def arc_energy(world: World, ball: int, from_state: int) -> tuple[float, float]:
    """Return the parameter and the complementary modulus of a flight that begins on an arc."""
    flight = world.flights[ball]
    if from_state == 1:
        take_energy(world, ball)
        return energy_of_state(flight.s, flight.c, flight.p)
    separatrix_piece = flight.separatrix_piece if flight.separatrix_piece >= 0 else flight.piece
    track = track_of(world, ball)
    return energy_on_piece(flight, track, track_on(world, ball, separatrix_piece))


@kernel
def launch_and_log(world: World, ball: int, cause: int) -> None:
    """Launch the flight whose state and constants are set, and log it."""
    settings = world.settings[0]
    flight = world.flights[ball]
    track = track_of(world, ball)
    piece = world.pieces[flight.piece]
    launch(flight, world.bodies[ball], piece, track, settings.one_sided)
    log_flight(world, ball, cause)


@kernel
def log_flight(world: World, ball: int, cause: int) -> None:
    """Log the flight of a body and reset the contact searches of its pairs."""
    flight = world.flights[ball]
    clock = world.clock[0]
    row = world.log[clock.flight_rows]
    row.body = ball
    row.piece = flight.piece
    row.t = flight.t
    row.t_low = flight.t_low
    row.s = flight.s
    row.c = flight.c
    row.p = flight.p
    row.before_s = flight.before_s
    row.before_c = flight.before_c
    row.before_p = flight.before_p
    row.parameter = flight.parameter
    row.complementary_modulus = flight.complementary_modulus
    row.specific_energy = flight.specific_energy
    row.saddle_root = flight.saddle_root
    row.cause = cause
    row.at_rest = flight.at_rest
    row.grouped = flight.grouped
    if flight.grouped != 0:
        _log_group(world, flight)
    elif row.group_count != 0:
        _clear_group(row)
    clock.flight_rows += 1
    for step in range(-1, 1):
        beside = pair_beside(world, ball, step)
        if beside >= 0:
            _forget(world, beside, flight)


@kernel
def _log_group(world: World, flight: Flight) -> None:
    """Log the fields that only a flight in lasting contact uses."""
    clock = world.clock[0]
    row = world.log[clock.flight_rows]
    row.group_first = flight.group_first
    row.group_count = flight.group_count
    row.flow_s = flight.flow_s
    row.flow_c = flight.flow_c
    row.flow_p = flight.flow_p
    row.shift_s = flight.shift_s
    row.shift_c = flight.shift_c
    row.rate_ratio = flight.rate_ratio
    row.frequency = flight.frequency
    row.line_acceleration = flight.line_acceleration
    row.segment = flight.segment
    if flight.segment > 0.0:
        segment = world.segments[clock.segment_rows]
        segment.flight = clock.flights_before + clock.flight_rows
        for k in range(SERIES_LENGTH):
            segment.series[k] = flight.series[k]
        clock.segment_rows += 1


@kernel
def _clear_group(row: FlightRow) -> None:
    """Clear the fields that a flight in lasting contact has left in a row that is used again."""
    row.group_first = 0
    row.group_count = 0
    row.flow_s = 0.0
    row.flow_c = 0.0
    row.flow_p = 0.0
    row.shift_s = 0.0
    row.shift_c = 0.0
    row.rate_ratio = 0.0
    row.frequency = 0.0
    row.line_acceleration = 0.0
    row.segment = 0.0


@kernel
def _forget(world: World, j: int, flight: Flight) -> None:
    pair = world.pairs[j]
    pair.contact_t = NEVER
    pair.contact_t_low = 0.0
    pair.apart = 0
    pair.touching = 0
    pair.searched = 0.0
    pair.begin_t = flight.t
    pair.begin_t_low = flight.t_low


@kernel
def project(flight: Flight, s: float, c: float, p: float) -> tuple[float, float, float]:
    """Return the nearest state with ``S^2 + C^2 = 1`` and the flight's energy (first order)."""
    scale = 1.5 - 0.5 * (s * s + c * c)
    s *= scale
    c *= scale
    sc = s * c
    size = p * p + sc * sc
    if size < LEAST_SIZE:
        return s, c, p
    return projected(flight, s, c, p, sc, size)


@kernel
def projected(
    flight: Flight, s: float, c: float, p: float, sc: float, size: float
) -> tuple[float, float, float]:
    """Project a state on the circle as :func:`project` does, given ``SC`` and ``P^2 + (SC)^2``."""
    root = flight.complementary_modulus
    is_high = s * s > 0.5
    lack = (c - p) * (c + p) - root * abs(root) if is_high else flight.parameter - s * s - p * p
    defect = 0.5 * lack / size
    beyond = not is_high and defect * defect * size > MOST_TURN * MOST_TURN
    if any_lane(beyond):
        # The carried energy is rounded relative to the trace's lowest position. For a small
        # libration about a higher bottom it is less accurate than the state; it would move bodies
        # apart.
        most = MOST_TURN / math.sqrt(size)
        defect = max(min(defect, most), -most) if beyond else defect
    turn = sc * defect
    return s + c * turn, c - s * turn, p + p * defect


@kernel
def state_at(world: World, ball: int, t: float, t_low: float) -> tuple[float, float, float]:
    """Return the state ``(S, C, P)`` of a body at an instant of its present flight."""
    flight = world.flights[ball]
    age = time_between(t, t_low, flight.t, flight.t_low)
    if age == 0.0 or flight.at_rest == 1:
        return flight.s, flight.c, flight.p
    s, c, p = flow(flight, age)
    if flight.own_frequency > 0.0 and flight.grouped == 0:
        return project(flight, s, c, p)
    return s, c, p


@kernel
def bring_to(world: World, ball: int, t: float, t_low: float) -> None:
    """Move a body to its state at an instant; its flight must then be launched anew."""
    flight = world.flights[ball]
    s, c, p = state_at(world, ball, t, t_low)
    place_at(flight, t, t_low, s, c, p)


@kernel
def is_same_instant(flight: Flight, t: float, t_low: float, s: float, c: float) -> bool:
    """Return whether all motion of a flight up to an instant and a position is rounding.

    The flight then counts as ending at the instant at which it began. A light body that bounces
    between a wall and a heavy body pressed to it moves like that once the gaps are too small to
    close.
    """
    age = time_between(t, t_low, flight.t, flight.t_low)
    if age == 0.0:
        return True
    if age > flight.brief:
        return False
    if flight.own_frequency > 0.0:
        return abs(s * flight.c - c * flight.s) <= NOWHERE
    return abs(s - flight.s) <= NOWHERE * flight.size


@kernel
def place_at(flight: Flight, t: float, t_low: float, s: float, c: float, p: float) -> None:
    """End a flight in a state, from which the next one starts."""
    if (flight.impacts > 0 or flight.fastest > 0.0) and not is_same_instant(flight, t, t_low, s, c):
        flight.impacts = 0
        flight.fastest = 0.0
    flight.t = t
    flight.t_low = t_low
    flight.s = s
    flight.c = c
    flight.p = p
    flight.before_s = s
    flight.before_c = c
    flight.before_p = p
