"""The three impact laws, for one pair or several simultaneous ones; the log of impacts.

Every law is an impulse ``I`` between the bodies of a pair that turns the law's own approach speed
``u = q_a v_a - q_b v_b`` into ``-k u``. The speeds change by ``-I h_a`` and ``+I h_b``:

===============  ==================  ==================
law              weight ``q``        response ``h``
===============  ==================  ==================
hedrih           ``1/r``             ``r/J_P = 1/(kappa m r)``
translational    ``1``               ``1/m``
normal-impulse   ``n t``             ``n t/(kappa m)``
===============  ==================  ==================

Sources: A (3), B (15)-(17), (20), C (3) for ``hedrih``; B (1)-(12) for ``translational``; Newton's
restitution on the approach speed with rolling preserved for ``normal-impulse``.
"""

from __future__ import annotations

import math

from vibro_cli.compile.kernel import kernel
from vibro_cli.kernels.numerics.constants import EPSILON
from vibro_cli.kernels.numerics.double_double import (
    dd_add,
    dd_multiply,
    difference_of_products,
    sum_of_products,
)
from vibro_cli.kernels.world import BodyData, World, flights_of

HEDRIH = 0
TRANSLATIONAL = 1
NORMAL_IMPULSE = 2
LAW_NAMES = ("hedrih", "translational", "normal-impulse")


@kernel
def weight_and_response(law: int, body: BodyData, normal: float) -> tuple[float, float]:
    """Return ``(q, h)`` of one body under a law; ``normal`` is ``n t`` of its path."""
    if law == HEDRIH:
        return 1.0 / body.radius, 1.0 / (body.rolling_mass * body.radius)
    if law == TRANSLATIONAL:
        return 1.0, 1.0 / body.mass
    return normal, normal / body.rolling_mass


@kernel
def inclination(one: BodyData, other: BodyData) -> float:
    """Return the cosine between the line of centres of touching bodies and their support.

    The support is the plane or line that they roll on.
    """
    if one.radius == other.radius:
        return 1.0
    return 2.0 * math.sqrt(one.radius * other.radius) / (one.radius + other.radius)


@kernel
def balances_mass(law: int) -> bool:
    """Return whether a law conserves ``sum m v`` of two bodies; others conserve ``sum kappa m v``.

    Lasting contact must begin with what the bounces before it conserve.
    """
    return law == TRANSLATIONAL


@kernel
def law_approach(
    law: int,
    body_a: BodyData,
    body_b: BodyData,
    normal_a: float,
    normal_b: float,
    speed_a: float,
    speed_b: float,
) -> float:
    """Return the relative speed ``u = q_a v_a - q_b v_b`` of a law, to about one rounding."""
    if law == TRANSLATIONAL:
        return speed_a - speed_b
    if law == HEDRIH:
        if body_a.radius == body_b.radius:
            return (speed_a - speed_b) / body_a.radius
        # Not with the weights 1/r: their rounding would show in a small relative speed.
        across = difference_of_products(body_b.radius, speed_a, body_a.radius, speed_b)
        return across / (body_a.radius * body_b.radius)
    if normal_a == normal_b:
        return normal_a * (speed_a - speed_b)
    return difference_of_products(normal_a, speed_a, normal_b, speed_b)


@kernel
def loss_of_impulse(
    law: int,
    restitution: float,
    body_a: BodyData,
    body_b: BodyData,
    impulse: float,
    approach: float,
    sum_a: float,
    sum_b: float,
) -> float:
    """Return the rolling energy (J) lost by the impulse of a pair, which turns ``u`` into ``-k u``.

    ``sum_a, sum_b`` are the sums of each body's speeds before and after (m/s).
    """
    if balances_mass(law) and body_a.kappa != body_b.kappa:
        # The law conserves m v, so q = m h, but the energy is kappa m v^2/2.
        qa, _ = weight_and_response(law, body_a, 1.0)
        qb, _ = weight_and_response(law, body_b, 1.0)
        lost = difference_of_products(body_a.kappa * qa, sum_a, body_b.kappa * qb, sum_b)
        return 0.5 * impulse * lost
    loss = 0.5 * (1.0 - restitution) * impulse * approach
    return loss * body_a.kappa if balances_mass(law) else loss


@kernel
def impact_of_pair(
    law: int,
    restitution: float,
    body_a: BodyData,
    body_b: BodyData,
    normal_a: float,
    normal_b: float,
    speed_a: float,
    speed_b: float,
) -> tuple[float, float, float]:
    """Return the speeds after the impact of one pair, and the energy lost.

    Returns ``v_a+``, ``v_b+`` (m/s) and the loss of rolling energy (J). The loss follows from the
    impulse, for ``hedrih`` and ``normal-impulse`` as ``(1 - k) I u/2`` (B (20)), and not from a
    difference of energies.
    """
    qa, ha = weight_and_response(law, body_a, normal_a)
    qb, hb = weight_and_response(law, body_b, normal_b)
    approach = law_approach(law, body_a, body_b, normal_a, normal_b, speed_a, speed_b)
    impulse = (1.0 + restitution) * approach / (qa * ha + qb * hb)
    after_a = speed_a - impulse * ha
    after_b = speed_b + impulse * hb
    sum_a = speed_a + after_a
    sum_b = speed_b + after_b
    loss = loss_of_impulse(law, restitution, body_a, body_b, impulse, approach, sum_a, sum_b)
    return after_a, after_b, loss


@kernel
def rounded_once(
    law: int,
    restitution: float,
    body_a: BodyData,
    body_b: BodyData,
    normal: float,
    speed_a: float,
    speed_b: float,
) -> tuple[float, float, float]:
    """Do what `impact_of_pair` does for bodies with one normal, but round each speed only once.

    The factors of the law have the same rounding at every impact of a pair, so that an energy which
    is not carried separately would drift. The common normal cancels.
    """
    qa, ha = weight_and_response(law, body_a, 1.0)
    qb, hb = weight_and_response(law, body_b, 1.0)
    if law == HEDRIH:  # as in `law_approach` not with the weights 1/r
        alike = body_a.radius == body_b.radius
        qa = 1.0 if alike else body_b.radius
        qb = 1.0 if alike else body_a.radius
        ha, hb = qa / body_a.rolling_mass, qb / body_b.rolling_mass
    high, low = sum_of_products(qa, speed_a, qb, -speed_b)
    high, low = dd_multiply(high, low, 1.0 + restitution)
    total, total_low = sum_of_products(qa, ha, qb, hb)
    impulse = high / total
    part, part_low = dd_multiply(total, total_low, -impulse)
    left, _ = dd_add(high, low, part, part_low)
    part, part_low = dd_multiply(impulse, left / total, -ha)
    after_a, _ = dd_add(speed_a, 0.0, part, part_low)
    part, part_low = dd_multiply(impulse, left / total, hb)
    after_b, _ = dd_add(speed_b, 0.0, part, part_low)
    _, _, loss = impact_of_pair(law, restitution, body_a, body_b, normal, normal, speed_a, speed_b)
    return after_a, after_b, loss


@kernel
def separation_speed(normal_a: float, normal_b: float, speed_a: float, speed_b: float) -> float:
    """Return the speed (m/s) at which a pair separates, ``n (v_b t_b - v_a t_a)``."""
    return normal_b * speed_b - normal_a * speed_a


# An approach below this share of the speeds is zero up to rounding.
SPEED_ROUNDING = 8.0 * EPSILON


@kernel
def do_part(normal_a: float, normal_b: float, wa: float, wb: float, size: float) -> bool:
    """Return whether bodies do not approach, up to the rounding of speeds of ``size`` (m/s)."""
    separation = separation_speed(normal_a, normal_b, wa, wb)
    return separation >= -SPEED_ROUNDING * (abs(wa) + abs(wb) + size)


@kernel
def is_graze(approach: float, pull: float, rounding: float) -> bool:
    """Return whether an impact cannot be distinguished from a passing touch.

    Without the impact, bodies that approach at ``approach`` (m/s) and are driven apart by ``pull``
    (m/s^2) would overlap by ``approach^2/(2 pull)``. In a touch this is at most the ``rounding``
    (m) of their positions.
    """
    return approach * approach <= 2.0 * pull * rounding


@kernel
def log_impact(world: World, j: int, wa: float, wb: float, law: int, loss: float) -> None:
    """Log the impact of a pair whose states and scratch speeds are those before it."""
    clock = world.clock[0]
    row = world.impacts[clock.impact_rows]
    pair = world.pairs[j]
    a, b = flights_of(world, pair)
    row.t = clock.t
    row.t_low = clock.t_low
    row.pair = j
    row.a = pair.a
    row.b = pair.b
    row.piece_a = a.piece
    row.piece_b = b.piece
    row.a_s = a.s
    row.a_c = a.c
    row.b_s = b.s
    row.b_c = b.c
    row.speed_a_pre = a.speed
    row.speed_b_pre = b.speed
    row.speed_a_post = wa
    row.speed_b_post = wb
    row.normal_a = pair.normal_a
    row.normal_b = pair.normal_b
    row.specific_energy_a_pre = a.specific_energy
    row.specific_energy_b_pre = b.specific_energy
    row.law = law
    pair.law = law
    row.loss = loss
    row.admissible = 1
    row.substituted = 0
    row.simultaneous = 0
    row.contact = 0
    clock.impact_rows += 1
    clock.collisions += 1


@kernel
def hold(world: World, j: int, held: int, delay: float) -> None:
    """Begin or end the lasting contact of a pair now; its bounces last ``delay`` (s) more."""
    clock = world.clock[0]
    pair = world.pairs[j]
    clock.held_pairs += held - pair.held
    clock.unlogged = 1
    pair.held = held
    pair.change_t = clock.t
    pair.change_t_low = clock.t_low
    pair.delay = delay
