"""The first contact of two free swings on one arc, guessed, refined and certified as a whole.

The difference of their angles obeys ``y'' >= -w^2 y``: from now on it stays above one oscillation,
and before the contact above another one. Where the two overlap, no contact is earlier.
"""

from __future__ import annotations

import math

from vibro_cli.compile.kernel import kernel
from vibro_cli.kernels.contact.arc_root import refine_on_arc
from vibro_cli.kernels.contact.first_contact import NONE_BEFORE_LIMIT
from vibro_cli.kernels.contact.gap import half_gap_sine
from vibro_cli.kernels.flow.flow import flow_of_two
from vibro_cli.kernels.numerics.conservative_advancement import (
    first_return,
    is_clear_before,
    safe_return,
)
from vibro_cli.kernels.structs import Clock, Flight, PairData, PairTrack

# Contacts guessed later than this many times the limit are not looked for.
FAR_GUESS = 1.25
# Two that part at less than this share of their rates do so by rounding: gravity alone decides.
NO_PARTING = 32.0 * 2.220446049250313e-16
# The frequency of a difference of angles is taken as no less than half that of small swings.
MOST_SOFTENING = 0.75


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
    """First contact of two free swings, and a time before which there is none.

    Returns
    -------
    The time (s) of the first contact from now, the states then being left in ``pair``, or
    ``NONE_BEFORE_LIMIT`` if it is not found; a time up to which there is no contact.
    """
    a_s, a_c, a_p, b_s, b_c, b_p = flow_of_two(a, b, age_a, age_b)
    clock.evaluations += 1
    gap = 0.0
    rate = 2.0 * (b.frequency * b_p - a.frequency * a_p)
    if touching == 0:
        x, cosine = half_gap_sine(contact, a_s, a_c, b_s, b_c, orientation)
        gap = max(2.0 * math.atan2(x, cosine), 0.0)
    elif rate <= NO_PARTING * (a.frequency * abs(a_p) + b.frequency * abs(b_p)):
        return NONE_BEFORE_LIMIT, 0.0
    # The difference of the angles, gap + beta, obeys y'' >= -w^2 y for equal frequencies; unequal
    # ones pull at it all the time.
    fastest, square = fastest_return(a, b)
    level = math.pi - contact.far_gap
    if a.frequency != b.frequency:
        level += uneven_pull(a, b) / square
    clear = safe_return(gap, rate, level, fastest)
    if clear <= 0.0:
        return NONE_BEFORE_LIMIT, 0.0
    slowed = guessed_frequency(
        a, b, a_s, a_c, a_p, b_s, b_c, b_p, gap, rate, level, fastest, orientation
    )
    guess = first_return(gap, rate, level, slowed)
    if guess > FAR_GUESS * limit:
        return NONE_BEFORE_LIMIT, clear
    h = refine_on_arc(a, b, age_a, age_b, guess, contact, orientation, pair, clock)
    if h < 0.0:
        return NONE_BEFORE_LIMIT, clear
    # The same bound seen from the contact, backwards in time.
    approach = 2.0 * (a.frequency * pair.a_p - b.frequency * pair.b_p)
    if is_clear_before(h - clear, approach, level, fastest):
        return h, clear
    return NONE_BEFORE_LIMIT, clear


@kernel
def fastest_return(a: Flight, b: Flight) -> tuple[float, float]:
    """Greatest frequency w (rad/s) with which the difference of the angles returns, and w^2."""
    fastest = max(a.frequency, b.frequency)
    return fastest, fastest * fastest


@kernel
def guessed_frequency(
    a: Flight,
    b: Flight,
    a_s: float,
    a_c: float,
    a_p: float,
    b_s: float,
    b_c: float,
    b_p: float,
    gap: float,
    rate: float,
    level: float,
    fastest: float,
    orientation: float,
) -> float:
    """Estimate the frequency (rad/s) of the difference of the angles from the states of now."""
    mean_s = 0.5 * (b_s + orientation * a_s)
    mean_p = 0.5 * (b_p + a_p)
    return frequency_of_difference(a, b, gap + level, rate, mean_s, mean_p, orientation)


@kernel
def uneven_pull(a: Flight, b: Flight) -> float:
    """Bound on what ``-w_b^2 sin f_b + w_a^2 sin f_a`` lacks of ``-w^2 (f_b - f_a)`` (rad/s^2)."""
    wa2 = a.frequency * a.frequency
    wb2 = b.frequency * b.frequency
    return abs(wa2 - wb2) * max(a.angular_bound / wa2, b.angular_bound / wb2)


@kernel
def frequency_of_difference(
    a: Flight,
    b: Flight,
    angle: float,
    rate: float,
    mean_s: float,
    mean_p: float,
    orientation: float,
) -> float:
    """Estimate the frequency (rad/s) at which the difference of the angles of two swings returns.

    ``y'' = -w^2 cos M sinc(y/2) y`` with M the mean of the angles, both as small oscillations:
    the mean over one of y, weighted with y^2.
    """
    w = 0.5 * (a.frequency + b.frequency)
    mean = mean_s * mean_s + mean_p * mean_p
    rate *= 1.0 / w
    size = angle * angle + rate * rate
    softening = 0.5 * mean + (1.0 / 32.0) * size
    if orientation > 0.0:
        along = mean_s * angle + mean_p * rate
        softening += along * along / size
    softening = min(softening, MOST_SOFTENING)
    # The root of 1 - softening, as a series.
    return w * (1.0 - softening * (0.5 + softening * (0.125 + 0.085 * softening)))
