"""Systems from scenarios, and every impossible scenario refused with its places.

A file `name.toml` of tests/impossible_scenarios has its errors in `name.toml.expected`.
"""

from __future__ import annotations

import math
import re
from itertools import combinations, pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.effort import calls
from vibro_cli.assemble import Problems, body_of, build_any, check_gaps, trace_of
from vibro_cli.mechanics.initial_conditions import gap
from vibro_cli.mechanics.system import InitialState, Wall, mechanics_warnings
from vibro_cli.scenario import ScenarioError, load_any
from vibro_cli.scenario.loading import scenario_of
from vibro_cli.stress.scenes import system_of

FOLDER = Path(__file__).parent / "impossible_scenarios"
GALLERY = Path(__file__).parents[1] / "scenarios"


def ball(**changes: Any) -> dict[str, Any]:
    """A ball of 1 kg on the first piece; None leaves a key out."""
    values = {"radius": 0.1, "mass": 1.0, "arc": 1, **changes}
    return {key: value for key, value in values.items() if value is not None}


def scenario(*balls: dict[str, Any], **changes: Any) -> dict[str, Any]:
    arcs = [
        {"shape": "valley", "radius": 1.0, "end_slope": 0.5},
        {"shape": "line", "length": 1.5},
        {"shape": "hump", "radius": 0.5, "end_slope": -0.4},
        {"shape": "valley", "radius": 1.0, "end_slope": 1.0},
    ]
    return {
        "gravity": 9.81,
        "trace": {"start_slope": -1.0, "arcs": arcs},
        "balls": list(balls),
        "collision": {"k": 0.9},
        "stop": {"time": 1.0},
        **changes,
    }


@pytest.mark.parametrize("path", sorted(FOLDER.glob("*.toml")), ids=lambda path: path.stem)
def test_impossible_scenario(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(FOLDER)
    read = load_any(path.name)
    with pytest.raises(ScenarioError) as caught:
        build_any(read)
    expected = path.with_name(f"{path.name}.expected").read_text(encoding="utf-8")
    assert f"{caught.value}\n" == expected


@pytest.mark.parametrize("path", sorted(GALLERY.glob("*.toml")), ids=lambda path: path.stem)
def test_every_scenario_of_the_gallery_is_possible(path: Path) -> None:
    read = load_any(path)
    built = build_any(read)
    assert len(built.bodies) == len(built.initial) == len(read.balls)
    assert len(built.trace.pieces) == len(read.given()["trace"]["arcs"])


def test_a_system_has_what_the_scenario_says() -> None:
    data = scenario(
        ball(angle=-0.7, rate=2.0),
        ball(angle=0.2, body="disk", mass=None, density=1000.0, thickness=0.02, omega=-3.0),
        ball(arc=2, position=0.9, body=None, inertia_ratio=0.3, speed=0.25),
        ball(arc=3, angle=0.1, rate=-1.5),
        ball(arc=4, angle=0.4),
        collision={"k": [0.1, 0.2, 0.3, 0.4], "law": "normal-impulse"},
        ends={"left": {"wall": 0.8}, "right": "stop"},
    )
    built = system_of(data)
    assert built.initial == (
        InitialState(0, -0.7, 2.0 * 0.9),
        InitialState(0, 0.2, -3.0 * 0.1),
        InitialState(1, 0.9, 0.25),
        InitialState(2, 0.1, -1.5 * 0.6),
        InitialState(3, 0.4, 0.0),
    )
    assert [body.kappa for body in built.bodies] == [1.4, 1.5, 1.3, 1.4, 1.4]
    assert built.bodies[1].mass == pytest.approx(0.2 * math.pi, rel=1e-15)
    assert built.restitution == (0.1, 0.2, 0.3, 0.4)
    assert (built.law, built.inadmissible, built.surface) == ("normal-impulse", "stop", "two-sided")
    assert (built.left_end, built.right_end, built.turning) == (Wall(0.8), None, None)
    assert (built.gravity, built.trace.closed) == (9.81, False)


def test_touching_bodies_stand_in_a_row() -> None:
    data = scenario(
        ball(angle=-0.3),
        ball(touching="previous", radius=0.05),
        ball(touching="previous", radius=0.12),
        ball(touching="previous", arc=2, radius=0.3),
        ball(touching="previous", arc=2, radius=0.2, speed=1.0),
    )
    built = system_of(data)
    assert [state.piece for state in built.initial] == [0, 0, 0, 1, 1]
    row = list(zip(built.bodies, built.initial, strict=True))
    for (body_a, state_a), (body_b, state_b) in pairwise(row):
        residual, rounding = gap(built.trace, body_a, state_a, body_b, state_b)
        assert abs(residual) <= rounding
    assert built.initial[4].speed == 1.0


def test_a_body_on_a_junction_starts_on_the_piece_it_moves_into() -> None:
    on_junction = [ball(angle=0.5, rate=rate) for rate in (0.0, -1.0, 1.0)]
    states = [system_of(scenario(one)).initial[0] for one in on_junction]
    assert [state.piece for state in states] == [0, 0, 1]
    assert states[2] == InitialState(1, 0.0, 0.9)


def test_laws_that_surprise_are_warned_of() -> None:
    unequal = ball(angle=-0.5), ball(angle=0.0, radius=0.2)
    mixed = ball(angle=-0.5), ball(angle=0.0, body="hoop", mass=2.0)
    for balls, law, words in (
        (unequal, "hedrih", "the hedrih law between bodies of unequal radii"),
        (mixed, "translational", "the translational law does not conserve"),
        (unequal, "translational", "the translational law between bodies of unequal radii"),
        (mixed, "hedrih", None),
        (unequal, "normal-impulse", None),
        (mixed, "normal-impulse", None),
    ):
        built = system_of(scenario(*balls, collision={"k": 0.9, "law": law}))
        warnings = mechanics_warnings(built)
        assert len(warnings) == (words is not None)
        assert all(warning.startswith(words or "") for warning in warnings)


@pytest.mark.parametrize(
    ("response", "then"),
    [
        ("stop", "the run then stops; the normal-impulse law always separates them"),
        ("normal-impulse", "the normal-impulse law is then used"),
    ],
)
def test_a_warning_says_what_follows_an_inadmissible_impact(response: str, then: str) -> None:
    balls = ball(angle=-0.5), ball(angle=0.0, radius=0.2)
    collision = {"k": 0.9, "law": "hedrih", "inadmissible": response}
    (warning,) = mechanics_warnings(system_of(scenario(*balls, collision=collision)))
    assert warning.endswith(f": {then}")


def test_a_phase_beyond_double_precision_is_warned_of() -> None:
    """On the hump w = sqrt(g/(kappa rho)) = 3.42/s; 1/(2 w eps) = 6.6e14 s."""
    built = system_of(scenario(ball(angle=-0.5)))
    assert mechanics_warnings(built, 6.5e14) == mechanics_warnings(built) == ()
    (warning,) = mechanics_warnings(built, 6.7e14)
    assert "not determined in double precision from about t = 6.6e+14 s" in warning
    (earlier,) = mechanics_warnings(system_of(scenario(ball(angle=-0.5, rate=2.0e3))), 1.0e13)
    assert "t = 1.5e+12 s" in earlier


def test_the_seam_of_a_circle_counts_for_warnings() -> None:
    trace = {
        "start_slope": "-180 deg",
        "closed": True,
        "arcs": [{"shape": "valley", "radius": 1.0, "end_slope": "180 deg"}],
    }
    radii = (0.1, 0.1, 0.1, 0.11)
    balls = [ball(angle=-1.0 + n, radius=radius) for n, radius in enumerate(radii)]
    assert len(mechanics_warnings(system_of(scenario(*balls, trace=trace)))) == 1
    assert not mechanics_warnings(system_of(scenario(*balls[:3], trace=trace)))


def bodies_through_gap(radii: list[float], degrees: float) -> list[tuple[int, int]]:
    """Pairs of bodies that are told to touch through the gap of one arc."""
    slope = math.radians(0.5 * degrees)
    arcs = [{"shape": "valley", "radius": 1.0, "end_slope": slope}]
    balls = (ball(radius=radius, angle=0.0) for radius in radii)
    read = scenario_of(scenario(*balls, trace={"start_slope": -slope, "arcs": arcs}))
    problems = Problems(read)
    check_gaps(trace_of(read), tuple(map(body_of, read.balls)), problems)
    numbers = [
        re.findall("bodies ([0-9]+) and ([0-9]+)", one.expected)[0] for one in problems.found
    ]
    return [(int(a) - 1, int(b) - 1) for a, b in numbers]


def test_a_gap_is_told_of_every_two_sizes_that_touch_through_it() -> None:
    random = np.random.default_rng(5)
    for _ in range(100):
        radii = random.choice([0.1, 0.15, 0.2, 0.3], 6).tolist()
        degrees = random.uniform(310.0, 358.0)
        touching = {
            frozenset((a, b))
            for a, b in combinations(radii, 2)
            if 2.0 * math.asin(math.sqrt(a * b / ((1.0 - a) * (1.0 - b))))
            > math.radians(360.0 - degrees)
        }
        told = bodies_through_gap(radii, degrees)
        assert {frozenset((radii[a], radii[b])) for a, b in told} == touching


def test_a_gap_is_told_of_two_bodies_of_each_size_at_most() -> None:
    assert bodies_through_gap([0.1] * 50, 358.0) == [(0, 1)]


def test_building_is_quick() -> None:
    read = load_any(GALLERY / "three_arcs.toml")
    assert calls(lambda: build_any(read)) < 2000
