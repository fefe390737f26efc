"""The first contact of two free swings on one arc, for several scenarios in lanes at once.

The operations of ``kernels.contact.libration_contact`` for two bodies that have just parted,
without jumps:
where those would go another way, the lane is marked as failed.
"""

from __future__ import annotations

import math

from vibro_cli.compile.kernel import kernel, struct
from vibro_cli.compile.lanes import Lanes, any_lane, both, choose, either, opposite
from vibro_cli.kernels.contact.arc_root import (
    LONGEST_CHANGE,
    derivatives_of_sine,
    inverted,
    is_last,
)
from vibro_cli.kernels.contact.bounce import FAR, LONG
from vibro_cli.kernels.contact.first_contact import FINAL_CORRECTION
from vibro_cli.kernels.contact.gap import half_gap_sine
from vibro_cli.kernels.contact.libration_contact import frequency_of_difference, uneven_pull
from vibro_cli.kernels.flow.flow import (
    advance_slightly,
    by_addition,
    pendulum_acceleration,
    pendulum_jerk,
)
from vibro_cli.kernels.numerics.conservative_advancement import (
    is_clear_with,
    safe_time,
    time_of_rise,
)
from vibro_cli.kernels.numerics.elliptic import trigonometric_form
from vibro_cli.kernels.numerics.trigonometry import REDUCTION_LIMIT, sine_cosine_in_lanes
from vibro_cli.kernels.structs import BodyData, Flight, PairTrack

# Evaluations of both flows for one contact; a lane that needs more fails.
MOST_EVALUATIONS = 5


@struct
class BodyLanes(BodyData):
    """One body in every lane."""

    mass: Lanes
    rolling_mass: Lanes
    weight: Lanes


@struct
class SwingLanes(Flight):
    """The flight of one body in every lane: a libration by itself, on the same arc in all."""

    flow_s: Lanes
    flow_c: Lanes
    flow_p: Lanes
    head: Lanes
    angular_bound: Lanes
    parameter: Lanes
    root_complement: Lanes
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
    contact_s: Lanes  # (S, C, P) at the contact
    contact_c: Lanes
    contact_p: Lanes
    next_p: Lanes  # P after it, the energy and the parameter
    next_head: Lanes
    next_m: Lanes
    next_root: Lanes


@kernel
def contact_in_lanes(a: SwingLanes, b: SwingLanes, contact: PairTrack) -> tuple[Lanes, bool]:
    """First contact of two swings that have just parted, in all lanes.

    Returns
    -------
    Its time (s) from the start of both flights, the states being left in ``a`` and ``b``; and in
    which lanes it is not certain.
    """
    rate = 2.0 * (b.frequency * b.flow_p - a.frequency * a.flow_p)
    fastest = max(a.frequency, b.frequency)
    level = math.pi - contact.far_gap
    if a.frequency != b.frequency:
        level += uneven_pull(a, b) / (fastest * fastest)
    over = choose(rate > 0.0, 2.0 * rate, 0.0)
    clear = safe_time(over, fastest * (2.0 * level), fastest)
    failed = clear <= 0.0
    mean_s = 0.5 * (b.flow_s + a.flow_s)
    mean_p = 0.5 * (b.flow_p + a.flow_p)
    slowed = frequency_of_difference(a, b, level, rate, mean_s, mean_p, 1.0)
    h, lost = _refined(a, b, time_of_rise(over, slowed * (2.0 * level), slowed), contact)
    failed = either(failed, lost)
    approach = 2.0 * (a.frequency * a.contact_p - b.frequency * b.contact_p)
    certain = both(approach > 0.0, is_clear_with(h - clear, approach, level, fastest))
    # Short flights from contact to contact are timed otherwise (kernels.contact.bounce).
    long = both(a.frequency * h > LONG, h > 0.0)
    long = both(either(long, b.frequency * h > LONG), h > 0.0)
    far = both(approach > 0.0, approach * h > FAR)
    return h, either(failed, opposite(both(certain, either(long, far))))


@kernel
def _refined(a: SwingLanes, b: SwingLanes, h: Lanes, contact: PairTrack) -> tuple[Lanes, bool]:
    """Zero of the sine of half the gap (see ``kernels.contact.arc_root``); where it is not
    found."""
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
        falls = both(x1 < 0.0, abs(change) * fastest <= LONGEST_CHANGE)
        ends = both(falls, is_last(change, x1, x2, fastest, FINAL_CORRECTION))
        ends = both(ends, opposite(done))
        if any_lane(ends):
            a_s, a_c, a_p = advance_slightly(a.frequency, change, a_s, a_c, a_p)
            b_s, b_c, b_p = advance_slightly(b.frequency, change, b_s, b_c, b_p)
            _keep(a, ends, a_s, a_c, a_p)
            _keep(b, ends, b_s, b_c, b_p)
        h = choose(done, h, h + change)
        falls = both(falls, abs(h) * (a.frequency + b.frequency) < 0.1 * REDUCTION_LIMIT)
        lost = either(lost, both(opposite(falls), opposite(done)))
        done = either(either(done, ends), lost)
        if not any_lane(opposite(done)):
            break
    return h, either(lost, opposite(done))


@kernel
def flow_in_lanes(swing: Flight, t: Lanes) -> tuple[Lanes, Lanes, Lanes]:
    """State of a libration a time t (s) after its start (see ``kernels.flow.flow.flow_of_two``)."""
    s, c = sine_cosine_in_lanes(swing.frequency * t * swing.argument_scale)
    s, c, d, common = trigonometric_form(swing, s, c)
    return by_addition(swing, s, c, d, common)


@kernel
def _keep(swing: SwingLanes, where: bool, s: Lanes, c: Lanes, p: Lanes) -> None:
    swing.contact_s = choose(where, s, swing.contact_s)
    swing.contact_c = choose(where, c, swing.contact_c)
    swing.contact_p = choose(where, p, swing.contact_p)
