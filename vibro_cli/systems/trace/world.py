"""Convert a system to the records of the kernels.

Records of a rotating trace hold the potential, crests and bounds of each piece. Systems that differ
in numbers only can be converted together, for a stack (``kernels.ensemble.points``).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from mmap import mmap
from typing import Any, TypeVar

import numpy as np

from vibro_cli.kernels.contact.libration_contact_lanes import TwoBodies, TwoLibrations, TwoTracks
from vibro_cli.kernels.flow.flight import NOWHERE
from vibro_cli.kernels.impact.laws import LAW_NAMES
from vibro_cli.kernels.numerics.constants import NEVER
from vibro_cli.kernels.world import (
    BodyForces,
    Clock,
    ContactRow,
    Flight,
    FlightRow,
    ImpactRow,
    PairData,
    PairTrack,
    PieceData,
    SegmentRow,
    Settings,
    TrackData,
    World,
)
from vibro_cli.mechanics.initial_conditions import wall_position
from vibro_cli.mechanics.potential import (
    Pull,
    Turning,
    contains_turn,
    heights,
    inside,
    roots,
)
from vibro_cli.mechanics.reachability import contact_angle, reach
from vibro_cli.mechanics.system import Body, TraceSystem
from vibro_cli.mechanics.trace import Piece, Trace, sine_cosine
from vibro_cli.numerics import elementwise
from vibro_cli.systems.driver import body_record, law_and_stops, zeros
from vibro_cli.systems.request import NO_LIMITS, Limits

Record = TypeVar("Record")

# Factor that keeps bounds above rounding errors.
CAUTION = 1.0 + 1.0e-12


def two_bodies(may_be_taken: bool) -> TwoBodies:
    """Return a record for the faster path of two bodies, or none where it may not be taken."""
    count = int(may_be_taken)
    return TwoBodies(zeros(count, TwoLibrations), zeros(count, TwoTracks))


def _turn(system: TraceSystem, body: Body, tracks: Sequence[TrackData], turning: Turning) -> None:
    """Add what rotation needs to the tracks of a body."""
    lowest = math.inf
    for piece, track in zip(system.trace.pieces, tracks, strict=True):
        set_one = _set_line if piece.is_line else _set_arc
        lowest = min(lowest, set_one(system, turning, body, piece, track))
    for track in tracks:
        track.bottom -= lowest


def _set_line(
    system: TraceSystem, turning: Turning, body: Body, piece: Piece, track: TrackData
) -> float:
    """Set the track of a line; return its least potential (m), from the lowest place at rest."""
    kappa = body.kappa
    tangent = math.cos(piece.start_slope)
    away = track.line_x - turning.x
    track.line_growth = abs(turning.rate * tangent) / math.sqrt(kappa)
    track.line_acceleration += turning.square / kappa * away * tangent
    outwards = turning.square / system.gravity * math.sin(piece.start_slope)
    track.line_normal = tangent + outwards * away
    track.line_normal_growth = outwards * tangent
    track.bottom -= 0.5 * turning.square / system.gravity * away * away
    square = track.line_growth * track.line_growth
    ends = (track.left_s, track.right_s)
    track.gravity_rate = max(abs(track.line_acceleration + square * s) for s in ends)
    # The potential is concave along a line: its least value is at an end, even if a wall is there.
    factor = kappa / system.gravity
    heights = [
        -factor * (track.line_acceleration + 0.5 * square * s) * s for s in (0.0, piece.length)
    ]
    return track.bottom + min(heights)


def _set_arc(
    system: TraceSystem, turning: Turning, body: Body, piece: Piece, track: TrackData
) -> float:
    """Set the track of an arc; return its least potential (m), from the lowest place at rest."""
    pull = Pull.on_arc(piece, body.radius, turning, system.gravity)
    track.tilt, track.spread = pull.tilt, pull.spread
    away = piece.centre[0] - turning.x
    track.bottom -= 0.5 * turning.square / system.gravity * away * away
    low, high = _span((track.left_s, track.left_c), (track.right_s, track.right_c))
    equilibria = pull.equilibria()
    track.lowest_potential = _lowest_potential(pull, equilibria, low, high)
    _set_bounds(track, pull, equilibria, (low, high))
    _set_force_bounds(track, pull, piece.sign, body.kappa, (low, high))
    ends = half_angle(piece, piece.angle_start), half_angle(piece, piece.angle_end)
    return track.bottom + track.twice_radius * _lowest_potential(pull, equilibria, *_span(*ends))


def _span(left: tuple[float, float], right: tuple[float, float]) -> tuple[float, float]:
    """Return the interval of angles f (rad) between two positions ``(S, C)``."""
    low, high = 2.0 * math.atan2(*left), 2.0 * math.atan2(*right)
    return (low, high) if low <= high else (low - 2.0 * math.tau, high)


def _lowest_potential(pull: Pull, equilibria: list[float], low: float, high: float) -> float:
    """Return the least potential between two angles f (rad)."""
    return min(pull.potential(angle) for angle in [low, high, *inside(equilibria, low, high)])


def _set_bounds(
    track: TrackData, pull: Pull, equilibria: list[float], span: tuple[float, float]
) -> None:
    """Set the crests between two angles f (rad), and bounds of the acceleration there."""
    low, high = span
    track.highest_potential = max(pull.potential(angle) for angle in equilibria)
    w2 = track.frequency * track.frequency
    track.most_angular = CAUTION * w2 * pull.greatest(0, low, high)
    track.most_stiffness = CAUTION * w2 * pull.greatest(1, low, high)
    track.most_bending = CAUTION * w2 * pull.greatest(2, low, high)
    track.steepest = CAUTION * w2 * pull.steepest_fall(low, high)
    track.gravity_rate = track.path_radius * track.most_angular
    maxima = [angle for angle in equilibria if pull.stiffness(angle) >= 0.0]
    crests = sorted((place, angle) for angle in maxima for place in inside([angle], low, high))
    track.crests = len(crests)
    track.top_s, track.top_c = sine_cosine(0.5 * max(maxima, key=pull.potential))
    track.pass_s, track.pass_c = sine_cosine(0.5 * min(maxima, key=pull.potential))
    halves = [_half_after_turns(*crest) for crest in crests]
    if halves:
        track.crest_s, track.crest_c = halves[0]
    if len(halves) > 1:
        track.other_crest_s, track.other_crest_c = halves[1]


def _half_after_turns(place: float, angle: float) -> tuple[float, float]:
    """Return ``(S, C)`` whole turns from an angle f (rad): to the bit, but for a common sign.

    Whether a crest is the saddle that an energy is measured from must not depend on rounding.
    """
    sine, cosine = sine_cosine(0.5 * angle)
    sign = -1.0 if round((place - angle) / math.tau) % 2 else 1.0
    return sign * sine, sign * cosine


def _set_force_bounds(
    track: TrackData, pull: Pull, sign: float, kappa: float, span: tuple[float, float]
) -> None:
    """Set where the normal force is stationary between two angles f (rad), and its least values."""
    places = inside(force_extremes(pull, kappa), *span)
    track.extreme_count = len(places)
    for index, angle in enumerate(places):
        track.extremes[2 * index] = math.sin(0.5 * angle)
        track.extremes[2 * index + 1] = math.cos(0.5 * angle)
    still = inside(roots(1.0, pull.tilt, 2.0 * pull.spread, 0), *span)
    track.least_still = min(_press(sign, pull, angle) for angle in [*span, *still])
    share = 4.0 / kappa
    track.least_normal = min(
        _press(sign, pull, angle) - sign * share * pull.potential(angle)
        for angle in [*span, *places]
    )


def _press(sign: float, pull: Pull, angle: float) -> float:
    """Return ``N/(m g)`` of a body at rest at an angle f (rad)."""
    sine = math.sin(angle)
    return sign * (math.cos(angle) + sine * (pull.tilt + pull.spread * sine))


def force_extremes(pull: Pull, kappa: float) -> list[float]:
    """Return the angles f (rad) at which the normal force is stationary, for any energy.

    ``N/(m g) = sign (cos f + tilt sin f + spread sin^2 f + (4/kappa) P^2)``.
    """
    harmonic = 1.0 + 2.0 / kappa
    return roots(harmonic, harmonic * pull.tilt, 2.0 * (1.0 + 1.0 / kappa) * pull.spread, 0)


NO_WALL = -1.0


def turns_of(piece: Piece) -> int:
    """Return the whole turns between the papers' angle of an arc and twice its half-angle."""
    if piece.is_line:
        return 0
    turns: int = elementwise.nearest((piece.angle_start + piece.angle_end) / (2.0 * math.tau))
    return turns


def half_angle(piece: Piece, position: float) -> tuple[float, float]:
    """Return ``(S, C)`` at an angle phi or psi of an arc, or ``(position, 1)`` on a line."""
    if piece.is_line:
        return position, 1.0
    sine, cosine = sine_cosine(0.5 * position)
    flip = elementwise.choose(turns_of(piece) % 2 == 1, -1.0, 1.0)
    if piece.sign > 0.0:
        return flip * sine, flip * cosine
    return flip * cosine, -flip * sine


def pairs_of(system: TraceSystem) -> list[tuple[int, int, int]]:
    """Return the pairs of neighbours as (a, b, 1 across the seam)."""
    count = len(system.bodies)
    pairs = [(j, j + 1, 0) for j in range(count - 1)]
    return [*pairs, (count - 1, 0, 1)] if system.trace.closed and count >= 2 else pairs


def make_world(system: TraceSystem, limits: Limits = NO_LIMITS, far_apart: bool = True) -> World:
    """Return the records of a run with its bodies in their initial states and empty logs.

    Without ``far_apart`` the records do not say where bodies may meet: only the solver needs it.
    The numbers of the system may be arrays, and those of the records are then
    (``numerics.elementwise``).
    """
    pairs = pairs_of(system)
    neighbours = [(system.bodies[a], system.bodies[b]) for a, b, _ in pairs]
    return World(
        settings=[_settings(system, len(pairs), limits)],
        clock=[_clock()],
        bodies=[body_record(body, system.gravity) for body in system.bodies],
        pieces=[_piece_data(piece) for piece in system.trace.pieces],
        tracks=_of_each(partial(_tracks, system), [(body,) for body in system.bodies]),
        pairs=[_pair_data(system, *pair, number) for number, pair in enumerate(pairs)]
        or [PairData()],
        contacts=_of_each(partial(_contacts, system.trace), neighbours) or [PairTrack()],
        meeting=_meeting(system.trace, neighbours if far_apart else [], len(pairs)),
        flights=[initial_flight(system, number) for number in range(len(system.bodies))],
        forces=[BodyForces() for _ in range(len(system.bodies) + 1)],
        impacts=[ImpactRow()],
        log=[FlightRow()],
        touches=[ContactRow()],
        segments=[SegmentRow()],
    )


def _of_each(make: Callable[..., list[Record]], groups: Sequence[tuple[Body, ...]]) -> list[Record]:
    """Return the records that depend on the shapes of bodies only, for each body or pair in turn.

    Groups of equal shapes share their records, which no kernel changes.
    """
    made: dict[Any, list[Record]] = {}
    found: list[Record] = []
    for bodies in groups:
        shape: Any = tuple(number for body in bodies for number in (body.radius, body.kappa))
        if not all(map(elementwise.is_number, shape)):
            shape = tuple(map(id, bodies))
        if shape not in made:
            made[shape] = make(*bodies)
        found += made[shape]
    return found


def _tracks(system: TraceSystem, body: Body) -> list[TrackData]:
    """Return the tracks of a body, one for each piece."""
    levels = heights(system.trace, body.radius)
    tracks = [
        _track_data(system, piece, body, own)
        for piece, own in zip(system.trace.pieces, levels, strict=True)
    ]
    if system.turning is not None:
        _turn(system, body, tracks, system.turning)
    return tracks


def _contacts(trace: Trace, body_a: Body, body_b: Body) -> list[PairTrack]:
    """Return the contact constants of a pair, for each piece."""
    return [_pair_track(piece, body_a, body_b) for piece in trace.pieces]


def _meeting(trace: Trace, asked: Sequence[tuple[Body, Body]], pairs: int) -> Any:
    """Return where two bodies, each on a piece, may meet (1), for the first pairs `asked`.

    The array has a number for each pair of pieces, and few ones. It is allocated in pages of 4 kB,
    of which those with zeros alone take no memory; NumPy would request pages of 2 MB.
    """
    shape = max(pairs, 1), len(trace.pieces), len(trace.pieces)
    room = mmap(-1, np.dtype(np.int64).itemsize * math.prod(shape))
    meeting = np.frombuffer(room, dtype=np.int64).reshape(shape)
    for rows, pair in zip(meeting, asked, strict=False):
        for one, other in reach(trace, *pair):
            rows[one, other] = 1
    return meeting.reshape(-1, shape[2])


def _clock() -> Clock:
    clock = Clock()
    clock.quiet_from = NEVER
    return clock


def _settings(system: TraceSystem, pairs: int, limits: Limits) -> Settings:
    settings = Settings()
    settings.gravity = system.gravity
    settings.bodies = len(system.bodies)
    settings.pieces = len(system.trace.pieces)
    settings.pairs = pairs
    settings.closed = int(system.trace.closed)
    settings.closing_error = system.trace.closing_error()[0] if system.trace.closed else 0.0
    settings.one_sided = int(system.surface == "one-sided")
    law_and_stops(settings, system, limits)
    left, right = system.left_end, system.right_end
    settings.left_wall = left.restitution if left else NO_WALL
    settings.right_wall = right.restitution if right else NO_WALL
    settings.keep_rows = 1
    settings.stop_t = NEVER if limits.time is None else limits.time
    if system.turning is not None:
        settings.axis_x, settings.turning_square = system.turning.x, system.turning.square
    return settings


def _piece_data(piece: Piece) -> PieceData:
    data = PieceData()
    data.sign = piece.sign
    data.length = piece.length
    data.radius = 0.0 if piece.is_line else piece.radius
    data.start_s = piece.start_s
    data.angle_start, data.angle_end = piece.angle_start, piece.angle_end
    data.turn = math.tau * turns_of(piece)
    if piece.is_line:
        data.x, data.y = piece.start
        data.tangent_y, data.tangent_x = sine_cosine(piece.start_slope)
    else:
        data.x, data.y = piece.centre
    return data


def _track_data(
    system: TraceSystem, piece: Piece, body: Body, levels: tuple[float, float]
) -> TrackData:
    track = TrackData()
    track.gravity_rate = system.gravity / body.kappa
    track.bottom, track.top = levels
    left, right = _ends(system, piece, body.radius)
    track.left_s, track.left_c = half_angle(piece, left)
    track.right_s, track.right_c = half_angle(piece, right)
    if piece.is_line:
        track.speed_factor = 1.0
        sine, _ = sine_cosine(piece.start_slope)
        track.line_acceleration = -track.gravity_rate * sine
        track.line_rise = sine
        track.line_x, track.line_y = piece.body_centre(0.0, body.radius)
        return track
    rho = piece.path_radius(body.radius)
    track.path_radius = rho
    track.frequency = body.natural_rate(system.gravity, rho)
    track.speed_factor = 2.0 * track.frequency * rho
    track.twice_radius = 2.0 * rho
    squares = (track.left_s * track.left_s, track.right_s * track.right_s)
    # f = phi in a valley, psi + pi on a hump: S^2 is 0 at f = 0, 1 at f = pi.
    bottom, top = (0.0, math.pi) if piece.sign > 0.0 else (math.pi, 0.0)
    track.lowest_s2 = elementwise.choose(
        contains_turn(piece, bottom), 0.0, elementwise.least(*squares)
    )
    track.highest_s2 = elementwise.choose(
        contains_turn(piece, top), 1.0, elementwise.greatest(*squares)
    )
    return track


def _ends(system: TraceSystem, piece: Piece, radius: float) -> tuple[float, float]:
    """Return where a body leaves a piece: at its ends, or where it touches a wall there."""
    left, right = piece.angle_start, piece.angle_end
    if system.trace.closed:
        return left, right
    if system.left_end and piece.index == 0:
        left = _at_wall(piece, radius, False)
    if system.right_end and piece.index == len(system.trace.pieces) - 1:
        right = _at_wall(piece, radius, True)
    return left, right


def _at_wall(piece: Piece, radius: float, right: bool) -> float:
    """Return where a body touches a wall, or the end of the piece if it does not fit there.

    Only an inner body may not fit (see ``assemble.check_walls``); it never reaches a wall.
    """
    end = piece.angle_end if right else piece.angle_start
    place = wall_position(piece, radius, right)
    touch: float = elementwise.choose(elementwise.is_nan(place), end, place)
    return touch


def _pair_data(system: TraceSystem, a: int, b: int, seam: int, number: int) -> PairData:
    pair = PairData()
    pair.a = a
    pair.b = b
    pair.seam = seam
    # Two bodies on a closed trace have the same k on both sides.
    pair.restitution = system.restitution_of(number)
    pair.law = LAW_NAMES.index(system.law)
    pair.distance = system.bodies[a].radius + system.bodies[b].radius
    pair.contact_t = NEVER
    pair.release_t = NEVER
    return pair


def _pair_track(piece: Piece, body_a: Body, body_b: Body) -> PairTrack:
    """Return the contact constants of a pair on a piece (A (6), B (48); C section 3 on a line)."""
    contact = PairTrack()
    total = body_a.radius + body_b.radius
    product = body_a.radius * body_b.radius
    if piece.is_line:
        contact.sine = 2.0 * elementwise.square_root(product)
        contact.normal_a = contact.normal_b = contact.sine / total
        return contact
    rho_a, rho_b = piece.path_radius(body_a.radius), piece.path_radius(body_b.radius)
    # Two bodies too large to lie side by side in this valley are always in contact there.
    beside = contact_angle(piece, body_a.radius, body_b.radius) < math.inf
    sine = elementwise.square_root(product / (rho_a * rho_b))
    contact.sine = elementwise.choose(beside, sine, 1.0)
    contact.cosine = elementwise.square_root((1.0 - contact.sine) * (1.0 + contact.sine))
    contact.far_gap = math.pi - 2.0 * elementwise.arcsine(contact.sine)
    sine_beta = 2.0 * contact.sine * contact.cosine
    contact.normal_a = rho_b * sine_beta / total
    contact.normal_b = rho_a * sine_beta / total
    return contact


def initial_flight(system: TraceSystem, number: int) -> Flight:
    """Return the flight record of a body at its initial state: piece, position and speed."""
    state = system.initial[number]
    body = system.bodies[number]
    piece = system.trace.pieces[state.piece]
    flight = Flight()
    flight.piece = state.piece
    flight.separatrix_piece = -1
    flight.saddle_root = NEVER
    flight.brief = elementwise.square_root(2.0 * NOWHERE * body.radius / system.gravity)
    flight.size = system.trace.length
    flight.s, flight.c = half_angle(piece, state.position)
    if piece.is_line:
        flight.p = state.speed
    else:
        rho = piece.path_radius(body.radius)
        frequency = body.natural_rate(system.gravity, rho)
        flight.own_frequency = frequency
        flight.p = state.speed / (2.0 * frequency * rho)
    return flight
