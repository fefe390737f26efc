"""The impulses of several pairs of touching balls, solved jointly.

An impulse ``I_p`` along each line of centres turns the law's relative speed ``u_p`` into
``-k u_p``:

    sum_q A_pq I_q = (1 + k) u_p,

where A says what each impulse changes in each relative speed (see `kernels.impact.laws`):
symmetric, and
singular where more pairs touch than there are motions to stop, though the velocities are unique. It
is solved by conjugate gradients on residuals of 31 digits, so that the doubles that come out do not
depend on the order of the pairs: symmetric scenes stay so.
"""

from __future__ import annotations

from vibro_cli.compile.kernel import kernel
from vibro_cli.kernels.impact.laws import law_approach, weight_and_response
from vibro_cli.kernels.numerics.double_double import pair_plus, pair_times
from vibro_cli.kernels.table.impacts import inclination
from vibro_cli.kernels.table.world import World

# The square of the share of the impulses at which the residuals are nothing but rounding.
SOLVED = 1.0e-50
# Impulses that change relative speeds by a smaller share than this balance one another but for the
# rounding of the normals: there is nothing to be solved for.
BALANCED = 1.0e-12


@kernel
def solve_impulses(world: World, closing: int, law: int, restitution: float) -> None:
    """Set the impulses of the closing pairs, and the velocities after them in the shares."""
    _set_up(world, closing, law, restitution)
    _descend(world, closing)
    for number in range(closing):
        touch = world.touches[number]
        touch.direction = touch.impulse
    _apply(world, closing)


@kernel
def impulses_for(world: World, pairs: int) -> None:
    """Set the impulses of pairs for right-hand sides given in ``left``, each a double."""
    if pairs == 1:
        world.touches[0].impulse = world.touches[0].left / world.touches[0].diagonal
        return
    for number in range(pairs):
        touch = world.touches[number]
        touch.left_low = 0.0
        touch.impulse, touch.impulse_low = 0.0, 0.0
        touch.direction = touch.left / touch.diagonal
    _descend(world, pairs)


@kernel
def _descend(world: World, closing: int) -> None:
    """Set the impulses by conjugate gradients, from the right-hand sides and first directions."""
    target = 0.0
    for number in range(closing):
        touch = world.touches[number]
        target += touch.left * touch.left / touch.diagonal
    rho = target
    for _ in range(20 + 10 * closing):
        if rho <= SOLVED * target:
            break
        along = _apply(world, closing)
        size = 0.0
        for number in range(closing):
            touch = world.touches[number]
            size += touch.diagonal * touch.direction * touch.direction
        if along <= BALANCED * size:
            break
        rho = _step(world, closing, rho, rho / along)
    for number in range(closing):
        touch = world.touches[number]
        touch.impulse += touch.impulse_low


@kernel
def set_weights(world: World, number: int, law: int) -> None:
    """Set weights and responses of a pair of touching balls."""
    touch = world.touches[number]
    one = world.bodies[touch.a]
    other = world.bodies[touch.b]
    inclined = inclination(one, other)
    touch.weight_a, touch.response_a = weight_and_response(law, one, inclined)
    touch.weight_b, touch.response_b = weight_and_response(law, other, inclined)
    touch.diagonal = touch.weight_a * touch.response_a + touch.weight_b * touch.response_b


@kernel
def _set_up(world: World, closing: int, law: int, restitution: float) -> None:
    """Set weights, responses and right-hand sides of the closing pairs."""
    first = world.clock[0].pair_rows - closing
    for number in range(closing):
        touch = world.touches[number]
        row = world.pair_log[first + number]
        one = world.bodies[touch.a]
        other = world.bodies[touch.b]
        inclined = inclination(one, other)
        set_weights(world, number, law)
        touch.approach = law_approach(
            law, one, other, inclined, inclined, row.normal_a_pre, row.normal_b_pre
        )
        touch.impulse, touch.impulse_low = 0.0, 0.0
    # By the very weights that the impulses are measured with: where these are redundant, another
    # rounding of the speeds would ask for what no impulses can do.
    for place in range(world.clock[0].group):
        ball = world.group[place]
        share = world.shares[ball]
        share.x, share.x_low = world.balls[ball].vx, 0.0
        share.y, share.y_low = world.balls[ball].vy, 0.0
    _measure(world, closing)
    for number in range(closing):
        touch = world.touches[number]
        factor = -(1.0 + restitution)
        touch.left, touch.left_low = pair_times(touch.change, touch.change_low, factor)
        touch.direction = touch.left / touch.diagonal


@kernel
def _apply(world: World, closing: int) -> float:
    """Set what impulses ``direction`` change: in the balls' velocities, in the relative speeds.

    Returns the product of the impulses with the changes of the relative speeds.
    """
    for place in range(world.clock[0].group):
        share = world.shares[world.group[place]]
        share.x, share.x_low, share.y, share.y_low = 0.0, 0.0, 0.0, 0.0
    for number in range(closing):
        touch = world.touches[number]
        x, y = touch.normal_x, touch.normal_y
        _give(world, touch.a, -touch.response_a * x, -touch.response_a * y, touch.direction)
        _give(world, touch.b, touch.response_b * x, touch.response_b * y, touch.direction)
    return _measure(world, closing)


@kernel
def _measure(world: World, closing: int) -> float:
    """Set the relative speeds of the velocities in the shares, positive where pairs part.

    Returns the product of the impulses with them.
    """
    product = 0.0
    for number in range(closing):
        touch = world.touches[number]
        x, y = touch.normal_x, touch.normal_y
        high, low = _along(world, touch.b, touch.weight_b * x, touch.weight_b * y)
        more, more_low = _along(world, touch.a, -touch.weight_a * x, -touch.weight_a * y)
        touch.change, touch.change_low = pair_plus(high, low, more, more_low)
        product += touch.direction * touch.change
    return product


@kernel
def _give(world: World, ball: int, x: float, y: float, impulse: float) -> None:
    share = world.shares[ball]
    high, low = pair_times(x, 0.0, impulse)
    share.x, share.x_low = pair_plus(share.x, share.x_low, high, low)
    high, low = pair_times(y, 0.0, impulse)
    share.y, share.y_low = pair_plus(share.y, share.y_low, high, low)


@kernel
def _along(world: World, ball: int, x: float, y: float) -> tuple[float, float]:
    share = world.shares[ball]
    high, low = pair_times(share.x, share.x_low, x)
    more, more_low = pair_times(share.y, share.y_low, y)
    return pair_plus(high, low, more, more_low)


@kernel
def _step(world: World, closing: int, rho: float, length: float) -> float:
    """Go a step along the direction; set the next one and return the new measure of what is left.

    The residuals follow the steps in two doubles, whatever rounding there is in their lengths.
    """
    measure = 0.0
    for number in range(closing):
        touch = world.touches[number]
        high, low = pair_times(touch.direction, 0.0, length)
        touch.impulse, touch.impulse_low = pair_plus(touch.impulse, touch.impulse_low, high, low)
        high, low = pair_times(touch.change, touch.change_low, -length)
        touch.left, touch.left_low = pair_plus(touch.left, touch.left_low, high, low)
        measure += touch.left * touch.left / touch.diagonal
    for number in range(closing):
        touch = world.touches[number]
        touch.direction = touch.left / touch.diagonal + measure / rho * touch.direction
    return measure
