"""Taylor series of the bodies' positions: their step, the motion between events, the log.

``x'' = -w^2 (x - l x/s)``, ``s = sqrt(b^2 + x^2)`` (C (4)), by recurrence: the coefficients of s
follow from those of x^2, and those of y = x/s from x = s y. Bodies in lasting contact move as one;
each adds its share ``M_i/M`` of the acceleration.

The step: for complex positions within R of the present one, R < s, the length stays above s - R.
The acceleration stays below ``w^2 (|x| + R)(1 + l/(s - R))``, and its derivative dx''/dx (see
`tangent`) below ``w^2 (1 + l b^2/(s - R)^3)``, so that the acceleration also stays below its
present value plus R times this. Let A be the lower of the two bounds. For complex times up to T,
``|v| T + A T^2/2 = R``, the position stays within R, and by Cauchy's estimate the coefficients of
its series are at most ``R/T^k``: the remainder of a step ``h = q T`` is below
``R q^(N+1)/(1 - q)``.

The series are in powers of time, in a unit that is the second; for a step so short or long that its
24th power would leave the range of doubles, it is a power of two near the step. No bit of the
motion depends on the unit.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from vibro_cli.compile.kernel import kernel, struct
from vibro_cli.kernels.numerics.conservative_advancement import value_of
from vibro_cli.kernels.numerics.constants import NEVER
from vibro_cli.kernels.numerics.double_double import add_to_time
from vibro_cli.kernels.springs.world import (
    BODY_ROWS,
    FORCE,
    LENGTH,
    ORDER,
    PARTING,
    PLACE,
    RATIO,
    SpringBody,
    World,
)

# q: the remainder is 0.2^25 0.5 = 1.7e-18 of the spring's length.
STEP = 0.2
# R as a share of s.
REACH = 0.5
# Series with steps (s) between these are in seconds.
LEAST_IN_SECONDS = 1.0e-6
MOST_IN_SECONDS = 1.0e6
# A tenth of the greatest displacement in a step, q R, as a share of s.
MOST_CHANGE = 0.1 * STEP * REACH
# A body is near the separatrix if its energy differs by less than this share from the saddle's.
# Farther off, the energy has as many digits measured from the centres.
NEAR = 0.5


@kernel
def group_size(world: World, first: int) -> int:
    """Return the number of bodies that move as one, of which ``first`` is the leftmost."""
    count = 1
    while first + count < len(world.bodies) and world.pairs[first + count - 1].held == 1:
        count += 1
    return count


@kernel
def mass_of_group(world: World, first: int, count: int) -> float:
    """Return the rolling mass (kg) of a group."""
    mass = 0.0
    for body in range(first, first + count):
        mass += world.bodies[body].rolling_mass
    return mass


@kernel
def expand(world: World) -> tuple[float, float]:
    """Set the series of all bodies at the present instant.

    Return the step (s) for which they hold, and their unit of time (s).
    """
    step = step_of_all(world)
    unit = unit_of(step)
    first = 0
    while first < len(world.bodies):
        count = group_size(world, first)
        expand_group(world, first, count, unit)
        first += count
    return step, unit


@kernel
def step_of_all(world: World) -> float:
    """Return the step (s) for which the series of all bodies hold."""
    step = NEVER
    first = 0
    while first < len(world.bodies):
        count = group_size(world, first)
        step = min(step, step_of_group(world, first, count))
        first += count
    return step


@kernel
def expand_group(world: World, first: int, count: int, unit: float) -> None:
    """Set the series of bodies that move as one, in a unit of time (s)."""
    begin_group(world, first, count, unit)
    for k in range(ORDER - 1):
        extend_group(world, first, count, k, unit)


@kernel
def unit_of(step: float) -> float:
    """Return the unit of time (s) of series for a step (s)."""
    if LEAST_IN_SECONDS < step < MOST_IN_SECONDS:
        return 1.0
    return math.pow(2.0, math.floor(math.log2(step)))


@kernel
def begin_group(world: World, first: int, count: int, unit: float) -> None:
    """Set the first two terms of the series of a group, in a unit of time (s)."""
    for body in range(first, first + count):
        place = body * BODY_ROWS + PLACE
        world.series[place] = world.springs[body].x
        world.series[place + 1] = world.springs[first].v * unit


@kernel
def extend_group(world: World, first: int, count: int, k: int, unit: float) -> None:
    """Set coefficient k of the accelerations of a group, and from it k + 2 of its positions."""
    if count == 1:
        common = _next_force(world, first, k)
    else:
        common = 0.0
        for body in range(first, first + count):
            common += world.bodies[body].rolling_mass * _next_force(world, body, k)
        common /= mass_of_group(world, first, count)
    divided = 1.0 / ((k + 1) * (k + 2)) * (unit * unit)
    for body in range(first, first + count):
        world.series[body * BODY_ROWS + PLACE + k + 2] = common * divided


@kernel
def step_of_group(world: World, first: int, count: int) -> float:
    """Return the step (s) for which the series of a group hold: q T."""
    reach, acceleration = bounds_of_group(world, first, count)
    speed = abs(world.springs[first].v)
    radius = 2.0 * reach / (speed + math.sqrt(speed * speed + 2.0 * acceleration * reach))
    return STEP * radius


@kernel
def bounds_of_group(world: World, first: int, count: int) -> tuple[float, float]:
    """Return R (m) and A (m/s^2) of a group.

    A/R bounds the change of acceleration per displacement.
    """
    reach = NEVER
    acceleration = 0.0
    for body in range(first, first + count):
        spring = world.springs[body]
        length = math.sqrt(square_of_length(spring))
        reach = min(reach, REACH * length)
    for body in range(first, first + count):
        spring = world.springs[body]
        length = math.sqrt(square_of_length(spring))
        shortest = length - reach
        direct = (abs(spring.x) + reach) * (1.0 + spring.length / shortest)
        ratio = spring.height / shortest
        slope = 1.0 + spring.length / spring.height * ratio * ratio * ratio
        along = abs(spring.x / length * (length - spring.length)) + reach * slope
        acceleration = max(acceleration, spring.square * min(direct, along))
    return reach, acceleration


@kernel
def _next_force(world: World, body: int, k: int) -> float:
    """Set and return the k-th coefficient of the free acceleration of a body, m/s^2.

    The latest coefficients come last in the sums, so that the other terms need not wait for them.
    """
    rows = world.series
    spring = world.springs[body]
    base = body * BODY_ROWS
    place, length, ratio = base + PLACE, base + LENGTH, base + RATIO
    if k == 0:
        x = rows[place]
        start = math.sqrt(spring.height * spring.height + x * x)
        rows[length] = start
        rows[ratio] = x / start
        # Avoids cancellation if the spring is nearly unstressed.
        force = -spring.square * rows[ratio] * (start - spring.length)
    else:
        inverse = 1.0 / rows[length]
        half = 0.0
        for i in range((k - 1) // 2, 0, -1):
            square = rows[place + i] * rows[place + k - i]
            half += square - rows[length + i] * rows[length + k - i]
        if k % 2 == 0:
            x = rows[place + k // 2]
            s = rows[length + k // 2]
            half += 0.5 * (x * x - s * s)
        rows[length + k] = (half + rows[place] * rows[place + k]) * inverse
        product = 0.0
        for i in range(k - 1, 0, -1):
            product += rows[length + i] * rows[ratio + k - i]
        rest = rows[place + k] - product - rows[length + k] * rows[ratio]
        rows[ratio + k] = rest * inverse
        force = -spring.square * (rows[place + k] - spring.length * rows[ratio + k])
    rows[base + FORCE + k] = force
    return force


@kernel
def move_body(world: World, body: int, last: int, time: float, rate: float) -> None:
    """Move a body on by a time in units, by its series up to the power ``last``.

    ``rate`` is the number of units in a second.
    """
    rows = world.series
    base = body * BODY_ROWS + PLACE
    spring = world.springs[body]
    speed = 0.0
    for k in range(last, 0, -1):
        speed = speed * time + k * rows[base + k]
    spring.v = speed * rate
    # Sum the displacement separately from the position, so that a short step does not lose it.
    spring.x = rows[base] + time * value_of(rows, base + 1, base + last, time)


@kernel
def acceleration_of(spring: SpringBody) -> float:
    """Return the free acceleration (m/s^2) of a body at the present instant."""
    length = math.sqrt(square_of_length(spring))
    return -spring.square * spring.x / length * (length - spring.length)


@kernel
def square_of_length(spring: SpringBody) -> float:
    """Return the square of the length of a body's spring, m^2."""
    return spring.height * spring.height + spring.x * spring.x


@kernel
def energy_of(spring: SpringBody) -> float:
    """Return the energy of a body over its rolling mass, m^2/s^2: v^2/2 + w^2 (s - l)^2/2."""
    length = math.sqrt(square_of_length(spring))
    stretch = length - spring.length
    return 0.5 * (spring.v * spring.v + spring.square * stretch * stretch)


@kernel
def energy_of_group(world: World, first: int, count: int) -> float:
    """Return the energy of a group over its rolling mass, m^2/s^2."""
    if count == 1:
        return energy_of(world.springs[first])
    total = 0.0
    for body in range(first, first + count):
        total += world.bodies[body].rolling_mass * energy_of(world.springs[body])
    return total / mass_of_group(world, first, count)


@kernel
def keep_energy(world: World, first: int, count: int) -> None:
    """Project position and speed of a group onto its energy, by the shortest way in (w x, v)."""
    spring = world.springs[first]
    if spring.root < NEVER:
        _keep_energy_above_saddle(world, first)
        return
    surplus = energy_of_group(world, first, count) - spring.energy
    mass = mass_of_group(world, first, count)
    rise = 0.0
    square = 0.0
    nearest = NEVER
    for body in range(first, first + count):
        share = world.bodies[body].rolling_mass / mass
        rise -= share * acceleration_of(world.springs[body])
        square += share * world.springs[body].square
        nearest = min(nearest, square_of_length(world.springs[body]))
    steepness = rise * rise / square + spring.v * spring.v
    # Near a saddle of a group, and in small oscillations, rounding of the energy would move the
    # bodies too far.
    if steepness <= 1.0e-2 * (spring.energy + square * spring.height * spring.height):
        return
    back = surplus / steepness
    change = back * rise / square
    # The same near a foot close to the line: the projection would undo the step.
    if change * change > MOST_CHANGE * MOST_CHANGE * nearest:
        return
    world.clock[0].energy_correction += mass * abs(surplus)
    for body in range(first, first + count):
        world.springs[body].x -= change
        world.springs[body].v -= back * spring.v if body > first else 0.0
    spring.v -= back * spring.v


@kernel
def _keep_energy_above_saddle(world: World, body: int) -> None:
    """Project position and speed of a body onto its energy above the saddle, in the same way."""
    spring = world.springs[body]
    size = _size_of_state(spring)
    if size == 0.0:
        return
    root = spring.root / size
    surplus = 0.5 * (_above_saddle(spring, size) - root * abs(root))
    rate = math.sqrt(spring.square)
    rise = -acceleration_of(spring) / rate / size
    speed = spring.v / size
    back = surplus / (rise * rise + speed * speed)
    change = back * rise * size / rate
    if abs(change) > MOST_CHANGE * math.sqrt(square_of_length(spring)):  # as in `keep_energy`
        return
    mass = world.bodies[body].rolling_mass
    world.clock[0].energy_correction += mass * abs(surplus) * size * size
    spring.x -= change
    spring.v -= back * spring.v


@kernel
def _size_of_state(spring: SpringBody) -> float:
    """Return the greater of v and w x (m/s), whose ratios to it have squares that are doubles."""
    return max(abs(spring.v), math.sqrt(spring.square) * abs(spring.x))


@kernel
def _above_saddle(spring: SpringBody, size: float) -> float:
    """Return twice the energy of a body above its saddle over its rolling mass and ``size^2``.

    It is ``v^2 - w^2 x^2 (2 l - s - b)/(s + b)``, from C (7), and keeps its digits at the saddle.
    """
    lengths = math.sqrt(square_of_length(spring)) + spring.height
    share = (2.0 * (spring.length - spring.height) - spring.x / lengths * spring.x) / lengths
    way = math.sqrt(spring.square) * spring.x / size
    speed = spring.v / size
    return speed * speed - way * way * share


@kernel
def _refer_to_saddle(spring: SpringBody) -> None:
    """Set the root of a single body if it is near the separatrix; one that is known is kept."""
    depth = spring.length - spring.height
    if depth <= 0.0:
        return
    if spring.root == NEVER:
        size = _size_of_state(spring)
        spring.root = size * _signed_root(_above_saddle(spring, size)) if size > 0.0 else 0.0
    if spring.root * spring.root > NEAR * spring.square * depth * depth:
        spring.root = NEVER


@kernel
def _signed_root(value: float) -> float:
    return math.copysign(math.sqrt(abs(value)), value)


@kernel
def change_speed(spring: SpringBody, v: float) -> None:
    """Give a body the speed v (m/s) after an impact, which changes its root accordingly."""
    if spring.root < NEVER and abs(v) != abs(spring.v):
        size = max(abs(spring.root), max(abs(v), abs(spring.v)))
        root = spring.root / size
        gain = (v - spring.v) / size * ((v + spring.v) / size)
        spring.root = size * _signed_root(root * abs(root) + gain)
    spring.v = v


@kernel
def go_on(world: World, time: float, unit: float) -> None:
    """Move all bodies on by a time (s) within the step of their series, conserving energies."""
    rate = 1.0 / unit
    first = 0
    while first < len(world.bodies):
        count = group_size(world, first)
        for body in range(first, first + count):
            move_body(world, body, ORDER, time * rate, rate)
        keep_energy(world, first, count)
        first += count


@kernel
def renew_energies(world: World) -> None:
    """Set the energy that each group conserves from now on."""
    first = 0
    while first < len(world.bodies):
        count = group_size(world, first)
        world.springs[first].energy = energy_of_group(world, first, count)
        # Where the saddle of several bodies together is, is not known.
        if count == 1:
            _refer_to_saddle(world.springs[first])
        else:
            for body in range(first, first + count):
                world.springs[body].root = NEVER
        first += count


@kernel
def log_states(world: World, cause: int, pair: int, value: float) -> None:
    """Log the state of every body after an event."""
    clock = world.clock[0]
    for body in range(len(world.bodies)):
        row = world.states[clock.state_rows]
        clock.state_rows += 1
        spring = world.springs[body]
        row.t = clock.t
        row.t_low = clock.t_low
        row.event = clock.collisions
        row.cause = cause
        row.pair = pair
        row.body = body
        row.x = spring.x
        row.v = spring.v
        row.energy = energy_of(spring)
        row.root = spring.root
        row.held = 0
        if body < len(world.bodies) - 1:
            # Between impacts at one instant, bodies that were in contact may have unequal speeds.
            same = world.springs[body + 1].v == spring.v
            row.held = 1 if world.pairs[body].held == 1 and same else 0
        row.value = value


@struct
class Sample:
    """An instant at which to compute the motion."""

    row: int  # in the log, of the first body's state after the event before the instant
    way: float  # -1: the motion from there with all speeds reversed; else 1
    t: float  # time (s) from the start of the run in that direction


@struct
class Found:
    """State of a body at one instant."""

    x: float  # from the foot's place, m
    v: float  # m/s
    energy: float  # over the rolling mass, m^2/s^2


@kernel
def sample_states(
    world: World,
    samples: Sequence[Sample],
    count: int,
    states: Sequence[Found],
    scratch: Sequence[SpringBody],
) -> None:
    """Fill in the states of all bodies at some instants: ``states[sample * bodies + body]``.

    Instants after the same event must be adjacent and not decreasing. ``world`` has the log, and is
    modified; ``scratch`` has an element for each body.
    """
    bodies = len(world.bodies)
    clock = world.clock[0]
    row = -1
    way = 0.0
    step = 0.0
    unit = 1.0
    for number in range(count):
        sample = samples[number]
        if sample.row != row or sample.way != way:
            row = sample.row
            way = sample.way
            restore(world, row, way)
            step, unit = expand(world)
        left = sample.t - clock.t - clock.t_low
        while step <= left:
            go_on(world, step, unit)
            clock.t, clock.t_low = add_to_time(clock.t, clock.t_low, step)
            step, unit = expand(world)
            left = sample.t - clock.t - clock.t_low
        for body in range(bodies):
            scratch[body].x = world.springs[body].x
            scratch[body].v = world.springs[body].v
        if left > 0.0:
            go_on(world, left, unit)
        for body in range(bodies):
            spring = world.springs[body]
            at = states[number * bodies + body]
            at.x = spring.x
            at.v = way * spring.v
            at.energy = energy_of(spring)
            spring.x = scratch[body].x
            spring.v = scratch[body].v


@kernel
def restore(world: World, row: int, way: float) -> None:
    """Restore the state of all bodies after an event, with speeds times ``way``."""
    bodies = len(world.bodies)
    for body in range(bodies):
        state = world.states[row + body]
        world.springs[body].x = state.x
        world.springs[body].v = way * state.v
        world.springs[body].root = state.root
        if body < bodies - 1:
            world.pairs[body].held = state.held
    world.clock[0].t = world.states[row].t
    world.clock[0].t_low = world.states[row].t_low
    renew_energies(world)


@kernel
def gap_of(world: World, pair: int) -> float:
    """Return the distance (m) between a body and its right neighbour along the line."""
    one = world.springs[pair]
    other = world.springs[pair + 1]
    return (other.foot - one.foot) + (other.x - one.x) - world.pairs[pair].touch


@kernel
def is_in_contact(world: World, pair: int) -> bool:
    """Return whether a pair is known to be in contact at the present instant."""
    state = world.pairs[pair]
    return state.held == 1 or state.known >= PARTING
