"""Bodies on springs to 50 digits, by Taylor series of a polynomial system; a twin for tests.

With ``u = 1/sqrt(b^2 + x^2)`` the motion is ``x' = v, v' = -w^2 (x - l x u), u' = -x v u^3``;
the energy is not used. Contacts are looked for on a fine grid, then by the secant method.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from mpmath import MPContext

mp: Any = MPContext()
mp.dps = 50
# What a step leaves out is about SHARE^TERMS = 1e-31 of a spring's length.
TERMS = 36
SHARE = mp.mpf("0.14")


@dataclass
class Body:
    inertia: Any  # kappa m
    radius: Any
    square: Any  # w^2
    length: Any
    height: Any
    foot: Any
    x: Any  # from the foot
    v: Any


def body(
    inertia: float, radius: float, spring: tuple[float, float, float, float], at: float, v: float
) -> Body:
    """`spring` is stiffness, length, height, foot; `at` along the line."""
    c, length, b, foot = map(mp.mpf, spring)
    m = mp.mpf(inertia)
    return Body(m, mp.mpf(radius), c / m, length, b, foot, mp.mpf(at) - foot, mp.mpf(v))


def product(one: list[Any], other: list[Any], k: int) -> Any:
    return mp.fdot((one[i], other[k - i]) for i in range(k + 1))


def series(one: Body) -> list[Any]:
    x, v = [one.x], [one.v]
    u = [1 / mp.sqrt(one.height**2 + one.x**2)]
    xu: list[Any] = []
    uu: list[Any] = []
    xv: list[Any] = []
    uuu: list[Any] = []
    for k in range(TERMS):
        xu.append(product(x, u, k))
        uu.append(product(u, u, k))
        xv.append(product(x, v, k))
        uuu.append(product(uu, u, k))
        x.append(v[k] / (k + 1))
        v.append(-one.square * (x[k] - one.length * xu[k]) / (k + 1))
        u.append(-product(xv, uuu, k) / (k + 1))
    return x


def at(row: list[Any], time: Any) -> tuple[Any, Any]:
    value = mp.polyval(row, time, asc=True)
    slope = mp.polyval([k * c for k, c in enumerate(row)][1:], time, asc=True)
    return value, slope


def run(one: Body, other: Body, k: float, impacts: int) -> list[tuple[Any, ...]]:
    """Time, places along the line and speeds after of the first impacts (papers' law, C (3))."""
    touch = 2 * mp.sqrt(one.radius * other.radius)
    restitution, t = mp.mpf(k), mp.zero
    found: list[tuple[Any, ...]] = []
    fresh = False
    while len(found) < impacts:
        rows = [series(one), series(other)]
        sizes = [(b, mp.sqrt(b.height**2 + b.x**2)) for b in (one, other)]

        def gap(time: Any, rows: list[list[Any]] = rows) -> Any:
            places = [at(row, time)[0] for row in rows]
            return other.foot + places[1] - one.foot - places[0] - touch

        whole = SHARE * min(length / (abs(b.v) + mp.sqrt(b.square) * length) for b, length in sizes)
        step = whole
        hit = None
        for n in range(1 if fresh else 0, 9):
            if gap(whole * n / 8) < 0:
                low, high = whole * (n - 1) / 8, whole * n / 8
                hit = mp.findroot(gap, (low, high), solver="anderson", tol=mp.mpf(10) ** -90)
                step = hit
                break
        for b, row in zip((one, other), rows, strict=True):
            b.x, b.v = at(row, step)
        t += step
        fresh = False
        if hit is None:
            continue
        fresh = True
        omegas = [b.v / b.radius for b in (one, other)]
        inertias = [b.inertia * b.radius**2 for b in (one, other)]
        relative = omegas[0] - omegas[1]
        change = (1 + restitution) * relative
        one.v -= change / (1 + inertias[0] / inertias[1]) * one.radius
        other.v += change / (1 + inertias[1] / inertias[0]) * other.radius
        found.append((t, one.foot + one.x, other.foot + other.x, one.v, other.v))
    return found
