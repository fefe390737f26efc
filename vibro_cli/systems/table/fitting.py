"""Which balls fit a wall, and where they are free of it: said of scenarios, never while solving."""

from __future__ import annotations

import math

from vibro_cli.systems.table.system import CIRCLE, POLYGON, Point, Wall


def largest_radius(wall: Wall) -> float:
    """Return the radius (m) up to which balls touch a wall at one place at a time.

    Inside an ellipse the least radius of curvature, b^2/a; a greater ball would touch it at both
    sides of an end of the long axis. Elsewhere every radius, if there is room.
    """
    if wall.shape == POLYGON or not wall.inside:
        return math.inf
    a, b = max(wall.semi_axes), min(wall.semi_axes)
    return a if wall.shape == CIRCLE else b * b / a


def rounding(wall: Wall, place: Point) -> float:
    """Return what of a distance from the wall (m) may be rounding."""
    sizes = [*wall.center, *wall.semi_axes, *place, *(x for corner in wall.corners for x in corner)]
    return 1e-14 * max(map(abs, sizes))


def distance_to_wall(wall: Wall, place: Point) -> float:
    """Return the distance (m) of a place from the wall, negative on the side without balls."""
    if wall.shape == POLYGON:
        distance = min(_to_side(place, *side) for side in _sides(wall))
        return distance if _is_within(wall, place) == wall.inside else -distance
    x, y = place[0] - wall.center[0], place[1] - wall.center[1]
    distance = _into_ellipse(*wall.semi_axes, abs(x), abs(y))
    return distance if wall.inside else -distance


def _sides(wall: Wall) -> list[tuple[Point, Point]]:
    return list(zip(wall.corners, wall.corners[1:] + wall.corners[:1], strict=True))


def _to_side(place: Point, start: Point, end: Point) -> float:
    dx, dy = end[0] - start[0], end[1] - start[1]
    share = ((place[0] - start[0]) * dx + (place[1] - start[1]) * dy) / (dx * dx + dy * dy)
    share = min(max(share, 0.0), 1.0)
    return math.hypot(start[0] + share * dx - place[0], start[1] + share * dy - place[1])


def _is_within(wall: Wall, place: Point) -> bool:
    """Whether a place is within a polygon: a ray from it crosses an odd number of sides."""
    within = False
    for (x, y), (ex, ey) in _sides(wall):
        if (y > place[1]) != (ey > place[1]):
            crossing = x + (place[1] - y) / (ey - y) * (ex - x)
            within ^= place[0] < crossing
    return within


def _into_ellipse(a: float, b: float, x: float, y: float) -> float:
    """Distance of a place in the first quadrant from an ellipse, positive within it.

    The nearest point ``(a^2 x/(s + a^2), b^2 y/(s + b^2))`` has the greatest root s of
    ``(a x/(s + a^2))^2 + (b y/(s + b^2))^2 = 1``, found by bisection.
    """
    if x == 0.0 and y == 0.0:
        return min(a, b)
    least = min(a, b) ** 2
    low, high = -least, a * math.hypot(x, y) + b * math.hypot(x, y)
    for _ in range(200):
        s = 0.5 * (low + high)
        if not low < s < high:
            break
        value = _term(a, x, s) + _term(b, y, s)
        low, high = (s, high) if value > 1.0 else (low, s)
    nearest_x, nearest_y = a * a * x / (high + a * a), b * b * y / (high + b * b)
    if high + least <= 1e-12 * least:  # the place is on the long axis near the middle
        nearest_x, nearest_y = _beside_axis(a, b, x, y)
    distance = math.hypot(nearest_x - x, nearest_y - y)
    return distance if (x / a) ** 2 + (y / b) ** 2 <= 1.0 else -distance


def _term(axis: float, place: float, s: float) -> float:
    return 0.0 if place == 0.0 else (axis * place / (s + axis * axis)) ** 2


def _beside_axis(a: float, b: float, x: float, y: float) -> Point:
    """Nearest point of the ellipse to a place on its long axis, nearer the centre than the foci."""
    if a >= b:
        nearest = a * a * x / (a * a - b * b) if a > b else 0.0
        return nearest, b * math.sqrt(max(1.0 - (nearest / a) ** 2, 0.0))
    nearest = b * b * y / (b * b - a * a)
    return a * math.sqrt(max(1.0 - (nearest / b) ** 2, 0.0)), nearest


def anticlockwise(corners: tuple[Point, ...]) -> tuple[Point, ...]:
    """Return the corners of a polygon in anticlockwise order, beginning with the same one."""
    if _area(corners) > 0.0:
        return corners
    return corners[:1] + corners[:0:-1]


def _area(corners: tuple[Point, ...]) -> float:
    following = corners[1:] + corners[:1]
    return 0.5 * sum(x * ey - ex * y for (x, y), (ex, ey) in zip(corners, following, strict=True))


def wrong_with_polygon(corners: tuple[Point, ...]) -> str:
    """Return why corners make no polygon, empty if they do."""
    count = len(corners)
    sides = [(corners[n], corners[(n + 1) % count]) for n in range(count)]
    for number, (start, end) in enumerate(sides, 1):
        if start == end:
            return f"corners {number} and {number % count + 1} at one place"
    for first in range(count):
        for second in range(first + 1, count):
            neighbours = second == first + 1 or (first == 0 and second == count - 1)
            if _meet(sides[first], sides[second], neighbours):
                return f"sides {first + 1} and {second + 1} that meet"
    return ""


def _meet(one: tuple[Point, Point], other: tuple[Point, Point], neighbours: bool) -> bool:
    """Whether two sides meet, neighbours elsewhere than at their common corner."""
    (p, q), (r, s) = one, other
    if neighbours:
        common, before, after = (q, p, s) if q == r else (p, q, r)
        turn = _turn(before, common, after)
        ahead = (common[0] - before[0]) * (after[0] - common[0])
        ahead += (common[1] - before[1]) * (after[1] - common[1])
        return turn == 0.0 and ahead <= 0.0
    splits = _turn(p, q, r) * _turn(p, q, s), _turn(r, s, p) * _turn(r, s, q)
    return splits[0] <= 0.0 and splits[1] <= 0.0


def _turn(p: Point, q: Point, r: Point) -> float:
    return (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])
