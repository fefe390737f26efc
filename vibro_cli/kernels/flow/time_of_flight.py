"""When a flight on an arc passes a state: the inverse of the flow, by Carlson's integral."""

from __future__ import annotations

import math

from vibro_cli.compile.kernel import kernel
from vibro_cli.kernels.numerics.elliptic import (
    ROOT_COMPLEMENT_TINY,
    TRIGONOMETRIC,
    carlson_rf,
    quarter_period,
    rf_near_logarithm,
)
from vibro_cli.kernels.structs import Flight

# Products of two such numbers would underflow.
TINY_PRODUCT = 1.0e-200
# Above this parameter a path through the bottom is timed in two parts, from the bottom.
SPLIT_PARAMETER = 0.9
# No way ahead takes this share of the argument after which S and C return; most is one half.
LONGEST_AHEAD = 0.75


@kernel
def time_to(flight: Flight, s1: float, c1: float, p1: float) -> float:
    """Return the first time (s) at which an arc's flight takes its start to ``(S1, C1, P1)``.

    The state is one of the flow's pendulum and must lie on the flight's orbit, less than a
    period ahead. Relative error a few ulp.
    """
    m = flight.parameter
    if flight.root_complement < 0.0:
        far = flight.flow_c * c1 + flight.flow_s * s1 < 0.0 or s1 * flight.flow_s <= 0.0
        u = _rotation_argument(flight, s1, c1) if far else _argument_by_addition(flight, s1, c1, p1)
    elif m > SPLIT_PARAMETER and not _stays_on_one_side(
        flight.flow_s * flight.flow_c, flight.flow_p, s1 * c1, p1
    ):
        u = _libration_argument(flight, s1, c1, p1)
    else:
        u = _argument_by_addition(flight, s1, c1, p1)
    return u / flight.frequency


@kernel
def time_ahead(flight: Flight, s1: float, c1: float, p1: float) -> float:
    """Return the time (s) to a state that lies ahead, without a turn on the way.

    The energy says where it is up to rounding: one that is reached within that is behind the start
    for :func:`time_to`, a whole period away.
    """
    after = time_to(flight, s1, c1, p1)
    if after * flight.frequency > LONGEST_AHEAD * _double_period(flight):
        return 0.0
    return after


@kernel
def _stays_on_one_side(sc0: float, p0: float, sc1: float, p1: float) -> bool:
    """Tell whether a libration goes from one state to the next one without passing S = 0.

    ``sc`` is S C, whose sign is that of sin f; in a libration C keeps its sign, and on a path to
    the same side without a turning point |P| falls outwards.
    """
    if sc0 * sc1 <= 0.0:
        return False
    if p0 * p1 > 0.0:
        return (abs(p1) - abs(p0)) * (sc0 * p0) < 0.0
    return sc0 * p0 >= 0.0


@kernel
def _libration_argument(flight: Flight, s1: float, c1: float, p1: float) -> float:
    """Argument between two states of a libration, each counted from a passage of the bottom."""
    m = flight.parameter
    quarter = quarter_period(m, flight.root_complement)
    # Seen from the side on which it starts to the right: mirror images take the same time.
    right = flight.flow_p > 0.0 or (flight.flow_p == 0.0 and flight.flow_s * flight.flow_c < 0.0)
    side = 1.0 if right else -1.0
    s0 = side * flight.flow_s
    first = _argument_along_libration(m, quarter, s0, flight.flow_c, side * flight.flow_p)
    second = _argument_along_libration(m, quarter, side * s1, c1, side * p1)
    if second < first:
        return second - first + 4.0 * quarter
    return second - first


@kernel
def _argument_along_libration(m: float, quarter: float, s: float, c: float, p: float) -> float:
    """Argument since the last passage of S = 0 with P > 0, in ``[-K, 3K)``."""
    outward = s if c > 0.0 else -s
    if p == 0.0:
        return quarter if outward > 0.0 else -quarter
    u = outward * carlson_rf(p * p, m * c * c, m)
    return u if p > 0.0 else 2.0 * quarter - u


@kernel
def _rotation_argument(flight: Flight, s1: float, c1: float) -> float:
    """Argument between two places of a rotation, each counted from the bottom.

    ``(S, C)`` return after two turns, of four times ``half_turn``; an arc with the bottom inside it
    may have them beyond the range from which they are counted.
    """
    m = flight.parameter
    complement = flight.root_complement * flight.root_complement
    half_turn = quarter_period(m, flight.root_complement)
    first = _argument_along_rotation(m, complement, half_turn, flight.flow_s, flight.flow_c)
    second = _argument_along_rotation(m, complement, half_turn, s1, c1)
    ahead = second - first if flight.flow_p > 0.0 else first - second
    return ahead if ahead >= 0.0 else ahead + 4.0 * half_turn


@kernel
def _argument_along_rotation(
    m: float, complement: float, half_turn: float, s: float, c: float
) -> float:
    """Signed argument from f = 0 to f in (-2 pi, 2 pi), ``half_turn`` being that of f = pi."""
    u = s * carlson_rf(complement + c * c, m * c * c, m)
    if c >= 0.0:
        return u
    if s >= 0.0:
        return 2.0 * half_turn - u
    return -2.0 * half_turn - u


@kernel
def _argument_by_addition(flight: Flight, s1: float, c1: float, p1: float) -> float:
    """``u = 2 |s| R_F((c+d)(1+c), (c+d)(1+d), (1+c)(1+d))`` with s, c, d of the difference."""
    m = flight.parameter
    s0 = flight.flow_s
    c0 = flight.flow_c
    p0 = flight.flow_p
    g = p0 * p0 + (s0 * c1) * (s0 * c1)
    if g < TINY_PRODUCT:
        scale = 1.0 / (abs(p0) + abs(s0 * c1))
        c0 *= scale
        p0 *= scale
        c1 *= scale
        p1 *= scale
        g = p0 * p0 + (s0 * c1) * (s0 * c1)
    inverse = 1.0 / g
    s = (s1 * p0 * c0 - s0 * p1 * c1) * inverse
    c = (p1 * p0 + s1 * c1 * s0 * c0) * inverse
    d = (m * c1 * c0 + s1 * p1 * s0 * p0) * inverse
    size = abs(s)
    if size == 0.0:
        # The same place: now, or after half a period with the opposite rate.
        return 0.0 if c > 0.0 else 0.5 * _double_period(flight)
    one_c = 1.0 + c if c > -0.5 else size * size / (1.0 - c)
    one_d = 1.0 + d if d > -0.5 else m * size * size / (1.0 - d)
    if c >= 0.0 and d >= 0.0:
        root = math.sqrt(c + d)
    else:
        # c + d = (1 - m) s^2/(d - c): its root, since it may underflow itself.
        root = abs(flight.root_complement) * size / math.sqrt(abs(d - c))
    if root < ROOT_COMPLEMENT_TINY:
        u = rf_near_logarithm(root * math.sqrt(one_c), root * math.sqrt(one_d), one_c * one_d)
    else:
        both = root * root
        u = carlson_rf(both * one_c, both * one_d, one_c * one_d)
    u *= 2.0 * size
    if s >= 0.0:
        return u
    return _double_period(flight) - u


@kernel
def _double_period(flight: Flight) -> float:
    """Argument after which s and c return (4 K for m < 1)."""
    if flight.form == TRIGONOMETRIC:
        return 2.0 * math.pi / flight.argument_scale
    return 2.0 * (flight.half_period + flight.half_period_low) / (1.0 + flight.argument_scale)
