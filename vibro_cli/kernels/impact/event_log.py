"""Logging impacts and the changes of lasting contact."""

from __future__ import annotations

from vibro_cli.compile.kernel import kernel
from vibro_cli.kernels.impact.laws import separation_speed
from vibro_cli.kernels.numerics.double_double import time_between
from vibro_cli.kernels.world import PairData, World

# A parting speed above -this (relative) is zero up to rounding.
SPEED_ROUNDING = 8.0 * 2.220446049250313e-16

# Times closer than this share of themselves are one instant.
SAME_INSTANT = 64.0 * 2.220446049250313e-16


@kernel
def parts(pair: PairData, wa: float, wb: float, size: float) -> int:
    """1 if the bodies part, or stay together up to the rounding of speeds of this size (m/s)."""
    return 1 if do_part(pair.normal_a, pair.normal_b, wa, wb, size) else 0


@kernel
def do_part(normal_a: float, normal_b: float, wa: float, wb: float, size: float) -> bool:
    """Tell whether bodies of given normals do what :func:`parts` asks for."""
    separation = separation_speed(normal_a, normal_b, wa, wb)
    return separation >= -SPEED_ROUNDING * (abs(wa) + abs(wb) + size)


@kernel
def log_impact(world: World, j: int, wa: float, wb: float, law: int, loss: float) -> None:
    """Log the impact of a pair whose states and scratch speeds are those before it."""
    clock = world.clock[0]
    row = world.impacts[clock.impact_rows]
    pair = world.pairs[j]
    a = world.flights[pair.a]
    b = world.flights[pair.b]
    row.t = clock.t
    row.t_low = clock.t_low
    row.pair = j
    row.a = pair.a
    row.b = pair.b
    row.piece_a = a.piece
    row.piece_b = b.piece
    row.lap_a = a.lap
    row.lap_b = b.lap
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
    row.law = law
    pair.law = law
    row.loss = loss
    row.admissible = 1
    row.substituted = 0
    row.simultaneous = 0
    row.contact = 0
    row.crossings = clock.crossings
    clock.impact_rows += 1
    clock.collisions += 1


@kernel
def hold(world: World, j: int, held: int, delay: float) -> None:
    """Begin or end the lasting contact of a pair now, its bounces lasting ``delay`` (s) more."""
    clock = world.clock[0]
    pair = world.pairs[j]
    clock.held_pairs += held - pair.held
    clock.unlogged = 1
    pair.held = held
    pair.change_t = clock.t
    pair.change_t_low = clock.t_low
    pair.delay = delay


@kernel
def log_contacts(world: World, t: float, t_low: float) -> None:
    """Log the contacts that have closed or opened for good before the next event at ``t``.

    Within one instant, or one accumulation, a contact may open and close many times.
    """
    clock = world.clock[0]
    clock.unlogged = 0
    for j in range(world.settings[0].pairs):
        pair = world.pairs[j]
        if pair.held == pair.logged:
            continue
        later = time_between(t, t_low, pair.change_t, pair.change_t_low)
        if later > pair.delay + SAME_INSTANT * abs(t):
            _log_contact(world, j, pair)
            pair.logged = pair.held
        else:
            clock.unlogged = 1


@kernel
def _log_contact(world: World, j: int, pair: PairData) -> None:
    clock = world.clock[0]
    row = world.touches[clock.contact_rows]
    a = world.flights[pair.a]
    b = world.flights[pair.b]
    row.t = pair.change_t
    row.t_low = pair.change_t_low
    row.delay = pair.delay
    row.a = pair.a
    row.b = pair.b
    row.opened = 1 - pair.held
    row.piece_a = a.piece
    row.piece_b = b.piece
    row.b_s = b.s
    row.b_c = b.c
    row.speed = b.p * world.tracks[pair.b * world.settings[0].pieces + b.piece].speed_factor
    clock.contact_rows += 1
    clock.contacts += pair.held
