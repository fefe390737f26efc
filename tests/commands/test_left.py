"""What a command says is left on disk when a signal ends it while it computes or draws."""

import contextlib
import os
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from tests.commands.conftest import Vibro
from tests.grid_folder import product, write_grid
from vibro_cli.benchmark.end_to_end import measure_grid
from vibro_cli.benchmark.measurement import PLANS, Job, Plan, Row, command
from vibro_cli.commands.shared.error_handling import Terminated
from vibro_cli.storage.files import write_file

FALLING = Path(__file__).parents[2] / "scenarios" / "falling_balls.toml"
COMPUTING = {
    "report run": "vibro_cli.report.content.report_html",
    "report grid": "vibro_cli.report.grid_content.grid_html",
    "section run": "vibro_cli.interface.runs.Run.section",
    "section grid": "vibro_cli.interface.grids.Grid.section",
    "basins grid": "vibro_cli.figures.analyses.mapped_basins",
    f"portrait {FALLING}": "vibro_cli.interface.pictures",
    f"orbit {FALLING} -o out": "vibro_cli.interface.analyses.orbit",
    f"fit {FALLING} run/collisions.parquet --free gravity": "vibro_cli.analysis.fit.fit_impacts",
    f"fit {FALLING} run/collisions.parquet --free gravity -o out": "vibro_cli.interface.pictures",
    "report ./run": "vibro_cli.storage.stored.open_run",
    f"run {FALLING} -o out": "vibro_cli.scenario.loading.load_any",
    "run --continue run": "vibro_cli.storage.folders.read_earlier_run",
    f"orbit {FALLING}": "vibro_cli.scenario.loading.load_any",
    f"fit {FALLING} run/collisions.parquet --free k": "vibro_cli.scenario.loading.load_any",
    f"portrait {FALLING} -o out": "vibro_cli.scenario.loading.load_any",
    "basins ./grid": "vibro_cli.storage.stored.open_grid",
    "new --all": "vibro_cli.scenario.gallery.whole",
}
"""Commands, and what they call before they write."""
LISTING = {
    "stress -o out": "vibro_cli.stress.suite.run",
    "bench --quick -o out": "vibro_cli.benchmark.suite.run",
}
"""Commands that print results as they come, and write after the last."""


def signalled(*_: object) -> None:
    raise Terminated(15)


def signalled_later(*_: object) -> Iterator[None]:
    signalled()
    yield


@pytest.mark.parametrize("command", [*COMPUTING, *LISTING])
def test_nothing_is_kept_of_what_is_written_at_the_end(
    vibro: Vibro, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: str
) -> None:
    write_grid(tmp_path / "grid", product({"balls[1].angle": [0.0, 0.1], "stop.time": [1.0, 2.0]}))
    vibro("run", FALLING, "--set", "stop.collisions=3", "--no-figures", "-o", "run")
    before = sorted(tmp_path.rglob("*"))
    if command in LISTING:
        monkeypatch.setattr(LISTING[command], signalled_later)
    else:
        monkeypatch.setattr(COMPUTING[command], signalled)
    outcome = vibro(*command.split())
    assert outcome.code == 143
    assert outcome.err.splitlines()[-1] == "vibro: terminated; nothing was written"
    assert sorted(tmp_path.rglob("*")) == before


def test_temporary_folders_of_measurements_are_not_called_results(
    vibro: Vibro, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def run(*_: object) -> Iterator[None]:
        with TemporaryDirectory() as folder:
            write_file(Path(folder) / "part", b"of a grid that is timed")
        return signalled_later()

    monkeypatch.setattr("vibro_cli.benchmark.suite.run", run)
    outcome = vibro("bench", "--quick", "-o", "out")
    assert outcome.code == 143
    assert outcome.err.splitlines()[-1] == "vibro: terminated; nothing was written"
    assert not list(tmp_path.iterdir())


def test_a_measured_grid_that_is_ended_leaves_no_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def timed(jobs: list[tuple[Row, Job]], plan: Plan) -> None:
        for _, job in jobs:
            job.ready()
            job.go()
        assert list(tmp_path.rglob("*.parquet"))
        signalled()

    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    monkeypatch.setattr("vibro_cli.benchmark.end_to_end.timed", timed)
    with pytest.raises(Terminated):
        measure_grid(PLANS["quick"])
    assert not list(tmp_path.iterdir())


def test_a_measured_command_ends_with_its_measurement(monkeypatch: pytest.MonkeyPatch) -> None:
    """It would go on to write to the temporary folder, which is removed."""
    begun = list[subprocess.Popen[bytes]]()

    def signalled_once(process: subprocess.Popen[bytes]) -> None:
        if not begun:
            begun.append(process)
            signalled()

    monkeypatch.setattr(subprocess.Popen, "poll", signalled_once)
    with pytest.raises(Terminated):
        command("help")
    assert begun[0].returncode


@pytest.mark.parametrize("error", [None, SyntaxError("(unicode error)")])
def test_nothing_is_written_while_the_command_line_is_parsed(
    vibro: Vibro, monkeypatch: pytest.MonkeyPatch, error: Exception | None
) -> None:
    """Typer turns ^C into an exit code, and C code may raise an error in its place."""

    def struck(*_: object) -> None:
        with contextlib.nullcontext() if error is None else contextlib.suppress(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        if error is not None:
            raise error

    monkeypatch.setattr("vibro_cli.commands.orbit._seconds", struck)
    outcome = vibro("fit", FALLING, "measured.csv", "--free", "gravity")
    assert (outcome.code, outcome.err) == (130, "vibro: interrupted; nothing was written\n")


@pytest.mark.usefixtures("undrawn")
def test_a_page_that_is_written_is_kept(
    vibro: Vibro, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The film is written after the page."""
    vibro("run", FALLING, "--set", "stop.collisions=3", "--no-figures", "-o", "run")
    monkeypatch.setattr("vibro_cli.interface.runs.write_film", signalled)
    outcome = vibro("report", "run", "--animate", "film.html")
    assert outcome.err.splitlines()[-1] == "vibro: terminated; finished results are kept"
    assert (tmp_path / "run-report.html").exists()
    assert not (tmp_path / "film.html").exists()


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_page_is_kept_that_is_put_in_place_when_the_signal_comes(
    vibro: Vibro, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: signal.Signals
) -> None:
    """Renaming may take long on a slow disk; the signal is raised when it is done."""
    vibro("run", FALLING, "--set", "stop.collisions=3", "--no-figures", "-o", "run")
    real = os.replace

    def struck(*given: Path) -> None:
        real(*given)
        os.kill(os.getpid(), number)

    monkeypatch.setattr(os, "replace", struck)
    outcome = vibro("report", "run")
    assert outcome.err.endswith("; finished results are kept\n")
    assert (tmp_path / "run-report.html").exists()
