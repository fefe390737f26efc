"""The first contact of two bodies alone on one arc of a turning trace, guessed and certified.

The kernels stand in for those of ``kernels.contact.arc_contact``. The difference y of their
angles
obeys ``y'' >= -W^2 y`` with the steepest fall of the pull on the arc: ``W^2 = w^2 max(-pull')``.
"""

from __future__ import annotations

import math

from vibro_cli.compile.kernel import kernel
from vibro_cli.kernels.flow.flow import angular_acceleration
from vibro_cli.kernels.flow.rotating_flow import pull
from vibro_cli.kernels.numerics.conservative_advancement import first_return
from vibro_cli.kernels.numerics.elliptic import HYPERBOLIC_TINY
from vibro_cli.kernels.world import Flight

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
def fastest_return(a: Flight, b: Flight) -> tuple[float, float]:
    """Greatest frequency W (rad/s) with which the difference of the angles returns, and W^2."""
    square = max(a.steepest, b.steepest)
    return math.sqrt(square), square


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
    second = angular_acceleration(b, b_s, b_c) - angular_acceleration(a, a_s, a_c)
    # What pulls half way to where the fastest difference would return.
    half = 0.5 * first_return(gap, rate, level, fastest)
    middle = gap + level + half * (rate + 0.5 * half * second)
    frequency = _frequency_of_difference(
        a, a_s + orientation * b_s, a_c + orientation * b_c, a_p + b_p, half, middle
    )
    share = max(frequency / max(a.steepest, b.steepest), LEAST_SHARE)
    return fastest * math.sqrt(min(share, 1.0))


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
def uneven_pull(a: Flight, b: Flight) -> float:
    """Bound on the difference of both pulls (rad/s^2) at one angle."""
    wa2 = a.frequency * a.frequency
    wb2 = b.frequency * b.frequency
    first = math.sqrt(1.0 + a.tilt * a.tilt) * abs(wb2 - wa2)
    return first + 0.5 * abs(wb2 * b.spread - wa2 * a.spread)
