"""Figures of bodies on springs and of tables: nothing overlaps, and the legends are complete."""

from __future__ import annotations

import math
import re
from functools import cache
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_hex
from matplotlib.image import imread
from matplotlib.patches import Polygon
from matplotlib.path import Path as Polyline
from matplotlib.text import Annotation

from tests.figures.layout import assert_texts_are_apart, texts
from vibro_cli.api import simulate
from vibro_cli.assemble import build_any
from vibro_cli.figures import style
from vibro_cli.figures.chart import body_look
from vibro_cli.figures.kinds import draw_all
from vibro_cli.scenario import any_scenario_of
from vibro_cli.scenario.loading import load_any
from vibro_cli.systems import NAMES
from vibro_cli.systems.springs.figures import springs_places, springs_scene
from vibro_cli.systems.springs.portrait import (
    springs_background,
    springs_portrait,
    springs_structure,
)
from vibro_cli.systems.table.figures import (
    table_contact_points,
    table_energies,
    table_velocities,
)
from vibro_cli.systems.table.plan import table_plan
from vibro_cli.systems.table.portrait import has_wall_portrait, wall_portrait

pytestmark = pytest.mark.long

FOLDER = Path(__file__).parents[2] / "scenarios"
PATHS = sorted(path for name in NAMES[1:] for path in FOLDER.glob(f"{name}/*.toml"))
LONG = {
    "two_disks": ("stop.time=6000",),
    "common_origin": ("stop.time=200", "collision.k=1"),
    "stressed_at_rest": ("stop.time=500",),
    "elliptic_wall": ("stop.bounces=1000", "stop.time=1e6"),
    "billiards": ("collision.k=1", "wall.k=1"),
    "convex_wall": (),
    "skew_impact": ("collision.k=1",),
}


@cache
def run_of(path: Path, *overrides: str) -> Any:
    return simulate(load_any(path, [*overrides]))


def shown_texts(figure: Any) -> set[str]:
    return {text.get_text() for text in texts(figure)}


@pytest.mark.parametrize("width", ["single", "double"])
@pytest.mark.parametrize("path", PATHS, ids=lambda path: path.stem)
def test_no_text_is_cut_off_or_overlaps_another(path: Path, width: str) -> None:
    for overrides in ((), LONG[path.stem]):
        for drawn in draw_all(run_of(path, *overrides), None, width):
            assert_texts_are_apart(drawn.figure)


@pytest.mark.parametrize("width", ["single", "double"])
@pytest.mark.parametrize("path", PATHS, ids=lambda path: path.stem)
def test_portraits_without_a_run_have_their_texts_apart(path: Path, width: str) -> None:
    system = run_of(path).system
    if path.parent.name == "springs":
        for ball in range(1, len(system.bodies) + 1):
            assert_texts_are_apart(springs_structure(system, ball, width))
    elif path.parent.name == "table" and has_wall_portrait(system.wall):
        assert_texts_are_apart(wall_portrait(system, 1, width))


def test_portraits_of_springs_name_what_they_show() -> None:
    two = run_of(FOLDER / "springs/two_disks.toml")
    names = shown_texts(springs_portrait(two, 1))
    assert {"start", "before", "after impact", "figure eight", "level", "centre", "saddle"} <= names
    assert "lasting contact" not in names
    three = run_of(FOLDER / "springs/stressed_at_rest.toml")
    names = shown_texts(springs_portrait(three, 2))
    assert {"start", "jump", "lasting contact", "level", "centre"} <= names
    last = np.max(three.collisions["t"][three.collisions["ball_b"] == 2])
    assert f"{last:.4g}" in names  # the end of the colours of time
    assert "separatrix" not in names


def test_every_ball_of_a_table_is_named_with_its_energy() -> None:
    run = run_of(FOLDER / "table/billiards.toml")
    figure = table_energies(run)
    assert figure is not None
    assert {str(ball) for ball in range(1, 11)} | {"sum", "loss"} <= shown_texts(figure)


@pytest.mark.parametrize("name", ["two_disks", "stressed_at_rest"])
def test_places_over_time_are_those_of_the_run(name: str) -> None:
    run = run_of(FOLDER / f"springs/{name}.toml")
    axes = springs_places(run).axes[0]
    for ball in range(1, len(run.system.bodies) + 1):
        time, place = (np.asarray(one) for one in axes.lines[2 * ball - 2].get_data())
        assert np.all(np.diff(time) >= 0.0)
        assert time[-1] == run.end_time
        sample = run.sample(time[::5])
        exact = sample["x"][sample["ball"] == ball]
        assert np.max(np.abs(place[::5] - exact)) < 1e-4 * np.ptp(place)
        assert np.max(np.diff(time)) < 0.2


def _arrows(axes: Axes) -> list[tuple[float, str]]:
    """Return the lengths (m) of the arrows of a picture, and the colours of their edges."""
    found = [text for text in axes.texts if isinstance(text, Annotation) and text.arrow_patch]
    ends = np.array([np.subtract(one.xy, one.xyann) for one in found])
    edges = [to_hex(one.arrow_patch.get_edgecolor()) for one in found if one.arrow_patch]
    return list(zip(np.hypot(*ends.T).tolist(), edges, strict=True))


def _scale(axes: Axes) -> float:
    """Return the length (m) of 1 m/s, from the scale arrow with its head, and its label."""
    (speed,) = (one[1] for text in axes.texts if (one := re.fullmatch("(.*) m/s", text.get_text())))
    (shaft,) = (line for line in axes.lines if not line.get_clip_on())
    polygons = (patch for patch in axes.patches if isinstance(patch, Polygon))
    (head,) = (patch for patch in polygons if not patch.get_clip_on())
    parts = (shaft, shaft.get_xydata()), (head, head.get_xy())
    shown = np.concatenate([part.get_transform().transform(points) for part, points in parts])
    return float(np.ptp(axes.transData.inverted().transform(shown)[:, 0])) / float(speed)


@pytest.mark.parametrize("name", ["billiards", "skew_impact", "elliptic_wall"])
def test_arrows_on_a_table_are_told_from_paths_and_have_a_scale(name: str) -> None:
    run = run_of(FOLDER / f"table/{name}.toml")
    axes = table_plan(run).axes[0]
    lengths, colours = zip(*_arrows(axes), strict=True)
    assert set(colours) == {to_hex(style.BLACK)}
    assert style.BLACK not in {body_look(ball)["color"] for ball in range(1, 13)}
    ends = [(run.collisions, "_a"), (run.collisions, "_b"), (run.bounces, "")]
    speeds = [math.hypot(*state.velocity) for state in run.system.initial]
    for table, end in ends:
        for when in ("pre", "post"):
            parts = (table[f"velocity_{axis}{end}_{when}"] for axis in "xy")
            speeds += np.hypot(*parts).tolist()
    moving = sorted(speed for speed in speeds if speed > 0.0)
    assert sorted(lengths) == pytest.approx(np.multiply(_scale(axes), moving), abs=1e-9)


def test_the_figure_eight_of_a_spring_is_one_curve_through_its_saddle() -> None:
    """However the energy of the saddle is rounded: springs of many sizes."""
    random = np.random.default_rng(3)
    for _ in range(60):
        height, stiffness = random.uniform(0.5, 2.0), random.uniform(1.0, 9.0)
        longer = 10.0 ** random.uniform(-6.0, 0.5)
        length = height * (1.0 + longer)
        held = {"height": height, "length": length, "stiffness": stiffness, "foot": 0.0}
        body = {"body": "disk", "radius": 0.1, "mass": 1.0, "position": 0.5, "spring": held}
        (eight,) = springs_background(_alone(body), 0, 1.0).eights
        (at_saddle,) = np.flatnonzero(eight.position == 0.0)
        assert eight.rate[at_saddle] == 0.0
        ends = eight.position[[0, -1]]
        # The energy of the saddle is that of the turning points: s + s_0 = 2 l.
        turns = math.sqrt((2.0 * length - height) ** 2 - height**2)
        np.testing.assert_allclose(ends, [-turns, turns], rtol=1e-9)


@pytest.mark.parametrize("size", [1.0, 2.0**-30])
@pytest.mark.parametrize(("length", "away"), [(2.0, 1e-3), (2.0, 1e-9), (0.5, 1e-3)])
def test_a_small_oscillation_on_a_spring_is_shown_close_up(
    length: float, away: float, size: float
) -> None:
    """Its curve fills both axes, and its energy is among those of the spring."""
    centre = math.sqrt(3.0) if length > 1.0 else 0.0
    upper, lower = _portrait_from(centre + away, length, size).axes
    (curve,) = (one for one in upper.collections if one.get_zorder() == 2.0)
    assert isinstance(curve, LineCollection)
    places = np.concatenate([np.asarray(one) for one in curve.get_segments()])
    assert np.ptp(places[:, 0]) > 0.3 * np.ptp(upper.get_xlim())
    assert np.ptp(places[:, 1]) > 0.3 * np.ptp(upper.get_ylim())
    low, high = lower.get_ylim()
    energies = np.asarray(lower.lines[0].get_ydata())
    assert np.count_nonzero((energies > low) & (energies < high)) > 0.2 * len(energies)


@pytest.mark.parametrize("size", [1.0, 2.0**-30])
def test_a_body_at_rest_up_to_rounding_is_drawn_among_the_level_curves(size: float) -> None:
    """At a stressed centre, whose place is rounded, it seems to move by less than an ulp."""
    upper, lower = _portrait_from(math.sqrt(3.0), 2.0, size).axes
    curves = [one for one in upper.collections if isinstance(one, LineCollection)]
    rates = np.concatenate(
        [np.asarray(line)[:, 1] for one in curves for line in one.get_segments()]
    )
    assert 0.5 < np.ptp(rates) / np.ptp(upper.get_ylim()) < 1.0
    energies = np.asarray(lower.lines[0].get_ydata())
    assert 0.5 < np.ptp(energies) / np.ptp(lower.get_ylim()) < 1.0


def _portrait_from(position: float, length: float, size: float) -> Any:
    """Return the portrait of a body that is let go 1 m beside the line of its spring's foot.

    Lengths in m times `size`.
    """
    held = {"height": size, "length": length * size, "stiffness": 4.0, "foot": 0.0}
    body = {"body": "disk", "radius": 0.1 * size, "mass": 1.0, "position": position * size}
    data = {"system": "springs", "balls": [body | {"spring": held}], "stop": {"time": 20.0}}
    return springs_portrait(simulate(any_scenario_of(data)), 1)


def _alone(body: dict[str, Any]) -> Any:
    """Return the system of one body on its spring."""
    return build_any(any_scenario_of({"system": "springs", "balls": [body], "stop": {"time": 1.0}}))


def test_the_outline_of_a_small_body_on_a_spring_does_not_cross_its_name() -> None:
    """The edge of the body used to cross the C, and looked like a part of the letter."""
    balls: list[dict[str, Any]] = [
        {"radius": 0.1, "mass": 1.0, "position": place, "speed": 1.0,
         "spring": {"stiffness": 20.0, "length": 1.2, "height": 0.5, "foot": foot}}
        for place, foot in ((-1.5, -0.6), (1.9, 1.0))
    ]  # fmt: skip
    data = {"system": "springs", "balls": balls, "collision": {"k": 1.0}, "stop": {"time": 0.1}}
    axes = springs_scene(simulate(any_scenario_of(data)), "double").axes[0]
    turn = np.linspace(0.0, 2.0 * np.pi, 720)
    for number, ball in enumerate(balls, 1):
        (name,) = (text for text in axes.texts if text.get_text() == f"$C_{{{number}}}$")
        edge = np.column_stack([ball["position"] + 0.1 * np.cos(turn), 0.1 * np.sin(turn)])
        box = name.get_window_extent()
        assert not any(box.contains(x, y) for x, y in axes.transData.transform(edge))


def test_numbers_of_balls_on_one_line_stand_beside_their_arrows() -> None:
    """Each is struck by the one before it; the arrows used to cross the numbers."""
    balls = [{"radius": 0.05, "mass": 1.0, "x": 0.1001 * n, "y": 0.0} for n in range(4)]
    balls[0] |= {"x": -0.05, "velocity_x": 1.0}
    data = {"system": "table", "balls": balls, "collision": {"k": 1.0}, "stop": {"time": 0.5}}
    axes = table_plan(simulate(any_scenario_of(data)), "double").axes[0]
    numbers = [text for text in axes.texts if text.get_text().isdigit()]
    assert sorted(text.get_text() for text in numbers) == ["1", "2", "3", "4"]
    along = axes.transData.transform((0.0, 0.0))[1]
    for text in numbers:
        low, high = text.get_window_extent().intervaly
        assert not low < along < high


@pytest.mark.parametrize("speed", [0.02, 1.0, 3e-7, 4e8, 5e-31])
@pytest.mark.parametrize("width", ["single", "double"])
def test_the_scale_of_a_plan_is_clear_of_the_legend(speed: float, width: str) -> None:
    """Its arrow, too, however long the number of the speed is."""
    wall = {"shape": "rectangle", "width": 1.0, "depth": 1.0, "k": 1.0}
    ball = {"radius": 0.05, "mass": 1.0, "x": 0.0, "y": 0.0, "velocity_x": speed}
    data = {"system": "table", "wall": wall, "balls": [ball], "stop": {"bounces": 3}}
    figure = table_plan(simulate(any_scenario_of(data)), width)
    assert_texts_are_apart(figure)
    (axes,), (legend,) = figure.axes, figure.legends
    (arrow,) = (line for line in axes.lines if not line.get_clip_on())
    (number,) = (text for text in axes.texts if text.get_text().endswith("m/s"))
    end = legend.get_window_extent().x1
    assert end < arrow.get_window_extent().x0
    assert arrow.get_window_extent().x1 < number.get_window_extent().x0


def test_a_plan_of_a_tall_table_fits_a_page() -> None:
    """Journals of Springer take 234 mm at most."""
    wall = {"shape": "rectangle", "width": 0.5, "depth": 3.0, "k": 1.0}
    ball = {"radius": 0.05, "mass": 1.0, "x": 0.0, "y": 0.0, "velocity_y": 1.0}
    data = {"system": "table", "wall": wall, "balls": [ball], "stop": {"bounces": 3}}
    figure = table_plan(simulate(any_scenario_of(data)), "double")
    assert figure.get_size_inches()[1] * 25.4 <= 234.0


def test_an_arrow_whose_head_is_beyond_the_panel_is_drawn() -> None:
    """The fastest of two balls starts beside the wall and moves towards it: black on its way."""
    fast, slow = (0.47, 0.0), (-0.3, 0.2)
    balls = [
        {"radius": 0.02, "mass": 1.0, "x": x, "y": y, "velocity_x": speed}
        for (x, y), speed in ((fast, 2.0), (slow, 0.5))
    ]
    wall = {"shape": "rectangle", "width": 1.0, "depth": 1.0, "k": 1.0}
    scenario = {"system": "table", "wall": wall, "balls": balls, "collision": {"k": 1.0}}
    figure = table_plan(simulate(any_scenario_of(scenario | {"stop": {"time": 0.004}})))
    file = BytesIO()
    figure.savefig(file, dpi=figure.dpi)
    file.seek(0)
    axes, pixels = figure.axes[0], imread(file)
    for (x, y), speed in ((fast, 2.0), (slow, 0.5)):
        across, up = axes.transData.transform((x + 0.4 * speed * _scale(axes), y))
        near = pixels[len(pixels) - int(up) - 4 : len(pixels) - int(up) + 3, int(across), :3]
        assert near.max(axis=1).min() < 0.5


@pytest.mark.parametrize("name", ["two_disks", "stressed_at_rest", "common_origin"])
def test_arrows_of_bodies_on_springs_are_as_long_as_their_speeds(name: str) -> None:
    run = run_of(FOLDER / f"springs/{name}.toml")
    panels = springs_scene(run).axes
    scale, table = _scale(panels[0]), run.collisions
    for row, axes in enumerate(panels[1:]):
        lengths = [length / scale for length, _ in _arrows(axes)]
        speeds = np.abs(run.sample([table["t"][row]])["speed"])
        assert lengths == pytest.approx(speeds[speeds > 0.0])
        for end in "ab":
            assert any(
                length == pytest.approx(abs(table[f"speed_{end}_post"][row]), abs=1e-9)
                for length in [*lengths, 0.0]
            )


def test_names_on_the_scene_of_springs_stand_beside_the_coils() -> None:
    """Not over their straight parts either, between the corners of the zigzag."""
    spring = {"stiffness": 40.0, "length": 0.12, "height": 0.06, "foot": 0.0}
    other = {"stiffness": 60.0, "length": 0.08, "height": 0.08, "foot": 0.05}
    disk = {"body": "disk", "radius": 0.02}
    first = disk | {"mass": 0.2, "position": -0.15, "spring": spring}
    second = disk | {"mass": 0.3, "position": 0.1, "speed": -0.5, "spring": other}
    data = {"system": "springs", "balls": [first, second]}
    run = simulate(any_scenario_of(data | {"collision": {"k": 0.95}, "stop": {"time": 2}}))
    figure = springs_scene(run)
    figure.draw_without_rendering()
    for axes in figure.axes:
        coils = [line for line in axes.lines if len(np.asarray(line.get_xydata())) > 10]
        assert len(coils) == 2
        heights = [text for text in axes.texts if text.get_text().startswith("$b_")]
        assert len(heights) == 2
        for name in heights:
            box = name.get_window_extent()
            for coil in coils:
                drawn = coil.get_path().transformed(coil.get_transform())
                assert not drawn.intersects_bbox(box.padded(-0.15 * box.height), filled=False)


@pytest.mark.parametrize("name", ["skew_impact", "convex_wall"])
def test_a_prime_does_not_push_the_index_of_an_angle_towards_the_panel(name: str) -> None:
    figure = table_velocities(run_of(FOLDER / f"table/{name}.toml"))
    assert figure is not None
    figure.set_dpi(300)
    figure.canvas.draw()
    above = {
        bool(re.search("[′']", text.get_text())): text.get_window_extent().y0
        - axes.get_window_extent().y1
        for axes in figure.axes
        for text in axes.texts
        if r"\alpha" in text.get_text() and text.get_transform() == axes.transAxes
    }
    assert above[True] == pytest.approx(above[False], abs=1.0)
    assert above[True] > 0.0


def test_names_of_possible_contact_points_stand_beside_the_tangent_planes() -> None:
    """Over none of the lines through T that are as long as these."""
    run = run_of(FOLDER / "table" / "elliptic_wall.toml", "balls[1].x=-0.8")
    assert _planes_beside_names(run) == 3  # one from the side, two from above


@pytest.mark.parametrize("beside", [0.02, 0.04, 0.06, 0.1, 0.13, 0.14])
def test_names_stand_beside_the_tangent_planes_at_any_angle(beside: float) -> None:
    """Also if that is farther from their points."""
    balls = [
        {"radius": 0.1, "mass": 1.0, "x": x, "y": y, "velocity_x": speed}
        for x, y, speed in ((-0.5, 0.0, 1.0), (0.5, beside, -0.5))
    ]
    data = {"system": "table", "balls": balls, "collision": {"k": 0.5}, "stop": {"time": 2.0}}
    assert _planes_beside_names(simulate(any_scenario_of(data))) == 6


@pytest.mark.parametrize("y", [0.0, 0.01])
def test_names_of_contact_points_side_by_side_cover_no_velocity(y: float) -> None:
    """Not even the edge of an arrow."""
    run = run_of(FOLDER / "table" / "skew_impact.toml", f"balls[1].y={y}")
    figure = table_contact_points(run)
    assert figure is not None
    figure.draw_without_rendering()
    for axes, body in ((figure.axes[1], 1), (figure.axes[3], 2)):
        shafts = [line for line in axes.lines if line.get_color() == body_look(body)["color"]]
        assert len(shafts) == 9
        for text in axes.texts:
            if re.fullmatch(rf"\$T_\{{{body}[23]\}}\$", text.get_text()):
                for line in shafts:
                    half = 0.5 * line.get_linewidth() * figure.dpi / 72.0
                    ends = axes.transData.transform(np.asarray(line.get_xydata()))
                    covered = text.get_window_extent().padded(half)
                    assert not Polyline(ends).intersects_bbox(covered, filled=False)


def test_contact_points_are_those_of_the_first_impact_also_on_the_wall() -> None:
    """The ball meets the wall, then the other ball: the figure is that of a run to the wall."""
    balls = [
        {"radius": 0.1, "mass": 1.0, "x": x, "y": y, "velocity_x": speed}
        for x, y, speed in ((0.7, 0.05, 1.0), (0.2, 0.0, 0.0))
    ]
    wall = {"shape": "rectangle", "width": 2.0, "depth": 2.0, "k": 1.0}
    data = {"system": "table", "wall": wall, "balls": balls, "collision": {"k": 0.5}}
    first, both = (
        table_contact_points(simulate(any_scenario_of({**data, "stop": stop})))
        for stop in ({"bounces": 1}, {"collisions": 1})
    )
    assert first is not None
    assert both is not None
    assert shown_texts(both) == shown_texts(first)
    assert len(both.axes) == len(first.axes)


def _planes_beside_names(run: Any) -> int:
    """Return the number of tangent planes in a figure; fail if a name is over one of them."""
    figure = table_contact_points(run)
    assert figure is not None
    figure.draw_without_rendering()
    found = 0
    for axes in figure.axes:
        lines = [np.asarray(line.get_xydata()) for line in axes.lines]
        across = [ends for ends in lines if 1.0 < np.hypot(*(ends[-1] - ends[0])) < 1.7]
        planes = [ends for ends in across if np.hypot(*ends.mean(axis=0)) > 0.9]  # in radii
        found += len(planes)
        for name in axes.texts:
            box = name.get_window_extent()
            for ends in planes:
                drawn = Polyline(axes.transData.transform(ends))
                assert not drawn.intersects_bbox(box.padded(-0.15 * box.height), filled=False)
    return found


def test_of_many_bodies_on_springs_each_has_its_number() -> None:
    """Of 30 bodies, the names of centres, feet and heights were on one another."""
    spring = {"stiffness": 6.0, "length": 0.5, "height": 1.0}
    balls = [
        {"radius": 0.4, "mass": 1.0, "position": 2.0 * n, "spring": spring | {"foot": 2.0 * n}}
        for n in range(30)
    ]
    data = {"system": "springs", "balls": balls, "collision": {"k": 1.0}, "stop": {"time": 0.1}}
    figure = springs_scene(simulate(any_scenario_of(data)), "double")
    assert_texts_are_apart(figure)
    names = [text.get_text() for text in figure.axes[0].texts]
    assert sorted(names, key=int) == [str(n) for n in range(1, 31)]


def test_the_paths_of_all_balls_on_a_table_have_lines_of_one_width() -> None:
    """Also if some have more flights than those above which lines are thin, and others fewer."""
    balls = [
        {"radius": 0.06, "mass": 1.0, "x": 0.4 * n - 0.7, "y": 0.1 * n - 0.2}
        | {"velocity_x": 1.0 - 0.3 * n, "velocity_y": 0.4 * n}
        for n in range(4)
    ]
    wall = {"shape": "rectangle", "width": 2.0, "depth": 1.0, "k": 1.0}
    data = {"system": "table", "wall": wall, "balls": balls, "collision": {"k": 1.0}}
    axes = table_plan(simulate(any_scenario_of(data | {"stop": {"time": 150.0}}))).axes[0]
    paths = [one for one in axes.collections if isinstance(one, LineCollection)]
    assert len(paths) == 4
    assert len({width for one in paths for width in np.atleast_1d(one.get_linewidth())}) == 1


@pytest.mark.parametrize(
    ("name", "width"), [("convex_wall", "single"), ("elliptic_wall", "double")]
)
def test_the_edge_of_a_ball_on_a_table_does_not_cross_its_number(name: str, width: str) -> None:
    run = run_of(FOLDER / f"table/{name}.toml", "balls[1].radius=0.1")
    axes = table_plan(run, width).axes[0]
    (number,) = (text for text in axes.texts if text.get_text() == "1")
    start = run.sample([0.0])
    turn = np.linspace(0.0, 2.0 * np.pi, 720)
    edge = np.column_stack([start["x"] + 0.1 * np.cos(turn), start["y"] + 0.1 * np.sin(turn)])
    box = number.get_window_extent()
    assert not any(box.contains(x, y) for x, y in axes.transData.transform(edge))
