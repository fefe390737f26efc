"""Structs that the kernels work on: pieces, bodies, flights, pairs and logs, in one ``World``.

Half-angle variables. On an arc the position of a body is ``(S, C) = (sin f/2, cos f/2)`` and its
motion ``P = f'/(2w)`` with ``w^2 = g/(kappa rho)``. In a valley ``f = phi``; on a hump
``f = psi + pi``, where ``C = -sin(psi/2)`` keeps its relative accuracy at the crest.
``S^2 + C^2 = 1``, and the parameter ``m = S^2 + P^2`` measures the energy. On a line ``S`` is the
distance from the line's left end, ``P`` the speed and ``C`` is unused. The speed of the centre is
``v = speed_factor P`` on every piece.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from vibro_cli.compile.kernel import Series, kernel, struct
from vibro_cli.kernels.numerics.elliptic import QuarticConstants
from vibro_cli.kernels.numerics.tridiagonal import ChainRow

PARTING = 1  # separating after an impact, with a speed
RELEASED = 2  # separating after lasting contact, with zero relative speed and acceleration
CLOSING = 3  # in contact and approaching: an impact follows at once, whatever the rounded gap

State = tuple[float, float, float]  # (S, C, P) of a body
States = tuple[float, float, float, float, float, float]  # (S, C, P) of both bodies of a pair


@struct
class Instant:
    """A time in two doubles, s."""

    t: float
    t_low: float


@struct
class PieceData:
    """One piece of the trace."""

    sign: float  # +1 valley, -1 hump, 0 line
    x: float  # centre of the arc; left end of a line, m
    y: float
    tangent_x: float  # of a line
    tangent_y: float
    length: float  # m
    radius: float  # R, m; 0 on a line
    start_s: float  # arc length of the left end, m
    angle_start: float  # phi or psi of the ends, rad; on a line their distance from the left end, m
    angle_end: float
    turn: float  # whole turns by which phi or psi differs from the angle of S and C, rad


@struct
class TrackData:
    """One body on one piece: the path of its centre."""

    path_radius: float  # rho, m; 0 on a line
    frequency: float  # w, rad/s; 0 on a line
    speed_factor: float  # v = speed_factor P
    bottom: float  # height of the centre at f = 0 above its lowest position, m; line: left end
    top: float  # at f = pi; line: unused
    twice_radius: float  # 2 rho, m: energy/(m g) = bottom + twice_radius * parameter; line: unused
    gravity_rate: float  # g/kappa, m/s^2; rotating trace: bound on the tangential acceleration
    line_acceleration: float  # -(g/kappa) sin(alpha), m/s^2
    line_rise: float  # sin(alpha) of a line
    left_s: float  # the ends, as (S, C) or distance
    left_c: float
    right_s: float
    right_c: float
    lowest_s2: float  # extremes of S^2 over the piece
    highest_s2: float
    line_x: float  # centre of the body at the left end of a line, m
    line_y: float
    tilt: float  # rotating trace, see kernels.flow.rotating_flow: sign Omega^2 (O_x - x0)/g
    spread: float  # Omega^2 rho/g
    line_growth: float  # line: Omega cos(alpha)/sqrt(kappa), 1/s
    line_normal: float  # N/(m g) at the left end of a line
    line_normal_growth: float  # its derivative along the line, 1/m
    lowest_potential: float  # least value of V on an arc
    most_angular: float  # bounds on an arc: |f''| (rad/s^2) and its first two derivatives in f
    most_stiffness: float
    most_bending: float
    steepest: float  # greatest rate at which f'' falls with f on an arc, 1/s^2
    crests: int  # number of maxima of V inside an arc, then (S, C) of each
    crest_s: float
    crest_c: float
    other_crest_s: float
    other_crest_c: float
    highest_potential: float  # greatest value of V on the full circle
    top_s: float  # (S, C) where that is, and where the least maximum of V on the full circle is
    top_c: float
    pass_s: float
    pass_c: float
    extremes: Series  # (S, C) of the extremes of the normal force inside an arc
    extreme_count: int
    least_normal: float  # least sign N/(m g) on an arc at P^2 = -V
    least_still: float  # and at P = 0


@struct
class BodyData:
    """One body."""

    radius: float  # m
    kappa: float  # 1 + J_C/(m r^2)
    mass: float  # kg
    rolling_mass: float  # M = kappa m, kg
    weight: float  # m g, N


@struct
class Flight(QuarticConstants):
    """The motion of one body between two of its events, and its state at the start."""

    piece: int
    winding_number: int  # laps of a closed trace so far
    t: float  # start, in two doubles, s
    t_low: float
    s: float  # (S, C, P) at the start
    c: float
    p: float
    before_s: float  # (S, C, P) at the end of the flight before this one, on its piece
    before_c: float
    before_p: float
    flow_s: float  # start of the flow: state of the body, or of its group's pendulum
    flow_c: float
    flow_p: float
    grouped: int  # 1: rolls in lasting contact with a neighbour
    group_first: int  # leftmost body of its group
    group_count: int  # number of bodies in the group
    shift_s: float  # sine and cosine of half the angle from the group's pendulum to the body
    shift_c: float
    rate_ratio: float  # P of the body over P of the group
    frequency: float  # w of the flow, rad/s; 0 on a line
    own_frequency: float  # w of the body alone on this piece
    at_rest: int  # 1: in equilibrium
    wall_side: int  # +1, -1: at rest against the wall on the right or left, else 0
    pressing: int  # scratch of an instant: contact with a wall, see kernels.impact.chattering
    impacts: int  # rounds of impacts of its chain at the instant when its flight began
    fastest: float  # scale (m/s) of the greatest speeds in its chain at that instant
    brief: float  # time (s) in which a body falls from rest by no more than rounding
    size: float  # length of the trace (m), the scale of rounding of positions on lines
    line_acceleration: float
    specific_energy: float  # energy/(m g), m above the body's lowest place
    separatrix_piece: int  # piece whose crest the energy is measured from, or -1
    separatrix_root: float  # complementary_modulus on that piece; saddle_root if it rotates
    exit_after: float  # time from the start to the end of the flight, s
    exit_side: int  # +1 right end, -1 left end, 0 none
    exit_kind: int  # BOUNDARY or LIFT_OFF
    exit_p: float  # P at the exit
    exit_t: float  # instant of the exit, in two doubles
    exit_t_low: float
    angular_bound: float  # bounds on the second (rad/s^2) and third (rad/s^3) derivative of f
    jerk_bound: float
    acceleration_bound: float  # bound on the acceleration of the centre, m/s^2
    speed: float  # scratch of an instant: speed of the centre, m/s
    half_curvature: float  # 1/(2 rho), 0 on a line
    segment: float  # duration of a segment across pieces, s
    series: Series  # tangential acceleration on that segment, in powers of t/segment (m/s^2)
    nodal: Series  # scratch: acceleration at the collocation nodes
    normal: Series  # normal force on that segment (N), for one-sided traces
    tilt: float  # rotating trace: coefficients of the torque, see rotating_flow.torque_of
    spread: float
    twist: float  # of a group; 0 for a body alone
    line_growth: float
    crests: int
    saddle_s: float  # the saddle that the energy is next to
    saddle_c: float
    # sign(V - E) sqrt|V - E| with V there, on a line in m/s; NEVER if E follows from the state
    saddle_root: float
    origin_s: float  # place from which the angles of the motion on an arc are measured
    origin_c: float
    nearest: float  # u of the place nearest to the saddle, where the motion starts, or 0
    lead: float  # time, times w, from the start of the motion to that of the flight
    most_speed: float  # bound on the speed of the centre, m/s
    steepest: float  # greatest rate at which f'' falls with f on its arc (1/s^2)
    snap_bound: float  # bound on the fourth derivative of f (rad/s^4), on any trace


@struct
class PairData(ChainRow):
    """Two neighbours, ``a`` left of ``b``.

    Across the seam of a closed trace ``a`` is the last body.
    """

    a: int
    b: int
    seam: int  # 1: b is one lap ahead
    restitution: float
    law: int  # of its last impact
    distance: float  # r_a + r_b, m
    begin_t: float  # when the later of the two flights began (two doubles)
    begin_t_low: float
    touching: int  # in contact at that instant: PARTING, RELEASED or CLOSING, else 0
    searched: float  # proved free of contact for this long since then: end of a search step, s
    held: int  # 1: in lasting contact
    logged: int  # state that was logged last: 1 closed, 0 open
    change_t: float  # when ``held`` last changed (two doubles)
    change_t_low: float
    delay: float  # time from then to the end of the accumulation, s
    closing_loss: float  # energy lost by equalising speeds when it last closed or continued, J
    struck: float  # approach speed (m/s) at this instant if it alone moved in its chain, or 0
    release_t: float  # when the contact force changes sign, or NEVER (two doubles)
    release_t_low: float
    contact_t: float  # first contact, or NEVER
    contact_t_low: float
    a_s: float  # (S, C, P) of both bodies there
    a_c: float
    a_p: float
    b_s: float
    b_c: float
    b_p: float
    apart: int  # 1: proved that the two flights never meet
    normal_a: float  # scratch of an instant: n t of both bodies
    normal_b: float
    closing: (
        int  # scratch of an instant: the next ``touching``; 1: takes part in a simultaneous impact
    )
    pressing: int  # scratch of an instant: see kernels.impact.chattering
    series: Series  # contact force on a segment across pieces, in powers of t/segment (N)
    nodal: Series  # scratch: force at the nodes; the first also energy (J) lost on closing


@struct
class BodyForces:
    """Forces of the trace on one body (scratch, see ``kernels.cluster.trace_forces``)."""

    x: float  # centre, m
    y: float
    sine: float  # sine and cosine of the slope
    cosine: float
    bend: float  # v^2/rho, positive in a valley, m/s^2
    acceleration: float  # along the path, m/s^2
    normal: float  # N
    friction: float
    start_normal: float  # at the start and the end of a motion
    start_friction: float
    end_normal: float
    end_friction: float
    normal_terms: Series  # normal force (N): coefficients, or values on a segment (note_forces)
    friction_terms: Series  # friction (N) with its sign, likewise


@struct
class PairTrack:
    """Constants of the contact of two neighbours on the same piece."""

    sine: float  # sin(beta/2), cos(beta/2); on a line the distance along it at contact, m
    cosine: float
    far_gap: float  # pi - beta
    normal_a: float  # n t_a, n t_b in contact
    normal_b: float


@struct
class Settings:
    """Constants of the whole run."""

    gravity: float
    bodies: int
    pieces: int
    pairs: int
    closed: int
    closing_error: float  # m: how far the end of a closed trace is from its start
    one_sided: int
    law: int
    substitute: int  # 1: an inadmissible impact is replaced by the normal-impulse law
    left_wall: float  # restitution, or -1 for a stop
    right_wall: float
    axis_x: float  # x of the axis of rotation, m
    turning_square: float  # square of the rate of rotation, 1/s^2; 0 for a trace at rest
    stop_t: float
    stop_collisions: int
    capacity: int  # rows of a log that may be filled; the logs hold twice as many
    keep_rows: int  # 0: the rows of a full log are dropped


@struct
class Clock(Instant):
    """The state of the run as a whole."""

    collisions: int
    crossings: int
    contacts: int
    held_pairs: int  # pairs in lasting contact now
    unlogged: int  # 1: some contact may have changed since it was logged
    last_ball: int  # body of the last boundary event
    quiet_from: float
    energy_correction: float  # sum of |corrections|, J
    impact_rows: int  # rows used in the logs
    flight_rows: int
    contact_rows: int
    segment_rows: int
    flights_before: int  # flight rows handed over so far
    searches: int  # counts of work done, for the benchmark and -v
    evaluations: int
    skipped_apart: int


# Why a flight began.
START = 0
COLLISION = 1
CROSSING = 2
WALL = 3
CONTACT_CLOSED = 4
CONTACT_OPENED = 5
SEGMENT = 6  # the next segment of a motion across pieces, or a relaunch after a change beside it
CAUSE_NAMES = (
    "start",
    "collision",
    "crossing",
    "wall",
    "contact_closed",
    "contact_opened",
    "segment",
)

# Most rows that one event adds to a log, for each body.
ROWS_OF_EVENT = 8

# Why the event loop of any system returned; all but RUNNING and LOG_FULL are end causes.
RUNNING = 0
END_TIME = 1
END_COLLISIONS = 2
END_NO_MORE_COLLISIONS = 3
END_INADMISSIBLE = 4
END_OF_TRACE = 5
END_LIFT_OFF = 6
END_REST = 7
LOG_FULL = 8
END_INTERRUPTED = 9  # from outside
END_BOUNCES = 10
END_WALL_CONTACT = 11
END_ACCUMULATION = 12
END_QUIET = 13  # the run is refused
END_NAMES = {
    END_TIME: "time",
    END_COLLISIONS: "collisions",
    END_NO_MORE_COLLISIONS: "no_more_collisions",
    END_INADMISSIBLE: "inadmissible",
    END_OF_TRACE: "end_of_trace",
    END_LIFT_OFF: "lift_off",
    END_REST: "rest",
    END_INTERRUPTED: "interrupted",
    END_BOUNCES: "bounces",
    END_WALL_CONTACT: "wall_contact",
    END_ACCUMULATION: "accumulation",
}


@struct
class ImpactRow(Instant):
    """One impact, in the variables of the kernels."""

    pair: int
    a: int
    b: int
    piece_a: int
    piece_b: int
    a_s: float
    a_c: float
    b_s: float
    b_c: float
    speed_a_pre: float
    speed_b_pre: float
    speed_a_post: float
    speed_b_post: float
    normal_a: float
    normal_b: float
    specific_energy_a_pre: float
    specific_energy_b_pre: float
    specific_energy_a_post: float
    specific_energy_b_post: float
    loss: float
    law: int
    admissible: int
    substituted: int
    simultaneous: int
    contact: int


@struct
class FlightRow(Instant):
    """The start of one flight."""

    body: int
    piece: int
    s: float
    c: float
    p: float
    before_s: float  # at the end of the body's flight before this one
    before_c: float
    before_p: float
    parameter: float
    complementary_modulus: float
    specific_energy: float
    saddle_root: float  # see Flight
    cause: int
    at_rest: int
    flow_s: float
    flow_c: float
    flow_p: float
    grouped: int
    group_first: int
    group_count: int
    shift_s: float
    shift_c: float
    rate_ratio: float
    frequency: float
    line_acceleration: float
    segment: float


@struct
class SegmentRow:
    """The motion of one body on a segment across pieces, which belongs to a flight row."""

    flight: int  # number of that row, counted over the whole run
    series: Series


@struct
class ContactRow(Instant):
    """A lasting contact that closes or opens."""

    delay: float  # time from the last impact to the end of the accumulation, s
    a: int
    b: int
    opened: int
    piece_a: int
    piece_b: int
    s: float  # state of a when the accumulation ends
    c: float
    p: float


class World(NamedTuple):
    """All data of one run: lists of records or structured arrays."""

    settings: Sequence[Settings]  # one
    clock: Sequence[Clock]  # one
    bodies: Sequence[BodyData]
    pieces: Sequence[PieceData]
    tracks: Sequence[TrackData]  # body by body
    pairs: Sequence[PairData]
    contacts: Sequence[PairTrack]  # pair by pair
    meeting: list[list[int]]  # meeting[pair * pieces + piece of a][piece of b]: 0 never in contact
    flights: Sequence[Flight]
    forces: Sequence[BodyForces]  # scratch: one for each body of a group, the last for a body alone
    impacts: Sequence[ImpactRow]
    log: Sequence[FlightRow]
    touches: Sequence[ContactRow]
    segments: Sequence[SegmentRow]


@kernel
def track_on(world: World, ball: int, piece: int) -> TrackData:
    """Return the path of a body's centre on a piece."""
    return world.tracks[ball * world.settings[0].pieces + piece]


@kernel
def track_of(world: World, ball: int) -> TrackData:
    """Return the path of a body's centre on the piece of its flight."""
    return track_on(world, ball, world.flights[ball].piece)


@kernel
def flights_of(world: World, pair: PairData) -> tuple[Flight, Flight]:
    """Return the flights of both bodies of a pair."""
    return world.flights[pair.a], world.flights[pair.b]


@kernel
def tracks_of(world: World, pair: PairData) -> tuple[TrackData, TrackData]:
    """Return the paths of both bodies of a pair on the pieces of their flights."""
    return track_of(world, pair.a), track_of(world, pair.b)


@kernel
def contact_of(world: World, j: int) -> PairTrack:
    """Return the constants of contact of a pair on the piece of its left body."""
    pieces = world.settings[0].pieces
    return world.contacts[j * pieces + world.flights[world.pairs[j].a].piece]


@kernel
def drop_rows(clock: Clock) -> None:
    """Drop the rows of logs that are not kept."""
    clock.flights_before += clock.flight_rows
    clock.impact_rows = 0
    clock.flight_rows = 0
    clock.contact_rows = 0
    clock.segment_rows = 0


@kernel
def is_now(world: World, t: float, t_low: float) -> bool:
    """Return whether an instant (two doubles, s) is the present one."""
    return t == world.clock[0].t and t_low == world.clock[0].t_low


@kernel
def number_along(world: World, first: int, step: int) -> int:
    """Return the number of a body of a chain, which is also that of its pair to the right."""
    return (first + step) % world.settings[0].bodies


@kernel
def pair_beside(world: World, first: int, step: int) -> int:
    """Return the number of the pair ``step`` places along, or -1 beyond an end of the trace."""
    settings = world.settings[0]
    number = first + step
    if settings.closed == 1:
        number %= settings.bodies
    return number if 0 <= number < settings.pairs else -1


@kernel
def flight_along(world: World, first: int, step: int) -> Flight:
    """Return the flight of the body ``step`` places along a chain."""
    return world.flights[number_along(world, first, step)]


@kernel
def pair_along(world: World, first: int, step: int) -> PairData:
    """Return the pair ``step`` places along a chain."""
    return world.pairs[number_along(world, first, step)]
