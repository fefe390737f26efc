"""Motion under a quartic: ``u'^2 = a0 u^4 + 4 a1 u^3 + 6 a2 u^2 + 4 a3 u + a4`` from ``u = 0``.

By Weierstrass's formula ``u`` is a rational function of wp and its derivative, whatever the roots
of the quartic: oscillation between two of them, in either of two wells, or rotation through
infinity. wp is used as ``z = wp - a2/2``, which solves ``z'^2 = 4 z^3 + 6 a2 z^2 + b z + c``. Where
a motion is slow, next to a saddle or a centre, the small roots of that cubic keep their relative
accuracy. ``u = X/Y = tan h``: the pair (X, Y) has no pole. Formulas: Whittaker and Watson 20.6;
DLMF 23.6 (Weierstrass by Jacobi), 19.25 (Carlson).
"""

from __future__ import annotations

import math

from vibro_cli.compile.kernel import kernel
from vibro_cli.kernels.numerics.elliptic import (
    QuarticConstants,
    carlson_rf,
    quarter_period,
    rf_near_logarithm,
    set_theta_constants,
    theta_functions,
)

RECTANGULAR = 0  # three real roots e1 > e2 > e3 of the cubic
RHOMBIC = 1  # one real root, two conjugate ones
BESIDE_SADDLE = 2  # the same, and z passes close to the conjugate roots
# Below this share of the other factors a root's distance is taken from the derivative.
NEAR_ROOT = 0.25
POLISHING_STEPS = 3
# More than ever needed: beside a saddle each step adds at least one digit of the place.
NEAREST_STEPS = 30
# Complementary parameter 1 - m below which z passes close to the conjugate roots.
NEAR_SADDLE = 1.0e-5
# Up to this ratio a polynomial estimates the root of a cubic with one real root.
FLAT = 1.25
# If cancellation leaves a share of a form whose square is below this, the other form is used.
NEAR_NOTHING = 1.0e-3
# Below this rate and push at the start, products of them could underflow.
VANISHING = 1.0e-30
# Above this share of its terms the squared rate gives the rate more accurately than the derivative
# does, and the squared norm of the first form has nearly all its digits.
CLEAR = 0.125


@kernel
def set_quartic_constants(
    motion: QuarticConstants, a0: float, a1: float, a2: float, a3: float, rate: float, over: int
) -> None:
    """Set the constants of the motion that starts at ``u = 0`` with ``u' = rate``."""
    motion.quartic_0 = a0
    motion.quartic_1 = a1
    motion.quartic_2 = a2
    motion.quartic_3 = a3
    motion.start_rate = rate
    motion.turns_over = over
    a4 = rate * rate
    motion.back = a3 * a3 - 1.5 * a2 * a4
    motion.returns_early = 1 if (2.0 * a3 * motion.back + a1 * a4 * a4) * rate < 0.0 else 0
    r, total, product = _roots(motion)
    discriminant = total * total - 4.0 * product
    if discriminant >= 0.0:
        width = math.sqrt(discriminant)
        outer = -0.5 * (total + width) if total >= 0.0 else 0.5 * (width - total)
        inner = product / outer if outer != 0.0 else 0.0
        _set_rectangular(motion, r, max(outer, inner), min(outer, inner), width)
    else:
        _set_rhombic(motion, r, -0.5 * total, 0.5 * math.sqrt(-discriminant))


@kernel
def _roots(motion: QuarticConstants) -> tuple[float, float, float]:
    """Return the isolated root of the cubic, and ``z^2 + total z + product`` of the other two."""
    a0 = motion.quartic_0
    a1 = motion.quartic_1
    a4 = motion.start_rate * motion.start_rate
    p2 = 1.5 * motion.quartic_2
    p1 = a1 * motion.quartic_3 - 0.25 * a0 * a4
    p0 = 0.25 * (a0 * motion.back + a1 * a1 * a4)
    r = _isolated_root(p2, p1, p0)
    if abs(r) * (r * r) >= abs(p0) and r != 0.0:
        product = -p0 / r
        total = (product - p1) / r
    else:
        total = p2 + r
        product = p1 + r * total
    return r, total, product


@kernel
def refer_to_saddle(motion: QuarticConstants, a0: float, a1: float, a2: float, root: float) -> None:
    """Take the distance of the two close roots from the energy relative to a saddle.

    The energy is ``u'^2 = -root |root|`` at the saddle, and ``a0`` to ``a2`` are those of the
    quartic about the saddle with no energy. Elsewhere, the energy is lost in rounding. The cubic
    about the saddle has the same differences of roots.
    """
    energy = -root * abs(root)
    a0 += energy
    a2 += energy / 3.0
    # Over the energy, whose square may underflow:
    p1 = -0.25 * a0
    p0 = 0.25 * (a1 * a1 - 1.5 * a0 * a2)
    r = _isolated_root(1.5 * a2, p1 * energy, p0 * energy)
    product = -p0 / r
    total = (product - p1) / r
    discriminant = energy * total * total - 4.0 * product
    width = abs(root) * math.sqrt(abs(discriminant))
    r, total, _ = _roots(motion)
    middle = -0.5 * total
    if (root <= 0.0) == (discriminant >= 0.0):
        _set_rectangular(motion, r, middle + 0.5 * width, middle - 0.5 * width, width)
    else:
        _set_rhombic(motion, r, middle, 0.5 * width)


@kernel
def start_beside_saddle(
    motion: QuarticConstants, a0: float, a1: float, a2: float, root: float, side: float
) -> float:
    """Set the motion from where it is nearest to a saddle, and return ``tan h`` of that place.

    ``tan h`` and ``a0`` to ``a2`` are as in :func:`refer_to_saddle`. A motion that passes the
    saddle starts there in the direction ``side``, another one where it turns on that side.
    """
    energy = -root * abs(root)
    b0 = a0 + energy
    curvature = 6.0 * a2 + 2.0 * energy  # of the squared rate at the saddle
    turn = 0.0
    if root >= 0.0:
        for _ in range(NEAREST_STEPS):
            before = turn
            turn = side * root / math.sqrt(curvature + turn * (4.0 * a1 + b0 * turn))
            if abs(turn - before) <= 2.0e-16 * abs(turn):
                break
    b1 = a1 + b0 * turn
    b3 = turn * (0.5 * curvature + turn * (3.0 * a1 + b0 * turn))
    rate = side * max(-root, 0.0)
    b2 = curvature / 6.0 + turn * (2.0 * a1 + b0 * turn)
    set_quartic_constants(motion, b0, b1, b2, b3, rate, motion.turns_over)
    refer_to_saddle(motion, a0, a1, a2, root)
    return turn


@kernel
def place_beside_turn(motion: QuarticConstants, rate: float) -> float:
    """Return the place u at which a motion that starts at rest has a small rate ``u'``."""
    u = 0.0
    for _ in range(NEAREST_STEPS):
        before = u
        pull = 4.0 * motion.quartic_3 + u * (
            6.0 * motion.quartic_2 + u * (4.0 * motion.quartic_1 + u * motion.quartic_0)
        )
        u = rate * (rate / pull)
        if abs(u - before) <= 2.0e-16 * abs(u):
            break
    return u


@kernel
def _isolated_root(p2: float, p1: float, p0: float) -> float:
    """Return the real root of ``z^3 + p2 z^2 + p1 z + p0`` furthest from the other two."""
    shift = p2 / 3.0
    g = shift * shift - p1 / 3.0
    h = 0.5 * (shift * (p1 - 2.0 * shift * shift) - p0)
    if g > 0.0:
        size = math.sqrt(g)
        ratio = abs(h) / (g * size)
        if ratio <= 1.0:
            y = _trisected(ratio)
        else:
            v = math.pow(ratio + math.sqrt((ratio - 1.0) * (ratio + 1.0)), 1.0 / 3.0)
            y = v + 1.0 / v
        e = size * y
    elif g < 0.0:
        size = math.sqrt(-g)
        ratio = abs(h) / (-g * size)
        if ratio <= FLAT:
            e = size * _hyperbolically_trisected(ratio)
        else:
            v = math.pow(ratio + math.sqrt(ratio * ratio + 1.0), 1.0 / 3.0)
            e = size * (v - 1.0 / v)
    else:
        e = math.pow(2.0 * abs(h), 1.0 / 3.0)
    z = (e if h >= 0.0 else -e) - shift
    # Polished in z itself, so that a small root is known to full relative accuracy (Halley).
    for _ in range(POLISHING_STEPS):
        slope = p1 + z * (2.0 * p2 + 3.0 * z)
        value = p0 + z * (p1 + z * (p2 + z))
        below = slope * slope - value * (p2 + 3.0 * z)
        if below == 0.0:
            break
        change = value * slope / below
        z -= change
        # It converges cubically: the next change would be below rounding.
        if abs(change) <= 3.0e-6 * abs(z):
            break
    return z


@kernel
def _trisected(x: float) -> float:
    """Return ``2 cos(arccos(x)/3)`` for x from 0 to 1, to 7e-7.

    It is the greatest y with y^3 - 3 y = 2 x.
    """
    square = x * x
    low = (1.73205196 + 0.333245128 * x) + square * (-0.0951072518 + 0.0439555711 * x)
    return low + (square * square) * (-0.0181083439 + 0.0039638132 * x)


@kernel
def _hyperbolically_trisected(x: float) -> float:
    """Return ``2 sinh(arsinh(x)/3)`` for x from 0 to FLAT, to 1.3e-6.

    It is the y with y^3 + 3 y = 2 x.
    """
    s = x * x
    square = s * s
    low = (0.666665828 - 0.0987088431 * s) + square * (0.0432535053 - 0.0231401238 * s)
    high = (0.0109748166 - 0.00348264796 * s) + square * 0.000508576893
    return x * (low + (square * square) * high)


@kernel
def _set_rectangular(
    motion: QuarticConstants, r: float, high: float, low: float, width: float
) -> None:
    """Set the constants for three real roots of the cubic, two of which are ``width`` apart."""
    motion.lattice = RECTANGULAR
    if r >= high:
        motion.root = r
        motion.second = r - high
        motion.third = r - low
        m = width / motion.third if motion.third > 0.0 else 0.0
        complement = motion.second / motion.third if motion.third > 0.0 else 1.0
    else:
        motion.root = high
        motion.second = width
        motion.third = high - r
        m = (low - r) / motion.third
        complement = width / motion.third
    motion.rate_scale = math.sqrt(motion.third)
    set_theta_constants(motion, m, math.sqrt(complement))


@kernel
def _set_rhombic(motion: QuarticConstants, r: float, real: float, imaginary: float) -> None:
    """Set the constants for one real root ``r`` of the cubic and two conjugate ones."""
    motion.lattice = RHOMBIC
    motion.root = r
    motion.second = r - real
    motion.third = imaginary
    away = motion.second
    size = math.sqrt(away * away + imaginary * imaginary)
    near = 0.5 * imaginary * imaginary / (size * (size + abs(away)))
    far = 0.5 * (size + abs(away)) / size
    motion.rate_scale = math.sqrt(size)
    if away >= 0.0:
        set_theta_constants(motion, near, math.sqrt(far))
    elif near < NEAR_SADDLE:
        motion.lattice = BESIDE_SADDLE
        motion.root = real
        set_theta_constants(motion, far, imaginary * math.sqrt(0.5 / (size * (size - away))))
    else:
        set_theta_constants(motion, far, math.sqrt(near))


@kernel
def quartic_motion(motion: QuarticConstants, t: float) -> tuple[float, float, float]:
    """Return ``sin h``, ``cos h`` and ``h'`` (``u = tan h``) a time ``t`` after the start."""
    s, c, d, n = theta_functions(motion, motion.rate_scale * t)
    scale = motion.rate_scale
    square = scale * scale
    # z = root + level/sigma^2, z' = -2 slope/sigma^3, all over a common denominator.
    if motion.lattice == RECTANGULAR:
        sigma = s
        level = square * (c * c)
        slope = square * scale * (c * d * n)
    elif motion.lattice == BESIDE_SADDLE:
        # From the real part of the conjugate roots, to which z comes close: it loses no digits.
        # All is divided by powers of d, which is so small that they would underflow.
        sigma = s
        inverse = 1.0 / d
        from_start = s * s * inverse
        from_half = c * c * inverse
        whole = n * n * inverse
        m = motion.parameter
        whole *= motion.complementary_modulus
        from_start *= motion.complementary_modulus
        fall = whole * whole + m * (from_half * from_half)
        level = square * (fall - (2.0 * m) * (from_start * from_start))
        slope = square * scale * (c * inverse * n) * fall
    else:
        sigma = s * d
        level = square * (c * c) * (n * n)
        sc = s * c
        slope = square * scale * (c * n) * (d * d * (n * n) - motion.parameter * (sc * sc))
    sine, cosine, rate = _by_weierstrass(motion, sigma, level, slope)
    return sine, cosine, _rate_by_energy(motion, sine, cosine, rate)


@kernel
def _rate_by_energy(motion: QuarticConstants, sine: float, cosine: float, rate: float) -> float:
    """Return ``h'`` from the energy, with the sign of ``rate``; ``rate`` where that loses digits.

    ``rate`` is a difference of powers of ``z``: soon after a start it is off by twenty roundings.
    """
    s2 = sine * sine
    c2 = cosine * cosine
    sc = sine * cosine
    fourth = motion.quartic_0 * s2 * s2
    third = 4.0 * motion.quartic_1 * (sc * s2)
    second = 6.0 * motion.quartic_2 * (s2 * c2)
    first = 4.0 * motion.quartic_3 * (sc * c2)
    start = motion.start_rate * motion.start_rate * (c2 * c2)
    square = (fourth + second) + (third + first) + start
    if square <= CLEAR * (abs(fourth) + abs(third) + abs(second) + abs(first) + start):
        return rate
    return math.sqrt(square) if rate > 0.0 else -math.sqrt(square)


@kernel
def _by_weierstrass(
    motion: QuarticConstants, sigma: float, level: float, slope: float
) -> tuple[float, float, float]:
    """Return the state from ``z = root + level/sigma^2`` and its slope.

    The form of ``u = X/Y`` that is far from 0/0 is used. The first becomes 0/0 where
    ``z = +- u' sqrt(a0)/2``, as often as u passes infinity, and nearly so where a0 is just below 0.
    The second, with a factor of X divided out, does so as long before the end of a period as the
    motion takes from its start until it comes back there. A motion that turns over never comes
    back.
    """
    if motion.turns_over == 0 and sigma < 0.0:
        # The motion repeats after a period of z, over which both change their signs.
        sigma = -sigma
        slope = -slope
    square = sigma * sigma
    z = motion.root * square + level
    push = max(abs(motion.start_rate), abs(motion.quartic_3))
    if push < VANISHING:
        if sigma == 0.0:
            return 0.0, 1.0, motion.start_rate
        # With z near 1 far from a slow start, and greater before, no product under- or overflows.
        most = math.sqrt(push) * square
        size = 1.0 / (max(abs(z), push * square) if abs(z) < VANISHING * square else most)
        root = math.sqrt(size)
        sigma *= root
        slope *= size * root
        square *= size
        z *= size
    if motion.start_rate == 0.0:
        # From a turning point: u = a3/z.
        x = motion.quartic_3 * square
        size = 1.0 / (x * x + z * z)
        root = math.sqrt(size)
        return x * root, z * root, 2.0 * motion.quartic_3 * slope * sigma * size
    side = 0.0
    by_second = motion.quartic_0 > 0.0  # it may pass infinity
    if not by_second and motion.turns_over == 0:
        by_second = _is_first_form_lost(motion, sigma, z, slope)
    if by_second:
        x, y, moved, side, by_second = _by_second_form(motion, sigma, z, slope)
    if not by_second:
        x, y, moved = _by_first_form(motion, sigma, z, slope)
        side = -1.0 if x * side < 0.0 else 1.0
    size = 1.0 / (x * x + y * y)
    root = side * math.sqrt(size)
    return x * root, y * root, moved * size


@kernel
def _by_second_form(
    motion: QuarticConstants, sigma: float, z: float, slope: float
) -> tuple[float, float, float, float, bool]:
    """Return X, Y, ``X' Y - X Y'`` and their sign by the form with a factor of X divided out.

    Also returns whether it is far from 0/0. If not, the sign is that of ``sin h``, for the first
    form.
    """
    a3 = motion.quartic_3
    rate = motion.start_rate
    a4 = rate * rate
    square = sigma * sigma
    along = 2.0 * a3 * z + motion.quartic_1 * a4 * square
    before = a4 * z
    after = motion.back * square
    x_part = 2.0 * (before - after)
    x = sigma * x_part
    y = 2.0 * rate * slope - sigma * along
    sign = 1.0 if rate > 0.0 else -1.0
    clear = True
    if motion.turns_over == 0:
        # The side of the start depends on whether the motion has come back yet.
        if motion.returns_early == 1:
            ahead = slope > 0.0 and x_part > 0.0
        else:
            ahead = slope >= 0.0 or x_part < 0.0
        side = sign if ahead else -sign
        terms = 2.0 * (abs(before) + abs(after)) * abs(sigma) + 2.0 * abs(rate * slope)
        terms += abs(sigma * along)
        clear = x * x + y * y >= NEAR_NOTHING * (terms * terms)
        sign = -1.0 if x * side < 0.0 or (x == 0.0 and y < 0.0) else 1.0
        if not clear:
            sign = side
    turned = rate * _bend(motion, z, square)
    pushed = 4.0 * a3 * slope * sigma
    return x, y, x_part * (turned - pushed) - 4.0 * a4 * slope * y, sign, clear


@kernel
def _bend(motion: QuarticConstants, z: float, square: float) -> float:
    """Return ``z'' sigma^4``."""
    a4 = motion.start_rate * motion.start_rate
    b = 2.0 * motion.quartic_1 * motion.quartic_3 - 0.5 * motion.quartic_0 * a4
    return 6.0 * z * (z + motion.quartic_2 * square) + b * (square * square)


@kernel
def _first_form(
    motion: QuarticConstants, sigma: float, z: float, slope: float
) -> tuple[float, float, float]:
    """Return both terms of ``X/sigma``, and Y, of Weierstrass's own form of ``u = X/Y``."""
    a4 = motion.start_rate * motion.start_rate
    square = sigma * sigma
    turned = 2.0 * motion.start_rate * slope
    along = sigma * (2.0 * motion.quartic_3 * z + motion.quartic_1 * a4 * square)
    return turned, along, 2.0 * z * z - 0.5 * motion.quartic_0 * a4 * (square * square)


@kernel
def _is_first_form_lost(motion: QuarticConstants, sigma: float, z: float, slope: float) -> bool:
    """Return whether Weierstrass's own form is nearly 0/0 for ``a0 <= 0``: its X cancels."""
    turned, along, y = _first_form(motion, sigma, z, slope)
    x = sigma * (turned + along)
    terms = sigma * (abs(turned) + abs(along))
    return x * x + y * y < CLEAR * (terms * terms)


@kernel
def _by_first_form(
    motion: QuarticConstants, sigma: float, z: float, slope: float
) -> tuple[float, float, float]:
    """Return X, Y and ``X' Y - X Y'`` by Weierstrass's own form.

    Their signs are right if ``a0 <= 0``.
    """
    first, rest, y = _first_form(motion, sigma, z, slope)
    x_part = first + rest
    turned = motion.start_rate * _bend(motion, z, sigma * sigma)
    turned += 4.0 * motion.quartic_3 * slope * sigma
    return sigma * x_part, y, 8.0 * x_part * z * slope - turned * y


@kernel
def squared_rate(motion: QuarticConstants, sine: float, cosine: float) -> float:
    """Return ``h'^2`` where the motion passes ``h``."""
    s2 = sine * sine
    c2 = cosine * cosine
    sc = sine * cosine
    even = motion.quartic_0 * s2 * s2 + 6.0 * motion.quartic_2 * s2 * c2
    odd = 4.0 * sc * (motion.quartic_1 * s2 + motion.quartic_3 * c2)
    return even + odd + motion.start_rate * motion.start_rate * (c2 * c2)


@kernel
def period_of(motion: QuarticConstants) -> float:
    """Return the time after which the motion repeats."""
    return 2.0 * quarter_period(motion.parameter, motion.complementary_modulus) / motion.rate_scale


@kernel
def time_to_place(motion: QuarticConstants, sine: float, cosine: float, rate: float) -> float:
    """Return the first time at which the motion is at ``h`` with ``h' = rate``.

    ``h`` must lie on the motion; ``sine`` and ``cosine`` may both have the opposite sign.
    """
    z, derivative = _place_on_curve(motion, sine, cosine, rate)
    distance = z - motion.root
    if motion.lattice == RECTANGULAR:
        e2 = distance + motion.second
        e3 = distance + motion.third
        others = e2 * e3
        if distance < NEAR_ROOT * e2:
            distance = derivative * derivative / others
            if abs(derivative) < VANISHING:  # its square may underflow
                distance = derivative * (derivative / others)
        t = carlson_rf(max(distance, 0.0), e2, e3)
        return t if derivative >= 0.0 else period_of(motion) - t
    e2 = distance + motion.second
    size = motion.rate_scale * motion.rate_scale
    if motion.lattice == BESIDE_SADDLE:
        e2 = distance
        distance -= motion.second
    others = e2 * e2 + motion.third * motion.third
    if distance < NEAR_ROOT * size:
        distance = derivative * derivative / others
    distance = max(distance, 0.0)
    # 2 sqrt(size) t = F(phi), cos phi = (distance - size)/(distance + size).
    inverse = 1.0 / (distance + size)
    c = (distance - size) * inverse
    if motion.lattice == BESIDE_SADDLE:
        c = (e2 - motion.third * motion.third / (size - motion.second)) * inverse
    s = 2.0 * math.sqrt(distance * size) * inverse
    m1 = motion.complementary_modulus * motion.complementary_modulus
    if abs(c) + motion.complementary_modulus < VANISHING:  # their squares may underflow
        share = motion.complementary_modulus / c
        integral = rf_near_logarithm(abs(c), abs(c) * math.sqrt(1.0 + share * share), 1.0)
    else:
        integral = carlson_rf(c * c, c * c + m1 * s * s, 1.0)
    t = 0.5 * s * integral / motion.rate_scale
    if c < 0.0:
        half = 0.5 * period_of(motion)
        return half - t if derivative >= 0.0 else half + t
    return t if derivative >= 0.0 else period_of(motion) - t


@kernel
def _place_on_curve(
    motion: QuarticConstants, s: float, c: float, rate: float
) -> tuple[float, float]:
    """Return ``z`` and ``-z'/2`` at a position, by Weierstrass's and Biermann's formulas."""
    a0 = motion.quartic_0
    a1 = motion.quartic_1
    a2 = motion.quartic_2
    a3 = motion.quartic_3
    start = motion.start_rate
    a4 = start * start
    product = start * rate
    straight = a4 * c * c + 2.0 * a3 * s * c
    back = product * straight < 0.0
    if back:
        top = (6.0 * a2 * a4 - 4.0 * a3 * a3) * (c * c) + 4.0 * a1 * a4 * (s * c)
        z = 0.5 * (top + a0 * a4 * (s * s)) / (product - straight)
    elif s == 0.0:
        return math.inf, math.inf
    else:
        z = 0.5 * (product + straight) / (s * s)
    cubed = s * s * s
    derivative = rate * (a4 * c + a3 * s)
    bent = start * (a4 * (c * c * c) + 3.0 * s * c * (a3 * c + a2 * s) + a1 * cubed)
    if back and product < 0.0 and abs(s) < abs(c):
        # On the way back the terms of one form cancel, near the start those of the other.
        ahead = (s / c) * (2.0 * z * z - 0.5 * a0 * a4)
        along = 2.0 * a3 * z
        lost = (abs(ahead) + abs(along)) * abs(cubed)
        if lost <= (abs(derivative) + abs(bent)) * abs(start):
            return z, 0.5 * (ahead - along - a1 * a4) / start
    return z, 0.5 * (derivative + bent) / cubed
