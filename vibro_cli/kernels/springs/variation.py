"""The derivative of the bodies' motion within a step, along the Taylor series of that motion.

A change d of a place goes on by ``d'' = g d``, ``g = -w^2 (1 - l h)``, ``h = b^2/s^3``, the
derivative of the acceleration; h, that of y = x/s, follows from ``s h = 1 - y^2`` and the series of
s and y. Bodies in lasting contact move as one; each adds its share ``M_i/M`` of g. While the place
stays within R < s of that at the start of the step, the length stays above s - R, and |g| below
``w^2 (1 + l b^2/(s - R)^3)``: the series of d hold for the step that those of the places do.
"""

from __future__ import annotations

from vibro_cli.compile.kernel import FloatMatrix, kernel
from vibro_cli.kernels.springs.series import (
    begin_group,
    extend_group,
    group_size,
    keep_energy,
    mass_of_group,
    move_body,
)
from vibro_cli.kernels.springs.world import BODY_ROWS, LENGTH, ORDER, PLACE, RATIO, World
from vibro_cli.kernels.tangent.world import Tangents

# Terms of a step are left out that are below this: those of changes, and of a place over b.
REST = 1.0e-18
# Rows of the scratch: g of a group, d that begins as a way or as a speed of 1, and h of each body.
_SLOPE, _WAY, _SPEED, _STEEPNESS = 0, 1, 2, 3


@kernel
def carry_on(world: World, tangents: Tangents, left: float) -> float:
    """Carry bodies and tangent vectors on by one step, at most ``left`` (s), and return it."""
    bodies = world.settings[0].bodies
    step = left
    first = 0
    while first < bodies:
        count = group_size(world, first)
        step = min(step, begin_group(world, first, count))
        first += count
    first = 0
    while first < bodies:
        count = group_size(world, first)
        last = _expand(world, tangents.series, first, count, step)
        one, three = _at(tangents.series, _WAY, last, step)
        two, four = _at(tangents.series, _SPEED, last, step)
        for body in range(first, first + count):
            _carry(tangents, body, one, two, three, four)
            move_body(world, body, last, step)
        keep_energy(world, first, count)
        first += count
    return step


@kernel
def _expand(world: World, series: FloatMatrix, first: int, count: int, step: float) -> int:
    """Set the series of a group and of changes; return the power of the last terms needed.

    Two in succession have to be small, since every second one vanishes where a body is at rest.
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
        extend_group(world, first, count, k)
        slope = 0.0
        for body in range(first, first + count):
            share = world.bodies[body].rolling_mass / mass
            slope += share * _next_slope(world, series, body, k)
        series[_SLOPE, k] = slope
        way, speed = _next_changes(series, k)
        power *= step
        size = abs(way) * step + abs(speed) + abs(world.series[place + k + 2]) * step / height
        small = small + 1 if size * power < REST else 0
        if small == 2:
            return k + 2
    return ORDER


@kernel
def _next_slope(world: World, series: FloatMatrix, body: int, k: int) -> float:
    """Return the k-th coefficient of g of a body on its own; set that of h."""
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
def _next_changes(series: FloatMatrix, k: int) -> tuple[float, float]:
    """Set and return coefficient k + 2 of the changes that begin as a way and as a speed."""
    way = 0.0
    speed = 0.0
    for i in range(k + 1):
        way += series[_SLOPE, i] * series[_WAY, k - i]
        speed += series[_SLOPE, i] * series[_SPEED, k - i]
    divided = 1.0 / ((k + 1) * (k + 2))
    way *= divided
    speed *= divided
    series[_WAY, k + 2] = way
    series[_SPEED, k + 2] = speed
    return way, speed


@kernel
def _at(series: FloatMatrix, row: int, last: int, time: float) -> tuple[float, float]:
    """Value and derivative of a series (Horner)."""
    value = 0.0
    slope = 0.0
    for k in range(last, -1, -1):
        slope = slope * time + value
        value = value * time + series[row, k]
    return value, slope


@kernel
def _carry(
    tangents: Tangents, body: int, one: float, two: float, three: float, four: float
) -> None:
    """Carry the tangent vectors of a body by the derivative ``[[one, two], [three, four]]``."""
    tau = tangents.state[0].time_scale
    frame = tangents.frame
    for column in range(len(frame)):
        way = frame[2 * body, column]
        rate = frame[2 * body + 1, column]
        frame[2 * body, column] = one * way + two / tau * rate
        frame[2 * body + 1, column] = three * tau * way + four * rate
