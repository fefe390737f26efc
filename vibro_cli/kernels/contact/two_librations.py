"""The first contact of two free swings on one arc, both bodies in the lanes of one register.

The operations of ``kernels.contact.libration_contact`` for two bodies that have just parted; where
those
would go another way, the contact is not looked for.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from vibro_cli.compile.kernel import kernel, struct
from vibro_cli.compile.lanes import Two, in_lane
from vibro_cli.kernels.contact.arc_root import (
    LONGEST_CHANGE,
    derivatives_of_sine,
    inverted,
    is_last,
)
from vibro_cli.kernels.contact.bounce import FAR, LONG
from vibro_cli.kernels.contact.first_contact import FINAL_CORRECTION, NONE_BEFORE_LIMIT
from vibro_cli.kernels.contact.gap import half_gap_sine
from vibro_cli.kernels.contact.libration_contact import frequency_of_difference, uneven_pull
from vibro_cli.kernels.contact.libration_contact_lanes import MOST_EVALUATIONS, flow_in_lanes
from vibro_cli.kernels.flow.flow import advance_slightly, pendulum_acceleration, pendulum_jerk
from vibro_cli.kernels.numerics.conservative_advancement import (
    is_clear_before,
    safe_time,
    time_of_rise,
)
from vibro_cli.kernels.numerics.trigonometry import REDUCTION_LIMIT
from vibro_cli.kernels.structs import Clock, Flight, PairTrack, TrackData


@struct
class TwoSwings(Flight):
    """The flights of two bodies, a lane for each."""

    frequency: Two
    flow_s: Two
    flow_c: Two
    flow_p: Two
    parameter: Two
    root_complement: Two
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
    contact_s: Two  # (S, C, P) at the contact
    contact_c: Two
    contact_p: Two
    head: Two
    weight: Two
    most_parameter: Two  # of such flights


@struct
class TwoTracks(TrackData):
    """The paths of both bodies, a lane for each."""

    speed_factor: Two
    top: Two
    bottom: Two
    twice_radius: Two


class TwoBodies(NamedTuple):
    """Two bodies in lanes: one record of each kind."""

    swings: Sequence[TwoSwings]
    tracks: Sequence[TwoTracks]


@kernel
def contact_of_two(two: TwoSwings, a: Flight, b: Flight, contact: PairTrack, clock: Clock) -> float:
    """Time (s) of the first contact from the start of both flights, the states left in ``two``.

    ``NONE_BEFORE_LIMIT`` where it is not certain. Of ``a`` and ``b`` the frequencies count, and
    the bounds if these differ.
    """
    wa = a.frequency
    wb = b.frequency
    a_p = in_lane(two.flow_p, 0)
    b_p = in_lane(two.flow_p, 1)
    rate = 2.0 * (wb * b_p - wa * a_p)
    fastest = max(wa, wb)
    level = math.pi - contact.far_gap
    if wa != wb:
        level += uneven_pull(a, b) / (fastest * fastest)
    over = 2.0 * rate if rate > 0.0 else 0.0
    clear = safe_time(over, fastest * (2.0 * level), fastest)
    if clear <= 0.0:
        return NONE_BEFORE_LIMIT
    mean_s = 0.5 * (in_lane(two.flow_s, 1) + in_lane(two.flow_s, 0))
    mean_p = 0.5 * (b_p + a_p)
    slowed = frequency_of_difference(a, b, level, rate, mean_s, mean_p, 1.0)
    guess = time_of_rise(over, slowed * (2.0 * level), slowed)
    h = _refined(two, guess, contact, clock)
    if h <= 0.0:
        return NONE_BEFORE_LIMIT
    approach = 2.0 * (wa * in_lane(two.contact_p, 0) - wb * in_lane(two.contact_p, 1))
    if not is_clear_before(h - clear, approach, level, fastest):
        return NONE_BEFORE_LIMIT
    # Short flights from contact to contact are timed otherwise (kernels.contact.bounce).
    return h if fastest * h > LONG or approach * h > FAR else NONE_BEFORE_LIMIT


@kernel
def _refined(two: TwoSwings, h: float, contact: PairTrack, clock: Clock) -> float:
    """Zero of the sine of half the gap (see ``kernels.contact.arc_root``)."""
    w = two.frequency
    wa = in_lane(w, 0)
    wb = in_lane(w, 1)
    fastest = max(wa, wb)
    for _ in range(MOST_EVALUATIONS):
        if fastest * abs(h) > 0.1 * REDUCTION_LIMIT:
            break
        s, c, p = flow_in_lanes(two, h)
        clock.evaluations += 1
        second = pendulum_acceleration(w, s, c)
        third = pendulum_jerk(w, s, c, 2.0 * w * p)
        x, cosine = half_gap_sine(
            contact, in_lane(s, 0), in_lane(c, 0), in_lane(s, 1), in_lane(c, 1), 1.0
        )
        rate = 2.0 * (wb * in_lane(p, 1) - wa * in_lane(p, 0))
        x1, x2, x3 = derivatives_of_sine(
            x, cosine, rate,
            in_lane(second, 1) - in_lane(second, 0), in_lane(third, 1) - in_lane(third, 0),
        )  # fmt: skip
        if x1 >= 0.0:
            break
        change = inverted(x, x1, x2, x3)
        if not abs(change) * fastest <= LONGEST_CHANGE:
            break
        h += change
        if is_last(change, x1, x2, fastest, FINAL_CORRECTION):
            two.contact_s, two.contact_c, two.contact_p = advance_slightly(w, change, s, c, p)
            return h
    return NONE_BEFORE_LIMIT
