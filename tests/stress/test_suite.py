"""The suite as a program: its table, its files, its exit codes."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from vibro_cli.commands.app import run_command_line
from vibro_cli.kernels.impact.laws import LAW_NAMES
from vibro_cli.scenario import scenario_of
from vibro_cli.storage.tables import read_parquet
from vibro_cli.stress import impact_laws, physics, suite
from vibro_cli.stress.extremes import swings, unequal
from vibro_cli.stress.oracles.arrangement import Laws, Touch
from vibro_cli.stress.oracles.scene import (
    Body,
    mp,
    scene_of_system,
    speed_changes,
    weight_and_response,
)
from vibro_cli.stress.scenes import VALLEY, Finding, Plan, ball, fault_of, scene, system_of
from vibro_cli.stress.suite import line_of, record_of, write

pytestmark = pytest.mark.long

QUICK = ("elliptic", "crest", "springs", "table")


@pytest.mark.parametrize("name", QUICK)
def test_quick_checks_meet_their_marks(name: str) -> None:
    findings = list(suite.run(Plan(3, False), [name]))
    assert len(findings) >= 3
    assert [line_of(one) for one in findings if not one.met] == []
    assert all(one.cases > 0 and one.worst >= 0.0 for one in findings)


class Tiny(Plan):
    """A plan with very few cases of everything."""

    def amount(self, short: int, long: int) -> int:
        return min(short, 3)


@pytest.mark.parametrize("name", ["accumulation", "impacts", "symmetry"])
def test_few_cases_of_the_long_checks(name: str) -> None:
    findings = list(suite.run(Tiny(1, False), [name]))
    assert [line_of(one) for one in findings if not one.met] == []
    assert all(one.scenario is not None for one in findings if one.mark is not None)


def test_few_cases_of_long_and_unequal_motions() -> None:
    plan, rng = Tiny(1, False), np.random.default_rng(1)
    findings = [swings(rng, plan), *unequal(rng, plan)]
    assert [line_of(one) for one in findings if not one.met] == []


def test_a_run_without_an_end_is_given_up() -> None:
    document = scene(VALLEY, [ball(-0.5), ball(0.5)], 1.0, time=1e9)
    assert "no end" in fault_of(document, 0.2)
    assert fault_of({**document, "stop": {"time": 1.0}}) == ""
    assert "KeyError" in fault_of({"gravity": 9.81})


def test_a_missed_mark_and_a_told_value() -> None:
    assert not Finding("b", "c", 1.0, worst=2.0).met
    assert Finding("b", "c", 1.0, worst=1.0).met
    assert Finding("b", "c", None, worst=9.0).met
    assert not Finding("b", "c", 1.0, worst=float("nan")).met


def test_what_is_found_in_arrays_can_be_told_as_json() -> None:
    found = Finding("b", "c", 1.0, worst=np.max([0.25, 0.5]))
    assert json.loads(json.dumps(record_of(found)))["met"]


def test_the_worst_is_kept_with_its_scenario() -> None:
    worst = Finding("b", "c", None)
    worst.take(1.0, {"name": "one"})
    worst.take(3.0, {"name": "three"})
    worst.take(2.0, {"name": "two"})
    assert (worst.worst, worst.cases, worst.scenario) == (3.0, 3, {"name": "three"})
    worst.take(float("nan"), {"name": "nan"})
    assert worst.worst == float("inf")


def test_the_folder(tmp_path: Path) -> None:
    document = scene(VALLEY, [ball(-0.5), ball(0.5)], 0.9, time=1.0)
    findings = [
        Finding("error", "cases", 1.0, check="one", cases=3, worst=2.0, scenario=document),
        Finding("count", "cases", None, check="two", cases=5),
    ]
    write(findings, Plan(1, False), tmp_path / "out")
    table = read_parquet(tmp_path / "out" / "stress.parquet").to_pylist()
    assert [row["met"] for row in table] == [False, True]
    assert [row["mark"] for row in table] == [1.0, None]
    assert table[1]["scenario"] is None
    kept = json.loads((tmp_path / "out" / table[0]["scenario"]).read_text(encoding="utf-8"))
    assert scenario_of(kept) == scenario_of(document)


def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target = str(tmp_path / "out")
    code = run_command_line(["stress", "--only", "elliptic", "--json", "-o", target])
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert code == 0
    assert {line["check"] for line in lines} == {"elliptic"}
    assert all(line["met"] for line in lines)
    assert (tmp_path / "out" / "stress.parquet").exists()


def test_an_unknown_check(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command_line(["stress", "--only", "nothing"]) == 2
    assert "expected one of elliptic" in capsys.readouterr().err


def test_a_missed_mark_is_exit_code_1(monkeypatch: pytest.MonkeyPatch) -> None:
    missed = Finding("error", "cases", 1.0, check="elliptic", worst=2.0)
    monkeypatch.setattr(suite, "run", lambda plan, names: iter([missed]))
    assert run_command_line(["stress", "-q"]) == 1


@pytest.mark.parametrize("law", LAW_NAMES)
def test_the_judges_have_one_law(law: str) -> None:
    """The papers' equations of an impact against weights and responses of both bodies."""
    bodies = Body(mp.mpf(3), mp.mpf(2), mp.mpf(7) / 5), Body(mp.mpf(2), mp.mpf(5), mp.mpf(2))
    speeds, k = (mp.mpf(3), mp.mpf(1)), mp.mpf(7) / 10
    radii, masses = [body.radius for body in bodies], [body.mass for body in bodies]
    rolling = [body.kappa * body.mass for body in bodies]
    (qa, ha), (qb, hb) = (weight_and_response(law, body, mp.one) for body in bodies)
    impulse = (1 + k) * (qa * speeds[0] - qb * speeds[1]) / (qa * ha + qb * hb)
    changes = speed_changes(law, k, speeds, radii, masses, rolling)
    for change, value in zip(changes, (-impulse * ha, impulse * hb), strict=True):
        assert mp.almosteq(change, value, 1e-45)


def test_no_judge_takes_a_law_that_it_does_not_know_for_another_one() -> None:
    system = system_of(scene(VALLEY, [ball(-0.5), ball(0.5)], time=1.0))
    one, two = system.bodies
    pair = (mp.one, mp.one)
    touch = Touch((0, 1), {0: -mp.one, 1: mp.one}, mp.one, 0)
    row = {f"speed_{end}_{when}": [1.0] for end in "ab" for when in ("pre", "post")}
    for judge in (
        lambda law: speed_changes(law, mp.one, (mp.one, mp.zero), pair, pair, pair),
        lambda law: Laws(scene_of_system(system), law).solve([touch], [mp.one, mp.zero], law),
        lambda law: impact_laws._factors(law, mp.one, one, two),
        lambda law: physics._against_law(row | {"law": [law]}, 0, one, two),
    ):
        for law in LAW_NAMES:
            judge(law)
        with pytest.raises(KeyError, match="another"):
            judge("another")
