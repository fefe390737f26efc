"""The tables' description: complete, consistent, the same as the reference in docs/."""

import re
from pathlib import Path

import pytest

from vibro_cli.commands.help import tables
from vibro_cli.systems.columns import Table
from vibro_cli.systems.trace import SYSTEM
from vibro_cli.systems.trace import tables as of_trace

PAGE = Path(__file__).parents[2] / "docs/reference-tables.md"
COLLISIONS = """
n, t, t_low, dt, ball_a, ball_b, arc_a, arc_b, angle_a, angle_b, s_a, s_b, x_a, y_a, x_b, y_b,
rate_a_pre, rate_b_pre, rate_a_post, rate_b_post, omega_a_pre, omega_b_pre, omega_a_post,
omega_b_post, speed_a_pre, speed_b_pre, speed_a_post, speed_b_post, energy_a_pre, energy_b_pre,
energy_a_post, energy_b_post, energy_loss, impulse_moment, approach_speed, separation_speed, gap,
law, admissible, substituted, simultaneous, grazing, contact,
kinetic_energy_a_pre, kinetic_energy_b_pre, kinetic_energy_a_post, kinetic_energy_b_post, impulse,
regime_a_pre, regime_b_pre, regime_a_post, regime_b_post,
eight_a_pre, eight_b_pre, eight_a_post, eight_b_post
"""
SUMMARY = """
status, reason, end_cause, end_time, quiet_from, collisions, crossings, contacts,
first_collision_time, last_collision_time, energy_start, energy_end, energy_drift,
energy_correction, max_gap, min_normal_force, max_friction_demand,
arc_1, angle_1, s_1, speed_1, arc_2, angle_2, s_2, speed_2
"""
EVENTS = "t, event, ball, other, arc_from, arc_to, s, speed, value"
MOTION = "t, ball, arc, angle, s, x, y, speed, energy"
UNITS = {"", "s", "1/s", "m", "rad", "rad/s", "m/s", "J", "N", "N s", "N m s"}


@pytest.mark.parametrize(
    ("table", "names"),
    [
        (of_trace.collisions(), COLLISIONS),
        (SYSTEM.summary(2), SUMMARY),
        (of_trace.EVENTS, EVENTS),
        (of_trace.MOTION, MOTION),
    ],
    ids=["collisions", "summary", "events", "motion"],
)
def test_columns_are_those_promised_in_their_order(table: Table, names: str) -> None:
    assert [column.name for column in table.columns] == re.findall(r"\w+", names)


def test_side_follows_the_pair_where_there_is_one() -> None:
    names = [column.name for column in of_trace.collisions(sided=True).columns]
    assert names[4:7] == ["ball_a", "ball_b", "side"]
    assert len(names) == len(of_trace.collisions().columns) + 1


@pytest.mark.parametrize("table", SYSTEM.tables(), ids=lambda table: table.name)
def test_every_column_has_a_meaning_and_a_unit_of_the_system(table: Table) -> None:
    assert len({column.name for column in table.columns}) == len(table.columns)
    for column in table.columns:
        assert column.description, column.name
        assert column.unit in UNITS, column.name
        assert column.unit == "" or column.type == "float64", column.name


@pytest.mark.parametrize(
    "table",
    [
        of_trace.collisions(),
        of_trace.collisions(sided=True),
        SYSTEM.summary(1),
        SYSTEM.summary(7),
        of_trace.EVENTS,
        of_trace.MOTION,
    ],
)
def test_a_table_is_found_from_the_names_of_its_columns(table: Table) -> None:
    assert SYSTEM.table(table.name, [column.name for column in table.columns]) == table


def test_an_unknown_table_is_refused() -> None:
    with pytest.raises(ValueError, match="no table 'impacts'"):
        SYSTEM.table("impacts", [])


def test_the_reference_prints_the_same_description() -> None:
    assert tables() in PAGE.read_text(encoding="utf-8")
