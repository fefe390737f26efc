"""Where a ball that moves straight on meets the wall, its centre at the distance r from it.

A conic (ellipse or circle with the semi-axes a, b) is met on its offset curve, which is no ellipse.
With the unit normal ``n`` of the wall at some point, the centre of a ball that touches it there is
``c = (a^2 n_x, b^2 n_y)/H - s r n``, ``H^2 = a^2 n_x^2 + b^2 n_y^2``, s = 1 inside and -1 outside;
its curve turns with the radius ``a^2 b^2/H^3 - s r``. While that is positive (build refuses other
balls) the centres that touch enclose a convex region, left once by a straight line, where
``n u > 0`` for its direction u, and entered once, where ``n u < 0``. On either half the distance
``u x (c - p)`` of c from the line grows or falls throughout: its one root is bracketed, and
Newton's steps that leave the bracket are replaced by its middle. So the contact found is the first.
A particle, r = 0, meets the wall itself, in closed form.
"""

from __future__ import annotations

import math

from vibro_cli.compile.kernel import kernel
from vibro_cli.kernels.numerics.constants import EPSILON, NEVER
from vibro_cli.kernels.numerics.double_double import difference_of_products, time_between
from vibro_cli.kernels.table.world import POLYGON, Ball, BounceRow, Edge, Meeting, WallData, World
from vibro_cli.kernels.world import BodyData

MOST_STEPS = 200
# Once steps are below this share of the half turn, they shrink until rounding decides them.
SETTLED = 1.0e-6
# A step below it is taken along the tangent: what it misses there is its square.
STRAIGHT = 1.0e-10
# Components of a velocity across a wall below this share of it are rounding, not approach; of the
# greatest speed in its last impact, for at k = 0 little of it may be left.
RESOLVED = 4.0 * EPSILON
# A slower ball (m/s) is at rest: the square of its speed has no digits any more.
SLOWEST = 1.0e-145


@kernel
def meet_wall(world: World, body: BodyData, ball: Ball, x: float, y: float, to: Meeting) -> float:
    """Return the time (s) until a ball at (x, y) meets the wall, and where; NEVER if it does not.

    ``to`` gets the place of the centre, the normal and the edge or -1; ``ball`` is how it moves.
    """
    to.other = -1
    wall = world.wall[0]
    speed = math.sqrt(ball.vx * ball.vx + ball.vy * ball.vy)
    if speed < SLOWEST:
        return NEVER
    if wall.kind != POLYGON:
        least = RESOLVED * ball.fastest / speed
        way = _meet_curve(wall, body.radius, x, y, ball.vx / speed, ball.vy / speed, least, to)
        return way / speed if way < NEVER else NEVER
    best = NEVER
    sides = len(world.edges)
    for index in range(sides):
        edge = world.edges[index]
        before = world.edges[index - 1 if index > 0 else sides - 1]
        after = world.edges[index + 1 if index + 1 < sides else 0]
        time = _meet_edge(edge, after, body.radius, ball, x, y, best, to)
        # The normal at a corner lies between those of its sides: who comes to neither, as a ball
        # that has rolled along one, does not come to it. A particle meets one of the sides.
        pointed = edge.corner == 1 and body.radius > 0.0
        if pointed and max(_approach_to(before, ball), _approach_to(edge, ball)) > 0.0:
            time = _meet_corner(edge, body.radius, ball, x, y, time, to)
        if time < best:
            best = time
            to.other = index
    return best


@kernel
def _meet_curve(
    wall: WallData,
    radius: float,
    x: float,
    y: float,
    ux: float,
    uy: float,
    least: float,
    to: Meeting,
) -> float:
    """Distance along the unit vector u to the contact; NEVER if there is none ahead.

    From outside there is none where the component of u across the wall is not above ``least``.
    """
    px = x - wall.x
    py = y - wall.y
    if wall.a == wall.b:
        return _meet_circle(wall, wall.a - wall.side * radius, px, py, ux, uy, least, to)
    # Normals within a quarter turn of +u inside, of -u outside: t is the tangent of half the angle.
    fx = wall.side * ux
    fy = wall.side * uy
    offset = wall.side * radius
    if wall.side < 0.0 and not _crosses(wall, offset, px, py, fx, fy):
        return NEVER
    cx, cy, nx, ny = _contact(wall, offset, px, py, fx, fy)
    ahead = (cx - px) * ux + (cy - py) * uy
    if wall.side < 0.0:
        if ahead < -8.0 * EPSILON * (wall.a + wall.b + abs(px) + abs(py)):
            return NEVER
        if wall.side * (nx * ux + ny * uy) <= least:
            return NEVER
    if ahead < 0.0:
        # By rounding it is beyond the wall: it touches where it is, not where it came through,
        # which along the wall may be far behind.
        cx, cy, nx, ny = _contact(wall, offset, px, py, nx, ny)
    _note(to, wall.x + cx, wall.y + cy, wall.side * nx, wall.side * ny)
    return max(ahead, 0.0)


@kernel
def _contact(
    wall: WallData, offset: float, px: float, py: float, fx: float, fy: float
) -> tuple[float, float, float, float]:
    """Centre that touches, and the normal there, where the line through p along f is met."""
    if offset == 0.0:  # the wall itself, in closed form
        x, y = _left_at(wall.a, wall.b, px, py, fx, fy)
        slope = wall.a / wall.b * y
        length = math.sqrt(x * x + slope * slope)
        return wall.a * x, wall.b * y, x / length, slope / length
    low, high, last = -1.0, 1.0, 2.0
    t = _first_guess(wall, offset, px, py, fx, fy)
    for _ in range(MOST_STEPS):
        cx, cy, nx, ny, turning = touch_curve(wall, offset, fx, fy, t)
        away = fx * (cy - py) - fy * (cx - px)
        if away < 0.0:
            low = t
        else:
            high = t
        step = 2.0
        if turning > 0.0:
            turn = away * (1.0 / turning)  # a quotient that need not wait for `away`
            step = -0.5 * (1.0 + t * t) * turn
        size = abs(step)
        if size <= STRAIGHT:
            slip = away * ((1.0 + t * t) / (1.0 - t * t))
            return cx + slip * ny, cy - slip * nx, nx + turn * ny, ny - turn * nx
        if last < SETTLED and size >= 0.5 * last:
            return cx, cy, nx, ny  # as near as the rounding of the distance allows
        last = size
        t += step
        if not low < t < high:
            t = 0.5 * (low + high)
            last = 2.0
            if not low < t < high:
                break
    cx, cy, nx, ny, _ = touch_curve(wall, offset, fx, fy, t)
    return cx, cy, nx, ny


@kernel
def touch_curve(
    wall: WallData, offset: float, fx: float, fy: float, t: float
) -> tuple[float, float, float, float, float]:
    """Centre that touches, normal there, and how fast the centre leaves the line as it turns.

    At t = 0, where f is the normal, the last is the radius of curvature of the centre's curve.
    """
    cosine = (1.0 - t * t) / (1.0 + t * t)
    sine = 2.0 * t / (1.0 + t * t)
    nx = fx * cosine - fy * sine
    ny = fx * sine + fy * cosine
    h = math.sqrt(wall.a * wall.a * nx * nx + wall.b * wall.b * ny * ny)
    cx = (wall.a * wall.a / h - offset) * nx
    cy = (wall.b * wall.b / h - offset) * ny
    ratio = wall.a * wall.b / h
    return cx, cy, nx, ny, (ratio * ratio / h - offset) * cosine


@kernel
def bend_at(world: World, row: BounceRow) -> float:
    """Return by how much (rad) the normal at a contact turns as the centre moves on by 1 m.

    The normal is that towards the wall; the centre's curve about a corner has the radius r.
    """
    wall = world.wall[0]
    radius = world.bodies[row.ball].radius
    if wall.kind != POLYGON:
        fx, fy = wall.side * row.normal_x, wall.side * row.normal_y
        _, _, _, _, curvature_radius = touch_curve(wall, wall.side * radius, fx, fy, 0.0)
        return wall.side / curvature_radius
    edge = world.edges[row.edge]
    if row.normal_x == edge.normal_x and row.normal_y == edge.normal_y:
        return 0.0
    return -1.0 / radius


@kernel
def _note(to: Meeting, x: float, y: float, nx: float, ny: float) -> None:
    """Note where the centre is at a contact, and the normal to the wall."""
    to.x = x
    to.y = y
    to.normal_x = nx
    to.normal_y = ny


@kernel
def _crosses(wall: WallData, offset: float, px: float, py: float, fx: float, fy: float) -> bool:
    """Whether the line through p along f crosses the region of centres that touch or overlap."""
    first_x, first_y, _, _, _ = touch_curve(wall, offset, fx, fy, -1.0)
    last_x, last_y, _, _, _ = touch_curve(wall, offset, fx, fy, 1.0)
    first = fx * (first_y - py) - fy * (first_x - px)
    last = fx * (last_y - py) - fy * (last_x - px)
    return first < 0.0 and last > 0.0


@kernel
def _first_guess(
    wall: WallData, offset: float, px: float, py: float, fx: float, fy: float
) -> float:
    """Guess of the contact, from the ellipse whose semi-axes are shorter (longer) by r."""
    a = wall.a - offset
    b = wall.b - offset
    x, y = _left_at(a, b, px, py, fx, fy)
    # Of both components, for f is of length 1 but for rounding.
    dot = fx * x / a + fy * y / b
    cross = fx * y / b - fy * x / a
    if dot <= 0.0:
        return 0.0
    return cross / (dot + math.sqrt(dot * dot + cross * cross))


@kernel
def _left_at(a: float, b: float, px: float, py: float, fx: float, fy: float) -> tuple[float, float]:
    """Where the line through p along f leaves an ellipse, in units of its semi-axes."""
    qx, qy, gx, gy = px / a, py / b, fx / a, fy / b
    square = gx * gx + gy * gy
    along = qx * gx + qy * gy
    across = qx * gy - qy * gx
    root = math.sqrt(max(square - across * across, 0.0))
    ahead = (root - along) / square
    return qx + ahead * gx, qy + ahead * gy


@kernel
def _meet_circle(
    wall: WallData,
    rho: float,
    px: float,
    py: float,
    ux: float,
    uy: float,
    least: float,
    to: Meeting,
) -> float:
    """The same for a circle on which the centres that touch lie at the distance rho."""
    along = px * ux + py * uy
    across = difference_of_products(px, uy, py, ux)
    square = (rho - across) * (rho + across)
    if square <= 0.0:
        if wall.side < 0.0:
            return NEVER
        square = 0.0
    root = math.sqrt(square)
    if wall.side > 0.0:
        ahead = root - along
    else:
        away = math.sqrt(px * px + py * py)
        if along >= -least * away:
            return NEVER
        outside = (away - rho) * (away + rho)
        ahead = outside / (root - along)
    ahead = max(ahead, 0.0)
    nx = px + ahead * ux
    ny = py + ahead * uy
    length = math.sqrt(nx * nx + ny * ny)
    nx /= length
    ny /= length
    _note(to, wall.x + rho * nx, wall.y + rho * ny, wall.side * nx, wall.side * ny)
    return ahead


@kernel
def _approach_to(edge: Edge, ball: Ball) -> float:
    """Speed (m/s) at which a ball moves towards the line of a side; 0 if it is rounding."""
    closing = ball.vx * edge.normal_x + ball.vy * edge.normal_y
    return closing if closing > RESOLVED * ball.fastest else 0.0


@kernel
def _meet_edge(
    edge: Edge, after: Edge, r: float, ball: Ball, x: float, y: float, best: float, to: Meeting
) -> float:
    """The sooner of a time and that until a straight side is met, which is then noted."""
    closing = _approach_to(edge, ball)
    if closing == 0.0:
        return best
    vx, vy = ball.vx, ball.vy
    distance = (edge.x - x) * edge.normal_x + (edge.y - y) * edge.normal_y - r
    time = max(distance / closing, 0.0)
    if time >= best:
        return best
    place = (x - edge.x + time * vx) * edge.along_x + (y - edge.y + time * vy) * edge.along_y
    start, end = place + edge.open_start, edge.length + edge.open_end - place
    if r == 0.0:
        # By the corners themselves: both sides of one tell alike how a particle passes it.
        turn = edge.normal_x * edge.along_y - edge.normal_y * edge.along_x
        start = turn * _beside(edge, ball, x, y) if edge.corner == 1 else start
        end = -turn * _beside(after, ball, x, y) if after.corner == 1 else end
    if start < 0.0 or end < 0.0:
        return best
    if distance < 0.0 and -distance > 1.0e-9 * (edge.length + r):
        return best  # it is behind this side, and sees it from there
    centre_x = edge.x + place * edge.along_x - r * edge.normal_x
    centre_y = edge.y + place * edge.along_y - r * edge.normal_y
    _note(to, centre_x, centre_y, edge.normal_x, edge.normal_y)
    return time


@kernel
def _beside(edge: Edge, ball: Ball, x: float, y: float) -> float:
    """On which side of a ball's path the first corner of a side lies: positive on the right."""
    return (edge.x - x) * ball.vy - (edge.y - y) * ball.vx


@kernel
def _meet_corner(
    edge: Edge, radius: float, ball: Ball, x: float, y: float, best: float, to: Meeting
) -> float:
    """The same for the first corner of a side: the centre comes to the distance r from it."""
    vx, vy = ball.vx, ball.vy
    rounding = RESOLVED * ball.fastest
    time = time_to_distance(edge.x - x, edge.y - y, -vx, -vy, radius, rounding)
    if time >= best:
        return best
    nx = edge.x - (x + time * vx)
    ny = edge.y - (y + time * vy)
    length = math.sqrt(nx * nx + ny * ny)
    if length == 0.0:
        return best
    nx /= length
    ny /= length
    _note(to, edge.x - radius * nx, edge.y - radius * ny, nx, ny)
    return time


@kernel
def time_to_distance(
    dx: float, dy: float, wx: float, wy: float, distance: float, rounding: float
) -> float:
    """Return when ``|d + w t|`` falls to a distance (s from now), or NEVER.

    The root of ``w^2 t^2 + 2 d w t + d^2 - D^2`` at which the distance falls, without cancellation:
    ``t = c/(root - d w)``, ``root^2 = (|w| D - |d x w|)(|w| D + |d x w|)``. An approach slower than
    ``rounding`` (m/s) is none.
    """
    closing = dx * wx + dy * wy
    if closing >= 0.0:  # half of the pairs, told without a root
        return NEVER
    apart = math.sqrt(dx * dx + dy * dy)
    if closing >= -rounding * apart:
        return NEVER
    square = wx * wx + wy * wy
    across = abs(difference_of_products(dx, wy, dy, wx))
    reach = math.sqrt(square) * distance
    inside = (reach - across) * (reach + across)
    if inside < 0.0:
        return NEVER
    beyond = (apart - distance) * (apart + distance)
    time = max(beyond / (math.sqrt(inside) - closing), 0.0)
    # Where they are further apart by then than now, ``root`` is nothing but rounding: they pass by.
    return time if time * square <= -2.0 * closing else NEVER


@kernel
def touching_distance(world: World, a: int, b: int) -> float:
    """Return the horizontal distance of two touching balls' centres, m."""
    radius_a = world.bodies[a].radius
    radius_b = world.bodies[b].radius
    if radius_a == radius_b:
        return 2.0 * radius_a
    return 2.0 * math.sqrt(radius_a * radius_b)


@kernel
def present_place(world: World, ball: int) -> tuple[float, float]:
    """Return where the centre of a ball is at the present instant, m."""
    clock = world.clock[0]
    state = world.balls[ball]
    past = time_between(clock.t, clock.t_low, state.t, state.t_low)
    return state.x + state.vx * past, state.y + state.vy * past
