import math
from itertools import pairwise
from typing import Any

import mpmath
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from tests.effort import calls
from vibro_cli.mechanics.reachability import (
    Path,
    contact_angle,
    fits_between,
    joined_behind,
    narrow_valleys,
    over_others,
    overlapping_pieces,
    overreaching,
    pocket_radius,
    reach,
    surely_sound,
    touch_across,
    touched_pieces,
)
from vibro_cli.mechanics.system import Body
from vibro_cli.mechanics.trace import ArcShape, Trace

Array = NDArray[np.float64]
SAMPLES = 120


def arc(shape: str, radius: float, degrees: float) -> ArcShape:
    return ArcShape(shape, radius=radius, end_slope=math.radians(degrees))


def line(length: float) -> ArcShape:
    return ArcShape("line", length=length)


def chain(start: float, *shapes: ArcShape, closed: bool = False) -> Trace:
    return Trace.chain(math.radians(start), shapes, closed)


def ball(radius: float) -> Body:
    return Body("ball", radius, 1.0, 0.4)


def three_arcs() -> Trace:
    shapes = arc("valley", 1.0, 50), arc("hump", 0.5, -50), arc("valley", 1.0, 120)
    return chain(-120, *shapes)


def stadium() -> Trace:
    half = arc("valley", 0.5, 180), line(2.0), arc("valley", 0.5, 360)
    return chain(0, line(2.0), *half, closed=True)


def positions(trace: Trace) -> list[Array]:
    return [np.linspace(p.angle_start, p.angle_end, SAMPLES) for p in trace.pieces]


def centres(trace: Trace, radius: float) -> list[Array]:
    """Return sampled centres of a body, piece by piece: arrays (SAMPLES, 2)."""
    return [
        np.array([piece.body_centre(float(q), radius) for q in along])
        for piece, along in zip(trace.pieces, positions(trace), strict=True)
    ]


def distances(one: Array, two: Array) -> Array:
    offset = one[:, None, :] - two[None, :, :]
    return np.asarray(np.hypot(offset[..., 0], offset[..., 1]), dtype=np.float64)


def slopes(trace: Trace) -> Array:
    return np.concatenate(
        [
            [piece.slope(float(q)) for q in along]
            for piece, along in zip(trace.pieces, positions(trace), strict=True)
        ]
    )


def turns(trace: Trace) -> Array:
    """Range of the slopes between any two sampled places of an open trace."""
    slope = slopes(trace)
    table = np.zeros((slope.size, slope.size))
    for first in range(slope.size):
        high = np.maximum.accumulate(slope[first:])
        low = np.minimum.accumulate(slope[first:])
        table[first, first:] = table[first:, first] = high - low
    return table


@st.composite
def traces(draw: st.DrawFn, pieces: int = 5, turn: float = 3.0) -> Trace:
    """Draw open traces of valleys, humps and lines, ordinary and extreme."""
    slope = start = draw(st.floats(-2.5, 1.0))
    shapes = []
    for _ in range(draw(st.integers(1, pieces))):
        shape = draw(st.sampled_from(["valley", "hump", "line"]))
        if shape == "line":
            shapes.append(line(draw(st.floats(0.05, 3.0))))
            continue
        slope += draw(st.floats(0.05, turn)) * (1.0 if shape == "valley" else -1.0)
        shapes.append(ArcShape(shape, radius=draw(st.floats(0.1, 2.0)), end_slope=slope))
    return Trace.chain(start, shapes)


def assert_no_sampled_point_is_touched(trace: Trace, radius: float) -> None:
    """Fail if a body that passes comes to a point of a piece that it is said not to touch."""
    assume(not any(narrow_valleys(trace, radius) + overlapping_pieces(trace)))
    touched = touched_pieces(trace, radius)
    bodies, points = centres(trace, radius), centres(trace, 0.0)
    for i, body in enumerate(bodies):
        for j, piece in enumerate(points):
            if (i, j) not in touched:
                assert distances(body, piece).min() >= radius - 1e-12


@pytest.mark.long
@settings(deadline=None)
@given(traces(), st.floats(0.0, 0.5))
def test_a_body_that_passes_touches_no_sampled_point(trace: Trace, radius: float) -> None:
    assert_no_sampled_point_is_touched(trace, radius)


@pytest.mark.long
@settings(deadline=None)
@given(traces(), st.floats(0.01, 0.5))
def test_a_body_that_is_refused_touches_another_piece(trace: Trace, radius: float) -> None:
    assume(not any(narrow_valleys(trace, radius) + overlapping_pieces(trace)))
    turned = turns(trace)
    bodies, points = centres(trace, radius), centres(trace, 0.0)
    for i, j in touched_pieces(trace, radius):
        stretch = turned[i * SAMPLES : (i + 1) * SAMPLES, j * SAMPLES : (j + 1) * SAMPLES]
        elsewhere = stretch >= math.pi - 0.1
        near = distances(bodies[i], points[j])[elsewhere].min()
        spacing = max(trace.pieces[n].length for n in (i, j)) + math.pi * radius
        assert near <= radius + spacing / (SAMPLES - 1)


@settings(deadline=None)
@given(traces(), st.floats(0.02, 0.5), st.floats(0.02, 0.5))
def test_pieces_out_of_reach_are_out_of_reach(trace: Trace, a: float, b: float) -> None:
    assume(not any(narrow_valleys(trace, max(a, b))))
    meeting = reach(trace, ball(a), ball(b))
    paths_a, paths_b = centres(trace, a), centres(trace, b)
    for i, path_a in enumerate(paths_a):
        for j, path_b in enumerate(paths_b):
            nearest = distances(path_a, path_b).min()
            if (i, j) not in meeting:
                assert nearest > a + b
            elif abs(i - j) > 1:
                spacing = sum(trace.pieces[n].length for n in (i, j)) + math.tau * (a + b)
                assert nearest <= a + b + spacing / (SAMPLES - 1)


def overlapping_over_one_between(trace: Trace, radii: tuple[float, float, float]) -> bool:
    """Whether sampled places in order let the outer two of three bodies touch, and no others."""
    a, m, c = (np.concatenate(centres(trace, radius)) for radius in radii)
    places = np.arange(len(a))
    right = places[None, :] > places[:, None]
    free_left = (distances(a, m) >= radii[0] + radii[1]) & right
    free_right = (distances(m, c) >= radii[1] + radii[2]) & right
    between = free_left.astype(np.float32) @ free_right.astype(np.float32) > 0.0
    return bool((between & (distances(a, c) <= radii[0] + radii[2])).any())


@pytest.mark.long
@settings(deadline=None, max_examples=300)
@given(traces(pieces=4, turn=2.0), st.tuples(*[st.floats(0.01, 0.4)] * 3))
def test_bodies_that_pass_never_touch_over_one_between(
    trace: Trace, radii: tuple[float, float, float]
) -> None:
    assume(not any(narrow_valleys(trace, max(radii)) + overlapping_pieces(trace)))
    assume(not any(touched_pieces(trace, radius) for radius in {0.0, *radii}))
    pairs = [(radii[0], radii[1]), (radii[1], radii[2]), (radii[0], radii[2])]
    assume(not any(any(joined_behind(trace, *pair)) for pair in pairs))
    if not overreaching(trace, radii):
        assert not overlapping_over_one_between(trace, radii)


@st.composite
def closed_traces(draw: st.DrawFn) -> Trace:
    """A random chain that turns by π, and the same chain again: closed whatever its shape."""
    turns_of_half = draw(st.lists(st.floats(-1.5, 2.5), min_size=1, max_size=3))
    rest = math.pi - math.fsum(turns_of_half)
    assume(abs(rest) > 0.05 and all(abs(turn) > 0.05 for turn in turns_of_half))
    shapes, slope = [], 0.0
    length = draw(st.floats(0.1, 2.0))
    radii = [draw(st.floats(0.1, 2.0)) for _ in range(len(turns_of_half) + 1)]
    for half in (0.0, math.pi):
        shapes.append(line(length))
        for turn, radius in zip([*turns_of_half, rest], radii, strict=True):
            slope += turn
            shape = "valley" if turn > 0.0 else "hump"
            shapes.append(ArcShape(shape, radius=radius, end_slope=slope))
        slope = half + math.pi
        shapes[-1] = ArcShape(shapes[-1].shape, radius=radii[-1], end_slope=slope)
    return Trace.chain(0.0, shapes, closed=True)


@pytest.mark.long
@settings(deadline=None)
@given(closed_traces(), st.floats(0.0, 0.5))
def test_on_closed_traces_too_a_body_that_passes_touches_no_sampled_point(
    trace: Trace, radius: float
) -> None:
    distance, turn = trace.closing_error()
    assert distance <= 1e-14 * trace.length
    assert turn == math.tau
    assert_no_sampled_point_is_touched(trace, radius)


def opposite_bodies_touch(trace: Trace, radii: tuple[float, ...]) -> bool:
    """Whether sampled places of four bodies on a closed trace let the first touch the third."""
    a, m, c, d = (np.concatenate(centres(trace, radius)) for radius in radii)
    free = {
        "am": distances(a, m) >= radii[0] + radii[1],
        "mc": distances(m, c) >= radii[1] + radii[2],
        "cd": distances(c, d) >= radii[2] + radii[3],
        "da": distances(d, a) >= radii[3] + radii[0],
    }
    touching = np.argwhere(distances(a, c) <= radii[0] + radii[2])
    count = len(a)
    for at_a, at_c in touching[:: max(1, len(touching) // 2000)]:
        ahead = (np.arange(count) - at_a) % count
        forward = ahead < ahead[at_c]
        can_m = (free["am"][at_a] & free["mc"][:, at_c] & forward).any()
        can_d = (free["cd"][at_c] & free["da"][:, at_a] & ~forward).any()
        if at_a != at_c and can_m and can_d:
            return True
    return False


@pytest.mark.long
@settings(deadline=None, max_examples=30)
@given(closed_traces(), st.tuples(*[st.floats(0.01, 0.3)] * 4))
def test_on_closed_traces_bodies_that_pass_never_touch_over_others(
    trace: Trace, radii: tuple[float, float, float, float]
) -> None:
    assume(not any(narrow_valleys(trace, max(radii)) + overlapping_pieces(trace)))
    assume(not any(touched_pieces(trace, radius) for radius in {0.0, *radii}))
    pairs = [(a, b) for n, a in enumerate(radii) for b in radii[n + 1 :]]
    assume(not any(any(joined_behind(trace, *pair)) for pair in pairs))
    if not overreaching(trace, radii):
        assert not opposite_bodies_touch(trace, radii)
        assert not opposite_bodies_touch(trace, (*radii[1:], radii[0]))


@pytest.mark.parametrize("degrees", [-50.0, 0.0, 30.0])
def test_on_a_line_a_quarter_of_the_radius_is_the_limit(degrees: float) -> None:
    trace = chain(degrees, line(20.0))
    below, above = math.nextafter(0.25, 0.0), 0.25 * (1.0 + 1e-12)
    assert overreaching(trace, (1.0, below, 1.0))[0].over == (1,)
    assert not overreaching(trace, (1.0, above, 1.0))
    assert not overreaching(trace, (0.1, 1.0, 0.1))
    assert not overreaching(trace, (1.0, 0.2, 0.2, 1.0))
    assert overreaching(trace, (1.0, 0.05, 0.05, 1.0))[0].over == (1, 2)


@pytest.mark.parametrize("shape", ["valley", "hump"])
def test_on_an_arc_the_limit_is_the_circle_that_touches_all_three(shape: str) -> None:
    turn = 100.0 if shape == "valley" else -100.0
    trace = chain(-turn, arc(shape, 2.0, turn))
    limit = pocket_radius(0.5 if shape == "valley" else -0.5, 0.3, 0.5)
    piece = trace.pieces[0]
    room = contact_angle(piece, 0.3, 0.5)
    taken = contact_angle(piece, 0.3, limit) + contact_angle(piece, limit, 0.5)
    assert taken == pytest.approx(room, rel=1e-14)
    assert fits_between(trace, (0.3, 0.5), (limit * (1.0 - 1e-12),))
    assert not fits_between(trace, (0.3, 0.5), (limit * (1.0 + 1e-12),))
    assert (limit > 0.3 * 0.5 / (math.sqrt(0.3) + math.sqrt(0.5)) ** 2) == (shape == "valley")


def test_across_junctions_the_tightest_valley_decides() -> None:
    trace = chain(-60, arc("valley", 1.0, 0), line(5.0), arc("valley", 2.0, 60))
    limit = pocket_radius(1.0, 0.3, 0.3)
    assert not overreaching(trace, (0.3, limit * 1.01, 0.3))
    assert overreaching(trace, (0.3, limit * 0.99, 0.3)) != ()
    found = overreaching(trace, (0.3, 0.1, 0.3, limit * 0.99, 0.3))
    assert [(pair.first, pair.over) for pair in found] == [(0, (1,)), (2, (3,))]


def test_on_a_closed_trace_both_ways_round_count() -> None:
    circle = chain(-180, arc("valley", 2.0, 180), closed=True)
    assert not overreaching(circle, (0.3, 0.3, 0.3, 0.3))
    found = overreaching(circle, (0.3, 0.02, 0.3))
    assert [(pair.first, pair.second, pair.over) for pair in found] == [(0, 2, (1,))]
    found = overreaching(circle, (0.3, 0.3, 0.3, 0.02))
    assert [(pair.first, pair.second, pair.over) for pair in found] == [(0, 2, (3,))]
    found = overreaching(circle, (0.02, 0.3, 0.3, 0.3))
    assert [(pair.first, pair.second, pair.over) for pair in found] == [(1, 3, (0,))]


def test_bodies_that_touch_across_a_mouth_are_found() -> None:
    overhang = chain(-170, arc("valley", 1.0, 90), line(0.2), arc("valley", 1.2, 150))
    assert touched_pieces(overhang, 0.1) == ()
    assert touch_across(overhang, 0.1, 0.1) is None
    across = touch_across(overhang, 0.45, 0.45)
    assert across is not None
    found = overreaching(overhang, (0.45, 0.45, 0.45))
    assert [pair.pieces for pair in found if not pair.over] == [across]


def test_nearly_full_turns_join_bodies_behind() -> None:
    assert joined_behind(chain(-179.9, arc("valley", 1.0, 179.9)), 0.1, 0.1) == [True]
    assert joined_behind(chain(-150, arc("valley", 1.0, 150)), 0.1, 0.1) == [False]
    assert joined_behind(chain(-180, arc("valley", 1.0, 180), closed=True), 0.1, 0.1) == [False]
    beta = contact_angle(three_arcs().pieces[0], 0.1, 0.2)
    open_by = math.pi - 0.5 * beta
    for turn, joined in ((open_by + 1e-9, True), (open_by - 1e-9, False)):
        trace = Trace.chain(-turn, [ArcShape("valley", radius=1.0, end_slope=turn)])
        assert joined_behind(trace, 0.1, 0.2) == [joined]


def test_narrow_valleys_and_full_turns_are_named() -> None:
    trace = chain(-60, arc("valley", 0.3, 0), line(1.0), arc("valley", 0.2, 60))
    assert narrow_valleys(trace, 0.1) == [False, False, False]
    assert narrow_valleys(trace, 0.2) == [False, False, True]
    assert narrow_valleys(trace, 0.3) == [True, False, True]
    assert overlapping_pieces(chain(-180, arc("valley", 1.0, 180))) == [True]
    assert overlapping_pieces(chain(-180, arc("valley", 1.0, 180), closed=True)) == [False]
    loop = chain(0, line(1.0), arc("valley", 1.0, 361), line(1.0))
    assert overlapping_pieces(loop) == [False, True, False]


def test_open_loops_and_crossings_are_found() -> None:
    loop = chain(0, line(1.0), arc("valley", 1.0, 350), arc("hump", 3.0, 300))
    assert touched_pieces(loop, 0.0) != ()
    mouth = chain(90, arc("hump", 0.05, -90), line(2.0), arc("valley", 0.2, 90), line(2.0))
    assert touched_pieces(mouth, 0.19) == ()
    flask = chain(-90, line(1.0), arc("hump", 0.1, -150), arc("valley", 0.5, 150), line(0.4))
    assert touched_pieces(flask, 0.05) == ()
    assert touched_pieces(flask, 0.45) != ()


@pytest.mark.parametrize("radius", [0.05, 0.49, 0.499])
def test_a_body_almost_as_large_as_the_stadium_fits(radius: float) -> None:
    assert touched_pieces(stadium(), radius) == ()


def test_a_circle_may_be_cut_into_arcs_anywhere() -> None:
    parts = [arc("valley", 1.0, degrees) for degrees in (-100, 5, 70, 180)]
    circle = chain(-180, *parts, closed=True)
    for radius in (0.0, 0.1, 0.6, 0.9):
        assert touched_pieces(circle, radius) == ()
    assert touch_across(circle, 0.2, 0.3) is None
    assert not overreaching(circle, (0.2, 0.2, 0.3, 0.2))
    open_circle = chain(-180, *parts)
    assert set(touched_pieces(open_circle, 0.1)) == {(0, 3), (3, 0)}


def test_contact_angle_agrees_with_the_distance_of_the_centres() -> None:
    for piece in three_arcs().pieces:
        beta = contact_angle(piece, 0.2, 0.03)
        with mpmath.workdps(40):
            rho_a, rho_b = (mpmath.mpf(piece.path_radius(r)) for r in (0.2, 0.03))
            cosine = (rho_a**2 + rho_b**2 - (mpmath.mpf(0.2) + 0.03) ** 2) / (2 * rho_a * rho_b)
            assert abs(beta / mpmath.acos(cosine) - 1) <= 1e-15
    assert contact_angle(three_arcs().pieces[0], 0.6, 0.5) == math.inf


def test_pocket_radius_solves_descartes_theorem() -> None:
    for curvature in (-2.0, 0.0, 0.7):
        with mpmath.workdps(40):
            a, b = 1 / mpmath.mpf(0.3), 1 / mpmath.mpf(0.4)
            k = mpmath.mpf(curvature)
            pocket = 1 / mpmath.mpf(pocket_radius(curvature, 0.3, 0.4))
            squares = a**2 + b**2 + k**2 + pocket**2
            assert abs((a + b - k + pocket) ** 2 - 2 * squares) <= 1e-13 * squares
    assert pocket_radius(1.0, 0.6, 0.6) == math.inf


def test_three_arcs_are_checked_quickly() -> None:
    def all_checks() -> None:
        trace = three_arcs()
        touched_pieces(trace, 0.0)
        touched_pieces(trace, 0.1)
        overreaching(trace, (0.1, 0.1))
        reach(trace, ball(0.1), ball(0.1))

    assert calls(all_checks) < 2000
    meeting = reach(three_arcs(), ball(0.1), ball(0.1))
    assert tuple((0, j) not in meeting for j in range(3)) == (False, False, True)


def long_trace(pieces: int) -> Trace:
    slopes_of_ends = [40 if n % 2 == 0 else -40 for n in range(pieces)]
    shapes = [arc("valley" if after > 0 else "hump", 0.5, after) for after in slopes_of_ends]
    return chain(-40, *shapes)


def test_long_traces_are_checked_in_reasonable_time() -> None:
    """Every piece is checked only with its neighbourhood: twice the work for twice the length."""

    def check(trace: Trace) -> None:
        assert touched_pieces(trace, 0.1) == ()
        reach(trace, ball(0.1), ball(0.1))

    short, trace = long_trace(30), long_trace(60)
    assert calls(lambda: check(trace)) < 2.5 * calls(lambda: check(short))
    meeting = reach(trace, ball(0.1), ball(0.1))
    assert all(((i, j) not in meeting) == (abs(i - j) > 1) for i in range(60) for j in range(60))


@pytest.mark.parametrize("trace", [chain(-20, arc("valley", 500.0, 20)), three_arcs()])
def test_many_bodies_are_checked_in_reasonable_time(trace: Trace) -> None:
    """Every pair is checked at most once, whatever is between them."""

    def check(count: int) -> int:
        return calls(lambda: overreaching(trace, (0.1,) * count))

    assert check(80) < 2.5 * check(40)


@pytest.mark.parametrize("power", [-20, -1, 1, 20])
def test_many_traces_are_searched_alike_in_any_unit_of_length(
    power: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Lines that a body touches, or that it just misses: as many intervals are searched."""
    searched = []
    point = Path.point

    def noted(path: Path, position: Any) -> Any:
        searched.append(np.size(position))
        return point(path, position)

    def check(metres: float) -> tuple[list[bool], int]:
        searched.clear()
        ends = line(np.linspace(0.3, 1.5, 40) * metres)  # type: ignore[arg-type]
        turn = ArcShape("valley", radius=0.5 * metres, end_slope=math.radians(100))
        radii = (0.2 * metres, 0.1 * metres, 0.2 * metres)
        sound = surely_sound(chain(-100, ends, turn, ends), radii, 40)
        return sound.tolist(), sum(searched)

    monkeypatch.setattr(Path, "point", noted)
    sound, intervals = check(1.0)
    assert 0 < sum(sound) < 40
    assert check(math.ldexp(1.0, power)) == (sound, intervals)


def test_no_row_is_left_out_that_fits_between_two_bodies() -> None:
    """Against all rows: bodies of any sizes, on one piece and on several."""
    random = np.random.default_rng(4)
    ring = chain(-180, arc("valley", 3.0, 180), closed=True)
    hump = chain(60, arc("hump", 3.0, -60))
    joined = chain(60, arc("hump", 3.0, 0), arc("valley", 0.7, 60))
    for trace in (chain(-60, arc("valley", 3.0, 60)), hump, ring, joined, three_arcs()):
        drawn = [tuple(row) for row in (0.3 * random.random((20, 8)) ** 4 + 1e-4).tolist()]
        for radii in (*drawn, (0.3, *[0.05] * 6, 0.3)):
            every = [
                row
                for (left, right), row in over_others(len(radii), trace.closed)
                if fits_between(trace, (radii[left], radii[right]), tuple(radii[n] for n in row))
            ]
            assert [one.over for one in overreaching(trace, radii) if one.over] == every
    assert all(a < b for a, b in pairwise(p.start_s for p in trace.pieces))


def test_many_traces_are_certified_at_once() -> None:
    """What is surely clear is so for the search of a single trace; it is nearly all that is."""
    rng = np.random.default_rng(11)
    count = 150
    ends: Any = rng.uniform(2.0, 5.3, count)
    radius: Any = rng.uniform(0.02, 0.6, count)
    hump = rng.uniform(0.2, 1.5, count)

    def chain(end: Any, of_hump: Any) -> Trace:
        shapes = [("valley", 1.0, 0.9), ("hump", of_hump, -0.9), ("valley", 1.0, end)]
        return Trace.chain(-2.0, [ArcShape(kind, r, None, e) for kind, r, e in shapes])

    radii = radius, 0.5 * radius, radius, 0.3 * radius
    clear = surely_sound(chain(ends, hump), radii, count)
    singly = np.ones(count, dtype=bool)
    for n, (end, of_hump, *row) in enumerate(zip(ends, hump, *radii, strict=True)):
        trace = chain(float(end), float(of_hump))
        touched = any(touched_pieces(trace, float(r)) for r in (0.0, *row))
        singly[n] = not touched and not overreaching(trace, tuple(map(float, row)))
    assert not (clear & ~singly).any()
    assert 0.2 * count < singly.sum() < 0.9 * count
    assert (singly & ~clear).sum() <= 0.02 * count
