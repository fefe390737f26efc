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
from vibro_cli.mechanics.turning_flow import pull
from vibro_cli.numerics.elliptic import HYPERBOLIC_TINY
from vibro_cli.numerics.engine import kernel
from vibro_cli.numerics.first_root import first_return, is_clear_before, safe_return

# The frequency of a difference of angles is taken as no less than this share of the greatest one.
LEAST_SHARE = 0.2
# Mean square of y from contact to contact as a share of its greatest: what guesses best.
MEAN_SQUARE = 0.35


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
    # What pulls half way to where the fastest difference would return.
    half = 0.5 * first_return(gap, rate, level, fastest)
    middle = gap + level + half * (rate + 0.5 * half * second)
    frequency = _frequency_of_difference(
        a, a_s + orientation * b_s, a_c + orientation * b_c, a_p + b_p, half, middle
    )
    share = max(frequency / square, LEAST_SHARE)
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
def _frequency_of_difference(
    a: Flight, s: float, c: float, p: float, half: float, angle: float
) -> float:
    """Estimate the square of the frequency (1/s^2) of a difference of angles at a time (s) ahead.

    With M the mean of the angles ``y'' = w^2 (-2 (cos M + tilt sin M) sin(y/2) + spread cos 2M sin
    y)``. ``s, c, p`` are sums of the states of both; ``angle`` is y then.
    """
    w = a.frequency
    size = 1.0 / math.sqrt(s * s + c * c)
    s *= size
    c *= size
    step = half * w * (0.5 * p + 0.25 * half * w * pull(a.tilt, a.spread, s, c))
    # To third order of the step, in half the angle.
    turn = step * (1.0 - step * step * (1.0 / 6.0))
    stay = 1.0 - 0.5 * step * step
    s, c = s * stay + c * turn, c * stay - s * turn
    sine = 2.0 * s * c
    cosine = (c - s) * (c + s)
    less = MEAN_SQUARE * angle * angle * (1.0 / 24.0)
    double = (cosine - sine) * (cosine + sine)
    along = (cosine + a.tilt * sine) * (1.0 - less)
    return w * w * (along - a.spread * double * (1.0 - 4.0 * less))


@kernel
def _uneven_pull(a: Flight, b: Flight) -> float:
    """Bound on the difference of both pulls (rad/s^2) at one angle."""
    wa2 = a.frequency * a.frequency
    wb2 = b.frequency * b.frequency
    first = math.sqrt(1.0 + a.tilt * a.tilt) * abs(wb2 - wa2)
    return first + 0.5 * abs(wb2 * b.spread - wa2 * a.spread)
