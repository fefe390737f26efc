"""The check of tangent maps: what it uses, that it passes, and that it reports an error."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from vibro_cli.stress import digits
from vibro_cli.stress.drawing import draw
from vibro_cli.stress.scenes import VALLEY, Document, Plan, ball, scene, system_of
from vibro_cli.systems.tangents import TangentMap
from vibro_cli.systems.trace import simulate_system

TOUCHING: Document = {"radius": 0.1, "mass": 1.0, "arc": 1, "touching": "previous"}


def test_scenes_drawn_at_random_meet_the_mark() -> None:
    maps, times = digits.check_tangent(Plan(seed=7, full=False, cases=3))
    assert maps.cases == 3
    assert maps.met, maps
    assert times.met, times


def test_two_bodies_reach_two_walls_at_one_instant() -> None:
    """A scene that is its own mirror image: each of both is an event of its own."""
    map_error, times_error = digits.errors_of(system_of(draw(0, 205)), 2)
    assert map_error <= 1e-12
    assert times_error <= 1e-12


def test_a_run_ends_with_the_first_of_two_impacts_at_one_instant() -> None:
    """Neighbours, in which the other one may come first, leave it out too."""
    system = system_of(draw(11, 357))
    first, second = simulate_system(system, None, 2).collisions["t"]
    assert first == second
    assert max(digits.errors_of(system, 1)) <= 1e-12


def test_an_error_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    def off(own: TangentMap) -> Any:
        found = exact(own)
        found[-1, 0] += 1e-8 * np.max(np.abs(found))
        return found

    exact = TangentMap.matrix
    monkeypatch.setattr(TangentMap, "matrix", off)
    maps, times = digits.check_tangent(Plan(seed=7, full=False, cases=1))
    assert not maps.met
    assert times.met


def test_what_has_no_derivative_is_left_out() -> None:
    assert digits.smooth_impacts(scene(VALLEY, [ball(-0.7), TOUCHING], 1.0, time=2.0)) == 0
    assert digits.smooth_impacts(scene(VALLEY, [ball(-0.7), ball(0.4)], 0.0, time=2.0)) == 0
    assert digits.smooth_impacts(scene(VALLEY, [ball(-0.7), ball(0.4)], 1.0, time=9.0)) == 3
    assert any(digits.smooth_impacts(draw(7, number)) == 0 for number in range(6))
