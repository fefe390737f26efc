"""The tangent map of a run of bodies on springs: along the Taylor series, and across events.

A change d of a position obeys ``d'' = g d``, ``g = -w^2 (1 - l h)``, ``h = b^2/s^3``. Here g is the
derivative of the acceleration, and h that of y = x/s; h follows from ``s h = 1 - y^2`` and the
series of s and y. Bodies in lasting contact move as one; each adds its share ``M_i/M`` of g. While
the position stays within R < s of that at the start of the step, the length stays above s - R, and
|g| below ``w^2 (1 + l b^2/(s - R)^3)``: the series of d hold for the same step as those of the
positions.

The state has the position and the speed of each body's centre. Between events the motion is
computed again together with the tangent vectors, with as many terms of the series as these need
(see `_expand`). Where a gap g closes, ``dx^+ = dx^- + (v^- - v^+) dt`` and ``dv^+ = dv^- -
(a^+ - a^-) dt + (change of v^+ - v^-)``, ``dt = -dg/g'``. The acceleration a jumps if bodies come
into lasting contact, or out of it by an impact. The impulses are those of `impacts`; their changes
solve one linear system with the same matrix. Where contact begins, changes are projected onto the
common motion.
"""

from __future__ import annotations

from vibro_cli.compile.kernel import FloatMatrix, kernel
from vibro_cli.kernels.impact.laws import balances_mass, inclination, weight_and_response
from vibro_cli.kernels.numerics.double_double import add_to_time, time_between
from vibro_cli.kernels.numerics.tridiagonal import solve_from_both_ends
from vibro_cli.kernels.springs.impacts import approach_by_law, common_acceleration, set_chain_row
from vibro_cli.kernels.springs.series import (
    begin_group,
    extend_group,
    group_size,
    keep_energy,
    mass_of_group,
    move_body,
    restore,
    step_of_all,
    unit_of,
)
from vibro_cli.kernels.springs.world import (
    BODY_ROWS,
    LENGTH,
    ORDER,
    PLACE,
    RATIO,
    ImpactRow,
    World,
)
from vibro_cli.kernels.tangent.frame import (
    Tangents,
    begin_frame,
    carry_vectors,
    change_force,
    orthogonalise,
    spoil,
    store_amplification,
    store_growth,
    store_no_impact,
    store_smooth,
)
from vibro_cli.kernels.world import RUNNING

# Terms below this are left out of a step: those of changes, and of a position over b.
REST = 1.0e-18
# Rows of the scratch: g of a group, d for an initial displacement or speed of 1, h of each body.
_SLOPE, _WAY, _SPEED, _STEEPNESS = 0, 1, 2, 3


@kernel
def carry_on(world: World, tangents: Tangents, left: float) -> float:
    """Carry bodies and tangent vectors on by one step, at most ``left`` (s), and return it."""
    bodies = len(world.bodies)
    step = min(left, step_of_all(world))
    unit = unit_of(step)
    rate = 1.0 / unit
    time = step * rate
    first = 0
    while first < bodies:
        count = group_size(world, first)
        begin_group(world, first, count, unit)
        last = _expand(world, tangents.series, first, count, time, unit)
        one, three = _at(tangents.series, _WAY, last, time)
        two, four = _at(tangents.series, _SPEED, last, time)
        for body in range(first, first + count):
            carry_vectors(tangents, body, one, two * unit, three * rate, four)
            move_body(world, body, last, time, rate)
        keep_energy(world, first, count)
        first += count
    return step


@kernel
def _expand(
    world: World, series: FloatMatrix, first: int, count: int, time: float, unit: float
) -> int:
    """Set the series of a group and of changes; return the power of the last terms needed.

    ``time`` is the step in units of time (``unit`` s each), and a speed of 1 means 1 m per unit.
    Two successive terms must be small, since every second one vanishes if a body is at rest. The
    first does not count: at the foot of a spring that is unstressed there, the first two vanish.
    """
    mass = mass_of_group(world, first, count)
    place = first * BODY_ROWS + PLACE
    height = world.springs[first].height
    series[_WAY, 0] = 1.0
    series[_WAY, 1] = 0.0
    series[_SPEED, 0] = 0.0
    series[_SPEED, 1] = 1.0
    power = 1.0
    small = 0
    for k in range(ORDER - 1):
        extend_group(world, first, count, k, unit)
        slope = 0.0
        for body in range(first, first + count):
            share = world.bodies[body].rolling_mass / mass
            slope += share * _next_slope(world, series, body, k)
        series[_SLOPE, k] = slope
        way, speed = _next_changes(series, k, unit)
        power *= time
        size = abs(way) * time + abs(speed) + abs(world.series[place + k + 2]) * time / height
        small = small + 1 if k > 0 and size * power < REST else 0
        if small == 2:
            return k + 2
    return ORDER


@kernel
def _next_slope(world: World, series: FloatMatrix, body: int, k: int) -> float:
    """Return the k-th coefficient of g of a single body; set that of h."""
    spring = world.springs[body]
    length = body * BODY_ROWS + LENGTH
    ratio = body * BODY_ROWS + RATIO
    row = _STEEPNESS + body
    inverse = 1.0 / world.series[length]
    if k == 0:
        cosine = spring.height * inverse
        steepness: float = cosine * cosine * inverse
        series[row, 0] = steepness
        return spring.square * (spring.length * steepness - 1.0)
    total = 0.0
    for i in range(k - 1, 0, -1):
        square = world.series[ratio + i] * world.series[ratio + k - i]
        total += world.series[length + i] * series[row, k - i] + square
    square = 2.0 * world.series[ratio] * world.series[ratio + k]
    total += world.series[length + k] * series[row, 0] + square
    steepness = -total * inverse
    series[row, k] = steepness
    return spring.square * spring.length * steepness


@kernel
def _next_changes(series: FloatMatrix, k: int, unit: float) -> tuple[float, float]:
    """Set and return coefficient k + 2 of the changes for an initial displacement and speed."""
    way = 0.0
    speed = 0.0
    for i in range(k + 1):
        way += series[_SLOPE, i] * series[_WAY, k - i]
        speed += series[_SLOPE, i] * series[_SPEED, k - i]
    divided = 1.0 / ((k + 1) * (k + 2)) * (unit * unit)
    way *= divided
    speed *= divided
    series[_WAY, k + 2] = way
    series[_SPEED, k + 2] = speed
    return way, speed


@kernel
def _at(series: FloatMatrix, row: int, last: int, time: float) -> tuple[float, float]:
    """Return the value and derivative of a series (Horner's scheme)."""
    value = 0.0
    slope = 0.0
    for k in range(last, -1, -1):
        slope = slope * time + value
        value = value * time + series[row, k]
    return value, slope


NUMBERS = 2  # of the state of a body: its position, tau times its speed

# Columns of the scratch row of a pair: its impulse, and the delay of its impact.
_IMPULSE, _DELAY = 0, 1
# Columns of the scratch row of a body: its acceleration before and after an event.
_BEFORE, _AFTER = 0, 1

# Number of steps of a flight after which the frame is made orthonormal again: while a body lingers
# near a saddle, tangent vectors grow so much that they would become parallel.
STEPS = 8


@kernel
def follow_bodies(
    world: World, known: int, cause: int, end_t: float, end_t_low: float, tangents: Tangents
) -> None:
    """Carry tangent vectors through a part of a run.

    The arguments are those of `kernels.tangent.follow.follow_tangents`, except that ``known`` is 0
    or 1. The bodies are in their state after the last event before the part.
    """
    clock = world.clock[0]
    if known == 0:
        begin_frame(tangents)
    impact = 0
    first = 0
    for row in range(0, clock.state_rows, len(world.bodies)):
        if world.states[row].t != clock.t or world.states[row].t_low != clock.t_low:
            first = _end_instant(tangents, first, impact)
        count = world.states[row].event - clock.collisions
        clock.collisions = world.states[row].event
        _happen(world, tangents, row, impact, count)
        impact += count
    for number in range(impact, clock.impact_rows):
        store_no_impact(tangents, number)
    _end_instant(tangents, first, clock.impact_rows)
    if cause != RUNNING:
        _carry(world, tangents, end_t, end_t_low)
        orthogonalise(tangents)
    tangents.state[0].end_t = end_t


@kernel
def _end_instant(tangents: Tangents, first: int, impact: int) -> int:
    """Fill in the growth at the impacts of an instant that is over; return the next impact.

    This orthogonalises the frame, which must not happen sooner: all delays of one instant refer to
    the same vectors.
    """
    if impact > first:
        store_growth(tangents, first, impact - first)
    return impact


@kernel
def _happen(world: World, tangents: Tangents, row: int, impact: int, count: int) -> None:
    """Carry the tangent vectors across one event with ``count`` impacts, perhaps none."""
    _carry(world, tangents, world.states[row].t, world.states[row].t_low)
    _note_accelerations(world, tangents, _BEFORE)
    if count > 0:
        _strike(world, tangents, impact, count)
    closed = _closes(world, row)
    restore(world, row, 1.0)
    _note_accelerations(world, tangents, _AFTER)
    for body in range(len(world.bodies)):
        jump = tangents.arriving[body, _AFTER] - tangents.arriving[body, _BEFORE]
        change_force(tangents, body, jump, 0)
    if closed:
        tangents.state[0].lost = 1
        _unite_groups(world, tangents)
    if count > 0:
        _judge(world, tangents, impact, count, closed)
    elif closed:
        tangents.state[0].rough = 1
        spoil(tangents, world.impacts, impact, world.clock[0].t, world.clock[0].t_low)
    for number in range(impact, impact + count):
        pair = world.impacts[number].pair
        store_amplification(tangents, number, pair, pair + 1, NUMBERS)


@kernel
def _judge(world: World, tangents: Tangents, impact: int, count: int, closed: bool) -> None:
    """Fill in whether the motion is differentiable at the impacts of an event."""
    row = world.impacts[impact]
    fine = count == 1 and row.simultaneous == 0 and row.grazing == 0
    if closed:
        # Contact must begin by an impact at k = 0, not by a sum of bounces.
        lawful = row.law == world.settings[0].law or row.substituted == 1
        fine = fine and lawful and world.pairs[row.pair].restitution == 0.0
    if row.simultaneous == 1:
        spoil(tangents, world.impacts, impact, row.t, row.t_low)
    store_smooth(tangents, impact, count, fine)
    tangents.state[0].rough = 0


@kernel
def _carry(world: World, tangents: Tangents, t: float, t_low: float) -> None:
    """Move all bodies and tangent vectors on to an instant, with the steps of the solver.

    At a new instant there are no delays yet, and no body has been struck.
    """
    clock = world.clock[0]
    left = time_between(t, t_low, clock.t, clock.t_low)
    if left > 0.0:
        for column in range(len(tangents.frame)):
            tangents.delay[0, column] = 0.0
        for body in range(len(world.bodies)):
            tangents.current[0, body] = 0
    steps = 0
    while left > 0.0:
        steps += 1
        if steps % STEPS == 0:
            orthogonalise(tangents)
        step = carry_on(world, tangents, left)
        clock.t, clock.t_low = add_to_time(clock.t, clock.t_low, step)
        left = 0.0 if step == left else time_between(t, t_low, clock.t, clock.t_low)
    clock.t = t
    clock.t_low = t_low


@kernel
def _note_accelerations(world: World, tangents: Tangents, when: int) -> None:
    """Store the accelerations of all bodies before or after an event."""
    first = 0
    while first < len(world.bodies):
        count = group_size(world, first)
        common = common_acceleration(world, first, count)
        for body in range(first, first + count):
            tangents.arriving[body, when] = common
        first += count


@kernel
def _closes(world: World, row: int) -> bool:
    """Return whether lasting contact of a pair begins, or begins again, at an event."""
    for body in range(len(world.bodies) - 1):
        if world.states[row + body].held == 1 and world.pairs[body].held == 0:
            return True
    return False


@kernel
def _strike(world: World, tangents: Tangents, begin: int, count: int) -> None:
    """Carry the tangent vectors across impacts of neighbouring pairs, solved jointly."""
    first = world.impacts[begin].pair
    pairs = len(world.bodies) - 1
    for number in range(count):
        row = world.impacts[begin + number]
        more = 1.0 + row.restitution
        if more == 1.0:
            tangents.state[0].lost = 1
        set_chain_row(world, row.pair, row.law, first, count)
        approach = approach_by_law(world, row.pair, row.law, row.v_a_pre, row.v_b_pre)
        world.pairs[row.pair].right = more * approach
    solve_from_both_ends(world.pairs, pairs, first, count)
    for number in range(count):
        tangents.turning[number, _IMPULSE] = world.pairs[first + number].solution
    for column in range(len(tangents.frame)):
        for number in range(count):
            row = world.impacts[begin + number]
            more = 1.0 + row.restitution
            delay = _delay(tangents, row, column)
            tangents.turning[number, _DELAY] = delay
            set_chain_row(world, row.pair, row.law, first, count)
            change = _approach_change(world, tangents, row, column, delay)
            world.pairs[row.pair].right = more * change
        solve_from_both_ends(world.pairs, pairs, first, count)
        for number in range(count):
            _apply(world, tangents, world.impacts[begin + number], number, column)
        tangents.delay[0, column] = tangents.turning[0, _DELAY]
    for body in range(first, first + count + 1):
        tangents.current[0, body] = 1


@kernel
def _delay(tangents: Tangents, row: ImpactRow, column: int) -> float:
    """Return the delay (s) of an impact for one tangent vector.

    A pair that collides because one of its bodies was struck at this instant has the delay of that
    impact, since its own speed of approach may be only rounding.
    """
    if tangents.current[0, row.pair] + tangents.current[0, row.pair + 1] > 0:
        late: float = tangents.delay[0, column]
        return late
    a = 2 * row.pair
    gap: float = tangents.frame[a + 2, column] - tangents.frame[a, column]
    return gap / (row.v_a_pre - row.v_b_pre)


@kernel
def _approach_change(
    world: World, tangents: Tangents, row: ImpactRow, column: int, delay: float
) -> float:
    """Return the change of the law's relative speed before an impact for one tangent vector."""
    tau = tangents.state[0].time_scale
    a = row.pair
    b = a + 1
    c = inclination(world.bodies[a], world.bodies[b])
    qa, _ = weight_and_response(row.law, world.bodies[a], c)
    qb, _ = weight_and_response(row.law, world.bodies[b], c)
    speed_a = tangents.frame[2 * a + 1, column] / tau + tangents.arriving[a, _BEFORE] * delay
    speed_b = tangents.frame[2 * b + 1, column] / tau + tangents.arriving[b, _BEFORE] * delay
    change: float = qa * speed_a - qb * speed_b
    return change


@kernel
def _apply(world: World, tangents: Tangents, row: ImpactRow, number: int, column: int) -> None:
    """Apply a pair's impulse and delay to the positions and speeds of one tangent vector."""
    tau = tangents.state[0].time_scale
    one = world.bodies[row.pair]
    other = world.bodies[row.pair + 1]
    c = inclination(one, other)
    way = tangents.turning[number, _IMPULSE] * tangents.turning[number, _DELAY]
    rate = tau * world.pairs[row.pair].solution
    a = 2 * row.pair
    _, ha = weight_and_response(row.law, one, c)
    _, hb = weight_and_response(row.law, other, c)
    tangents.frame[a, column] += ha * way
    tangents.frame[a + 1, column] -= ha * rate
    tangents.frame[a + 2, column] -= hb * way
    tangents.frame[a + 3, column] += hb * rate


@kernel
def _unite_groups(world: World, tangents: Tangents) -> None:
    """Project the tangent vectors onto the common motion of groups, at the law's momentum."""
    first = 0
    while first < len(world.bodies):
        count = group_size(world, first)
        if count > 1:
            for column in range(len(tangents.frame)):
                _unite(world, tangents, first, count, column)
        first += count


@kernel
def _unite(world: World, tangents: Tangents, first: int, count: int, column: int) -> None:
    for part in range(2):
        momentum = 0.0
        total = 0.0
        for body in range(first, first + count):
            mass = world.bodies[body].rolling_mass
            if balances_mass(world.settings[0].law):
                mass = world.bodies[body].mass
            momentum += mass * tangents.frame[2 * body + part, column]
            total += mass
        for body in range(first, first + count):
            tangents.frame[2 * body + part, column] = momentum / total
