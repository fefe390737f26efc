"""The derivative of the bodies' motion within a step, along the Taylor series of that motion.

A change d of a place goes on by ``d'' = g d``, ``g = -w^2 (1 - (l/b) c)``, ``c = (b/s)^3``, the
derivative of the acceleration; c follows from the series of the length s by ``s c' = -3 s' c``.
Bodies in lasting contact move as one; each adds its share ``M_i/M`` of g. While the place stays
within R < s of that at the start of the step, the length stays above s - R, and |g| below
``w^2 (1 + l b^2/(s - R)^3)``: the series of d hold for the step that those of the places do.
"""

from __future__ import annotations

from vibro_cli.compile.kernel import FloatMatrix, kernel
from vibro_cli.kernels.springs.series import group_size, mass_of_group
from vibro_cli.kernels.springs.world import BODY_ROWS, LENGTH, ORDER, World
from vibro_cli.kernels.tangent.world import Tangents

# Rows of the scratch: c of a body, g of its group, and d that begins as a way or as a speed of 1.
_CUBE, _SLOPE, _WAY, _SPEED = 0, 1, 2, 3


@kernel
def carry_vectors(world: World, tangents: Tangents, time: float) -> None:
    """Carry the tangent vectors of all bodies on by a time (s) within the step of their series."""
    series = tangents.series
    first = 0
    while first < world.settings[0].bodies:
        count = group_size(world, first)
        for k in range(ORDER - 1):
            series[_SLOPE, k] = 0.0
        mass = mass_of_group(world, first, count)
        for body in range(first, first + count):
            _add_slope(world, series, body, world.bodies[body].rolling_mass / mass)
        _expand(series)
        one, three = _at(series, _WAY, time)
        two, four = _at(series, _SPEED, time)
        for body in range(first, first + count):
            _carry(tangents, body, one, two, three, four)
        first += count


@kernel
def _add_slope(world: World, series: FloatMatrix, body: int, share: float) -> None:
    """Add the share of a body to g of its group."""
    spring = world.springs[body]
    length = body * BODY_ROWS + LENGTH
    start = world.series[length]
    ratio = spring.height / start
    series[_CUBE, 0] = ratio * ratio * ratio
    for k in range(1, ORDER - 1):
        total = 0.0
        for i in range(1, k + 1):
            total += (k + 2 * i) * world.series[length + i] * series[_CUBE, k - i]
        series[_CUBE, k] = -total / (k * start)
    pull = share * spring.square
    softer = pull * spring.length / spring.height
    series[_SLOPE, 0] -= pull
    for k in range(ORDER - 1):
        series[_SLOPE, k] += softer * series[_CUBE, k]


@kernel
def _expand(series: FloatMatrix) -> None:
    """Set the series of changes that begin with a way and with a speed."""
    series[_WAY, 0] = 1.0
    series[_WAY, 1] = 0.0
    series[_SPEED, 0] = 0.0
    series[_SPEED, 1] = 1.0
    for k in range(ORDER - 1):
        way = 0.0
        speed = 0.0
        for i in range(k + 1):
            way += series[_SLOPE, k - i] * series[_WAY, i]
            speed += series[_SLOPE, k - i] * series[_SPEED, i]
        series[_WAY, k + 2] = way / ((k + 1) * (k + 2))
        series[_SPEED, k + 2] = speed / ((k + 1) * (k + 2))


@kernel
def _at(series: FloatMatrix, row: int, time: float) -> tuple[float, float]:
    """Value and derivative of a series (Horner)."""
    value = 0.0
    slope = 0.0
    for k in range(ORDER, -1, -1):
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
