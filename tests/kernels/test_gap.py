"""The gap of two neighbours: as an angle on one arc, as a distance on two pieces."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.bare_system import bare_system
from tests.highprecision.reference_solver import Place, ReferenceSolver
from tests.kernels.kernel_records import Records, ball, records, three_arcs
from vibro_cli.kernels.contact.contact_kinematics import (
    centre_position,
    centre_tangent,
    distance_gap,
    half_gap_sine,
)
from vibro_cli.mechanics.system import Body, InitialState
from vibro_cli.mechanics.trace import ArcShape, Trace
from vibro_cli.stress.oracles.scene import Real, mp, scene_of_system
from vibro_cli.systems.trace.world import half_angle

EPSILON = 2.0**-52
SETTINGS = settings(deadline=None, derandomize=True, max_examples=100)
BODIES = (ball(0.1), Body("disk", 0.13, 2.0, 0.5))
TRACE = three_arcs()


def scene(
    starts: tuple[InitialState, ...], trace: Trace = TRACE
) -> tuple[Records, ReferenceSolver]:
    """The kernels' records of two bodies, and the same in high precision."""
    system = bare_system(trace, BODIES, starts)
    return records(trace, BODIES, starts), ReferenceSolver(scene_of_system(system))


def place(piece: int, share: float, speed: float) -> InitialState:
    shape = TRACE.pieces[piece]
    position = shape.angle_start + share * (shape.angle_end - shape.angle_start)
    return InitialState(piece, position, speed)


def derivatives(twin: ReferenceSolver, t: Real) -> tuple[Real, Real, Real]:
    """Gap and its derivatives by differences in high precision."""
    h = mp.mpf(10) ** -10

    def gap(at: Real) -> Real:
        a, b = twin.at(0, at), twin.at(1, at)
        return _distance(a, b) - sum(body.radius for body in twin.scene.bodies)

    early, now, late = (gap(t + step) for step in (-h, mp.zero, h))
    return now, (late - early) / (2 * h), (late - 2 * now + early) / h**2


def _distance(a: Place, b: Place) -> Real:
    return mp.hypot(b.centre[0] - a.centre[0], b.centre[1] - a.centre[1])


@SETTINGS
@given(
    shares=st.tuples(st.floats(0.02, 0.98), st.floats(0.02, 0.98)),
    speeds=st.tuples(st.floats(-4.0, 4.0), st.floats(-4.0, 4.0)),
    pieces=st.sampled_from([(0, 1), (1, 2), (0, 2), (1, 1), (2, 2)]),
)
def test_distance_and_its_derivatives(
    shares: tuple[float, float], speeds: tuple[float, float], pieces: tuple[int, int]
) -> None:
    starts = tuple(map(place, pieces, shares, speeds))
    found, twin = scene(starts)
    a, b = found.flights
    if abs(_distance(twin.at(0, mp.zero), twin.at(1, mp.zero))) < 0.05:
        return
    pull = [
        -found.tracks[body][flight.piece].gravity_rate * 2.0 * flight.s * flight.c
        for body, flight in enumerate((a, b))
    ]
    gap, rate, second = distance_gap(
        found.pieces[a.piece], found.tracks[0][a.piece],
        found.pieces[b.piece], found.tracks[1][b.piece],
        (a.s, a.c, a.p, b.s, b.c, b.p), (pull[0], pull[1]),
        sum(body.radius for body in BODIES),
    )  # fmt: skip
    exact = derivatives(twin, mp.zero)
    assert abs(gap - exact[0]) <= 16 * EPSILON
    assert abs(rate - exact[1]) <= 1e-13
    assert abs(second - exact[2]) <= 1e-11


@pytest.mark.parametrize("piece", [0, 1, 2])
def test_centre_and_tangent(piece: int) -> None:
    for share in (0.0, 0.2, 0.5, 0.9, 1.0):
        start = place(piece, share, 1.0)
        found, twin = scene((start, start))
        s, c = half_angle(TRACE.pieces[piece], start.position)
        shape, track = found.pieces[piece], found.tracks[1][piece]
        exact = twin.at(1, mp.zero)
        for value, true in zip(centre_position(shape, track, s, c), exact.centre, strict=True):
            assert abs(value - true) <= 4 * EPSILON
        for value, true in zip(centre_tangent(shape, s, c), exact.tangent, strict=True):
            assert abs(value - true) <= 4 * EPSILON


@SETTINGS
@given(middle=st.floats(-1.5, 0.3), apart=st.floats(0.0, 1.4))
def test_half_gap_on_one_arc(middle: float, apart: float) -> None:
    starts = (InitialState(0, middle, 0.0), InitialState(0, middle + apart * 0.3, 0.0))
    found, _ = scene(starts)
    a, b = found.flights
    sine, cosine = half_gap_sine(found.contacts[0], a.s, a.c, b.s, b.c, 1.0)
    rho = [mp.mpf(1) - mp.mpf(body.radius) for body in BODIES]
    radii = mp.mpf(BODIES[0].radius) * mp.mpf(BODIES[1].radius)
    beta = 2 * mp.asin(mp.sqrt(radii / (rho[0] * rho[1])))
    gap = mp.mpf(starts[1].position) - mp.mpf(starts[0].position) - beta
    assert abs(sine - mp.sin(gap / 2)) <= 4 * EPSILON
    assert abs(cosine - mp.cos(gap / 2)) <= 4 * EPSILON


def test_contact_angle_is_where_the_distance_is_the_sum_of_radii() -> None:
    for piece in (0, 1, 2):
        found, _ = scene((place(piece, 0.4, 0.0), place(piece, 0.4, 0.0)))
        contact = found.contacts[piece]
        beta = 2.0 * math.asin(contact.sine)
        start = place(piece, 0.4, 0.0).position
        _, twin = scene((InitialState(piece, start, 0.0), InitialState(piece, start + beta, 0.0)))
        distance = _distance(twin.at(0, mp.zero), twin.at(1, mp.zero))
        assert abs(distance - sum(body.radius for body in BODIES)) <= 8 * EPSILON
        assert contact.sine**2 + contact.cosine**2 == pytest.approx(1.0, rel=4 * EPSILON)


def test_across_the_seam_the_half_angle_is_larger_by_pi() -> None:
    """b at -175 degrees one lap ahead of a at 175: the gap is 10 degrees less beta."""
    trace = Trace.chain(-math.pi, [ArcShape("valley", radius=1.0, end_slope=math.pi)], True)
    starts = (
        InitialState(0, math.radians(175.0), 0.0),
        InitialState(0, math.radians(-175.0), 0.0),
    )
    found, _ = scene(starts, trace)
    a, b = found.flights
    sine, _ = half_gap_sine(found.contacts[0], a.s, a.c, b.s, b.c, -1.0)
    beta = 2.0 * math.asin(found.contacts[0].sine)
    assert sine == pytest.approx(math.sin(0.5 * (math.radians(10.0) - beta)), abs=4 * EPSILON)
