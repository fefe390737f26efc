"""`vibro report`: where the page goes, what is left alone, misuse."""

import os
import shutil
from pathlib import Path

import pytest

from tests.commands.conftest import Outcome, Vibro
from tests.grid_folder import product, write_grid
from tests.grids.kill import content

pytestmark = pytest.mark.long

GALLERY = Path(__file__).parents[2] / "scenarios"
RUN = ("run", GALLERY / "one_circle.toml", "--set", "stop.collisions=4", "--no-figures")


def test_a_page_stands_beside_the_folder(vibro: Vibro) -> None:
    vibro(*RUN)
    before = sorted(Path("outputs/one_circle").iterdir())
    assert vibro("report", "outputs/one_circle").code == 0
    page = Path("outputs/one_circle-report.html")
    assert page.read_bytes().startswith(b"<!DOCTYPE html>")
    assert b'href="one_circle/collisions.parquet"' in page.read_bytes()
    assert sorted(Path("outputs/one_circle").iterdir()) == before
    assert vibro("report", "outputs/one_circle").code == 0  # ours: replaced
    assert vibro(*RUN).code == 0  # and the run's folder can still be replaced


def test_a_page_of_a_link_stands_beside_the_link(vibro: Vibro) -> None:
    vibro(*RUN, "-o", "elsewhere/run")
    Path("latest").symlink_to("elsewhere/run", target_is_directory=True)
    assert vibro("report", "latest").code == 0
    assert b'href="elsewhere/run/collisions.parquet"' in Path("latest-report.html").read_bytes()
    assert [path.name for path in Path("elsewhere").iterdir()] == ["run"]


def test_results_of_the_folder_in_which_one_stands_go_beside_it(
    vibro: Vibro, monkeypatch: pytest.MonkeyPatch
) -> None:
    here = Path.cwd()
    vibro(*RUN, "-o", "one")
    values = [i / 40 for i in range(40)]
    write_grid(Path("grid"), product({"collision.k": values}))
    for folder, command, written in (
        ("one", "report", "one-report.html"),
        ("one", "section", "one-section.png"),
        ("grid", "basins", "grid-basins"),
    ):
        monkeypatch.chdir(here / folder)
        outcome = vibro(command, ".")
        assert (outcome.code, (here / written).exists()) == (0, True), outcome.err
        refused = vibro(command, "/")
        assert (refused.code, refused.err.startswith("vibro: / ")) == (2, True), refused.err


def test_several_runs_have_one_page_and_a_pdf(vibro: Vibro) -> None:
    vibro(*RUN, "-o", "one")
    vibro(*RUN, "-o", "two", "--set", "collision.k=0.5")
    (written,) = vibro("report", "one", "two", "--pdf", "figures.pdf", "--json").lines
    page = str(Path("report.html").resolve())
    assert written == {"page": page, "pdf": "figures.pdf", "figures": None, "film": None}
    assert vibro("report", "one", "-o", "-", "--json").code == 2
    refused = vibro("report", "one", "-o", "page.pdf")
    assert (refused.code, "found 'page.pdf', expected a .html file" in refused.err) == (2, True)
    refused = vibro("report", "one", "--pdf", "pages.png")
    assert (refused.code, refused.err) == (
        2,
        "vibro: --pdf: found 'pages.png', expected a .pdf file\n",
    )
    assert not Path("pages.png").exists()
    assert b"collision.k" in Path("report.html").read_bytes()
    pdf = Path("figures.pdf").read_bytes()
    assert pdf.startswith(b"%PDF-")
    assert pdf.count(b"/Type /Page ") == 26
    assert b"CreationDate" not in pdf


def test_each_figure_can_be_had_as_a_file(vibro: Vibro) -> None:
    vibro(*RUN)
    options = ("--figures", "figures", "--width", "single")
    assert vibro("report", "outputs/one_circle", *options).code == 0
    names = {path.name for path in Path("figures").iterdir()}
    assert {"energy.pdf", "plan.svg", "portrait_2.png", "manifest.json"} <= names
    assert len(names) == 3 * 13 + 1
    assert vibro("report", "outputs/one_circle", *options).code == 0  # ours: replaced
    Path("figures/notes.txt").write_text("keep")
    outcome = vibro("report", "outputs/one_circle", *options)
    assert outcome.code == 2
    assert "notes.txt" in outcome.err


@pytest.mark.usefixtures("undrawn")
def test_figures_of_another_run_are_replaced_only_if_asked(vibro: Vibro) -> None:
    def report(*options: str) -> Outcome:
        return vibro("report", *options, "--figures", "figures")

    vibro(*RUN)
    vibro(*RUN, "--set", "collision.k=0.5", "-o", "other")
    write_grid(Path("sweep"), product({"collision.k": [1.0, 0.9]}))
    assert report("outputs/one_circle").code == 0
    before = content(Path("figures"))
    for others in (["other"], ["sweep"], ["outputs/one_circle", "other"]):
        outcome = report(*others)
        assert outcome.code == 2
        assert outcome.err.startswith(
            "vibro: figures holds figures of others (found -> requested):"
        )
        assert content(Path("figures")) == before
        assert "\n  : " not in outcome.err
    assert "\n  collision.k[1]: 0.9 -> 0.5\n" in report("other").err
    assert not Path("other-report.html").exists()
    vibro("run", "--continue", "outputs/one_circle", "--set", "stop.collisions=5")
    assert report("outputs/one_circle").code == 0  # as `run` itself replaces an earlier part
    assert report("other", "--force").code == 0
    assert content(Path("figures")) != before
    assert report("outputs/one_circle").code == 2
    assert "--force requires --figures" in vibro("report", "other", "--force").err


def test_figures_as_pages_and_as_files_are_those_asked_for_alone(
    vibro: Vibro, monkeypatch: pytest.MonkeyPatch
) -> None:
    vibro(*RUN)
    drawn: list[str] = []
    monkeypatch.setattr("vibro_cli.figures.processes.available_cores", lambda: 1)
    monkeypatch.setattr("vibro_cli.progress.WORK.report", drawn.append)
    for file, folder in (("both.pdf", "both"), ("pages.pdf", None), (None, "files")):
        drawn.clear()
        pages = () if file is None else ("--pdf", file)
        files = () if folder is None else ("--figures", folder)
        assert vibro("report", "outputs/one_circle", *pages, *files).code == 0
        # Twice for the page, in two widths, and once more for pages and files.
        assert drawn.count("Energies") == 3
    assert Path("both.pdf").read_bytes() == Path("pages.pdf").read_bytes()
    for path in Path("files").iterdir():
        assert (Path("both") / path.name).read_bytes() == path.read_bytes()


def test_a_folder_of_that_name_in_outputs_is_suggested(vibro: Vibro) -> None:
    vibro(*RUN)
    for command in ("report", "section"):
        outcome = vibro(command, "one_circle")
        assert outcome.code == 2
        assert outcome.err == (
            "vibro: one_circle does not exist (did you mean 'outputs/one_circle'?); expected a "
            "folder that `vibro run` wrote\n"
        )
    assert "did you mean" not in vibro("report", "two_circles").err


def test_the_page_can_be_printed(vibro: Vibro) -> None:
    vibro(*RUN)
    outcome = vibro("report", "outputs/one_circle", "-o", "-")
    assert outcome.code == 0
    assert outcome.text.startswith("<!DOCTYPE html>")
    assert not Path("outputs/one_circle-report.html").exists()


def test_files_of_others_are_left_alone(vibro: Vibro) -> None:
    vibro(*RUN)
    Path("mine.html").write_text("<p>keep</p>")
    Path("mine.pdf").write_text("keep")
    for options in (("-o", "mine.html"), ("--pdf", "mine.pdf")):
        outcome = vibro("report", "outputs/one_circle", *options)
        assert outcome.code == 2
        assert "left as it is" in outcome.err
    assert Path("mine.html").read_text() == "<p>keep</p>"
    assert Path("mine.pdf").read_text() == "keep"
    outcome = vibro("report", "outputs/one_circle", "--figures", "outputs/one_circle")
    assert outcome.code == 2
    assert outcome.err.endswith("it is left as it is (choose another folder)\n")  # -o is the page


@pytest.mark.parametrize("option", ["-o", "--pdf", "--animate"])
def test_of_what_is_there_only_the_beginning_is_read(vibro: Vibro, option: str) -> None:
    vibro(*RUN)
    target = Path("mine.html")
    with target.open("wb") as file:
        file.truncate(1 << 40)  # a file of one hole, which no memory holds
    assert "left as it is" in vibro("report", "outputs/one_circle", option, target).err
    target.unlink()
    os.mkfifo(target)
    assert "left as it is" in vibro("report", "outputs/one_circle", option, target).err
    assert target.is_fifo()


@pytest.mark.parametrize(
    ("option", "name"), [("-o", "page.html"), ("--pdf", "all.pdf"), ("--animate", "film.gif")]
)
def test_a_file_without_a_folder_is_told_before_anything_is_drawn(
    vibro: Vibro, monkeypatch: pytest.MonkeyPatch, option: str, name: str
) -> None:
    """It was told after half a minute of drawing, of fifty bodies."""
    vibro(*RUN)
    monkeypatch.setattr("vibro_cli.report.content.report_html", None)
    Path("file").touch()
    for folder, words in (("gone", "No such file or directory"), ("file", "Not a directory")):
        outcome = vibro("report", "outputs/one_circle", option, f"{folder}/{name}")
        assert (outcome.code, outcome.out) == (1, b"")
        assert outcome.err == f"vibro: {folder}/{name}: {words}\n"


def test_a_section_without_a_folder_is_told_before_anything_is_drawn(
    vibro: Vibro, monkeypatch: pytest.MonkeyPatch
) -> None:
    vibro(*RUN)
    monkeypatch.setattr("vibro_cli.interface.runs.open_run", None)
    outcome = vibro("section", "outputs/one_circle", "-o", "gone/section.png")
    assert (outcome.code, outcome.out) == (1, b"")
    assert outcome.err == "vibro: gone/section.png: No such file or directory\n"


@pytest.mark.parametrize("command", ["report", "section"])
def test_what_is_no_run_is_refused(vibro: Vibro, command: str) -> None:
    Path("empty").mkdir()
    outcome = vibro(command, "empty")
    assert outcome.code == 2
    assert outcome.err.startswith("vibro: empty is not a vibro run")


def test_a_folder_of_runs_is_refused_with_the_names_of_its_runs(vibro: Vibro) -> None:
    vibro(*RUN, "-o", "runs/b")
    Path("runs/notes").mkdir()
    shutil.copytree("runs/b", "runs/a")
    outcome = vibro("report", "runs")
    assert outcome.code == 2
    assert outcome.err.endswith("`vibro run` wrote (results are in runs/a and runs/b)\n")
    for name in ("c", "d"):
        shutil.copytree("runs/b", f"runs/{name}")
    outcome = vibro("verify", "runs")
    assert outcome.code == 2
    assert outcome.err.endswith("of vibro (results are in runs/a, runs/b and 2 more)\n")


@pytest.mark.parametrize(
    ("command", "option"),
    [("report", "-o"), ("report", "--pdf"), ("report", "--animate"), ("section", "-o")],
)
def test_a_folder_in_the_place_of_a_file_is_told(vibro: Vibro, command: str, option: str) -> None:
    vibro(*RUN)
    folder = Path({"--pdf": "there.pdf", "--animate": "there.gif"}.get(option, "there.html"))
    if command == "section":
        folder = Path("there.png")
    folder.mkdir()
    outcome = vibro(command, "outputs/one_circle", option, folder)
    assert (outcome.code, outcome.out) == (2, b"")
    assert outcome.err == f"vibro: {folder} is a folder; expected a file name\n"
    assert folder.is_dir()


def test_a_changed_run_is_refused(vibro: Vibro) -> None:
    vibro(*RUN)
    with Path("outputs/one_circle/scenario.json").open("a") as file:
        file.write(" ")
    outcome = vibro("report", "outputs/one_circle")
    assert outcome.code == 2
    assert "has changed since it was written" in outcome.err


@pytest.mark.parametrize("name", ["collisions.parquet", "events.parquet", "summary.json"])
def test_a_damaged_table_is_named(vibro: Vibro, name: str) -> None:
    vibro(*RUN)
    path = Path("outputs/one_circle", name)
    content = path.read_bytes()
    path.write_bytes(content[:99] + bytes([content[99] ^ 1]) + content[100:])
    outcome = vibro("report", "outputs/one_circle")
    assert outcome.code == 2
    assert outcome.err.startswith(f"vibro: {path} has changed since it was written (SHA-256 ")
    path.unlink()
    again = "vibro run outputs/one_circle/scenario.json -o outputs/one_circle"
    missing = f"vibro: {path} is missing; {again} solves it again\n"
    assert vibro("report", "outputs/one_circle").err == missing
    assert not Path("outputs/one_circle-report.html").exists()
    assert vibro(*again.split()[1:]).code == 0
    assert vibro("verify", "outputs/one_circle").code == 0
    assert path.read_bytes() == content


def test_a_system_without_films_is_named(vibro: Vibro, monkeypatch: pytest.MonkeyPatch) -> None:
    vibro(*RUN)
    monkeypatch.delattr("vibro_cli.systems.trace.figures.film")
    outcome = vibro("report", "outputs/one_circle", "--animate", "film.gif")
    assert outcome.code == 2
    expected = 'found system = "trace", expected a system that has films'
    assert outcome.err == f"vibro: outputs/one_circle: {expected}\n"
    assert not Path("outputs/one_circle-report.html").exists()


def test_without_ffmpeg_nothing_is_begun(vibro: Vibro, monkeypatch: pytest.MonkeyPatch) -> None:
    vibro(*RUN)
    monkeypatch.setenv("PATH", "")
    outcome = vibro("report", "outputs/one_circle", "--animate", "film.mp4")
    assert outcome.code == 2
    assert "needs the program ffmpeg, which is not there; .gif and .html do not" in outcome.err
    assert not Path("outputs/one_circle-report.html").exists()


def test_the_motion_can_be_had_as_a_film(vibro: Vibro) -> None:
    vibro(*RUN)
    options = ("--span", "0.5:1", "--fps", "10")
    for name, start in {"film.gif": b"GIF89a", "film.html": b"<!DOCTYPE html>"}.items():
        outcome = vibro("report", "outputs/one_circle", "--animate", name, *options)
        assert outcome.code == 0
        assert "film of 0.5 s to 1 s (the run ends at" in outcome.err
        assert Path(name).read_bytes().startswith(start)
        assert vibro("report", "outputs/one_circle", "--animate", name, *options).code == 0
        Path(name).write_text("mine")
        outcome = vibro("report", "outputs/one_circle", "--animate", name, *options)
        assert outcome.code == 2
        assert "is not a film" in outcome.err
        assert Path(name).read_text() == "mine"
    said = [
        vibro("report", "outputs/one_circle", "--animate", f"{pace}.gif", *options, "--pace", pace)
        for pace in ("1", "10")
    ]
    warning = "vibro: warning: the film has one frame; a smaller --pace gives more\n"
    assert [warning in one.err for one in said] == [False, True]


def test_a_film_that_cannot_be_is_refused(vibro: Vibro) -> None:
    vibro(*RUN)
    for options, words in {
        ("film.avi",): "expected a .mp4, .gif or .html file",
        ("film.gif", "--fps", "30"): "divisor of 100",
        ("film.gif", "--span", "2:1"): "FROM < TO",
        ("film.gif", "--span", "900:901"): "before the end of the run",
        ("film.gif", "--pace", "1e-5", "--span", "0:1"): "expected at most 20000",
        ("film.gif", "--pace", "inf"): "--pace: found inf, expected a finite number",
    }.items():
        outcome = vibro("report", "outputs/one_circle", "--animate", *options)
        assert outcome.code == 2, options
        assert words in outcome.err
    assert not list(Path().glob("film.*"))


def test_what_only_a_film_has_needs_one(vibro: Vibro) -> None:
    vibro(*RUN)
    for options in (("--span", "0:1"), ("--pace", "0.5"), ("--fps", "50")):
        outcome = vibro("report", "outputs/one_circle", *options)
        assert outcome.code == 2, options
        assert options[0] in outcome.err
        assert "require --animate FILE" in outcome.err
    assert not Path("outputs/one_circle-report.html").exists()


def test_a_grid_has_a_page_and_figures(vibro: Vibro) -> None:
    write_grid(Path("sweep"), product({"collision.k": [1.0, 0.9], "balls[1].angle": [0.1, 0.2]}))
    options = ("--pdf", "sweep.pdf", "--figures", "figures", "--width", "single")
    assert vibro("report", "sweep", *options).code == 0
    assert b"All 4 points are solved." in Path("sweep-report.html").read_bytes()
    assert Path("sweep.pdf").read_bytes().count(b"/Type /Page ") == 5
    assert Path("figures/endings.svg").exists()
    assert vibro("report", "sweep", "--map", "energy_start", "--figures", "maps").code == 0
    assert Path("maps/map_energy_start.svg").exists()
    assert b"Energy start" in Path("sweep-report.html").read_bytes()
    vibro(*RUN)
    for extra, words in {
        ("outputs/one_circle",): "a report is on runs or on one grid",
        ("--animate", "film.gif"): "takes a run",
        ("--map", "energy_strat"): 'did you mean "energy_start"?',
        ("--map", ""): "--map: found '', expected one of end_time, ",
    }.items():
        outcome = vibro("report", "sweep", *extra)
        assert outcome.code == 2
        assert words in outcome.err


def test_a_map_that_would_be_empty_is_refused(vibro: Vibro) -> None:
    write_grid(Path("one"), product({"collision.k": [1.0, 0.9]}))
    outcome = vibro("report", "one", "--map", "energy_start")
    assert outcome.code == 2
    assert "--map: energy_start: found no map, expected two axes that change" in outcome.err
    assert not Path("one-report.html").exists()


def test_what_grid_wrote_has_a_page(vibro: Vibro) -> None:
    Path("sweep.toml").write_text(
        f'base = "{GALLERY / "one_circle.toml"}"\n'
        '[[axes]]\npath = "collision.k"\nvalues = [0.9, 0.5]\n'
        '[[axes]]\npath = "balls[1].angle"\nvalues = [-0.6, -0.5, 2.9]\n'
        "[keep]\ncollisions = true\n"
    )
    made = vibro("grid", "sweep.toml", "--engine", "python", "--set", "stop.collisions=3")
    assert made.code == 0
    assert vibro("report", "outputs/sweep").code == 0
    page = Path("outputs/sweep-report.html").read_text()
    assert "All 6 points are solved." in page
    assert "Why points are invalid or failed" in page  # 2.9 rad would be beyond the other ball
    for title in ("How the runs end", "Runs over one axis", "Positions of the impacts"):
        assert title in page
