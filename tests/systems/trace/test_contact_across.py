"""Lasting contact across a junction, against one quadrature of its single degree of freedom.

With q the place of the left body along its path, the right body's place follows from the distance
of the centres; ``M(q) q'^2/2 + V(q) = E`` then gives the time between two places as an integral.
The solver integrates forces instead, so that the two have nothing in common but the geometry.
"""

from __future__ import annotations

from pathlib import Path
from random import Random
from typing import Any

import mpmath
import numpy as np
import pytest
from mpmath import mpf

from vibro_cli.api import simulate
from vibro_cli.scenario import load_any, scenario_of
from vibro_cli.stress.scenes import scene
from vibro_cli.systems.run import Run

SCENARIO = Path(__file__).parents[3] / "scenarios" / "three_arcs.toml"
DIGITS = 50


class Constrained:
    """Two equal balls in contact, the left one on the hump, the right one in the next valley."""

    def __init__(self, run: Run) -> None:
        system = run.system
        hump, valley = system.trace.pieces[1:]
        self.gravity = mpf(system.gravity)
        self.masses = [mpf(body.mass) for body in system.bodies]
        self.kappa = mpf(7) / 5
        radius = mpf(system.bodies[0].radius)
        self.reach = 2 * radius
        self.rho = [mpf(hump.radius) + radius, mpf(valley.radius) - radius]
        slope = mpf(hump.end_slope)
        # The junction is the origin; both centres of curvature lie on its normal.
        normal = (-mpmath.sin(slope), mpmath.cos(slope))
        self.top = [-mpf(hump.radius) * n for n in normal]
        self.bottom = [mpf(valley.radius) * n for n in normal]
        self.junction = -slope  # psi there; phi is its negative

    def left(self, psi: mpf) -> tuple[mpf, mpf]:
        rho = self.rho[0]
        return self.top[0] + rho * mpmath.sin(psi), self.top[1] + rho * mpmath.cos(psi)

    def right(self, phi: mpf) -> tuple[mpf, mpf]:
        rho = self.rho[1]
        return self.bottom[0] + rho * mpmath.sin(phi), self.bottom[1] - rho * mpmath.cos(phi)

    def distance(self, psi: mpf, phi: mpf) -> mpf:
        (ax, ay), (bx, by) = self.left(psi), self.right(phi)
        return mpmath.hypot(bx - ax, by - ay)

    def phi_of(self, psi: mpf) -> mpf:
        """Place of the right ball that touches the left one at ``psi``, by Newton's method."""
        guess = -self.junction + (self.reach - self.rho[0] * (self.junction - psi)) / self.rho[1]
        return mpmath.findroot(lambda phi: self.distance(psi, phi) - self.reach, guess)

    def mass(self, psi: mpf, phi: mpf) -> mpf:
        """M of the coordinate psi: each ball's kappa m (dx/dpsi)^2."""
        (ax, ay), (bx, by) = self.left(psi), self.right(phi)
        normal = ((bx - ax) / self.reach, (by - ay) / self.reach)
        along_a = normal[0] * mpmath.cos(psi) - normal[1] * mpmath.sin(psi)
        along_b = normal[0] * mpmath.cos(phi) + normal[1] * mpmath.sin(phi)
        ratio = along_a / along_b
        return self.kappa * self.rho[0] ** 2 * (self.masses[0] + self.masses[1] * ratio**2)

    def potential(self, psi: mpf, phi: mpf) -> mpf:
        heights = self.left(psi)[1] * self.masses[0] + self.right(phi)[1] * self.masses[1]
        return self.gravity * heights

    def duration(self, start: mpf, end: mpf, rate: mpf) -> mpf:
        """Time from psi = start, where its rate is given, to psi = end (no turning point)."""
        phi = self.phi_of(start)
        energy = self.mass(start, phi) * rate**2 / 2 + self.potential(start, phi)

        def inverse_rate(psi: mpf) -> mpf:
            there = self.phi_of(psi)
            kinetic = energy - self.potential(psi, there)
            return mpmath.sqrt(self.mass(psi, there) / (2 * kinetic))

        cuts = mpmath.linspace(start, end, 3)
        time, error = mpmath.quad(inverse_rate, cuts, method="gauss-legendre", error=True)
        assert error <= 1e-20
        return abs(time)


@pytest.mark.parametrize("engine", ["python", "compiled"])
def test_time_over_the_junction_is_that_of_the_quadrature(engine: str) -> None:
    run = simulate(load_any(SCENARIO, ["stop.time=60"]), engine)
    assert run.end_cause == "time"
    assert run.summary_record()["end_time"] == 60.0
    events = run.events
    closed = float(events["t"][list(events["event"]).index("contact_closed")])
    crossing = (events["event"] == "crossing") & (events["t"] > closed)
    rows = np.flatnonzero(crossing & (np.ma.filled(events["arc_to"], 0) == 2))
    # The left ball climbs onto the hump, alone, and comes back to the junction.
    first = int(rows[0])
    assert int(events["ball"][first]) == 1
    start = float(events["t"][first])
    with mpmath.workdps(DIGITS):
        scene = Constrained(run)
        state = run.sample([start])
        rate = mpf(float(state["speed"][0])) / scene.rho[0]
        for after in (0.01, 0.04, 0.08):
            later = run.sample([start + after])
            assert list(later["arc"]) == [2, 3]
            psi = mpf(float(later["angle"][0]))
            expected = scene.duration(scene.junction, psi, rate)
            # The angle is a double, so the time is known to its rounding over the rate.
            assert abs(expected - mpf(after)) <= 1e-12


def row_of_three(
    trace: dict[str, Any], bodies: list[tuple[str, float, float, int]], angle: float, speed: float
) -> dict[str, Any]:
    """Bodies in contact of these shapes, radii, masses and pieces, all as fast at the start."""
    balls = [
        {"body": body, "radius": radius, "mass": mass, "arc": arc, "speed": speed}
        for body, radius, mass, arc in bodies
    ]
    balls[0]["angle"] = angle
    for ball in balls[1:]:
        ball["touching"] = "previous"
    return scene(trace, balls, 0.0, time=0.02)


# On rotating traces: one contact loses its force on an arc, the other rolls on over the junction.
# When the force vanishes, when that pair (or the other one) meets again, and both speeds then; by
# extrapolation of the equations of motion with their contact forces as multipliers, in long double.
TORN_OPEN = {
    "two valleys": (
        row_of_three(
            {
                "start_slope": -1.3,
                "arcs": [
                    {"shape": "valley", "radius": 1.702, "end_slope": -0.31},
                    {"shape": "valley", "radius": 0.518, "end_slope": 1.4},
                ],
                "turning": {"x": 1.675, "rate": 2.825},
            },
            [("ball", 0.038, 0.234, 1), ("hoop", 0.036, 0.209, 1), ("hoop", 0.034, 4.87, 2)],
            -0.36728, 1.889,
        ),
        0.01040271542596025, 0.011554108130857641, (1.8683867048580122, 1.8706135486900852),
    ),
    "hump and valley": (
        row_of_three(
            {
                "start_slope": 1.781,
                "arcs": [
                    {"shape": "hump", "radius": 1.712, "end_slope": 0.781},
                    {"shape": "valley", "radius": 0.616, "end_slope": 1.3},
                ],
                "turning": {"x": 0.212, "rate": 2.403},
            },
            [("hoop", 0.038, 4.38, 1), ("disk", 0.05, 0.699, 2), ("hoop", 0.053, 1.06, 2)],
            -0.81652, -1.278,
        ),
        0.00042366146442854106, 0.018890748760595459, (-1.3414569338516186, -1.3506674540774729),
    ),
}  # fmt: skip


@pytest.mark.parametrize("scene", TORN_OPEN)
def test_a_contact_beside_a_group_across_is_torn_open_when_it_is(scene: str, engine: str) -> None:
    document, opens, meets, speeds = TORN_OPEN[scene]
    run = simulate(scenario_of(document), engine)
    events, table = run.events, run.collisions
    opened = events["t"][events["event"] == "contact_opened"]
    # That of the reference moves by 1e-15 s with its start by 1e-15 rad.
    assert abs(opened[0] - opens) < 1e-14
    first = int(np.flatnonzero(table["t"] > opens)[0])
    # Bodies nearer than 16 units in the last place of their places touch.
    earlier = 16 * 2.0**-52 * 2.0 / float(table["approach_speed"][first])
    assert abs(table["t"][first] - meets) < earlier
    found = [float(table[f"speed_{end}_pre"][first]) for end in "ab"]
    np.testing.assert_allclose(found, speeds, rtol=0.0, atol=10.0 * 9.81 * earlier)


def along_slopes_that_never_fall(number: int) -> dict[str, Any]:
    """Draw two slow bodies on valleys with sloping lines between them; they stick."""
    draw = Random(number)
    arcs: list[dict[str, Any]] = []
    for end in (draw.uniform(-0.4, -0.2), draw.uniform(-0.1, 0.2), 1.3):
        arcs.append({"shape": "valley", "radius": draw.uniform(0.7, 1.4), "end_slope": end})
        if end < 1.0:
            arcs.append({"shape": "line", "length": draw.uniform(0.2, 0.5)})
    ball = {"radius": 0.04, "speed": 0.0}
    balls = [
        {**ball, "mass": draw.uniform(0.3, 3.0), "arc": 1, "angle": draw.uniform(-0.6, -0.5)},
        {**ball, "mass": draw.uniform(0.3, 3.0), "arc": 3, "angle": arcs[0]["end_slope"] + 0.02},
    ]
    return {
        "gravity": 9.81,
        "trace": {"start_slope": -0.7, "arcs": arcs},
        "balls": balls,
        "collision": {"k": 0.0, "law": "normal-impulse"},
        "stop": {"time": 60.0},
    }


def test_contacts_without_a_force_on_a_slope_are_not_opened_by_rounding() -> None:
    """Where the slope never falls the body behind is pressed on; on one line there is no force.

    Contacts opened whenever the body behind came to a line, up to 40 times in these scenes, and
    impacts of 1e-15 m/s closed them.
    """
    for number in range(20):
        run = simulate(scenario_of(along_slopes_that_never_fall(number)))
        found = run.summary_record()
        assert (found["end_cause"], found["collisions"], found["contacts"]) == ("time", 1, 1)
        assert found["crossings"] > 60


def pair_on_three_lines(slope: float, speed: float) -> dict[str, Any]:
    """A disk and a ball in contact ahead of it, on the first of three lines in a row."""
    pair = {"radius": 0.05, "arc": 1, "speed": speed}
    balls = [
        {**pair, "mass": 1.0, "body": "disk", "position": 0.7},
        {**pair, "mass": 2.0, "body": "ball", "touching": "previous"},
    ]
    trace = {"start_slope": slope, "arcs": [{"shape": "line", "length": 1.0}] * 3}
    return scene(trace, balls, 0.0, time=0.9)


def test_slow_bodies_in_contact_cross_lines_in_a_row() -> None:
    # The crossings alone took 2,000,000 segments of 10 ms, after which the run was refused.
    document = pair_on_three_lines(0.0, 1e-5)
    document["balls"].append({**document["balls"][0], "arc": 3, "position": 0.5, "speed": 0.0})
    run = simulate(scenario_of({**document, "stop": {"collisions": 1}}))
    assert run.collisions["t"][0] == pytest.approx((2.5 - 0.7 - 0.2) / 1e-5, rel=1e-15)


def test_bodies_in_contact_cross_sloping_lines_at_one_acceleration() -> None:
    # Uphill the disk is held back less than the ball and pushes it: (sum m)/(sum kappa m) for both.
    run = simulate(scenario_of(pair_on_three_lines(0.3, 3.0)))
    assert list(run.events["event"]).count("crossing") == 4
    pull = -mpf("9.81") * mpmath.sin(mpf(0.3)) * 3 / (mpf("1.5") + 2 * mpf("1.4"))
    times = np.linspace(0.0, 0.9, 100)
    motion = run.sample(times)
    s = [float(mpf("0.7") + 3 * mpf(t) + pull * mpf(t) ** 2 / 2) for t in times]
    np.testing.assert_allclose(motion["s"][::2], s, rtol=0.0, atol=2e-15)
    speeds = [float(3 + pull * mpf(t)) for t in times]
    np.testing.assert_allclose(motion["speed"][::2], speeds, rtol=0.0, atol=2e-15)
