"""Chains of touching bodies: their contact normals, joint impacts and contact forces.

The pair of a body and its right neighbour has the body's own number; a chain is a run of such
pairs (round the seam of a closed trace). Impulses and forces of a chain obey a tridiagonal system,
solved from both ends to the middle, so that a mirror image has mirrored results to the bit.
"""

from __future__ import annotations

import math

from vibro_cli.mechanics.gap import centre_position, centre_tangent
from vibro_cli.mechanics.laws import law_approach, weight_and_response
from vibro_cli.mechanics.records import Flight
from vibro_cli.numerics.engine import kernel
from vibro_cli.simulation.world import World

# The line of centres is level with the trace up to this share.
LIFT_ROUNDING = 1.0e-14


@kernel
def set_normals(world: World, j: int) -> float:
    """Set ``n t`` of both bodies of a pair from their present places; return the gap (m)."""
    pieces = world.settings[0].pieces
    pair = world.pairs[j]
    a = world.flights[pair.a]
    b = world.flights[pair.b]
    piece_a = world.pieces[a.piece]
    piece_b = world.pieces[b.piece]
    ax, ay = centre_position(piece_a, world.tracks[pair.a * pieces + a.piece], a.s, a.c)
    bx, by = centre_position(piece_b, world.tracks[pair.b * pieces + b.piece], b.s, b.c)
    dx = bx - ax
    dy = by - ay
    distance = math.sqrt(dx * dx + dy * dy)
    contact = world.contacts[j * pieces + a.piece]
    if a.piece == b.piece and contact.normal_a > 0.0:
        pair.normal_a = contact.normal_a
        pair.normal_b = contact.normal_b
    else:
        tax, tay = centre_tangent(piece_a, a.s, a.c)
        tbx, tby = centre_tangent(piece_b, b.s, b.c)
        pair.normal_a = (dx * tax + dy * tay) / distance
        pair.normal_b = (dx * tbx + dy * tby) / distance
    return distance - pair.distance


@kernel
def lifted_body(world: World, j: int) -> int:
    """The body of a touching pair that an impact would lift off a one-sided trace, or -1.

    The impulse P along the line of centres n needs impulses ``P n n_a`` and ``-P n n_b`` of the
    trace along its normals; a one-sided trace cannot pull.
    """
    pieces = world.settings[0].pieces
    pair = world.pairs[j]
    a = world.flights[pair.a]
    b = world.flights[pair.b]
    piece_a = world.pieces[a.piece]
    piece_b = world.pieces[b.piece]
    ax, ay = centre_position(piece_a, world.tracks[pair.a * pieces + a.piece], a.s, a.c)
    bx, by = centre_position(piece_b, world.tracks[pair.b * pieces + b.piece], b.s, b.c)
    dx = bx - ax
    dy = by - ay
    tax, tay = centre_tangent(piece_a, a.s, a.c)
    tbx, tby = centre_tangent(piece_b, b.s, b.c)
    rounding = LIFT_ROUNDING * pair.distance
    if dy * tax - dx * tay < -rounding:
        return pair.a
    if dy * tbx - dx * tby > rounding:
        return pair.b
    return -1


@kernel
def set_speed(world: World, ball: int) -> None:
    """Set a body's scratch speed from its state."""
    flight = world.flights[ball]
    track = world.tracks[ball * world.settings[0].pieces + flight.piece]
    flight.speed = track.speed_factor * flight.p


@kernel
def parting_speed(world: World, j: int) -> float:
    """Speed (m/s) at which a pair parts along its line of centres."""
    pair = world.pairs[j]
    speed_a = world.flights[pair.a].speed
    speed_b = world.flights[pair.b].speed
    return pair.normal_b * speed_b - pair.normal_a * speed_a


@kernel
def free_acceleration(world: World, ball: int) -> float:
    """Tangential acceleration (m/s^2) of a body under gravity alone."""
    flight = world.flights[ball]
    track = world.tracks[ball * world.settings[0].pieces + flight.piece]
    if supported(flight):
        return 0.0
    if track.path_radius == 0.0:
        return track.line_acceleration
    return -track.gravity_rate * (2.0 * flight.s * flight.c)


@kernel
def supported(flight: Flight) -> bool:
    """Tell whether a wall keeps a body from moving, being pressed to it at rest."""
    return flight.wall_side != 0 and flight.speed * flight.wall_side >= 0.0


@kernel
def _mobility(world: World, ball: int) -> float:
    """Acceleration of a body for one newton along its path; none at a wall."""
    flight = world.flights[ball]
    return 0.0 if supported(flight) else 1.0 / world.bodies[ball].rolling_mass


@kernel
def _centripetal(world: World, ball: int) -> tuple[float, float]:
    """Acceleration of a body's centre across its path (m/s^2)."""
    flight = world.flights[ball]
    piece = world.pieces[flight.piece]
    track = world.tracks[ball * world.settings[0].pieces + flight.piece]
    if piece.sign == 0.0:
        return 0.0, 0.0
    central = flight.speed * flight.speed / track.path_radius
    sine = 2.0 * flight.s * flight.c
    cosine = (flight.c - flight.s) * (flight.c + flight.s)
    return -piece.sign * central * sine, central * cosine


@kernel
def free_approach(world: World, j: int) -> float:
    """Second derivative of a pair's distance (m/s^2) without contact forces (normals set)."""
    pieces = world.settings[0].pieces
    pair = world.pairs[j]
    a = world.flights[pair.a]
    b = world.flights[pair.b]
    piece_a = world.pieces[a.piece]
    piece_b = world.pieces[b.piece]
    ax, ay = centre_position(piece_a, world.tracks[pair.a * pieces + a.piece], a.s, a.c)
    bx, by = centre_position(piece_b, world.tracks[pair.b * pieces + b.piece], b.s, b.c)
    nx = (bx - ax) / pair.distance
    ny = (by - ay) / pair.distance
    tax, tay = centre_tangent(piece_a, a.s, a.c)
    tbx, tby = centre_tangent(piece_b, b.s, b.c)
    across = nx * (b.speed * tby - a.speed * tay) - ny * (b.speed * tbx - a.speed * tax)
    cax, cay = _centripetal(world, pair.a)
    cbx, cby = _centripetal(world, pair.b)
    curve = nx * (cbx - cax) + ny * (cby - cay) + across * across / pair.distance
    drive_b = pair.normal_b * free_acceleration(world, pair.b)
    return drive_b - pair.normal_a * free_acceleration(world, pair.a) + curve


@kernel
def solve_from_both_ends(world: World, first: int, count: int) -> None:
    """Solve the tridiagonal system held in ``count`` pairs from ``first`` on, into ``solution``."""
    pairs = world.settings[0].pairs
    half = (count - 1) // 2
    for step in range(half):
        left = world.pairs[(first + step) % pairs]
        next_left = world.pairs[(first + step + 1) % pairs]
        right = world.pairs[(first + count - 1 - step) % pairs]
        next_right = world.pairs[(first + count - 2 - step) % pairs]
        factor_left = next_left.lower / left.diagonal
        factor_right = next_right.upper / right.diagonal
        diagonal_left = factor_left * left.upper
        diagonal_right = factor_right * right.lower
        value_left = factor_left * left.right
        value_right = factor_right * right.right
        if step == half - 1 and count % 2 == 1:
            next_left.diagonal -= diagonal_left + diagonal_right
            next_left.right -= value_left + value_right
        else:
            next_left.diagonal -= diagonal_left
            next_left.right -= value_left
            next_right.diagonal -= diagonal_right
            next_right.right -= value_right
    left = world.pairs[(first + half) % pairs]
    if count % 2 == 1:
        left.solution = left.right / left.diagonal
    else:
        right = world.pairs[(first + half + 1) % pairs]
        determinant = left.diagonal * right.diagonal - left.upper * right.lower
        value = left.right * right.diagonal - left.upper * right.right
        right.solution = (right.right * left.diagonal - right.lower * left.right) / determinant
        left.solution = value / determinant
    for step in range(half - 1, -1, -1):
        left = world.pairs[(first + step) % pairs]
        inner = world.pairs[(first + step + 1) % pairs]
        left.solution = (left.right - left.upper * inner.solution) / left.diagonal
        right = world.pairs[(first + count - 1 - step) % pairs]
        inner = world.pairs[(first + count - 2 - step) % pairs]
        right.solution = (right.right - right.lower * inner.solution) / right.diagonal


@kernel
def joint_impulses(world: World, first: int, count: int, law: int, plastic: int) -> None:
    """Impulses (``solution``) of pairs that close at one instant, each with its own k.

    Row of a pair: its law's relative speed after all impulses is ``-k`` times that before;
    ``plastic`` takes k = 0 for all.
    """
    pairs = world.settings[0].pairs
    for step in range(count):
        j = (first + step) % pairs
        pair = world.pairs[j]
        qa, ha = weight_and_response(law, world.bodies[pair.a], pair.normal_a)
        qb, hb = weight_and_response(law, world.bodies[pair.b], pair.normal_b)
        speed_a = world.flights[pair.a].speed
        approach = law_approach(qa, qb, speed_a, world.flights[pair.b].speed)
        k = 0.0 if plastic == 1 else pair.restitution
        pair.diagonal = qa * ha + qb * hb
        pair.right = (1.0 + k) * approach
        pair.lower = 0.0
        pair.upper = 0.0
        if step > 0:
            before = world.pairs[(first + step - 1) % pairs]
            _, h = weight_and_response(law, world.bodies[pair.a], before.normal_b)
            pair.lower = -qa * h
        if step < count - 1:
            after = world.pairs[(first + step + 1) % pairs]
            _, h = weight_and_response(law, world.bodies[pair.b], after.normal_a)
            pair.upper = -qb * h
    solve_from_both_ends(world, first, count)


@kernel
def apply_impulses(world: World, first: int, count: int, law: int) -> None:
    """Change the speeds of a run of pairs by their impulses, the two of one body at once."""
    pairs = world.settings[0].pairs
    for step in range(count + 1):
        change = 0.0
        ball = 0
        if step > 0:
            pair = world.pairs[(first + step - 1) % pairs]
            ball = pair.b
            _, h = weight_and_response(law, world.bodies[ball], pair.normal_b)
            change = pair.solution * h
        if step < count:
            pair = world.pairs[(first + step) % pairs]
            ball = pair.a
            _, h = weight_and_response(law, world.bodies[ball], pair.normal_a)
            change = change - pair.solution * h
        world.flights[ball].speed += change


@kernel
def contact_forces(world: World, first: int, count: int) -> None:
    """Forces (``solution``, N) that keep a run of pairs in contact (normals and speeds set)."""
    pairs = world.settings[0].pairs
    for step in range(count):
        j = (first + step) % pairs
        pair = world.pairs[j]
        ease_a = _mobility(world, pair.a)
        ease_b = _mobility(world, pair.b)
        pair.right = -free_approach(world, j)
        pair.diagonal = pair.normal_a * pair.normal_a * ease_a
        pair.diagonal += pair.normal_b * pair.normal_b * ease_b
        if pair.diagonal == 0.0:
            # Both at walls: nothing moves, nothing presses.
            pair.diagonal = 1.0
        pair.lower = 0.0
        pair.upper = 0.0
        if step > 0:
            before = world.pairs[(first + step - 1) % pairs]
            pair.lower = -pair.normal_a * before.normal_b * ease_a
        if step < count - 1:
            after = world.pairs[(first + step + 1) % pairs]
            pair.upper = -pair.normal_b * after.normal_a * ease_b
    solve_from_both_ends(world, first, count)
