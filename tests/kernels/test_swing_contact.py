"""Contacts of free oscillations found as a whole are those of the search step by step."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.bare_system import bare_system
from tests.kernels.kernel_records import ball, flight_on_arc
from vibro_cli.kernels.contact import arc_contact
from vibro_cli.kernels.flow.flow import flow, flow_of_two
from vibro_cli.kernels.numerics.elliptic import (
    PARAMETER_SPLIT,
    ThetaConstants,
    set_libration,
    set_theta_constants,
)
from vibro_cli.kernels.world import Flight
from vibro_cli.mechanics.system import Body, InitialState, TraceSystem
from vibro_cli.mechanics.trace import ArcShape, Trace
from vibro_cli.systems.run import Run
from vibro_cli.systems.trace import simulate_system

SETTINGS = settings(deadline=None, derandomize=True, max_examples=150)
IMPACTS = 6
VALLEY = Trace.chain(-2.9, [ArcShape("valley", 1.0, None, 2.9)])
state = st.tuples(st.floats(-1.2, 1.2), st.floats(-2.5, 2.5))


def two(
    a: Body, b: Body, left: tuple[float, float], right: tuple[float, float], k: float
) -> TraceSystem:
    initial = (InitialState(0, *left), InitialState(0, *right))
    return bare_system(
        VALLEY, (a, b), initial, restitution=(k,), law="hedrih", inadmissible="normal-impulse"
    )


def step_by_step(system: TraceSystem) -> Run:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(arc_contact, "librates", lambda flight: False)
        return simulate_system(system, None, IMPACTS, "python")


@SETTINGS
@given(state, state, st.sampled_from([0.03, 0.06, 0.1]), st.sampled_from([1.0, 0.8]))
def test_both_ways_find_the_same_impacts(
    a: tuple[float, float], b: tuple[float, float], radius: float, k: float
) -> None:
    left, right = sorted((a, b))
    right = (max(right[0], left[0] + 0.3), right[1])
    system = two(ball(0.06, 2.0), Body("hoop", radius, 1.0, 1.0), left, right, k)
    whole, steps = simulate_system(system, None, IMPACTS), step_by_step(system)
    assert whole.end_cause == steps.end_cause
    times, others = whole.collisions["t"], steps.collisions["t"]
    assert len(times) == len(others)
    # Rounding differs, and grows from impact to impact.
    for number, (t, other) in enumerate(zip(times, others, strict=True)):
        assert t == pytest.approx(other, rel=1e-13 * 30.0**number)


def test_it_takes_fewer_evaluations() -> None:
    system = two(ball(0.1, 7.8), ball(0.1, 2.7), (-0.72, 0.0), (0.54, 0.0), 1.0)
    whole, steps = (
        simulate_system(system, None, 40, "python"),
        step_by_step(replace(system, restitution=(1.0,))),
    )
    each = whole.clock["evaluations"] / 40
    assert each < 3.2
    assert each < 0.8 * steps.clock["evaluations"] / IMPACTS


def swinging(m: float, phase: float) -> Flight:
    s = math.sqrt(m) * math.sin(phase)
    return flight_on_arc(2.8, s, math.sqrt(1.0 - s * s), math.sqrt(m) * math.cos(phase))


parameter = st.floats(0.001, 3.0)
phase = st.floats(-1.5, 1.5)


@SETTINGS
@given(parameter, phase, parameter, phase, st.floats(0.0, 4.0), st.floats(0.0, 4.0))
def test_two_flows_taking_turns_are_the_flows_to_the_bit(
    m: float, at: float, other_m: float, other_at: float, age: float, other_age: float
) -> None:
    a = swinging(min(m, 0.99 / max(math.sin(at) ** 2, 0.3)), at)
    b = swinging(min(other_m, 0.99 / max(math.sin(other_at) ** 2, 0.3)), other_at)
    assert flow_of_two(a, b, age, other_age) == flow(a, age) + flow(b, other_age)


@SETTINGS
@given(st.floats(0.0, PARAMETER_SPLIT), st.floats(0.0, PARAMETER_SPLIT))
def test_constants_of_librations_are_the_constants_to_the_bit(m: float, other: float) -> None:
    def fields(theta: ThetaConstants) -> list[float]:
        return [getattr(theta, name) for name in ThetaConstants.fields]  # type: ignore[attr-defined]

    a, b, c, d = (ThetaConstants() for _ in range(4))
    set_libration(a, m, math.sqrt(1.0 - m))
    set_libration(b, other, math.sqrt(1.0 - other))
    set_theta_constants(c, m, math.sqrt(1.0 - m))
    set_theta_constants(d, other, math.sqrt(1.0 - other))
    assert fields(a) == fields(c)
    assert fields(b) == fields(d)
