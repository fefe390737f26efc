"""Columns of impacts that follow from the motion, in every system: energies, angles, impulses."""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import numpy as np
import pytest

from tests.gallery import GALLERY, run_of
from vibro_cli.api import simulate
from vibro_cli.kernels.statistics.impact_columns import place_on
from vibro_cli.kernels.world import PieceData
from vibro_cli.scenario import load_any
from vibro_cli.storage.tables import record_batch
from vibro_cli.systems import system_named
from vibro_cli.systems.columns import converging, exponents


@pytest.mark.parametrize("name", ["three_arcs", "one_circle", "five_balls", "springs/two_disks"])
def test_kinetic_energies_are_those_of_rolling_and_give_the_loss(name: str) -> None:
    """B (18), (19), (20): half J_P omega^2, and the loss of their sum in an impact."""
    run = run_of(name, "stop.collisions=30")
    table = run.collisions
    kinetic = {}
    for end in "ab":
        inertias = np.array([body.rolling_inertia for body in run.system.bodies])
        inertia = inertias[np.asarray(table[f"ball_{end}"]) - 1]
        for when in ("pre", "post"):
            kinetic[end, when] = table[f"kinetic_energy_{end}_{when}"]
            rolling = 0.5 * inertia * table[f"omega_{end}_{when}"] ** 2
            np.testing.assert_allclose(kinetic[end, when], rolling, rtol=1e-13)
    lost = kinetic["a", "pre"] + kinetic["b", "pre"] - kinetic["a", "post"] - kinetic["b", "post"]
    alone = ~np.asarray(table["simultaneous"]) & ~np.asarray(table["contact"])
    np.testing.assert_allclose(lost[alone], table["energy_loss"][alone], atol=1e-11)


@pytest.mark.parametrize("name", ["one_circle", "springs/two_disks"])
def test_the_impulse_is_that_of_translation(name: str) -> None:
    """B (6): (1 + k) m1 m2/(m1 + m2) (v1 - v2); under the papers' law it is a moment."""
    run = run_of(name, "stop.collisions=3", "collision.law=translational", "collision.k=0.9")
    table = run.collisions
    one, other = (body.mass for body in run.system.bodies)
    swapped = np.asarray(table["ball_a"]) == 2
    assert not swapped.any()
    closing = table["speed_a_pre"] - table["speed_b_pre"]
    wanted = 1.9 * one * other / (one + other) * closing
    np.testing.assert_allclose(table["impulse"], wanted, rtol=1e-13)
    assert np.isnan(run_of(name, "stop.collisions=3").collisions["impulse"]).all()


def test_the_impulse_on_a_table_is_that_of_translation() -> None:
    run = run_of("table/skew_impact", "collision.law=translational")
    table = run.collisions
    one, other = (body.mass for body in run.system.bodies)
    closing = table["normal_speed_a_pre"] - table["normal_speed_b_pre"]
    np.testing.assert_allclose(
        table["impulse"], 1.9 * one * other / (one + other) * closing, rtol=1e-13
    )


def test_outgoing_and_arrival_angles_differ_for_equal_balls() -> None:
    """C has them equal; of equal balls the one that arrives leaves along the common tangent."""
    equal = [
        "balls[1].radius=0.05", "balls[2].radius=0.05", "balls[2].velocity_x=0",
        "balls[2].velocity_y=0", "balls[2].x=0", "balls[1].x=-0.5", "balls[1].y=0.06",
        "balls[1].velocity_x=1", "collision.k=1",
    ]  # fmt: skip
    table = run_of("table/skew_impact", *equal).collisions
    assert table["arrival_angle_a"][0] == pytest.approx(math.asin(0.6), rel=1e-12)
    assert math.degrees(table["arrival_angle_a"][0]) == pytest.approx(36.87, abs=0.01)
    assert table["outgoing_angle_a"][0] == pytest.approx(math.pi / 2, rel=1e-12)
    assert math.isnan(table["arrival_angle_b"][0])
    assert table["outgoing_angle_b"][0] == 0.0
    assert not table["central"][0]
    assert run_of("table/skew_impact", *equal, "balls[1].y=0").collisions["central"][0]


def test_a_wall_turns_the_angle_by_its_restitution() -> None:
    """The tangent of the outgoing angle is 1/k of that of the arrival angle; omega is v/r."""
    run = run_of("table/elliptic_wall")
    table, k = run.bounces, run.system.wall.restitution
    wanted = np.tan(table["arrival_angle"]) / k
    np.testing.assert_allclose(np.tan(table["outgoing_angle"]), wanted, rtol=1e-12)
    for when in ("pre", "post"):
        speed = np.hypot(table[f"velocity_x_{when}"], table[f"velocity_y_{when}"])
        omega = speed / run.system.bodies[0].radius
        np.testing.assert_allclose(table[f"omega_{when}"], omega, rtol=1e-14)


def test_a_spring_lets_its_body_oscillate_and_its_saddle_parts_the_loops() -> None:
    run = run_of("springs/two_disks", "collision.k=1", "stop.collisions=40")
    table = run.collisions
    seen = set()
    for end in "ab":
        spring = [run.system.springs[ball - 1] for ball in table[f"ball_{end}"]]
        saddles = np.array([one.energy(0.0) for one in spring])
        for when in ("pre", "post"):
            assert set(table[f"regime_{end}_{when}"]) == {"oscillating"}
            loop = np.where(table[f"displacement_{end}"] < 0.0, "left loop", "right loop")
            side = np.where(table[f"energy_{end}_{when}"] < saddles, loop, "outside")
            assert list(table[f"eight_{end}_{when}"]) == list(side)
            seen |= set(side.tolist())
    assert len(seen) >= 2
    short = run_of("springs/two_disks", "balls[1].spring.length=0.5", "stop.collisions=3")
    assert set(short.collisions["eight_a_pre"]) == {"none"}


@pytest.mark.parametrize(
    ("name", "overrides"),
    [
        ("particle_on_arcs", []),
        ("horizontal_line_1_2", []),
        ("springs/two_disks", ["balls[2].body=particle"]),
        ("table/skew_impact", ["balls[1].body=particle", "balls[2].velocity_x=0"]),
        ("table/elliptic_wall", []),
    ],
)
def test_columns_that_may_have_no_value_say_so(name: str, overrides: list[str]) -> None:
    """Of bodies that slide, on lines, and at rest: the file has null, and refuses it elsewhere."""
    scenario = load_any(GALLERY / f"{name}.toml", ["stop.collisions=3", *overrides])
    run, kind = simulate(scenario), system_named(scenario.system)
    rows = 0
    for table in kind.impact_tables:
        columns = getattr(run, table)
        rows += record_batch(kind.impact_table(table, [*columns]), columns).num_rows
    assert rows > 0


def _held(value: int, shape: Any, dtype: Any = np.float64) -> Any:
    return np.full(shape, value, dtype)


@pytest.mark.parametrize("engine", ["python", "compiled"])
@pytest.mark.parametrize("name", ["three_arcs", "one_circle"])
def test_every_column_of_impacts_on_a_trace_is_written(
    name: str, engine: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What the memory held shows nowhere, and interpreted no place is beyond the last column."""
    scenario = load_any(GALLERY / f"{name}.toml", ["stop.collisions=6"])
    found = []
    for value in (0, 1):
        with monkeypatch.context() as patch:
            patch.setattr(np, "empty", partial(_held, value))
            found.append(simulate(scenario, engine).collisions)
    for column, values in found[0].items():
        np.testing.assert_array_equal(found[1][column], values, err_msg=column)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("start", [0.0, -2.0 * math.pi, -math.pi])
def test_an_impact_at_the_seam_of_a_circle_is_at_the_end_that_it_comes_to(
    sign: float, start: float
) -> None:
    piece = PieceData()
    piece.sign, piece.angle_start, piece.angle_end = sign, start, start + 2.0 * math.pi
    for angle in (*np.linspace(start, piece.angle_end, 33), start - 1e-9, piece.angle_end + 1e-9):
        sine, cosine = math.sin(0.5 * angle), math.cos(0.5 * angle)
        found = place_on(piece, *((sine, cosine) if sign > 0.0 else (cosine, -sine)))
        assert found == pytest.approx(min(max(angle, start), piece.angle_end), abs=1e-15)


def test_exponents_of_the_summary_are_those_of_the_whole_run() -> None:
    """Each row of the table of their convergence covers the run until an impact."""
    for columns, part in ((exponents(2), False), (converging(2).columns, True)):
        told = [one.description for one in columns if one.name in ("lyapunov_1", "lyapunov_2")]
        assert ["of the run up to this impact" in text for text in told] == [part, part]
