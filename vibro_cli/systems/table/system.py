"""The system of balls on a table with its wall, and the records of its event loop."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from vibro_cli.kernels.numerics.constants import NEVER
from vibro_cli.kernels.table.loop import advance
from vibro_cli.kernels.table.tangent import follow_balls
from vibro_cli.kernels.table.world import (
    CONIC,
    Ball,
    Clock,
    Edge,
    Meeting,
    Settings,
    Share,
    Touch,
    WallData,
    World,
)
from vibro_cli.kernels.table.world import POLYGON as POLYGON_KIND
from vibro_cli.mechanics.system import ImpactSystem
from vibro_cli.systems.driver import EventLoop, body_record, law_and_stops, records_of
from vibro_cli.systems.request import UNLIMITED, Limits

ELLIPSE = "ellipse"
CIRCLE = "circle"
POLYGON = "polygon"
_KINDS = {ELLIPSE: CONIC, CIRCLE: CONIC, POLYGON: POLYGON_KIND}
"""Kind of wall in the kernels, by shape."""

Point = tuple[float, float]


@dataclass(frozen=True)
class Wall:
    """A vertical wall; a ball touches it when its centre is one radius away."""

    shape: str
    """`ellipse` (axes along x and y), `circle` or `polygon`."""
    inside: bool
    """Whether the balls are inside."""
    restitution: float
    """k of the normal component of velocity."""
    centre: Point = (0.0, 0.0)
    """Centre of an ellipse or a circle (m)."""
    semi_axes: Point = (0.0, 0.0)
    """Semi-axes along x and y (m); equal for a circle, unused for a polygon."""
    corners: tuple[Point, ...] = ()
    """Corners of a polygon (m), in order around it."""
    named: str = ""
    """The scenario's name of the shape, if it differs."""

    @property
    def points(self) -> tuple[Point, ...]:
        """Points (m) that with the semi-axes around them bound the wall: its corners or centre."""
        return self.corners or (self.centre,)


@dataclass(frozen=True)
class InitialState:
    """Initial position (m) and velocity (m/s) of a ball."""

    place: Point
    velocity: Point


@dataclass(frozen=True)
class TableSystem(ImpactSystem):
    """Balls on a plane and everything their motion depends on."""

    initial: tuple[InitialState, ...]
    wall: Wall | None
    restitution: float
    """k of every pair."""

    def keeps_energy(self, clock: Mapping[str, Any]) -> bool:
        """Return whether energy was conserved by all impacts, of balls and on the wall."""
        kept = self.wall is None or self.wall.restitution == 1.0 or clock["bounces"] == 0
        if clock["collisions"] > 0:
            kept = kept and self.restitution == 1.0 and self.law_keeps_energy
        return bool(kept)


# Relative length by which sides extend beyond corners that no ball can touch, to leave no gap.
BEYOND = 1.0e-9

LOOP = EventLoop(
    advance=advance,
    follow=follow_balls,
    records=records_of(World),
    logs={"pair_log": "pair_rows", "bounce_log": "bounce_rows"},
    state=("clock", "balls", "meetings"),  # determine the tournament tree
    quiet_log=("bounce_log", "impacts on the wall"),
    other_stops={"stop_time": NEVER, "stop_bounces": UNLIMITED},
)


def make_world(system: TableSystem, limits: Limits) -> World:
    """Return the records of a system at the start, with empty logs."""
    settings = Settings()
    law_and_stops(settings, system, limits)
    settings.restitution = system.restitution
    settings.stop_time = NEVER if limits.time is None else limits.time
    settings.stop_bounces = UNLIMITED if limits.bounces is None else limits.bounces
    leaves = 2
    while leaves < len(system.bodies):
        leaves *= 2
    wall, edges = (WallData(), []) if system.wall is None else wall_records(system.wall)
    return World(
        clock=[Clock()],
        settings=[settings],
        wall=[wall],
        edges=edges,
        bodies=[body_record(body) for body in system.bodies],
        balls=initial_records(system)["balls"],
        meetings=[Meeting() for _ in system.bodies],
        tree=[leaves] * leaves,  # `leaves` stands for no ball
        partners=[-1] * len(system.bodies),
        stale=[0] * len(system.bodies),
        radii=[body.radius for body in system.bodies],
        **{name: [0.0] * len(system.bodies) for name in ("x", "y", "vx", "vy", "sifted")},
        touches=[Touch() for _ in range(most_touches(len(system.bodies)))],
        shares=[Share() for _ in system.bodies],
        group=[0] * len(system.bodies),
        pair_log=[],
        bounce_log=[],
    )


def initial_records(system: TableSystem) -> dict[str, Any]:
    """Return the records of the world that contain the initial state."""
    return {"balls": [_ball(state) for state in system.initial]}


def time_scale(system: TableSystem) -> float:
    """Return the time scale (s) of tangent maps.

    It is the time in which the initially fastest ball travels half the greater extent of the wall,
    or without a wall of the initial positions (1 m if all coincide). It is 1 s if no ball moves.
    """
    points, axes = tuple(state.place for state in system.initial), (0.0, 0.0)
    if system.wall is not None:
        points, axes = system.wall.points, system.wall.semi_axes
    half = max(
        axis + 0.5 * (max(values) - min(values))
        for axis, *values in zip(axes, *points, strict=True)
    )
    fastest = max(math.hypot(*state.velocity) for state in system.initial)
    return (half or 1.0) / fastest if fastest > 0.0 else 1.0


def most_touches(balls: int) -> int:
    """Return an upper bound of the number of pairs of balls that touch at once.

    In a packing of spheres of any radii the mean number of contacts of a sphere is below
    8 + 4 sqrt(3) (Kuperberg and Schramm 1994), so there are fewer than 7.5 pairs per ball.
    """
    return min(balls * (balls - 1) // 2, 8 * balls)


def _ball(start: InitialState) -> Ball:
    ball = Ball()
    ball.x, ball.y = start.place
    ball.vx, ball.vy = start.velocity
    ball.square = ball.vx * ball.vx + ball.vy * ball.vy
    ball.fastest = abs(ball.vx) + abs(ball.vy)
    return ball


def wall_records(wall: Wall) -> tuple[WallData, list[Edge]]:
    """Return the record of a wall, and those of its sides if it is a polygon."""
    data = WallData()
    data.kind = _KINDS[wall.shape]
    data.side = 1.0 if wall.inside else -1.0
    data.restitution = wall.restitution
    data.x, data.y = wall.centre
    data.a, data.b = wall.semi_axes
    if wall.shape != POLYGON:
        return data, []
    left = on_left(wall)
    edges = [_edge(*ends, left) for ends in _sides(wall.corners)]
    for before, edge in zip(edges[-1:] + edges[:-1], edges, strict=True):
        # A ball can touch only corners that point towards the balls.
        turn = before.along_x * edge.along_y - before.along_y * edge.along_x
        edge.corner = 1 if turn * left < 0.0 else 0
        if not edge.corner:
            before.open_end = BEYOND * before.length
            edge.open_start = BEYOND * edge.length
    return data, edges


def _edge(start: tuple[float, float], end: tuple[float, float], left: float) -> Edge:
    """Return the record of a polygon's side; the balls are on its left (`left` 1) or right (-1)."""
    edge = Edge()
    edge.x, edge.y = start
    dx, dy = end[0] - start[0], end[1] - start[1]
    edge.length = math.hypot(dx, dy)
    edge.along_x, edge.along_y = dx / edge.length, dy / edge.length
    edge.normal_x, edge.normal_y = left * edge.along_y, -left * edge.along_x
    return edge


def largest_radius(wall: Wall) -> float:
    """Return the radius (m) below which a ball touches a curved wall at one point at a time.

    Inside an ellipse it is the least radius of curvature, b^2/a: a larger ball would touch it on
    both sides of an end of the long axis. Otherwise any radius is allowed.
    """
    if wall.shape == POLYGON or not wall.inside:
        return math.inf
    a, b = max(wall.semi_axes), min(wall.semi_axes)
    return a if wall.shape == CIRCLE else b * b / a


def rounding(wall: Wall, place: Point) -> float:
    """Return the rounding error (m) that a distance from the wall may have."""
    sizes = [*wall.semi_axes, *place, *(x for point in wall.points for x in point)]
    return 1e-14 * max(map(abs, sizes))


def distance_to_wall(wall: Wall, place: Point) -> float:
    """Return the distance (m) of a point from the wall, negative on the side without balls."""
    if wall.shape == POLYGON:
        distance = min(_to_side(place, *side) for side in _sides(wall.corners))
        return distance if _is_within(wall, place) == wall.inside else -distance
    x, y = place[0] - wall.centre[0], place[1] - wall.centre[1]
    distance = _into_ellipse(*wall.semi_axes, abs(x), abs(y))
    return distance if wall.inside else -distance


def _sides(corners: tuple[Point, ...]) -> list[tuple[Point, Point]]:
    return list(zip(corners, corners[1:] + corners[:1], strict=True))


def _to_side(place: Point, start: Point, end: Point) -> float:
    dx, dy = end[0] - start[0], end[1] - start[1]
    share = ((place[0] - start[0]) * dx + (place[1] - start[1]) * dy) / (dx * dx + dy * dy)
    share = min(max(share, 0.0), 1.0)
    return math.hypot(start[0] + share * dx - place[0], start[1] + share * dy - place[1])


def _is_within(wall: Wall, place: Point) -> bool:
    """Return whether a point is within a polygon: a ray from it crosses an odd number of sides."""
    within = False
    for (x, y), (ex, ey) in _sides(wall.corners):
        if (y > place[1]) != (ey > place[1]):
            crossing = x + (place[1] - y) / (ey - y) * (ex - x)
            within ^= place[0] < crossing
    return within


def _into_ellipse(a: float, b: float, x: float, y: float) -> float:
    """Return the distance of a point in the first quadrant from an ellipse, positive inside.

    For a >= b the nearest point ``(a^2 x/(t + a^2 - b^2), b^2 y/t)`` has the greatest root t of
    ``(a x/(t + a^2 - b^2))^2 + (b y/t)^2 = 1``. The left side falls and is convex, so Newton's
    method increases t to the root from where one term alone is 1.
    """
    if a < b:
        a, b, x, y = b, a, y, x
    focal_square = (a - b) * (a + b)
    t = max(a * x - focal_square, b * y)
    if t > 1e-290:  # below, 1/t is infinite
        step = t
        while t + step > t:
            across, up = a * x / (t + focal_square), b * y / t
            fall = 2.0 * (across * across / (t + focal_square) + up * up / t)
            step = (across * across + up * up - 1.0) / fall
            t += step
        nearest_x, nearest_y = a * a * x / (t + focal_square), b * b * y / t
    else:  # the point is on the long axis, near the centre
        share = min(a * x / focal_square, 1.0) if focal_square > 0.0 else 0.0
        nearest_x, nearest_y = a * share, b * math.sqrt((1.0 - share) * (1.0 + share))
    distance = math.hypot(nearest_x - x, nearest_y - y)
    return distance if (x / a) ** 2 + (y / b) ** 2 <= 1.0 else -distance


def on_left(wall: Wall) -> float:
    """Return 1 if the balls are on the left when following a polygon's corners, else -1."""
    x, y = wall.corners[0]  # relative to it, the sign of the area is right far from the origin
    corners = tuple((px - x, py - y) for px, py in wall.corners)
    twice = sum(px * qy - qx * py for (px, py), (qx, qy) in _sides(corners))
    return math.copysign(1.0, twice if wall.inside else -twice)


def wrong_with_polygon(corners: tuple[Point, ...]) -> str:
    """Return why corners do not form a polygon, or an empty string if they do."""
    count = len(corners)
    sides = _sides(corners)
    for number, (start, end) in enumerate(sides, 1):
        if start == end:
            return f"corners {number} and {number % count + 1} at the same point"
    met = min(_meeting(sides), default=None)
    return "" if met is None else f"sides {met[0] + 1} and {met[1] + 1} that meet"


def _meeting(sides: Sequence[tuple[Point, Point]]) -> Iterator[tuple[int, int]]:
    """Yield the pairs of sides that meet, by a sweep along x."""
    left = [min(start[0], end[0]) for start, end in sides]
    order = sorted(range(len(sides)), key=left.__getitem__)
    for at, one in enumerate(order):
        right = max(sides[one][0][0], sides[one][1][0])
        for other in map(order.__getitem__, range(at + 1, len(order))):
            if left[other] > right:
                break  # the remaining sides lie even farther along x
            first, second = min(one, other), max(one, other)
            neighbours = second - first in (1, len(sides) - 1)
            if _meet(sides[first], sides[second], neighbours):
                yield first, second


def _meet(one: tuple[Point, Point], other: tuple[Point, Point], neighbours: bool) -> bool:
    """Return whether two sides meet; for neighbours, elsewhere than at their common corner."""
    (p, q), (r, s) = one, other
    if neighbours:
        common, before, after = (q, p, s) if q == r else (p, q, r)
        turn = _turn(before, common, after)
        ahead = (common[0] - before[0]) * (after[0] - common[0])
        ahead += (common[1] - before[1]) * (after[1] - common[1])
        return turn == 0.0 and ahead <= 0.0
    # Collinear sides, such as the tops of a U, meet only if their bounding boxes do.
    for axis in (0, 1):
        if max(p[axis], q[axis]) < min(r[axis], s[axis]):
            return False
        if max(r[axis], s[axis]) < min(p[axis], q[axis]):
            return False
    splits = _turn(p, q, r) * _turn(p, q, s), _turn(r, s, p) * _turn(r, s, q)
    return splits[0] <= 0.0 and splits[1] <= 0.0


def _turn(p: Point, q: Point, r: Point) -> float:
    return (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])
