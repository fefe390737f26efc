"""Contact of a ball in straight motion with the wall, at distance r of its centre.

On a conic (ellipse or circle with semi-axes a, b) the centre reaches an offset curve, which is not
an ellipse. If the ball touches the wall where its unit normal is ``n``, the centre is at
``c = (a^2 n_x, b^2 n_y)/H - s r n``, ``H^2 = a^2 n_x^2 + b^2 n_y^2``, s = 1 inside and -1 outside;
the offset curve has the radius of curvature ``a^2 b^2/H^3 - s r``. While this is positive (other
balls are refused when the system is built) the curve encloses a convex region. A straight line of
direction u leaves that region once, where ``n u > 0``, and enters it once, where ``n u < 0``. On
either half the distance ``u x (c - p)`` of c from the line is monotonic, so its only root is
bracketed; Newton steps that leave the bracket are replaced by bisection. So the contact found is
the first. A particle, r = 0, meets the wall itself, in closed form.
"""

from __future__ import annotations

import math

from vibro_cli.compile.kernel import kernel
from vibro_cli.kernels.numerics.constants import EPSILON, NEVER
from vibro_cli.kernels.numerics.double_double import difference_of_products
from vibro_cli.kernels.table.world import POLYGON, Ball, BounceRow, Edge, Meeting, WallData, World
from vibro_cli.kernels.world import BodyData

MOST_STEPS = 200
# Once steps of t are below this, one that is not less than half the last shows only rounding.
SETTLED = 1.0e-6
# A step below this is taken along the tangent, with an error of its square.
STRAIGHT = 1.0e-10
# A velocity component across a wall below this share of the speed is rounding, not approach. The
# speed is the greatest in the last impact, since at k = 0 little of it may be left.
RESOLVED = 4.0 * EPSILON
# Below this square of its speed (m^2/s^2) a ball counts as at rest: lesser ones lose digits.
SLOWEST = 1.0e-290


@kernel
def meet_wall(world: World, body: BodyData, ball: Ball, x: float, y: float, to: Meeting) -> float:
    """Return the time (s) until a ball at (x, y) meets the wall, or NEVER.

    ``ball`` has the velocity; ``to`` receives the centre at the contact, the normal, and the side,
    or -1 on a curve.
    """
    to.other = -1
    wall = world.wall[0]
    square = ball.vx * ball.vx + ball.vy * ball.vy
    if square < SLOWEST:
        return NEVER
    if wall.kind != POLYGON:
        speed = math.sqrt(square)
        least = RESOLVED * ball.fastest / speed
        way = _meet_curve(wall, body.radius, x, y, ball.vx / speed, ball.vy / speed, least, to)
        return way / speed if way < NEVER else NEVER
    best = NEVER
    sides = len(world.edges)
    for index in range(sides):
        edge = world.edges[index]
        before = world.edges[index - 1 if index > 0 else sides - 1]
        time = _meet_edge(world, index, body.radius, ball, x, y, best, to)
        # The normal at a corner lies between those of its two sides: a ball that approaches neither
        # side, such as one that rolled along one, cannot meet it. A particle meets a side instead.
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
    """Return the distance along the unit vector u to the contact, or NEVER if none is ahead.

    From outside, there is no contact unless the component of u across the wall exceeds ``least``.
    """
    px = x - wall.x
    py = y - wall.y
    if wall.a == wall.b:
        return _meet_circle(wall, wall.a - wall.side * radius, px, py, ux, uy, least, to)
    # Normals lie within a quarter turn of f: +u inside, -u outside. t = tan(half the angle to f).
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
        # By rounding the ball is beyond the wall: the contact is where the ball is, not where it
        # crossed the wall, which may be far behind along the wall.
        cx, cy, nx, ny = _contact(wall, offset, px, py, nx, ny)
    _note(to, wall.x + cx, wall.y + cy, wall.side * nx, wall.side * ny)
    return max(ahead, 0.0)


@kernel
def _contact(
    wall: WallData, offset: float, px: float, py: float, fx: float, fy: float
) -> tuple[float, float, float, float]:
    """Return the centre of a touching ball and the normal, where the line through p along f leaves.

    It leaves the region that the centres of touching balls enclose.
    """
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
            turn = away * (1.0 / turning)  # the division need not wait for `away`
            step = -0.5 * (1.0 + t * t) * turn
        size = abs(step)
        if size <= STRAIGHT:
            slip = away * ((1.0 + t * t) / (1.0 - t * t))
            return cx + slip * ny, cy - slip * nx, nx + turn * ny, ny - turn * nx
        if last < SETTLED and size >= 0.5 * last:
            return cx, cy, nx, ny  # the rounding of the distance allows no more accuracy
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
    """Return the centre of a touching ball, the normal, and how fast the centre leaves the line.

    This is the derivative of the distance from a line along f with respect to the angle of the
    normal. At t = 0, where f is the normal, it is the offset curve's radius of curvature.
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
    """Return the angle (rad) by which the normal at a contact turns per metre of the centre's way.

    The normal points towards the wall; about a corner the centre moves on a circle of radius r.
    """
    wall = world.wall[0]
    radius = world.bodies[row.ball].radius
    if row.edge < 0:
        fx, fy = wall.side * row.normal_x, wall.side * row.normal_y
        _, _, _, _, curvature_radius = touch_curve(wall, wall.side * radius, fx, fy, 0.0)
        return wall.side / curvature_radius
    edge = world.edges[row.edge]
    if row.normal_x == edge.normal_x and row.normal_y == edge.normal_y:
        return 0.0
    return -1.0 / radius


@kernel
def _note(to: Meeting, x: float, y: float, nx: float, ny: float) -> None:
    """Store the centre at a contact, and the normal to the wall."""
    to.x = x
    to.y = y
    to.normal_x = nx
    to.normal_y = ny


@kernel
def _crosses(wall: WallData, offset: float, px: float, py: float, fx: float, fy: float) -> bool:
    """Return whether the line through p along f crosses the region that the offset curve encloses.

    In it the ball touches or overlaps the wall.
    """
    first_x, first_y, _, _, _ = touch_curve(wall, offset, fx, fy, -1.0)
    last_x, last_y, _, _, _ = touch_curve(wall, offset, fx, fy, 1.0)
    first = fx * (first_y - py) - fy * (first_x - px)
    last = fx * (last_y - py) - fy * (last_x - px)
    return first < 0.0 and last > 0.0


@kernel
def _first_guess(
    wall: WallData, offset: float, px: float, py: float, fx: float, fy: float
) -> float:
    """Return a first guess of t, from the ellipse with semi-axes shorter (outside: longer) by r."""
    a = wall.a - offset
    b = wall.b - offset
    x, y = _left_at(a, b, px, py, fx, fy)
    # The angle from both components, since the length of f is 1 only up to rounding.
    dot = fx * x / a + fy * y / b
    cross = fx * y / b - fy * x / a
    if dot <= 0.0:
        return 0.0
    return cross / (dot + math.sqrt(dot * dot + cross * cross))


@kernel
def _left_at(a: float, b: float, px: float, py: float, fx: float, fy: float) -> tuple[float, float]:
    """Return the point where the line through p along f leaves an ellipse, in its semi-axes."""
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
    """Return the same as ``_meet_curve`` for a circle; touching centres are at distance rho."""
    # The length of u has the rounding of the speed, the same after every bounce, which would turn
    # all chords alike.
    excess = (ux * ux - 0.5) + (uy * uy - 0.5)
    ux -= 0.5 * excess * ux
    uy -= 0.5 * excess * uy
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
    """Return the speed (m/s) at which a ball approaches the line of a side, 0 if it is rounding."""
    closing = ball.vx * edge.normal_x + ball.vy * edge.normal_y
    return closing if closing > RESOLVED * ball.fastest else 0.0


@kernel
def _meet_edge(
    world: World, index: int, r: float, ball: Ball, x: float, y: float, best: float, to: Meeting
) -> float:
    """Return the time (s) until a straight side is met, and store the contact; else ``best``.

    ``best`` is the time of an earlier contact.
    """
    edge = world.edges[index]
    closing = _approach_to(edge, ball)
    if closing == 0.0:
        return best
    after = world.edges[index + 1 if index + 1 < len(world.edges) else 0]
    vx, vy = ball.vx, ball.vy
    distance = _way_to(edge, r, x, y)
    time = max(distance / closing, 0.0)
    if time >= best:
        return best
    place = (x - edge.x + time * vx) * edge.along_x + (y - edge.y + time * vy) * edge.along_y
    start, end = place + edge.open_start, edge.length + edge.open_end - place
    if r == 0.0:
        # Decide by the corners themselves, so that both sides of a corner agree on how a particle
        # passes it.
        turn = edge.normal_x * edge.along_y - edge.normal_y * edge.along_x
        start = turn * _beside(edge, ball, x, y) if edge.corner == 1 else start
        end = -turn * _beside(after, ball, x, y) if after.corner == 1 else end
    if start < 0.0 or end < 0.0:
        return best
    if distance < 0.0 and -distance > 1.0e-9 * (edge.length + r):
        return best  # the ball is behind this side
    if distance < 0.0:
        before = world.edges[index - 1 if index > 0 else len(world.edges) - 1]
        if edge.corner == 1 and _leaves(before, r, ball, x, y, distance):
            return best
        if after.corner == 1 and _leaves(after, r, ball, x, y, distance):
            return best
    centre_x = edge.x + place * edge.along_x - r * edge.normal_x
    centre_y = edge.y + place * edge.along_y - r * edge.normal_y
    _note(to, centre_x, centre_y, edge.normal_x, edge.normal_y)
    return time


@kernel
def _way_to(edge: Edge, r: float, x: float, y: float) -> float:
    """Return the distance (m) of a ball from the line of a side, negative beyond it."""
    return (edge.x - x) * edge.normal_x + (edge.y - y) * edge.normal_y - r


@kernel
def _leaves(edge: Edge, r: float, ball: Ball, x: float, y: float, distance: float) -> bool:
    """Return whether a ball comes from one side of a corner that points at it, not the other.

    It is at the ``distance`` from the other side, beyond its line.
    """
    return _approach_to(edge, ball) == 0.0 and _way_to(edge, r, x, y) > distance


@kernel
def _beside(edge: Edge, ball: Ball, x: float, y: float) -> float:
    """Return a number that is positive if a side's first corner is to the right of a ball's path.

    It is negative if the corner is to the left.
    """
    return (edge.x - x) * ball.vy - (edge.y - y) * ball.vx


@kernel
def _meet_corner(
    edge: Edge, radius: float, ball: Ball, x: float, y: float, best: float, to: Meeting
) -> float:
    """Return the same as ``_meet_edge`` for a side's first corner, met at distance r."""
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
    """Return the time (s from now) when ``|d + w t|`` falls to a distance D, or NEVER.

    This is the root of ``w^2 t^2 + 2 d w t + c``, ``c = d^2 - D^2``, where the distance decreases.
    Without cancellation ``t = c/(root - d w)``, ``root^2 = (|w| D - |d x w|)(|w| D + |d x w|)``.
    An approach slower than ``rounding`` (m/s) counts as none.
    """
    closing = dx * wx + dy * wy
    if closing >= 0.0:  # half of all pairs, excluded without a square root
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
    # If the distance is greater then than now, ``root`` is only rounding: they pass each other.
    return time if time * square <= -2.0 * closing else NEVER


@kernel
def touching_distance(world: World, a: int, b: int) -> float:
    """Return the horizontal distance (m) between the centres of two touching balls."""
    radius_a = world.bodies[a].radius
    radius_b = world.bodies[b].radius
    if radius_a == radius_b:
        return 2.0 * radius_a
    return 2.0 * math.sqrt(radius_a * radius_b)
