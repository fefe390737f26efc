"""The progress line of a long run: on a terminal only."""

import re
import time
from collections.abc import Iterator
from itertools import groupby
from pathlib import Path

import pytest

from tests.commands import processes
from tests.scenario.texts import parse_scenario
from tests.two_balls import SCENARIO
from vibro_cli import example, fit, orbit, orbit_family
from vibro_cli.api import simulate
from vibro_cli.commands.shared import terminal
from vibro_cli.figures.kinds import draw_all
from vibro_cli.progress import RUN, WORK
from vibro_cli.scenario import load_any
from vibro_cli.systems.trace.figures import FIGURES

pytestmark = pytest.mark.long

GALLERY = Path(__file__).parents[2] / "scenarios"
LONG = ("run", "small.toml", "--engine", "python", "--no-figures", "--set", "stop.collisions=20000")
LINE = re.compile(
    rb"\r\x1b\[Ksmall: t = ([\d.]+) s  ([\d,]+) impacts  ([\d,]+) impacts/s  (.*?) left"
)


WALLS = "[ends]\nleft = {wall = 1.0}\nright = {wall = 1.0}\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "small.toml").write_text(SCENARIO.replace("k = 0.9", "k = 1.0") + WALLS)
    return tmp_path


def test_a_long_run_tells_time_impacts_and_rate_on_a_terminal(folder: Path) -> None:
    code, seen = processes.on_terminal(folder, list(LONG))
    assert code == 0
    told = LINE.findall(seen)
    assert len(told) >= 2
    times, impacts, rates = zip(
        *([float(text.replace(b",", b"")) for text in line[:3]] for line in told), strict=True
    )
    assert list(times) == sorted(times)
    assert list(impacts) == sorted(impacts)
    assert 0.0 < impacts[0] < impacts[-1] <= 20000
    assert min(rates) > 0.0
    # The last line is removed before the summary is printed.
    assert re.search(rb"left\r\x1b\[Ksmall: ended at t = ", seen)
    assert max(len(line) for line in re.split(rb"\r\x1b\[K|\r\n", seen)) <= 80


def test_nothing_is_drawn_of_a_short_run(folder: Path) -> None:
    short = [*LONG, "--set", "stop.collisions=3"]
    # A millisecond a look, however busy the machine is.
    clock = "import itertools, time; time.monotonic = itertools.count(0.0, 1e-3).__next__; "
    code, seen = processes.on_terminal(folder, short, before=clock)
    assert code == 0
    assert b"\x1b" not in seen


def test_nothing_is_drawn_where_nobody_looks(folder: Path) -> None:
    assert b"impacts/s" not in processes.call(folder, *LONG).stderr
    code, seen = processes.on_terminal(folder, [*LONG, "-q"])
    assert (code, seen) == (0, b"")


@pytest.mark.parametrize(
    "name", ["three_arcs.toml", "table/billiards.toml", "springs/two_disks.toml"]
)
def test_runs_of_every_system_tell_how_far_they_are(name: str) -> None:
    told: list[tuple[float, int]] = []
    with RUN.to(lambda time, impacts: told.append((time, impacts))):
        run = simulate(load_any(GALLERY / name))
    assert told == sorted(told)
    record = run.summary_record()
    assert 0.0 < told[-1][0] <= record["end_time"]  # from the last impact to a stop is no work
    assert told[-1][1] == record["collisions"]
    before = len(told)
    simulate(parse_scenario(SCENARIO))
    assert len(told) == before


def test_the_time_left_is_that_to_the_nearer_stop(monkeypatch: pytest.MonkeyPatch) -> None:
    line = terminal.RunProgress("name", 100.0, 1000)
    line.update(50.0, 200)  # a run that is continued
    assert line._line(75.0, 400, 2.0).endswith("400 impacts  100 impacts/s  2 s left")
    assert line._line(60.0, 920, 9.0).endswith("920 impacts  80 impacts/s  1 s left")
    endless = terminal.RunProgress("name", None, None)
    endless.update(0.0, 0)
    assert endless._line(1.5, 3, 1.0) == "name: t = 1.5 s  3 impacts  3 impacts/s"


def test_what_is_drawn_is_told_on_a_terminal(folder: Path) -> None:
    few = ["--set", "stop.collisions=3", "-o", "run", "--no-figures"]
    assert processes.call(folder, "run", "small.toml", *few).returncode == 0
    film = ["--animate", "film.gif", "--span", "0:5", "--fps", "50"]
    code, seen = processes.on_terminal(folder, ["report", "run", *film])
    assert code == 0
    told = [words.decode() for words in re.findall(rb"\r\x1b\[Kdrawing: ([^\r]*)", seen)]
    assert set(told) & {kind.title for kind in FIGURES.values()}
    assert told[-1] == "frame 101 of 125"
    # The line is removed before anything else is printed.
    for word in (b"report in", b"film of"):
        assert re.search(rb"drawing: [^\r]*\r\x1b\[K" + word, seen)
    assert b"drawing" not in processes.call(folder, "report", "run").stderr


def test_a_line_is_redrawn_twice_a_second(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """However often points are added; it tells the time since the beginning."""
    clock = [100.0]
    monkeypatch.setattr("time.monotonic", lambda: clock[0])
    monkeypatch.setattr(terminal, "_settings", {"as_json": False, "least": "info"})
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    monkeypatch.setenv("TERM", "xterm")
    progress = terminal.Progress(4000)
    for _ in range(1000):  # in ten seconds
        clock[0] += 0.01
        progress.add(1, 5)
    lines = capfd.readouterr().err.split("\r\x1b[K")[1:]
    assert 18 <= len(lines) <= 20
    assert re.search(r" of 4,000 points  500 impacts/s  3\d s left", lines[-1])


def test_what_is_measured_is_told_until_each_result_comes(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(terminal, "_EVERY", 0.0)
    # Commands of other tests may have been quiet, or have used JSON.
    monkeypatch.setattr(terminal, "_settings", {"as_json": False, "least": "info"})
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    monkeypatch.setenv("TERM", "xterm")

    def results() -> Iterator[int]:
        for number in (1, 2):
            WORK.report(f"part {number}")
            for _ in range(1000):  # until a thread has drawn the line
                if capfd.readouterr().err:
                    break
                time.sleep(0.01)
            WORK.report(f"rest of part {number}")
            yield number

    for number in terminal.each_with_progress("measuring", results()):
        shown = capfd.readouterr().err
        assert f"measuring: rest of part {number}" in shown
        assert shown.endswith("\r\x1b[K")  # nothing is left before the result is printed


def test_each_figure_is_told_before_it_is_drawn() -> None:
    run = simulate(load_any(GALLERY / "springs/two_disks.toml", ["stop.collisions=3"]))
    told: list[str] = []
    with WORK.to(told.append):
        for drawn in draw_all(run, ["portrait", "energy"]):
            assert told[-1] == drawn.title
    assert told == [*(f"Phase portrait and energies of body {n}" for n in (1, 2)), "Energies"]


def test_each_motion_of_a_fit_is_told() -> None:
    told: list[str] = []
    scenario = example("three_arcs").replace({"stop.collisions": 20})
    measured = simulate(scenario).collisions["t"]
    with WORK.to(told.append):
        found = fit(scenario.replace({"collision.k": 0.88}), measured, ["collision.k"])
    # The initial residuals, and then ever more impacts.
    stages = [key for key, _ in groupby(int(line.rsplit(" ", 1)[1]) for line in told)]
    assert stages == [20, 4, 8, 16, 20]
    assert [line.split(",")[0] for line in told] == [
        f"motion {number}" for number in range(1, found.evaluations + 1)
    ]


def test_the_search_for_an_orbit_and_the_value_of_each_orbit_of_a_family_are_told() -> None:
    told: list[str] = []
    scenario = example("falling_balls")
    with WORK.to(told.append):
        found = orbit(scenario, 1)
    assert {line.rsplit(" ", 1)[0] for line in told} == {"the motion closes to within"}
    told.clear()
    with WORK.to(told.append):
        family = orbit_family(scenario, found, "balls[2].mass", 0.99, 1.01)
    numbers = {float(line.removeprefix("orbit near ")) for line in told}
    assert {point.value for point in family.points[:: len(family.points) - 1]} <= numbers
