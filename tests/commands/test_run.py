"""`vibro run`: where results go, what it prints, and how it ends."""

import contextlib
import csv
import errno
import io
import json
import os
import pkgutil
import shlex
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pyarrow as pa
import pytest

from tests.commands.conftest import ByHand, Outcome, Vibro
from tests.grids.kill import content
from tests.storage.test_files import entries
from tests.two_balls import SCENARIO
from vibro_cli import api, interface, verify
from vibro_cli.api import NotRecalled
from vibro_cli.commands.app import run_command_line
from vibro_cli.commands.run import Interruption
from vibro_cli.commands.shared.error_handling import Terminated
from vibro_cli.errors import NoLibrary
from vibro_cli.storage.files import FolderRefused
from vibro_cli.storage.folders import StreamedFolder
from vibro_cli.storage.tables import read_parquet
from vibro_cli.systems import driver

GALLERY = Path(__file__).parents[2] / "scenarios"
TWO_DISKS = GALLERY / "springs/two_disks.toml"
INTERRUPTED = """
import sys, time
sys.path.insert(0, {root!r})
from tests.fake_run import FakeRun
import vibro_cli.api as module
def simulate_streamed(scenario, sink, engine, checkpoint, names, interrupted, **options):
    if scenario.name == "second":
        print("started", flush=True)
        while not interrupted():
            time.sleep(0.01)
    return FakeRun().told_to(sink)
module.simulate_streamed = simulate_streamed
sys.argv[0] = "vibro"
from vibro_cli.__main__ import main
main()
"""


def several(folder: Path, *names: str) -> list[Path]:
    """Write scenarios with these names."""
    paths = []
    for name in names:
        path = folder / f"{name}.toml"
        path.write_text(SCENARIO)
        paths.append(path)
    return paths


def test_results_go_to_outputs_by_name(vibro: Vibro, scenario: Path, by_hand: ByHand) -> None:
    outcome = vibro("run", scenario, "--no-figures")
    assert outcome.code == 0
    assert outcome.out == b""
    assert "collisions.parquet" in entries(Path("outputs/small"))


def test_o_names_the_folder(vibro: Vibro, scenario: Path, by_hand: ByHand) -> None:
    assert vibro("run", scenario, "-o", "a/b", "--no-figures").code == 0
    assert "summary.json" in entries(Path("a/b"))
    assert not Path("outputs").exists()


def test_several_scenarios_have_a_folder_each(
    vibro: Vibro, tmp_path: Path, by_hand: ByHand
) -> None:
    paths = several(tmp_path, "first", "second")
    assert vibro("run", *paths, "-o", "all", "--no-figures").code == 0
    assert entries(Path("all")) == ["first", "second"]
    assert by_hand.calls == [("first", "compiled"), ("second", "compiled")]


def test_equal_names_are_an_error_before_anything_runs(
    vibro: Vibro, tmp_path: Path, by_hand: ByHand
) -> None:
    paths = several(tmp_path, "first", "second")
    outcome = vibro("run", *paths, "--set", "name=same")
    assert outcome.code == 2
    assert "2 scenarios are called 'same'" in outcome.err
    assert by_hand.calls == []


def test_the_engine_is_passed_on(vibro: Vibro, scenario: Path, by_hand: ByHand) -> None:
    vibro("run", scenario, "--no-figures", "--engine", "python", "-q")
    assert by_hand.calls == [("small", "python")]


def test_a_foreign_folder_is_refused_before_anything_runs(
    vibro: Vibro, scenario: Path, by_hand: ByHand
) -> None:
    Path("mine").mkdir()
    Path("mine/thesis.tex").write_text("years of work")
    outcome = vibro("run", scenario, "-o", "mine")
    assert outcome.code == 2
    assert outcome.err.startswith("vibro: mine exists and is not a vibro run")
    assert by_hand.calls == []
    assert entries(Path("mine")) == ["thesis.tex"]


def test_a_run_of_the_same_parameters_is_replaced(
    vibro: Vibro, scenario: Path, by_hand: ByHand
) -> None:
    for _ in range(2):
        assert vibro("run", scenario, "--no-figures").code == 0
    assert entries(Path("outputs")) == ["small"]


def test_a_run_of_other_parameters_is_replaced_only_by_force(
    vibro: Vibro, scenario: Path, by_hand: ByHand
) -> None:
    def kept() -> bytes:
        return Path("outputs/small/scenario.json").read_bytes()

    other = ("run", scenario, "--no-figures", "--set", "collision.k=0.5")
    assert vibro("run", scenario, "--no-figures").code == 0
    before = kept()
    refused = vibro(*other, "--json")
    assert (refused.code, refused.out, kept()) == (2, b"", before)
    assert refused.err.splitlines() == [
        "vibro: outputs/small holds a run with different parameters (found -> requested):",
        "  collision.k[1]: 0.9 -> 0.5",
        "(--force replaces it, -o names another folder)",
    ]
    assert len(by_hand.calls) == 1
    assert vibro(*other, "--force").code == 0
    assert json.loads(kept())["collision"]["k"] == [0.5]
    Path("outputs/small/scenario.json").write_text("damaged")
    refused = vibro(*other)
    assert refused.code == 2
    assert "with different parameters" in refused.err
    assert vibro(*other, "--force").code == 0


def test_force_replaces_nothing_that_is_not_a_run(
    vibro: Vibro, scenario: Path, by_hand: ByHand
) -> None:
    Path("mine").mkdir()
    Path("mine/thesis.tex").write_text("years of work")
    assert vibro("run", scenario, "-o", "mine", "--force").code == 2
    assert entries(Path("mine")) == ["thesis.tex"]


@pytest.mark.parametrize("form", ["csv", "jsonl", "arrow", "parquet"])
def test_format_streams_the_collisions_and_writes_no_folder(
    vibro: Vibro, scenario: Path, by_hand: ByHand, form: str
) -> None:
    outcome = vibro("run", scenario, "--format", form)
    assert outcome.code == 0
    assert not Path("outputs").exists()
    if form == "csv":
        times = [float(row["t"]) for row in csv.DictReader(outcome.text.splitlines())]
    elif form == "jsonl":
        times = [row["t"] for row in outcome.lines]
    elif form == "arrow":
        times = pa.ipc.open_stream(outcome.out).read_all()["t"].to_pylist()
    else:
        times = read_parquet(io.BytesIO(outcome.out))["t"].to_pylist()
    assert times == list(by_hand.run.collisions["t"])


def test_a_dash_streams_csv(vibro: Vibro, scenario: Path, by_hand: ByHand) -> None:
    outcome = vibro("run", scenario, "-o", "-")
    assert outcome.text.startswith('"n","t","t_low"')
    assert not Path("-").exists()


def test_format_with_a_folder_does_both(vibro: Vibro, scenario: Path, by_hand: ByHand) -> None:
    outcome = vibro("run", scenario, "--format", "csv", "-o", "both", "--no-figures")
    assert outcome.text.count("\n") == 4
    assert "collisions.parquet" in entries(Path("both"))


def test_json_prints_a_summary_on_a_line_for_each_scenario(
    vibro: Vibro, tmp_path: Path, by_hand: ByHand
) -> None:
    outcome = vibro("run", *several(tmp_path, "first", "second"), "--json", "--no-figures")
    assert [line["scenario"] for line in outcome.lines] == ["first", "second"]
    kept = json.loads(Path("outputs/first/summary.json").read_text())
    where = {"overrides": {}, "folder": "outputs/first"}
    assert outcome.lines[0] == {"scenario": "first", **where, **kept}


def test_json_tells_what_was_changed_and_where_it_is(
    vibro: Vibro, scenario: Path, by_hand: ByHand
) -> None:
    changes = {"collision.k": 0.5, "balls[1].angle": "-60 deg", "stop.collisions": 7}
    options = [text for path, value in changes.items() for text in ("--set", f"{path}={value}")]
    (line,) = vibro("run", scenario, "--json", "-o", "there", "--no-figures", *options).lines
    assert (line["overrides"], line["folder"]) == (changes, "there")
    (line,) = vibro("run", scenario, "--json", "-o", "there", "--set", "stop.time=inf").lines
    assert (line["status"], line["overrides"], line["folder"]) == (
        "invalid", {"stop.time": "inf"}, None
    )  # fmt: skip
    (line,) = vibro("run", scenario, "--json", "--set", "name = {day = 2026-01-01}").lines
    assert (line["status"], line["overrides"]) == ("invalid", {"name": "{day = 2026-01-01}"})


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--json", "-o", "-"], "both need standard output"),
        (["--json", "--format", "csv"], "both need standard output"),
        (["b.toml", "-o", "-"], "one table is streamed at a time"),
        (["--figures", "portrait", "--no-figures"], "found --figures and --no-figures"),
        (
            ["--format", "csv", "--figures", "all"],
            "a streamed table alone has no folder, which --figures and --force need; ",
        ),
        (["-o", "-", "--force"], "which --figures and --force need; expected --format and -o DIR"),
        (["--set"], "requires an argument. (see vibro run --help)"),
    ],
)
def test_what_does_not_go_together_is_wrong_usage(
    vibro: Vibro, arguments: list[str], message: str
) -> None:
    outcome = vibro("run", "a.toml", *arguments)
    assert outcome.code == 2
    assert message in outcome.err


def test_the_summary_says_in_words_how_it_ended(
    vibro: Vibro, scenario: Path, by_hand: ByHand
) -> None:
    outcome = vibro("run", scenario, "--no-figures")
    first, *rest = outcome.err.splitlines()
    assert first == "small: ended at t = 60 s: the stop time was reached"
    assert [line.split()[0] for line in rest] == [
        "impacts",
        "energy",
        "accuracy",
        "validity",
        "friction",  # the end of the line before, which is broken at 80 columns
        "files",
        "next",
    ]
    assert rest[-2].split()[1] == "outputs/small"
    assert rest[-1].split(None, 1)[1] == "vibro report outputs/small"


def test_quiet_says_nothing_and_verbose_what_was_skipped(
    vibro: Vibro, scenario: Path, by_hand: ByHand
) -> None:
    assert vibro("run", scenario, "--no-figures", "-q").err == ""
    verbose = vibro("run", scenario, "--no-figures", "-v").err
    assert verbose.splitlines()[-1].split(None, 1) == ["skipped", by_hand.run.skipped[0]]


def test_a_lone_body_needs_no_search(vibro: Vibro) -> None:
    path = GALLERY / "lone_particle.toml"
    verbose = vibro("run", path, "--no-figures", "-v", "--set", "stop.time=0.1").err
    assert "every search for a contact: none was needed" in " ".join(verbose.split())


@pytest.mark.parametrize(
    ("status", "cause", "code"),
    [("ok", "time", 0), ("ok", "inadmissible", 3), ("invalid", None, 3), ("failed", None, 3)],
)
def test_strict_ends_with_3_unless_all_is_sound(
    vibro: Vibro,
    scenario: Path,
    by_hand: ByHand,
    monkeypatch: pytest.MonkeyPatch,
    status: str,
    cause: str | None,
    code: int,
) -> None:
    record = {**by_hand.run.summary_record(), "status": status, "end_cause": cause}
    monkeypatch.setattr(by_hand.run, "summary_record", lambda: record)
    heard = vibro("run", scenario, "--no-figures").err
    strict = vibro("run", scenario, "--no-figures", "--strict", "-q")
    assert strict.code == code
    assert strict.err == ("" if code == 0 else heard)  # or cron would send no mail


def bad_and_good(folder: Path) -> list[Path]:
    good, bad, worse = several(folder, "good", "bad", "worse")
    bad.write_text(SCENARIO.replace("mass = 2.0", "mass = -2.0"))
    worse.write_text(SCENARIO.replace("gravity", "gravitas").replace("k = 0.9", "k = 1.9"))
    return [bad, good, worse, folder / "none.toml"]


def assert_all_told(outcome: Outcome) -> None:
    assert outcome.code == 2
    for place in ("bad.toml:8:", "worse.toml:2:", "worse.toml:17:", "none.toml: "):
        assert place in outcome.err
    assert "balls[1].mass: found -2.0, expected" in outcome.err


def test_bad_scenarios_are_told_and_the_good_ones_run(
    vibro: Vibro, tmp_path: Path, by_hand: ByHand
) -> None:
    outcome = vibro("run", *bad_and_good(tmp_path), "--json", "--no-figures")
    assert_all_told(outcome)
    assert by_hand.calls == [("good", "compiled")]
    assert entries(Path("outputs")) == ["good"]
    assert [line["status"] for line in outcome.lines] == ["invalid", "invalid", "invalid", "ok"]
    first = outcome.lines[0]["problems"][0]
    assert (first["path"], first["found"], first["line"]) == ("balls[1].mass", "-2.0", 8)


def test_fail_fast_runs_nothing_when_a_scenario_is_bad(
    vibro: Vibro, tmp_path: Path, by_hand: ByHand
) -> None:
    outcome = vibro("run", *bad_and_good(tmp_path), "--fail-fast")
    assert_all_told(outcome)
    assert outcome.out == b""
    assert by_hand.calls == []


@pytest.mark.parametrize(("options", "done"), [((), ["first", "third"]), (("--fail-fast",), [])])
def test_a_failure_does_not_stop_the_others_unless_it_should(
    vibro: Vibro, tmp_path: Path, by_hand: ByHand, options: tuple[str, ...], done: list[str]
) -> None:
    def act() -> None:
        if by_hand.calls[-1][0] == ("second" if not options else "first"):
            raise OSError(errno.ENOSPC, "No space left on device")

    by_hand.act = act
    outcome = vibro("run", *several(tmp_path, "first", "second", "third"), "--no-figures", *options)
    assert outcome.code == 1
    assert "vibro: No space left on device\n" in outcome.err
    assert [name for name in ("first", "second", "third") if Path("outputs", name).exists()] == done


def test_words_and_errors_as_json(vibro: Vibro, scenario: Path, by_hand: ByHand) -> None:
    outcome = vibro("run", scenario, "--no-figures", "-v", "--log-format", "json")
    words = [json.loads(line) for line in outcome.err.splitlines()]
    assert [word["level"] for word in words] == ["info", "detail"]
    assert words[0]["scenario"] == "small"
    scenario.write_text(SCENARIO.replace("mass = 2.0", "mass = -2.0"))
    (word,) = map(json.loads, vibro("check", scenario, "--log-format=json").err.splitlines())
    assert word["level"] == "error"
    assert word["problems"][0]["path"] == "balls[1].mass"
    (word,) = map(json.loads, vibro("run", "--log-format", "json", "--fly").err.splitlines())
    assert word["level"] == "error"


def test_a_scenario_comes_from_standard_input(
    vibro: Vibro, by_hand: ByHand, monkeypatch: pytest.MonkeyPatch
) -> None:
    data = io.TextIOWrapper(io.BytesIO(SCENARIO.encode()))
    monkeypatch.setattr(sys, "stdin", data)
    assert vibro("run", "-", "--set", "name=piped", "--no-figures").code == 0
    assert entries(Path("outputs")) == ["piped"]


def test_standard_input_is_read_once(vibro: Vibro) -> None:
    outcome = vibro("run", "-", "-")
    assert outcome.code == 2
    assert "only once" in outcome.err


def test_a_fault_of_the_program_is_named_and_its_traceback_kept(
    vibro: Vibro, scenario: Path, by_hand: ByHand, monkeypatch: pytest.MonkeyPatch
) -> None:
    def act() -> None:
        raise KeyError("no such\nthing")

    by_hand.act = act
    monkeypatch.setattr("tempfile.tempdir", str(scenario.parent))
    outcome = vibro("run", scenario)
    assert outcome.code == 1
    assert outcome.err.startswith(
        "vibro: internal error, please report it: KeyError: 'no such\\nthing' ("
    )
    assert outcome.err.count("\n") == 1
    (kept,) = scenario.parent.glob("vibro-fault-*.txt")
    assert str(kept) in outcome.err
    assert "Traceback" in kept.read_text()


def test_a_manifest_with_a_text_in_place_of_a_time_is_none(vibro: Vibro, scenario: Path) -> None:
    assert vibro("run", scenario, "-o", "run", "--no-figures").code == 0
    manifest = Path("run/manifest.json")
    whole = json.loads(manifest.read_text())
    manifest.write_text(json.dumps(whole | {"unsampled_from": 1.5}))
    assert "samples of its motion from t = 1.5 s" in vibro("verify", "run").err
    manifest.write_text(json.dumps(whole | {"unsampled_from": "1.5"}))
    outcome = vibro("verify", "run")
    assert outcome.code == 2
    assert "run has no valid manifest" in outcome.err


def test_without_memory_for_the_traceback_of_a_fault_memory_has_run_out(
    vibro: Vibro, scenario: Path, by_hand: ByHand, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Libraries in C then raise errors of other types."""

    def act() -> None:
        raise SystemError("error return without exception set")

    def refuse(*_: object) -> None:
        raise MemoryError

    by_hand.act = act
    monkeypatch.setattr("tempfile.tempdir", str(scenario.parent))
    monkeypatch.setattr("traceback.format_exception", refuse)
    outcome = vibro("run", scenario)
    assert (outcome.code, outcome.err) == (1, "vibro: out of memory\n")
    assert not list(scenario.parent.glob("vibro-fault-*"))


@pytest.mark.parametrize(
    ("end", "code"), [(KeyboardInterrupt(), 130), (Terminated(15), 143), (Terminated(1), 129)]
)
def test_a_signal_that_struck_within_a_class_is_no_fault_of_the_program(
    vibro: Vibro, scenario: Path, by_hand: ByHand, end: BaseException, code: int
) -> None:
    """Python 3.11 turns what `__set_name__` raises into a RuntimeError, as while modules load."""

    def act() -> None:
        try:
            raise RuntimeError("Error calling __set_name__") from end
        except RuntimeError as error:
            raise ImportError("no module") from error

    by_hand.act = act
    outcome = vibro("run", scenario)
    assert outcome.code == code
    assert "internal error" not in outcome.err
    assert outcome.err.count("\n") == 1


def test_an_error_in_the_place_of_a_signal_is_no_fault_of_the_program(
    vibro: Vibro, scenario: Path, by_hand: ByHand
) -> None:
    """C code may drop the exception of a signal, and report a wrong argument instead."""

    def act() -> None:
        with contextlib.suppress(KeyboardInterrupt):
            signal.raise_signal(signal.SIGTERM)
        raise ValueError("no matrix")

    by_hand.act = act
    outcome = vibro("run", scenario, "--format", "csv")
    assert outcome.code == 143
    assert outcome.err.startswith("vibro: terminated; ")


def test_a_signal_that_python_drops_comes_again(
    vibro: Vibro, scenario: Path, by_hand: ByHand
) -> None:
    """Python prints what `__del__` raises as `Exception ignored in`, and drops it."""

    class Closed:
        def __del__(self) -> None:
            signal.raise_signal(signal.SIGTERM)

    ended = False

    def act() -> None:
        nonlocal ended
        held = [Closed()]
        held.clear()
        time.sleep(15.0)
        ended = True

    by_hand.act = act
    outcome = vibro("run", scenario, "--format", "csv")
    assert not ended
    assert (outcome.code, outcome.err) == (143, "vibro: terminated; nothing was written\n")


@pytest.mark.parametrize(
    ("error", "code", "message"),
    [
        (OSError(errno.ENOSPC, "No space left on device", "a.parquet"), 1, "a.parquet: No space"),
        (MemoryError(), 1, "out of memory"),
        (
            RuntimeError("can't start new thread"),
            1,
            "vibro: no thread can be started: the limit of processes (ulimit -u)",
        ),
        (
            ImportError("a.so: failed to map segment from shared object"),
            1,
            "vibro: out of memory\n",
        ),
        (
            OSError("kernels.so: failed to map segment from shared object"),
            1,
            "vibro: out of memory\n",
        ),
        (
            ImportError("numpy says:\n\nno: a.so: failed to map segment from shared object\n"),
            1,
            "vibro: out of memory\n",
        ),
        (
            ImportError("no parquet (a.so: failed to map segment from shared object)"),
            1,
            "vibro: out of memory\n",
        ),
        (
            ImportError("a.so: failed to map segment from shared object: Operation not permitted"),
            1,
            "internal error, please report it: ImportError: a.so",
        ),
        (NoLibrary("laws.py:71: no kernel"), 1, "vibro: laws.py:71: no kernel\n"),
        (NotRecalled("it ends elsewhere"), 1, "vibro: it ends elsewhere\n"),
        (FolderRefused("b is no run"), 2, "vibro: b is no run\n"),
        (KeyboardInterrupt(), 130, "vibro: interrupted; nothing was written\n"),
        (Terminated(15), 143, "vibro: terminated; nothing was written\n"),
        (BrokenPipeError(), 0, ""),
    ],
)
def test_errors_of_the_system_are_one_line(
    vibro: Vibro,
    scenario: Path,
    by_hand: ByHand,
    monkeypatch: pytest.MonkeyPatch,
    error: BaseException,
    code: int,
    message: str,
) -> None:
    def act() -> None:
        raise error

    by_hand.act = act
    outcome = vibro("run", scenario)
    assert outcome.code == code
    assert message in outcome.err
    assert outcome.err.count("\n") == (1 if message else 0)
    assert not Path("outputs/small").exists()


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_keeps_what_was_finished_and_nothing_else(
    tmp_path: Path, number: signal.Signals, code: int
) -> None:
    paths = several(tmp_path, "first", "second", "third")
    script = INTERRUPTED.format(root=str(Path(__file__).parents[2]))
    with subprocess.Popen(
        [sys.executable, "-c", script, "run", *map(str, paths), "-o", "all", "--no-figures", "-q"],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "started\n"
        process.send_signal(number)
        _, words = process.communicate(timeout=300)
    assert process.returncode == code
    assert words.endswith("; finished results are kept\n")
    assert words.count("\n") == 1
    assert entries(tmp_path / "all") == ["first", "second"]
    assert entries(tmp_path / "all" / "second") == entries(tmp_path / "all" / "first")


@pytest.mark.parametrize("name", ["-dash", "it's a run", "-v; rm x"])
def test_the_command_that_follows_takes_the_folder_for_no_option(vibro: Vibro, name: str) -> None:
    few = ("--set", "stop.collisions=2", "--no-figures", "-o", name)
    told = vibro("run", GALLERY / "one_circle.toml", *few).err.splitlines()[-1]
    following, _, command = told.strip().partition(" ")
    program, report, folder = shlex.split(command)
    assert (following, program, report) == ("next", "vibro", "report")
    assert os.path.samefile(folder, Path(name))
    assert vibro("verify", folder).code == 0


FIGURES = {
    "one_circle": ["portrait", "scene", "velocities"],
    "springs/two_disks": ["motion", "portrait"],
    "table/skew_impact": ["plan"],
}


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize("name", FIGURES)
def test_the_figures_that_are_named_are_drawn(vibro: Vibro, tmp_path: Path, name: str) -> None:
    wanted = FIGURES[name]
    path = GALLERY / f"{name}.toml"
    few = ("--set", "stop.collisions=2", "-o", "run", "-q")
    assert vibro("run", path, *few, "--figures", ",".join(wanted)).code == 0
    drawn = {file.stem.rpartition("_")[0] or file.stem for file in tmp_path.glob("run/*.png")}
    assert drawn == set(wanted)


@pytest.mark.usefixtures("undrawn")
def test_a_run_that_is_continued_has_the_same_kinds_of_figures(
    vibro: Vibro, tmp_path: Path
) -> None:
    def drawn() -> list[str]:
        return sorted(file.stem for file in tmp_path.glob("run/*.png"))

    def to(stop: int, *options: str) -> int:
        more = ("--set", f"stop.collisions={stop}", "-q", *options)
        return vibro("run", "--continue", "run", *more).code

    # One with a table of its motion beside the figure.
    few = ("--set", "stop.collisions=2", "--set", "output.step=0.1", "-o", "run", "-q")
    assert vibro("run", TWO_DISKS, *few, "--figures", "portrait,energy").code == 0
    assert (tmp_path / "run/motion.parquet").exists()
    before = drawn()
    assert before == ["energy", "portrait_1", "portrait_2"]
    assert (to(3), drawn()) == (0, before)
    assert (to(4, "--figures", "motion"), drawn()) == (0, ["motion"])
    assert (to(5, "--no-figures"), drawn()) == (0, [])
    assert (to(6), drawn()) == (0, [])


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory: pytest.TempPathFactory) -> dict[int, dict[str, bytes]]:
    """The files of runs of 2 and of 3 impacts, with figures."""
    folder, found = tmp_path_factory.mktemp("uninterrupted"), {}
    for stop in (2, 3):
        asked = ("--set", f"stop.collisions={stop}", "--figures", "motion,energy", "-q")
        assert run_command_line(["run", str(TWO_DISKS), *asked, "-o", str(folder / str(stop))]) == 0
        found[stop] = content(folder / str(stop))
    return found


@pytest.mark.parametrize(
    ("number", "code", "early"),
    [
        (signal.SIGINT, 130, False),
        (signal.SIGTERM, 143, True),
        pytest.param(signal.SIGINT, 130, True, marks=pytest.mark.long),
        pytest.param(signal.SIGTERM, 143, False, marks=pytest.mark.long),
    ],
)
def test_a_signal_does_not_wait_for_figures_and_loses_no_table(
    vibro: Vibro,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    uninterrupted: dict[int, dict[str, bytes]],
    number: signal.Signals,
    code: int,
    early: bool,
) -> None:
    """It comes while figures are drawn, or before: then no figure is begun."""
    begun = 0

    def figures_of(*_: object) -> dict[str, bytes]:
        nonlocal begun
        begun += 1
        os.kill(os.getpid(), number)
        return {}

    def simulate_streamed(*given: Any, **more: Any) -> Any:
        os.kill(os.getpid(), number)
        return real(*given, **more)

    real = api.simulate_streamed
    monkeypatch.setattr(interface, "figures_of", figures_of)
    if early:
        monkeypatch.setattr(api, "simulate_streamed", simulate_streamed)
    few = ("--set", "stop.collisions=2")
    outcome = vibro("run", TWO_DISKS, *few, "--figures", "motion,energy", "-o", "run")
    assert outcome.code == code
    assert outcome.err.endswith("; finished results are kept, two_disks without figures\n")
    assert begun == (not early)
    monkeypatch.undo()
    monkeypatch.chdir(tmp_path)
    verified = vibro("verify", "run")
    assert verified.code == 0
    assert "run: ended by a signal, without figures; vibro run --continue com" in verified.err
    shutil.copytree("run", "ended")
    assert vibro("run", "--continue", "ended", "-q").code == 0
    assert content(tmp_path / "ended") == uninterrupted[2]
    assert vibro("run", "--continue", "run", "--set", "stop.collisions=3", "-q").code == 0
    assert content(tmp_path / "run") == uninterrupted[3]


@pytest.mark.parametrize("scene", ["three_arcs", "springs/two_disks", "table/skew_impact"])
def test_a_signal_does_not_wait_for_very_many_samples(
    vibro: Vibro, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, scene: str
) -> None:
    """With a mistyped step the table of one stretch would take years, and fill the disk."""
    real, struck = StreamedFolder.add, 0.0

    def add(folder: StreamedFolder, name: str, rows: Any) -> None:
        nonlocal struck
        if name == "motion" and not struck:
            struck = time.monotonic()
            os.kill(os.getpid(), signal.SIGTERM)
        real(folder, name, rows)

    monkeypatch.setattr(StreamedFolder, "add", add)
    options = ("--no-figures", "-q", "-o")
    path, step = GALLERY / f"{scene}.toml", 1e-12
    outcome = vibro("run", path, "--set", f"output.step={step}", *options, "run")
    assert outcome.code == 143
    assert time.monotonic() - struck < 10.0  # mostly 1.5 s
    monkeypatch.undo()
    monkeypatch.chdir(tmp_path)
    verified = vibro("verify", "run")
    assert verified.code == 0
    motion = read_parquet(tmp_path / "run/motion.parquet")
    bodies = motion["body" if "body" in motion.column_names else "ball"].to_numpy()
    count = motion.num_rows // len(set(bodies))
    missing = json.loads((tmp_path / "run/manifest.json").read_text())["unsampled_from"]
    assert missing == count * step
    assert verify("run").lacking == {"unsampled_from": missing}
    without = f"without samples of its motion from t = {missing:.6g} s"
    assert f"run: ended by a signal, {without}; vibro run --continue completes it" in verified.err
    name = path.stem
    words = f"finished results are kept, {name} {without}"
    assert outcome.err.endswith(f"vibro: terminated; {words}\n")
    longer = ("--set", "output.step=0.01")
    assert vibro("run", "--continue", "run", *longer, *options, "run").code == 0
    assert vibro("run", path, *longer, *options, "whole").code == 0
    assert content(tmp_path / "run") == content(tmp_path / "whole")


@pytest.mark.parametrize(
    ("number", "code", "step"),
    [
        (signal.SIGINT, 130, "folders.StreamedFolder.finish"),
        (signal.SIGTERM, 143, "files._put_in_place"),
        pytest.param(signal.SIGINT, 130, "files._put_in_place", marks=pytest.mark.long),
        pytest.param(signal.SIGTERM, 143, "folders.StreamedFolder.finish", marks=pytest.mark.long),
    ],
)
def test_a_signal_while_a_solved_run_is_put_in_place_loses_nothing(
    vibro: Vibro,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    uninterrupted: dict[int, dict[str, bytes]],
    number: signal.Signals,
    code: int,
    step: str,
) -> None:
    """On a slow disk that may take long."""
    real = pkgutil.resolve_name(f"vibro_cli.storage.{step}")

    def struck(*given: Any) -> None:
        os.kill(os.getpid(), number)
        real(*given)

    monkeypatch.setattr(f"vibro_cli.storage.{step}", struck)
    few = ("--set", "stop.collisions=2", "--figures", "motion,energy")
    outcome = vibro("run", TWO_DISKS, *few, "-o", "run")
    assert outcome.code == code
    assert outcome.err.endswith("; finished results are kept\n")
    assert content(tmp_path / "run") == uninterrupted[2]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_figures_that_a_signal_prevents_are_not_called_empty(
    vibro: Vibro, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: signal.Signals
) -> None:
    """It comes while the last rows are written; all figures were said to have nothing to show."""
    real = StreamedFolder.end_tables

    def struck(folder: StreamedFolder) -> Path:
        monkeypatch.setattr(StreamedFolder, "end_tables", real)
        os.kill(os.getpid(), number)
        return real(folder)

    monkeypatch.setattr(StreamedFolder, "end_tables", struck)
    few = ("--set", "stop.collisions=2", "--figures", "motion,energy")
    outcome = vibro("run", TWO_DISKS, *few, "-o", "run", "-q")
    assert outcome.err.endswith("; finished results are kept, two_disks without figures\n")
    assert outcome.err.count("\n") == 1


@pytest.mark.parametrize("finished", [0, 1])
def test_a_second_signal_tells_whether_any_run_was_finished(
    vibro: Vibro, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, finished: int
) -> None:
    """In the first of several, finished results were said to be kept, and there were none."""
    begun = 0

    def struck(*given: Any, **more: Any) -> Any:
        nonlocal begun
        begun += 1
        for _ in range(2 * (begun > finished)):
            os.kill(os.getpid(), signal.SIGINT)
        return real(*given, **more)

    real = api.simulate_streamed
    monkeypatch.setattr(api, "simulate_streamed", struck)
    outcome = vibro("run", *several(tmp_path, "first", "second"), "-o", "all", "--no-figures", "-q")
    left = ("nothing was written", "finished results are kept")[finished]
    assert (outcome.code, outcome.err) == (130, f"vibro: interrupted; {left}\n")
    assert [path.name for path in tmp_path.glob("all/*")] == ["first"][:finished]


def test_an_unknown_figure_is_refused_before_anything_runs(vibro: Vibro, tmp_path: Path) -> None:
    outcome = vibro("run", GALLERY / "one_circle.toml", "--figures", "velocity", "-o", "run")
    assert outcome.code == 2
    assert "found 'velocity' (did you mean 'velocities'?), expected all or some" in outcome.err
    assert not (tmp_path / "run").exists()


@pytest.mark.usefixtures("undrawn")
def test_a_figure_that_is_named_and_shows_nothing_is_told(vibro: Vibro, tmp_path: Path) -> None:
    few = ("--set", "stop={collisions = 1}", "-o", "run", "--force")
    path = GALLERY / "turning_circle.toml"
    outcome = vibro("run", path, *few, "--figures", "energy,intervals")
    assert outcome.code == 0
    assert "turning_circle: the run has nothing to show as intervals" in outcome.err
    assert {file.stem for file in tmp_path.glob("run/*.png")} == {"energy"}
    for figures in ("all", "default", "energy,accuracy"):
        assert "nothing to show" not in vibro("run", path, *few, "--figures", figures).err


GOING_ROUND = """
gravity = 9.81
[trace]
start_slope = "-180 deg"
closed = true
arcs = [{shape = "valley", radius = 1.0, end_slope = "180 deg"}]
[[balls]]
radius = 0.1
mass = 1.0
arc = 1
angle = 0.0
rate = 14.0
[[balls]]
radius = 0.1
mass = 0.1
arc = 1
angle = 1.0
rate = 0.0
[collision]
k = 0.0
[stop]
collisions = 5
"""
"""Two bodies that go round and seldom meet: five times in 900 crossings of the seam."""


def _expect_impacts_often(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have a run refused after 100 flights without an impact, looked for every 64 rows."""
    for name in ("FIRST_ROWS", "COMPILED_ROWS", "INTERPRETED_ROWS"):
        monkeypatch.setattr(driver, name, 64)
    monkeypatch.setattr(driver, "QUIET_ROWS", 100)


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize("engine", ["compiled", "python"])
def test_a_run_that_waits_too_long_for_an_impact_keeps_those_before(
    vibro: Vibro, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, engine: str
) -> None:
    (tmp_path / "round.toml").write_text(GOING_ROUND)
    assert vibro("run", "round.toml", "-q", "--no-figures", "-o", "whole").code == 0
    whole = read_parquet(Path("whole/collisions.parquet"))
    _expect_impacts_often(monkeypatch)
    outcome = vibro("run", "round.toml", "-q", "-o", "part", "--engine", engine)
    assert outcome.code == 2
    assert "no impact among the last 100 flights" in outcome.err
    assert "the run until then, without figures, is kept in part" in outcome.err
    kept = read_parquet(Path("part/collisions.parquet"))
    assert 0 < kept.num_rows < 5
    assert kept.equals(whole.slice(0, kept.num_rows))
    assert json.loads(Path("part/summary.json").read_text())["end_cause"] == "interrupted"
    monkeypatch.undo()
    assert vibro("run", "--continue", tmp_path / "part", "-q", "-o", tmp_path / "on").code == 0
    assert read_parquet(tmp_path / "on/collisions.parquet").equals(whole)


@pytest.mark.parametrize("engine", ["compiled", pytest.param("python", marks=pytest.mark.long)])
def test_what_is_kept_of_a_run_that_waits_too_long_has_a_report(
    vibro: Vibro, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, engine: str
) -> None:
    (tmp_path / "round.toml").write_text(GOING_ROUND)
    _expect_impacts_often(monkeypatch)
    assert vibro("run", "round.toml", "-q", "--engine", engine, "-o", "part").code == 2
    assert vibro("report", "part", "-q").code == 0


def test_a_run_that_never_has_an_impact_leaves_no_folder(
    vibro: Vibro, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    _expect_impacts_often(monkeypatch)
    text = GOING_ROUND.replace("angle = 1.0\nrate = 0.0", "angle = 3.0\nrate = 14.0")
    (tmp_path / "round.toml").write_text(
        text.replace("angle = 0.0\nrate = 14.0", "angle = -3.0\nrate = 14.0")
    )
    outcome = vibro("run", "round.toml", "-q", "-o", "part")
    assert (outcome.code, Path("part").exists()) == (2, False)
    assert "no impact among the last 100 flights" in outcome.err


@pytest.mark.usefixtures("undrawn")
def test_figures_that_are_interrupted_do_not_replace_those_of_the_same_run(
    vibro: Vibro, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def figures_of(*_: object) -> dict[str, bytes]:
        os.kill(os.getpid(), signal.SIGINT)
        return {}

    command = ("run", GALLERY / "one_circle.toml", "--set", "stop.collisions=2", "-q", "-o", "run")
    assert vibro(*command).code == 0
    before = content(tmp_path / "run")
    assert "portrait_1.pdf" in before
    monkeypatch.setattr(interface, "figures_of", figures_of)
    outcome = vibro(*command)
    assert outcome.code == 130
    assert outcome.err.endswith("the results in run, which go as far or further, are kept\n")
    assert content(tmp_path / "run") == before


def test_an_interrupted_run_does_not_replace_one_that_goes_further(
    vibro: Vibro, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A continuation begins again at the start, and may be interrupted before the earlier end."""

    def interrupted(self: Interruption) -> None:
        self.number, self.left = signal.SIGINT, "finished results are kept"

    falling = ("run", GALLERY / "falling_balls.toml", "--set", "stop.collisions=500")
    plain = ("-q", "--no-figures")
    assert vibro(*falling, *plain, "-o", "run").code == 0
    assert vibro(*falling, *plain, "-o", "short", "--set", "stop.collisions=3").code == 0
    before = content(tmp_path / "run")
    for name in ("FIRST_ROWS", "COMPILED_ROWS"):
        monkeypatch.setattr(driver, name, 64)
    monkeypatch.setattr(Interruption, "__init__", interrupted)
    on = ("--set", "stop.collisions=2000", *plain)
    for command in (("run", "--continue", "run", *on), (*falling, *plain, "-o", "run")):
        outcome = vibro(*command)
        assert outcome.code == 130
        assert outcome.err == (
            "vibro: interrupted; the results in run, which go as far or further, are kept\n"
        )
        assert content(tmp_path / "run") == before
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["run", "short"]
    outcome = vibro("run", "--continue", "short", *on)
    assert (outcome.code, outcome.err) == (130, "vibro: interrupted; finished results are kept\n")
    assert 3 < read_parquet(Path("short/collisions.parquet")).num_rows < 500
