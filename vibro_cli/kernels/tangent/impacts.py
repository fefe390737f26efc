"""The derivative of the state of all bodies across impacts: saltation matrices.

Where a gap ``g`` closes, bodies that arrive by ``f^-`` go on by ``f^+`` from ``R(z)``:

``dz^+ = D R (dz^- + f^- dt) - f^+ dt,    dt = -(grad g dz^-)/(grad g f^-)``

(M. di Bernardo, C. Budd, A. Champneys, P. Kowalczyk, *Piecewise-smooth Dynamical Systems*, Springer
2008, 2.5). Ways stay what they are in an impact, so that

``dq^+ = dq^- + (v^- - v^+) dt,    dv^+ = dv^- - (a^+ - a^-) dt + (change of v^+ - v^-)``.

Impulses of pairs that share a body are one linear system (see ``kernels.impact``); its derivative
is the same system with another right side, each pair at its own ``dt``. Which of them came first in
a neighbouring motion would matter there: such a map is not differentiable, and this is one of its
one-sided derivatives' means, good for orders of magnitude.
"""

from __future__ import annotations

from vibro_cli.compile.kernel import kernel
from vibro_cli.kernels.contact.contact_kinematics import centre_position, centre_tangent
from vibro_cli.kernels.impact.laws import NORMAL_IMPULSE, law_approach, weight_and_response
from vibro_cli.kernels.numerics.tridiagonal import solve_from_both_ends
from vibro_cli.kernels.tangent.frame import Tangents
from vibro_cli.kernels.world import ImpactRow, World

# Columns of the scratch rows of a joint impact.
_IMPULSE = 0
_NORMAL_A, _NORMAL_B = 1, 2  # derivatives of n t of both bodies
_DELAY = 3
WIDTH = 4


@kernel
def strike(world: World, tangents: Tangents, begin: int, count: int) -> None:
    """Carry the tangent vectors over impacts of ``count`` pairs in a row, solved jointly."""
    pairs = world.settings[0].pairs
    first = world.impacts[begin].pair
    _solve_impulses(world, begin, count)
    for step in range(count):
        pair = world.pairs[(first + step) % pairs]
        tangents.turning[step, _IMPULSE] = pair.solution
        if pair.restitution == 0.0:
            tangents.state[0].lost = 1
    for column in range(len(tangents.frame)):
        for step in range(count):
            _prepare(world, tangents, begin, step, column)
        _solve_changes(world, tangents, begin, count, column)
        for step in range(count):
            _apply(world, tangents, world.impacts[begin + step], step, column)
        tangents.delay[0, column] = tangents.turning[0, _DELAY]


@kernel
def _set_matrix(world: World, begin: int, step: int, count: int) -> None:
    """Set the matrix row of a pair: how impulses change its law's relative speed."""
    row = world.impacts[begin + step]
    pair = world.pairs[row.pair]
    qa, ha = weight_and_response(row.law, world.bodies[row.a], row.normal_a)
    qb, hb = weight_and_response(row.law, world.bodies[row.b], row.normal_b)
    pair.part_a = qa * ha
    pair.part_b = qb * hb
    pair.lower = 0.0
    pair.upper = 0.0
    if step > 0:
        before = world.impacts[begin + step - 1]
        _, h = weight_and_response(row.law, world.bodies[row.a], before.normal_b)
        pair.lower = -qa * h
    if step < count - 1:
        after = world.impacts[begin + step + 1]
        _, h = weight_and_response(row.law, world.bodies[row.b], after.normal_a)
        pair.upper = -qb * h


@kernel
def _solve_impulses(world: World, begin: int, count: int) -> None:
    """Set the impulses (``solution``) of the pairs of an impact."""
    for step in range(count):
        row = world.impacts[begin + step]
        _set_matrix(world, begin, step, count)
        approach = law_approach(
            row.law, world.bodies[row.a], world.bodies[row.b], row.normal_a, row.normal_b,
            row.speed_a_pre, row.speed_b_pre,
        )  # fmt: skip
        pair = world.pairs[row.pair]
        pair.right = (1.0 + pair.restitution) * approach
    solve_from_both_ends(world.pairs, world.settings[0].pairs, world.impacts[begin].pair, count)


@kernel
def _prepare(world: World, tangents: Tangents, begin: int, step: int, column: int) -> None:
    """Set what one tangent vector changes of a pair: the time of its impact, its normals."""
    row = world.impacts[begin + step]
    way_a = tangents.frame[2 * row.a, column]
    way_b = tangents.frame[2 * row.b, column]
    closing = row.normal_a * row.speed_a_pre - row.normal_b * row.speed_b_pre
    delay = (row.normal_b * way_b - row.normal_a * way_a) / closing
    tangents.turning[step, _DELAY] = delay
    tangents.turning[step, _NORMAL_A] = 0.0
    tangents.turning[step, _NORMAL_B] = 0.0
    if row.law == NORMAL_IMPULSE and row.piece_a != row.piece_b:
        # On one piece bodies in contact have the same normals everywhere.
        change_a, change_b = normal_changes(
            world, row, way_a + row.speed_a_pre * delay, way_b + row.speed_b_pre * delay
        )
        tangents.turning[step, _NORMAL_A] = change_a
        tangents.turning[step, _NORMAL_B] = change_b


@kernel
def normal_changes(world: World, row: ImpactRow, way_a: float, way_b: float) -> tuple[float, float]:
    """Change of n t of both bodies of a pair in contact that move on in contact by small ways."""
    pieces = world.settings[0].pieces
    piece_a = world.pieces[row.piece_a]
    piece_b = world.pieces[row.piece_b]
    track_a = world.tracks[row.a * pieces + row.piece_a]
    track_b = world.tracks[row.b * pieces + row.piece_b]
    distance = world.pairs[row.pair].distance
    ax, ay = centre_position(piece_a, track_a, row.a_s, row.a_c)
    bx, by = centre_position(piece_b, track_b, row.b_s, row.b_c)
    tax, tay = centre_tangent(piece_a, row.a_s, row.a_c)
    tbx, tby = centre_tangent(piece_b, row.b_s, row.b_c)
    nx = (bx - ax) / distance
    ny = (by - ay) / distance
    turned = tax * tbx + tay * tby
    bend_a = 0.0 if piece_a.sign == 0.0 else piece_a.sign / track_a.path_radius
    bend_b = 0.0 if piece_b.sign == 0.0 else piece_b.sign / track_b.path_radius
    change_a = (turned * way_b - way_a) / distance + bend_a * (ny * tax - nx * tay) * way_a
    change_b = (way_b - turned * way_a) / distance + bend_b * (ny * tbx - nx * tby) * way_b
    return change_a, change_b


@kernel
def _solve_changes(world: World, tangents: Tangents, begin: int, count: int, column: int) -> None:
    """Set the changes of all impulses (``solution``) for one tangent vector."""
    tau = tangents.state[0].time_scale
    turning = tangents.turning
    for step in range(count):
        row = world.impacts[begin + step]
        _set_matrix(world, begin, step, count)
        pair = world.pairs[row.pair]
        delay = turning[step, _DELAY]
        change_a = turning[step, _NORMAL_A]
        change_b = turning[step, _NORMAL_B]
        qa, _ = weight_and_response(row.law, world.bodies[row.a], row.normal_a)
        qb, _ = weight_and_response(row.law, world.bodies[row.b], row.normal_b)
        speed_a = tangents.frame[2 * row.a + 1, column] / tau + tangents.arriving[row.a, 1] * delay
        speed_b = tangents.frame[2 * row.b + 1, column] / tau + tangents.arriving[row.b, 1] * delay
        approach = qa * speed_a - qb * speed_b
        approach += change_a * row.speed_a_pre - change_b * row.speed_b_pre
        right = (1.0 + pair.restitution) * approach
        if row.law == NORMAL_IMPULSE:
            yield_a = row.normal_a * change_a / world.bodies[row.a].rolling_mass
            yield_b = row.normal_b * change_b / world.bodies[row.b].rolling_mass
            right -= 2.0 * (yield_a + yield_b) * turning[step, _IMPULSE]
            if step > 0:
                before = world.impacts[begin + step - 1]
                other = turning[step - 1, _NORMAL_B]
                change = change_a * before.normal_b + row.normal_a * other
                ease = 1.0 / world.bodies[row.a].rolling_mass
                right += change * ease * turning[step - 1, _IMPULSE]
            if step < count - 1:
                after = world.impacts[begin + step + 1]
                other = turning[step + 1, _NORMAL_A]
                change = change_b * after.normal_a + row.normal_b * other
                ease = 1.0 / world.bodies[row.b].rolling_mass
                right += change * ease * turning[step + 1, _IMPULSE]
        pair.right = right
    solve_from_both_ends(world.pairs, world.settings[0].pairs, world.impacts[begin].pair, count)


@kernel
def _apply(world: World, tangents: Tangents, row: ImpactRow, step: int, column: int) -> None:
    """Change the ways and speeds of one tangent vector by what a pair's impulse and delay do."""
    tau = tangents.state[0].time_scale
    impulse = tangents.turning[step, _IMPULSE]
    delay = tangents.turning[step, _DELAY]
    change = world.pairs[row.pair].solution
    _, ha = weight_and_response(row.law, world.bodies[row.a], row.normal_a)
    _, hb = weight_and_response(row.law, world.bodies[row.b], row.normal_b)
    # A response changes with the normal under one law only; its changes are zero under the others.
    turn_a = tangents.turning[step, _NORMAL_A] / world.bodies[row.a].rolling_mass
    turn_b = tangents.turning[step, _NORMAL_B] / world.bodies[row.b].rolling_mass
    tangents.frame[2 * row.a, column] += impulse * ha * delay
    tangents.frame[2 * row.b, column] -= impulse * hb * delay
    tangents.frame[2 * row.a + 1, column] -= tau * (change * ha + impulse * turn_a)
    tangents.frame[2 * row.b + 1, column] += tau * (change * hb + impulse * turn_b)
