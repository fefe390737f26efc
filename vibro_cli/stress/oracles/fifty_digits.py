"""First contacts in 50-digit arithmetic: slow, and apart from both the solver and the judge."""

from __future__ import annotations

from typing import Any

from vibro_cli.stress.oracles.interval_oracle import (
    BODY_A,
    BODY_B,
    GRAVITY,
    HORIZON,
    KAPPA,
    PLACE,
    RADIUS,
    SIDE,
    SIGN,
    SIZE,
    SLOPE,
    SPEED,
)  # fmt: skip

DIGITS = 50
TERMS = 44
STEP = 0.125  # of a step in w t max(1, f'/w): what is left out is below 1e-50
SAMPLES = 12


class MissingLibrary(Exception):
    """A library that only this suite needs is not installed."""


def multiprecision() -> Any:
    """A context of mpmath with 50 digits; raises MissingLibrary without mpmath."""
    try:
        from mpmath import MPContext
    except ImportError as error:
        raise MissingLibrary(
            "mpmath is missing; install it with: pip install 'vibro-cli[stress]'"
        ) from (error)
    context = MPContext()
    context.dps = DIGITS
    return context


class _Mover:
    """One body; its place as a polynomial on each step in turn."""

    def __init__(self, mp: Any, flight: Any, body: int) -> None:
        self.mp = mp
        number = {name: mp.mpf(float(flight[body + name])) for name in range(7)}
        gravity, self.slope = mp.mpf(float(flight[GRAVITY])), mp.mpf(float(flight[SLOPE]))
        self.sign, self.radius = number[SIGN], number[RADIUS]
        self.rho = number[SIZE] - self.sign * self.radius
        self.size, self.side = number[SIZE], number[SIDE]
        self.place, self.rate = number[PLACE], number[SPEED]
        self.pull = -gravity / number[KAPPA] * mp.sin(self.slope)
        if self.sign:
            self.w2 = gravity / number[KAPPA] / self.rho
            self.rate /= self.rho

    def fastest(self) -> float:
        """Greatest of ``w`` and rate, 1/s."""
        if not self.sign:
            return 0.0
        return float(self.mp.sqrt(self.w2) + abs(self.rate)) + 1.0e-3

    def series(self) -> list[Any]:
        """Taylor coefficients of the place in time."""
        mp = self.mp
        if not self.sign:
            return [self.place, self.rate, self.pull / 2]
        f, s, c = [self.place, self.rate], [mp.sin(self.place)], [mp.cos(self.place)]
        for k in range(TERMS - 1):
            f.append(-self.sign * self.w2 * s[k] / ((k + 1) * (k + 2)))
            rates = [(j + 1) * f[j + 1] for j in range(k + 1)]
            s.append(mp.fdot(zip(c, reversed(rates), strict=True)) / (k + 1))
            c.append(-mp.fdot(zip(s[: k + 1], reversed(rates), strict=True)) / (k + 1))
        return f

    def centre(self, place: Any) -> tuple[Any, Any]:
        """Centre of the body, from the junction (or the centre of the one arc)."""
        mp = self.mp
        sine, cosine = mp.sin(self.slope), mp.cos(self.slope)
        if not self.sign:
            along = place - (self.size if self.side < 0 else 0)
            return along * cosine - self.radius * sine, along * sine + self.radius * cosine
        x, y = self.rho * mp.sin(place), -self.sign * self.rho * mp.cos(place)
        if self.side:
            x, y = x - self.sign * self.size * sine, y + self.sign * self.size * cosine
        return x, y


def first_contact(mp: Any, flight: Any) -> Any:
    """Instant of the first contact of a flight (a row for the judge), or None.

    The gap is sampled densely; every least value between samples is sharpened to 50 digits before
    its sign decides.
    """
    bodies = [_Mover(mp, flight, body) for body in (BODY_A, BODY_B)]
    touch = bodies[0].radius + bodies[1].radius
    t, horizon = mp.zero, mp.mpf(float(flight[HORIZON]))
    while t < horizon:
        rates = [body.fastest() for body in bodies]
        h = min(mp.mpf(STEP) / max(*rates, 1.0e-3), horizon - t)
        rows = [body.series() for body in bodies]

        def gap(u: Any, rows: list[Any] = rows) -> Any:
            (ax, ay), (bx, by) = (
                body.centre(mp.polyval(row, u, asc=True))
                for body, row in zip(bodies, rows, strict=True)
            )
            return (bx - ax) ** 2 + (by - ay) ** 2 - touch**2

        found = _first_root(mp, gap, h)
        if found is not None:
            return t + found
        for body, row in zip(bodies, rows, strict=True):
            body.place, body.rate = mp.polyval(row, h, derivative=True, asc=True)
        t += h
    return None


def _first_root(mp: Any, gap: Any, h: Any) -> Any:
    """First root of the gap on a step, None if it stays positive.

    A sample before and one behind the step let a least value at its ends be seen.
    """
    times = [h * k / SAMPLES for k in range(-1, SAMPLES + 2)]
    values = [gap(u) for u in times]
    for k in range(1, SAMPLES + 2):
        if values[k] <= 0:
            return _bisect(gap, times[max(k - 1, 1)], times[k])
        if values[k] <= values[k - 1] and values[k] <= values[k + 1]:
            bottom = _least(mp, gap, times[k - 1], times[k + 1])
            if 0 <= bottom <= h and gap(bottom) <= 0:
                return _bisect(gap, max(times[k - 1], mp.zero), bottom)
    return None


def _least(mp: Any, gap: Any, low: Any, high: Any) -> Any:
    """Where the gap is least between two instants: golden section, then parabolas."""
    ratio = (mp.sqrt(5) - 1) / 2
    for _ in range(30):
        one, two = high - ratio * (high - low), low + ratio * (high - low)
        low, high = (low, two) if gap(one) < gap(two) else (one, high)
    u, step = (low + high) / 2, (high - low) / 2
    for _ in range(5):
        left, here, right = gap(u - step), gap(u), gap(u + step)
        u += step * (left - right) / (2 * (left - 2 * here + right))
        step = max(step * step, mp.mpf(10) ** -14)
    return u


def _bisect(gap: Any, low: Any, high: Any) -> Any:
    for _ in range(70):
        middle = (low + high) / 2
        low, high = (low, middle) if gap(middle) <= 0 else (middle, high)
    return (low + high) / 2
