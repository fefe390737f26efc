"""The Python interface: the functions of the command line, with the same names and results."""

import copy
import inspect
import json
import logging
import pickle
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn, cast

import duckdb
import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import vibro_cli
from tests.grids.kill import content
from vibro_cli import (
    CannotContinue,
    FolderRefused,
    GridChanged,
    NotAGrid,
    NotContinuable,
    NothingToShow,
    NotRecalled,
    Run,
    Scenario,
    ScenarioError,
    VibroError,
    api,
    check,
    example,
    fit,
    load_scenario,
    open_grid,
    open_run,
    orbit,
    orbit_family,
    portrait,
    simulate,
    simulate_many,
    sweep,
    verify,
)
from vibro_cli.figures.kinds import draw_all
from vibro_cli.interface.grids import Design
from vibro_cli.storage import stored, tables

pytestmark = pytest.mark.long

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "scenarios/three_arcs.toml"
SYSTEMS = ("three_arcs", "two_disks", "elliptic_wall")


@pytest.fixture(scope="module")
def run() -> Run:
    return simulate(load_scenario(SOURCE, ["stop.time=12"]))


def data_of(name: str) -> dict[str, object]:
    """A scenario of the gallery as plain data."""
    return example(name).resolved() | {"system": example(name).system}


@pytest.mark.parametrize(
    "use",
    [
        simulate,
        check,
        portrait,
        orbit,
        lambda one: simulate_many([one]),
        lambda one: fit(one, [], []),
    ],
)
@pytest.mark.parametrize("found", ["mine.toml", Path("mine.toml"), {"name": "mine"}])
def test_what_is_no_scenario_is_told(use: Callable[[Any], object], found: object) -> None:
    with pytest.raises(TypeError, match=r"found .*mine.*, expected a scenario: load_scenario\("):
        use(found)


def test_a_table_without_a_portrait_is_told() -> None:
    """In a loop over scenarios ``except VibroError`` did not catch this."""
    with pytest.raises(VibroError, match="found no wall, expected an ellipse or a circle"):
        portrait(example("skew_impact"))


def test_a_sweep_of_what_is_no_scenario_is_told() -> None:
    found: Any = {"name": "mine"}
    with pytest.raises(TypeError, match=r"'mine'\} \(dict\), expected a scenario"):
        sweep(found, {"collision.k": [0.5, 0.6]})


@pytest.mark.parametrize("name", SYSTEMS)
def test_a_scenario_is_made_of_dictionaries(name: str) -> None:
    made = Scenario.from_dict(json.loads(json.dumps(data_of(name))))
    assert made == example(name)
    assert made.system == example(name).system


def test_numbers_of_numpy_are_numbers() -> None:
    data = data_of("three_arcs") | {"gravity": np.float64(9.81)}
    assert Scenario.from_dict(data) == example("three_arcs")
    changed = example("three_arcs").replace({"collision.k": np.array([0.5])})
    assert changed.resolved()["collision"]["k"] == [0.5]


@pytest.mark.parametrize("kind", [list, tuple, np.array, pl.Series, pd.Series, pa.array])
def test_values_are_sequences_or_arrays(kind: Callable[[list[float]], Any]) -> None:
    scenario = load_scenario(SOURCE, ["stop.time=2"])
    grid = sweep(scenario, {"collision.k": kind([0.25, 0.5])})
    assert grid.summary["collision.k"].tolist() == [0.25, 0.5]
    changed = scenario.replace({"collision.k": kind([0.25])})
    assert changed.resolved()["collision"]["k"] == [0.25]


def test_whole_numbers_are_a_range() -> None:
    grid = sweep(example("three_arcs"), {"stop.collisions": range(1, 4)})
    assert grid.summary["collisions"].tolist() == [1, 2, 3]
    with pytest.raises(ScenarioError, match='found "abc", expected a list of values'):
        sweep(example("three_arcs"), {"collision.k": "abc"})


def test_the_points_and_the_seed_of_a_design_have_names() -> None:
    """A Latin hypercube has one point in each of n strata; another seed draws others."""
    assert sweep.__annotations__["design"] == "Unpack[Design]"
    assert [*Design.__annotations__] == ["n", "seed"]
    assert "\nn, seed\n" in str(inspect.getdoc(sweep))
    drawn = [
        sweep(
            example("three_arcs").replace({"stop.collisions": 1}),
            {"collision.k": {"uniform": [0.0, 1.0]}},
            mode="latin-hypercube", n=8, seed=seed,
        ).summary["collision.k"]
        for seed in (1, 2)
    ]  # fmt: skip
    assert [sorted(np.floor(8.0 * values).astype(int)) for values in drawn] == [[*range(8)]] * 2
    assert not np.array_equal(drawn[0], drawn[1])
    with pytest.raises(ScenarioError, match=r'unknown key "sead".*did you mean "seed"'):
        sweep(example("three_arcs"), {"collision.k": [0.5]}, sead=2)  # type: ignore[call-arg]
    with pytest.raises(ScenarioError, match=r"^sweep: columns: .* expected axes.*collisions"):
        sweep(example("three_arcs"), {"collision.k": [0.5]}, columns=["t"])  # type: ignore[call-arg]
    with pytest.raises(ScenarioError, match=r'collisions\[1\]: found "tt", expected a column of'):
        sweep(example("three_arcs"), {"collision.k": [0.5]}, collisions=["tt"])


def test_replace_changes_what_set_changes() -> None:
    texts = ["collision.k=0.7", "balls[1].angle=-60 deg", "balls[2].mass=2 kg", "stop.time=1e1"]
    changes = {
        "collision.k": 0.7,
        "balls[1].angle": "-60 deg",
        "balls[2].mass": 2.0,
        "stop.time": 10,
    }
    whole = load_scenario(SOURCE)
    assert whole.replace(changes) == load_scenario(SOURCE, texts)
    assert whole.replace({}) == whole
    one_by_one = whole
    for path, value in changes.items():
        one_by_one = one_by_one.replace({path: value})
    assert one_by_one == load_scenario(SOURCE, texts)


def test_a_default_that_hangs_on_a_changed_value_changes_too() -> None:
    # `collision.k` of three bodies is spread over two pairs only when it is read.
    scenario = example("three_arcs")
    three = [*scenario.given()["balls"], {**scenario.given()["balls"][1], "angle": 0.9}]
    assert len(scenario.replace({"balls": three}).resolved()["collision"]["k"]) == 2


def test_what_is_wrong_with_a_change_is_told_with_its_path() -> None:
    with pytest.raises(ScenarioError) as caught:
        example("three_arcs").replace({"collision.kk": 1, "balls[3].angle": 0, "gravity": "x"})
    assert [problem.path for problem in caught.value.problems] == [
        "collision.kk",
        "balls[3]",
        "gravity",
    ]
    assert "replace collision.kk=1: collision.kk: " in str(caught.value)


def test_a_run_is_that_of_the_solver(run: Run) -> None:
    solved = api.simulate(run.scenario)
    assert run.summary == solved.summary_record()
    for name, column in solved.collisions.items():
        assert np.ma.filled(column, np.nan).tolist() == pytest.approx(
            run.collisions[name].tolist(), abs=0.0, nan_ok=True
        )


def test_tables_say_what_they_are(run: Run) -> None:
    table = run.collisions
    assert (table.rows, len(table)) == (run.summary["collisions"], len(list(table)))
    assert table.units["t"] == "s"
    assert table.descriptions["t"].startswith("time of the impact")
    assert repr(table) == f"<Table collisions: {table.rows} rows, {len(table)} columns>"
    summary = run.tables["summary"]
    assert repr(summary) == f"<Table summary: 1 row, {len(summary)} columns>"
    with pytest.raises(KeyError, match="collisions has no column 'time'"):
        table["time"]
    assert not table["t"].flags.writeable


def test_a_missing_whole_number_is_masked(run: Run) -> None:
    others = run.events["other"]
    crossings = run.events["event"] == "crossing"
    assert crossings.any()
    assert np.ma.getmaskarray(others)[crossings].all()
    assert np.isnan(run.collisions["dt"][0])


def test_every_library_takes_a_table(run: Run) -> None:
    impacts = run.collisions
    times = impacts["t"].tolist()
    assert pa.table(impacts)["t"].to_pylist() == times
    assert pl.DataFrame(impacts)["t"].to_list() == times
    assert impacts.to_polars().equals(pl.DataFrame(impacts))
    assert impacts.to_pandas()["t"].tolist() == times
    assert isinstance(impacts.to_pandas(), pd.DataFrame)
    with duckdb.connect() as connection:
        connection.register("impacts", impacts)
        ((lost,),) = connection.sql("select sum(energy_loss) from impacts").fetchall()
    assert lost == pytest.approx(impacts["energy_loss"].sum(), rel=1e-14)


@pytest.mark.parametrize("take", [pd.DataFrame, np.asarray, pd.Series])
def test_what_would_take_the_names_of_a_table_for_it_is_refused(run: Run, take: Any) -> None:
    with pytest.raises(TypeError, match=r"collisions is not an array: expected .* to_pandas\(\)"):
        take(run.collisions)


@pytest.mark.parametrize(
    ("name", "table"), [("three_arcs", "bounces"), ("elliptic_wall", "events")]
)
def test_a_table_that_a_system_has_not_is_told(name: str, table: str) -> None:
    lone = simulate(example(name).replace({"stop.time": 0.1}))
    assert table not in lone.tables
    with pytest.raises(KeyError, match=f"runs of system = {lone.scenario.system} have no table"):
        getattr(lone, table)


def test_tools_can_list_the_attributes_of_runs_and_grids() -> None:
    """Debuggers and completers stumbled over a `KeyError` for a table that there is not."""
    scenario = example("three_arcs")
    run, grid = simulate(scenario), sweep(scenario, {"collision.k": [0.9]})
    assert not hasattr(run, "bounces")
    assert not hasattr(grid, "collisions")
    assert {"collisions", "events"} < dict(inspect.getmembers(run)).keys()
    assert "summary" in dict(inspect.getmembers(grid))


def test_a_grid_of_tables_has_its_bounces() -> None:
    """A ball goes back and forth over 1.8 m, slower by k each time."""
    wall = {"shape": "rectangle", "width": 2.0, "depth": 1.0, "k": 1.0}
    one = {"radius": 0.1, "mass": 1.0, "x": 0.0, "y": 0.0, "velocity_x": 2.0}
    document = {"system": "table", "wall": wall, "balls": [one], "stop": {"bounces": 4}}
    scenario = Scenario.from_dict(document)
    grid = sweep(scenario, {"wall.k": [0.5, 1.0]}, collisions=True)
    assert grid.bounces["scenario"].tolist() == [1] * 4 + [2] * 4
    times = [0.45, 0.45 + 1.8, 0.45 + 5.4, 0.45 + 12.6, 0.45, 1.35, 2.25, 3.15]
    np.testing.assert_allclose(grid.bounces["t"], times, rtol=1e-14)
    with pytest.raises(KeyError, match=r"no table bounces \(collisions=True"):
        _ = sweep(scenario, {"wall.k": [0.5, 1.0]}).bounces
    kept = sweep(
        example("one_circle").replace({"stop.collisions": 2}),
        {"collision.k": [0.5, 1.0]},
        collisions=True,
    )
    with pytest.raises(KeyError, match="no table bounces'"):
        _ = kept.bounces


def test_a_library_that_is_missing_is_named(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("vibro_cli.storage.frame.find_spec", lambda name: None)
    with pytest.raises(ImportError, match=r"to_polars\(\) needs polars, .*pip install polars"):
        run.collisions.to_polars()
    with pytest.raises(ImportError, match="pip install pandas"):
        run.collisions.to_pandas()


def test_importing_the_interface_loads_no_library_of_frames() -> None:
    code = (
        "import sys, vibro_cli\n"
        "assert not {'numpy', 'logging'} & set(sys.modules)\n"
        "vibro_cli.simulate\n"
        "assert not {'pandas', 'polars', 'matplotlib'} & set(sys.modules)\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, cwd=ROOT)


def test_every_public_name_is_there() -> None:
    assert set(vibro_cli.__all__) == set(dir(vibro_cli))
    for name in vibro_cli.__all__:
        thing = getattr(vibro_cli, name)
        assert name == "__version__" or thing.__doc__
        if isinstance(thing, type) and issubclass(thing, Exception):
            assert issubclass(thing, VibroError)


def test_what_a_public_function_returns_is_public() -> None:
    """Users need the name to annotate functions of their own."""
    for name in vibro_cli.__all__:
        thing = getattr(vibro_cli, name)
        if inspect.isfunction(thing):
            returned = re.findall(r"\b[A-Z]\w+", inspect.signature(thing).return_annotation)
            assert set(returned) <= set(vibro_cli.__all__), name


def test_sample_is_a_table_of_the_motion(run: Run) -> None:
    first = run.collisions["t"][0]
    before, after = (run.sample(first, side) for side in ("before", "after"))
    for found, when in ((before, "pre"), (after, "post")):
        speeds = [run.collisions[f"speed_{body}_{when}"][0] for body in "ab"]
        assert found["speed"].tolist() == pytest.approx(speeds, rel=1e-14)
    assert after.units["speed"] == "m/s"
    assert run.sample([0.5, 1.0])["ball"].tolist() == [1, 2, 1, 2]
    with pytest.raises(ValueError, match="outside"):
        run.sample([13.0])


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize("name", SYSTEMS)
def test_a_run_that_is_saved_and_opened_is_the_same(tmp_path: Path, name: str) -> None:
    made = simulate(example(name))
    folder = made.save(tmp_path / "run")
    found = open_run(folder)
    assert found.summary == made.summary
    assert found.scenario == made.scenario
    for table in made.tables:
        assert found.tables[table].to_arrow().equals(made.tables[table].to_arrow())
    assert verify(folder).sound
    page = made.report(tmp_path / "unsaved.html").read_text(encoding="utf-8")
    assert "Not stored; made by:" in page
    assert ".parquet" not in page
    assert ".parquet" in found.report(tmp_path / "saved.html").read_text(encoding="utf-8")


def test_save_writes_what_the_command_writes(tmp_path: Path, run: Run) -> None:
    command = ["run", str(SOURCE), "--set", "stop.time=12", "-o", str(tmp_path / "cli"), "-q"]
    subprocess.run([sys.executable, "-m", "vibro_cli", *command], check=True, cwd=ROOT)
    run.save(tmp_path / "python")
    files = {path.name for path in (tmp_path / "cli").iterdir()}
    assert files == {path.name for path in (tmp_path / "python").iterdir()}
    for name in files - {"manifest.json"}:
        if name.endswith(".parquet"):
            one, other = (pq.read_table(tmp_path / side / name) for side in ("cli", "python"))
            assert one.equals(other, check_metadata=True)
        else:
            one, other = ((tmp_path / side / name).read_bytes() for side in ("cli", "python"))
            assert one == other, name


def test_a_run_of_other_parameters_is_not_replaced(tmp_path: Path, run: Run) -> None:
    folder = run.save(tmp_path / "run", figures=False)
    other = simulate(run.scenario.replace({"collision.k": 0.5}))
    with pytest.raises(FolderRefused, match=r"collision.k\[1\]: 0.9 -> 0.5") as refused:
        other.save(folder, figures=False)
    assert str(refused.value).endswith("\n(force=True replaces it)")  # no option of a command
    other.save(folder, figures=False, force=True)
    assert open_run(folder).summary == other.summary


@pytest.mark.parametrize("path", ["collision.k", "balls[1].angle", "gravity"])
def test_a_run_that_goes_on_stays_the_same_run(run: Run, path: str) -> None:
    with pytest.raises(CannotContinue, match=re.escape(f"found a value for {path}, expected one")):
        run.continued({path: 0.5, "stop.time": 12})


def test_a_continued_run_is_that_of_one_without_a_break(tmp_path: Path, run: Run) -> None:
    short = simulate(run.scenario.replace({"stop.time": 5}))
    short.save(tmp_path / "short", figures=False)
    for before in (short, open_run(tmp_path / "short")):
        whole = before.continued({"stop.time": 12})
        assert whole.collisions.to_arrow().equals(run.collisions.to_arrow())
    with pytest.raises(CannotContinue):
        run.continued({"stop.time": 5})


def test_figures(tmp_path: Path, run: Run, request: pytest.FixtureRequest) -> None:
    assert run.kinds[:2] == ("scene", "portrait")
    drawn = run.figure("portrait", body=2, width="single")
    assert drawn.name == "portrait_2"
    assert drawn._repr_png_().startswith(b"\x89PNG")
    assert drawn.save(tmp_path / "portrait.v1.pdf").read_bytes().startswith(b"%PDF")
    with pytest.raises(ValueError, match="unknown figure format"):
        drawn.save(tmp_path / "portrait.bmp")
    request.getfixturevalue("undrawn")  # of all the others only the names are looked at
    kinds = [kind for kind in run.kinds if kind != "exponents"]
    files = {path.stem for path in run.save(tmp_path / "all", figures=kinds).iterdir()}
    assert {run.figure(kind, body=2).name for kind in kinds} <= files
    with pytest.raises(ValueError, match="found the kind of figure 'portrat', expected one of"):
        run.figure("portrat")
    with pytest.raises(ValueError, match="body: found 3, expected a whole number from 1 to 2"):
        run.figure(body=3)
    lone = simulate(example("lone_particle"))
    with pytest.raises(NothingToShow, match="has nothing to show as intervals"):
        lone.figure("intervals")


def _fitted(run: Run, free: Any) -> object:
    return fit(run.scenario, run.collisions["t"], free)


def _family(vary: str, low: float, high: float) -> object:
    scenario = example("falling_balls")
    return orbit_family(scenario, orbit(scenario, impacts=1), vary, low, high)


WRONG: dict[str, tuple[Callable[[Run], object], str]] = {
    "fps of none": (lambda run: run.film("f.html", fps=0), "found 0, expected a whole number from"),
    "fps below": (lambda run: run.film("f.html", fps=-5), "fps: found -5, expected"),
    "pace": (lambda run: run.film("f.html", pace=float("inf")), "pace: found inf, expected"),
    "pace nan": (lambda run: run.film("f.html", pace=float("nan")), "pace: found nan, expected"),
    "part of a body": (
        lambda run: run.figure("portrait", body=cast("int", 1.5)),
        "body: found 1.5",
    ),
    "text": (
        lambda run: run.figure("portrait", body=cast("int", "1")),
        'body: found "1", expected',
    ),
    "truth": (lambda run: run.figure("portrait", body=True), "body: found true, expected"),
    "portrait": (lambda run: portrait(run.scenario, body=cast("int", 1.5)), "body: found 1.5, exp"),
    "impacts": (lambda run: orbit(run.scenario, impacts=-1), "impacts: found -1, expected"),
    "period": (lambda run: orbit(run.scenario, period=0.0), "period: found 0.0, expected"),
    "workers": (lambda run: simulate_many([run.scenario], -1), "workers: found -1, expected"),
    "transient": (lambda run: run.section(transient=-1), "transient: found -1, expected"),
    "count too large": (
        lambda run: run.section(transient=2**63),
        r"transient: found 9223372036854775808, expected a whole number below 2\^63",
    ),
    "part": (lambda run: run.section(transient=cast("int", 2.5)), "transient: found 2.5, expected"),
    "pair": (
        lambda run: run.section(pair=cast("Any", "1-2")),
        'pair: found "1-2", expected a list',
    ),
    "columns": (lambda run: run.section("t"), 'columns: found "t", expected a list of columns'),
    "shape": (lambda run: run.sample([[1, 2], [3, 4]]), r"times: found an array of shape \(2, 2\)"),
    "masked": (lambda run: run.sample(np.ma.masked), "times: found a masked value, expected num"),
    "one masked": (
        lambda run: run.sample(np.ma.masked_equal([0.5, 1.0], 1.0)),
        "times: found a masked value, expected numbers",
    ),
    "inf": (lambda run: run.sample([np.inf], extrapolate=True), "t = inf s .*expected a finite"),
    "figures": (lambda run: run.save("f", figures="portrait"), 'found "portrait", expected a list'),
    "changes": (lambda run: run.scenario.replace(cast("Any", [1])), "changes: found a list of 1"),
    "axes": (
        lambda run: sweep(run.scenario, cast("Any", [("n", 1)])),
        "axes: found a list of 1, ex",
    ),
    "name": (lambda run: example(cast("str", 3)), "name: found 3, expected the name"),
    "data": (lambda run: Scenario.from_dict(cast("Any", None)), "data: found null, expected"),
    "override": (
        lambda run: load_scenario(SOURCE, cast("Any", [5])),
        "overrides: found 5, expected a list of overrides path=value, each a text",
    ),
    "bounds of none": (
        lambda run: _fitted(run, {"collision.k": None}),
        "k: found null, expected two",
    ),
    "one bound": (
        lambda run: _fitted(run, {"collision.k": (0,)}),
        "a list of 1, expected two bounds",
    ),
    "bounds of texts": (
        lambda run: _fitted(run, {"collision.k": ("0.1", "0.9")}),
        "collision.k: found '0.1' to '0.9', expected ascending bounds",
    ),
    "free text": (
        lambda run: _fitted(run, "collision.k"),
        "free: found .* expected a list of paths",
    ),
    "free number": (lambda run: _fitted(run, [1]), "found 1, expected a path such as"),
    "instants": (
        lambda run: fit(run.scenario, cast("Any", 5), ["collision.k"]),
        "t: found 5, expected a column of numbers",
    ),
    "number of an impact": (
        lambda run: fit(run.scenario, {"t": [1.0], "n": [1e300]}, ["collision.k"]),
        r"row 1: n: found 1e\+300, expected a whole number",
    ),
    "range of a family": (
        lambda run: _family("balls[2].mass", 2.1, 0.9),
        r"balls\[2\].mass: found 2.1 to 0.9, expected an ascending range",
    ),
    "end of a family": (
        lambda run: _family("balls[2].mass", cast("float", "a"), 2.1),
        'low: found "a", expected a number',
    ),
    "number of a family": (
        lambda run: _family(cast("str", 5), 0.9, 2.1),
        "found 5, expected a path such as",
    ),
    "continued": (lambda run: run.continued(cast("Any", None)), "changes: found null, expected a"),
    "continued path": (lambda run: run.continued(cast("Any", {5: 1})), "found a value for 5, exp"),
    "width of a section": (
        lambda run: run.section(width="x"),
        "unknown width 'x', expected one of",
    ),
    "complex": (lambda run: run.sample(cast("Any", [1j])), "times: found complex128, expected num"),
    "huge": (lambda run: run.sample([10**400]), "times: found .*, expected num"),
    "times in words": (
        lambda run: run.sample(cast("Any", ["a"])),
        "times: found <U1, expected num",
    ),
    "overrides": (lambda run: load_scenario(SOURCE, "stop.time=1"), "overrides: found .*a list of"),
    "kind in a list": (
        lambda run: run.figure(cast("str", [])),
        r"found the kind of figure \[\], expected one of scene, portrait",
    ),
    "width of a figure": (
        lambda run: run.figure("energy", width=cast("str", [])),
        r"unknown width \[\], expected one of single, double",
    ),
    "columns of numbers": (
        lambda run: run.section(cast("Any", [1, 2])),
        "columns: found 1, expected a list of columns, each a text",
    ),
    "figures of numbers": (
        lambda run: run.save("f", figures=cast("Any", [1])),
        "figures: found 1, expected a list of kinds of figures, each a text",
    ),
    "times of dictionaries": (
        lambda run: run.sample(cast("Any", [{}])),
        "times: found .*, expected numbers",
    ),
    "file": (lambda run: run.report(cast("str", 5)), "file: found 5, expected the path of a file"),
    "page": (lambda run: run.report("a.docx"), "file: found 'a.docx', expected a .html file"),
    "film": (lambda run: run.film(cast("str", None)), "file: found null, expected the path of a"),
    "picture": (
        lambda run: run.figure("energy").save(cast("str", 5)),
        "file: found 5, expected the path of a file",
    ),
    "folder": (lambda run: run.save(cast("str", 5)), "folder: found 5, expected the path of a fol"),
    "empty path of a page": (
        lambda run: run.report(""),
        'file: found "", expected the path of a file, a text or a pathlib.Path',
    ),
    "zero byte in a folder": (
        lambda run: run.save("a\0b"),
        'folder: found "a\N{REPLACEMENT CHARACTER}b", expected the path of a folder',
    ),
    "text that has no bytes": (
        lambda run: open_run("\ud800"),
        'folder: found "\N{REPLACEMENT CHARACTER}", expected the path of a folder',
    ),
    "working directory as a picture": (
        lambda run: run.figure("energy").save(Path()),
        'file: found ".", expected the path of a file',
    ),
    "empty path of a grid file": (lambda run: sweep(""), 'source: found "", expected the path of'),
    "empty path of a measured table": (
        lambda run: fit(run.scenario, "", ["collision.k"]),
        'measured: found "", expected the path of a file',
    ),
    "folder of a run": (lambda run: open_run(cast("str", 5)), "folder: found 5, expected the path"),
    "folder of a grid": (
        lambda run: open_grid(cast("str", None)),
        "folder: found null, expected the path of a folder, a text or a pathlib.Path",
    ),
    "folder to verify": (lambda run: verify(cast("str", 5)), "folder: found 5, expected the path"),
    "source": (lambda run: load_scenario(cast("str", 5)), "source: found 5, expected the path of"),
    "folder of a sweep": (
        lambda run: sweep(run.scenario, {"collision.k": [0.5]}, cast("str", 5)),
        "folder: found 5, expected the path",
    ),
    "one body of two": (
        lambda run: fit(run.scenario, {"t": [1.0], "ball_a": [1]}, ["collision.k"]),
        "found ball_a alone, expected both ball_a and ball_b",
    ),
    "bodies of too many rows": (
        lambda run: fit(
            run.scenario, {"t": [1.0], "ball_a": [1], "ball_b": [2, 2]}, ["collision.k"]
        ),
        "found columns of unequal lengths",
    ),
}


@pytest.mark.parametrize("found", ["no", "", 0, 1, 1.0, None, [], np.array([True, False])])
@pytest.mark.parametrize(
    ("use", "name"),
    [
        (lambda run, flag: run.save("f", False, flag), "force"),
        (lambda run, flag: run.sample([99.0], extrapolate=flag), "extrapolate"),
        (lambda run, flag: sweep(run.scenario, {"stop.time": [1]}, "f", force=flag), "force"),
    ],
)
def test_a_flag_is_true_or_false(
    run: Run, use: Callable[[Run, Any], object], name: str, found: Any, tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    with pytest.raises(TypeError, match=rf"^{name}: found .*, expected true or false$"):
        use(run, found)
    assert not [*tmp_path.iterdir()]
    use(run, np.True_)


@pytest.mark.usefixtures("undrawn")
def test_whether_figures_are_saved_may_be_said_by_numpy(run: Run, tmp_path: Path) -> None:
    for said in (True, np.True_, False, np.False_):
        assert [*run.save(tmp_path / "f", cast("bool", said), True).glob("*.png")] == [
            *run.save(tmp_path / "f", bool(said), True).glob("*.png")
        ]


@pytest.mark.parametrize("found", [None, 5, "mine.toml", example("three_arcs"), np.array(0.5)])
def test_what_is_no_list_of_scenarios_is_told(found: Any) -> None:
    with pytest.raises(TypeError, match=r"scenarios: found .*, expected a list of scenarios"):
        simulate_many(found)


@pytest.mark.parametrize(
    ("use", "message"),
    [
        (lambda grid: grid.figure("impacts", "x"), "unknown width 'x'"),
        (lambda grid: grid.figure("curves", "x"), "unknown width 'x'"),
        (lambda grid: grid.figure("end_time", "x"), "unknown width 'x'"),
        (lambda grid: grid.figure("energy"), "nothing to show as energy: expected that two axes"),
        (lambda grid: grid.figure("end_time"), "nothing to show as end_time: expected that two ax"),
        (lambda grid: grid.figure([]), r"found the kind of figure \[\], expected one of endings"),
        (lambda grid: grid.section([1]), "columns: found 1, expected a list of columns, each"),
        (lambda grid: grid.basins([1]), "outcome: found 1, expected a list of columns of the sum"),
        (lambda grid: grid.basins().map("x"), "unknown width 'x'"),
        (lambda grid: grid.basins().scaling("x"), "unknown width 'x'"),
        (lambda grid: grid.report("f.html", [1]), "maps: found 1, expected a list of columns"),
        (lambda grid: grid.report("f.html", ["x"]), "maps: found 'x', expected some of end_time"),
        (lambda grid: grid.save(5), "folder: found 5, expected the path of a folder"),
    ],
)
def test_a_wrong_argument_of_a_grid_over_one_axis_is_told(
    use: Callable[[Any], object],
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    scenario = example("three_arcs").replace({"stop.time": 3.0})
    grid = sweep(scenario, {"collision.k": np.linspace(0.7, 1.0, 33)}, collisions=True)
    with pytest.raises(ValueError, match=message):
        use(grid)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("wrong", WRONG)
def test_a_wrong_argument_is_told(
    run: Run, wrong: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    use, message = WRONG[wrong]
    with pytest.raises(ValueError, match=message):
        use(run)
    assert not list(tmp_path.iterdir())


def test_a_family_of_what_is_no_orbit_is_told() -> None:
    with pytest.raises(TypeError, match="found null, expected an orbit"):
        orbit_family(example("falling_balls"), cast("Any", None), "balls[2].mass", 0.9, 2.1)


def test_a_wrong_width_of_a_section_of_a_grid_is_told(tmp_path: Path, run: Run) -> None:
    axes = {"collision.k": [0.7, 0.8]}
    grid = sweep(run.scenario, axes, tmp_path / "grid", collisions=True)
    with pytest.raises(ValueError, match="unknown width 'x', expected one of"):
        grid.section(width="x")


@pytest.mark.usefixtures("undrawn")
def test_folders_are_found_after_the_working_directory_has_changed(
    tmp_path: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    grid = sweep(run.scenario, {"collision.k": [0.7, 0.8]}, "grid", collisions=True)
    stored = open_run(run.save("run", figures=False))
    monkeypatch.chdir("/")
    assert grid.summary.rows == 2
    assert grid.collisions.rows == grid.summary["collisions"].sum()
    assert grid.save(tmp_path / "copy").is_dir()
    assert stored.collisions["t"].tolist() == run.collisions["t"].tolist()
    for one, name in ((grid, "grid"), (stored, "run")):
        page = one.report(tmp_path / f"{name}.html").read_text(encoding="utf-8")
        assert f"<code>{name}</code>" in page
        assert f'href="{name}/' in page


def test_a_wrong_argument_of_a_sweep_begins_no_folder(tmp_path: Path, run: Run) -> None:
    with pytest.raises(ValueError, match="workers: found -1, expected a whole number of at least"):
        sweep(run.scenario, {"collision.k": [0.5]}, tmp_path / "grid", workers=-1)
    assert not (tmp_path / "grid").exists()
    with pytest.raises(ScenarioError, match='found "1", expected a path'):
        run.scenario.replace(cast("Any", {1: 1}))


def test_each_of_very_many_bodies_has_the_portrait_of_its_own_size() -> None:
    """Names of files have no room for 89 numbers: body 88 is not one of those 88 others."""
    data = example("lone_particle").given()
    data["collision"] = {"k": 1.0}
    ball = {"body": "particle", "mass": 1.0, "arc": 1}
    data["balls"] = [
        ball | {"radius": 0.002 if number == 88 else 0.001, "angle": 0.01 * number - 0.5}
        for number in range(1, 91)
    ]
    scenario = Scenario.from_dict(data)
    names = {body: vibro_cli.portrait(scenario, body).name for body in (1, 2, 87, 88, 89)}
    assert names.pop(88) == "portrait_88"
    assert set(names.values()) == {"portrait_1_and_88_others"}


def test_a_portrait_without_a_run_and_a_film(tmp_path: Path, run: Run) -> None:
    for name in SYSTEMS:
        drawn = vibro_cli.portrait(example(name)).save(tmp_path / "portrait.png")
        assert drawn.read_bytes().startswith(b"\x89PNG")
    with pytest.raises(ValueError, match="ellipse or a circle"):
        vibro_cli.portrait(example("skew_impact"))
    film = run.film(tmp_path / "film.html", end=1.0, fps=5)
    assert b'content="vibro film"' in film.read_bytes()
    with pytest.raises(ValueError, match=r"found 0 s to 99 s, expected times from 0 to 12 s"):
        run.film(tmp_path / "film.html", end=99.0)
    with pytest.raises(ValueError, match=r"found 2 s to 1 s, .* 0 to 12 s, end after start"):
        run.film(tmp_path / "film.html", start=2.0, end=1.0)
    with pytest.raises(ValueError, match=r"'film\.avi', expected a \.mp4, \.gif or \.html file"):
        run.film(tmp_path / "film.avi")
    with pytest.raises(ValueError, match="fps: found 30, expected a divisor of 100"):
        run.film(tmp_path / "film.gif", fps=30)
    for name in SYSTEMS:
        one = simulate(example(name))
        film = one.film(tmp_path / f"{name}.html", end=0.5 * one.summary["end_time"], fps=5)
        assert b'content="vibro film"' in film.read_bytes()


def test_many_runs_are_in_the_order_given() -> None:
    scenario = load_scenario(SOURCE, ["stop.time=12"])
    values = [0.7, 0.8, 0.9, 1.0]
    found = simulate_many([scenario.replace({"collision.k": k}) for k in values], workers=2)
    assert [run.scenario.resolved()["collision"]["k"] for run in found] == [[k] for k in values]
    assert [run.summary for run in found] == [
        simulate(scenario.replace({"collision.k": k})).summary for k in values
    ]


def test_a_sweep_has_the_summaries_of_its_runs(tmp_path: Path) -> None:
    scenario = load_scenario(SOURCE, ["stop.time=12"])
    axes = {"collision.k": [0.8, 0.9], "balls[1].angle": {"linspace": ["-75 deg", -1.2, 2]}}
    grid = sweep(scenario, axes, collisions=["n", "t"])
    assert grid.axes == ("collision.k", "balls[1].angle")
    assert grid.summary["collision.k"].tolist() == [0.8, 0.8, 0.9, 0.9]
    points = [
        simulate(scenario.replace({"collision.k": k, "balls[1].angle": angle}))
        for k in (0.8, 0.9)
        for angle in ("-75 deg", -1.2)
    ]
    assert grid.summary["energy_end"].tolist() == [one.summary["energy_end"] for one in points]
    assert list(grid.collisions) == ["scenario", "n", "t"]
    with pytest.raises(KeyError, match=r"no table collisions .*collisions=True of sweep"):
        sweep(scenario, {"collision.k": [0.8]}).collisions  # noqa: B018
    assert grid.collisions["t"].tolist() == [t for one in points for t in one.collisions["t"]]
    assert grid.figure("impacts").save(tmp_path / "impacts.svg").is_file()
    assert grid.figure("max_gap").name == "max_gap"
    found = open_grid(grid.save(tmp_path / "grid"))
    assert found.summary.to_arrow().equals(grid.summary.to_arrow())
    assert "4" in found.report(tmp_path / "grid.html").read_text(encoding="utf-8")


def test_a_sweep_in_a_folder_is_that_of_the_command(tmp_path: Path) -> None:
    file = ROOT / "scenarios/grids/three_arcs_grid.toml"
    made = sweep(file, folder=tmp_path / "python")
    command = ["grid", str(file), "-o", str(tmp_path / "cli"), "-q"]
    subprocess.run([sys.executable, "-m", "vibro_cli", *command], check=True, cwd=ROOT)
    assert content(tmp_path / "python") == content(tmp_path / "cli")
    with pytest.raises(GridChanged):
        sweep(example("three_arcs"), {"collision.k": [0.5]}, tmp_path / "python")
    assert made.stored.points > 1


def test_a_temporary_grid_lasts_as_long_as_its_copies(tmp_path: Path) -> None:
    scenario, axes = load_scenario(SOURCE, ["stop.time=5"]), {"collision.k": [0.8, 0.9]}
    made = sweep(scenario, axes, collisions=True)
    folder, copies = made.stored.folder, [copy.copy(made), copy.deepcopy(made)]
    del made
    assert [one.collisions.rows for one in copies] == [4, 4]
    with pytest.raises(TypeError, match=r"found a grid in a temporary folder.*sweep"):
        pickle.dumps(copies.pop())
    assert folder.is_dir()
    copies.clear()
    assert not folder.exists()
    kept = sweep(scenario, axes, tmp_path / "kept")
    assert pickle.loads(pickle.dumps(kept)).summary.to_arrow().equals(kept.summary.to_arrow())


def test_errors_of_folders(tmp_path: Path) -> None:
    with pytest.raises(NotContinuable, match="is not a vibro run"):
        open_run(tmp_path)
    with pytest.raises(NotAGrid):
        open_grid(tmp_path)
    with pytest.raises(vibro_cli.NoManifest):
        verify(tmp_path)


@pytest.mark.parametrize(
    "given",
    [
        {"axes": {"collision.k": [0.5]}},
        {"collisions": True},
        {"collisions": False},
        {"mode": "zip"},
        {"n": 3},
        {"foo": 1},
    ],
)
def test_a_grid_file_takes_no_settings_beside_it(tmp_path: Path, given: dict[str, Any]) -> None:
    file = ROOT / "scenarios/grids/three_arcs_grid.toml"
    with pytest.raises(TypeError, match=f"found {next(iter(given))}= beside a grid file"):
        sweep(file, folder=tmp_path / "grid", **given)
    assert not (tmp_path / "grid").exists()


@pytest.fixture
def ends_elsewhere(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make runs that are solved again end differently."""

    def elsewhere(*_: object) -> NoReturn:
        raise NotRecalled("solved again it ends elsewhere")

    for name in ("recalled", "recalled_motion"):
        monkeypatch.setattr(stored, name, elsewhere)


@pytest.mark.usefixtures("ends_elsewhere")
def test_tables_and_sections_of_a_folder_need_no_solving(tmp_path: Path, run: Run) -> None:
    folder = run.save(tmp_path / "run", figures=False)
    opened = open_run(folder)
    assert opened.collisions.to_arrow().equals(run.collisions.to_arrow())
    assert opened.summary == run.summary
    assert opened.kinds == run.kinds
    opened.section().save(tmp_path / "opened.png")
    run.section().save(tmp_path / "run.png")
    assert (tmp_path / "opened.png").read_bytes() == (tmp_path / "run.png").read_bytes()
    with pytest.raises(NotContinuable, match=f"{folder}: solved again it ends elsewhere"):
        opened.sample(1.0)


@pytest.mark.parametrize(
    ("name", "kinds"),
    [
        ("one_circle", ("intervals", "impact_map")),
        ("springs/two_disks", ("intervals", "impact_map")),
        ("table/billiards", ("intervals", "velocities")),
    ],
)
@pytest.mark.usefixtures("ends_elsewhere")
def test_figures_of_tables_alone_need_no_solving(
    tmp_path: Path, name: str, kinds: tuple[str, ...]
) -> None:
    run = simulate(load_scenario(ROOT / f"scenarios/{name}.toml"))
    opened = open_run(run.save(tmp_path / "run", figures=False))
    for kind in kinds:
        opened.figure(kind).save(tmp_path / "opened.png")
        run.figure(kind).save(tmp_path / "run.png")
        assert (tmp_path / "opened.png").read_bytes() == (tmp_path / "run.png").read_bytes()


def test_columns_of_a_run_in_a_folder_are_read_as_they_are_asked_for(
    tmp_path: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    read: list[list[str]] = []

    def watched(self: Any, columns: Any = None, own: Any = pq.ParquetFile.read, **more: Any) -> Any:
        read.append(columns)
        return own(self, columns, **more)

    folder = run.save(tmp_path / "run", figures=False)
    monkeypatch.setattr(pq.ParquetFile, "read", watched)
    table = open_run(folder).collisions
    assert (table.rows, table.keys()) == (run.collisions.rows, run.collisions.keys())
    assert "<table>" in table._repr_html_()
    assert read == []
    for _ in range(2):
        np.testing.assert_array_equal(table["t"], run.collisions["t"])
        assert read == [["t"]]
    # The file that was opened is read to its end, whatever replaces it.
    shutil.copy(folder / "collisions.parquet", tmp_path / "kept.parquet")
    (folder / "collisions.parquet").rename(tmp_path / "moved.parquet")
    (folder / "collisions.parquet").write_bytes(b"something else")
    for one in (table, copy.deepcopy(table), pickle.loads(pickle.dumps(table))):
        assert one.to_arrow().equals(pq.read_table(tmp_path / "kept.parquet"), check_metadata=True)
        np.testing.assert_array_equal(one["law"], run.collisions["law"])


def test_a_folder_that_has_gone_is_told(tmp_path: Path, run: Run) -> None:
    opened = open_run(run.save(tmp_path / "run", figures=False))
    grid = sweep(run.scenario, {"collision.k": [0.8, 0.9]}, tmp_path / "grid", collisions=True)
    for folder in ("run", "grid"):
        shutil.rmtree(tmp_path / folder)
    uses: list[Callable[[], object]] = [
        lambda: opened.tables,
        lambda: opened.collisions,
        lambda: opened.motion,
        lambda: grid.summary,
        lambda: grid.collisions,
        lambda: grid.section(),
        lambda: grid.figure("diagram"),
    ]
    for use in uses:
        with pytest.raises(FileNotFoundError, match=str(tmp_path)):
            use()


@pytest.mark.parametrize(
    "read",
    [
        lambda run: run.collisions,
        lambda run: run.stored.collisions["t"],
        lambda run: run.stored.collisions.first(1),
        lambda run: run.report(run.folder.with_suffix(".html")),
    ],
)
def test_a_run_that_was_replaced_is_not_mixed_with_the_other(
    tmp_path: Path, run: Run, read: Callable[[Run], object]
) -> None:
    run.save(tmp_path / "run", figures=False)
    opened, begun = open_run(tmp_path / "run"), open_run(tmp_path / "run")
    assert begun.stored.collisions["n"].size == run.collisions.rows
    other = simulate(run.scenario.replace({"collision.k": 0.3}))
    other.save(tmp_path / "run", figures=False, force=True)
    for one in (opened, begun):
        with pytest.raises(OSError, match="the run was replaced"):
            read(one)
    assert open_run(tmp_path / "run").summary == other.summary


def test_check_tells_what_is_doubtful() -> None:
    assert check(example("three_arcs")) == ()
    with pytest.raises(ScenarioError):
        check(example("three_arcs").replace({"balls[2].angle": -1.3}))


@pytest.mark.usefixtures("undrawn")
def test_the_logger_tells_of_figures_that_show_nothing(
    tmp_path: Path, run: Run, caplog: pytest.LogCaptureFixture
) -> None:
    run.save(tmp_path / "run", figures=["portrait", "exponents"])
    assert [one.message for one in caplog.records if one.levelname == "WARNING"] == [
        f"{run.name}: the run has nothing to show as exponents: expected that "
        "analysis.lyapunov is true, and there are two impacts"
    ]
    assert (tmp_path / "run" / "portrait_1.png").exists()
    caplog.clear()
    run.save(tmp_path / "own")
    assert not [one for one in caplog.records if one.levelname == "WARNING"]


@pytest.mark.parametrize("name", ["three_arcs", "elliptic_wall", "two_disks"])
def test_a_figure_that_shows_nothing_says_what_it_needs(name: str) -> None:
    run = simulate(example(name).replace({"stop": {"time": 1e-3}}))
    told = {}
    for kind in run.kinds:
        try:
            run.figure(kind)
        except NothingToShow as error:
            told[kind] = str(error)
    assert len(told) > 2
    for kind, text in told.items():
        assert text.startswith(f"{name} has nothing to show as {kind}: expected that ")


@pytest.mark.parametrize("name", ["three_arcs", "turning_circle", "elliptic_wall", "two_disks"])
def test_a_run_can_be_handed_to_another_process(name: str) -> None:
    """As by a pool of processes that call `simulate`: it could not be pickled."""
    found = simulate(example(name).replace({"stop": {"time": 3.0}}))
    copied = pickle.loads(pickle.dumps(found))
    assert copied.summary == found.summary
    assert copied.collisions.to_arrow().equals(found.collisions.to_arrow())
    for given in (copied, found):
        assert given.sample([1.0, 2.5]).to_arrow().equals(found.sample([1.0, 2.5]).to_arrow())
    longer = {"stop.time": 5.0}
    assert copied.continued(longer).summary == found.continued(longer).summary


def test_the_logger_warns_of_invalid_points_of_a_grid(caplog: pytest.LogCaptureFixture) -> None:
    """Their rows have no numbers, and nothing else said so."""
    sweep(example("three_arcs").replace({"stop.collisions": 1}), {"collision.k": [0.5, 0.9]})
    assert not caplog.records
    grid = sweep(example("three_arcs"), {"collision.k": [0.5, 2.0, 3.0]})
    assert [record.message for record in caplog.records] == [
        "three_arcs: 2 of 3 points invalid or failed, such as scenario 2 (invalid): "
        "collision.k: found 2.0, expected a number from 0 to 1"
    ]
    assert grid.summary["status"].tolist() == ["ok", "invalid", "invalid"]


def test_warnings_are_shown_where_logging_is_not_set_up(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Python's own fallback prints them; a handler of the package that does nothing hid them."""
    monkeypatch.setattr(logging.getLogger(), "handlers", [])
    sweep(example("three_arcs").replace({"stop.collisions": 1}), {"collision.k": [0.9, 2.0]})
    assert capsys.readouterr().err.startswith("three_arcs: 1 of 2 points invalid or failed")


def test_the_logger_tells_how_a_run_ended(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO, logger="vibro_cli"):
        simulate(example("one_circle"))
    assert any("ended at t = " in record.message for record in caplog.records)


def test_what_a_notebook_shows(run: Run) -> None:
    assert len(repr(run)) < 100
    assert repr(run).startswith("<Run three_arcs: ")
    for thing in (run, run.collisions, run.scenario):
        shown = thing._repr_html_()
        assert "<table><caption" in shown[:50]
        assert shown.count("<tr>") == shown.count("</tr>") > 3
    assert "<tr><th>collision.k</th><td>[0.9]</td></tr>" in run.scenario._repr_html_()


@pytest.mark.parametrize(
    ("name", "heads"),
    {
        "three_arcs": ("gravity [m/s^2]", "trace.arcs[2].end_slope [rad]", "balls[1].angle [rad]"),
        "falling_balls": ("balls[2].mass [kg]", "balls[2].position [m]", "ends.left.wall"),
        "two_disks": ("balls[2].spring.stiffness [N/m]", "collision.k"),
        "elliptic_wall": ("wall.semi_axis_x [m]", "balls[1].direction [rad]", "wall.shape"),
    }.items(),
)
def test_a_notebook_shows_the_units_of_a_scenario(name: str, heads: tuple[str, ...]) -> None:
    shown = example(name)._repr_html_()
    for head in heads:
        assert f"<th>{head}</th>" in shown


def test_a_notebook_completes_the_columns_of_a_table(run: Run) -> None:
    table = run.collisions
    assert table._ipython_key_completions_() == table.keys() == list(table)


def test_what_a_file_says_of_its_columns_is_no_markup_in_a_notebook() -> None:
    field = pa.field("<i>t", pa.float64(), metadata={"unit": "<script>", "description": "<b>"})
    shown = vibro_cli.Table("<u>", pa.table([[1.0]], schema=pa.schema([field])))._repr_html_()
    assert set(re.findall(r"<(\w+)", shown)) == {"div", "table", "caption", "tr", "th", "td"}


@pytest.fixture
def columns_read(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of the columns that have been read from parquet files, in order."""
    names: list[str] = []
    original = tables.read_column

    def noted(parts: Any, name: str) -> Any:
        names.append(name)
        return original(parts, name)

    monkeypatch.setattr(stored, "read_column", noted)
    return names


def test_a_figure_of_a_grid_reads_the_columns_that_it_shows(
    tmp_path: Path, columns_read: list[str]
) -> None:
    scenario = example("three_arcs").replace({"stop.time": 3.0})
    axes = {"collision.k": [0.7, 0.8, 0.9], "balls[1].angle": [-1.3, -1.2, -1.1]}
    sweep(scenario, axes, tmp_path / "grid")
    grid = open_grid(tmp_path / "grid")
    grid.figure("impacts")
    assert "collisions" in columns_read
    assert not {"energy_end", "max_gap", "end_time"} & set(columns_read)


@pytest.mark.usefixtures("undrawn")
def test_figures_of_bodies_read_each_column_of_a_short_run_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, columns_read: list[str]
) -> None:
    """Each of the figures of a body wants a score of columns; of a long run few are kept."""
    simulate(example("five_balls").replace({"stop.collisions": 20})).save(tmp_path / "run")
    figures = list(draw_all(stored.open_run(tmp_path / "run"), ["portrait", "energy_portrait"]))
    assert len(figures) == 10
    assert len(columns_read) == len(set(columns_read)) > 15
    monkeypatch.setattr(stored, "_MOST_VALUES", 0)
    kept = stored.StoredColumns([tmp_path / "run" / "collisions.parquet"])
    assert len([kept[name] for name in kept]) > len(kept._columns) == 8
