"""From a system to the records of the kernels."""

from __future__ import annotations

import math

from vibro_cli.compile.kernel import interpreted_rows
from vibro_cli.kernels.flow.begin_flight import NOWHERE
from vibro_cli.kernels.impact.laws import LAW_NAMES
from vibro_cli.kernels.structs import (
    NEVER,
    BodyForces,
    Clock,
    Flight,
    PairData,
    PairTrack,
    PieceData,
    Settings,
    TrackData,
)
from vibro_cli.kernels.world import ContactRow, FlightRow, ImpactRow, SegmentRow, World
from vibro_cli.mechanics.initial_conditions import wall_position
from vibro_cli.mechanics.potential import Heights, contains_turn, heights
from vibro_cli.mechanics.reachability import contact_angle, reach
from vibro_cli.mechanics.system import Body, System, body_record
from vibro_cli.mechanics.trace import Piece, sine_cosine
from vibro_cli.numerics import elementwise
from vibro_cli.simulation.turning_tracks import set_turning

NO_WALL = -1.0


def turns_of(piece: Piece) -> int:
    """Whole turns between the papers' angle of an arc and the angle whose half is computed with."""
    if piece.is_line:
        return 0
    turns: int = elementwise.nearest((piece.angle_start + piece.angle_end) / (2.0 * math.tau))
    return turns


def half_angle(piece: Piece, position: float) -> tuple[float, float]:
    """Return ``(S, C)`` at an angle phi or psi of an arc; on a line ``(position, 1)``."""
    if piece.is_line:
        return position, 1.0
    sine, cosine = sine_cosine(0.5 * position)
    flip = elementwise.choose(turns_of(piece) % 2 == 1, -1.0, 1.0)
    if piece.sign > 0.0:
        return flip * sine, flip * cosine
    return flip * cosine, -flip * sine


def neighbours(system: System) -> list[tuple[int, int, int]]:
    """Return the pairs of neighbours as (a, b, 1 across the seam)."""
    count = len(system.bodies)
    pairs = [(j, j + 1, 0) for j in range(count - 1)]
    if system.trace.closed and count >= 2:
        pairs.append((count - 1, 0, 1))
    return pairs


def make_world(
    system: System,
    stop_time: float | None,
    stop_collisions: int | None,
    far_apart: bool = True,
) -> World:
    """Return the records of a run, its bodies at their initial states, its logs without rows.

    Without ``far_apart`` it is not asked where bodies can never meet; they are searched there, too.
    The numbers of the system may be arrays, and those of the records are then
    (``numerics.elementwise``).
    """
    nowhere = [[False] * len(system.trace.pieces) for _ in system.trace.pieces]
    levels = [heights(system.trace, body.radius) for body in system.bodies]
    pairs = neighbours(system)
    contacts: list[PairTrack] = []
    far: list[list[int]] = []
    for a, b, _ in pairs:
        body_a, body_b = system.bodies[a], system.bodies[b]
        contacts += [_pair_track(piece, body_a, body_b) for piece in system.trace.pieces]
        answers = reach(system.trace, body_a, body_b) if far_apart else nowhere
        far += [[int(answer) for answer in row] for row in answers]
    if not pairs:
        far.append([0])
        contacts.append(PairTrack())
    world = World(
        settings=[_settings(system, len(pairs), stop_time, stop_collisions)],
        clock=[_clock()],
        bodies=[body_record(body, system.gravity) for body in system.bodies],
        pieces=[_piece_data(piece) for piece in system.trace.pieces],
        tracks=[
            _track_data(system, piece, number, levels[number][piece.index])
            for number in range(len(system.bodies))
            for piece in system.trace.pieces
        ],
        pairs=[_pair_data(system, *pair, number) for number, pair in enumerate(pairs)]
        or [PairData()],
        contacts=contacts,
        far=far,
        flights=[initial_flight(system, number) for number in range(len(system.bodies))],
        forces=interpreted_rows(BodyForces, len(system.bodies) + 1),
        impacts=[ImpactRow()],
        log=[FlightRow()],
        touches=[ContactRow()],
        segments=[SegmentRow()],
    )
    if system.turning is not None:
        set_turning(world, system, system.turning)
    return world


def _clock() -> Clock:
    clock = Clock()
    clock.quiet_t = NEVER
    return clock


def _settings(
    system: System, pairs: int, stop_time: float | None, stop_collisions: int | None
) -> Settings:
    settings = Settings()
    settings.gravity = system.gravity
    settings.bodies = len(system.bodies)
    settings.pieces = len(system.trace.pieces)
    settings.pairs = pairs
    settings.closed = int(system.trace.closed)
    settings.one_sided = int(system.surface == "one-sided")
    settings.law = LAW_NAMES.index(system.law)
    settings.substitute = int(system.inadmissible == "normal-impulse")
    left, right = system.left_end, system.right_end
    settings.left_wall = left.restitution if left else NO_WALL
    settings.right_wall = right.restitution if right else NO_WALL
    settings.keep = 1
    settings.stop_t = NEVER if stop_time is None else stop_time
    settings.stop_collisions = 2**62 if stop_collisions is None else stop_collisions
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
        data.x, data.y = piece.center
    return data


def _track_data(system: System, piece: Piece, number: int, levels: Heights) -> TrackData:
    body = system.bodies[number]
    track = TrackData()
    track.gravity_rate = system.gravity / body.kappa
    track.bottom = levels.bottom
    track.top = levels.top
    left, right = _ends(system, piece, number)
    track.left_s, track.left_c = half_angle(piece, left)
    track.right_s, track.right_c = half_angle(piece, right)
    if piece.is_line:
        track.speed_factor = 1.0
        sine, _ = sine_cosine(piece.start_slope)
        track.line_acceleration = -track.gravity_rate * sine
        track.line_rise = sine
        track.line_x, track.line_y = piece.body_center(0.0, body.radius)
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


def _ends(system: System, piece: Piece, number: int) -> tuple[float, float]:
    """The places at which a body leaves a piece: its ends, or where it touches a wall there."""
    left, right = piece.angle_start, piece.angle_end
    if system.trace.closed:
        return left, right
    radius = system.bodies[number].radius
    if system.left_end and piece.index == 0:
        left = _at_wall(piece, radius, False, number == 0)
    if system.right_end and piece.index == len(system.trace.pieces) - 1:
        right = _at_wall(piece, radius, True, number == len(system.bodies) - 1)
    return left, right


def _at_wall(piece: Piece, radius: float, right: bool, outermost: bool) -> float:
    """Where a body touches a wall; the end of the piece for an inner one that does not fit there.

    An inner body never comes to a wall: another one is in between.
    """
    end = piece.angle_end if right else piece.angle_start
    place = wall_position(piece, radius, right)
    if place is not None:
        on_piece = place >= piece.angle_start if right else place <= piece.angle_end
        touch: float = elementwise.choose(on_piece, place, end)
        return touch
    if outermost:
        raise ValueError(f"piece {piece.index + 1} is too short for a body to touch its wall")
    return end


def _pair_data(system: System, a: int, b: int, seam: int, number: int) -> PairData:
    pair = PairData()
    pair.a = a
    pair.b = b
    pair.seam = seam
    # Two bodies on a closed trace meet on either side with the same k.
    pair.restitution = system.restitution[min(number, len(system.restitution) - 1)]
    pair.law = LAW_NAMES.index(system.law)
    pair.distance = system.bodies[a].radius + system.bodies[b].radius
    pair.contact_t = NEVER
    pair.release_t = NEVER
    return pair


def _pair_track(piece: Piece, body_a: Body, body_b: Body) -> PairTrack:
    """Constants of the contact of a pair on one piece (A (6), B (48); C section 3 on a line)."""
    contact = PairTrack()
    total = body_a.radius + body_b.radius
    product = body_a.radius * body_b.radius
    if piece.is_line:
        contact.sine = 2.0 * elementwise.square_root(product)
        contact.normal_a = contact.normal_b = contact.sine / total
        return contact
    if not elementwise.holds(contact_angle(piece, body_a.radius, body_b.radius) < math.inf):
        # Two bodies that never stand in this valley side by side: always in contact there.
        contact.sine = 1.0
        return contact
    rho_a, rho_b = piece.path_radius(body_a.radius), piece.path_radius(body_b.radius)
    contact.sine = elementwise.square_root(product / (rho_a * rho_b))
    contact.cosine = elementwise.square_root((1.0 - contact.sine) * (1.0 + contact.sine))
    contact.far_gap = math.pi - 2.0 * elementwise.arcsine(contact.sine)
    sine_beta = 2.0 * contact.sine * contact.cosine
    contact.normal_a = rho_b * sine_beta / total
    contact.normal_b = rho_a * sine_beta / total
    return contact


def initial_flight(system: System, number: int) -> Flight:
    """Return a body before its first flight: its piece, place and motion."""
    state = system.initial[number]
    body = system.bodies[number]
    piece = system.trace.pieces[state.piece]
    flight = Flight()
    flight.piece = state.piece
    flight.anchor = -1
    flight.brief = elementwise.square_root(2.0 * NOWHERE * body.radius / system.gravity)
    flight.s, flight.c = half_angle(piece, state.position)
    if piece.is_line:
        flight.p = state.speed
    else:
        rho = piece.path_radius(body.radius)
        frequency = body.natural_rate(system.gravity, rho)
        flight.p = state.speed / (2.0 * frequency * rho)
    return flight
