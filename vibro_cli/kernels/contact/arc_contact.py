"""The certified search for the first contact of two neighbours on one arc.

Two free swings are tried as a whole (``kernels.contact.libration_contact``); what that leaves
open, and all
other motions, are searched step by step (see ``kernels.contact.first_contact``).
"""

from __future__ import annotations

import math

from vibro_cli.compile.kernel import kernel
from vibro_cli.kernels.contact.arc_root import refine_on_arc
from vibro_cli.kernels.contact.first_contact import (
    DEEP,
    NONE_BEFORE_LIMIT,
    UNRESOLVED,
    keep_states,
)
from vibro_cli.kernels.contact.gap import half_gap_sine
from vibro_cli.kernels.contact.libration_contact import contact_of_swings
from vibro_cli.kernels.flow.flow import (
    angular_acceleration_at,
    angular_jerk,
    flow_of_two,
    swings,
)
from vibro_cli.kernels.numerics.conservative_advancement import (
    safe_step_third_order,
    unresolved_step,
)
from vibro_cli.kernels.structs import RELEASED, Clock, Flight, PairData, PairTrack

# Safety of the certificate of a single root against rounding: g'^2 > 2 A g.
SINGLE_ROOT = 2.01


@kernel
def both_swing(a: Flight, b: Flight) -> bool:
    """Tell whether two flights are such that their contact may be guessed."""
    return swings(a) and swings(b)


@kernel
def contact_on_arc(
    a: Flight,
    b: Flight,
    age_a: float,
    age_b: float,
    touching: int,
    horizon: float,
    limit: float,
    contact: PairTrack,
    orientation: float,
    pair: PairData,
    clock: Clock,
) -> float:
    """First contact of two bodies on one arc.

    Parameters
    ----------
    a, b
        The flights; ``age_a, age_b`` the times since their starts at the begin of the search, s.
    touching
        ``PARTING`` or ``RELEASED`` if they are in contact there and going apart, else 0.
    horizon, limit
        The search may stop after ``horizon`` (s from its begin), which decides on no step of it;
        the first of the flights ends at ``limit``.
    contact, orientation
        Constants of contact on the arc; -1 if b is one lap ahead.
    pair
        ``searched``: how far the search has come (s from its begin), where it goes on.

    Returns
    -------
    Time of the first contact from the begin (s), the states then being left in ``pair``;
    ``NONE_BEFORE_LIMIT`` if there is none before the horizon.
    """
    wa = a.own_frequency
    wb = b.own_frequency
    t = pair.searched
    if t == 0.0 and touching != RELEASED and both_swing(a, b):
        h, t = contact_of_swings(
            a, b, age_a, age_b, touching, limit, contact, orientation, pair, clock
        )
        if h >= 0.0:
            pair.searched = limit
            return h if h <= limit else NONE_BEFORE_LIMIT
        if t > horizon:
            pair.searched = t
            return NONE_BEFORE_LIMIT
    bound_2 = a.angular_bound + b.angular_bound
    bound_3 = a.jerk_bound + b.jerk_bound
    while True:
        a_s, a_c, a_p, b_s, b_c, b_p = flow_of_two(a, b, age_a + t, age_b + t)
        clock.evaluations += 1
        x, cosine = half_gap_sine(contact, a_s, a_c, b_s, b_c, orientation)
        gap = contact.far_gap
        if cosine > 0.0:
            gap = 2.0 * x if x > 0.0 else 0.0
        rate = 2.0 * (wb * b_p - wa * a_p)
        second = angular_acceleration_at(b, age_b + t, b_s, b_c)
        second -= angular_acceleration_at(a, age_a + t, a_s, a_c)
        if touching != 0 and t == 0.0:
            if touching == RELEASED:
                t = released_step(a, b, a_s, a_c, a_p, b_s, b_c, b_p, rate)
                if t > horizon:
                    pair.searched = t
                    return NONE_BEFORE_LIMIT
                continue
            gap = 0.0
            rate = max(rate, 0.0)
            if rate == 0.0 and second <= 0.0:
                # Marked as parting, but at rest against one another and pressed together.
                keep_states(pair, a_s, a_c, a_p, b_s, b_c, b_p)
                return 0.0
        single = rate * rate > SINGLE_ROOT * bound_2 * gap * (1.0 + 0.5 * x * x)
        if rate < 0.0 and single and cosine > 0.0 and x < 0.5:
            x2 = x * x
            gap = 2.0 * x * (1.0 + x2 * (1.0 / 6.0 + x2 * (3.0 / 40.0 + x2 * (15.0 / 336.0))))
            if (
                t + 2.0 * gap / (math.sqrt(rate * rate + 2.0 * bound_2 * max(gap, 0.0)) - rate)
                > limit
            ):
                pair.searched = limit
                return NONE_BEFORE_LIMIT
            third = angular_jerk(b, b_s, b_c, b_p) - angular_jerk(a, a_s, a_c, a_p)
            h = _cubic_guess(gap, rate, second, third)
            h = refine_on_arc(a, b, age_a + t, age_b + t, h, contact, orientation, pair, clock)
            before = NONE_BEFORE_LIMIT < h < -t
            if before or (x <= 0.0 and not -t <= h <= 0.0):
                # In contact by rounding, with no root since the begin: now, in the states of now.
                keep_states(pair, a_s, a_c, a_p, b_s, b_c, b_p)
                pair.searched = limit
                return t
            if h > NONE_BEFORE_LIMIT:
                pair.searched = limit
                return t + h if t + h <= limit else NONE_BEFORE_LIMIT
        step = safe_step_third_order(max(gap, 0.0), rate, second, bound_2, bound_3)
        inside = x < -0.5 * DEEP * UNRESOLVED
        if gap <= 0.0 and rate >= 0.0 and not inside and (touching == 0 or t > 0.0):
            # At least so long the bodies are in contact or apart by less than rounding.
            step = max(step, unresolved_step(second, bound_3, UNRESOLVED))
        if t + step > horizon:
            pair.searched = t + step
            return NONE_BEFORE_LIMIT
        if t + step == t and (t > 0.0 or touching == 0):
            # The gap closes below the resolution of time: contact, tangential within rounding.
            keep_states(pair, a_s, a_c, a_p, b_s, b_c, b_p)
            return t
        t += step


@kernel
def _cubic_guess(gap: float, rate: float, second: float, third: float) -> float:
    """Root of the quadratic, improved by one step on the cubic."""
    h = 2.0 * gap / (math.sqrt(max(rate * rate - 2.0 * second * gap, 0.0)) - rate)
    slope = rate + h * (second + 0.5 * h * third)
    if slope < 0.0:
        h -= (gap + h * (rate + h * (0.5 * second + h * third * (1.0 / 6.0)))) / slope
    return h


@kernel
def released_step(
    a: Flight,
    b: Flight,
    a_s: float,
    a_c: float,
    a_p: float,
    b_s: float,
    b_c: float,
    b_p: float,
    rate: float,
) -> float:
    """Step up to which a pair whose contact force has just vanished stays apart.

    There the gap starts as ``j h^3/6``, bounded below by ``j h^3/6 - B h^4/24`` with j its jerk and
    ``B`` the sum of ``w^2 (f'^2 + w^2)``.
    """
    wa = a.frequency
    wb = b.frequency
    third = angular_jerk(b, b_s, b_c, b_p) - angular_jerk(a, a_s, a_c, a_p)
    bound_a = wa * wa * (4.0 * wa * wa * (1.0 + a.parameter))
    bound_b = wb * wb * (4.0 * wb * wb * (1.0 + b.parameter))
    if third <= 0.0 or rate < -1.0e-9 * (abs(wa * a_p) + abs(wb * b_p)):
        return 1.0e-9 / (wa + wb)
    return 3.0 * third / (bound_a + bound_b)
