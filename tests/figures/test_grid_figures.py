"""Figures of grids made by hand: the values drawn, and that nothing overlaps."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from matplotlib.collections import PathCollection, QuadMesh
from matplotlib.colors import LogNorm, to_rgb
from matplotlib.figure import Figure

from tests.figures.layout import WIDTHS, assert_texts_are_apart, texts
from tests.grid_folder import CAUSES, place_of, product, write_grid
from vibro_cli import example, load_scenario, sweep
from vibro_cli.analysis.basins import codes_of
from vibro_cli.figures import maps, over_axis
from vibro_cli.figures.chart import value_axis
from vibro_cli.figures.kinds import CONTACT_WORDS, draw_grid, draw_grid_kind
from vibro_cli.figures.maps import COLOURS, ending_map, parameter_map, quantity_map, words_of
from vibro_cli.figures.over_axis import FIRST, curves, diagram, first_times, place_column
from vibro_cli.figures.style import has_rasters, render
from vibro_cli.storage.stored import NotAGrid, StoredGrid, is_grid, open_grid

ANGLES = [-1.2, -1.1, -0.9, -0.6, -0.2]
TWO = product({"balls[1].angle": ANGLES, "collision.k": [1.0, 0.9, 0.5]})
THREE = product({"gravity": [9.81, 1.6], "balls[1].angle": ANGLES, "collision.k": [1.0, 0.9, 0.5]})
WORDS = product({"balls[1].body": ["ball", "disk", "particle"], "collision.k": [1.0, 0.9]})
ONE = {"balls[1].angle": ANGLES}
TOGETHER = product({"balls[1].angle": ANGLES, "collision.k": [1.0, 0.9, 0.5]})
TOGETHER["balls[2].angle"] = [-angle for angle in TOGETHER["balls[1].angle"]]
RANDOM = np.random.default_rng(5)
SAMPLE = {"balls[1].angle": RANDOM.random(40), "collision.k": RANDOM.random(40)}
GRIDS: dict[str, Any] = {
    "two": TWO, "three": THREE, "words": WORDS, "one": ONE, "sample": SAMPLE,
}  # fmt: skip


@pytest.fixture
def made(tmp_path: Path) -> Any:
    def make(columns: Any, **more: Any) -> StoredGrid:
        grid = open_grid(write_grid(tmp_path / "grid", columns, **more))
        return replace(grid, summary=dict(grid.summary))  # the columns are changed here and there

    return make


def mesh(figure: Figure) -> QuadMesh:
    (found,) = (one for one in figure.axes[0].collections if isinstance(one, QuadMesh))
    return found


def cells_of(figure: Figure) -> Any:
    """Return the values of the cells, of shape (rows, columns)."""
    return mesh(figure).get_array()


def dots(figure: Figure, panel: int = 0) -> PathCollection:
    (found,) = (one for one in figure.axes[panel].collections if isinstance(one, PathCollection))
    return found


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("name", GRIDS)
def test_no_text_is_cut_off_or_overlaps_another(made: Any, name: str, width: str) -> None:
    drawn = list(draw_grid(made(GRIDS[name], bad={1: ("invalid", "too steep")}), width))
    expected = ["endings", "impacts", "energy", "curves", "diagram"]
    assert [one.name for one in drawn] == (expected[3:] if name == "one" else expected)
    for one in drawn:
        assert_texts_are_apart(one.figure)


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("largest", [1e-7, 0.03, 1.0, 12345.0, 3e9])
@pytest.mark.parametrize("words", [CONTACT_WORDS, "impacts"])
def test_the_bar_of_a_map_has_room_for_its_numbers(
    made: Any, words: str, largest: float, width: str
) -> None:
    grid = made(TWO)
    for least in (0.2, 1e-6):
        values = np.linspace(least * largest, largest, 15)
        figure = quantity_map(grid, width, values, words)
        assert figure is not None
        assert_texts_are_apart(figure)


def test_angles_of_several_arcs_have_no_common_axis(made: Any) -> None:
    """On one arc the diagram shows angles, else arc lengths."""
    grid = made(TWO)
    one, several = (
        place_column(grid),
        place_column(cast("Any", Several(grid, ("n", "angle_a", "s_a")))),
    )
    assert one is not None
    assert several is not None
    assert one[0] == "angle_a"
    assert several[0] == "s_a"
    assert place_column(cast("Any", Several(grid, ("n", "angle_a")))) is None


class Several:
    """A grid as it is, but on a trace of three arcs."""

    def __init__(self, grid: StoredGrid, columns: tuple[str, ...]) -> None:
        self._grid, self._columns = grid, columns
        self.shapes = ("valley", "hump", "valley")

    def __getattr__(self, name: str) -> Any:
        return getattr(self._grid, name)

    def impact_columns(self) -> tuple[str, ...]:
        return self._columns


def test_words_of_axes() -> None:
    assert words_of("balls[1].angle") == "initial angle of body 1"
    assert words_of("collision.k") == "coefficient of restitution $k$"
    assert words_of("trace.turning.rate") == "rate of rotation"
    assert words_of("trace.arcs[2].radius") == "radius of arc 2"
    assert words_of("balls[2].spring.length") == "length of spring of body 2"
    assert words_of("gravity") == "gravity $g$"
    assert words_of("stop.time") == "stop time"
    assert words_of("stop.collisions") == "number of impacts at the stop"


def test_the_map_of_endings_has_the_colour_of_each_point(made: Any) -> None:
    figure = ending_map(made(TWO, bad={4: ("invalid", "too steep")}))
    assert figure is not None
    colours = mesh(figure).to_rgba(cells_of(figure))[:, :, :3]
    for n in range(15):
        column, row = divmod(n, 3)
        cause = "invalid" if n == 4 else CAUSES[n % 4]
        # k falls from point to point, and rises along the figure's axis
        assert colours[2 - row, column] == pytest.approx(to_rgb(COLOURS[cause])), n
    shown = {text.get_text() for text in texts(figure)}
    assert {"stop time reached (3)", "invalid (1)", "initial angle of body 1 [rad]"} <= shown
    assert "coefficient of restitution $k$" in shown


@pytest.mark.parametrize(
    ("numbers", "words", "labels"),
    [
        (range(1, 4), "arc 1", ["1", "2", "3"]),
        (range(3), "arc 1 (white: 0)", ["1", "2"]),
        (range(1, 2), "arc 1", ["1"]),
    ],
)
def test_few_whole_numbers_have_a_colour_each(
    made: Any, numbers: range, words: str, labels: list[str]
) -> None:
    grid = made(TWO, bad={1: ("invalid", "too steep")})
    column = np.array([numbers[n % len(numbers)] for n in range(15)], dtype=np.float64)
    column[1] = np.nan
    grid.summary["arc_1"], grid.units["arc_1"] = column, ""
    figure = draw_grid_kind(grid, "arc_1", "single")
    assert figure is not None
    bar = figure.axes[1]
    assert bar.get_ylabel() == words
    assert [text.get_text() for text in bar.get_yticklabels()] == labels
    own = mesh(figure).to_rgba(cells_of(figure).compressed())
    assert len(np.unique(own, axis=0)) == len(labels)
    assert_texts_are_apart(figure)


def test_a_grid_without_a_valid_point_has_no_curves() -> None:
    scenario = load_scenario(Path(__file__).parents[2] / "scenarios/one_circle.toml")
    for radii, there in (([-1.0, -2.0], False), ([-1.0, 0.1], True)):
        grid = sweep(scenario, {"balls[1].radius": radii}).stored
        assert [one.name for one in draw_grid(grid, "single")] == ["curves"] * there


def test_the_points_of_all_figures_are_found_once(
    made: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """At both widths, over one axis and over two, which tell of each other nothing."""
    grid, coded = made(TWO), []

    def counted(values: Any) -> Any:
        coded.append(len(values))
        return codes_of(values)

    monkeypatch.setattr(maps, "codes_of", counted)
    for width in ("single", "double"):
        assert len(list(draw_grid(grid, width))) > 3
    assert len(coded) == 2 * len(grid.axes)


def test_cells_end_halfway_between_values(made: Any) -> None:
    across, along = parameter_map(made(TWO), 2).coordinates  # type: ignore[union-attr]
    np.testing.assert_allclose(across.edges(), [-1.25, -1.15, -1.0, -0.75, -0.4, 0.0])
    np.testing.assert_allclose(along.edges(), [0.3, 0.7, 0.95, 1.05])


def as_logspace(grid: StoredGrid) -> StoredGrid:
    """Return the grid with its axes as in a file that gives them by `logspace`."""
    axes = [{"paths": [path], "logspace": [1.0, 1.0, 1]} for path in grid.axes]
    return replace(grid, definition={**grid.definition, "axes": axes})


@pytest.mark.parametrize("width", WIDTHS)
def test_axes_at_even_ratios_are_logarithmic(made: Any, width: str) -> None:
    """Cells are as wide as one another there, below 0 too; dots are at even distances."""
    angles: list[float] = (-np.geomspace(1e-3, 1.0, 7)).tolist()
    gravities: list[float] = np.geomspace(0.5, 8.0, 5).tolist()
    grid = as_logspace(made(product({"balls[1].angle": angles, "gravity": gravities})))
    across, along = parameter_map(grid, 2).coordinates  # type: ignore[union-attr]
    np.testing.assert_allclose(across.edges(), -np.geomspace(10**0.25, 10**-3.25, 8))
    np.testing.assert_allclose(along.edges(), np.geomspace(0.5 / 2**0.5, 8.0 * 2**0.5, 6))
    drawn = {one.name: one.figure for one in draw_grid(grid, width)}
    corners = np.asarray(mesh(drawn["energy"]).get_coordinates())
    axes = drawn["energy"].axes[0]
    places = axes.transAxes.inverted().transform(axes.transData.transform(corners.reshape(-1, 2)))
    rows, columns = np.divmod(np.arange(48), 8)
    np.testing.assert_allclose(places, np.column_stack([columns / 7, rows / 5]), atol=1e-9)
    labels = [text.get_text() for text in axes.get_xticklabels()]
    assert labels == ["−$10^{-3}$", "−$10^{-2}$", "−$10^{-1}$", "−$10^{0}$"]
    assert [text.get_text() for text in axes.get_yticklabels()] == ["0.5", "1", "2", "5", "10"]
    axes = drawn["curves"].axes[0]
    points = axes.transData.transform(np.asarray(dots(drawn["curves"]).get_offsets()))
    np.testing.assert_allclose(np.diff(points[:, 0]), np.mean(np.diff(points[:, 0])))
    for figure in drawn.values():
        assert_texts_are_apart(figure)


def test_the_map_of_a_quantity_has_its_values_and_leaves_out_what_is_not_there(made: Any) -> None:
    grid = made(TWO)
    values = np.where(np.arange(15) == 7, np.nan, 10.0 ** np.arange(15))
    figure = quantity_map(grid, "single", values, "it")
    assert figure is not None
    cells = cells_of(figure)
    for n in range(15):
        column, row = divmod(n, 3)
        assert (cells[2 - row, column] is np.ma.masked) == (n == 7)
        if n != 7:
            assert cells[2 - row, column] == values[n]
    assert isinstance(mesh(figure).norm, LogNorm)
    assert figure.axes[1].get_ylabel() == "it"
    assert quantity_map(grid, "single", np.full(15, np.nan), "it") is None


def test_a_logarithmic_bar_has_the_labels_of_an_axis_and_the_least_number(made: Any) -> None:
    """From 1 to 60 impacts it had two numbers, 1 and 10."""
    figure = quantity_map(made(TWO), "single", np.geomspace(1.0, 60.0, 15), "impacts", 10.0)
    assert figure is not None
    labels = [text.get_text() for text in figure.axes[1].get_yticklabels()]
    assert labels == ["1", "2", "5", "10", "20", "50"]
    assert_texts_are_apart(figure)


@pytest.mark.parametrize(
    ("value", "label"), [(1.0, "1"), (0.0, "0"), (-0.25, "−0.25"), (2e-9, r"$2\times 10^{-9}$")]
)
def test_equal_numbers_have_one_colour_and_a_bar_with_that_number(
    made: Any, value: float, label: str
) -> None:
    """The bar showed a scale from half to one and a half times the number, in all colours."""
    values = np.full(15, value) * (1.0 + 1e-15 * np.arange(15.0))
    figure = quantity_map(made(TWO), "single", values, "it [J]")
    assert figure is not None
    bar = figure.axes[1]
    assert [text.get_text() for text in bar.get_yticklabels()] == [label]
    assert bar.get_yticks() == pytest.approx([value], rel=1e-12, abs=1e-15)
    assert bar.get_ylabel() == "it [J]"
    (own,) = np.unique(mesh(figure).to_rgba(cells_of(figure).ravel()), axis=0)
    painted = bar.collections[-1].get_array()
    assert painted is not None
    colours = bar.collections[-1].to_rgba(painted.ravel())
    (shown,) = np.unique(colours, axis=0)
    assert own == pytest.approx(shown)
    assert_texts_are_apart(figure)


def test_the_map_of_contact_says_what_it_shows(made: Any) -> None:
    grid = made(TWO)
    changes = {"contacts": np.arange(15) % 2, "last_collision_time": np.linspace(1.0, 9.0, 15)}
    grid.summary.update(changes)
    figure = draw_grid_kind(grid, "contact", "single")
    assert figure is not None
    assert figure.axes[1].get_ylabel() == CONTACT_WORDS
    shown = cells_of(figure).compressed()
    assert sorted(shown) == pytest.approx(changes["last_collision_time"][1::2])


def test_further_axes_are_held_and_named(made: Any) -> None:
    grid = made(THREE)
    shown = parameter_map(grid, 2)
    assert shown is not None
    assert [one.path for one in shown.coordinates] == ["balls[1].angle", "collision.k"]
    assert shown.held == "gravity = 9.81 m/s²"
    assert shown.rows.tolist() == list(range(15))
    captions = {one.name: one.caption for one in draw_grid(grid, "single")}
    assert captions["endings"].endswith("Held: gravity = 9.81 m/s².")
    assert captions["curves"].endswith("Held: gravity = 9.81 m/s², collision.k = 1.")


def test_axes_that_change_together_are_one(made: Any) -> None:
    shown = parameter_map(made(TOGETHER), 2)
    assert shown is not None
    assert [one.path for one in shown.coordinates] == ["balls[1].angle", "collision.k"]
    assert len(shown.rows) == 15
    assert shown.held == ""


BODIES: dict[str, Any] = {
    "balls[1].radius": [0.1, 0.1, 0.12],
    "balls[1].body": ["disk", "ball", "hoop"],
}


@pytest.mark.parametrize("paths", [list(BODIES), list(BODIES)[::-1]])
@pytest.mark.parametrize("values", [[1.0, 0.5], [1.0, 0.9, 0.7, 0.5]])
def test_of_axes_that_change_together_one_that_tells_the_others_is_shown(
    made: Any, values: list[float], paths: list[str]
) -> None:
    rows = product({"row": [0, 1, 2], "collision.k": values})
    together = {path: [BODIES[path][row] for row in rows["row"]] for path in paths}
    shown = parameter_map(made({**together, "collision.k": rows["collision.k"]}), 2)
    assert shown is not None
    assert [one.path for one in shown.coordinates] == ["balls[1].body", "collision.k"]
    assert shown.coordinates[0].words == ("disk", "ball", "hoop")
    assert len(shown.rows) == 3 * len(values)
    assert shown.is_full
    assert shown.held == ""


def test_what_two_axes_tell_together_is_not_held(made: Any) -> None:
    """A mass for each pair of two radii and two starts, beside k."""
    starts = {"balls[1].radius": [0.1, 0.2], "balls[1].angle": [-1.0, -0.5]}
    columns = product({**starts, "collision.k": [1.0, 0.9]})
    shown = parameter_map(made({**columns, "balls[1].mass": [1, 1, 2, 2, 2, 2, 1, 1]}), 2)
    assert shown is not None
    assert [one.path for one in shown.coordinates] == list(starts)
    assert shown.held == "collision.k = 1"
    assert len(shown.rows) == 4


def test_a_sample_is_shown_point_by_point(made: Any) -> None:
    figure = ending_map(made(SAMPLE))
    assert figure is not None
    places = np.asarray(dots(figure).get_offsets())
    np.testing.assert_array_equal(places[:, 0], SAMPLE["balls[1].angle"])
    np.testing.assert_array_equal(places[:, 1], SAMPLE["collision.k"])


@pytest.mark.parametrize("width", WIDTHS)
def test_two_axes_of_angles_have_numbers_of_one_kind(made: Any, width: str) -> None:
    """One of them is too short for parts of π."""
    wide, short = np.linspace(-1.5, 1.5, 7).tolist(), np.linspace(0.5, 0.6, 5).tolist()
    grid = made(product({"balls[1].angle": wide, "balls[2].angle": short}))
    grid.units["balls[2].angle"] = "rad"
    figure = ending_map(grid, width)
    assert figure is not None
    panel = figure.axes[0]
    labels = [*panel.get_xticklabels(), *panel.get_yticklabels()]
    assert not any("π" in label.get_text() for label in labels)
    assert_texts_are_apart(figure)


def test_words_stand_beside_one_another(made: Any) -> None:
    figure = ending_map(made(WORDS))
    assert figure is not None
    assert [text.get_text() for text in figure.axes[0].get_xticklabels()] == [
        "ball", "disk", "particle",
    ]  # fmt: skip


def test_curves_have_the_values_of_the_summary(made: Any) -> None:
    figure = curves(made(ONE))
    assert figure is not None
    n = np.arange(5)
    for panel, values in enumerate((n % 7, 1.0 / (1.0 + n), np.where(n, 0.5 + 0.01 * n, np.nan))):
        offsets = np.ma.filled(np.asarray(dots(figure, panel).get_offsets()), np.nan)
        np.testing.assert_allclose(offsets[:, 0], ANGLES)
        np.testing.assert_allclose(offsets[:, 1], values)


def test_curves_have_the_greatest_exponent_if_there_is_one(made: Any) -> None:
    grid = made(ONE)
    without = curves(grid)
    assert without is not None
    grid.summary["lyapunov_1"] = np.array([0.3, -0.2, np.nan, -np.inf, 0.7])
    figure = curves(grid)
    assert figure is not None
    assert len(figure.axes) == len(without.axes) + 1
    assert figure.axes[3].get_ylabel() == r"$\lambda_{1}$ [1/s]"
    offsets = np.ma.filled(np.asarray(dots(figure, 3).get_offsets()), np.nan)
    np.testing.assert_allclose(offsets[:, 1], [0.3, -0.2, np.nan, np.nan, 0.7])
    assert_texts_are_apart(figure)


@pytest.mark.parametrize("most", [1, 2, 5, 8, 9, 14, 40])
def test_impacts_over_an_axis_are_counted_in_whole_numbers(made: Any, most: int) -> None:
    grid = made(ONE)
    grid.summary["collisions"] = np.linspace(0.0, most, 5).astype(int)
    figure = curves(grid)
    assert figure is not None
    assert figure.axes[0].get_ylabel() == "impacts"
    ticks = np.asarray(figure.axes[0].get_yticks())
    assert len(ticks) > 1
    np.testing.assert_array_equal(ticks, np.round(ticks))


def test_of_a_run_without_energy_at_its_start_no_share_is_left(made: Any) -> None:
    """There is no value, instead of 0 as if all of it were lost."""
    grid = made(ONE)
    grid.summary["energy_start"] = np.array([1.0, 0.0, 1.0, 1.0, 1.0])
    grid.summary["energy_end"] = np.array([1.0, 0.0, 0.5, 0.25, 0.0])
    figure = curves(grid)
    assert figure is not None
    offsets = np.ma.filled(np.asarray(dots(figure, 1).get_offsets()), np.nan)
    np.testing.assert_array_equal(offsets[:, 1], [1.0, np.nan, 0.5, 0.25, 0.0])


def test_the_diagram_has_every_impact(made: Any) -> None:
    figure = diagram(made(TWO))
    assert figure is not None
    expected = [
        (angle, place_of(3 * column + 1, n))  # k is held at its first value
        for column, angle in enumerate(ANGLES)
        for n in range(1, 3 * column % 7 + 1)
    ]
    np.testing.assert_allclose(np.asarray(dots(figure).get_offsets()), expected)
    assert diagram(made(TWO)) is not None


def test_the_first_times_are_those_of_the_first_impacts(made: Any) -> None:
    grid = made(TWO)
    taken: list[tuple[Any, ...]] = []

    class Many(Several):
        def impacts(self, columns: Any, scenarios: Any) -> Iterator[dict[str, Any]]:
            taken.append(tuple(columns))
            runs, n = np.repeat(scenarios, 2 * FIRST), np.tile(np.arange(2 * FIRST) + 1, 5)
            yield {"scenario": runs, "n": n, "t": 100.0 * runs + n}

    figure = first_times(cast("Any", Many(grid, ("n", "t"))))
    assert figure is not None
    expected = [
        (angle, 100.0 * (3 * column + 1) + n)  # k is held at its first value
        for column, angle in enumerate(ANGLES)
        for n in range(1, FIRST + 1)
    ]
    np.testing.assert_allclose(np.asarray(dots(figure).get_offsets()), expected)
    assert taken == [("scenario", "n", "t")]
    assert not figure.legends
    assert first_times(cast("Any", Several(grid, ("n", "s_a")))) is None


@pytest.mark.parametrize("width", ["single", "double"])
def test_runs_that_were_cut_short_have_their_ends_among_the_times(
    made: Any, width: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Few(Several):
        def impacts(self, columns: Any, scenarios: Any) -> Iterator[dict[str, Any]]:
            yield {"scenario": scenarios, "n": np.ones(5), "t": np.arange(5.0)}

    grid = made(ONE)
    grid.summary.update(end_time=np.arange(5.0) + 7.0, collisions=np.array([1, 1, 1, FIRST, 1]))
    figure = first_times(cast("Any", Few(grid, ("n", "t"))), width)
    assert figure is not None
    assert_texts_are_apart(figure)
    (cross,) = figure.axes[0].lines
    assert CAUSES[2:] == ("end_of_trace", "inadmissible")
    np.testing.assert_array_equal(np.asarray(cross.get_xydata()), [[ANGLES[2], 9.0]])
    assert figure.axes[0].get_ylim()[1] > 9.0
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["run ended"]
    assert not cross.get_rasterized()
    monkeypatch.setattr(over_axis, "MOST_VECTOR_POINTS", 0)  # 10^5 of them took 13 MB in SVG
    figure = first_times(cast("Any", Few(grid, ("n", "t"))), width)
    assert figure is not None
    assert figure.axes[0].lines[0].get_rasterized()


def test_a_panel_of_one_value_is_left_out(made: Any) -> None:
    grid = made(ONE)
    grid.summary["first_collision_time"][:] = 0.5
    figure = curves(grid)
    assert figure is not None
    assert [axes.get_ylabel() for axes in figure.axes] == ["impacts", r"$E_\mathrm{end}/E_0$"]


def test_without_impacts_there_is_no_diagram(made: Any) -> None:
    assert diagram(made(TWO, kept=False)) is None
    assert "diagram" not in [one.name for one in draw_grid(made(TWO, kept=False), "single")]


def test_a_million_points_are_a_raster(made: Any) -> None:
    number = 30000
    grid = made({"collision.k": np.linspace(0.0, 1.0, number)})
    for figure in (curves(grid), diagram(grid)):
        assert figure is not None
        assert has_rasters(figure)
        assert len(render(figure, "svg")) < 1_000_000


def test_the_same_grid_gives_the_same_bytes(made: Any) -> None:
    grid = made(TWO)
    first, second = (
        [render(one.figure, "pdf") for one in draw_grid(grid, "single")] for _ in range(2)
    )
    assert first == second


def test_colours_of_endings_differ_in_grey() -> None:
    grey = sorted(float(np.dot(to_rgb(one), [0.2126, 0.7152, 0.0722])) for one in COLOURS.values())
    assert min(np.diff(grey)) > 0.06


def test_other_folders_are_no_grids(tmp_path: Path) -> None:
    assert not is_grid(tmp_path)
    (tmp_path / "grid.json").write_text("{}")
    assert is_grid(tmp_path)
    expected = "expected a folder that `vibro grid` wrote"
    (tmp_path / "empty").mkdir()
    with pytest.raises(NotAGrid, match=f"empty holds no grid; {expected}"):
        open_grid(tmp_path / "empty")
    with pytest.raises(NotAGrid, match=f"nowhere does not exist; {expected}"):
        open_grid(tmp_path / "nowhere")
    with pytest.raises(NotAGrid, match="expected its manifest"):
        open_grid(tmp_path)
    folder = write_grid(tmp_path / "one", ONE)
    (folder / "summary/part-000000.parquet").unlink()
    with pytest.raises(NotAGrid, match="no finished point"):
        open_grid(folder)


def test_the_places_on_a_table_are_of_a_ball_not_of_the_left_one() -> None:
    scenario = example("billiards").replace({"stop.time": 0.5})
    grid = sweep(scenario, {"wall.k": [0.7, 0.8, 0.9]}, collisions=True)
    assert place_column(grid.stored) == ("x_a", "$x$ of ball a", "m")


def test_values_that_are_one_but_for_rounding_have_an_axis_around_them() -> None:
    axes = Figure().add_subplot()
    value_axis(axes, [0.4244596862733530, 0.4244596862733532], "first impact", "s")
    assert axes.get_ylabel() == "first impact [s]"
    assert axes.get_ylim()[0] == pytest.approx(0.4244596862733531 * 0.5, rel=0.2)


def test_an_energy_that_is_kept_but_for_rounding_has_no_panel() -> None:
    """A row of dots at 1 used to fill a third of the page."""
    rates = {"balls[1].angle": np.linspace(-1.4, -1.0, 9)}
    elastic = example("one_circle").replace({"collision.k": 1.0, "stop.collisions": 40})
    grid = sweep(elastic, rates).stored
    left = np.asarray(grid.summary["energy_end"]) / np.asarray(grid.summary["energy_start"])
    assert 0.0 < np.ptp(left) < 1e-12
    figure = curves(grid)
    assert figure is not None
    assert [axes.get_ylabel() for axes in figure.axes] == ["impacts", "first impact [s]"]
