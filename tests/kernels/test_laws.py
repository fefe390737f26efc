"""The impact laws: what they conserve, what they dissipate, and where they agree."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mpmath import MPContext

from vibro_cli.kernels.impact.laws import (
    HEDRIH,
    LAW_NAMES,
    NORMAL_IMPULSE,
    TRANSLATIONAL,
    balances_mass,
    impact_of_pair,
    law_approach,
    rounded_once,
    separation_speed,
)
from vibro_cli.kernels.world import BodyData
from vibro_cli.mechanics.system import LAWS, law_keeps_energy
from vibro_cli.stress.oracles.scene import weight_and_response

SETTINGS = settings(deadline=None, derandomize=True, max_examples=300)
EPSILON = 2.0**-52
mp: Any = MPContext()
mp.dps = 40

size = st.floats(0.01, 2.0)
# Not so slow that energies underflow.
speed = st.floats(-5.0, 5.0).map(lambda v: v if abs(v) > 1e-100 else 0.0)
share = st.floats(0.0, 1.0)
normal = st.floats(0.3, 1.0)


@st.composite
def bodies(draw: st.DrawFn) -> BodyData:
    body = BodyData()
    body.radius = draw(size)
    body.mass = draw(size)
    body.kappa = draw(st.sampled_from([1.0, 1.4, 1.5, 5.0 / 3.0, 2.0]))
    body.rolling_mass = body.kappa * body.mass
    return body


def omegas(body: BodyData, *speeds: float) -> list[Any]:
    return [mp.mpf(value) / mp.mpf(body.radius) for value in speeds]


def inertia(body: BodyData) -> Any:
    """Return J_P = kappa m r^2 from the rolling mass, with which the kernel computes."""
    return mp.mpf(body.rolling_mass) * mp.mpf(body.radius) ** 2


@SETTINGS
@given(a=bodies(), b=bodies(), va=speed, vb=speed, k=share)
def test_speeds_with_one_rounding(a: BodyData, b: BodyData, va: float, vb: float, k: float) -> None:
    """By the judges' weights; what changes has a few of the bodies and of 1 + k besides."""
    exact = [SimpleNamespace(**{name: mp.mpf(getattr(one, name)) for name in
             ("radius", "mass", "kappa")}) for one in (a, b)]  # fmt: skip
    for law, name in enumerate(LAW_NAMES):
        (qa, ha), (qb, hb) = (weight_and_response(name, one, mp.one) for one in exact)
        impulse = (1 + mp.mpf(k)) * (qa * va - qb * vb) / (qa * ha + qb * hb)
        *found, _ = rounded_once(law, k, a, b, 1.0, va, vb)
        changes = -impulse * ha, impulse * hb
        for after, before, change in zip(found, (va, vb), changes, strict=True):
            known = before + change
            bound = EPSILON * (abs(known) / 2 + 3 * abs(change)) + mp.mpf(10) ** -110
            assert abs(after - known) <= bound, name


@SETTINGS
@given(a=bodies(), b=bodies(), va=speed, vb=speed, k=share)
def test_hedrih(a: BodyData, b: BodyData, va: float, vb: float, k: float) -> None:
    wa, wb, loss = impact_of_pair(HEDRIH, k, a, b, 1.0, 1.0, va, vb)
    (one, one_after), (two, two_after) = omegas(a, va, wa), omegas(b, vb, wb)
    ja, jb = inertia(a), inertia(b)
    fastest = max(abs(value) for value in (one, two, one_after, two_after))
    # B (13): J_P omega is conserved; B (14): restitution on omega.
    scale = (ja + jb) * fastest
    assert abs(ja * (one_after - one) + jb * (two_after - two)) <= 8 * EPSILON * scale
    assert abs((two_after - one_after) - k * (one - two)) <= 16 * EPSILON * fastest
    # B (17): moment of impulse; B (20): loss; B (23): Carnot.
    moment = ja * jb / (ja + jb) * (1 + mp.mpf(k)) * (one - two)
    assert abs(jb * (two_after - two) - moment) <= 16 * EPSILON * scale
    taken = (1 - mp.mpf(k) ** 2) * ja * jb / (ja + jb) * (one - two) ** 2 / 2
    approach = max(abs(one), abs(two)) / max(abs(one - two), mp.mpf(10) ** -30)
    assert abs(loss - taken) <= (8 + 4 * approach) * EPSILON * taken + mp.mpf(10) ** -300
    changes = (ja * (one_after - one) ** 2 + jb * (two_after - two) ** 2) / 2
    carnot = (1 - mp.mpf(k)) / (1 + mp.mpf(k)) * changes
    assert abs(loss - carnot) <= 64 * EPSILON * (ja + jb) * fastest**2


@SETTINGS
@given(a=bodies(), b=bodies(), va=speed, vb=speed, k=share)
def test_translational(a: BodyData, b: BodyData, va: float, vb: float, k: float) -> None:
    wa, wb, loss = impact_of_pair(TRANSLATIONAL, k, a, b, 1.0, 1.0, va, vb)
    ma, mb = mp.mpf(a.mass), mp.mpf(b.mass)
    before, after = mp.mpf(va) - mp.mpf(vb), mp.mpf(wb) - mp.mpf(wa)
    fastest = max(map(abs, (va, vb, wa, wb)))
    change = ma * (mp.mpf(wa) - va) + mb * (mp.mpf(wb) - vb)
    assert abs(change) <= 8 * EPSILON * (ma + mb) * fastest
    assert abs(after - k * before) <= 16 * EPSILON * fastest
    energies = [
        mp.mpf(body.kappa) * mp.mpf(body.mass) * (mp.mpf(v) ** 2 - mp.mpf(w) ** 2) / 2
        for body, v, w in ((a, va, wa), (b, vb, wb))
    ]
    scale = 2 * (ma + mb) * fastest**2
    assert abs(loss - sum(energies)) <= 32 * EPSILON * scale


@SETTINGS
@given(a=bodies(), b=bodies(), va=speed, vb=speed, k=share, ca=normal, cb=normal)
def test_normal_impulse(
    a: BodyData, b: BodyData, va: float, vb: float, k: float, ca: float, cb: float
) -> None:
    wa, wb, loss = impact_of_pair(NORMAL_IMPULSE, k, a, b, ca, cb, va, vb)
    ma, mb = mp.mpf(a.rolling_mass), mp.mpf(b.rolling_mass)
    na, nb = mp.mpf(ca), mp.mpf(cb)
    approach = va * na - vb * nb
    fastest = max(map(abs, (va, vb, wa, wb)))
    # The impulses on both are opposite along n; they part at k times the speed of approach.
    along_a, along_b = ma * (mp.mpf(wa) - va) / na, mb * (mp.mpf(wb) - vb) / nb
    assert abs(along_a + along_b) <= 32 * EPSILON * (ma / na + mb / nb) * fastest
    assert abs(separation_speed(ca, cb, wa, wb) - k * approach) <= 32 * EPSILON * fastest
    if approach > 0:
        assert separation_speed(ca, cb, wa, wb) >= -8 * EPSILON * (abs(wa) + abs(wb))
    taken = (1 - mp.mpf(k) ** 2) * approach**2 / (na**2 / ma + nb**2 / mb) / 2
    lost_digits = max(abs(va), abs(vb)) / max(abs(approach), mp.mpf(10) ** -30)
    assert abs(loss - taken) <= (8 + 4 * lost_digits) * EPSILON * taken + mp.mpf(10) ** -300


@SETTINGS
@given(a=bodies(), b=bodies(), va=speed, vb=speed, k=share)
def test_equal_radii_on_one_piece(a: BodyData, b: BodyData, va: float, vb: float, k: float) -> None:
    """There normal-impulse equals hedrih; for bodies of equal kappa so does translational."""
    b.radius = a.radius
    scale = max(1.0, abs(va), abs(vb))
    one = impact_of_pair(HEDRIH, k, a, b, 0.9, 0.9, va, vb)
    other = impact_of_pair(NORMAL_IMPULSE, k, a, b, 0.9, 0.9, va, vb)
    assert math.isclose(one[0], other[0], rel_tol=0.0, abs_tol=32 * EPSILON * scale)
    assert math.isclose(one[1], other[1], rel_tol=0.0, abs_tol=32 * EPSILON * scale)
    b.kappa = a.kappa
    b.rolling_mass = b.kappa * b.mass
    one = impact_of_pair(HEDRIH, k, a, b, 0.9, 0.9, va, vb)
    other = impact_of_pair(TRANSLATIONAL, k, a, b, 0.9, 0.9, va, vb)
    assert math.isclose(one[0], other[0], rel_tol=0.0, abs_tol=32 * EPSILON * scale)
    assert math.isclose(one[1], other[1], rel_tol=0.0, abs_tol=32 * EPSILON * scale)
    tolerance = 64 * EPSILON * a.kappa * (a.mass + b.mass) * scale**2
    assert math.isclose(one[2], other[2], rel_tol=1e-12, abs_tol=tolerance)


def body_of(radius: float, mass: float, kappa: float) -> BodyData:
    body = BodyData()
    body.radius, body.mass, body.kappa, body.rolling_mass = radius, mass, kappa, kappa * mass
    return body


@pytest.mark.parametrize("name", LAW_NAMES)
def test_what_is_declared_of_a_law_is_what_its_impacts_do(name: str) -> None:
    law, declared = LAW_NAMES.index(name), LAWS[name]
    assert bool(balances_mass(law)) == declared.balances_mass
    rng = np.random.default_rng(5)
    parting: dict[str, list[float]] = {"lines": [], "arcs": []}
    for _ in range(2000):
        a, b = (body_of(*rng.uniform([0.05, 0.2, 1.0], [0.2, 3.0, 2.0])) for _ in range(2))
        va = float(rng.uniform(-1.0, 1.0))
        for place, slopes in (("lines", [0.8, 0.8]), ("arcs", rng.uniform(0.5, 1.0, 2))):
            ca, cb = map(float, slopes)
            vb = va * ca / cb - float(rng.uniform(1e-3, 1.0))  # they approach
            wa, wb, loss = impact_of_pair(law, 1.0, a, b, ca, cb, va, vb)
            parting[place].append(separation_speed(ca, cb, wa, wb))
            masses = [one.mass if declared.balances_mass else one.rolling_mass for one in (a, b)]
            if place == "lines" and declared.separates_on_lines:
                assert abs(masses[0] * (wa - va) + masses[1] * (wb - vb)) < 1e-14
            if bool(law_keeps_energy(name, [a.kappa, b.kappa])):
                assert abs(loss) < 1e-14
            b.kappa, b.rolling_mass = a.kappa, a.kappa * b.mass
            assert bool(law_keeps_energy(name, [a.kappa, b.kappa]))
            assert abs(impact_of_pair(law, 1.0, a, b, ca, cb, va, vb)[2]) < 1e-14
    assert (min(parting["lines"]) > 0.0) == declared.separates_on_lines
    assert (min(parting["arcs"]) > 0.0) == declared.separates_on_arcs


def test_unequal_inertia_takes_energy_under_a_law_that_balances_mass() -> None:
    _, _, loss = impact_of_pair(
        TRANSLATIONAL, 1.0, body_of(0.1, 1.0, 1.4), body_of(0.1, 1.0, 1.5), 1.0, 1.0, 1.0, 0.0
    )
    assert loss != 0.0
    assert not law_keeps_energy("translational", [1.4, 1.5])
    kappas = [np.array([1.4, 1.4]), np.array([1.5, 1.4])]
    assert law_keeps_energy("translational", kappas).tolist() == [False, True]


@SETTINGS
@given(a=bodies(), b=bodies(), va=speed, vb=speed, k=share, ca=normal, cb=normal)
def test_a_law_turns_its_relative_speed_to_minus_k_times_itself(
    a: BodyData, b: BodyData, va: float, vb: float, k: float, ca: float, cb: float
) -> None:
    """What the kernels have for that speed, and what an impact leaves, by the judges' weights."""
    for law, name in enumerate(LAW_NAMES):
        wa, wb, _ = impact_of_pair(law, k, a, b, ca, cb, va, vb)
        qa, qb = (weight_and_response(name, one, mp.mpf(c))[0] for one, c in ((a, ca), (b, cb)))
        turned, left = qa * va - qb * vb, qa * wa - qb * wb
        size = qa * (abs(va) + abs(wa)) + qb * (abs(vb) + abs(wb))
        # A rounding of each weight, product, difference and, of what is left, step of the impact.
        assert abs(law_approach(law, a, b, ca, cb, va, vb) - turned) <= 4 * EPSILON * size
        assert abs(left + k * turned) <= 16 * EPSILON * size


@SETTINGS
@given(a=bodies(), b=bodies(), va=speed, vb=speed, k=share, ca=normal, cb=normal)
def test_mirror_image_to_the_bit(
    a: BodyData, b: BodyData, va: float, vb: float, k: float, ca: float, cb: float
) -> None:
    """Right for left: b becomes a, all speeds change sign."""
    for law in range(len(LAW_NAMES)):
        wa, wb, loss = impact_of_pair(law, k, a, b, ca, cb, va, vb)
        mirrored = impact_of_pair(law, k, b, a, cb, ca, -vb, -va)
        if law == TRANSLATIONAL and a.kappa != b.kappa:
            assert mirrored[:2] == (-wb, -wa)
            assert math.isclose(mirrored[2], loss, rel_tol=1e-9, abs_tol=1e-13)
        else:
            assert mirrored == (-wb, -wa, loss)
