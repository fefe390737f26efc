import math
from typing import Any

import mpmath
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from vibro_cli.mechanics.initial_conditions import (
    beside,
    enter_piece,
    gap,
    out_of_order,
    reaches_over,
    snap_to_piece,
    speed_of_omega,
    speed_of_rate,
    wall_position,
)
from vibro_cli.mechanics.system import Body, InitialState
from vibro_cli.mechanics.trace import ArcShape, Piece, Trace

EPSILON = 2.0**-52


def ball(radius: float) -> Body:
    return Body("ball", radius, 1.0, 0.4)


def mixed() -> Trace:
    shapes = [
        ArcShape("valley", radius=0.8, end_slope=0.4),
        ArcShape("line", length=0.7),
        ArcShape("hump", radius=0.6, end_slope=-0.3),
        ArcShape("line", length=0.05),
        ArcShape("valley", radius=1.1, end_slope=1.5),
    ]
    return Trace.chain(-1.4, shapes)


def exact_centre(piece: Piece, position: float, radius: float) -> tuple[mpmath.mpf, mpmath.mpf]:
    at, r = mpmath.mpf(position), mpmath.mpf(radius)
    if piece.is_line:
        cosine, sine = mpmath.cos(piece.start_slope), mpmath.sin(piece.start_slope)
        x, y = piece.start
        return x + at * cosine - r * sine, y + at * sine + r * cosine
    rho = piece.radius - piece.sign * r
    x, y = piece.centre
    return x + rho * mpmath.sin(at), y - piece.sign * rho * mpmath.cos(at)


def exact_gap(
    trace: Trace, body_a: Body, a: InitialState, body_b: Body, on: int, position: float
) -> mpmath.mpf:
    ax, ay = exact_centre(trace.pieces[a.piece], a.position, body_a.radius)
    bx, by = exact_centre(trace.pieces[on], position, body_b.radius)
    return mpmath.hypot(bx - ax, by - ay) - mpmath.mpf(body_a.radius) - body_b.radius


@given(st.integers(0, 4), st.floats(0.0, 1.0), st.floats(0.01, 0.35), st.floats(0.01, 0.35))
def test_touching_is_contact_to_the_last_digit(
    index: int, fraction: float, radius_a: float, radius_b: float
) -> None:
    trace, body_a, body_b = mixed(), ball(radius_a), ball(radius_b)
    piece = trace.pieces[index]
    start, end = piece.angle_start, piece.angle_end
    state = InitialState(index, min(end, start + fraction * (end - start)), 0.0)
    found = beside(trace, body_a, state, body_b)
    if found is None:
        ends = InitialState(4, trace.pieces[4].angle_end, 0.0)
        assert gap(trace, body_a, state, body_b, ends)[0] < 0.0
        return
    on, position = found
    assert (on, position) > (state.piece, state.position)
    with mpmath.workdps(40):
        step = 4 * EPSILON * max(1.0, abs(position))
        before = exact_gap(trace, body_a, state, body_b, on, position - step)
        after = exact_gap(trace, body_a, state, body_b, on, position + step)
        assert before < 0 < after or abs(before) + abs(after) < 4 * step
    residual, rounding = gap(trace, body_a, state, body_b, InitialState(on, position, 0.0))
    assert abs(residual) <= rounding


@given(st.floats(0.0, 0.9999), st.floats(0.01, 0.35), st.floats(0.01, 0.35))
def test_touching_is_the_first_contact_to_the_right(
    fraction: float, radius_a: float, radius_b: float
) -> None:
    trace, body_a, body_b = mixed(), ball(radius_a), ball(radius_b)
    piece = trace.pieces[0]
    position = piece.angle_start + fraction * (piece.angle_end - piece.angle_start)
    state = InitialState(0, position, 0.0)
    found = beside(trace, body_a, state, body_b)
    assert found is not None
    for other in trace.pieces[: found[0] + 1]:
        low = position if other.index == 0 else other.angle_start
        high = found[1] if other.index == found[0] else other.angle_end
        for n in range(1, 40):
            between = InitialState(other.index, low + (high - low) * n / 40, 0.0)
            assert gap(trace, body_a, state, body_b, between)[0] < 0.0


@given(st.floats(0.0, 1.0), st.floats(0.01, 0.45), st.floats(0.01, 0.45), st.floats(1.0, 6.2))
def test_in_a_loop_that_comes_back_to_a_body_the_first_contact_counts(
    place: float, radius_a: float, radius_b: float, turn: float
) -> None:
    """The centre of body b may leave the circle of contact and enter it again on one arc."""
    shapes = ArcShape("line", length=1.0), ArcShape("valley", radius=0.5, end_slope=turn)
    trace, body_a, body_b = Trace.chain(0.0, shapes), ball(radius_a), ball(radius_b)
    state = InitialState(0, place, 0.0)
    found = beside(trace, body_a, state, body_b)
    last = (1, turn) if found is None else found
    for index, start in ((0, place), (1, 0.0)):
        end = last[1] if index == last[0] else trace.pieces[index].angle_end
        for share in np.linspace(0.0, 1.0, 100, endpoint=False)[1:] if index <= last[0] else ():
            between = InitialState(index, start + share * (end - start), 0.0)
            assert gap(trace, body_a, state, body_b, between)[0] < 1e-12
    if found is not None:
        residual, rounding = gap(trace, body_a, state, body_b, InitialState(*found, 0.0))
        assert abs(residual) <= rounding


@given(st.floats(-1.3, 1.3), st.floats(-1.3, 1.3), st.floats(0.01, 0.5), st.floats(0.01, 0.5))
def test_gap_on_one_arc_has_no_cancellation(
    at: float, other: float, radius_a: float, radius_b: float
) -> None:
    trace = Trace.chain(-1.3, [ArcShape("valley", radius=1.2, end_slope=1.3)])
    assume(at < other)
    a, b = InitialState(0, at, 0.0), InitialState(0, other, 0.0)
    residual, rounding = gap(trace, ball(radius_a), a, ball(radius_b), b)
    with mpmath.workdps(40):
        exact = exact_gap(trace, ball(radius_a), a, ball(radius_b), 0, other)
        assert abs(residual - exact) <= 8 * EPSILON
    assert 0.0 < rounding < 1e-13


def test_bodies_beside_one_another_over_a_closed_seam() -> None:
    circle = [ArcShape("valley", radius=1.0, end_slope=angle) for angle in (0.0, math.pi)]
    trace = Trace.chain(-math.pi, circle, closed=True)
    state = InitialState(1, math.pi - 1e-3, 0.0)
    found = beside(trace, ball(0.1), state, ball(0.1))
    assert found is not None
    beta = 2.0 * math.asin(0.1 / 0.9)
    assert found[0] == 0
    assert found[1] == pytest.approx(-math.pi - 1e-3 + beta, abs=4e-15)


def test_there_may_be_no_room_beside_a_body() -> None:
    trace = Trace.chain(0.0, [ArcShape("line", length=1.0)])
    at_end = InitialState(0, 0.95, 0.0)
    assert beside(trace, ball(0.1), at_end, ball(0.1)) is None
    assert beside(trace, ball(0.1), InitialState(0, 0.5, 0.0), ball(0.1)) == (0, 0.7)


def test_a_valley_that_is_too_narrow_is_no_place_beside_a_body() -> None:
    valley = ArcShape("valley", radius=0.3, end_slope=1.0)
    trace = Trace.chain(0.0, [ArcShape("line", length=1.0), valley])
    assert beside(trace, ball(0.1), InitialState(0, 0.9, 0.0), ball(0.3)) is None
    assert beside(trace, ball(0.1), InitialState(0, 0.9, 0.0), ball(0.1)) is not None


def test_only_a_hair_beyond_an_end_is_rounding() -> None:
    piece = mixed().pieces[0]
    assert snap_to_piece(piece, math.nextafter(0.4, 1.0)) == 0.4
    assert snap_to_piece(piece, math.nextafter(-1.4, -2.0)) == -1.4
    assert snap_to_piece(piece, 0.1) == 0.1
    assert math.isnan(snap_to_piece(piece, 0.4 + 1e-14))
    assert math.isnan(snap_to_piece(piece, math.nan))


def test_speeds_have_the_sign_of_the_motion() -> None:
    trace = mixed()
    assert speed_of_rate(trace.pieces[0], ball(0.3), -2.0) == -2.0 * (0.8 - 0.3)
    assert speed_of_rate(trace.pieces[2], ball(0.3), 2.0) == 2.0 * (0.6 + 0.3)
    assert speed_of_omega(ball(0.25), -4.0) == -1.0
    with pytest.raises(ValueError, match="no angle"):
        speed_of_rate(trace.pieces[1], ball(0.3), 1.0)
    with pytest.raises(ValueError, match="does not roll"):
        speed_of_omega(Body("particle", 0.0, 1.0, 0.0), 1.0)


def test_a_body_on_a_junction_belongs_to_the_piece_it_moves_into() -> None:
    trace = mixed()
    end, crest = trace.pieces[0].angle_end, trace.pieces[2].angle_start
    assert enter_piece(trace, InitialState(0, end, 0.5)) == InitialState(1, 0.0, 0.5)
    assert enter_piece(trace, InitialState(2, crest, -0.5)) == InitialState(1, 0.7, -0.5)
    for state in (
        InitialState(0, end, 0.0),
        InitialState(0, end, -0.5),
        InitialState(0, trace.pieces[0].angle_start, -0.5),
        InitialState(4, trace.pieces[4].angle_end, 0.5),
        InitialState(2, 0.1, 0.5),
    ):
        assert enter_piece(trace, state) == state


def test_a_body_on_the_seam_of_a_closed_trace_goes_on_at_its_other_side() -> None:
    circle = [ArcShape("valley", radius=1.0, end_slope=math.pi)]
    trace = Trace.chain(-math.pi, circle, closed=True)
    entered = enter_piece(trace, InitialState(0, math.pi, 2.0))
    assert entered == InitialState(0, -math.pi, 2.0)
    assert enter_piece(trace, InitialState(0, -math.pi, -2.0)).position == math.pi


@pytest.mark.parametrize("right", [False, True])
@pytest.mark.parametrize("index", [0, 1, 2])
def test_at_its_wall_a_body_is_one_radius_from_the_plane(index: int, right: bool) -> None:
    piece, radius = mixed().pieces[index], 0.2
    position = wall_position(piece, radius, right)
    end = piece.end if right else piece.start
    slope = piece.end_slope if right else piece.start_slope
    x, y = piece.body_centre(position, radius)
    inward = -1.0 if right else 1.0
    distance = inward * ((x - end[0]) * math.cos(slope) + (y - end[1]) * math.sin(slope))
    assert distance == pytest.approx(radius, rel=1e-14)


def test_a_piece_may_have_no_room_for_a_wall() -> None:
    pieces = mixed().pieces
    assert math.isnan(wall_position(pieces[3], 0.1, right=True))
    assert math.isnan(wall_position(pieces[0], 0.4, right=False))


def test_an_outermost_body_keeps_smaller_ones_from_the_wall_and_not_larger_ones() -> None:
    def on_a_line(*radii: float) -> int:
        trace = Trace.chain(0.0, [ArcShape("line", length=3.0)])
        bodies = [ball(r) for r in radii]
        found: int = reaches_over(trace, bodies, right=False)
        assert found == reaches_over(trace, bodies[::-1], right=True)
        return found

    # Both in the corner, centres (r, r): they overlap unless one is 3 + 2 sqrt 2 times the other.
    ratio = 3.0 + 2.0 * math.sqrt(2.0)
    assert on_a_line(0.02, 0.02 * ratio * (1.0 - 1e-9)) == 0
    assert on_a_line(0.02, 0.02 * ratio * (1.0 + 1e-9)) == 1
    assert on_a_line(0.15, 0.02) == 0
    # Over one, but not over the one before it.
    assert on_a_line(0.15, 0.02, 0.15) == 0


def test_many_places_are_as_single_ones() -> None:
    """Of arrays every element has the bits of the number: settled, at a wall, and the gaps."""
    rng = np.random.default_rng(8)
    count = 300
    trace = mixed()
    radius: Any = rng.uniform(0.01, 0.75, count)
    other: Any = rng.uniform(0.01, 0.35, count)
    for piece in trace.pieces:
        ends = piece.angle_start, piece.angle_end
        place: Any = rng.uniform(ends[0] - 0.1, ends[1] + 0.1, count)
        place[:2] = ends
        found: list[Any] = [
            snap_to_piece(piece, place),
            *(
                np.broadcast_to(wall_position(piece, radius, right), count)
                for right in (False, True)
            ),
        ]
        beside: Any = rng.uniform(0.0, 0.7, count)
        for index in (1, 4):
            there = InitialState(index, beside, 0.0)
            here = InitialState(piece.index, place, 0.0)
            found += gap(trace, ball(other), here, ball(0.2), there)
            found.append(np.broadcast_to(out_of_order(here, there), count))
        for n in range(count):
            r, at, to = float(radius[n]), float(place[n]), float(beside[n])
            single: list[Any] = [snap_to_piece(piece, at)]
            single += [wall_position(piece, r, right) for right in (False, True)]
            for index in (1, 4):
                one, two = InitialState(piece.index, at, 0.0), InitialState(index, to, 0.0)
                single += gap(trace, ball(float(other[n])), one, ball(0.2), two)
                single.append(out_of_order(one, two))
            np.testing.assert_array_equal([column[n] for column in found], single)


@pytest.mark.parametrize("right", [False, True])
def test_the_bound_for_walls_holds(right: bool) -> None:
    """Of two bodies one reaches a wall over the other only where the bound for arrays says so."""
    rng = np.random.default_rng(9)
    count = 400
    between: Any = rng.uniform(0.005, 0.05, count)
    inner: Any = between * rng.uniform(0.5, 9.0, count)
    for shape, end in (("valley", 1.0), ("hump", -1.0), ("line", None)):
        radius, length = (None, 3.0) if shape == "line" else (1.5, None)
        trace = Trace.chain(0.0, [ArcShape(shape, radius, length, end)])
        row = [ball(between), ball(inner)]
        bound = reaches_over(trace, row[::-1] if right else row, right)
        reached = np.zeros(count, dtype=bool)
        for n in range(count):
            pair = [ball(float(between[n])), ball(float(inner[n]))]
            reached[n] = reaches_over(trace, pair[::-1] if right else pair, right) > 0
        assert not (reached & ~bound).any()
        assert 0.1 * count < reached.sum() < 0.9 * count
        assert (bound & ~reached).sum() <= 0.02 * count
