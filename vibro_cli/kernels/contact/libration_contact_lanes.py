"""The first contact of two free librations on one arc, in lanes of scenarios or of both bodies.

The operations are those of ``kernels.contact.arc_contact`` for two bodies that have just separated,
without branches. Where a branch would go another way, a lane is marked as failed; with lanes of
both bodies, the contact is then not searched for.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from vibro_cli.compile.kernel import Lanes, Two, any_lane, extract, kernel, struct
from vibro_cli.kernels.contact.arc_contact import (
    LONGEST_CHANGE,
    derivatives_of_sine,
    frequency_of_difference,
    inverted,
    is_last,
    uneven_torque,
)
from vibro_cli.kernels.contact.contact_kinematics import half_gap_sine
from vibro_cli.kernels.contact.first_contact import FAR, FINAL_CORRECTION, LONG, NONE_BEFORE_LIMIT
from vibro_cli.kernels.flow.flight import LEAST_SIZE, projected
from vibro_cli.kernels.flow.flow import (
    advance_slightly,
    by_addition,
    librates,
    pendulum_acceleration,
    pendulum_jerk,
)
from vibro_cli.kernels.numerics.conservative_advancement import (
    is_clear_before,
    safe_time,
    time_of_rise,
)
from vibro_cli.kernels.numerics.constants import NEVER
from vibro_cli.kernels.numerics.elliptic import (
    REDUCTION_LIMIT,
    TRIGONOMETRIC,
    reduced_sine_cosine,
    trigonometric_form,
)
from vibro_cli.kernels.world import (
    PARTING,
    BodyData,
    Clock,
    Flight,
    PairTrack,
    TrackData,
    World,
    track_on,
)

# Most evaluations of both flows for one contact; a lane that needs more fails.
MOST_EVALUATIONS = 5


@struct
class BodyLanes(BodyData):
    """One body in all lanes."""

    mass: Lanes
    rolling_mass: Lanes
    weight: Lanes


@struct
class Meeting(Flight):
    """A flight and its state at contact."""

    contact_s: float  # (S, C, P)
    contact_c: float
    contact_p: float


@struct
class LibrationLanes(Meeting):
    """The flight of one body in all lanes: a free libration, on the same arc in each."""

    flow_s: Lanes
    flow_c: Lanes
    flow_p: Lanes
    specific_energy: Lanes
    angular_bound: Lanes
    parameter: Lanes
    complementary_modulus: Lanes
    argument_scale: Lanes
    even_0: Lanes
    even_2: Lanes
    even_4: Lanes
    odd_1: Lanes
    odd_3: Lanes
    sum_0: Lanes
    sum_2: Lanes
    difference_1: Lanes
    difference_3: Lanes
    sine_scale: Lanes
    cosine_scale: Lanes
    delta_scale: Lanes
    two_nome: Lanes
    contact_s: Lanes
    contact_c: Lanes
    contact_p: Lanes
    next_p: Lanes  # P, energy and parameter after the contact
    next_specific_energy: Lanes
    next_m: Lanes
    next_root: Lanes


@kernel
def contact_in_lanes(
    a: LibrationLanes, b: LibrationLanes, contact: PairTrack
) -> tuple[Lanes, bool]:
    """Return the first contact of two librations that have just separated, in all lanes.

    Returns its time (s) from the start of both flights, with the states left in ``a`` and ``b``,
    and in which lanes it is uncertain.
    """
    rate = 2.0 * (b.frequency * b.flow_p - a.frequency * a.flow_p)
    mean_s = 0.5 * (b.flow_s + a.flow_s)
    mean_p = 0.5 * (b.flow_p + a.flow_p)
    clear, guess, level = _expected(a, b, contact, rate, mean_s, mean_p)
    h, lost = _refined(a, b, guess, contact)
    approach = 2.0 * (a.frequency * a.contact_p - b.frequency * b.contact_p)
    certain = _is_certain(h, clear, approach, level, max(a.frequency, b.frequency))
    return h, clear <= 0.0 or lost or not certain


@kernel
def _expected(
    a: Flight, b: Flight, contact: PairTrack, rate: float, mean_s: float, mean_p: float
) -> tuple[float, float, float]:
    """Return a time (s) before which two separating librations do not meet, and an estimate.

    Also returns the contact angle (rad), increased by what unequal frequencies add.
    """
    fastest = max(a.frequency, b.frequency)
    uneven = uneven_torque(a, b) / (fastest * fastest) if a.frequency != b.frequency else 0.0
    level = math.pi - contact.far_gap + uneven
    over = 2.0 * rate if rate > 0.0 else 0.0
    clear = safe_time(over, fastest * (2.0 * level), fastest)
    slowed = frequency_of_difference(a, b, level, rate, mean_s, mean_p, 1.0)
    return clear, time_of_rise(over, slowed * (2.0 * level), slowed), level


@kernel
def _is_certain(h: float, clear: float, approach: float, level: float, fastest: float) -> bool:
    """Return whether a contact is certainly the first one and does not end a short flight.

    Short flights from contact to contact are timed differently (kernels.contact.first_contact).
    """
    long = fastest * h > LONG or approach * h > FAR
    return is_clear_before(h - clear, approach, level, fastest) and long


@kernel
def _refined(
    a: LibrationLanes, b: LibrationLanes, h: Lanes, contact: PairTrack
) -> tuple[Lanes, bool]:
    """Return the zero of the sine of half the gap, as ``refine_on_arc``, and where it is lost."""
    fastest = max(a.frequency, b.frequency)
    lost = h * (a.frequency + b.frequency) > 0.1 * REDUCTION_LIMIT
    done = lost
    for _ in range(MOST_EVALUATIONS):
        a_s, a_c, a_p = flow_in_lanes(a, h)
        b_s, b_c, b_p = flow_in_lanes(b, h)
        rate_a = 2.0 * a.frequency * a_p
        rate_b = 2.0 * b.frequency * b_p
        rate = 2.0 * (b.frequency * b_p - a.frequency * a_p)
        second = pendulum_acceleration(b.frequency, b_s, b_c)
        second -= pendulum_acceleration(a.frequency, a_s, a_c)
        third = pendulum_jerk(b.frequency, b_s, b_c, rate_b)
        third -= pendulum_jerk(a.frequency, a_s, a_c, rate_a)
        x, cosine = half_gap_sine(contact, a_s, a_c, b_s, b_c, 1.0)
        x1, x2, x3 = derivatives_of_sine(x, cosine, rate, second, third)
        change = inverted(x, x1, x2, x3)
        falls = x1 < 0.0 and abs(change) * fastest <= LONGEST_CHANGE
        ends = falls and is_last(x, change, x1, x2, fastest, FINAL_CORRECTION)
        ends = ends and not done
        if any_lane(ends):
            a_s, a_c, a_p = advance_slightly(a.frequency, change, a_s, a_c, a_p)
            b_s, b_c, b_p = advance_slightly(b.frequency, change, b_s, b_c, b_p)
            _keep(a, ends, a_s, a_c, a_p)
            _keep(b, ends, b_s, b_c, b_p)
        h = h if done else h + change
        falls = falls and abs(h) * (a.frequency + b.frequency) < 0.1 * REDUCTION_LIMIT
        lost = lost or not (falls or done)
        done = done or ends or lost
        if not any_lane(not done):
            break
    return h, lost or not done


@kernel
def flow_in_lanes(libration: Flight, t: Lanes) -> tuple[Lanes, Lanes, Lanes]:
    """Return the state of a libration a time t (s) after its start (see ``kernels.flow.flow``)."""
    s, c = reduced_sine_cosine(libration.frequency * t * libration.argument_scale)
    s, c, d, common = trigonometric_form(libration, s, c)
    return by_addition(libration.flow_s, libration.flow_c, libration.flow_p, s, c, d, common)


@kernel
def _keep(libration: LibrationLanes, where: bool, s: Lanes, c: Lanes, p: Lanes) -> None:
    libration.contact_s = s if where else libration.contact_s
    libration.contact_c = c if where else libration.contact_c
    libration.contact_p = p if where else libration.contact_p


@kernel
def project_libration(libration: Meeting) -> bool:
    """Project the state of contact as ``kernels.flow.flight.project``; return where this fails."""
    s = libration.contact_s
    c = libration.contact_c
    p = libration.contact_p
    scale = 1.5 - 0.5 * (s * s + c * c)
    s *= scale
    c *= scale
    sc = s * c
    size = p * p + sc * sc
    s, c, p = projected(libration, s, c, p, sc, size)
    libration.contact_s = s
    libration.contact_c = c
    libration.contact_p = p
    return size < LEAST_SIZE


@struct
class TwoLibrations(Meeting):
    """The flights of two bodies, one lane each."""

    frequency: Two
    flow_s: Two
    flow_c: Two
    flow_p: Two
    parameter: Two
    complementary_modulus: Two
    argument_scale: Two
    even_0: Two
    even_2: Two
    even_4: Two
    odd_1: Two
    odd_3: Two
    sum_0: Two
    sum_2: Two
    difference_1: Two
    difference_3: Two
    sine_scale: Two
    cosine_scale: Two
    delta_scale: Two
    two_nome: Two
    contact_s: Two
    contact_c: Two
    contact_p: Two
    specific_energy: Two
    weight: Two
    most_parameter: Two  # upper limit of the parameter of such flights


@struct
class TwoTracks(TrackData):
    """The paths of two bodies, one lane each."""

    speed_factor: Two
    top: Two
    bottom: Two
    twice_radius: Two


class TwoBodies(NamedTuple):
    """Two bodies in lanes: one record of each kind."""

    librations: Sequence[TwoLibrations]
    tracks: Sequence[TwoTracks]


@kernel
def contact_of_two(
    two: TwoLibrations, a: Flight, b: Flight, contact: PairTrack, clock: Clock
) -> float:
    """Return the time (s) of the first contact from the start of both flights.

    The states are left in ``two``. Returns ``NONE_BEFORE_LIMIT`` if the contact is uncertain. Only
    the frequencies of ``a`` and ``b`` are used, and their bounds if the frequencies differ.
    """
    wa = a.frequency
    wb = b.frequency
    a_p = extract(two.flow_p, 0)
    b_p = extract(two.flow_p, 1)
    rate = 2.0 * (wb * b_p - wa * a_p)
    mean_s = 0.5 * (extract(two.flow_s, 1) + extract(two.flow_s, 0))
    clear, guess, level = _expected(a, b, contact, rate, mean_s, 0.5 * (b_p + a_p))
    if clear <= 0.0:
        return NONE_BEFORE_LIMIT
    h = _refined_of_two(two, guess, contact, clock)
    if h <= 0.0:
        return NONE_BEFORE_LIMIT
    approach = 2.0 * (wa * extract(two.contact_p, 0) - wb * extract(two.contact_p, 1))
    certain = _is_certain(h, clear, approach, level, max(wa, wb))
    return h if certain else NONE_BEFORE_LIMIT


@kernel
def _refined_of_two(two: TwoLibrations, h: float, contact: PairTrack, clock: Clock) -> float:
    """Return the zero of the sine of half the gap (see ``kernels.contact.arc_contact``)."""
    w = two.frequency
    wa = extract(w, 0)
    wb = extract(w, 1)
    fastest = max(wa, wb)
    for _ in range(MOST_EVALUATIONS):
        if fastest * abs(h) > 0.1 * REDUCTION_LIMIT:
            break
        s, c, p = flow_in_lanes(two, h)
        clock.evaluations += 1
        second = pendulum_acceleration(w, s, c)
        third = pendulum_jerk(w, s, c, 2.0 * w * p)
        x, cosine = half_gap_sine(
            contact, extract(s, 0), extract(c, 0), extract(s, 1), extract(c, 1), 1.0
        )
        rate = 2.0 * (wb * extract(p, 1) - wa * extract(p, 0))
        x1, x2, x3 = derivatives_of_sine(
            x, cosine, rate,
            extract(second, 1) - extract(second, 0), extract(third, 1) - extract(third, 0),
        )  # fmt: skip
        if x1 >= 0.0:
            break
        change = inverted(x, x1, x2, x3)
        if not abs(change) * fastest <= LONGEST_CHANGE:
            break
        h += change
        if is_last(x, change, x1, x2, fastest, FINAL_CORRECTION):
            two.contact_s, two.contact_c, two.contact_p = advance_slightly(w, change, s, c, p)
            return h
    return NONE_BEFORE_LIMIT


# While these kernels do not apply, the event loop handles up to this many impacts in a row.
LONGEST_STAY = 1 << 12


@kernel
def fits(world: World, piece: int) -> bool:
    """Return whether two bodies have just separated and librate on an arc, clear of its ends."""
    clock = world.clock[0]
    pair = world.pairs[0]
    valley = world.pieces[piece].sign > 0.0 and world.contacts[piece].normal_a > 0.0
    fit = valley and clock.held_pairs == 0 and clock.unlogged == 0
    fit = fit and pair.touching == PARTING and pair.searched == 0.0 and pair.contact_t == NEVER
    for ball in range(2):
        flight = world.flights[ball]
        track = track_on(world, ball, piece)
        end = min(track.left_s * track.left_s, track.right_s * track.right_s)
        fit = fit and flight.piece == piece and librates(flight) and flight.form == TRIGONOMETRIC
        fit = fit and track.lowest_s2 == 0.0 and flight.exit_after == NEVER
        fit = fit and 0.0 < flight.parameter < end and flight.complementary_modulus > 0.0
        fit = (
            fit
            and flight.separatrix_piece < 0
            and flight.t == clock.t
            and flight.t_low == clock.t_low
        )
    return fit
