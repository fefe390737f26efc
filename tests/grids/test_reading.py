"""Grid files: their meaning, and the messages for wrong ones."""

from __future__ import annotations

import math
import tracemalloc
from decimal import Decimal
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from pyarrow import csv

from tests.two_balls import SCENARIO
from vibro_cli.grids.document import load_grid, may_lack_an_end
from vibro_cli.scenario import ScenarioError

AXIS = 'base = "base.toml"\n[[axes]]\n'


@pytest.fixture
def write(tmp_path: Path) -> Path:
    (tmp_path / "base.toml").write_text(SCENARIO)
    return tmp_path / "grid.toml"


def test_product_changes_the_last_axis_fastest(write: Path) -> None:
    write.write_text(
        'base = "base.toml"\n'
        '[[axes]]\npath = "balls[1].angle"\nlinspace = ["-60 deg", -0.5, 3]\n'
        '[[axes]]\npath = "collision.law"\nvalues = ["hedrih", "normal-impulse"]\n'
    )
    grid = load_grid(write)
    assert grid.design.points == 6
    columns = grid.design.columns(np.arange(6))
    angles, laws = columns[("balls", 0, "angle")], columns[("collision", "law")]
    expected = np.linspace(-1.0471975511965979, -0.5, 3)  # -60 deg, rounded once
    assert angles.tolist() == np.repeat(expected, 2).tolist()
    assert laws.tolist() == ["hedrih", "normal-impulse"] * 3


def test_zip_and_several_paths_on_one_axis(write: Path) -> None:
    write.write_text(
        'base = "base.toml"\nmode = "zip"\n'
        '[[axes]]\npaths = ["balls[1].mass", "balls[2].mass"]\nvalues = [1.0, [2.0, 3.0]]\n'
        '[[axes]]\npath = "gravity"\nlogspace = [1, 100, 2]\n'
    )
    columns = load_grid(write).design.columns(np.arange(2))
    assert [columns[("balls", n, "mass")].tolist() for n in (0, 1)] == [[1.0, 2.0], [1.0, 3.0]]
    assert columns[("gravity",)].tolist() == [1.0, 100.0]


def test_a_list_for_one_path_and_an_empty_cell_are_told_what_is_expected(write: Path) -> None:
    write.write_text(AXIS + 'path = "collision.k"\nvalues = [[0.9, 0.8]]\n')
    with pytest.raises(ScenarioError, match="or a list of 1: one for each of the paths"):
        load_grid(write)
    write.with_name("points.csv").write_text("collision.k,gravity\n0.9,\n")
    write.write_text(AXIS + 'table = "points.csv"\n')
    with pytest.raises(ScenarioError, match=r"in row 1 .* with a value in every cell"):
        load_grid(write)


@pytest.mark.parametrize("exponents", [(-200, 200), (200, -200), (-160, 160), (160, -160)])
@pytest.mark.parametrize("sign", [1, -1])
def test_ratios_are_equal_even_if_no_double_holds_that_of_the_ends(
    write: Path, exponents: tuple[int, int], sign: int
) -> None:
    low, high = (sign * Decimal(10) ** exponent for exponent in exponents)
    write.write_text(AXIS + f'path = "balls[1].angle"\nlogspace = [{low:e}, {high:e}, 5]\n')
    found = load_grid(write).design.columns(np.arange(5))[("balls", 0, "angle")].tolist()
    assert (found[0], found[4]) == (float(low), float(high))
    for number, value in enumerate(found):
        exact = low * Decimal(10) ** ((exponents[1] - exponents[0]) // 4 * number)
        assert abs(Decimal(value) / exact - 1) < Decimal("1e-12")


def test_the_hint_on_stops_needs_no_copy_of_a_long_axis(write: Path) -> None:
    write.write_text(AXIS + 'path = "collision.k"\nlinspace = [0.5, 1.0, 100_000]\n')
    grid = load_grid(write, ["stop.collisions=1000"])
    tracemalloc.start()
    assert may_lack_an_end(grid)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 100_000  # bytes; the axis has 800,000


@pytest.mark.parametrize("mode", ["latin-hypercube", "sobol"])
def test_designs_fill_every_stratum_and_do_not_depend_on_the_stretch(
    write: Path, mode: str
) -> None:
    write.write_text(
        f'base = "base.toml"\nmode = "{mode}"\nn = 64\nseed = 3\n'
        '[[axes]]\npath = "balls[1].angle"\nuniform = [-1.0, -0.5]\n'
        '[[axes]]\npath = "collision.law"\nvalues = ["hedrih", "translational"]\n'
    )
    design = load_grid(write).design
    whole = design.columns(np.arange(64))
    angle = whole[("balls", 0, "angle")]
    assert sorted(np.floor((angle + 1.0) / 0.5 * 64).astype(int)) == list(range(64))
    assert (whole[("collision", "law")] == "hedrih").sum() == 32
    part = design.columns(np.arange(17, 40))
    assert part[("balls", 0, "angle")].tolist() == angle[17:40].tolist()


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_a_table_of_scenarios(write: Path, tmp_path: Path, suffix: str) -> None:
    table = pa.table({"collision.k": [0.5, 1.0], "collision.law": ["hedrih", "translational"]})
    if suffix == "csv":
        csv.write_csv(table, tmp_path / "points.csv")
    else:
        pq.write_table(table, tmp_path / "points.parquet")
    write.write_text(f'base = "base.toml"\n[[axes]]\ntable = "points.{suffix}"\n')
    columns = load_grid(write).design.columns(np.arange(2))
    assert columns[("collision", "k")].tolist() == [0.5, 1.0]
    assert columns[("collision", "law")].tolist() == ["hedrih", "translational"]


CELLS = {
    "a word among numbers": ("0.5,-1\nmuch,-1", 'found "much" in row 2 of column collision.k'),
    "no unit": ("0.5,-1\n0.6,2 much", 'unit "much" in "2 much" in row 2 of column balls[1].angle'),
    "an empty cell": ("0.5,-1\n0.6,-1\n0.7,", "lacks a value in row 3 of column balls[1].angle"),
    "not finite": ("0.5,-1\ninf,1 rad", "found inf in row 2 of column collision.k"),
}


@pytest.mark.parametrize("name", CELLS)
def test_a_wrong_cell_of_a_table_is_named_by_row_and_column(write: Path, name: str) -> None:
    cells, expected = CELLS[name]
    write.with_name("points.csv").write_text(f"collision.k,balls[1].angle\n{cells}\n")
    write.write_text(AXIS + 'table = "points.csv"\n')
    with pytest.raises(ScenarioError) as caught:
        load_grid(write)
    assert expected in str(caught.value)


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_a_table_without_rows_is_refused(write: Path, tmp_path: Path, suffix: str) -> None:
    table = pa.table({"collision.k": pa.array([], pa.float64())})
    if suffix == "csv":
        csv.write_csv(table, tmp_path / "points.csv")
    else:
        pq.write_table(table, tmp_path / "points.parquet")
    write.write_text(f'base = "base.toml"\n[[axes]]\ntable = "points.{suffix}"\n')
    with pytest.raises(ScenarioError, match=r"axes\[1\].table: found .*a table without rows"):
        load_grid(write)


def test_a_table_whose_names_are_not_in_utf8_is_refused(write: Path) -> None:
    write.with_name("points.csv").write_bytes("collision.k,Höhe\n0.5,1\n".encode("latin-1"))
    write.write_text(AXIS + 'table = "points.csv"\n')
    with pytest.raises(ScenarioError, match="the name of a column is not in UTF-8"):
        load_grid(write)


def test_columns_that_are_no_paths_are_told_and_can_be_left_out(write: Path) -> None:
    write.with_name("points.csv").write_text("collision.k,date\n0.5,2024-05-06\n0.6,2024-05-07\n")
    write.write_text(AXIS + 'table = "points.csv"\n')
    with pytest.raises(ScenarioError, match=r'column "date", expected .*paths of the axis choose'):
        load_grid(write)
    write.write_text(AXIS + 'table = "points.csv"\npath = "collision.k"\n')
    assert load_grid(write).design.columns(np.arange(2))[("collision", "k")].tolist() == [0.5, 0.6]
    write.write_text(AXIS + 'table = "points.csv"\npath = "gravity"\n')
    with pytest.raises(
        ScenarioError, match=r"columns collision.k and date, expected a column grav"
    ):
        load_grid(write)


def test_a_column_of_a_table_may_have_numbers_with_and_without_units(write: Path) -> None:
    write.with_name("points.csv").write_text("balls[1].angle\n-1\n-90 deg\n-1.5e0\n")
    write.write_text(AXIS + 'table = "points.csv"\n')
    angles = load_grid(write).design.columns(np.arange(3))[("balls", 0, "angle")]
    assert angles.tolist() == pytest.approx([-1.0, -math.pi / 2, -1.5])


WRONG = {
    "more points than Sobol's sequence has": (
        f'mode = "sobol"\nn = {2**30 + 1}\n{AXIS}path = "gravity"\nuniform = [9.0, 10.0]\n',
        ["n: found 1073741825, expected a whole number from 1 to 1073741824"],
    ),
    "more points than a number can hold": (
        'base = "base.toml"\n'
        '[[axes]]\npath = "gravity"\nlinspace = [1, 9, 300000]\n'
        '[[axes]]\npath = "collision.k"\nlinspace = [0, 1, 300000]\n'
        '[[axes]]\npath = "balls[1].mass"\nlinspace = [1, 9, 300000]\n',
        ["axes: found 27000000000000000 points, expected fewer than 2^53"],
    ),
    "no base": ("mode = 'zip'\n", ["found none of them, expected one of base or scenario"]),
    "a grid as base": (
        'base = "grid.toml"\n[[axes]]\npath = "gravity"\nvalues = [9.0]\n',
        [":1:8: base: found a grid, expected a scenario"],
    ),
    "unknown path": (
        AXIS + 'path = "balls[1].angel"\nvalues = [1]\n',
        [":3:8: axes[1].path: ", 'the unknown key "angel"', 'did you mean "angle"?'],
    ),
    "unknown table": (
        AXIS + 'path = "collisions.k"\nvalues = [1]\n',
        [
            ":3:8: axes[1].path: found collisions.k, expected a value of",
            'did you mean "collision"?',
        ],
    ),
    "beyond the list": (
        AXIS + 'path = "balls[3].angle"\nvalues = [1]\n',
        ["balls[3] of 2", "a number from 1 to 2"],
    ),
    "no number": (
        AXIS + 'path = "collision.k"\nvalues = [0.5, "much"]\n',
        [":4:16: axes[1].values[2]: ", 'found "much", expected a number'],
    ),
    "wrong word": (
        AXIS + 'path = "collision.law"\nvalues = ["hedrig"]\n',
        [":4:11: axes[1].values[1]: ", 'did you mean "hedrih"?'],
    ),
    "wrong unit": (
        AXIS + 'path = "balls[1].angle"\nlinspace = ["-60 m", 1, 3]\n',
        [":4:13: axes[1].linspace[1]: ", "expected an angle"],
    ),
    "no count": (
        AXIS + 'path = "gravity"\nlinspace = [1, 2, 0.5]\n',
        [":4:19: axes[1].linspace[3]: ", "a whole number from 1"],
    ),
    "ratio below 0": (
        AXIS + 'path = "balls[1].angle"\nlogspace = [-1.0, 1.0, 3]\n',
        [":4:12: axes[1].logspace: found -1.0 to 1.0, expected two ends of the same sign"],
    ),
    "ratio with 0": (
        AXIS + 'path = "balls[1].angle"\nlogspace = [1.0, 0.0, 3]\n',
        ["axes[1].logspace: found 1.0 to 0.0, expected two ends of the same sign, neither"],
    ),
    "no count for uniform": (
        AXIS + 'path = "gravity"\nuniform = [1, 2]\n',
        ["axes[1].uniform: ", "[low, high, count] in mode product"],
    ),
    "two generators": (
        AXIS + 'path = "gravity"\nvalues = [1]\nlinspace = [1, 2, 3]\n',
        ["found values and linspace"],
    ),
    "a path twice": (
        AXIS + 'paths = ["gravity", "gravity"]\nvalues = [1]\n',
        ["found gravity twice"],
    ),
    "without effect": (AXIS + 'path = "output.step"\nvalues = [1]\n', ["axes[1].path: "]),
    "not one value": (AXIS + 'path = "trace.arcs"\nvalues = [1]\n', ["trace.arcs as a whole"]),
    "lengths": (
        'base = "base.toml"\nmode = "zip"\n'
        '[[axes]]\npath = "gravity"\nvalues = [1, 2]\n'
        '[[axes]]\npath = "collision.k"\nvalues = [1]\n',
        ["axes[2]: found 1 value, expected 2 values"],
    ),
    "columns": (
        AXIS + 'path = "gravity"\nvalues = [1]\n[keep]\ncollisions = true\ncolumns = ["speed"]\n',
        ["keep.columns[1]: "],
    ),
    "columns of growth": (
        AXIS
        + 'path = "gravity"\nvalues = [1]\n[keep]\ncollisions = true\ncolumns = ["digits_left"]\n',
        ['keep.columns[1]: found "digits_left"', "of growth they keep only the exponents"],
    ),
    "unknown key": ('base = "base.toml"\naxis = 1\n', ['axis: found the unknown key "axis"']),
    "no table": (AXIS + 'table = "nowhere.csv"\n', ["axes[1].table: ", "nowhere.csv"]),
}


@pytest.mark.parametrize("override", ["balls[1].angle=-0.5", "balls[1].angle=-30 deg"])
def test_an_override_of_what_an_axis_varies_is_refused(write: Path, override: str) -> None:
    """It would have no effect: every point has the axis's value."""
    write.write_text(AXIS + 'paths = ["gravity", "balls[1].angle"]\nvalues = [[9, -0.4]]\n')
    with pytest.raises(ScenarioError) as caught:
        load_grid(write, [override])
    assert f"axes[1]: found balls[1].angle, which --set {override} sets too, in vain" in str(
        caught.value
    )
    grid = load_grid(write, ["balls[2].angle=0.25"])
    assert grid.base.data["balls"][1]["angle"] == 0.25


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_a_table_with_two_columns_of_one_name_is_refused(write: Path, suffix: str) -> None:
    twice = pa.table([pa.array([0.5]), pa.array([0.6])], names=["collision.k", "collision.k"])
    file = write.with_name(f"points.{suffix}")
    csv.write_csv(twice, file) if suffix == "csv" else pq.write_table(twice, file)
    write.write_text(AXIS + f'table = "{file.name}"\n')
    with pytest.raises(ScenarioError, match=r"table: .*2 columns are named 'collision.k'"):
        load_grid(write)


@pytest.mark.parametrize("name", WRONG)
def test_errors_name_the_place_and_what_was_expected(write: Path, name: str) -> None:
    text, expected = WRONG[name]
    write.write_text(text)
    with pytest.raises(ScenarioError) as caught:
        load_grid(write)
    told = str(caught.value)
    assert told.startswith(str(write))
    assert all(part in told for part in expected), told


def test_the_scenario_may_stand_in_the_grid_file(write: Path) -> None:
    axes = '[[axes]]\npath = "balls[1].angle"\nlinspace = [-1.2, -0.5, 3]\n'
    write.write_text('base = "base.toml"\n' + axes)
    apart = load_grid(write)
    inline = SCENARIO.replace("[[balls]]", "[[scenario.balls]]")
    for table in ("trace", "collision", "stop"):
        inline = inline.replace(f"[{table}]", f"[scenario.{table}]")
    write.write_text("[scenario]" + inline + axes)
    within = load_grid(write)
    assert within.base.data == apart.base.data
    line = write.read_text().splitlines().index("k = 0.9") + 1
    assert within.base.source.place("collision.k").line == line
