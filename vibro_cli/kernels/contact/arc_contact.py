"""The certified search for the first contact of two neighbours on one arc.

The difference y of their angles obeys ``y'' >= -w^2 y``. From now on y therefore stays above one
oscillation, and up to the contact above another. If the times for which these keep the bodies apart
overlap, no contact is earlier.

Two free pendulums are tried as a whole (:func:`contact_of_swings`). What that leaves undecided, and
all other motions, are searched step by step. On a rotating trace w follows from the steepest fall
of the torque on the arc, ``w^2 max(-torque')``; the kernels named ``rotating_...`` override the
others there.
"""

from __future__ import annotations

import math

from vibro_cli.compile.kernel import kernel
from vibro_cli.kernels.contact.contact_kinematics import half_gap_sine
from vibro_cli.kernels.contact.first_contact import (
    DEEP,
    FINAL_CORRECTION,
    NONE_BEFORE_LIMIT,
    STEPS_AT_ONCE,
    UNFINISHED,
    UNRESOLVED,
    Ages,
    keep_after_small_step,
    keep_states,
)
from vibro_cli.kernels.flow.flow import (
    POLYNOMIAL,
    angular_acceleration,
    angular_acceleration_at,
    angular_jerk,
    angular_jerk_at,
    flow_of_two,
    librates,
    quickness,
)
from vibro_cli.kernels.flow.rotating_flow import torque
from vibro_cli.kernels.numerics.conservative_advancement import (
    first_return,
    is_clear_before,
    safe_return,
    safe_step_third_order,
    unresolved_step,
)
from vibro_cli.kernels.numerics.constants import EPSILON, NEVER
from vibro_cli.kernels.numerics.elliptic import angle_sum, twice_angle
from vibro_cli.kernels.world import RELEASED, Flight, States, World, contact_of, flights_of

# Longest reliable step of the iteration, times the frequency.
LONGEST_CHANGE = 1.0


@kernel
def refine_on_arc(
    world: World, j: int, age_a: float, age_b: float, h: float, orientation: float
) -> float:
    """Refine the time ``h`` (s) of a zero of the sine of half the gap.

    The iteration uses the third-order expansion and full flows. The states at the zero are kept in
    the pair. Returns ``NONE_BEFORE_LIMIT`` if it does not converge.
    """
    a, b = flights_of(world, world.pairs[j])
    contact = contact_of(world, j)
    fastest = max(a.own_frequency, b.own_frequency)
    settled = FINAL_CORRECTION
    if a.form == POLYNOMIAL or b.form == POLYNOMIAL:
        # Without the acceleration the iteration is of second order only.
        settled *= FINAL_CORRECTION
    for _ in range(12):
        states = flow_of_two(a, b, age_a + h, age_b + h)
        world.clock[0].evaluations += 1
        a_s, a_c, a_p, b_s, b_c, b_p = states
        rate = _rate_of_gap(a, b, states)
        second = angular_acceleration(b, b_s, b_c) - angular_acceleration(a, a_s, a_c)
        third = angular_jerk(b, b_s, b_c, b_p) - angular_jerk(a, a_s, a_c, a_p)
        x, cosine = half_gap_sine(contact, a_s, a_c, b_s, b_c, orientation)
        x1, x2, x3 = derivatives_of_sine(x, cosine, rate, second, third)
        if x1 >= 0.0:
            return NONE_BEFORE_LIMIT
        change = inverted(x, x1, x2, x3)
        if not abs(change) * fastest <= LONGEST_CHANGE:
            return NONE_BEFORE_LIMIT
        h += change
        quick = max(quickness(a.own_frequency, a_p), quickness(b.own_frequency, b_p))
        if is_last(x, change, x1, x2, quick, settled):
            before = age_a + h - change, age_b + h - change
            keep_after_small_step(world, j, before, change, states)
            return h
    return NONE_BEFORE_LIMIT


@kernel
def derivatives_of_sine(
    x: float, cosine: float, rate: float, second: float, third: float
) -> tuple[float, float, float]:
    """Return the time derivatives of the sine of half the gap from those of the gap."""
    x1 = 0.5 * rate * cosine
    x2 = 0.5 * second * cosine - 0.25 * rate * rate * x
    x3 = 0.5 * third * cosine - 0.75 * rate * second * x - 0.25 * rate * rate * x1
    return x1, x2, x3


@kernel
def is_last(x: float, change: float, x1: float, x2: float, fastest: float, settled: float) -> bool:
    """Return whether the iteration has converged with a ``change`` of time (s).

    Far from the zero of the function the inverse series may itself be zero and attract the
    iteration. Newton's step is not that short there.
    """
    is_short = abs(change) * (abs(x2) - fastest * x1) < -settled * x1
    return is_short and abs(x) <= -2.0 * abs(change) * x1


@kernel
def inverted(x: float, x1: float, x2: float, x3: float) -> float:
    """Return the step to the zero of a function by the inverse series to third order."""
    inverse = 1.0 / x1
    step = -x * inverse
    c2 = 0.5 * (x2 * inverse)
    c3 = (1.0 / 6.0) * (x3 * inverse)
    return step * (1.0 - step * (c2 - step * (2.0 * (c2 * c2) - c3)))


# Contacts estimated later than this many times the limit are not searched for.
FAR_GUESS = 1.25
# Separation at less than this share of the rates of both is rounding: gravity alone decides.
NO_PARTING = 32.0 * EPSILON
# Keeps the estimated frequency of a difference of angles above half that of small oscillations.
MOST_SOFTENING = 0.75


@kernel
def contact_of_swings(
    world: World, j: int, age_a: float, age_b: float, limit: float, orientation: float
) -> tuple[float, float]:
    """Return the first contact of two free pendulums, and a time before which there is none.

    The contact is a time (s) from now, with its states left in the pair, or ``NONE_BEFORE_LIMIT``
    if it is not found.
    """
    pair = world.pairs[j]
    a, b = flights_of(world, pair)
    contact = contact_of(world, j)
    a_s, a_c, a_p, b_s, b_c, b_p = flow_of_two(a, b, age_a, age_b)
    world.clock[0].evaluations += 1
    gap = 0.0
    rate = 2.0 * (b.frequency * b_p - a.frequency * a_p)
    if pair.touching == 0:
        x, cosine = half_gap_sine(contact, a_s, a_c, b_s, b_c, orientation)
        gap = max(2.0 * math.atan2(x, cosine), 0.0)
    elif rate <= NO_PARTING * (a.frequency * abs(a_p) + b.frequency * abs(b_p)):
        return NONE_BEFORE_LIMIT, 0.0
    # The difference of the angles, gap + beta, obeys y'' >= -w^2 y for equal frequencies; unequal
    # ones add a torque.
    fastest, square = fastest_return(a, b)
    level = math.pi - contact.far_gap
    if a.frequency != b.frequency:
        level += uneven_torque(a, b) / square
    clear = safe_return(gap, rate, level, fastest)
    if clear <= 0.0:
        return NONE_BEFORE_LIMIT, 0.0
    states = a_s, a_c, a_p, b_s, b_c, b_p
    slowed = guessed_frequency(a, b, states, (gap, rate, level), fastest, orientation)
    guess = first_return(gap, rate, level, slowed)
    if guess > FAR_GUESS * limit:
        return NONE_BEFORE_LIMIT, clear
    h = refine_on_arc(world, j, age_a, age_b, guess, orientation)
    if h < 0.0:
        return NONE_BEFORE_LIMIT, clear
    # The same bound, backwards in time from the contact.
    approach = 2.0 * (a.frequency * pair.a_p - b.frequency * pair.b_p)
    if is_clear_before(h - clear, approach, level, fastest):
        return h, clear
    return NONE_BEFORE_LIMIT, clear


@kernel
def fastest_return(a: Flight, b: Flight) -> tuple[float, float]:
    """Return the greatest frequency w (rad/s) of the difference of the angles, and w^2."""
    fastest = max(a.frequency, b.frequency)
    return fastest, fastest * fastest


@kernel
def guessed_frequency(
    a: Flight,
    b: Flight,
    states: States,
    gap: tuple[float, float, float],
    fastest: float,
    orientation: float,
) -> float:
    """Estimate the frequency (rad/s) of the difference of the angles from the present states.

    ``gap`` is the gap angle, its rate and the contact angle.
    """
    a_s, _, a_p, b_s, _, b_p = states
    angle, rate, level = gap
    mean_s = 0.5 * (b_s + orientation * a_s)
    mean_p = 0.5 * (b_p + a_p)
    return frequency_of_difference(a, b, angle + level, rate, mean_s, mean_p, orientation)


@kernel
def uneven_torque(a: Flight, b: Flight) -> float:
    """Return a bound (rad/s^2) on what unequal frequencies add to the difference of the angles.

    ``-w_b^2 sin f_b + w_a^2 sin f_a`` is below ``-w^2 (f_b - f_a)`` by at most this.
    """
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
    """Estimate the frequency (rad/s) of the difference y of the angles of two pendulums.

    ``y'' = -w^2 cos M sinc(y/2) y`` with M the mean of the angles. Both y and M are taken as small
    oscillations, and the factor is averaged over an oscillation of y, weighted with y^2.
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
    # The square root of 1 - softening, as a series.
    return w * (1.0 - softening * (0.5 + softening * (0.125 + 0.085 * softening)))


# Certificate of a single root, g'^2 > 2 A g, with a margin for rounding.
SINGLE_ROOT = 2.01
UNCERTAIN = -2.0 * NEVER  # in addition to NONE_BEFORE_LIMIT


@kernel
def contact_on_arc(
    world: World, j: int, ages: Ages, horizon: float, limit: float, orientation: float
) -> float:
    """Return the time (s) of the first contact of two bodies on one arc.

    All times are from the beginning of the search. The pair has ``touching``, ``PARTING`` or
    ``RELEASED`` if the bodies are in contact at the beginning and separate, else 0, and
    ``searched``, how far the search has come. The search may stop after ``horizon``, on which none
    of its steps depends; the first of the flights ends at ``limit``. ``orientation`` is -1 if b is
    one lap ahead.

    The states of contact are left in the pair. Returns ``NONE_BEFORE_LIMIT`` if there is no contact
    before the horizon, ``UNFINISHED`` after ``STEPS_AT_ONCE`` steps.
    """
    pair = world.pairs[j]
    a, b = flights_of(world, pair)
    age_a, age_b = ages
    t = pair.searched
    if t == 0.0 and pair.touching == RELEASED:
        states = flow_of_two(a, b, age_a, age_b)
        world.clock[0].evaluations += 1
        t = _released_step(a, b, ages, states)
    elif t == 0.0 and librates(a) and librates(b):
        h, t = contact_of_swings(world, j, age_a, age_b, limit, orientation)
        if h >= 0.0:
            pair.searched = limit
            return h if h <= limit else NONE_BEFORE_LIMIT
    if t > horizon:
        pair.searched = t
        return NONE_BEFORE_LIMIT
    return _contact_by_steps(world, j, ages, t, horizon, limit, orientation)


@kernel
def _contact_by_steps(
    world: World, j: int, ages: Ages, t: float, horizon: float, limit: float, orientation: float
) -> float:
    """Search for the contact of :func:`contact_on_arc` if there is none before a time t (s)."""
    pair = world.pairs[j]
    a, b = flights_of(world, pair)
    bound_2 = a.angular_bound + b.angular_bound
    bound_3 = a.jerk_bound + b.jerk_bound
    for _ in range(STEPS_AT_ONCE):
        states, x, cosine, derivatives = _gap_on_arc(world, j, ages, t, orientation)
        gap, rate, second = derivatives
        parting = t == 0.0 and pair.touching != 0
        if parting:
            gap = 0.0
            rate = max(rate, 0.0)
            if rate == 0.0 and second <= 0.0:
                # Marked as separating, but without relative speed and pressed together.
                keep_states(pair, states)
                return 0.0
        single = rate * rate > SINGLE_ROOT * bound_2 * gap * (1.0 + 0.5 * x * x)
        if rate < 0.0 and single and cosine > 0.0 and x < 0.5:
            gap = _twice_arc_sine(x)
            root = _first_root(world, j, ages, t, limit, states, (gap, rate, second), orientation)
            if root != UNCERTAIN:
                pair.searched = limit
                return root
        step = safe_step_third_order(max(gap, 0.0), rate, second, bound_2, bound_3)
        inside = x < -0.5 * DEEP * UNRESOLVED
        if gap <= 0.0 and rate >= 0.0 and not inside and not parting:
            # For at least this long the bodies are in contact or apart by less than rounding.
            step = max(step, unresolved_step(second, bound_3, UNRESOLVED))
        if t + step == t and not parting:
            # The gap closes below the resolution of time: contact, tangential within rounding.
            keep_states(pair, states)
            return t
        t += step
        if t > horizon:
            break
    pair.searched = t
    return NONE_BEFORE_LIMIT if t > horizon else UNFINISHED


@kernel
def _gap_on_arc(
    world: World, j: int, ages: Ages, t: float, orientation: float
) -> tuple[States, float, float, tuple[float, float, float]]:
    """Return states, sine and cosine of half the gap, gap and its derivatives at a time t (s)."""
    a, b = flights_of(world, world.pairs[j])
    age_a, age_b = ages
    states = flow_of_two(a, b, age_a + t, age_b + t)
    world.clock[0].evaluations += 1
    a_s, a_c, _, b_s, b_c, _ = states
    contact = contact_of(world, j)
    x, cosine = half_gap_sine(contact, a_s, a_c, b_s, b_c, orientation)
    gap = contact.far_gap
    if cosine > 0.0:
        gap = 2.0 * x if x > 0.0 else 0.0
    second = angular_acceleration_at(b, age_b + t, b_s, b_c)
    second -= angular_acceleration_at(a, age_a + t, a_s, a_c)
    return states, x, cosine, (gap, _rate_of_gap(a, b, states), second)


@kernel
def _rate_of_gap(a: Flight, b: Flight, states: States) -> float:
    """Return the rate (rad/s) of the gap of two bodies on one arc."""
    _, _, a_p, _, _, b_p = states
    return 2.0 * (b.own_frequency * b_p - a.own_frequency * a_p)


@kernel
def _twice_arc_sine(x: float) -> float:
    """Return ``2 asin x`` for x below 0.5, approximately, by its series."""
    x2 = x * x
    return 2.0 * x * (1.0 + x2 * (1.0 / 6.0 + x2 * (3.0 / 40.0 + x2 * (15.0 / 336.0))))


@kernel
def _first_root(
    world: World,
    j: int,
    ages: Ages,
    t: float,
    limit: float,
    states: States,
    derivatives: tuple[float, float, float],
    orientation: float,
) -> float:
    """Return the contact of :func:`contact_on_arc` at the first root after t (s), a simple one.

    ``derivatives`` are the gap and its first two derivatives. Returns ``UNCERTAIN`` if the
    refinement fails.
    """
    pair = world.pairs[j]
    a, b = flights_of(world, pair)
    age_a, age_b = ages
    gap, rate, second = derivatives
    bound = a.angular_bound + b.angular_bound
    if t + 2.0 * gap / (math.sqrt(rate * rate + 2.0 * bound * max(gap, 0.0)) - rate) > limit:
        return NONE_BEFORE_LIMIT
    a_s, a_c, a_p, b_s, b_c, b_p = states
    third = angular_jerk(b, b_s, b_c, b_p) - angular_jerk(a, a_s, a_c, a_p)
    h = _cubic_guess(gap, rate, second, third)
    h = refine_on_arc(world, j, age_a + t, age_b + t, h, orientation)
    before = NONE_BEFORE_LIMIT < h < -t
    if before or (gap <= 0.0 and not -t <= h <= 0.0):
        # In contact by rounding, with no root since the beginning: now, in the present states.
        keep_states(pair, states)
        return t
    if h > NONE_BEFORE_LIMIT:
        return t + h if t + h <= limit else NONE_BEFORE_LIMIT
    return UNCERTAIN


@kernel
def _cubic_guess(gap: float, rate: float, second: float, third: float) -> float:
    """Return the root of the quadratic, improved by one Newton step on the cubic."""
    h = 2.0 * gap / (math.sqrt(max(rate * rate - 2.0 * second * gap, 0.0)) - rate)
    slope = rate + h * (second + 0.5 * h * third)
    if slope < 0.0:
        h -= (gap + h * (rate + h * (0.5 * second + h * third * (1.0 / 6.0)))) / slope
    return h


@kernel
def _released_step(a: Flight, b: Flight, ages: Ages, states: States) -> float:
    """Return a time (s) for which a pair whose contact force has just vanished stays apart.

    The gap starts as ``j h^3/6`` and is at least ``j h^3/6 - B h^4/24``, with j its jerk and ``B``
    the sum of the bounds on the fourth derivatives of both angles.
    """
    age_a, age_b = ages
    a_s, a_c, a_p, b_s, b_c, b_p = states
    wa = a.own_frequency
    wb = b.own_frequency
    rate = _rate_of_gap(a, b, states)
    third = angular_jerk_at(b, age_b, b_s, b_c, b_p) - angular_jerk_at(a, age_a, a_s, a_c, a_p)
    if third <= 0.0 or rate < -1.0e-9 * (abs(wa * a_p) + abs(wb * b_p)):
        return 1.0e-9 / (wa + wb)
    return 3.0 * third / (a.snap_bound + b.snap_bound)


# The squared frequency of a difference of angles is at least this share of the greatest one.
LEAST_SHARE = 0.2
# Mean square of y between contacts, as a share of its maximum, that gives the best estimates.
MEAN_SQUARE = 0.35


@kernel
def rotating_fastest_return(a: Flight, b: Flight) -> tuple[float, float]:
    """Return the greatest frequency W (rad/s) of the difference of the angles, and W^2."""
    square = max(a.steepest, b.steepest)
    return math.sqrt(square), square


@kernel
def rotating_guessed_frequency(
    a: Flight,
    b: Flight,
    states: States,
    gap: tuple[float, float, float],
    fastest: float,
    orientation: float,
) -> float:
    """Estimate the frequency (rad/s) of the difference of the angles from the present states."""
    a_s, a_c, a_p, b_s, b_c, b_p = states
    angle, rate, level = gap
    second = angular_acceleration(b, b_s, b_c) - angular_acceleration(a, a_s, a_c)
    # Evaluate the torque halfway to the return of the fastest difference.
    half = 0.5 * first_return(angle, rate, level, fastest)
    middle = angle + level + half * (rate + 0.5 * half * second)
    frequency = _frequency_of_difference(
        a, a_s + orientation * b_s, a_c + orientation * b_c, a_p + b_p, half, middle
    )
    share = max(frequency / max(a.steepest, b.steepest), LEAST_SHARE)
    return fastest * math.sqrt(min(share, 1.0))


@kernel
def _frequency_of_difference(
    a: Flight, s: float, c: float, p: float, half: float, angle: float
) -> float:
    """Estimate the squared frequency (1/s^2) of the difference of the angles, ``half`` (s) ahead.

    With M the mean of the angles
    ``y'' = w^2 (-2 (cos M + tilt sin M) sin(y/2) + spread cos 2M sin y)``. ``s, c, p`` are sums of
    the states of both; ``angle`` is y then.
    """
    w = a.frequency
    size = 1.0 / math.sqrt(s * s + c * c)
    s *= size
    c *= size
    step = half * w * (0.5 * p + 0.25 * half * w * torque(a.tilt, a.spread, s, c))
    # To third order of the step in half the angle.
    turn = step * (1.0 - step * step * (1.0 / 6.0))
    stay = 1.0 - 0.5 * step * step
    s, c = angle_sum(s, c, turn, stay)
    sine, cosine = twice_angle(s, c)
    less = MEAN_SQUARE * angle * angle * (1.0 / 24.0)
    double = (cosine - sine) * (cosine + sine)
    along = (cosine + a.tilt * sine) * (1.0 - less)
    return w * w * (along - a.spread * double * (1.0 - 4.0 * less))


@kernel
def rotating_uneven_torque(a: Flight, b: Flight) -> float:
    """Return a bound (rad/s^2) on the difference of both torques at one angle."""
    wa2 = a.frequency * a.frequency
    wb2 = b.frequency * b.frequency
    first = math.sqrt(1.0 + a.tilt * a.tilt) * abs(wb2 - wa2)
    return first + 0.5 * abs(wb2 * b.spread - wa2 * a.spread)
