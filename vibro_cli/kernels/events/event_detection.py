"""The certified search for the pair that meets first, among all pairs that can meet."""

from __future__ import annotations

import math

from vibro_cli.compile.kernel import kernel
from vibro_cli.kernels.contact.arc_contact import contact_on_arc
from vibro_cli.kernels.contact.contact_kinematics import (
    centre_position,
    centre_tangent,
    on_one_line,
)
from vibro_cli.kernels.contact.first_contact import (
    UNFINISHED,
    contact_by_distance,
    contact_on_line,
    keep_states,
    polish_root_by_distance,
    polish_root_on_arc,
    short_bounce,
)
from vibro_cli.kernels.flow.flight import state_at
from vibro_cli.kernels.flow.flow import LINE, POLYNOMIAL
from vibro_cli.kernels.numerics.constants import NEVER
from vibro_cli.kernels.numerics.double_double import add_to_time, time_between
from vibro_cli.kernels.world import (
    CLOSING,
    PARTING,
    Flight,
    PairData,
    PairTrack,
    PieceData,
    TrackData,
    World,
    contact_of,
    flights_of,
    track_of,
    track_on,
    tracks_of,
)

# Margin for rounding where cosines of bounds are compared.
CAUTION = 1.0e-12
NEVER_MEET = -2.0 * NEVER  # a proof, in addition to NONE_BEFORE_LIMIT
# In place of a pair: the search must be called again, so that interrupts are seen.
TO_BE_CONTINUED = -2
# Rounds over all pairs before that.
ROUNDS = 10_000


@kernel
def first_contact(world: World, horizon_t: float, horizon_low: float) -> int:
    """Search all pairs up to an instant; return the pair that meets first, or -1.

    Returns ``TO_BE_CONTINUED`` if that takes very long.

    The steps of a search depend on its two flights alone. An interrupted search resumes at the end
    of a step, so that its result does not depend on what interrupted it: another event, or the stop
    of a run that is continued.
    """
    first = -1
    settings = world.settings[0]
    for j in range(settings.pairs):
        pair = world.pairs[j]
        if time_between(pair.contact_t, pair.contact_t_low, horizon_t, horizon_low) < 0.0:
            first = j
            horizon_t = pair.contact_t
            horizon_low = pair.contact_t_low
    for _ in range(ROUNDS):
        finished = True
        for j in range(settings.pairs):
            pair = world.pairs[j]
            if pair.apart == 1 or pair.held == 1:
                continue
            ahead = time_between(horizon_t, horizon_low, pair.begin_t, pair.begin_t_low)
            if (ahead > 0.0 and ahead >= pair.searched) or pair.touching == CLOSING:
                if pair.contact_t == NEVER and not _search_pair(world, j, pair, ahead):
                    finished = False
                later = time_between(pair.contact_t, pair.contact_t_low, horizon_t, horizon_low)
                # A pair that closes at an instant does so before any body bounces off a wall then.
                if later < 0.0 or (later == 0.0 and first < 0 and pair.touching == CLOSING):
                    first = j
                    horizon_t = pair.contact_t
                    horizon_low = pair.contact_t_low
        if finished:
            return first
    return TO_BE_CONTINUED


@kernel
def _search_pair(world: World, j: int, pair: PairData, ahead: float) -> bool:
    """Continue the search of one pair up to ``ahead`` (s); keep a contact found in the pair.

    Returns False if the search has not come that far.
    """
    clock = world.clock[0]
    clock.searches += 1
    if pair.touching == CLOSING:
        pair.contact_t = pair.begin_t
        pair.contact_t_low = pair.begin_t_low
        pair.a_s, pair.a_c, pair.a_p = state_at(world, pair.a, pair.begin_t, pair.begin_t_low)
        pair.b_s, pair.b_c, pair.b_p = state_at(world, pair.b, pair.begin_t, pair.begin_t_low)
        return True
    a, b = flights_of(world, pair)
    laps = b.winding_number - a.winding_number + pair.seam
    if _is_out_of_reach(world, j, laps):
        h = NEVER_MEET
    else:
        to_a = time_between(a.exit_t, a.exit_t_low, pair.begin_t, pair.begin_t_low)
        to_b = time_between(b.exit_t, b.exit_t_low, pair.begin_t, pair.begin_t_low)
        limit = min(to_a, to_b)
        if pair.searched >= limit:
            return True  # searched to the end of a flight
        # The end of a short bounce is known only after polishing: no horizon precedes it.
        ahead = max(ahead, min(limit, short_bounce(a, b)))
        h = _time_of_contact(world, j, laps, ahead, limit)
    if h == NEVER_MEET:
        clock.skipped_apart += 1
        pair.apart = 1
    elif h >= 0.0:
        pair.contact_t, pair.contact_t_low = add_to_time(pair.begin_t, pair.begin_t_low, h)
        if _are_both_pairs(world, pair):
            _hand_over(world, pair, world.pairs[1 - j])
    return h != UNFINISHED


@kernel
def _is_out_of_reach(world: World, j: int, laps: int) -> bool:
    """Return whether a pair cannot meet on its pieces, while at rest, or as this pair."""
    pair = world.pairs[j]
    a, b = flights_of(world, pair)
    if world.meeting[j * world.settings[0].pieces + a.piece][b.piece] == 0:
        return True
    if (a.at_rest == 1 and b.at_rest == 1) or _is_left_to_the_other(world, pair):
        return True
    # Almost a lap ahead on the same line, b is behind a: they can only meet as the other pair.
    return a.piece == b.piece and world.pieces[a.piece].sign == 0.0 and laps != 0


@kernel
def _time_of_contact(world: World, j: int, laps: int, ahead: float, limit: float) -> float:
    """Return the time (s) of the first contact of a pair after the start of both its flights.

    Returns ``NONE_BEFORE_LIMIT`` or ``UNFINISHED`` if it is not known yet, and ``NEVER_MEET`` if
    there is none on these flights.
    """
    pair = world.pairs[j]
    a, b = flights_of(world, pair)
    age_a = time_between(pair.begin_t, pair.begin_t_low, a.t, a.t_low)
    age_b = time_between(pair.begin_t, pair.begin_t_low, b.t, b.t_low)
    ages = age_a, age_b
    if a.piece == b.piece and world.pieces[a.piece].sign != 0.0:
        if _moves_as_one(a, b) or kept_apart(a, b, contact_of(world, j), laps):
            return NEVER_MEET
        orientation = 1.0 if laps == 0 else -1.0
        h = contact_on_arc(world, j, ages, ahead, limit, orientation)
        if h > 0.0 and pair.touching == PARTING:
            h = max(polish_root_on_arc(world, j, age_a + h, orientation) - age_a, 0.0)
        return h
    touching = pair.touching
    if touching == 0 and _are_both_pairs(world, pair):
        touching = world.pairs[1 - j].touching
    straight = laps == 0 and on_one_line(world, a, b)
    if a.form == LINE and b.form == LINE and straight:
        between = world.pieces[b.piece].start_s - world.pieces[a.piece].start_s
        return contact_on_line(world, j, ages, touching, limit, between)
    if _separated(world, pair):
        return NEVER_MEET
    h = contact_by_distance(world, j, straight, touching, ahead, limit, ages)
    if h > 0.0 and touching == PARTING:
        h = max(polish_root_by_distance(world, j, straight, age_a + h) - age_a, 0.0)
    return h


@kernel
def _are_both_pairs(world: World, pair: PairData) -> bool:
    """Return whether the bodies of a pair also form the other pair of a closed trace.

    They are the only two bodies, and on different pieces.
    """
    settings = world.settings[0]
    a, b = flights_of(world, pair)
    return settings.pairs == 2 and settings.bodies == 2 and a.piece != b.piece


@kernel
def _is_left_to_the_other(world: World, pair: PairData) -> bool:
    """Return whether a pair of the only two bodies on a closed trace is searched as the other pair.

    On two pieces one search finds the contact of either pair. While one contact lasts there is no
    other.
    """
    return _are_both_pairs(world, pair) and (pair.seam == 1 or world.pairs[1].held == 1)


@kernel
def _hand_over(world: World, pair: PairData, other: PairData) -> None:
    """Move a contact of two bodies on two pieces to the other pair if it is on that side."""
    a, b = flights_of(world, pair)
    piece_a = world.pieces[a.piece]
    piece_b = world.pieces[b.piece]
    track_a, track_b = tracks_of(world, pair)
    ax, ay = centre_position(piece_a, track_a, pair.a_s, pair.a_c)
    bx, by = centre_position(piece_b, track_b, pair.b_s, pair.b_c)
    tx, ty = centre_tangent(piece_a, pair.a_s, pair.a_c)
    ux, uy = centre_tangent(piece_b, pair.b_s, pair.b_c)
    if (bx - ax) * (tx + ux) + (by - ay) * (ty + uy) >= 0.0:
        return
    keep_states(other, (pair.b_s, pair.b_c, pair.b_p, pair.a_s, pair.a_c, pair.a_p))
    other.contact_t = pair.contact_t
    other.contact_t_low = pair.contact_t_low
    other.apart = 0
    pair.contact_t = NEVER
    pair.contact_t_low = 0.0
    pair.apart = 1


@kernel
def _moves_as_one(a: Flight, b: Flight) -> bool:
    """Return whether two bodies belong to one group on one arc, so that their angle is constant.

    A group across several pieces moves in segments, and its ends may approach each other.
    """
    if a.grouped + b.grouped != 2 or a.form == POLYNOMIAL:
        return False
    return a.group_first == b.group_first


@kernel
def kept_apart(a: Flight, b: Flight, contact: PairTrack, laps: int) -> bool:
    """Return whether two librations in a circle keep two bodies apart across its top.

    The flights stay within ``|f| <= 2 asin sqrt m``. The bodies meet over the top only if both
    half-angles and half the contact angle add up to pi.
    """
    root_a = a.complementary_modulus
    root_b = b.complementary_modulus
    if laps == 0 or a.grouped + b.grouped != 0 or root_a <= 0.0 or root_b <= 0.0:
        return False
    if a.c <= 0.0 or b.c <= 0.0:
        return False
    reach = root_a * root_b - math.sqrt(a.parameter * b.parameter)
    return reach > CAUTION - contact.cosine


@kernel
def _separated(world: World, pair: PairData) -> bool:
    """Return whether the horizontal extents of its flights keep a pair apart."""
    low_a, high_a = horizontal_extent(world, pair.a)
    low_b, high_b = horizontal_extent(world, pair.b)
    return low_b - high_a > pair.distance or low_a - high_b > pair.distance


@kernel
def horizontal_extent(world: World, ball: int) -> tuple[float, float]:
    """Return the least and greatest x (m) of a body's centre on its flight; infinite in contact.

    A flight that turns back has what its energy reaches on its piece.
    """
    flight = world.flights[ball]
    if flight.grouped == 1:
        return -NEVER, NEVER
    low, high, _, _ = _reachable_on(world, ball, flight.piece, flight.c)
    piece = world.pieces[flight.piece]
    track = track_of(world, ball)
    # x grows along a line to the right, and within 90 degrees of a bottom or a crest.
    grows = piece.tangent_x > 0.0
    if piece.sign > 0.0:
        grows = min(flight.parameter, track.highest_s2) <= 0.5
    elif piece.sign < 0.0:
        grows = track.lowest_s2 >= 0.5
    return ahead(world, ball, low, high) if grows else (low, high)


@kernel
def ahead(world: World, ball: int, low: float, high: float) -> tuple[float, float]:
    """Return an extent (m) without what lies behind a flight that goes straight to its exit.

    x must grow along the path.
    """
    flight = world.flights[ball]
    piece = world.pieces[flight.piece]
    here, _ = centre_position(piece, track_of(world, ball), flight.flow_s, flight.flow_c)
    if flight.exit_side * flight.flow_p > 0.0:
        if flight.exit_side == 1:
            low = here
        else:
            high = here
    return low, high


# Margin, as a share, of energies and lengths where a proof is to hold for ever.
FOR_EVER = 1.0e-9


@kernel
def never_meet(world: World) -> bool:
    """Return whether the energies of the bodies keep all neighbours apart for ever.

    Between impacts an energy is constant, or falls at a wall. False if a body may lift off or reach
    an open end of the trace, and where this is not proved: in lasting contact and on a rotating
    trace.
    """
    settings = world.settings[0]
    if settings.one_sided == 1 or settings.turning_square > 0.0 or world.clock[0].held_pairs > 0:
        return False
    low_a, high_a = reachable(world, 0)
    if low_a <= -NEVER:
        return False
    for j in range(settings.pairs):
        pair = world.pairs[j]
        low_b, high_b = reachable(world, pair.b)
        distance = pair.distance + FOR_EVER * world.flights[pair.a].size
        if low_b - high_a <= distance and low_a - high_b <= distance:
            return False
        low_a, high_a = low_b, high_b
    return True


@kernel
def reachable(world: World, ball: int) -> tuple[float, float]:
    """Return the least and greatest x (m) that the energy of a body lets its centre reach.

    They are infinite if it reaches an open end of the trace or all of a closed one.
    """
    flight = world.flights[ball]
    low, high, left, right = _reachable_on(world, ball, flight.piece, flight.c)
    if right:
        low, high = _reachable_beyond(world, ball, 1, low, high)
    if left:
        low, high = _reachable_beyond(world, ball, -1, low, high)
    return low, high


@kernel
def _reachable_beyond(
    world: World, ball: int, side: int, low: float, high: float
) -> tuple[float, float]:
    """Return the extremes of x, which are known on its piece, for a body that leaves it on a side.

    ``side`` is 1 (right) or -1.
    """
    settings = world.settings[0]
    piece = world.flights[ball].piece
    for _ in range(settings.pieces):
        piece += side
        if settings.closed == 0 and not 0 <= piece < settings.pieces:
            wall = settings.right_wall if side > 0 else settings.left_wall
            return (low, high) if wall >= 0.0 else (-NEVER, NEVER)
        piece = piece % settings.pieces
        track = track_on(world, ball, piece)
        c = track.left_c if side > 0 else track.right_c
        next_low, next_high, left, right = _reachable_on(world, ball, piece, c)
        low = min(low, next_low)
        high = max(high, next_high)
        if not (right if side > 0 else left):
            return low, high
    return -NEVER, NEVER


@kernel
def _reachable_on(
    world: World, ball: int, number: int, c: float
) -> tuple[float, float, bool, bool]:
    """Return the extremes of x that a body reaches on a piece, and whether it reaches its ends.

    A body at rest stays where it is. On an arc ``C`` tells on which side of the top it is: where
    its energy does not take it over the top, it stays there.
    """
    piece = world.pieces[number]
    track = track_on(world, ball, number)
    flight = world.flights[ball]
    if flight.at_rest == 1:
        x, _ = centre_position(piece, track, flight.s, flight.c)
        return x, x, False, False
    # A body that has almost no energy left still crosses a step that is due to rounding.
    energy = flight.specific_energy * (1.0 + FOR_EVER) + CAUTION * flight.size
    if piece.sign == 0.0:
        return _reachable_on_line(piece, track, energy)
    complement = (track.top - energy) / track.twice_radius - CAUTION
    over = complement <= 0.0
    left = over or (track.left_c * c > 0.0 and track.left_c * track.left_c >= complement)
    right = over or (track.right_c * c > 0.0 and track.right_c * track.right_c >= complement)
    turn = 2.0 * math.sqrt(max(complement * (1.0 - complement), 0.0))
    from_left = 2.0 * track.left_s * track.left_c if left else -turn
    to_right = 2.0 * track.right_s * track.right_c if right else turn
    if track.lowest_s2 < 0.5 < min(1.0 - complement, track.highest_s2):
        # The path may pass a vertical tangent, where x is extreme.
        from_left = -1.0
        to_right = 1.0
    one = piece.x + piece.sign * track.path_radius * from_left
    other = piece.x + piece.sign * track.path_radius * to_right
    rounding = CAUTION * track.path_radius
    return min(one, other) - rounding, max(one, other) + rounding, left, right


@kernel
def _reachable_on_line(
    piece: PieceData, track: TrackData, energy: float
) -> tuple[float, float, bool, bool]:
    """Return the extremes of x that a body reaches on a line, and whether it reaches its ends."""
    start = track.left_s
    end = track.right_s
    rise = energy - track.bottom
    left = rise >= track.line_rise * start
    right = rise >= track.line_rise * end
    if not left:
        start = min(max(start, rise / track.line_rise), end)
    if not right:
        end = max(min(end, rise / track.line_rise), start)
    one = track.line_x + piece.tangent_x * start
    other = track.line_x + piece.tangent_x * end
    return min(one, other), max(one, other), left, right
