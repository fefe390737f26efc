"""Basins against boundaries of known dimension, counting by hand, and the separatrix."""

from __future__ import annotations

import json
import math
import re
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.figures.layout import assert_texts_are_apart, texts
from vibro_cli import NoBasins, example, sweep
from vibro_cli.analysis.basins import BOX, Basins, Outcomes, basins_of, outcomes_of
from vibro_cli.commands.app import run_command_line
from vibro_cli.figures.analyses import Mapped, coloured
from vibro_cli.figures.maps import Coordinate, ParameterMap, category_map


def _measured(cells: Any, number: int = 2) -> Basins:
    names = tuple(str(code) for code in range(number))
    return basins_of(Outcomes(names, cells.ravel()), cells)


def _cantor(levels: int) -> Any:
    """Return 1 on the Cantor set of some levels, 0 on the middle thirds that it removes."""
    kept = np.ones(1, dtype=np.int64)
    for _ in range(levels):
        kept = np.concatenate([kept, np.zeros_like(kept), kept])
    return kept


def test_a_straight_boundary_has_the_exponent_one() -> None:
    rows, columns = np.indices((240, 320))
    found = _measured((rows + 2 * columns > 400).astype(np.int64))
    assert found.exponent is not None
    assert found.exponent.value == pytest.approx(1.0, abs=0.05)
    assert found.boundary_dimension == pytest.approx(1.0, abs=0.05)
    assert not found.fractal


@pytest.mark.parametrize("lines", [1, 200])
def test_the_boundary_of_a_cantor_set_has_its_dimension(lines: int) -> None:
    row = _cantor(7)
    found = _measured(row if lines == 1 else np.tile(row, (lines, 1)))
    assert found.boundary_dimension is not None
    dimension = math.log(2.0) / math.log(3.0) + (0.0 if lines == 1 else 1.0)
    assert found.boundary_dimension == pytest.approx(dimension, abs=0.05)


def test_outcomes_by_chance_have_the_exponent_zero_and_fractal_boundaries() -> None:
    cells = np.random.default_rng(3).integers(0, 4, (300, 300))
    found = _measured(cells, 4)
    assert found.exponent is not None
    assert abs(found.exponent.value) < 0.01
    assert found.fractal
    # The mean of 25 draws of 4 falls short of ln 4 by nearly 3/(2 * 25).
    assert found.entropy.value == pytest.approx(math.log(4.0) - 3.0 / 50.0, abs=0.01)


def test_entropies_are_those_counted_box_by_box() -> None:
    rng = np.random.default_rng(8)
    cells = (rng.random((37, 43)) < np.linspace(0.0, 0.3, 43)).astype(np.int64)
    found = _measured(cells)
    counted = []
    for i in range(0, 35, BOX):
        for j in range(0, 40, BOX):
            box = Counter(int(one) for one in cells[i : i + BOX, j : j + BOX].ravel())
            counted.append(sum(-n / 25 * math.log(n / 25) for n in box.values()))
    assert found.entropy.value == pytest.approx(np.mean(counted), rel=1e-14)
    mixed = [one for one in counted if one > 0.0]
    assert found.boundary_entropy is not None
    assert found.boundary_entropy.value == pytest.approx(np.mean(mixed), rel=1e-14)


def test_one_outcome_has_no_boundary() -> None:
    found = _measured(np.zeros((40, 40), dtype=np.int64), 1)
    assert found.entropy.value == 0.0
    assert found.boundary_entropy is None
    assert found.exponent is None


def test_a_particle_leaves_the_trace_beyond_the_separatrix_through_its_end() -> None:
    """Compare with the energy that the end of one valley requires, computed by hand."""
    trace = {"trace.start_slope": -1.2, "trace.arcs": [
        {"shape": "valley", "radius": 1.0, "end_slope": 1.2}
    ]}  # fmt: skip
    one = example("lone_particle").replace({**trace, "stop.time": 10.0, "balls[1].rate": 0.0})
    angle, rate = np.linspace(-1.0, 1.0, 60), np.linspace(-4.0, 4.0, 80)
    grid = sweep(one, {"balls[1].angle": angle, "balls[1].rate": rate})
    found = grid.basins()
    energy = 0.5 * rate**2 - 9.81 * np.cos(angle)[:, None]
    leaves = energy > -9.81 * math.cos(1.2)
    # The axis that the grid has first, the angle, lies across: along the last axis of the cells.
    beyond = found.basins.cells == found.basins.outcomes.index("end of trace")
    assert np.array_equal(beyond, leaves.T)
    assert found.basins.exponent is not None
    assert found.basins.exponent.value == pytest.approx(1.0, abs=0.1)
    assert found.map("double") is not None
    assert found.scaling("single") is not None
    form = r"(\d+) outcomes, basin entropy (\S+) ± \S+, uncertainty exponent (\S+) ± \S+"
    stopped = 100.0 * np.mean(~leaves)  # all others move for ever
    assert found.doubt == (
        f"{stopped:.3g} % of the runs were stopped while bodies were still moving: their outcome "
        "is that at the stop, and a later stop may give another"
    )
    words = re.fullmatch(f"<GridBasins: {form}; warning: {re.escape(found.doubt)}>", repr(found))
    assert words is not None
    assert int(words[1]) == len(found.basins.outcomes)
    assert float(words[2]) == pytest.approx(found.basins.entropy.value, abs=6e-5)
    assert float(words[3]) == pytest.approx(found.basins.exponent.value, abs=6e-5)


def test_outcomes_are_words_and_whole_numbers_together() -> None:
    summary = {
        "scenario": np.arange(4),
        "status": np.array(["ok", "ok", "invalid", "ok"], dtype=object),
        "arc_2": np.array([1.0, 3.0, np.nan, 1.0]),
        "energy_end": np.array([0.1, 0.2, np.nan, 0.3]),
        "reason": np.array([None] * 4, dtype=object),
        "arc_3": np.full(4, np.nan),
    }
    found = outcomes_of(summary, ["status", "arc_2"], np.arange(4))
    assert found.names == ("ok, 2 on arc 1", "invalid", "ok, 2 on arc 3")
    assert found.code.tolist() == [0, 2, 1, 0]
    for name in ("reason", "arc_3"):
        with pytest.raises(NoBasins, match=f"outcome '{name}', expected one of status, arc_2$"):
            outcomes_of(summary, [name], np.arange(4))
    with pytest.raises(NoBasins, match="found the outcome 'energy_end', expected one of status"):
        outcomes_of(summary, ["energy_end"], np.arange(4))


def test_the_rarest_outcomes_share_a_colour() -> None:
    names = tuple(f"outcome {n}" for n in range(12))
    categories = coloured(Outcomes(names, np.repeat(np.arange(12), np.arange(12, 0, -1))))
    entries = categories.entries()
    assert len(entries) == 10
    assert entries[-1][0] == "3 others (7.69 %)"
    assert int(categories.code.max()) == 9


def test_one_outcome_that_has_no_colour_of_its_own_is_told_in_the_singular() -> None:
    names = tuple(f"outcome {n}" for n in range(10))
    assert coloured(Outcomes(names, np.arange(10))).names[-1] == "1 other (10 %)"


@pytest.mark.parametrize("width", ["single", "double"])
@pytest.mark.parametrize(
    "letters", [pytest.param(n, marks=[pytest.mark.long] if n % 3 else []) for n in range(18)]
)
def test_names_of_outcomes_fit_over_the_map(width: str, letters: int) -> None:
    names = tuple(f"inadmissible, {'m' * letters}1 on arc {n}, 2 on arc 3" for n in range(10))
    shown = ParameterMap(np.arange(4), (_sides(0.0, 1.0, 0.0, 1.0), _sides(0.0, 0.0, 1.0, 1.0)), ())
    outcomes = Outcomes(names, np.array([0, 1, 8, 9]))
    drawn = category_map(shown, width, coloured(outcomes))
    assert_texts_are_apart(drawn)


def _sides(*places: float) -> Coordinate:
    return Coordinate("collision.k", "", np.array(places), ())


def test_axes_that_cannot_be_measured_are_told(tmp_path: Path) -> None:
    grid = sweep(example("one_circle"), {"collision.k": [0.5, 0.6, 0.8]})
    with pytest.raises(
        NoBasins, match=r"at least 32 evenly spaced numbers, found collision\.k \(3, uneven\)"
    ):
        grid.basins()


def test_a_point_that_is_there_twice_does_not_stand_for_one_that_is_missing() -> None:
    starts = np.array([[0.1 * n, 0.01 * m] for n in range(32) for m in range(32)])
    starts[-1] = starts[0]
    axes = dict(zip(["balls[1].rate", "balls[2].rate"], starts.T, strict=True))
    grid = sweep(example("one_circle").replace({"stop.collisions": 1}), axes, mode="zip")
    with pytest.raises(NoBasins, match=r"no point, or several, for some values of the axes"):
        grid.basins()


def test_the_command_writes_what_it_prints(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    angles = np.linspace(-1.2, 0.4, 40)
    grid = sweep(example("three_arcs"), {"balls[1].angle": angles}, tmp_path / "grid")
    assert run_command_line(["basins", str(tmp_path / "grid"), "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    folder = tmp_path / "grid-basins"
    assert run_command_line(["basins", str(tmp_path / "grid")]) == 0
    told = capsys.readouterr()
    assert re.search(r"uncertainty exponent .*; from 3 distances\n", told.out)
    stopped = 100.0 * np.mean(np.asarray(grid.summary["end_cause"]) == "time")
    assert f"warning: {stopped:.3g} % of the runs were stopped" in told.err
    assert record == json.loads((folder / "basins.json").read_text())
    assert record["axes"] == ["balls[1].angle"]
    ended = Counter(
        f"{cause.replace('_', ' ')}, 1 on arc {one}, 2 on arc {two}"
        for cause, one, two in zip(
            *(grid.summary[name] for name in ("end_cause", "arc_1", "arc_2")), strict=True
        )
    )
    assert {one["outcome"]: round(40 * one["share"]) for one in record["outcomes"]} == dict(ended)
    assert (folder / "uncertainty.pdf").exists()
    assert run_command_line(["basins", str(tmp_path / "grid"), "-o", str(tmp_path)]) == 2
    assert "is not a vibro basins folder; it is left as it is" in capsys.readouterr().err


def test_what_is_found_is_worded_as_an_indication(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    sweep(example("one_circle"), {"collision.k": np.linspace(0.3, 0.99, 40)}, tmp_path / "grid")
    command = ["basins", str(tmp_path / "grid"), "--outcome", "collisions", "--no-figures"]
    assert run_command_line(command) == 0
    assert "; above ln 2 = 0.6931, a sign of a fractal boundary\n" in capsys.readouterr().out


def test_the_axis_of_a_share_ends_at_one() -> None:
    """The axis used to extend to 10, and an error of 0.0003 was printed as 0.000."""
    cells = np.random.default_rng(3).integers(0, 5, 400)
    found = _measured(cells, 5)
    place = Coordinate("collision.k", "", np.linspace(0.0, 1.0, 400), ())
    shown = ParameterMap(np.arange(400), (place,), ())
    figure = Mapped(shown, Outcomes(tuple("01234"), cells), found).scaling("single")
    assert figure is not None
    (axes,) = figure.axes
    assert 1.0 < axes.get_ylim()[1] < 2.0
    assert np.max(found.uncertain) > 0.8
    assert found.exponent is not None
    assert found.exponent.error is not None
    told = {text.get_text().replace("−", "-") for text in texts(figure)}
    assert f"slope {found.exponent.value:.4f} ± {found.exponent.error:.4f}" in told
