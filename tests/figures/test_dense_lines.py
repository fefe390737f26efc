"""Very many points of a run: all that is drawn belongs to the motion, and covers all of it."""

import math
import re
import tracemalloc
from io import BytesIO
from typing import Any

import numpy as np
import pytest
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection, PatchCollection, PathCollection
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.image import imread
from matplotlib.text import Annotation

from tests.effort import calls
from tests.figures.layout import assert_texts_are_apart, texts
from tests.gallery import run_of
from vibro_cli import example, simulate
from vibro_cli.analysis.levels import Landscape
from vibro_cli.api import simulate as simulate_any
from vibro_cli.figures.chart import draw_by_colour
from vibro_cli.figures.portraits.trajectory import MOST_BRANCHES, trajectory
from vibro_cli.figures.runs import over_impacts, over_time
from vibro_cli.figures.runs.over_time import (
    energies,
    energy_course,
    energy_lines,
    seen,
    space_time,
    timeline,
)
from vibro_cli.figures.style import render
from vibro_cli.scenario import any_scenario_of
from vibro_cli.systems import NAMES as SYSTEMS
from vibro_cli.systems import system_named
from vibro_cli.systems.springs.figures import springs_energy
from vibro_cli.systems.table.figures import table_contact_points, table_energies, table_velocities
from vibro_cli.systems.table.plan import MOST_LINES, table_plan


def test_a_thinned_line_has_points_of_the_line_and_its_extremes() -> None:
    draw = np.random.default_rng(1)
    time = np.sort(draw.uniform(0.0, 50.0, 300_000))
    values = np.sin(time) + draw.normal(0.0, 0.1, len(time))
    thin_time, thin = seen([(time, values)])
    assert len(thin) < 11_000
    assert set(zip(thin_time.tolist(), thin.tolist(), strict=True)) <= set(
        zip(time.tolist(), values.tolist(), strict=True)
    )
    for low in np.linspace(time[0], time[-1], 101)[:-1]:
        within = (time >= low) & (time <= low + 0.5)
        kept = (thin_time >= low - 0.02) & (thin_time <= low + 0.52)
        assert thin[kept].min() <= values[within].min()
        assert thin[kept].max() >= values[within].max()


def test_very_many_flights_without_any_error_lie_on_the_lower_edge(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """On a level line no flight changes its energy: the figure of more than 200,000 failed."""
    run = run_of("horizontal_line_1_2")
    monkeypatch.setattr(over_impacts, "MOST_VECTOR_POINTS", 0)
    figure = over_impacts.accuracy(run)
    assert figure is not None
    (errors, _) = figure.axes[-1].lines
    free = ~run.flights()["contact"] & (run.flights()["cause_end"] != "contact_closed")
    assert set(np.asarray(errors.get_xdata())) == set(run.flights()["t_end"][free])
    assert set(np.asarray(errors.get_ydata())) == {figure.axes[-1].get_ylim()[0]}


def test_a_line_of_few_points_is_as_it_is() -> None:
    time = np.linspace(0.0, 1.0, 50)
    np.testing.assert_array_equal(seen([(time[:20], time[:20]), (time[20:], time[20:])])[0], time)


def test_dense_marks_are_where_the_points_are_on_any_scale() -> None:
    axes = (figure := Figure(figsize=(4.0, 3.0))).add_axes((0.1, 0.1, 0.8, 0.8))
    axes.set_yscale("log")
    axes.set_xlim(0.0, 10.0)
    axes.set_ylim(1e-3, 1e3)
    axes.set_axis_off()
    across, along = np.array([2.5, 7.5, 5.0, 11.0]), np.array([1.0, 10.0, 0.0, 1.0])
    black = ScalarMappable(Normalize(0.0, 1.0), ListedColormap(["#000000"]))
    look: Any = {"marker": "o", "markersize": 1.0, "markeredgewidth": 0.0}
    draw_by_colour(axes, across, along, np.ones(4), black, **look)
    shown = imread(BytesIO(render(figure, "png", 300.0)))[::-1, :, 0]
    rows, columns = np.nonzero(shown < 0.5)
    high, wide = shown.shape
    place, level = ((columns + 0.5) / wide - 0.1) / 0.8, ((rows + 0.5) / high - 0.1) / 0.8
    places = place * 10.0, 10.0 ** (level * 6.0 - 3.0)
    for one, other in zip(across[:2], along[:2], strict=True):
        near = (np.abs(places[0] - one) < 0.05) & (np.abs(np.log10(places[1] / other)) < 0.05)
        assert near.any()
    # Each is a disc of 0.35 mm in pixels of 0.085 mm; a value of 0 and one beyond are not there.
    assert 20 < len(rows) < 40


def test_energies_on_springs_take_as_many_calls_for_ten_times_as_many_impacts() -> None:
    def needed(impacts: int) -> int:
        stop = {"stop.collisions": impacts, "stop.time": 1e6, "collision.k": 1}
        run = simulate(example("two_disks").replace(stop)).solved
        return calls(lambda: springs_energy(run, 1, run.end_time))

    assert needed(2000) < 1.2 * needed(200)


def test_paths_of_a_long_run_on_a_table_end_together_before_they_are_a_stain() -> None:
    stop = {"stop.time": 2000, "collision.k": 1, "wall.k": 1}
    run = simulate(example("billiards").replace(stop)).solved
    figure = table_plan(run)
    axes = figure.axes[0]
    (until,) = re.findall(r"the first (\S+) s of 2000 s", axes.get_xlabel())
    paths = [one.get_segments() for one in axes.collections if isinstance(one, LineCollection)]
    balls = len(run.system.bodies)
    assert sum(len(path) for path in paths) <= MOST_LINES + balls
    ends = run.sample([float(until)])
    for ball, path in enumerate(paths):
        end = np.asarray(path[-1])[-1]
        slack = 0.001 * float(until) * (ends["speed"][ball] + 0.1)  # the label has three digits
        assert np.hypot(*(end - [ends["x"][ball], ends["y"][ball]])) < slack
    assert_texts_are_apart(figure)


def test_paths_of_very_many_balls_are_seen_and_end_together() -> None:
    """Each of 700 balls has a path; arrows are shorter than twice the distance between balls."""
    rng = np.random.default_rng(3)
    balls = [
        {
            "radius": 0.3, "mass": 1.0, "x": n % 28, "y": n // 28,
            "velocity_x": rng.normal(), "velocity_y": rng.normal(),
        }
        for n in range(700)
    ]  # fmt: skip
    scenario = {"system": "table", "balls": balls, "collision": {"k": 1.0}, "stop": {"time": 2.0}}
    run = simulate(any_scenario_of(scenario)).solved
    axes = table_plan(run).axes[0]
    (until,) = re.findall(r"the first (\S+) s of 2 s", axes.get_xlabel())
    paths = [one.get_segments() for one in axes.collections if isinstance(one, LineCollection)]
    events = 2 * int(np.sum(run.collisions["t"] <= float(until)))
    assert len(paths) == 700
    assert abs(events - 700) < 5  # and 700 first flights
    ends = run.sample([float(until)])
    drawn = np.array([np.asarray(path[-1])[-1] for path in paths]).T
    wanted = [[ends[f"{axis}"][n] for n in range(700)] for axis in "xy"]
    np.testing.assert_allclose(drawn, wanted, atol=0.01 * float(until) * 5.0)
    lengths = [
        np.hypot(*np.subtract(one.xy, one.xyann))
        for one in axes.texts
        if isinstance(one, Annotation)
    ]
    assert len(lengths) >= 700
    assert max(lengths) < 2.0
    assert not [text for text in axes.texts if text.get_text().isdigit()]


def test_thousands_of_balls_are_drawn_at_their_starts_by_two_artists() -> None:
    """Positions and radii are those of the scenario; one artist per ball took most of a run."""
    count = 300
    balls = [
        {"radius": 0.1 + 0.001 * n, "mass": 1.0, "x": n % 20, "y": n // 20, "velocity_x": 0.1}
        for n in range(count)
    ]
    scenario = {"system": "table", "balls": balls, "collision": {"k": 1.0}, "stop": {"time": 1.0}}
    axes = table_plan(simulate(any_scenario_of(scenario)).solved).axes[0]
    assert len(axes.patches) == 1  # of the scale
    (discs,) = (one for one in axes.collections if isinstance(one, PatchCollection))
    (centres,) = (one for one in axes.collections if isinstance(one, PathCollection))
    wanted = np.array([[ball["x"], ball["y"]] for ball in balls])
    np.testing.assert_array_equal(centres.get_offsets(), wanted)
    edges = [path.get_extents() for path in discs.get_paths()]
    radii = np.array([[ball["radius"]] for ball in balls])
    np.testing.assert_allclose([edge.min for edge in edges], wanted - radii, atol=1e-14)
    np.testing.assert_allclose([edge.max for edge in edges], wanted + radii, atol=1e-14)


@pytest.mark.parametrize(("bodies", "until"), [(8, 400_000.0), (16, 800_000.0)])
def test_a_sum_of_energies_needs_no_more_memory_for_more_bodies(bodies: int, until: float) -> None:
    """For eight bodies it takes less than their energies at every instant would."""
    times = [np.repeat(np.arange(n % 8, until, 8.0), 2) for n in range(bodies)]
    courses = [(time, np.arange(len(time), dtype=np.float64)) for time in times]
    tracemalloc.start()
    lines = energy_lines(courses)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert lines.total is not None
    at, total = lines.total
    wanted = np.sum([np.interp(at, *course) for course in courses], axis=0)
    np.testing.assert_array_equal(total, wanted)
    assert peak < 8 * (2 * 400_000 * 8)
    assert len(at) < 20_000


@pytest.mark.parametrize("width", ["single", "double"])
def test_numbers_of_many_digits_have_room_in_the_figures_of_an_impact(width: str) -> None:
    """Balls 1199 and 1200 collide at an angle; no ball before them is met."""
    balls: list[Any] = [
        {"radius": 0.1, "mass": 1.0, "x": n % 40, "y": n // 40} for n in range(1200)
    ]
    balls[-2] |= {"velocity_x": 1.2345, "velocity_y": 0.1234}
    scenario = {"system": "table", "balls": balls, "collision": {"k": 0.5}, "stop": {"time": 1.0}}
    run = simulate(any_scenario_of(scenario)).solved
    velocities, points = table_velocities(run, width), table_contact_points(run, width)
    assert velocities is not None
    assert points is not None
    assert_texts_are_apart(velocities)
    assert_texts_are_apart(points)
    assert r"$T_{1199,2}$" in {text.get_text() for text in texts(points)}


@pytest.mark.parametrize(("fastest", "bodies"), [(1.0, 0), (5.0, 300)])
def test_energies_that_all_lie_on_the_axis_are_left_out(fastest: float, bodies: int) -> None:
    """Of 300 equal balls each has a 300th of the sum, 25 times that the one five times as fast."""
    balls = [
        {"radius": 0.1, "mass": 1.0, "x": n % 20, "y": n // 20, "velocity_x": (-1.0) ** n}
        for n in range(300)
    ]
    balls[0]["velocity_x"] = -fastest  # away from all others
    scenario = {"system": "table", "balls": balls, "collision": {"k": 0.5}, "stop": {"time": 1.0}}
    figure = table_energies(simulate(any_scenario_of(scenario)).solved)
    assert figure is not None
    *each, total = figure.axes[0].lines
    assert len(each) == bodies
    speeds = np.array([ball["velocity_x"] for ball in balls])
    start = 0.5 * 1.4 * np.sum(speeds**2)  # of rolling balls
    assert np.asarray(total.get_ydata())[0] == pytest.approx(start, rel=1e-14)
    assert figure.axes[0].get_ylim()[1] >= start
    named = {text.get_text() for text in texts(figure)}
    assert "sum" in named
    assert ("body 1" in named) == (bodies > 0)


def test_energies_of_thousands_of_impacts_are_means_of_the_motion() -> None:
    """Against the mean of many samples of the run within each of some windows."""
    stop = {"stop.collisions": 3000, "stop.time": 1e6, "collision.k": 1}
    run = simulate(example("five_balls").replace(stop)).solved
    figure = energies(run)
    assert_texts_are_apart(figure)
    (words,) = re.findall(r"means over (\S+) s:", " ".join(t.get_text() for t in texts(figure)))
    window = float(words)
    end = float(np.max(run.flights()["t_end"]))
    assert end / 100.0 <= window <= end / 40.0
    axes = figure.axes[0]
    for ball in (1, 3):
        time, mean = map(np.asarray, axes.lines[5 + ball - 1].get_data())
        assert end - window < time[-1] <= end
        for first in (0, len(time) // 4 * 2, len(time) - 2):
            assert time[first + 1] - time[first] == pytest.approx(window)
            at = time[first] + window * (np.arange(8000) + 0.5) / 8000
            sample = run.sample(at)
            energy = sample["energy"][sample["ball"] == ball]
            assert mean[first] == pytest.approx(np.mean(energy), rel=0.01)
            assert mean[first + 1] == mean[first]


@pytest.mark.parametrize("name", SYSTEMS)
def test_the_caption_of_energies_says_of_the_means(name: str) -> None:
    caption = system_named(name).figures["energy"].caption
    words = "several bodies jump very often, their means over equal intervals are drawn"
    assert f"If the energies of {words}" in caption


def test_energies_of_few_impacts_are_steps() -> None:
    run = simulate(example("five_balls").replace({"stop.collisions": 60})).solved
    assert not re.search("means", " ".join(t.get_text() for t in texts(energies(run))))


def rotating(angle: float, rate: float, time: float, bodies: int) -> Any:
    """Bodies in a rotating valley whose bottom is 1 m below the axis, the others touching."""
    first = {"radius": 0.1, "density": 7800.0, "arc": 1, "angle": angle}
    other = {"radius": 0.1, "density": 7800.0, "arc": 1, "touching": "previous"}
    arcs = [{"shape": "valley", "radius": 1.1, "end_slope": 1.0}]
    document = {
        "gravity": 9.81,
        "trace": {"start_slope": -1.0, "turning": {"through_arc": 1, "rate": rate}, "arcs": arcs},
        "balls": [first, *[other] * (bodies - 1)],
        "collision": {"k": 0.0},
        "stop": {"time": time},
    }
    return simulate_any(any_scenario_of(document))


@pytest.mark.parametrize(
    ("angle", "below", "turns"), [(0.0, 0.0, 0), (1e-6, 0.0, 0), (1e-3, 1e-5, 3)]
)
def test_a_motion_much_slower_than_its_fastest_rate_is_sampled_as_it_is_drawn(
    angle: float, below: float, turns: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Near the rate at which the bottom ceases to be a centre, and at rest there, for very long."""
    run = rotating(angle, math.sqrt(9.81 * (1.0 - below)), 3e5, 1)
    asked, curve = [], type(run).flight_curve

    def counted(run: Any, row: int, count: int, *lasts: float) -> Any:
        asked.append(count)
        return curve(run, row, count, *lasts)

    monkeypatch.setattr(type(run), "flight_curve", counted)
    branches = trajectory(run, 1).branches[0]
    position, rate = branches.position[0], branches.rate[0]
    assert sum(asked) < 30 * len(position)
    assert np.sum(rate[1:] * rate[:-1] < 0.0) == turns
    lasts = 3e5 if not turns else 2.0 * math.tau * math.sqrt(1.4 / 9.81 / below)
    fine = run.sample(np.linspace(0.0, lasts, 32 * (len(position) - 1) + 1))
    if not turns:
        wanted = fine["angle"][::32]
        np.testing.assert_allclose(position, wanted, rtol=0.0, atol=1e-12 * angle)
        return
    assert np.ptp(position) == pytest.approx(2.0 * angle, rel=1e-3)
    scales = np.array([np.ptp(position), np.ptp(rate)])
    states = np.column_stack([fine["angle"], fine["speed"] / 1.0]) / scales  # 1 m from the centre
    for state in np.column_stack([position, rate]) / scales:
        assert np.min(np.hypot(*(states - state).T)) < 1e-3


def test_energies_in_contact_for_very_many_periods_are_sampled_as_they_are_seen() -> None:
    run = rotating(-0.1, 3.0, 1e6, 2)
    time, energy = energy_course(run, 1)
    assert len(time) < 600_000
    assert time[-1] == 1e6
    _, few = energy_course(run, 1, 100.0)
    for end in (np.min, np.max):
        assert end(energy) == pytest.approx(end(few), abs=1e-3 * np.ptp(few))


def test_of_many_branches_those_of_one_passage_are_drawn_on_every_piece() -> None:
    """A body comes to the left valley over the hump alone, with the energy that it has there."""
    walls = "ends={left={wall=1.0},right={wall=1.0}}"
    run = run_of("three_arcs", "collision.k=1", "stop={collisions=20000}", walls)
    path, hills = trajectory(run, 1), Landscape.of(run.system, 1)
    assert path.every > 5
    left, hump, _ = (
        hills.energy(piece, branches.position[:, 0], branches.rate[:, 0])
        for piece, branches in zip(run.system.trace.pieces, path.branches, strict=True)
    )
    assert len(left) > 100
    apart = np.abs(np.subtract.outer(left, hump)).min(axis=1)
    assert np.mean(apart < 1e-9 * left) > 0.95
    assert sum(len(branches.time) for branches in path.branches) < 1.5 * MOST_BRANCHES


@pytest.mark.parametrize(("pairs", "drawn"), [(10, 20), (200, 0)])
def test_junctions_are_drawn_unless_they_merge_into_grey(pairs: int, drawn: int) -> None:
    wave = [
        {"shape": "valley", "radius": 1.0, "end_slope": "40 deg"},
        {"shape": "hump", "radius": 1.0, "end_slope": "-40 deg"},
    ]
    ball = {"radius": 0.1, "mass": 1.0, "angle": 0.0, "rate": 4.0}
    data = {
        "gravity": 9.81,
        "trace": {"start_slope": "-40 deg", "arcs": [*wave * pairs, wave[0]]},
        "balls": [ball | {"arc": 1}, ball | {"arc": 2 * pairs + 1, "rate": 0.0}],
        "collision": {"k": 1.0},
        "stop": {"time": 1.0},
    }
    run = simulate(any_scenario_of(data)).solved
    figure = space_time(run)
    assert figure is not None
    starts = {piece.start_s for piece in run.system.trace.pieces[1:]}
    level = [set(np.asarray(one.get_ydata()).tolist()) for one in figure.axes[0].lines]
    assert sum(len(one) == 1 and one <= starts for one in level) == drawn


def test_a_line_over_time_that_is_sampled_in_parts_is_that_of_one_sample(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(over_time, "_AT_ONCE", 500)
    run = simulate_any(example("three_arcs").replace({"stop.time": 1.0}))
    for ball in (1, 2):
        time, way = timeline(run, ball, 1.0)
        assert len(time) > 1000
        assert way.tolist() == run.sample(time)["s"][ball - 1 :: 2].tolist()
