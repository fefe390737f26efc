"""What an event changes: the impact of a pair, and the end of a flight at a boundary."""

from __future__ import annotations

import math

from vibro_cli.mechanics.flight import (
    LIFT_OFF,
    anchor_at_crest,
    head_from_state,
    launch,
    measure_energy,
    set_arc_energy,
    set_arc_energy_from_state,
    squared_rate_at,
)
from vibro_cli.mechanics.gap import centre_position, centre_tangent
from vibro_cli.mechanics.laws import NORMAL_IMPULSE, impact_of_pair, separation_speed
from vibro_cli.mechanics.records import NEVER, Flight, PairData, TrackData
from vibro_cli.numerics.engine import kernel
from vibro_cli.simulation.world import (
    COLLISION,
    CROSSING,
    END_COLLISIONS,
    END_INADMISSIBLE,
    END_LIFT_OFF,
    END_OF_TRACE,
    RUNNING,
    WALL,
    ImpactRow,
    World,
)

# A parting speed above -this (relative) is zero up to rounding.
SEPARATION_ROUNDING = 8.0 * 2.220446049250313e-16
# Below this share of the whole energy, a speed is carried over a junction instead of the energy.
SLOW_CROSSING = 1.0e-6


@kernel
def begin_flight(world: World, ball: int, cause: int, from_state: int) -> None:
    """Launch and log the flight whose state is set; its energy from the state or as carried."""
    settings = world.settings[0]
    flight = world.flights[ball]
    body = world.bodies[ball]
    piece = world.pieces[flight.piece]
    track = world.tracks[ball * settings.pieces + flight.piece]
    if from_state == 1:
        measure_energy(flight, body, track, settings.gravity)
    if piece.sign != 0.0:
        if from_state == 1:
            set_arc_energy_from_state(flight)
        else:
            anchor = flight.anchor if flight.anchor >= 0 else flight.piece
            set_arc_energy(flight, track, world.tracks[ball * settings.pieces + anchor])
    launch(flight, body, piece, track, settings.one_sided)
    clock = world.clock[0]
    _log_flight(world, ball, flight, cause)
    clock.flight_rows += 1
    for j in range(settings.pairs):
        pair = world.pairs[j]
        if pair.a == ball or pair.b == ball:
            pair.contact_t = NEVER
            pair.apart = 0
            pair.touching = 0
            pair.clear_t = flight.t
            pair.clear_t_low = flight.t_low


@kernel
def _log_flight(world: World, ball: int, flight: Flight, cause: int) -> None:
    row = world.log[world.clock[0].flight_rows]
    row.body = ball
    row.piece = flight.piece
    row.lap = flight.lap
    row.t = flight.t
    row.t_low = flight.t_low
    row.s = flight.s
    row.c = flight.c
    row.p = flight.p
    row.before_s = flight.before_s
    row.before_c = flight.before_c
    row.before_p = flight.before_p
    row.parameter = flight.parameter
    row.root_complement = flight.root_complement
    row.head = flight.head
    row.cause = cause
    row.exit_kind = flight.exit_kind


@kernel
def project(flight: Flight, s: float, c: float, p: float) -> tuple[float, float, float]:
    """Nearest state with ``S^2 + C^2 = 1`` and the flight's own energy (first order)."""
    scale = 1.5 - 0.5 * (s * s + c * c)
    s *= scale
    c *= scale
    sc = s * c
    size = p * p + sc * sc
    if size < 1.0e-8:
        return s, c, p
    if s * s > 0.5:
        root = flight.root_complement
        defect = 0.5 * ((c - p) * (c + p) - root * abs(root)) / size
    else:
        defect = 0.5 * (flight.parameter - s * s - p * p) / size
    turn = sc * defect
    return s + c * turn, c - s * turn, p + p * defect


@kernel
def _pair_normals(world: World, j: int, pair: PairData) -> tuple[float, float]:
    """``n t_a`` and ``n t_b`` of a pair in contact."""
    pieces = world.settings[0].pieces
    a = world.flights[pair.a]
    b = world.flights[pair.b]
    contact = world.contacts[j * pieces + a.piece]
    if a.piece == b.piece and contact.normal_a > 0.0:
        return contact.normal_a, contact.normal_b
    piece_a = world.pieces[a.piece]
    piece_b = world.pieces[b.piece]
    ax, ay = centre_position(piece_a, world.tracks[pair.a * pieces + a.piece], pair.a_s, pair.a_c)
    bx, by = centre_position(piece_b, world.tracks[pair.b * pieces + b.piece], pair.b_s, pair.b_c)
    dx = bx - ax
    dy = by - ay
    inverse = 1.0 / math.sqrt(dx * dx + dy * dy)
    tax, tay = centre_tangent(piece_a, pair.a_s, pair.a_c)
    tbx, tby = centre_tangent(piece_b, pair.b_s, pair.b_c)
    return (dx * tax + dy * tay) * inverse, (dx * tbx + dy * tby) * inverse


@kernel
def collide(world: World, j: int) -> int:
    """Carry out the impact of pair ``j`` at its contact time; return the cause of an end, or RUNNING."""
    settings = world.settings[0]
    clock = world.clock[0]
    pair = world.pairs[j]
    a = world.flights[pair.a]
    b = world.flights[pair.b]
    body_a = world.bodies[pair.a]
    body_b = world.bodies[pair.b]
    track_a = world.tracks[pair.a * settings.pieces + a.piece]
    track_b = world.tracks[pair.b * settings.pieces + b.piece]
    if a.frequency > 0.0:
        pair.a_s, pair.a_c, pair.a_p = project(a, pair.a_s, pair.a_c, pair.a_p)
    if b.frequency > 0.0:
        pair.b_s, pair.b_c, pair.b_p = project(b, pair.b_s, pair.b_c, pair.b_p)
    normal_a, normal_b = _pair_normals(world, j, pair)
    va = track_a.speed_factor * pair.a_p
    vb = track_b.speed_factor * pair.b_p
    law = settings.law
    wa, wb, loss = impact_of_pair(law, pair.restitution, body_a, body_b, normal_a, normal_b, va, vb)
    substituted = 0
    admissible = _parts(normal_a, normal_b, wa, wb)
    if admissible == 0 and settings.substitute == 1:
        law = NORMAL_IMPULSE
        substituted = 1
        wa, wb, loss = impact_of_pair(
            law, pair.restitution, body_a, body_b, normal_a, normal_b, va, vb
        )
    row = world.impacts[clock.impact_rows]
    _log_impact(world, j, row, va, vb, wa, wb, normal_a, normal_b)
    row.law = law
    row.substituted = substituted
    row.admissible = admissible
    row.loss = loss
    row.head_a_pre = a.head
    row.head_b_pre = b.head
    clock.t = pair.contact_t
    clock.t_low = pair.contact_t_low
    clock.impact_rows += 1
    clock.collisions += 1
    if admissible == 0 and substituted == 0:
        return _inadmissible(world, row, pair, wa, wb)
    _set_state(a, pair, pair.a_s, pair.a_c, pair.a_p, wa / track_a.speed_factor)
    _set_state(b, pair, pair.b_s, pair.b_c, pair.b_p, wb / track_b.speed_factor)
    _share_energy(world, pair, loss)
    row.head_a_post = a.head
    row.head_b_post = b.head
    pair.touching = 1
    if clock.collisions >= settings.stop_collisions:
        return END_COLLISIONS
    return RUNNING


@kernel
def _parts(normal_a: float, normal_b: float, wa: float, wb: float) -> int:
    """1 if the bodies part, or stay together up to rounding, after the law."""
    separation = separation_speed(normal_a, normal_b, wa, wb)
    return 1 if separation >= -SEPARATION_ROUNDING * (abs(wa) + abs(wb)) else 0


@kernel
def _inadmissible(world: World, row: ImpactRow, pair: PairData, wa: float, wb: float) -> int:
    """Complete the row with what the law says; the states stay those before the impact."""
    gravity = world.settings[0].gravity
    body_a = world.bodies[pair.a]
    body_b = world.bodies[pair.b]
    va = row.speed_a_pre
    vb = row.speed_b_pre
    row.head_a_post = row.head_a_pre + 0.5 * body_a.kappa * (wa - va) * (wa + va) / gravity
    row.head_b_post = row.head_b_pre + 0.5 * body_b.kappa * (wb - vb) * (wb + vb) / gravity
    return END_INADMISSIBLE


@kernel
def _log_impact(
    world: World,
    j: int,
    row: ImpactRow,
    va: float,
    vb: float,
    wa: float,
    wb: float,
    normal_a: float,
    normal_b: float,
) -> None:
    pair = world.pairs[j]
    a = world.flights[pair.a]
    b = world.flights[pair.b]
    row.t = pair.contact_t
    row.t_low = pair.contact_t_low
    row.pair = j
    row.a = pair.a
    row.b = pair.b
    row.piece_a = a.piece
    row.piece_b = b.piece
    row.lap_a = a.lap
    row.lap_b = b.lap
    row.a_s = pair.a_s
    row.a_c = pair.a_c
    row.b_s = pair.b_s
    row.b_c = pair.b_c
    row.speed_a_pre = va
    row.speed_b_pre = vb
    row.speed_a_post = wa
    row.speed_b_post = wb
    row.normal_a = normal_a
    row.normal_b = normal_b
    row.simultaneous = 0
    row.contact = 0
    row.crossings = world.clock[0].crossings


@kernel
def _set_state(
    flight: Flight, pair: PairData, s: float, c: float, p_before: float, p_after: float
) -> None:
    flight.t = pair.contact_t
    flight.t_low = pair.contact_t_low
    flight.before_s = s
    flight.before_c = c
    flight.before_p = p_before
    flight.s = s
    flight.c = c
    flight.p = p_after


@kernel
def _share_energy(world: World, pair: PairData, loss: float) -> None:
    """Give both bodies their energies after an impact, so that the sum keeps the law exactly.

    The body with less energy takes it from its state, the other one the rest; what that corrects is
    added up. A tie is shared evenly, so that mirror images stay mirror images.
    """
    settings = world.settings[0]
    a = world.flights[pair.a]
    b = world.flights[pair.b]
    body_a = world.bodies[pair.a]
    body_b = world.bodies[pair.b]
    track_a = world.tracks[pair.a * settings.pieces + a.piece]
    track_b = world.tracks[pair.b * settings.pieces + b.piece]
    total = body_a.weight * a.head + body_b.weight * b.head - loss
    energy_a = body_a.weight * head_from_state(a, body_a, track_a, settings.gravity)
    energy_b = body_b.weight * head_from_state(b, body_b, track_b, settings.gravity)
    excess = total - (energy_a + energy_b)
    world.clock[0].energy_correction += abs(excess)
    if energy_a > energy_b:
        begin_flight(world, pair.b, COLLISION, 1)
        a.head = (total - energy_b) / body_a.weight
        _carry_energy(world, pair.a, track_a)
    elif energy_b > energy_a:
        begin_flight(world, pair.a, COLLISION, 1)
        b.head = (total - energy_a) / body_b.weight
        _carry_energy(world, pair.b, track_b)
    else:
        a.head = (energy_a + 0.5 * excess) / body_a.weight
        b.head = (energy_b + 0.5 * excess) / body_b.weight
        _carry_energy(world, pair.a, track_a)
        _carry_energy(world, pair.b, track_b)


@kernel
def _carry_energy(world: World, ball: int, track: TrackData) -> None:
    flight = world.flights[ball]
    anchor_at_crest(flight, track)
    begin_flight(world, ball, COLLISION, 0)


@kernel
def leave_piece(world: World, ball: int) -> int:
    """Carry out the end of a flight: a crossing, a wall, the end of the trace or a lift-off."""
    settings = world.settings[0]
    clock = world.clock[0]
    flight = world.flights[ball]
    clock.t = flight.exit_t
    clock.t_low = flight.exit_t_low
    clock.last_ball = ball
    if flight.exit_kind == LIFT_OFF:
        return END_LIFT_OFF
    track = world.tracks[ball * settings.pieces + flight.piece]
    right = flight.exit_side > 0
    flight.before_s = track.right_s if right else track.left_s
    flight.before_c = track.right_c if right else track.left_c
    flight.before_p = flight.exit_p
    target = flight.piece + (1 if right else -1)
    if settings.closed == 1 or 0 <= target < settings.pieces:
        _cross(world, ball, target, right, track.speed_factor * flight.exit_p)
        return RUNNING
    restitution = settings.right_wall if right else settings.left_wall
    if restitution < 0.0:
        return END_OF_TRACE
    p = flight.exit_p
    _enter(flight, track, not right)
    flight.p = -restitution * p
    if restitution < 1.0:
        begin_flight(world, ball, WALL, 1)
    else:
        begin_flight(world, ball, WALL, 0)
    return RUNNING


@kernel
def _enter(flight: Flight, track: TrackData, at_left: bool) -> None:
    """Place a flight at an end of its piece at the instant of its exit."""
    flight.t = flight.exit_t
    flight.t_low = flight.exit_t_low
    flight.s = track.left_s if at_left else track.right_s
    flight.c = track.left_c if at_left else track.right_c


@kernel
def _cross(world: World, ball: int, target: int, right: bool, speed: float) -> None:
    """Carry a body over a junction: centre and speed continue, the energy is carried."""
    settings = world.settings[0]
    clock = world.clock[0]
    flight = world.flights[ball]
    if target < 0:
        target = settings.pieces - 1
        flight.lap -= 1
    elif target >= settings.pieces:
        target = 0
        flight.lap += 1
    clock.crossings += 1
    flight.piece = target
    track = world.tracks[ball * settings.pieces + target]
    _enter(flight, track, right)
    flight.p = speed / track.speed_factor
    kinetic = 0.5 * world.bodies[ball].kappa * speed * speed / settings.gravity
    if kinetic > SLOW_CROSSING * flight.head:
        flight.p = _rate_by_energy(world, ball, flight, track)
    begin_flight(world, ball, CROSSING, 0)


@kernel
def _rate_by_energy(world: World, ball: int, flight: Flight, track: TrackData) -> float:
    """``P`` at the end of a piece from the carried energy, with the sign of the present ``P``."""
    settings = world.settings[0]
    if track.path_radius == 0.0:
        height = track.bottom + track.line_rise * flight.s
        rise = flight.head - height
        rate = math.sqrt(max(2.0 * settings.gravity * rise / world.bodies[ball].kappa, 0.0))
    else:
        anchor = flight.anchor if flight.anchor >= 0 else flight.piece
        set_arc_energy(flight, track, world.tracks[ball * settings.pieces + anchor])
        s2 = flight.s * flight.s
        if s2 > 0.5:
            root = flight.root_complement
            rate = math.sqrt(max(flight.c * flight.c - root * abs(root), 0.0))
        else:
            rate = math.sqrt(max(flight.parameter - s2, 0.0))
    if rate == 0.0:
        return flight.p
    return rate if flight.p > 0.0 else -rate
