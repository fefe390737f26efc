"""From the system to the records of the event loop."""

from __future__ import annotations

import math

from vibro_cli.kernels.impact.laws import LAW_NAMES
from vibro_cli.kernels.structs import BodyData
from vibro_cli.kernels.table.loop import advance
from vibro_cli.kernels.table.world import (
    CONIC,
    END_INTERRUPTED,
    END_NAMES,
    END_TIME,
    LOG_FULL,
    LOGS,
    NEVER,
    NO_WALL,
    POLYGON,
    RECORDS,
    STATE,
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
from vibro_cli.mechanics.body_record import body_record
from vibro_cli.systems.driver import EventLoop
from vibro_cli.systems.table.system import POLYGON as POLYGON_SHAPE
from vibro_cli.systems.table.system import TableSystem, Wall

# A side ends in a corner that no ball can touch; met a little beyond, it has no way through there.
BEYOND = 1.0e-9
UNLIMITED = 2**62

LOOP = EventLoop(
    advance=advance,
    records=RECORDS,
    logs=LOGS,
    state=STATE,
    end_names=END_NAMES,
    end_time=END_TIME,
    end_interrupted=END_INTERRUPTED,
    log_full=LOG_FULL,
    rows_of_event=8,
)


def make_world(
    system: TableSystem,
    stop_time: float | None,
    stop_collisions: int | None,
    stop_bounces: int | None,
) -> World:
    """Return the records of a system at the start, with empty logs."""
    settings = Settings()
    settings.law = LAW_NAMES.index(system.law)
    settings.substitute = 1 if system.inadmissible == "normal-impulse" else 0
    settings.restitution = system.restitution
    settings.stop_time = NEVER if stop_time is None else stop_time
    settings.stop_collisions = UNLIMITED if stop_collisions is None else stop_collisions
    settings.stop_bounces = UNLIMITED if stop_bounces is None else stop_bounces
    leaves = 2
    while leaves < len(system.bodies):
        leaves *= 2
    settings.leaves = leaves
    wall = WallData()
    edges: list[Edge] = []
    if system.wall is not None:
        wall, edges = wall_records(system.wall)
    bodies: list[BodyData] = [body_record(body) for body in system.bodies]
    return World(
        clock=[Clock()],
        settings=[settings],
        wall=[wall],
        edges=edges,
        bodies=bodies,
        balls=[_ball(state.place, state.velocity) for state in system.initial],
        meetings=[Meeting() for _ in system.bodies],
        tree=[leaves] * leaves,  # no ball where none has played
        touches=[Touch() for _ in range(most_touches(len(system.bodies)))],
        shares=[Share() for _ in system.bodies],
        group=[0] * max(len(system.bodies), 2),
        pair_log=[],
        bounce_log=[],
    )


def most_touches(balls: int) -> int:
    """Return how many pairs of balls can touch at once.

    The mean number of spheres that touch one of a packing, whatever their radii, is below
    8 + 4 sqrt(3) (Kuperberg and Schramm 1994), so there are fewer than 7.5 pairs for each.
    """
    return max(1, min(balls * (balls - 1) // 2, 8 * balls))


def _ball(place: tuple[float, float], velocity: tuple[float, float]) -> Ball:
    ball = Ball()
    ball.x, ball.y = place
    ball.vx, ball.vy = velocity
    ball.square = ball.vx * ball.vx + ball.vy * ball.vy
    return ball


def wall_records(wall: Wall) -> tuple[WallData, list[Edge]]:
    """Return the wall as a whole, and its sides if it is a polygon."""
    data = WallData()
    data.kind = NO_WALL if wall is None else CONIC
    data.side = 1.0 if wall.inside else -1.0
    data.restitution = wall.restitution
    data.x, data.y = wall.center
    data.a, data.b = wall.semi_axes
    if wall.shape != POLYGON_SHAPE:
        return data, []
    data.kind = POLYGON
    corners = wall.corners
    count = len(corners)
    edges = [_edge(corners[n], corners[(n + 1) % count], data.side) for n in range(count)]
    for before, edge in zip(edges[-1:] + edges[:-1], edges, strict=True):
        # The corners that a ball can touch are those that point at it.
        turn = before.along_x * edge.along_y - before.along_y * edge.along_x
        edge.corner = 1 if turn * data.side < 0.0 else 0
        if not edge.corner:
            before.open_end = BEYOND * before.length
            edge.open_start = BEYOND * edge.length
    return data, edges


def _edge(start: tuple[float, float], end: tuple[float, float], side: float) -> Edge:
    """A side of a polygon whose corners go round anticlockwise; the balls are on ``side``."""
    edge = Edge()
    edge.x, edge.y = start
    dx, dy = end[0] - start[0], end[1] - start[1]
    edge.length = math.hypot(dx, dy)
    edge.along_x, edge.along_y = dx / edge.length, dy / edge.length
    edge.normal_x, edge.normal_y = side * edge.along_y, -side * edge.along_x
    return edge
