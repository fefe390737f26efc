"""Checks of the elliptic functions against mpmath, up to the immediate neighbourhood of m = 1."""

from __future__ import annotations

import math
from collections.abc import Iterable
from decimal import Decimal
from typing import Any

import numpy as np

from vibro_cli.kernels.numerics.constants import EPSILON
from vibro_cli.kernels.numerics.elliptic import (
    ThetaConstants,
    carlson_rf,
    set_theta_constants,
    theta_functions,
)
from vibro_cli.numerics.jacobi import Jacobi
from vibro_cli.stress.oracles.scene import mp
from vibro_cli.stress.scenes import Finding, Plan

LARGEST = math.log10(0.5)  # exponent of 1 - m
PLAINLY = "relative error of cn, dn / (eps max(1, u))"


def _exact(u: float, root: float) -> tuple[Any, Any, Any]:
    """Return sn, cn, dn of parameter ``1 - root^2`` by Jacobi's imaginary transformation.

    See DLMF 22.6.21. ``root`` is exact; its square may be as small as 1e-300, so the working
    precision must exceed that.
    """
    with mp.workdps(50 + 2 * max(0, -int(2 * mp.log10(root)))):
        complement = mp.mpf(root) ** 2
        sc, nc = (mp.ellipfun(kind, mp.mpc(0, u), m=complement) for kind in ("sc", "nc"))
        sn, cn = sc.imag, nc.real
        return sn, cn, mp.sqrt(cn * cn + complement * sn * sn)


def check_elliptic(plan: Plan) -> list[Finding]:
    """Check sn, cn, dn over a period, and Carlson's integral, for 1 - m from 0.5 to 1e-300."""
    rng = np.random.default_rng([plan.seed, 7])
    return [
        *_jacobi(rng, plan.amount(150, 4000)),
        _zeros(rng, plan.amount(60, 1000)),
        _carlson(rng, plan.amount(300, 10000)),
    ]


def _jacobi(rng: np.random.Generator, count: int) -> list[Finding]:
    tried = "sn, cn, dn over a period, 1 - m from 0.5 to 1e-300, against mpmath"
    absolute = Finding("absolute error / (1e-14 + 2 ulp(u))", tried, 1.0)
    relative = Finding(f"{PLAINLY} in a flight, beside its slope", tried, 16.0)
    plain = Finding(PLAINLY, tried, 16.0)
    for number in range(count):
        root = _root_of_complement(rng, number)
        jacobi = Jacobi(root)
        theta = ThetaConstants()
        set_theta_constants(theta, 1.0 - root * root, root)
        u = 4.0 * float(jacobi.quarter_period) * float(rng.uniform(-1.0, 1.0))
        *functions, common = theta_functions(theta, u)
        exact = _exact(u, root)
        off = [abs(mp.mpf(f) / common - e) for f, e in zip(functions, exact, strict=True)]
        absolute.take(_greatest(off) / (1.0e-14 + 2.0 * math.ulp(u)))
        # The argument in a flight is rounded, which moves the zeros of cn: add the slope to the
        # scale of its error.
        unit, (sn, cn, dn) = EPSILON * max(1.0, abs(u)), exact
        relative.take(
            _greatest(
                off[n] / unit / (abs(exact[n]) + abs(sn * slope)) for n, slope in ((1, dn), (2, cn))
            )
        )
        plain.take(_plain_error(jacobi, u, exact))
    return [absolute, relative, plain]


def _greatest(errors: Iterable[Any]) -> float:
    """Return the greatest of some mpmath numbers as a double, NaN if one is NaN."""
    return float(np.max([float(error) for error in errors]))


def _root_of_complement(rng: np.random.Generator, number: int) -> float:
    """Return the root of ``1 - m``, for every third number very close to the separatrix."""
    exponent = rng.uniform(-300.0, -16.0) if number % 3 == 0 else rng.uniform(-16.0, LARGEST)
    return math.sqrt(10.0**exponent)


def _plain_error(jacobi: Jacobi, u: float, exact: Any) -> float:
    """Return the greater of the plain relative errors of cn and dn."""
    unit = EPSILON * max(1.0, abs(u))
    pairs = zip(jacobi.functions(u)[1:], exact[1:], strict=True)
    return _greatest(abs(mp.mpf(found) / true - 1) / unit for found, true in pairs)


def _zeros(rng: np.random.Generator, count: int) -> Finding:
    """Check plain errors of cn and dn 1e-15 to 1e-2 from several zeros of cn, on both sides."""
    tried = "1e-15 to 1e-2 from the zeros of cn, 1 - m from 0.5 to 1e-300, against mpmath"
    plain = Finding(PLAINLY, tried, 16.0)
    for number in range(count):
        root = _root_of_complement(rng, number)
        jacobi = Jacobi(root)
        zero = (2 * int(rng.integers(-4, 4)) + 1) * jacobi.quarter_period
        off = float(10.0 ** rng.uniform(-15.0, -2.0)) * (1.0 if rng.random() < 0.5 else -1.0)
        u = float(zero + Decimal(off))
        plain.take(_plain_error(jacobi, u, _exact(u, root)))
    return plain


def _carlson(rng: np.random.Generator, count: int) -> Finding:
    """Check K and F as the solver computes them, by R_F."""
    tried = "F and K by Carlson's R_F, 1 - m from 0.5 to 1e-300, against mpmath"
    ulps = Finding("error (ulp)", tried, 4.0)
    for _ in range(count):
        complement = float(10.0 ** rng.uniform(-300.0, math.log10(0.5)))
        m1 = mp.mpf(complement)
        sine = float(rng.uniform(0.0, 1.0)) if rng.random() < 0.7 else 1.0
        cosine2 = (1.0 - sine) * (1.0 + sine)
        found = sine * carlson_rf(cosine2, cosine2 + complement * sine * sine, 1.0)
        s = mp.mpf(sine)
        exact = s * mp.elliprf(1 - s * s, 1 - s * s + m1 * s * s, 1)
        ulps.take(float(abs(mp.mpf(found) - exact)) / math.ulp(float(exact)))
    return ulps
