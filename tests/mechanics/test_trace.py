import math
import random
import subprocess
import sys
from collections.abc import Iterable
from fractions import Fraction

import mpmath
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vibro_cli.mechanics.system import CUSTOM, INERTIA_RATIO, Body, mass_from_density
from vibro_cli.mechanics.trace import ArcShape, Piece, Trace, sine_cosine
from vibro_cli.numerics import elementwise

EPSILON = 2.0**-52

SETTINGS = settings(deadline=None, derandomize=True)


def arc(shape: str, radius: float, end_slope: float) -> ArcShape:
    return ArcShape(shape, radius=radius, end_slope=end_slope)


def line(length: float) -> ArcShape:
    return ArcShape("line", length=length)


@st.composite
def chains(draw: st.DrawFn) -> tuple[float, list[ArcShape]]:
    """A start slope and up to eight pieces, each turning as its shape says."""
    slope = start = draw(st.floats(-3.0, 3.0))
    shapes = []
    for _ in range(draw(st.integers(1, 8))):
        shape = draw(st.sampled_from(["valley", "hump", "line"]))
        if shape == "line":
            shapes.append(line(draw(st.floats(0.01, 10.0))))
            continue
        turn = draw(st.floats(0.01, 3.0))
        slope += turn if shape == "valley" else -turn
        shapes.append(arc(shape, draw(st.floats(0.01, 10.0)), slope))
    return start, shapes


def curvature(shape: ArcShape) -> mpmath.mpf:
    return {"valley": 1, "hump": -1}[shape.shape] / mpmath.mpf(shape.radius)


def integrated_ends(start: float, shapes: list[ArcShape]) -> list[tuple[mpmath.mpf, mpmath.mpf]]:
    """Integrate x' = cos α, y' = sin α, α' = curvature to the ends of the pieces, to 50 digits."""
    x = y = mpmath.mpf(0)
    slope = mpmath.mpf(start)
    ends = []
    for shape in shapes:
        if shape.end_slope is None:
            x += shape.length * mpmath.cos(slope)
            y += shape.length * mpmath.sin(slope)
        else:
            end = mpmath.mpf(shape.end_slope)
            x += mpmath.quad(mpmath.cos, [slope, end]) / curvature(shape)
            y += mpmath.quad(mpmath.sin, [slope, end]) / curvature(shape)
            slope = end
        ends.append((x, y))
    return ends


def test_pieces_of_a_long_chain_begin_at_the_sum_of_all_before_rounded_once() -> None:
    """Compared with sums of fractions; each piece takes as long as any other."""
    rng, shapes, slope = random.Random(3), [], 0.3
    for number in range(300):
        if number % 3 == 2:
            shapes.append(line(10.0 ** rng.uniform(-6.0, 3.0)))
            continue
        slope += (1.0 if number % 3 == 0 else -1.0) * rng.uniform(0.1, 2.0)
        shape = "valley" if number % 3 == 0 else "hump"
        shapes.append(arc(shape, 10.0 ** rng.uniform(-6.0, 3.0), slope))
    x = y = s = Fraction(0)
    for piece in Trace.chain(0.3, shapes).pieces:
        assert (piece.start_s, piece.start) == (float(s), (float(x), float(y)))
        s += Fraction(piece.length)
        sine, cosine = sine_cosine(piece.start_slope)
        if piece.is_line:
            x, y = x + Fraction(piece.length * cosine), y + Fraction(piece.length * sine)
            continue
        reach, (sine_end, cosine_end) = piece.sign * piece.radius, sine_cosine(piece.end_slope)
        x += Fraction(-reach * sine) + Fraction(reach * sine_end)
        y += Fraction(reach * cosine) + Fraction(-reach * cosine_end)


def test_a_chain_takes_no_more_terms_the_longer_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    counts: list[int] = []

    def counted(terms: Iterable[float]) -> float:
        given = list(terms)
        counts.append(len(given))
        return math.fsum(given)

    monkeypatch.setattr(elementwise, "exact_sum", counted)
    shapes = [arc("valley", 0.7, 0.9), arc("hump", 1.3, -0.9)] * 200
    Trace.chain(-0.9, shapes)
    assert max(counts) < 10


@SETTINGS
@given(chains())
def test_ends_follow_the_differential_equation_of_the_trace(
    chain: tuple[float, list[ArcShape]],
) -> None:
    start, shapes = chain
    trace = Trace.chain(start, shapes)
    size = sum(shape.radius or shape.length or 0.0 for shape in shapes)
    with mpmath.workdps(50):
        exact = integrated_ends(start, shapes)
        for piece, (x, y) in zip(trace.pieces, exact, strict=True):
            assert abs(piece.end[0] - x) <= 2 * EPSILON * size
            assert abs(piece.end[1] - y) <= 2 * EPSILON * size


@SETTINGS
@given(chains(), st.floats(0.0, 0.009))
def test_the_path_of_a_centre_is_continuous_at_junctions(
    chain: tuple[float, list[ArcShape]], radius: float
) -> None:
    trace = Trace.chain(*chain)
    for left, right in zip(trace.pieces, trace.pieces[1:], strict=False):
        assert left.slope(left.angle_end) == right.slope(right.angle_start)
        assert left.arc_length(left.angle_end) == pytest.approx(right.start_s, rel=1e-14)
        end = left.body_centre(left.angle_end, radius)
        start = right.body_centre(right.angle_start, radius)
        assert math.dist(end, start) <= 1e-14 * (10.0 + trace.length)


@SETTINGS
@given(chains(), st.floats(0.0, 1.0), st.floats(0.0, 0.009))
def test_a_centre_is_one_radius_from_its_contact_point_along_the_normal(
    chain: tuple[float, list[ArcShape]], fraction: float, radius: float
) -> None:
    for piece in Trace.chain(*chain).pieces:
        position = piece.angle_start + fraction * (piece.angle_end - piece.angle_start)
        contact, centre = piece.contact_point(position), piece.body_centre(position, radius)
        slope = piece.slope(position)
        normal = (-math.sin(slope), math.cos(slope))
        assert centre[0] - contact[0] == pytest.approx(radius * normal[0], abs=1e-13)
        assert centre[1] - contact[1] == pytest.approx(radius * normal[1], abs=1e-13)


@SETTINGS
@given(chains(), st.floats(0.01, 0.99))
def test_the_tangent_of_the_path_is_the_slope(
    chain: tuple[float, list[ArcShape]], fraction: float
) -> None:
    for piece in Trace.chain(*chain).pieces:
        position = piece.angle_start + fraction * (piece.angle_end - piece.angle_start)
        step = 1e-6 * (piece.angle_end - piece.angle_start)
        before = piece.contact_point(position - step)
        after = piece.contact_point(position + step)
        length = math.dist(before, after)
        assert length == pytest.approx(
            piece.arc_length(position + step) - piece.arc_length(position - step), rel=1e-5
        )
        slope = piece.slope(position)
        assert (after[0] - before[0]) / length == pytest.approx(math.cos(slope), abs=1e-5)
        assert (after[1] - before[1]) / length == pytest.approx(math.sin(slope), abs=1e-5)


@pytest.mark.parametrize("quarter", range(-8, 9))
def test_quarter_turns_have_exact_sines_and_cosines(quarter: int) -> None:
    with mpmath.workdps(30):
        nearest = float(quarter * mpmath.pi / 2)
    sine, cosine = sine_cosine(nearest)
    assert (sine, cosine) == [(0, 1), (1, 0), (0, -1), (-1, 0)][quarter % 4]


@SETTINGS
@given(st.floats(-100.0, 100.0))
def test_sine_and_cosine_elsewhere_are_those_of_the_angle(angle: float) -> None:
    sine, cosine = sine_cosine(angle)
    with mpmath.workdps(40):
        assert abs(sine - mpmath.sin(angle)) <= max(math.ulp(1.0), 0.5 * math.ulp(angle))
        assert abs(cosine - mpmath.cos(angle)) <= max(math.ulp(1.0), 0.5 * math.ulp(angle))


def test_the_circle_and_the_stadium_close_exactly() -> None:
    circle = Trace.chain(-math.pi, [arc("valley", 1.7, math.pi)], closed=True)
    assert circle.closing_error() == (0.0, math.tau)
    assert circle.length == 1.7 * math.tau
    sides = [line(2.3), arc("valley", 0.7, math.pi), line(2.3), arc("valley", 0.7, math.tau)]
    assert Trace.chain(0.0, sides, closed=True).closing_error() == (0.0, math.tau)


@SETTINGS
@given(st.floats(0.01, 3.0), st.floats(0.01, 1.5), st.floats(0.01, 10.0), st.floats(0.01, 10.0))
def test_a_symmetric_trace_has_equal_ends_and_level_junctions(
    outer: float, inner: float, valley: float, hump: float
) -> None:
    shapes = [arc("valley", valley, inner), arc("hump", hump, -inner), arc("valley", valley, outer)]
    first, middle, last = Trace.chain(-outer, shapes).pieces
    assert last.end[1] == first.start[1] == 0.0
    assert middle.start[1] == middle.end[1]
    assert first.centre[1] == last.centre[1]


@pytest.mark.parametrize(
    ("shape", "message"),
    [
        (arc("valley", 1.0, -0.5), "must rise"),
        (arc("hump", 1.0, 0.5), "must fall"),
        (arc("valley", 0.0, 0.5), "radius greater than 0"),
        (arc("valley", math.nan, 0.5), "radius greater than 0"),
        (ArcShape("hump", radius=1.0), "end slope"),
        (ArcShape("line"), "length greater than 0"),
        (ArcShape("spiral"), "unknown shape"),
    ],
)
def test_a_piece_that_makes_no_chain_is_refused(shape: ArcShape, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Trace.chain(0.0, [shape])


def test_a_trace_without_pieces_is_refused() -> None:
    with pytest.raises(ValueError, match="at least one"):
        Trace.chain(0.0, [])


def test_the_radius_of_the_path_depends_on_the_side() -> None:
    def radius_of(piece: Piece) -> float:
        return piece.path_radius(0.25)

    shapes = [arc("valley", 1.0, 1.0), line(1.0), arc("hump", 1.0, 0.0)]
    assert [*map(radius_of, Trace.chain(0.0, shapes).pieces)] == [0.75, math.inf, 1.25]


@pytest.mark.parametrize(
    ("kind", "kappa"),
    [("ball", 7 / 5), ("disk", 3 / 2), ("hollow_ball", 5 / 3), ("hoop", 2.0), ("particle", 1.0)],
)
def test_kappa_is_the_double_nearest_to_its_ratio(kind: str, kappa: float) -> None:
    assert Body(kind, 0.1, 2.0, INERTIA_RATIO[kind]).kappa == kappa
    assert Body(kind, 0.5, 2.0, INERTIA_RATIO[kind]).rolling_inertia == kappa * 0.5
    assert Body(CUSTOM, 0.1, 2.0, 0.25).kappa == 1.25


@pytest.mark.parametrize("kind", ["hollow_ball", "hoop"])
def test_masses_of_thin_bodies_are_limits_of_those_of_thick_ones(kind: str) -> None:
    radius, thickness, density = 0.3, 1e-4, 7800.0
    outer, inner = radius + thickness / 2, radius - thickness / 2
    exact = {
        "hollow_ball": 4 / 3 * math.pi * (outer**3 - inner**3) * density,
        "hoop": math.pi * (outer**2 - inner**2) * thickness * density,
    }[kind]
    assert mass_from_density(kind, radius, density, thickness) == pytest.approx(exact, rel=1e-7)


def test_masses_of_ball_and_disk() -> None:
    assert mass_from_density("ball", 0.1, 7800.0) == pytest.approx(32.6725635973, rel=1e-11)
    assert mass_from_density("disk", 0.1, 1000.0, 0.02) == pytest.approx(0.2 * math.pi, rel=1e-15)
    with pytest.raises(ValueError, match="needs a thickness"):
        mass_from_density("disk", 0.1, 1000.0)
    with pytest.raises(ValueError, match="does not follow"):
        mass_from_density(CUSTOM, 0.1, 1000.0)


def test_geometry_needs_no_numpy() -> None:
    modules = "trace, system, reachability, initial_conditions"
    code = f"import sys; from vibro_cli.mechanics import {modules}; print('numpy' in sys.modules)"
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"
