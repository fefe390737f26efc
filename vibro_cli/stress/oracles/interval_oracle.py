"""A judge of first contacts that is independent of the solver.

Two bodies move from exact initial states on one piece of a trace, or on two adjacent pieces. Their
paths are Taylor polynomials of the plain pendulum equation ``f'' = -sign w^2 sin f`` in numbers of
two doubles, each with a proved bound of the remainder. On each step the squared distance of the
centres less ``(r_a + r_b)^2`` is a polynomial ``D``; it is proved positive on an interval of
midpoint ``m`` and half width ``h`` by ``D(m) - |D'(m)| h - B h^2/2 > e``, with ``B`` a bound of
``|D''|`` from the coefficients and ``e`` the bound of all errors. If that fails, the interval is
halved. The verdict is a proof: contact within an enclosure, or none up to the horizon.

Remainder. ``s = sin f, c = cos f, v = f'/w`` obey ``s' = c v, c' = -s v, v' = -sign s`` in ``w t``.
A majorant ``y' = x, x' = x y`` from ``(x, y) = (1, V)``, ``V = |v|``, has ``y' <= y^2/2 + 1``, so
that for ``u <= r = sqrt2 (1.45 - atan(V/sqrt2))`` both stay below 70; by Cauchy the terms from
order n + 1 on are below ``70 (u/r)^(n+1)/(1 - u/r)``. For large V the majorant ``z' = z^2`` from
``q = max(1, V)`` gives ``5 q`` at ``r = 0.8/q``. An error of the state grows at most as ``e^(w t)``
(the symmetric part of the equation's derivative has norm 1).

Arithmetic. A number is ``high + low`` with ``|low| <= ulp(high)/2``. Every operation has a relative
error of a few 2^-104 of its result, or of the larger operand for sums (Joldes, Muller and Popescu
2017); the judge assumes 2^-98 for each. No code is shared with the solver's own arithmetic.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

from vibro_cli.compile.kernel import (
    FloatArray3,
    FloatArray4,
    FloatMatrix,
    dtype,
    fused,
    kernel,
    struct,
)
from vibro_cli.compile.native import compiled

Wide = tuple[float, float]

# Terms of the series of sine and cosine.
_TERMS = 14
# pi/2 in three doubles.
_QUARTER_HIGH = 1.5707963267948966
_QUARTER_MIDDLE = 6.123233995736766e-17
_QUARTER_LOW = -1.4973849048591833e-33


@kernel
def quick_sum(a: float, b: float) -> Wide:
    """Return the exact sum of two doubles, ``|a| >= |b|``."""
    total = a + b
    return total, b - (total - a)


@kernel
def exact_sum(a: float, b: float) -> Wide:
    """Return the exact sum of two doubles (Knuth)."""
    total = a + b
    part = total - a
    return total, (a - (total - part)) + (b - part)


@kernel
def exact_product(a: float, b: float) -> Wide:
    """Return the exact product of two doubles."""
    product = a * b
    return product, fused(a, b, -product)


@kernel
def add(a: Wide, b: Wide) -> Wide:
    """Return the sum of two wide numbers."""
    high, low = exact_sum(a[0], b[0])
    more, least = exact_sum(a[1], b[1])
    high, low = quick_sum(high, low + more)
    return quick_sum(high, low + least)


@kernel
def negative(a: Wide) -> Wide:
    """Return the negative of a wide number."""
    return -a[0], -a[1]


@kernel
def multiply(a: Wide, b: Wide) -> Wide:
    """Return the product of two wide numbers."""
    high, low = exact_product(a[0], b[0])
    return quick_sum(high, low + (a[0] * b[1] + a[1] * b[0]))


@kernel
def scale(a: Wide, b: float) -> Wide:
    """Return the product of a wide number and a double."""
    high, low = exact_product(a[0], b)
    return quick_sum(high, low + a[1] * b)


@kernel
def divide(a: Wide, b: Wide) -> Wide:
    """Return the quotient of two wide numbers, by three steps of long division."""
    first = a[0] / b[0]
    rest = add(a, negative(scale(b, first)))
    second = rest[0] / b[0]
    rest = add(rest, negative(scale(b, second)))
    third = rest[0] / b[0]
    return add(quick_sum(first, second), (third, 0.0))


@kernel
def square_root(a: Wide) -> Wide:
    """Return the square root of a positive wide number, by two steps of Newton's iteration."""
    root = (math.pow(a[0], 0.5), 0.0)
    for _ in range(2):
        rest = add(a, negative(multiply(root, root)))
        root = add(root, scale(divide(rest, root), 0.5))
    return root


@kernel
def sine_cosine(a: Wide) -> tuple[Wide, Wide]:
    """Return sine and cosine with an absolute error below 1e-28 for ``|a| < 1e3``."""
    quarters = float(round(a[0] / _QUARTER_HIGH))
    small = add(a, exact_product(-quarters, _QUARTER_HIGH))
    small = add(small, exact_product(-quarters, _QUARTER_MIDDLE))
    small = add(small, exact_product(-quarters, _QUARTER_LOW))
    square = negative(multiply(small, small))
    sine, less = (0.0, 0.0), (0.0, 0.0)
    for k in range(_TERMS, 0, -1):
        sine = divide(multiply(add((1.0, 0.0), sine), square), (2.0 * k * (2.0 * k + 1.0), 0.0))
        less = divide(multiply(add((1.0, 0.0), less), square), (2.0 * k * (2.0 * k - 1.0), 0.0))
    sine = multiply(small, add((1.0, 0.0), sine))
    cosine = add((1.0, 0.0), less)
    turned = int(quarters) % 4
    if turned == 1:
        sine, cosine = cosine, negative(sine)
    elif turned == 2:
        sine, cosine = negative(sine), negative(cosine)
    elif turned == 3:
        sine, cosine = negative(cosine), sine
    return sine, cosine


NO_CONTACT = 0
CONTACT = 1
UNDECIDED = 2

ORDER = 30
STEP = 0.15  # of the radius within which the majorant is bounded
MOST_STEPS = 20000
FINEST = 0.5**45  # share of a step below which intervals are no longer halved
GRID = 0.5**40  # of the horizon: instants are multiples of it, so that their sums are exact
WIDE_ROUNDING = 1.0e-26  # of one step, relative; some hundred operations of 2^-98 each
DOUBLE_ROUNDING = 2.0e-14  # of D evaluated in doubles, relative to its largest terms


@struct
class JudgedFlight:
    """The data of a flight for the judge, besides its two bodies."""

    gravity: float  # m/s^2
    slope: float  # at the junction, or of the line, rad
    horizon: float  # s


@struct
class JudgedBody:
    """The data of a body for the judge."""

    sign: float  # of its piece: +1 valley, -1 hump, 0 line
    size: float  # radius of the arc, length of the line, m
    radius: float  # m
    kappa: float
    place: float  # at the start: phi or psi, rad; on a line the distance from its left end, m
    speed: float  # of the centre, m/s
    side: float  # of the junction: -1, +1; 0 if both bodies are on one piece


@struct
class Verdict:
    """The judge's result."""

    status: int  # CONTACT, NO_CONTACT or UNDECIDED
    low: float  # the enclosure of the instant of the first contact, s
    high: float
    speed: float  # at which the centres approach there, m/s


# Rows of a table of coefficients.
X, Y = 0, 1
HIGH, LOW = 0, 1


class Workspace(NamedTuple):
    """Working memory of the judge for one flight."""

    states: FloatArray3
    """[body, one of s, c, v, high or low]"""
    rows: FloatArray3
    """Series of s, c, v on a step: [row, high or low, power]"""
    paths: FloatArray4
    """Series of the centres' places on a step: [body, axis, high or low, power]"""
    between: FloatArray3
    """Difference of the centres' series: [axis, high or low, power]"""
    stack: FloatMatrix
    """Intervals to examine."""


@kernel
def _origin(flight: JudgedFlight, body: JudgedBody) -> tuple[Wide, Wide]:
    """Return the centre of a body's arc, or the body's centre at the junction end of its line.

    The origin is the junction of two pieces, the centre of a single arc, or the left end of a
    single line.
    """
    sine, cosine = sine_cosine((flight.slope, 0.0))
    sign, radius = body.sign, body.radius
    away = radius if sign == 0.0 else sign * body.size
    if body.side == 0.0 and sign != 0.0:
        away = 0.0
    return scale(sine, -away), scale(cosine, away)


@kernel
def _line_step(
    flight: JudgedFlight, body: JudgedBody, t: float, h: float, path: FloatArray3
) -> None:
    """Set the coefficients of the centre's place on a line, in powers of ``(time - t)/h``."""
    sine, cosine = sine_cosine((flight.slope, 0.0))
    pull = divide(scale(sine, -flight.gravity), (body.kappa, 0.0))
    place = exact_sum(body.place, 0.0)
    if body.side < 0.0:
        place = exact_sum(body.place, -body.size)
    speed = add((body.speed, 0.0), scale(pull, t))
    mean = add((body.speed, 0.0), scale(scale(pull, 0.5), t))
    place = add(place, scale(mean, t))
    x0, y0 = _origin(flight, body)
    for axis in range(2):
        for k in range(ORDER + 1):
            path[axis, HIGH, k], path[axis, LOW, k] = 0.0, 0.0
    linear, quadratic = scale(speed, h), scale(scale(pull, 0.5 * h), h)
    for k in range(3):
        term = place if k == 0 else linear if k == 1 else quadratic
        for axis in range(2):
            value = multiply(term, cosine if axis == X else sine)
            if k == 0:
                value = add(value, x0 if axis == X else y0)
            path[axis, HIGH, k], path[axis, LOW, k] = value


@kernel
def _arc_series(sign: float, w_h: Wide, state: FloatMatrix, rows: FloatArray3) -> None:
    """Set the coefficients of ``s, c, v`` in powers of the share of a step ``w h``."""
    for row in range(3):
        rows[row, HIGH, 0], rows[row, LOW, 0] = state[row, HIGH], state[row, LOW]
    for k in range(ORDER):
        along, against = (0.0, 0.0), (0.0, 0.0)
        for j in range(k + 1):
            v = (rows[2, HIGH, k - j], rows[2, LOW, k - j])
            along = add(along, multiply((rows[1, HIGH, j], rows[1, LOW, j]), v))
            against = add(against, multiply((rows[0, HIGH, j], rows[0, LOW, j]), v))
        factor = divide(w_h, (k + 1.0, 0.0))
        rows[0, HIGH, k + 1], rows[0, LOW, k + 1] = multiply(along, factor)
        rows[1, HIGH, k + 1], rows[1, LOW, k + 1] = multiply(against, negative(factor))
        pull = multiply((rows[0, HIGH, k], rows[0, LOW, k]), factor)
        rows[2, HIGH, k + 1], rows[2, LOW, k + 1] = scale(pull, -sign)


@kernel
def majorant(v: float) -> tuple[float, float]:
    """Return a radius within which the majorant of the series is bounded, and the bound."""
    plain = math.sqrt(2.0) * (1.45 - math.atan(v / math.sqrt(2.0)))
    q = max(1.0, v)
    if plain > 0.8 / q:
        return plain, 70.0
    return 0.8 / q, 5.0 * q


@kernel
def _path_radius(body: JudgedBody) -> Wide:
    return exact_sum(body.size, -body.sign * body.radius)


@kernel
def _frequency(flight: JudgedFlight, body: JudgedBody) -> Wide:
    """Return ``w = sqrt(g/(kappa rho))``, or 0 on a line."""
    if body.sign == 0.0:
        return 0.0, 0.0
    inertia = scale(_path_radius(body), body.kappa)
    return square_root(divide((flight.gravity, 0.0), inertia))


@kernel
def _start(flight: JudgedFlight, body: JudgedBody, state: FloatMatrix) -> None:
    """Set ``(sin f, cos f, f'/w)`` at the start, where f is the papers' angle phi or psi."""
    if body.sign == 0.0:
        return
    sine, cosine = sine_cosine((body.place, 0.0))
    span = multiply(_path_radius(body), _frequency(flight, body))
    rate = divide((body.speed, 0.0), span)
    state[0, HIGH], state[0, LOW] = sine
    state[1, HIGH], state[1, LOW] = cosine
    state[2, HIGH], state[2, LOW] = rate


@kernel
def _arc_step(
    flight: JudgedFlight,
    body: JudgedBody,
    h: float,
    state: FloatMatrix,
    rows: FloatArray3,
    path: FloatArray3,
) -> float:
    """Set the coefficients of the centre's place on an arc, and the state at the step's end.

    Returns the bound of the error that the step adds to the state.
    """
    w_h = scale(_frequency(flight, body), h)
    radius, bound = majorant(abs(state[2, HIGH]) + 1.0e-9)
    share = w_h[0] / radius
    _arc_series(body.sign, w_h, state, rows)
    rho = _path_radius(body)
    x0, y0 = _origin(flight, body)
    for k in range(ORDER + 1):
        path[X, HIGH, k], path[X, LOW, k] = multiply(rho, (rows[0, HIGH, k], rows[0, LOW, k]))
        y = multiply(rho, (rows[1, HIGH, k], rows[1, LOW, k]))
        path[Y, HIGH, k], path[Y, LOW, k] = scale(y, -body.sign)
    for axis in range(2):
        value = add((path[axis, HIGH, 0], path[axis, LOW, 0]), x0 if axis == X else y0)
        path[axis, HIGH, 0], path[axis, LOW, 0] = value
    for row in range(3):
        total = (0.0, 0.0)
        for k in range(ORDER, -1, -1):
            total = add(total, (rows[row, HIGH, k], rows[row, LOW, k]))
        state[row, HIGH], state[row, LOW] = total
    left_out: float = bound * math.pow(share, ORDER + 1) / (1.0 - share)
    rounding: float = WIDE_ROUNDING * (1.0 + abs(state[2, HIGH]))
    return left_out + rounding


@kernel
def _step_length(flight: JudgedFlight, body: JudgedBody, state: FloatMatrix) -> float:
    w = _frequency(flight, body)[0]
    if w == 0.0:
        return math.inf
    radius, _ = majorant(abs(state[2, HIGH]) + 1.0e-9)
    return STEP * radius / w


@kernel
def _wide_gap(between: FloatArray3, touch: Wide, u: float) -> float:
    """Return ``D`` at a share ``u`` of the step, in numbers of two doubles."""
    gap = negative(multiply(touch, touch))
    for axis in range(2):
        value = (0.0, 0.0)
        for k in range(ORDER, -1, -1):
            value = add(scale(value, u), (between[axis, HIGH, k], between[axis, LOW, k]))
        gap = add(gap, multiply(value, value))
    return gap[0] + gap[1]


@kernel
def _gap(between: FloatArray3, touch: float, u: float) -> tuple[float, float]:
    """Return ``D`` and ``dD/du`` at a share ``u`` of the step, in doubles."""
    gap, rate = -touch * touch, 0.0
    for axis in range(2):
        value, slope = 0.0, 0.0
        for k in range(ORDER, -1, -1):
            slope = slope * u + value
            value = value * u + between[axis, HIGH, k]
        gap += value * value
        rate += 2.0 * value * slope
    return gap, rate


@kernel
def _bounds(between: FloatArray3) -> tuple[float, float, float, float]:
    """Return bounds over a step of ``|D''|``, ``|D'|``, squared distance, and ``|dx| + |dy|``."""
    second, slope, square, extent = 0.0, 0.0, 0.0, 0.0
    for axis in range(2):
        zeroth, first, last = 0.0, 0.0, 0.0
        for k in range(ORDER + 1):
            size = abs(between[axis, HIGH, k])
            zeroth += size
            first += k * size
            last += k * (k - 1.0) * size
        second += 2.0 * (first * first + zeroth * last)
        slope += 2.0 * zeroth * first
        square += zeroth * zeroth
        extent += zeroth
    return second * (1.0 + 1.0e-12), slope, square * (1.0 + 1.0e-12), extent


@kernel
def _examine(
    between: FloatArray3, touch: Wide, end: float, error: float, stack: FloatMatrix
) -> tuple[float, float, float]:
    """Examine a step from left to right, halving intervals that are not decided.

    Returns the first share not proved free of contact (above 1: none), the first share proved to
    be overlap (above 1: none), and dD/du there.
    """
    second, steepest, square, extent = _bounds(between)
    scale_of_touch = square + touch[0] * touch[0]
    exact_error = error * (2.0 * extent + error) + WIDE_ROUNDING * scale_of_touch
    plain_error = exact_error + DOUBLE_ROUNDING * scale_of_touch
    doubtful, overlap, rate = 2.0, 2.0, 0.0
    stack[0, 0], stack[0, 1], count = 0.0, end, 1
    while count > 0:
        count -= 1
        low, high = stack[count, 0], stack[count, 1]
        half = 0.5 * (high - low)
        middle = low + half
        gap, slope = _gap(between, touch[0], middle)
        spread = (abs(slope) + DOUBLE_ROUNDING * steepest) * half + 0.5 * second * half * half
        if gap - spread > plain_error:
            continue
        gap = _wide_gap(between, touch, middle)
        if gap - spread > exact_error:
            continue
        if gap < -exact_error:
            # Overlap: intervals to the right no longer matter.
            overlap, rate, count = middle, slope, 0
        if half < FINEST:
            doubtful = min(doubtful, low)
            continue
        if gap >= -exact_error:
            stack[count, 0], stack[count, 1] = middle, high
            count += 1
        stack[count, 0], stack[count, 1] = low, middle
        count += 1
    return doubtful, overlap, rate


@kernel
def _step(
    flight: JudgedFlight,
    body: JudgedBody,
    t: float,
    h: float,
    error: float,
    state: FloatMatrix,
    rows: FloatArray3,
    path: FloatArray3,
) -> float:
    """Set the path of one body on a step; return the error bound of its state at the end."""
    if body.sign == 0.0:
        _line_step(flight, body, t, h, path)
        return WIDE_ROUNDING
    growth = math.exp(1.001 * _frequency(flight, body)[0] * h)
    added = _arc_step(flight, body, h, state, rows, path)
    return error * growth + added


@kernel
def _reach(flight: JudgedFlight, body: JudgedBody) -> float:
    """Return the length (m) that converts an error bound of the state to one of the place."""
    if body.sign == 0.0:
        way: float = abs(body.size) + abs(body.speed * flight.horizon)
        return 1.0 + way
    radius: float = _path_radius(body)[0]
    return radius


@kernel
def _subtract(paths: FloatArray4, between: FloatArray3) -> None:
    for axis in range(2):
        for k in range(ORDER + 1):
            b = (paths[1, axis, HIGH, k], paths[1, axis, LOW, k])
            a = (paths[0, axis, HIGH, k], paths[0, axis, LOW, k])
            between[axis, HIGH, k], between[axis, LOW, k] = add(b, negative(a))


@kernel
def judge(
    flight: JudgedFlight, a: JudgedBody, b: JudgedBody, work: Workspace, verdict: Verdict
) -> None:
    """Judge one flight of two bodies and set the verdict."""
    states = work.states
    rows = work.rows
    paths = work.paths
    between = work.between
    for body in range(2):
        for row in range(3):
            states[body, row, HIGH], states[body, row, LOW] = 0.0, 0.0
    touch = exact_sum(a.radius, b.radius)
    _start(flight, a, states[0])
    _start(flight, b, states[1])
    t, doubtful, horizon = 0.0, math.inf, flight.horizon
    tick = GRID * math.pow(2.0, math.ceil(math.log2(horizon)))
    error_a, error_b = 0.0, 0.0
    for _ in range(MOST_STEPS):
        h = min(_step_length(flight, a, states[0]), _step_length(flight, b, states[1]))
        h = tick * max(math.floor(min(h, horizon - t + tick) / tick), 1.0)
        error_a = _step(flight, a, t, h, error_a, states[0], rows, paths[0])
        error_b = _step(flight, b, t, h, error_b, states[1], rows, paths[1])
        error = _reach(flight, a) * error_a + _reach(flight, b) * error_b
        _subtract(paths, between)
        end = min(1.0, (horizon - t) / h)
        unsure, overlap, rate = _examine(between, touch, end, error, work.stack)
        if unsure <= 1.0:
            doubtful = min(doubtful, t + unsure * h)
        if overlap <= 1.0:
            instant = t + overlap * h
            verdict.status, verdict.low, verdict.high = CONTACT, min(doubtful, instant), instant
            verdict.speed = -rate / (h * 2.0 * touch[0])
            return
        t += h
        if t >= horizon:
            break
    verdict.status, verdict.low, verdict.high = NO_CONTACT, horizon, horizon
    if doubtful < math.inf or t < horizon:
        verdict.status, verdict.low, verdict.high = UNDECIDED, min(doubtful, t), t


@kernel
def judge_flights(
    flights: Sequence[JudgedFlight],
    bodies: Sequence[JudgedBody],
    work: Workspace,
    verdicts: Sequence[Verdict],
) -> None:
    """Judge many flights and set the verdicts; ``bodies`` has two entries for each flight."""
    for number in range(len(flights)):
        a, b = bodies[2 * number], bodies[2 * number + 1]
        judge(flights[number], a, b, work, verdicts[number])


def judge_all(flights: Any, bodies: Any) -> Any:
    """Return the `Verdict` of each `JudgedFlight`; ``bodies`` has two `JudgedBody` for each."""
    import numpy as np

    rows = ORDER + 1
    work = Workspace(
        states=np.zeros((2, 3, 2)),
        rows=np.zeros((3, 2, rows)),
        paths=np.zeros((2, 2, 2, rows)),
        between=np.zeros((2, 2, rows)),
        stack=np.zeros((200, 2)),
    )
    verdicts = np.zeros(len(flights), dtype(Verdict))
    compiled(judge_flights)(flights, bodies, work, verdicts)
    return verdicts
