"""The main job as a user does it: from a scenario of the gallery to tables and portraits."""

import csv
import hashlib
import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.commands.conftest import Vibro
from tests.commands.processes import VIBRO
from tests.effort import ratio
from tests.storage.test_runs import contents
from vibro_cli import __version__
from vibro_cli.storage.files import read_manifest
from vibro_cli.storage.tables import read_parquet
from vibro_cli.systems import driver
from vibro_cli.systems.trace import SYSTEM

GALLERY = Path(__file__).parents[2] / "scenarios"
THREE_ARCS = GALLERY / "three_arcs.toml"
FEW = ("--set", "stop.collisions=5")


def test_three_arcs_give_tables_and_portraits_and_again_the_same_bytes(vibro: Vibro) -> None:
    outcome = vibro("run", THREE_ARCS, *FEW)
    assert outcome.code == 0
    folder = Path("outputs/three_arcs")
    portraits = {f"portrait_{ball}.{form}" for ball in (1, 2) for form in ("png", "pdf")}
    assert portraits <= set(contents(folder))
    assert (folder / "portrait_1.png").read_bytes().startswith(b"\x89PNG")
    assert (folder / "portrait_2.pdf").read_bytes().startswith(b"%PDF")
    manifest = read_manifest(folder)
    assert manifest is not None
    assert set(manifest["files"]) | {"manifest.json"} == set(contents(folder))
    assert "three_arcs: ended at t = " in outcome.err
    assert vibro("run", THREE_ARCS, *FEW, "-o", "again").code == 0
    assert contents(Path("again")) == contents(folder)


def test_tables_are_as_described_and_agree_with_the_summary(vibro: Vibro) -> None:
    vibro("run", THREE_ARCS, *FEW, "--no-figures", "--set", "output.step=0.5")
    folder = Path("outputs/three_arcs")
    for name in ("collisions", "events", "motion", "summary"):
        data = read_parquet(folder / f"{name}.parquet")
        expected = SYSTEM.table(name, data.column_names)
        assert data.column_names == [column.name for column in expected.columns]
    summary = json.loads((folder / "summary.json").read_bytes())
    (row,) = read_parquet(folder / "summary.parquet").to_pylist()
    assert summary == row
    impacts = read_parquet(folder / "collisions.parquet")
    assert impacts.num_rows == summary["collisions"] == 5
    assert summary["last_collision_time"] == impacts["t"][-1].as_py()
    assert summary["end_cause"] == "collisions"


def test_the_resolved_scenario_gives_the_same_run(vibro: Vibro) -> None:
    vibro("run", THREE_ARCS, *FEW, "-o", "one", "--no-figures")
    assert vibro("run", "one/scenario.json", "-o", "two", "--no-figures").code == 0
    assert contents(Path("one")) == contents(Path("two"))


def test_the_stream_has_the_numbers_of_the_table(vibro: Vibro) -> None:
    outcome = vibro("run", THREE_ARCS, *FEW, "--format", "csv", "-o", "both", "--no-figures")
    rows = list(csv.DictReader(outcome.text.splitlines()))
    data = read_parquet(Path("both/collisions.parquet"))
    for name in ("t", "t_low", "angle_a", "rate_b_post", "energy_loss"):
        assert [float(row[name]) for row in rows] == data[name].to_pylist()


def test_a_single_body_has_no_impacts_and_a_portrait(vibro: Vibro) -> None:
    assert vibro("run", GALLERY / "lone_particle.toml", "--set", "stop.time=2").code == 0
    folder = Path("outputs/lone_particle")
    assert read_parquet(folder / "collisions.parquet").num_rows == 0
    assert "portrait_1.png" in contents(folder)


@pytest.mark.parametrize("path", sorted(GALLERY.glob("*.toml")), ids=lambda path: path.stem)
def test_the_gallery_runs(vibro: Vibro, path: Path) -> None:
    outcome = vibro("run", path, "--json", "--no-figures", "-q")
    assert outcome.code == 0, outcome.err
    assert outcome.lines[0]["status"] == "ok"


LIBRARIES = "numpy, pydantic, pyarrow.parquet, scipy.special, typer"
DRAWING = "matplotlib.figure, matplotlib.backends.backend_agg, matplotlib.backends.backend_pdf"


@pytest.mark.parametrize(
    ("options", "libraries"),
    [
        (("--no-figures",), LIBRARIES),
        pytest.param((), f"{LIBRARIES}, {DRAWING}", marks=pytest.mark.long),
    ],
)
def test_the_main_job_is_quick(tmp_path: Path, options: tuple[str, ...], libraries: str) -> None:
    """It takes little more than loading the libraries, on a busy machine too."""
    run = [*VIBRO, "run", str(THREE_ARCS), *options, "-q", "-o", str(tmp_path / "run")]
    assert ratio(run, [sys.executable, "-c", f"import {libraries}"], times=4) <= 3.5


def test_a_run_does_not_load_what_it_does_not_need(tmp_path: Path) -> None:
    command = [sys.executable, "-X", "importtime", "-m", "vibro_cli", "run", str(THREE_ARCS)]
    outcome = subprocess.run(
        [*command, *FEW, "--no-figures", "-o", str(tmp_path / "run")],
        capture_output=True,
        text=True,
        check=True,
    )
    loaded = {line.split("|")[-1].strip() for line in outcome.stderr.splitlines()}
    assert "numpy" in loaded
    assert not loaded & {"pandas", "matplotlib", "compiled", "ruamel.yaml"}


def test_a_run_in_two_parts_is_the_run_in_one(vibro: Vibro) -> None:
    first = ("--set", "stop.time=30", "--no-figures")
    assert vibro("run", THREE_ARCS, *first, "-o", "parts").code == 0
    assert vibro("run", THREE_ARCS, "-o", "whole").code == 0
    on = ("--set", "stop.time=60", "--figures", "default")
    assert vibro("run", "--continue", "parts", *on).code == 0
    assert contents(Path("parts")) == contents(Path("whole"))


def test_a_run_goes_on_by_impacts_and_elsewhere(vibro: Vibro) -> None:
    samples = ("--set", "output.step=0.5")
    vibro("run", THREE_ARCS, "--set", "stop.collisions=50", "-o", "part", "--no-figures")
    before = contents(Path("part"))
    vibro("run", THREE_ARCS, "--set", "stop.collisions=90", *samples, "-o", "one", "--no-figures")
    more = ("--set", "stop.collisions=90", *samples, "-o", "other", "--no-figures")
    assert vibro("run", "--continue", "part", *more).code == 0
    assert contents(Path("other")) == contents(Path("one"))
    assert contents(Path("part")) == before


def test_a_stored_scenario_that_is_no_text_has_its_place(vibro: Vibro) -> None:
    """Somebody may have saved it in another encoding, and updated its checksum."""
    vibro("run", THREE_ARCS, *FEW, "-o", "run", "--no-figures")
    scenario, manifest = Path("run/scenario.json"), Path("run/manifest.json")
    found = scenario.read_bytes()
    changed = found.replace(b'"three_arcs"', '"trois étés"'.encode("latin-1"))
    before, after = (hashlib.sha256(content).hexdigest() for content in (found, changed))
    scenario.write_bytes(changed)
    manifest.write_text(manifest.read_text().replace(before, after))
    line = found[: found.index(b'"three_arcs"')].count(b"\n") + 1
    for command in (("run", "--set", "stop.collisions=9", "--continue"), ("report",)):
        outcome = vibro(*command, "run")
        assert outcome.code == 2
        assert f"run/scenario.json:{line}:" in outcome.err
        assert "found the byte 0xe9, expected a text in UTF-8" in outcome.err


def test_a_state_of_another_layout_is_refused(
    vibro: Vibro, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The version may be the same; a report said that the machine was another one."""
    now = driver.CHECKPOINT_FORMAT
    with monkeypatch.context() as earlier:
        earlier.setattr(driver, "CHECKPOINT_FORMAT", now - 1)
        vibro("run", THREE_ARCS, *FEW, "-o", "run", "--no-figures")
    for command in (("run", "--set", "stop.collisions=9", "--continue"), ("report",)):
        outcome = vibro(*command, "run")
        assert outcome.code == 2
        assert outcome.err == (
            f"vibro: run/checkpoint.json has format {now - 1}; expected {now}; "
            "vibro run run/scenario.json -o run solves it again\n"
        )


def test_what_cannot_be_continued_is_said(vibro: Vibro) -> None:
    def refused(*arguments: object) -> str:
        outcome = vibro("run", "--continue", *arguments)
        assert (outcome.code, outcome.out) == (2, b"")
        assert outcome.err.count("\n") == 1
        return outcome.err

    vibro("run", THREE_ARCS, *FEW, "-o", "run", "--no-figures")
    later = ("--set", "stop.collisions=9")
    assert "run cannot be continued: the run has 5 impacts" in refused("run")
    assert "found a value of 'collision', expected one of stop" in refused(
        "run", *later, "--set", "collision.k=0.5"
    )
    assert "found a SCENARIO and --continue" in refused("run", THREE_ARCS)
    assert "nothing does not exist" in refused("nothing")
    vibro("run", GALLERY / "unequal_hedrih.toml", "-o", "ended", "--no-figures")
    assert "had ended for good: inadmissible" in refused("ended", "--set", "stop.time=99")
    checkpoint = Path("run/checkpoint.json")
    checkpoint.write_text(checkpoint.read_text().replace("1", "2", 1))
    assert "run/checkpoint.json has changed since it was written" in refused("run", *later)
    manifest = Path("run/manifest.json")
    manifest.write_text(manifest.read_text().replace(f'"{__version__}"', '"0.0.9"'))
    told = refused("run", *later)
    assert f"run was written by vibro 0.0.9; expected {__version__}" in told
    assert told.endswith("; vibro run run/scenario.json -o run solves it again\n")
    Path("run/checkpoint.json").unlink()  # nothing but the scenario is needed
    assert vibro("run", "run/scenario.json", "-o", "run", "--no-figures").code == 0
    assert vibro("run", "--continue", "run", *later, "--no-figures").code == 0
