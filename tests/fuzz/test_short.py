"""The short form of the fuzzing, with the same texts every time."""

import math
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.effort import processor_time
from tests.fuzz.judge import judge
from tests.fuzz.mutation import FORMS, mutated, seeds
from tests.scenario.texts import parse_scenario
from vibro_cli.scenario import ScenarioError

COUNT = {"toml": 1500, "json": 1500, "yaml": 300}


@pytest.mark.parametrize("form", FORMS)
def test_only_scenario_errors_leave_the_reader(form: str) -> None:
    # A second on a usual machine: the time of many texts like the seeds, wherever this runs.
    usual = processor_time(lambda: judge(form, range(20), math.inf))
    found = judge(form, range(COUNT[form]), longest=50 * usual)
    assert found.faults == []
    assert found.valid + found.invalid == COUNT[form]
    # If all texts were refused at once, the test would show little.
    assert found.valid > 0.02 * COUNT[form]


@pytest.mark.parametrize("key", ["<<: *ands", "<", "<wall>"])
def test_a_key_that_looks_like_a_tag_is_an_unknown_key(key: str) -> None:
    """Found by the long form, after 166,463 texts."""
    for text in (f'{{"{key}": 1}}', f'{{"ends": {{"left": {{"{key}": 1, "wall": 1}}}}}}'):
        with pytest.raises(ScenarioError, match=re.escape(f'the unknown key "{key}"')):
            parse_scenario(text, "json")


@pytest.mark.parametrize("form", FORMS)
def test_texts_are_the_same_every_time_and_differ(form: str) -> None:
    texts = {mutated(form, number) for number in range(200)}
    assert len(texts) > 190
    assert mutated(form, 7) in texts
    assert len(seeds(form)) > 14


def test_the_long_form_says_what_it_found_and_keeps_within_its_memory() -> None:
    outcome = subprocess.run(
        [sys.executable, "-m", "tests.fuzz", "--form", "json", "--count", "200"],
        cwd=Path(__file__).parents[2],
        capture_output=True,
        text=True,
        check=True,
    )
    assert outcome.stdout.startswith("json to 200: ")
    assert outcome.stdout.rstrip().endswith("0 faults")


def test_the_judge_sees_what_a_reader_leaks(monkeypatch: pytest.MonkeyPatch) -> None:
    """To the user any exception is a bad text; here it is a fault."""

    def leak(*_: object) -> None:
        raise KeyError("leaked")

    monkeypatch.setattr("vibro_cli.scenario.forms.read_json", leak)
    (fault, *_) = judge("json", range(5)).faults
    assert "cannot be read (KeyError)" in fault
    monkeypatch.setattr("vibro_cli.scenario.loading.parse_document", leak)
    assert "json 0: KeyError: 'leaked'" in judge("json", range(5)).faults


def test_fuzzing_guided_by_coverage() -> None:
    pytest.importorskip("atheris")
    outcome = subprocess.run(
        [sys.executable, "-m", "tests.fuzz.guided", "--form", "json", "--runs", "500"],
        cwd=Path(__file__).parents[2],
        capture_output=True,
        text=True,
        check=False,
    )
    assert outcome.returncode == 0, outcome.stderr
    assert "Done 500 runs" in outcome.stderr
