"""Logging impacts and the changes of lasting contact."""

from __future__ import annotations

from vibro_cli.mechanics.laws import separation_speed
from vibro_cli.mechanics.records import PairData
from vibro_cli.numerics.engine import kernel
from vibro_cli.simulation.world import World

# A parting speed above -this (relative) is zero up to rounding.
SPEED_ROUNDING = 8.0 * 2.220446049250313e-16


@kernel
def parts(pair: PairData, wa: float, wb: float) -> int:
    """1 if the bodies part, or stay together up to rounding, with these speeds."""
    separation = separation_speed(pair.normal_a, pair.normal_b, wa, wb)
    return 1 if separation >= -SPEED_ROUNDING * (abs(wa) + abs(wb)) else 0


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
    row.loss = loss
    row.admissible = 1
    row.substituted = 0
    row.simultaneous = 0
    row.contact = 0
    row.crossings = clock.crossings
    clock.impact_rows += 1
    clock.collisions += 1


@kernel
def log_contact(world: World, j: int, opened: int, delay: float) -> None:
    """Log that a lasting contact of a pair closes (``delay`` s from now) or opens."""
    clock = world.clock[0]
    row = world.touches[clock.contact_rows]
    pair = world.pairs[j]
    a = world.flights[pair.a]
    b = world.flights[pair.b]
    row.t = clock.t
    row.t_low = clock.t_low
    row.delay = delay
    row.a = pair.a
    row.b = pair.b
    row.opened = opened
    row.piece_a = a.piece
    row.piece_b = b.piece
    row.b_s = b.s
    row.b_c = b.c
    row.speed = b.speed
    clock.contact_rows += 1
    if opened == 0:
        clock.contacts += 1
