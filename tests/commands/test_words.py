"""The summary in words, cause by cause."""

import json
import re
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest

from tests.commands.conftest import Vibro
from tests.fake_run import FakeRun
from tests.systems.trace.test_energy import not_made
from vibro_cli import example, simulate
from vibro_cli.commands.app import run_command_line
from vibro_cli.commands.shared.terminal import duration, size, summary_text
from vibro_cli.kernels.impact.laws import LAW_NAMES
from vibro_cli.mechanics.system import LAWS
from vibro_cli.report.words import ending
from vibro_cli.scenario.models import Law
from vibro_cli.systems.columns import END_CAUSES
from vibro_cli.systems.request import STOPS


def lines(**changes: Any) -> list[str]:
    """Return the lines of a summary, with wrapped lines joined again."""
    record = {**FakeRun().summary_record(), **changes}
    return re.sub(r"\n {4}\s*", " ", summary_text("name", record, None)).splitlines()


def test_the_whole_summary() -> None:
    text = summary_text("name", FakeRun().summary_record(), Path("my results/name"))
    assert text.splitlines() == [
        "name: ended at t = 60 s: the stop time was reached",
        "  impacts    3, from t = 0.25 s to 59.5 s; 1 crossing, 0 lasting contacts",
        "  energy     12.5 J at the start, 11.25 J at the end",
        "  accuracy   largest gap left at an impact 1e-16 m",
        "  validity   normal force at least 3.5 N; rolling needs a coefficient of",
        "             friction of 0.25",
        "  files      my results/name",
        "  next       vibro report 'my results/name'",
    ]


@pytest.mark.parametrize("mass", [1.0, 2.0])
def test_it_is_said_when_chaotic_motion_has_lost_its_digits(mass: float) -> None:
    """With equal masses the motion is regular, and keeps its digits."""
    changes = {"balls[1].mass": mass, "stop.collisions": 500}
    run = simulate(example("falling_balls").replace(changes))
    text = " ".join(summary_text("name", dict(run.summary), None).split())
    said = re.search(r"; after some (\S+) s no digit is accurate", text)
    digits = run.collisions["digits_left"]
    assert (said is not None) is bool(np.any(digits == 0.0)) is (mass == 2.0)
    if said is not None:
        first = run.collisions["t"][np.argmax(digits == 0.0)]
        assert float(said[1]) == pytest.approx(first, rel=0.25)


def test_the_time_until_digits_are_lost_is_written_out() -> None:
    """It was 1e+02 s."""
    run = simulate(example("turning_circle").replace({"analysis.lyapunov": True}))
    summary = dict(run.summary) | {"lyapunov_1": 0.37}
    text = " ".join(summary_text("name", summary, None).split())
    assert "; after some 100 s no digit is accurate" in text
    summary["lyapunov_1"] = 45678.0
    text = " ".join(summary_text("name", summary, None, exponent_error=123.4).split())
    assert "the greatest 45680 ± 120 1/s" in text


def test_an_exponent_has_its_standard_error(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """That of the last row of the table, which ends with the last impact, as this run does."""
    scenario = example("falling_balls").replace({"stop.collisions": 500})
    (tmp_path / "balls.json").write_text(json.dumps(scenario.resolved()), encoding="utf-8")
    folder = ["-o", str(tmp_path / "run"), "--no-figures"]
    assert run_command_line(["run", str(tmp_path / "balls.json"), *folder]) == 0
    run = simulate(scenario)
    rate, error = (run.tables["exponents"][name][-1] for name in ("lyapunov_1", "lyapunov_error"))
    told = capsys.readouterr()
    assert f"the greatest {rate:.4g} ± {error:.2g} 1/s" in told.out + told.err


@pytest.mark.parametrize("changes", [{}, {"min_normal_force": -51.7324}, {"quiet_from": 1 / 3}])
def test_every_line_fits_a_terminal(changes: dict[str, Any]) -> None:
    long = {
        "collisions": 2_200_000,
        "crossings": 1_234_567,
        "contacts": 98_765,
        "reason": "x " * 99,
    }
    for status in ("ok", "invalid"):
        record = {**FakeRun().summary_record(), **long, **changes, "status": status}
        text = summary_text("name", {**record, "end_cause": "inadmissible"}, Path("outputs/name"))
        assert max(map(len, text.splitlines())) <= 80


def test_what_an_inadmissible_run_can_do_is_said() -> None:
    text = summary_text(
        "name", {**FakeRun().summary_record(), "end_cause": "inadmissible"}, None
    ).splitlines()
    assert text[-2:] == [
        "  hint       repeat the command with --set collision.inadmissible=normal-impulse",
        "             --force to have such impacts follow the normal-impulse law",
    ]


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("inadmissible", "2, at t = 0 s, the last 2 inadmissible and not carried out; 0"),
        ("lift_off", "1, at t = 0.243703 s, the last one prevented; 0"),
    ],
)
def test_impacts_at_the_end_that_are_not_made_are_told(
    name: str, words: str, vibro: Vibro, tmp_path: Path
) -> None:
    file = tmp_path / f"{name}.json"
    file.write_text(json.dumps(not_made(name)))
    assert f"impacts {words}" in " ".join(vibro("run", str(file), "--no-figures").err.split())


def test_what_a_one_sided_trace_would_do_is_said_of_others_only() -> None:
    record = {**FakeRun().summary_record(), "min_normal_force": -2.0}
    for one_sided, said in ((False, True), (True, False)):
        text = summary_text("name", record, None, one_sided)
        assert "warning: the trace has to hold the bodies back" in text
        assert ("would lose them" in " ".join(text.split())) == said


def test_a_system_need_not_count_anything_but_impacts() -> None:
    record = FakeRun().summary_record()
    for counted in ("crossings", "contacts"):
        del record[counted]
    text = re.sub(r"\n {4}\s*", " ", summary_text("name", record, None)).splitlines()
    assert text[1] == "  impacts    3, from t = 0.25 s to 59.5 s"


@pytest.mark.parametrize("cause", sorted(END_CAUSES))
def test_every_end_cause_has_its_words(cause: str) -> None:
    assert lines(end_cause=cause)[0].endswith(END_CAUSES[cause])
    assert cause not in {word for word in END_CAUSES[cause].split() if "_" in word}


def test_the_end_at_a_stop_has_the_name_of_its_key() -> None:
    assert set(STOPS) <= set(END_CAUSES)


@pytest.mark.parametrize(
    ("changes", "line", "text"),
    [
        ({"energy_drift": -3.5e-15}, 2, "; relative drift -3.5e-15"),
        ({"collisions": 1, "last_collision_time": 0.25}, 1, "1, at t = 0.25 s; 1 crossing"),
        ({"quiet_from": 12.5}, 1, "; none possible after t = 12.5 s"),
        ({"max_gap": None}, 3, "no impact to measure a gap at"),
        ({"min_normal_force": -2.0}, 4, "a normal force down to -2 N; a one-sided"),
        ({"max_friction_demand": 1.0}, 4, "3.5 N; rolling needs a coefficient of friction of 1"),
        (
            {"max_friction_demand": 17.0712},
            4,
            "warning: rolling needs a coefficient of friction of 17.07, more than dry surfaces "
            "have; normal force at least 3.5 N",
        ),
        (
            {"max_friction_demand": None, "min_normal_force": 0.0},
            4,
            "rolling is not possible everywhere",
        ),
        (
            {"end_cause": "inadmissible"},
            1,
            "59.5 s, the last one inadmissible and not carried out; 1",
        ),
        ({"crossings": 2, "contacts": 1}, 1, "2 crossings, 1 lasting contact"),
    ],
)
def test_what_is_particular_is_said(changes: dict[str, Any], line: int, text: str) -> None:
    assert text in lines(**changes)[line]


def test_a_run_without_impacts() -> None:
    text = lines(collisions=0, first_collision_time=None, last_collision_time=None)[1]
    assert text == "  impacts    0; 1 crossing, 0 lasting contacts"


def test_a_run_that_is_not_possible_is_one_line() -> None:
    invalid = {"status": "invalid", "reason": "ball 2 does not fit its valley"}
    nothing = dict.fromkeys(set(FakeRun().summary_record()) - set(invalid))
    assert lines(**invalid, **nothing) == ["name: invalid: ball 2 does not fit its valley"]


def test_every_law_has_its_words() -> None:
    for named in (get_args(Law)[1].words, LAWS):
        assert set(named) == set(LAW_NAMES)


@pytest.mark.parametrize(
    ("number", "text"),
    [
        (0, "0 B"), (999, "999 B"), (1000, "1 kB"), (3_214_000, "3.21 MB"),
        (999_400, "999 kB"), (999_600, "1 MB"), (999_600_000, "1 GB"), (2.5e12, "2.5 TB"),
    ],
)  # fmt: skip
def test_bytes_have_three_digits_and_no_power_of_ten(number: float, text: str) -> None:
    assert size(number) == text


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0.032, "0.032 s"), (4.26, "4.3 s"), (45, "45 s"), (130, "2 min 10 s"), (11100, "3 h 5 min")],
)
def test_a_duration_is_in_units_that_are_read_at_once(seconds: float, text: str) -> None:
    assert duration(seconds) == text


def test_a_run_that_is_followed_as_far_as_times_reach_was_not_stopped() -> None:
    assert lines(end_time=1e100)[0] == (
        "name: ended at t = 1e+100 s: the bodies move on for ever; without stop.time a run is "
        "followed until then"
    )
    assert ending("time", 1e100).startswith("The bodies move on for ever")
    assert ending("time", 60.0) == "The stop time was reached."
