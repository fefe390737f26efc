"""The world of the table: the structs and arrays that its event loop works on, and its logs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from vibro_cli.compile.kernel import struct
from vibro_cli.kernels.world import BodyData, Instant

# Kinds of a ball's next meeting.
NOTHING = 0
MEETS_WALL = 1
MEETS_BALL = 2

NO_WALL = 0
CONIC = 1  # an ellipse, or a circle
POLYGON = 2


@struct
class Ball:
    """The straight motion of one ball since its last event."""

    x: float  # centre at the instant t, m
    y: float
    vx: float  # m/s
    vy: float
    t: float  # in two doubles, s
    t_low: float
    square: float  # square of its speed, as the impact laws give it, m^2/s^2
    fastest: float  # greatest |vx| + |vy| before and after its last impact, m/s


@struct
class Meeting(Instant):
    """The next meeting of a ball: with the wall, or with a ball of greater index."""

    kind: int
    other: int  # the other ball, or the side of the wall, negative on a curve
    x: float  # centre of the ball at the wall, m
    y: float
    normal_x: float  # from the ball to the wall
    normal_y: float


@struct
class WallData:
    """Shape and properties of the wall."""

    kind: int
    side: float  # +1: the balls are inside, -1: outside
    x: float  # centre of a conic, m
    y: float
    a: float  # semi-axes, m
    b: float
    restitution: float


@struct
class Edge:
    """A straight side of a polygon from one corner to the next, with its first corner."""

    x: float  # m
    y: float
    along_x: float
    along_y: float
    normal_x: float  # away from the balls
    normal_y: float
    length: float
    corner: int  # 1: a ball can touch the corner itself
    open_start: float  # length beyond each end over which the side is also met, m
    open_end: float


@struct
class Touch:
    """Two balls that touch at the present instant, with the variables of their impulse."""

    a: int
    b: int
    normal_x: float  # from a to b
    normal_y: float
    weight_a: float  # of the law, see `kernels.impact.laws`
    weight_b: float
    response_a: float
    response_b: float
    diagonal: float
    approach: float  # the law's relative speed
    impulse: float  # in two doubles
    impulse_low: float
    best: float  # impulse with the smallest residual so far
    left: float  # residual, at first the right-hand side, in two doubles
    left_low: float
    direction: float  # search direction of the next step
    change: float  # of the relative speed in that direction, in two doubles
    change_low: float


@struct
class Share:
    """Change of a ball's velocity due to all impulses at the present instant."""

    place: int  # in the group, from 1; 0: not in the group
    x: float  # m/s, in two doubles
    x_low: float
    y: float
    y_low: float


@struct
class Clock(Instant):
    """The state of the run as a whole."""

    collisions: int
    bounces: int
    pair_rows: int
    bounce_rows: int
    stalled: int  # successive events without time between them
    group: int  # number of balls in the group that collides now
    energy_correction: float
    begun: int


@struct
class Settings:
    """Constants of the run."""

    law: int
    substitute: int
    restitution: float
    stop_time: float
    stop_collisions: int
    stop_bounces: int
    capacity: int


@struct
class PairRow(Instant):
    """One impact of two balls."""

    event: int  # number of the event, counting both kinds
    a: int
    b: int
    x_a: float
    y_a: float
    x_b: float
    y_b: float
    vx_a_pre: float
    vy_a_pre: float
    vx_b_pre: float
    vy_b_pre: float
    vx_a_post: float
    vy_a_post: float
    vx_b_post: float
    vy_b_post: float
    normal_x: float
    normal_y: float
    normal_a_pre: float  # components along the line of centres
    normal_b_pre: float
    normal_a_post: float
    normal_b_post: float
    loss: float
    gap: float
    restitution: float  # k of the impulse
    law: int
    admissible: int
    substituted: int
    simultaneous: int
    grazing: int


@struct
class BounceRow(Instant):
    """One impact of a ball on the wall."""

    event: int
    ball: int
    edge: int  # side of the wall, from 0; negative on a curve
    x: float
    y: float
    normal_x: float
    normal_y: float
    vx_pre: float
    vy_pre: float
    vx_post: float
    vy_post: float
    loss: float
    grazing: int


class World(NamedTuple):
    """All records of a run."""

    clock: Sequence[Clock]
    settings: Sequence[Settings]
    wall: Sequence[WallData]
    edges: Sequence[Edge]
    bodies: Sequence[BodyData]
    balls: Sequence[Ball]
    meetings: Sequence[Meeting]
    tree: list[int]  # tournament of the meetings: winners of the matches, root at 1
    partners: list[int]  # the ball that each ball meets next, or -1
    stale: list[int]  # balls whose meetings must be searched again
    radii: list[float]  # of the balls, m
    x: list[float]  # their centres at the present instant, m
    y: list[float]
    vx: list[float]  # m/s
    vy: list[float]
    sifted: list[float]  # for each other ball, a bound of the time to contact, or 0 if it touches
    touches: Sequence[Touch]
    shares: Sequence[Share]
    group: list[int]  # balls that touch one another now
    pair_log: Sequence[PairRow]
    bounce_log: Sequence[BounceRow]
