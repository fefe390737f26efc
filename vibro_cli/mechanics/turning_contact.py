"""The first contact of two bodies alone on one arc of a turning trace, guessed and certified.

The kernels stand in for those of ``mechanics.swing_contact``. The difference y of their angles
obeys ``y'' >= -W^2 y`` with the steepest fall of the pull on the arc: ``W^2 = w^2 max(-pull')``.
"""

from __future__ import annotations

import math

from vibro_cli.mechanics.arc_root import refine_on_arc
from vibro_cli.mechanics.contact import NONE_BEFORE_LIMIT
from vibro_cli.mechanics.flow import angular_acceleration, flow_of_two
from vibro_cli.mechanics.gap import half_gap_sine
from vibro_cli.mechanics.records import Clock, Flight, PairData, PairTrack
from vibro_cli.mechanics.swing_contact import FAR_GUESS
from vibro_cli.numerics.elliptic import HYPERBOLIC_TINY
from vibro_cli.numerics.engine import kernel
from vibro_cli.numerics.first_root import first_return, is_clear_before, safe_return

# The frequency of a difference of angles is taken as no less than this share of the greatest one.
LEAST_SHARE = 0.2


@kernel
def are_alone(a: Flight, b: Flight) -> bool:
    """Tell whether two flights on an arc are each of a body alone, and moving."""
    if a.grouped + b.grouped + a.at_rest + b.at_rest != 0:
        return False
    return a.form <= HYPERBOLIC_TINY and b.form <= HYPERBOLIC_TINY


@kernel
def contact_of_swings(
    a: Flight,
    b: Flight,
    age_a: float,
    age_b: float,
    touching: int,
    limit: float,
    contact: PairTrack,
    orientation: float,
    pair: PairData,
    clock: Clock,
) -> tuple[float, float]:
    """First contact of two bodies, and a time before which there is none (as at rest)."""
    a_s, a_c, a_p, b_s, b_c, b_p = flow_of_two(a, b, age_a, age_b)
    clock.evaluations += 1
    gap = 0.0
    rate = 2.0 * (b.frequency * b_p - a.frequency * a_p)
    if touching == 0:
        x, cosine = half_gap_sine(contact, a_s, a_c, b_s, b_c, orientation)
        gap = max(2.0 * math.atan2(x, cosine), 0.0)
    square = max(a.steepest, b.steepest)
    fastest = math.sqrt(square)
    level = math.pi - contact.far_gap
    if a.frequency != b.frequency:
        level += _uneven_pull(a, b) / square
    clear = safe_return(gap, rate, level, fastest)
    if clear <= 0.0:
        return NONE_BEFORE_LIMIT, 0.0
    second = angular_acceleration(b, b_s, b_c) - angular_acceleration(a, a_s, a_c)
    share = max(-second / ((gap + level) * square), LEAST_SHARE)
    guess = first_return(gap, rate, level, fastest * math.sqrt(min(share, 1.0)))
    if guess > FAR_GUESS * limit:
        return NONE_BEFORE_LIMIT, clear
    h = refine_on_arc(a, b, age_a, age_b, guess, contact, orientation, pair, clock)
    if h < 0.0:
        return NONE_BEFORE_LIMIT, clear
    approach = 2.0 * (a.frequency * pair.a_p - b.frequency * pair.b_p)
    if is_clear_before(h - clear, approach, level, fastest):
        return h, clear
    return NONE_BEFORE_LIMIT, clear


@kernel
def _uneven_pull(a: Flight, b: Flight) -> float:
    """Bound on the difference of both pulls (rad/s^2) at one angle."""
    wa2 = a.frequency * a.frequency
    wb2 = b.frequency * b.frequency
    first = math.sqrt(1.0 + a.tilt * a.tilt) * abs(wb2 - wa2)
    return first + 0.5 * abs(wb2 * b.spread - wa2 * a.spread)
