"""The tangent map of a run, from the logs of its event loop.

Where a gap ``g`` closes, the vector field is ``f^-`` before and ``f^+`` after the event, and the
state z jumps to ``R(z)``:

``dz^+ = D R (dz^- + f^- dt) - f^+ dt,    dt = -(grad g dz^-)/(grad g f^-)``

(M. di Bernardo, C. Budd, A. Champneys, P. Kowalczyk, *Piecewise-smooth Dynamical Systems*, Springer
2008, 2.5). Positions do not change in an impact, so that

``dq^+ = dq^- + (v^- - v^+) dt,    dv^+ = dv^- - (a^+ - a^-) dt + (change of v^+ - v^-)``.

Impulses of pairs that share a body solve one linear system (see ``kernels.impact``). Its derivative
is the same system with another right-hand side, each pair at its own ``dt``. In a neighbouring
motion one of these impacts may come first, and their order matters: such a map is not
differentiable. The result is a kind of mean of its one-sided derivatives, good for orders of
magnitude.

Bodies are independent between events: the tangent vectors of a body are kept at the start of its
present flight, and carried on when that ends. The log of flights says when and how it ends; impacts
have their own log. No other part of the solver depends on this module.
"""

from __future__ import annotations

from collections.abc import Sequence

from vibro_cli.compile.kernel import kernel
from vibro_cli.kernels.contact.contact_kinematics import centre_position, centre_tangent
from vibro_cli.kernels.flow.flow import acceleration_at, replay_flight
from vibro_cli.kernels.flow.rotating_flow import torque
from vibro_cli.kernels.impact.laws import (
    NORMAL_IMPULSE,
    balances_mass,
    law_approach,
    weight_and_response,
)
from vibro_cli.kernels.numerics.double_double import time_between
from vibro_cli.kernels.numerics.tridiagonal import solve_from_both_ends
from vibro_cli.kernels.tangent.flight_jacobian import flight_jacobian
from vibro_cli.kernels.tangent.frame import (
    Tangents,
    begin_frame,
    carry_far,
    change_force,
    from_start,
    orthogonalise,
    scaled_back,
    spoil,
    store_amplification,
    store_growth,
    store_no_impact,
    store_smooth,
)
from vibro_cli.kernels.world import (
    COLLISION,
    CONTACT_CLOSED,
    CROSSING,
    RUNNING,
    SEGMENT,
    START,
    WALL,
    Flight,
    FlightRow,
    ImpactRow,
    TrackData,
    World,
    number_along,
    track_on,
)

# Columns of the scratch rows of a simultaneous impact.
_IMPULSE = 0
_NORMAL_A, _NORMAL_B = 1, 2  # derivatives of n t of both bodies
_DELAY = 3
# Ratios of speeds differ from 1 by less than this through rounding alone: normals are the same.
SAME_NORMALS = 1.0e-12
# Bodies that separate at less than this share of their speeds do so through rounding alone.
LEAST_PARTING = 1.0e-11


@kernel
def strike(world: World, tangents: Tangents, begin: int, count: int) -> None:
    """Carry the tangent vectors across impacts of ``count`` successive pairs, solved jointly."""
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
            row = world.impacts[begin + step]
            _apply(world, tangents, row, step, column)
            _delay_groups(tangents, row, column, tangents.turning[step, _DELAY])


@kernel
def _delay_groups(tangents: Tangents, row: ImpactRow, column: int, delay: float) -> None:
    """Set the derivative of the time of an impact for its bodies and those in contact with them.

    Other bodies that collide at the same instant have their own delays.
    """
    for body in range(len(tangents.delay)):
        group = tangents.current[1, body]
        if group == tangents.current[1, row.a] or group == tangents.current[1, row.b]:
            tangents.delay[body, column] = delay


@kernel
def _set_matrix(world: World, begin: int, step: int, count: int) -> None:
    """Set the matrix row of a pair: the changes of its relative speed per unit impulse."""
    row = world.impacts[begin + step]
    pair = world.pairs[row.pair]
    qa, ha = weight_and_response(row.law, world.bodies[row.a], row.normal_a)
    qb, hb = weight_and_response(row.law, world.bodies[row.b], row.normal_b)
    pair.part_a = qa * ha
    pair.part_b = qb * hb
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
    """Set the changes of a pair's time of impact and normals for one tangent vector."""
    row = world.impacts[begin + step]
    way_a = tangents.frame[2 * row.a, column]
    way_b = tangents.frame[2 * row.b, column]
    closing = row.normal_a * row.speed_a_pre - row.normal_b * row.speed_b_pre
    delay = (row.normal_b * way_b - row.normal_a * way_a) / closing
    tangents.turning[step, _DELAY] = delay
    tangents.turning[step, _NORMAL_A] = 0.0
    tangents.turning[step, _NORMAL_B] = 0.0
    if row.law == NORMAL_IMPULSE and row.piece_a != row.piece_b:
        # On one piece the normals of bodies in contact are constant.
        change_a, change_b = normal_changes(
            world, row, way_a + row.speed_a_pre * delay, way_b + row.speed_b_pre * delay
        )
        tangents.turning[step, _NORMAL_A] = change_a
        tangents.turning[step, _NORMAL_B] = change_b


@kernel
def normal_changes(world: World, row: ImpactRow, way_a: float, way_b: float) -> tuple[float, float]:
    """Return the changes of n t of both bodies in contact for small displacements in contact."""
    piece_a = world.pieces[row.piece_a]
    piece_b = world.pieces[row.piece_b]
    track_a = track_on(world, row.a, row.piece_a)
    track_b = track_on(world, row.b, row.piece_b)
    distance = world.pairs[row.pair].distance
    ax, ay = centre_position(piece_a, track_a, row.a_s, row.a_c)
    bx, by = centre_position(piece_b, track_b, row.b_s, row.b_c)
    tax, tay = centre_tangent(piece_a, row.a_s, row.a_c)
    tbx, tby = centre_tangent(piece_b, row.b_s, row.b_c)
    nx = (bx - ax) / distance
    ny = (by - ay) / distance
    turned = tax * tbx + tay * tby
    bend_a = curvature(world, row.a, row.piece_a)
    bend_b = curvature(world, row.b, row.piece_b)
    change_a = (turned * way_b - way_a) / distance + bend_a * (ny * tax - nx * tay) * way_a
    change_b = (way_b - turned * way_a) / distance + bend_b * (ny * tbx - nx * tby) * way_b
    return change_a, change_b


@kernel
def has_kink(world: World, row: ImpactRow, right: int) -> bool:
    """Return whether the normals of an impact change at another rate on either side of a junction.

    This is so where a body, the right or the left one, is at a junction at which the curvature of
    its path jumps, unless its path leads along the line of centres. Only ``normal-impulse`` depends
    on the normals.
    """
    if row.law != NORMAL_IMPULSE:
        return False
    body, piece, s, c = row.a, row.piece_a, row.a_s, row.a_c
    if right == 1:
        body, piece, s, c = row.b, row.piece_b, row.b_s, row.b_c
    jump = curvature_jump(world, body, piece, s, c)
    if jump == 0.0:
        return False
    track_a = track_on(world, row.a, row.piece_a)
    track_b = track_on(world, row.b, row.piece_b)
    ax, ay = centre_position(world.pieces[row.piece_a], track_a, row.a_s, row.a_c)
    bx, by = centre_position(world.pieces[row.piece_b], track_b, row.b_s, row.b_c)
    tx, ty = centre_tangent(world.pieces[piece], s, c)
    return abs(((bx - ax) * ty - (by - ay) * tx) * jump) > SAME_NORMALS


@kernel
def curvature_jump(world: World, body: int, piece: int, s: float, c: float) -> float:
    """Return the jump of the curvature (1/m) of a body's path at its place, 0 off junctions."""
    settings = world.settings[0]
    other = piece + end_at(track_on(world, body, piece), s, c)
    if settings.closed == 1:
        other = (other + settings.pieces) % settings.pieces
    if other == piece or other < 0 or other >= settings.pieces:
        return 0.0
    return curvature(world, body, other) - curvature(world, body, piece)


@kernel
def curvature(world: World, body: int, piece: int) -> float:
    """Return the curvature (1/m) of the path of a body's centre on a piece."""
    radius = track_on(world, body, piece).path_radius
    return world.pieces[piece].sign / radius if radius > 0.0 else 0.0


@kernel
def end_at(track: TrackData, s: float, c: float) -> int:
    """Return -1 at the left end of a body's track, 1 at the right end, 0 elsewhere."""
    line = track.path_radius == 0.0
    if s == track.left_s and (line or c == track.left_c):
        return -1
    return 1 if s == track.right_s and (line or c == track.right_c) else 0


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
    """Apply a pair's impulse and delay to the positions and speeds of one tangent vector."""
    tau = tangents.state[0].time_scale
    impulse = tangents.turning[step, _IMPULSE]
    delay = tangents.turning[step, _DELAY]
    change = world.pairs[row.pair].solution
    _, ha = weight_and_response(row.law, world.bodies[row.a], row.normal_a)
    _, hb = weight_and_response(row.law, world.bodies[row.b], row.normal_b)
    # Responses depend on the normal under one law only; under the others the changes are zero.
    turn_a = tangents.turning[step, _NORMAL_A] / world.bodies[row.a].rolling_mass
    turn_b = tangents.turning[step, _NORMAL_B] / world.bodies[row.b].rolling_mass
    tangents.frame[2 * row.a, column] += impulse * ha * delay
    tangents.frame[2 * row.b, column] -= impulse * hb * delay
    tangents.frame[2 * row.a + 1, column] -= tau * (change * ha + impulse * turn_a)
    tangents.frame[2 * row.b + 1, column] += tau * (change * hb + impulse * turn_b)


@kernel
def follow_tangents(
    world: World,
    known: int,
    cause: int,
    end_t: float,
    end_t_low: float,
    tangents: Tangents,
    scratch: Sequence[Flight],
) -> None:
    """Carry tangent vectors through a part of a run, and fill in their columns of impacts.

    ``world`` has the rows of the part in its logs; its pairs are used as scratch, as is the one
    flight in ``scratch``. ``known`` and ``cause`` are as in ``run_statistics.update_statistics``;
    at the end of the run (two doubles, s) all bodies are carried to it.
    """
    state = tangents.state[0]
    rows = world.clock[0].flight_rows
    if known == 0:
        begin_frame(tangents)
        state.begin_t = world.log[0].t
    for ball in range(known):
        tangents.current[0, ball] = ball
    impact = 0
    row = known
    while row < rows:
        count = _rows_of_event(world, tangents, row, rows)
        impact = _happen(world, tangents, row, count, impact, scratch)
        row += count
    for number in range(impact, world.clock[0].impact_rows):
        store_no_impact(tangents, number)
    if cause != RUNNING:
        for ball in range(world.settings[0].bodies):
            _carry(world, tangents, ball, end_t, end_t_low, scratch)
        orthogonalise(tangents)
    state.end_t = end_t


@kernel
def _rows_of_event(world: World, tangents: Tangents, first: int, rows: int) -> int:
    """Return the number of flights from row ``first`` on that start at the same event.

    They start at one instant, and no body occurs twice.
    """
    start = world.log[first]
    count = 1
    while first + count < rows:
        row = world.log[first + count]
        if row.t != start.t or row.t_low != start.t_low:
            return count
        for step in range(count):
            if not _are_of_one_event(world, tangents, world.log[first + step], row):
                return count
        count += 1
    return count


@kernel
def _are_of_one_event(world: World, tangents: Tangents, one: FlightRow, other: FlightRow) -> bool:
    """Return whether two flights that start at one instant start at the same event.

    By chance or symmetry, two bodies may reach two walls or two junctions at one instant.
    """
    if one.body == other.body:
        return False
    if one.cause == CROSSING and other.cause == CROSSING:
        before = world.log[tangents.current[0, one.body]]
        after = world.log[tangents.current[0, other.body]]
        together: bool = before.grouped * after.grouped == 1
        return together and before.group_first == after.group_first
    if one.cause == WALL and other.cause == WALL:
        return False
    if one.cause == WALL or one.cause == SEGMENT:
        return other.cause == WALL or other.cause == SEGMENT
    return one.cause == other.cause


@kernel
def _happen(
    world: World,
    tangents: Tangents,
    first: int,
    count: int,
    impact: int,
    scratch: Sequence[Flight],
) -> int:
    """Carry the tangent vectors across one event; return the row of the next impact."""
    ended = _arrive_all(world, tangents, first, count, scratch)
    for step in range(count):
        for column in range(len(tangents.frame)):
            tangents.delay[world.log[first + step].body, column] = 0.0
    begin = impact
    if world.log[first].cause == COLLISION:
        impact = _collide(world, tangents, first, count, impact)
    elif ended >= 0:
        _reach_end(world, tangents, first, count, ended)
        if world.log[tangents.current[0, ended]].cause == WALL:
            _rebound(world, tangents, ended)
    if ended >= 0 or impact > begin:
        for step in range(count):
            _change_force(world, tangents, first + step, scratch[0])
    _constrain(world, tangents, first, count)
    if impact > begin:
        _store_derivatives(world, tangents, begin, impact)
    return impact


@kernel
def _arrive_all(
    world: World, tangents: Tangents, first: int, count: int, scratch: Sequence[Flight]
) -> int:
    """Carry the bodies of an event to it; return the body at an end of its piece, or -1."""
    ended = -1
    for step in range(count):
        row = world.log[first + step]
        if row.cause != START:
            before = world.log[tangents.current[0, row.body]]
            tangents.current[1, row.body] = before.group_first if before.grouped == 1 else row.body
            age = _carry(world, tangents, row.body, row.t, row.t_low, scratch)
            track = track_on(world, row.body, before.piece)
            tangents.arriving[row.body, 0] = track.speed_factor * row.before_p
            tangents.arriving[row.body, 1] = acceleration_at(
                scratch[0], track.path_radius, age, row.before_s, row.before_c
            )
            passed = row.piece != before.piece or count == 1
            if row.cause == WALL or (row.cause == CROSSING and passed):
                ended = row.body
        tangents.current[0, row.body] = first + step
    return ended


@kernel
def _carry(
    world: World, tangents: Tangents, ball: int, t: float, t_low: float, scratch: Sequence[Flight]
) -> float:
    """Carry the tangent vectors of a body to an instant of its flight, which is replayed.

    Return the time (s) since the start of the flight.
    """
    number = tangents.current[0, ball]
    row = world.log[number]
    flight = scratch[0]
    age = time_between(t, t_low, row.t, row.t_low)
    replay_flight(world, row, number, flight)
    if age > 0.0 and not leans(world, row):
        if row.at_rest == 1 and curvature_jump(world, ball, row.piece, row.s, row.c) != 0.0:
            tangents.state[0].rough = 1  # a body beside the junction stays on its side
        one, two, three, four = flight_jacobian(flight, age, tangents.series)
        carry_far(tangents, ball, one, two, three, four)
    return age


@kernel
def leans(world: World, row: FlightRow) -> bool:
    """Return whether a body is held at rest by a wall, or rests in a group, not in equilibrium."""
    if row.at_rest == 0 or row.grouped == 1:
        return row.at_rest == 1
    track = track_on(world, row.body, row.piece)
    if track.path_radius == 0.0:
        return track.line_acceleration + track.line_growth * track.line_growth * row.s != 0.0
    return torque(track.tilt, track.spread, row.s, row.c) != 0.0


@kernel
def _reach_end(world: World, tangents: Tangents, first: int, count: int, ball: int) -> None:
    """Set the derivative of the time at which a body and its group reach an end of its piece."""
    speed = tangents.arriving[ball, 0]
    if speed == 0.0:
        if count > 1 or world.log[first].cause == WALL:  # alone, nothing jumps at a junction
            tangents.state[0].rough = 1
        return
    for column in range(len(tangents.frame)):
        delay = -tangents.frame[2 * ball, column] / speed
        for step in range(count):
            tangents.delay[world.log[first + step].body, column] = delay


@kernel
def _rebound(world: World, tangents: Tangents, ball: int) -> None:
    """Carry the tangent vectors of a body across its impact on a wall."""
    settings = world.settings[0]
    tau = tangents.state[0].time_scale
    speed = tangents.arriving[ball, 0]
    pull = tangents.arriving[ball, 1]
    restitution = settings.right_wall if speed > 0.0 else settings.left_wall
    if restitution == 0.0:
        tangents.state[0].lost = 1
    for column in range(len(tangents.frame)):
        delay = tangents.delay[ball, column]
        way = tangents.frame[2 * ball, column]
        rate = tangents.frame[2 * ball + 1, column]
        # A body that does not bounce starts exactly at the wall, whatever rounding leaves.
        moved = way + (1.0 + restitution) * speed * delay
        tangents.frame[2 * ball, column] = 0.0 if restitution == 0.0 else moved
        tangents.frame[2 * ball + 1, column] = (
            -restitution * rate - (1.0 + restitution) * pull * tau * delay
        )


@kernel
def _change_force(world: World, tangents: Tangents, number: int, flight: Flight) -> None:
    """Apply the jump of the acceleration at the start of a flight to the tangent vectors."""
    row = world.log[number]
    track = track_on(world, row.body, row.piece)
    replay_flight(world, row, number, flight)
    pull = acceleration_at(flight, track.path_radius, 0.0, row.s, row.c)
    change_force(tangents, row.body, pull - tangents.arriving[row.body, 1], row.body)


@kernel
def _collide(world: World, tangents: Tangents, first: int, count: int, impact: int) -> int:
    """Carry the tangent vectors across the impacts of an event; return the row of the next one."""
    while impact < world.clock[0].impact_rows and _belongs(world, tangents, first, count, impact):
        length = 1
        while _is_simultaneous(world, impact + length - 1) and length < count - 1:
            length += 1
        for step in range(length):
            row = world.impacts[impact + step]
            if row.normal_a * row.speed_a_pre == row.normal_b * row.speed_b_pre:
                tangents.state[0].rough = 1
                return impact + length
        strike(world, tangents, impact, length)
        impact += length
    return impact


@kernel
def _belongs(world: World, tangents: Tangents, first: int, count: int, impact: int) -> bool:
    """Return whether an impact belongs to an event, by its time and the bodies' arrival speeds."""
    row = world.impacts[impact]
    start = world.log[first]
    if row.t != start.t or row.t_low != start.t_low:
        return False
    found = 0
    for step in range(count):
        ball = world.log[first + step].body
        if ball == row.a and tangents.arriving[ball, 0] == row.speed_a_pre:
            found += 1
        if ball == row.b and tangents.arriving[ball, 0] == row.speed_b_pre:
            found += 1
    return found == 2


@kernel
def _is_simultaneous(world: World, impact: int) -> bool:
    """Return whether an impact and the next one were solved jointly, judging by a common body."""
    if impact + 1 >= world.clock[0].impact_rows:
        return False
    row = world.impacts[impact]
    after = world.impacts[impact + 1]
    if row.t != after.t or row.t_low != after.t_low or row.b != after.a:
        return False
    return row.speed_b_pre == after.speed_a_pre and row.speed_b_post == after.speed_a_post


@kernel
def _constrain(world: World, tangents: Tangents, first: int, count: int) -> None:
    """Project the tangent vectors onto lasting contact: gaps and their rates vanish."""
    step = 0
    while step < count:
        row = world.log[first + step]
        members = 1
        if row.grouped == 1:
            members = row.group_count
        if leans(world, row):
            tangents.state[0].lost = 1
            for column in range(len(tangents.frame)):
                tangents.frame[2 * row.body, column] = 0.0
                tangents.frame[2 * row.body + 1, column] = 0.0
            members = 1
        elif members > 1:
            _unite(world, tangents, row)
        step += members


@kernel
def _unite(world: World, tangents: Tangents, row: FlightRow) -> None:
    """Project the tangent vectors onto the common motion of a group, conserving its momentum."""
    tangents.state[0].lost = 1
    by_mass = balances_mass(world.settings[0].law) and _acts_along_centres(world, tangents, row)
    closes = by_mass and row.cause == CONTACT_CLOSED
    drift = tangents.state[0].time_scale * _drift(world, tangents, row) if closes else 0.0
    pressed = _closing_pair(world, tangents, row) if closes else 0
    for column in range(len(tangents.frame)):
        later = _delay_of_contact(world, tangents, row, pressed, column) if closes else 0.0
        way, inertia = _momentum(world, tangents, row, column, 0, by_mass)
        rate, _ = _momentum(world, tangents, row, column, 1, by_mass)
        ratio = 1.0
        for step in range(row.group_count):
            ball = number_along(world, row.group_first, step)
            if step > 0:
                ratio *= _ratio(world, tangents, ball)
            tangents.frame[2 * ball, column] = ratio * way / inertia
            tangents.frame[2 * ball + 1, column] = ratio * rate / inertia + ratio * later * drift


@kernel
def _momentum(
    world: World, tangents: Tangents, row: FlightRow, column: int, part: int, by_mass: bool
) -> tuple[float, float]:
    """Return the momentum of a group's displacements or rates in a tangent vector, and its inertia.

    The inertia is the momentum for a displacement or rate of 1 of the first body.
    """
    ratio = 1.0
    momentum = 0.0
    inertia = 0.0
    for step in range(row.group_count):
        ball = number_along(world, row.group_first, step)
        if step > 0:
            ratio *= _ratio(world, tangents, ball)
        body = world.bodies[ball]
        weight = (body.mass if by_mass else body.rolling_mass) * ratio
        momentum += weight * tangents.frame[2 * ball + part, column]
        inertia += weight * ratio
    return momentum, inertia


@kernel
def _acts_along_centres(world: World, tangents: Tangents, row: FlightRow) -> bool:
    """Return whether all bodies of a group in contact have equal speeds, up to rounding."""
    for step in range(1, row.group_count):
        ball = number_along(world, row.group_first, step)
        if abs(_ratio(world, tangents, ball) - 1.0) > SAME_NORMALS:
            return False
    return True


@kernel
def _drift(world: World, tangents: Tangents, row: FlightRow) -> float:
    """Return the mean acceleration (m/s^2) of bodies coming into contact, less their common one.

    ``translational`` conserves ``sum m v`` in bounces, lasting contact ``sum kappa m v``.
    """
    momentum = 0.0
    mass = 0.0
    rolling_momentum = 0.0
    rolling = 0.0
    for step in range(row.group_count):
        ball = number_along(world, row.group_first, step)
        body = world.bodies[ball]
        momentum += body.mass * tangents.arriving[ball, 1]
        mass += body.mass
        rolling_momentum += body.rolling_mass * tangents.arriving[ball, 1]
        rolling += body.rolling_mass
    return momentum / mass - rolling_momentum / rolling


@kernel
def _closing_pair(world: World, tangents: Tangents, row: FlightRow) -> int:
    """Return the left body of the pair of a group that is pressed together most.

    Bodies that were in contact before arrive with equal accelerations, so they are not chosen.
    """
    closing = row.group_first
    most = 0.0
    for step in range(1, row.group_count):
        ball = number_along(world, row.group_first, step)
        c = tangents.arriving[number_along(world, ball, -1), 1] - tangents.arriving[ball, 1]
        if c > most:
            most = c
            closing = number_along(world, ball, -1)
    return closing


@kernel
def _delay_of_contact(
    world: World, tangents: Tangents, row: FlightRow, a: int, column: int
) -> float:
    """Return the delay (s) of the contact of body ``a`` and its right neighbour.

    The contact begins ``2 u/(c (1 - k))`` after a bounce with separation speed ``u`` and approach
    acceleration ``c``. The change ``r`` of u at a fixed time is that at the bounce plus ``c dt``,
    where ``dt`` is the bounce's delay: the gap changes by ``-u dt``. After a plastic
    impact there are no bounces, and r is ``c dt`` alone. The solver adds no time of bounces for
    bodies that are in contact with others.
    """
    tau = tangents.state[0].time_scale
    b = number_along(world, a, 1)
    speed_a = tangents.arriving[a, 0]
    speed_b = tangents.arriving[b, 0]
    c: float = tangents.arriving[a, 1] - tangents.arriving[b, 1]
    if c <= 0.0:
        return 0.0
    way: float = tangents.frame[2 * b, column] - tangents.frame[2 * a, column]
    rate: float = (tangents.frame[2 * b + 1, column] - tangents.frame[2 * a + 1, column]) / tau
    k: float = world.pairs[a].restitution
    u: float = speed_b - speed_a
    if k == 0.0 or u <= LEAST_PARTING * (abs(speed_a) + abs(speed_b)):
        return rate / c
    delay: float = -way / u
    if row.group_count > 2:
        return delay
    return delay + 2.0 * (rate - c * delay) / (c * (1.0 - k))


@kernel
def _ratio(world: World, tangents: Tangents, b: int) -> float:
    """Return the ratio of a body's speed to that of its left neighbour in lasting contact."""
    a = number_along(world, b, -1)
    one = world.log[tangents.current[0, a]]
    other = world.log[tangents.current[0, b]]
    track_a = track_on(world, a, one.piece)
    track_b = track_on(world, b, other.piece)
    if one.piece == other.piece:
        return track_b.path_radius / track_a.path_radius if track_a.path_radius > 0.0 else 1.0
    ax, ay = centre_position(world.pieces[one.piece], track_a, one.s, one.c)
    bx, by = centre_position(world.pieces[other.piece], track_b, other.s, other.c)
    tax, tay = centre_tangent(world.pieces[one.piece], one.s, one.c)
    tbx, tby = centre_tangent(world.pieces[other.piece], other.s, other.c)
    along_b = (bx - ax) * tbx + (by - ay) * tby
    return ((bx - ax) * tax + (by - ay) * tay) / along_b


@kernel
def _store_derivatives(world: World, tangents: Tangents, begin: int, end: int) -> None:
    """Fill in the derivatives of time, the growth and the smoothness at the impacts of an event."""
    if len(tangents.times) > begin:
        for column in range(len(tangents.frame)):
            for impact in range(begin, end):
                ball = world.impacts[impact].a
                value = from_start(tangents, tangents.delay, ball, column)
                tangents.times[impact, column] = scaled_back(tangents, value)
    store_growth(tangents, begin, end - begin)
    for impact in range(begin, end):
        row = world.impacts[impact]
        store_amplification(tangents, impact, row.a, row.b, 2)
        fine = end == begin + 1 and row.simultaneous == 0 and row.contact == 0
        fine = fine and not (has_kink(world, row, 0) or has_kink(world, row, 1))
        store_smooth(tangents, impact, 1, fine)
        if row.simultaneous == 1:
            spoil(tangents, world.impacts, impact, row.t, row.t_low)
    tangents.state[0].rough = 0
