"""Charts of a run: the values drawn, and that nothing overlaps or is cut off."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.collections import LineCollection, PathCollection
from matplotlib.patches import Circle

from tests.figures.energy import on_trace
from tests.figures.layout import assert_texts_are_apart, texts
from tests.gallery import GALLERY, run_of
from tests.scaling import scaled
from vibro_cli.api import simulate
from vibro_cli.figures.chart import contact_times
from vibro_cli.figures.kinds import PORTRAIT, draw_all
from vibro_cli.figures.portraits.energies import energy_portrait
from vibro_cli.figures.portraits.portrait import phase_portrait
from vibro_cli.figures.portraits.trajectory import trajectory
from vibro_cli.figures.runs.contact_points import contact_points
from vibro_cli.figures.runs.over_impacts import accuracy, impact_map, intervals
from vibro_cli.figures.runs.over_time import energy_course, energy_residuals, space_time, timeline
from vibro_cli.figures.runs.scene import WALL, configurations, plan, scene
from vibro_cli.figures.style import render
from vibro_cli.scenario import any_scenario_of
from vibro_cli.stress import scenes
from vibro_cli.systems.springs.portrait import springs_portrait
from vibro_cli.systems.trace.figures import FIGURES

pytestmark = pytest.mark.long

WITHOUT_PORTRAITS = [name for name in FIGURES if name != PORTRAIT]

TO_SCALE = (
    "plan",
    "velocities",
    "contact_points",
)  # pictures, with a bar of length, and values above
NAMES = sorted(path.stem for path in GALLERY.glob("*.toml"))


@pytest.mark.parametrize(
    ("name", "width"),
    [*((name, "single") for name in NAMES), ("three_arcs", "double"), ("five_balls", "double")],
)
def test_no_text_is_cut_off_or_overlaps_another(name: str, width: str) -> None:
    run = run_of(name, "stop.collisions=60")
    for drawn in draw_all(run, WITHOUT_PORTRAITS, width):
        assert_texts_are_apart(drawn.figure)


@pytest.mark.parametrize("name", ["three_arcs", "lone_particle", "closed_three_balls"])
def test_every_axis_has_a_quantity(name: str) -> None:
    for drawn in draw_all(
        run_of(name), [kind for kind in WITHOUT_PORTRAITS if kind not in TO_SCALE]
    ):
        shown = [text.get_text() for text in texts(drawn.figure)]
        for axes in (axes for axes in drawn.figure.axes if axes.get_yticks().size):
            assert axes.get_ylabel()
        assert any("[" in text or "impact $n$" in text for text in shown)


def test_places_are_those_of_the_motion() -> None:
    run = run_of("three_arcs")
    for ball in (1, 2):
        time, s = timeline(run, ball, 60.0)
        assert np.all(np.diff(time) >= 0.0)
        # where an event is at the very time, either side is right: the place is continuous
        sample = run.sample(time[::7])
        exact = sample["s"][sample["ball"] == ball]
        np.testing.assert_allclose(s[::7], exact, atol=1e-9)


def test_lines_break_at_the_seam() -> None:
    run = run_of("closed_three_balls")
    lines = [timeline(run, ball, 40.0)[1] for ball in (1, 2, 3)]
    assert any(np.any(np.isnan(line)) for line in lines)
    for line in lines:
        steps = np.abs(np.diff(line))
        assert np.nanmax(steps) < 0.5 * run.system.trace.length


def test_energies_add_up_to_those_of_the_tables() -> None:
    run = run_of("three_arcs")
    table, record = run.collisions, run.summary_record()
    courses = [energy_course(run, ball) for ball in (1, 2)]
    assert sum(energy[0] for _, energy in courses) == pytest.approx(record["energy_start"])
    assert sum(energy[-1] for _, energy in courses) == pytest.approx(record["energy_end"])
    between = 0.5 * (table["t"][1:] + table["t"][:-1])
    for (time, energy), side in zip(courses, "ab", strict=True):
        assert np.all(np.diff(time) >= 0.0)
        drawn = np.interp(between, time, energy)
        np.testing.assert_allclose(drawn, table[f"energy_{side}_post"][:-1], rtol=1e-12)


def test_the_sum_is_constant_in_lasting_contact() -> None:
    run = run_of("three_arcs")
    ((start, end),) = contact_times(run)
    times = np.linspace(start, end, 3001)[1:-1]
    total = sum(np.interp(times, *energy_course(run, ball)) for ball in (1, 2))
    assert np.ptp(total) < 2e-3 * np.max(total)  # what straight lines between samples leave


def test_the_energy_error_is_that_of_rounding() -> None:
    error = np.concatenate([change for _, change in energy_residuals(run_of("three_arcs"))])
    assert len(error) > 200
    assert 0.0 < float(np.max(np.abs(error))) < 1e-14


def test_configurations_are_the_start_the_first_impacts_and_the_last() -> None:
    run = run_of("five_balls")
    shown = configurations(run, 8)
    assert [one.title.partition(",")[0] for one in shown] == [
        "start",
        *(f"impact {n}" for n in (1, 2, 3, 4, 5, 6, len(run.collisions["t"]))),
    ]
    exact = run.sample(run.collisions["t"][:6])
    for number, one in enumerate(shown[1:7]):
        here = slice(5 * number, 5 * number + 5)
        places = np.column_stack([exact["x"][here], exact["y"][here]])
        np.testing.assert_allclose(one.centres, places, atol=2e-5)


def test_bodies_stand_on_the_scene_where_they_start() -> None:
    run = run_of("three_arcs")
    figure = scene(run, "single")
    circles = [one for one in figure.axes[0].patches if isinstance(one, Circle)]
    start = run.sample([0.0])
    for number, circle in enumerate(circles):
        assert circle.center == pytest.approx((start["x"][number], start["y"][number]), abs=1e-12)
        assert circle.radius == 0.1
    box, (left, right), (low, high) = (
        figure.axes[0].get_window_extent(),
        figure.axes[0].get_xlim(),
        figure.axes[0].get_ylim(),
    )
    assert box.width / (right - left) == pytest.approx(box.height / (high - low), rel=1e-9)


def test_numbers_of_bodies_that_touch_belong_to_their_bodies() -> None:
    """On the scene a number is nearest to its own ball, or a line leads from it to that ball."""
    resting = [{"touching": "previous"}] * 3
    starts = [{"angle": "-30 deg"}, {"angle": "-3.5 deg"}, *resting]
    balls = [{"radius": 0.01, "density": 7800, "arc": 1} | start for start in starts]
    arc = {"shape": "valley", "radius": 0.5, "end_slope": "80 deg"}
    data = {"gravity": 9.81, "trace": {"start_slope": "-80 deg", "arcs": [arc]}, "balls": balls}
    run = simulate(any_scenario_of(data | {"collision": {"k": 1.0}, "stop": {"time": 0.1}}))
    (axes,) = scene(run, "single").axes
    apart = 2.0 * np.arcsin(0.01 / 0.49)  # balls of radius 0.01 whose centres move at 0.49 from O
    angles = np.radians([-30.0, -3.5, -3.5, -3.5, -3.5]) + apart * np.array([0, 0, 1, 2, 3])
    origin = 0.5 * np.array([np.sin(np.radians(80.0)), np.cos(np.radians(80.0))])
    centres = origin + 0.49 * np.column_stack([np.sin(angles), -np.cos(angles)])
    lines = [np.asarray(line.get_xydata()) for line in axes.lines if line.zorder == 4.5]
    names = [text for text in axes.texts if text.get_fontstyle() != "italic"]
    assert [name.get_text() for name in names[:5]] == ["1", "2", "3", "4", "5"]
    for number, (name, centre) in enumerate(zip(names, centres, strict=False), 1):
        distances = np.hypot(*(centres - name.get_position()).T)
        led = any(np.allclose(line[1], centre, atol=1e-9) for line in lines)
        assert led or np.argmin(distances) == number - 1


def test_impacts_on_one_arc_have_angles() -> None:
    figure = impact_map(run_of("one_circle"))
    assert figure is not None
    assert figure.axes[0].get_xlabel() == r"$\varphi$ of the left body [rad]"
    (dots,) = (one for one in figure.axes[0].collections if isinstance(one, PathCollection))
    table = run_of("one_circle").collisions
    expected = np.column_stack([table["angle_a"], table["approach_speed"]])
    np.testing.assert_array_equal(np.asarray(dots.get_offsets()), expected)


def test_places_that_differ_by_rounding_are_not_spread_over_an_impact_map() -> None:
    """Two equal balls let go on both sides of the bottom meet above it again and again."""
    balls = [scenes.ball(angle) for angle in (-1.0, 1.0)]
    run = scenes.solve_any(scenes.scene(scenes.VALLEY, balls, time=100.0))
    spread = np.ptp(run.collisions["angle_a"])
    assert 0.0 < spread < 1e-12
    figure = impact_map(run)
    assert figure is not None
    low, high = figure.axes[0].get_xlim()
    assert high - low == pytest.approx(0.1 * np.radians(340.0))  # a tenth of the arc


@pytest.mark.parametrize("metres", [1.0, 2.0**-30, 2.0**30])
def test_an_impact_map_of_one_place_is_as_wide_as_the_bodies(metres: float) -> None:
    """Two equal disks on equal springs meet in the middle, whatever the unit of length."""
    held = {"stiffness": 4.0, "length": metres, "height": 2.0 * metres}
    size = {"body": "disk", "radius": 0.25 * metres, "mass": 1.0}
    balls = [
        size | {"position": side * metres, "spring": held | {"foot": 0.5 * side * metres}}
        for side in (-1.0, 1.0)
    ]
    stop = {"time": 9.0, "collisions": 2}
    data = {"system": "springs", "balls": balls, "collision": {"k": 1.0}, "stop": stop}
    (drawn,) = draw_all(simulate(any_scenario_of(data)), ["impact_map"], "single")
    low, high = drawn.figure.axes[0].get_xlim()
    assert (high - low) / metres == pytest.approx(0.5)


def test_kinds_with_nothing_to_show_are_left_out() -> None:
    drawn = [one.name for one in draw_all(run_of("lone_particle"))]
    assert drawn == [
        "scene",
        "portrait_1",
        "energy_portrait_1",
        "energy",
        "space_time",
        "accuracy",
    ]


def test_impacts_at_one_instant_alone_have_no_figure_of_intervals() -> None:
    """The middle one of three equal balls is struck from both sides at once."""
    balls = [scenes.ball(angle) for angle in (-1.0, 0.0, 1.0)]
    run = scenes.solve_any(scenes.scene(scenes.VALLEY, balls, k=0.5, time=0.6))
    assert len(run.collisions["n"]) > 1
    assert not np.any(run.collisions["dt"] > 0.0)
    assert intervals(run) is None


def test_the_same_run_gives_the_same_bytes() -> None:
    run = run_of("one_circle")
    first, second = (
        [render(one.figure, "pdf") for one in draw_all(run, WITHOUT_PORTRAITS, "single")]
        for _ in range(2)
    )
    assert first == second


def test_an_unknown_kind_is_refused() -> None:
    with pytest.raises(ValueError, match="expected some of scene, portrait, energy_portrait"):
        list(draw_all(run_of("lone_particle"), ["painting"]))


def test_a_body_that_oscillates_alone_while_others_collide_is_drawn_where_it_is() -> None:
    """Its one flight lasts for the whole run, of which charts and plans show instants."""
    balls = [scenes.ball(-0.6), scenes.ball(0.4, mass=2.0), scenes.ball(0.5, 3)]
    run = scenes.solve_any(scenes.scene(scenes.THREE_ARCS, balls, time=2000.0))
    flights = run.flights()
    assert np.count_nonzero(flights["ball"] == 3) == 1
    times = [0.0, *run.collisions["t"][:6].tolist(), float(run.collisions["t"][-1])]
    for shown, time in zip(configurations(run, 8), times, strict=True):
        there = run.sample([time])
        np.testing.assert_allclose(shown.centres, np.column_stack([there["x"], there["y"]]))
    axes = space_time(run).axes[0]  # type: ignore[union-attr]
    time, s = (np.asarray(one) for one in axes.lines[-3].get_data())
    assert time[-1] == axes.get_xlim()[1] < 200.0
    middles = 0.5 * (time[1:] + time[:-1])
    sample = run.sample(middles)
    exact = sample["s"][sample["ball"] == 3]
    assert np.max(np.abs(0.5 * (s[1:] + s[:-1]) - exact)) < 0.01 * np.ptp(s)


def test_a_long_run_is_drawn_in_short_time_and_says_where_it_ends() -> None:
    run = run_of("one_circle", "collision.k=1", "stop.collisions=20000", "stop.time=1e6")
    figures = {drawn.name: drawn.figure for drawn in draw_all(run, WITHOUT_PORTRAITS, "single")}
    for figure in figures.values():
        assert_texts_are_apart(figure)
    period = 2.0 * np.pi * np.sqrt(1.0 / 9.81)
    (axes,) = figures["space_time"].axes
    assert axes.get_xlim()[1] == pytest.approx(60 * period)
    part = rf"the first {60 * period:.3g} s of $2.139\times 10^{{4}}$ s"
    assert axes.get_xlabel() == f"$t$ [s], {part}"


@pytest.mark.parametrize("width", ["single", "double"])
@pytest.mark.parametrize(("second", "views"), [("disk", 2), ("hoop", 2), ("ball", 3)])
def test_flat_bodies_have_contact_points_from_the_side_only(
    second: str, views: int, width: str
) -> None:
    run = run_of("disk_on_arcs", f"balls[2].body={second}", "stop.collisions=1")
    figure = contact_points(run, width)
    assert figure is not None
    assert_texts_are_apart(figure)
    shown = [text.get_text() for text in texts(figure)]
    assert len(figure.axes) == views
    assert shown.count("from above") == views - 2
    assert "$T_0$" in shown
    assert not any("T_{1" in text for text in shown)


def test_a_contact_point_at_a_right_angle_lies_on_the_axis() -> None:
    """Ball 2 is struck while it passes at 90 degrees to the line of centres."""
    ball = {"radius": 0.05, "mass": 1.0}
    balls = [
        ball | {"x": -1.0, "y": 0.0, "velocity_x": 1.0},
        ball | {"x": 0.0, "y": -0.9, "velocity_y": 1.0},
    ]
    data = {"system": "table", "balls": balls, "collision": {"k": 1.0}, "stop": {"time": 2.0}}
    run = simulate(any_scenario_of(data))
    assert run.collisions["arrival_angle_b"][0] == pytest.approx(0.5 * np.pi, abs=1e-12)
    (drawn,) = draw_all(run, ["contact_points"], "single")
    shown = [text.get_text() for text in texts(drawn.figure)]
    assert r"$\alpha$ = 90°, 0 m from the axis" in shown


def test_a_trace_that_turns_has_its_axis_on_the_scene() -> None:
    run = run_of("turning_circle")
    figure, turning = scene(run, "single"), run.system.turning
    assert turning is not None
    lines = figure.axes[0].lines
    there = [line for line in lines if np.all(np.asarray(line.get_xdata()) == turning.x)]
    heights = [np.asarray(line.get_ydata()).tolist() for line in there]
    assert heights.count([0, 1]) == 1  # from edge to edge; the others are of the arc's centre
    assert any("rad/s" in text.get_text() for text in texts(figure))
    assert_texts_are_apart(figure)


@pytest.mark.parametrize("x", [-1.5, 0.0, 1.0, 2.0, 3.5])
def test_the_rate_of_rotation_is_written_where_there_is_room(x: float) -> None:
    """Beside the axis, to the right unless that is too near the edge."""
    run = run_of("turning_three_arcs", "stop.time=0.1", f"trace.turning={{rate = -2.657, x = {x}}}")
    figure = scene(run, "single")
    assert_texts_are_apart(figure)
    (words,) = (text for text in figure.axes[0].texts if "rad/s" in text.get_text())
    axis = figure.axes[0].transData.transform((x, 0.0))[0]
    left, right = words.get_window_extent().intervalx
    assert 0.0 < max(left - axis, axis - right) < 0.02 * figure.bbox.width


OTHER = {
    "millimetres": (
        "one_circle",
        ["trace.arcs[1].radius=2 mm", "balls[1].radius=0.2 mm", "balls[2].radius=0.2 mm"],
    ),
    "kilometres": (
        "one_circle",
        ["trace.arcs[1].radius=3 km", "balls[1].radius=100 m", "balls[2].radius=100 m"],
    ),
    "one impact": ("one_circle", ["collision.k=0"]),
    "few impacts": ("five_balls", ["stop.collisions=4", "collision.k=0.5"]),
    "small motion": ("lone_particle", ["balls[1].angle=-0.2"]),
    "turning fast": ("turning_circle", ["trace.turning.rate=5", "stop.time=9"]),
}
"""Scenes that are not the gallery's."""


@pytest.mark.parametrize("name", OTHER)
def test_no_text_overlaps_another_at_other_sizes(name: str) -> None:
    scenario, overrides = OTHER[name]
    for drawn in draw_all(run_of(scenario, "stop.collisions=9", *overrides), None, "single"):
        assert_texts_are_apart(drawn.figure)


def test_a_body_held_by_a_wall_is_drawn_at_rest() -> None:
    overrides = ["balls[1].position=3", "ends.left={wall = 0.5}", "stop={time = 5}"]
    run = run_of("falling_balls", *overrides, "balls[2].position=90", "balls[1].speed=0")
    (branches,) = trajectory(run, 1).branches
    assert branches.rate[-1].tolist() == [0.0] * branches.rate.shape[1]
    assert float(np.max(branches.rate)) < 6.0  # from 3 m up a slope of 30°


def test_a_motion_on_a_small_part_of_a_line_is_shown_close() -> None:
    run = run_of("falling_balls", "stop.collisions=9")
    close, whole, *_ = phase_portrait(run, 1).axes
    assert close.get_xlim()[1] < 2.0
    assert whole.get_xlim() == (0.0, 100.0)
    assert energy_portrait(run, 1).axes[0].get_xlim()[1] < 2.0


def test_walls_are_drawn_in_scene_and_plan() -> None:
    for overrides, number in (((), 2), (("ends={left = 'stop', right = 'stop'}",), 0)):
        run = run_of("turning_valley", "stop.collisions=1", *overrides)
        (axes,) = scene(run).axes
        walls = [line for line in axes.lines if line.get_linewidth() == WALL["linewidth"]]
        assert len(walls) == number


def test_bodies_that_stay_in_contact_have_no_figure_of_accuracy() -> None:
    """They have no impact and no free flight, so that there is nothing to measure."""
    trace = {"start_slope": -1.5, "arcs": [{"shape": "valley", "radius": 1.0, "end_slope": 1.5}]}
    pair = [scenes.ball(-0.3), {"radius": 0.1, "mass": 1.0, "arc": 1, "touching": "previous"}]
    run = scenes.solve_any(scenes.scene(trace, pair, 0.5, "hedrih", time=1.0))
    assert run.summary_record()["collisions"] == 0
    drawn = {one.name for one in draw_all(run, None, "single")}
    assert "accuracy" not in drawn
    assert "energy" in drawn


@pytest.mark.parametrize("length", [-40, -20, 0, 20])
def test_the_axis_of_gaps_is_of_the_size_of_the_bodies(length: int) -> None:
    """That of bodies of a picometre went up to 1e-15 m."""
    document = scenes.scene(scenes.VALLEY, [scenes.ball(-0.7), scenes.ball(0.4)], 1.0, time=4.0)
    run = scenes.solve_any(scaled(document, length, length // 2))
    figure = accuracy(run)
    assert figure is not None
    bottom, top = np.log10(figure.axes[0].get_ylim())
    gaps = np.abs(run.collisions["gap"])
    least = np.spacing(run.system.bodies[0].radius)
    shown = np.log10([*gaps[gaps > 0.0], least])
    # From one power of ten to another, with room for what is 0.
    assert shown.min() - 2.5 < bottom < shown.min()
    assert shown.max() < top < shown.max() + 1.1


@pytest.mark.parametrize(
    ("name", "overrides"),
    [
        ("three_arcs", ("stop.time=1e-9",)),
        ("lone_particle", ("balls[1].arc=2", "balls[1].angle=1e-8", "stop.time=0.5")),
        ("lone_particle", ("balls[1].arc=2", "balls[1].angle=1e-14", "stop.time=0.5")),
    ],
)
def test_a_motion_of_hardly_any_extent_is_drawn(name: str, overrides: tuple[str, ...]) -> None:
    """From rest, so that the energy of the body is the potential energy of its start."""
    run = run_of(name, *overrides)
    assert {"energy_portrait_1", "space_time"} <= {one.name for one in draw_all(run)}
    lower = energy_portrait(run, 1).axes[1]
    place = float(run.sample([0.0])["s"][0])
    along, energy = (np.asarray(values) for values in lower.lines[0].get_data())
    (level,) = {
        float(y)
        for line in lower.collections
        for y in np.asarray(line.get_paths()[0].vertices)[:, 1]
    }
    assert float(np.interp(place, along, energy)) == pytest.approx(level, rel=1e-12)
    low, high = lower.get_ylim()
    assert low + 0.1 * (high - low) < level < high - 0.1 * (high - low)


def test_a_wall_near_bodies_that_are_shown_close_is_in_the_picture() -> None:
    """The floor, at the left end of the trace; the far end, 100 m away, is not."""
    run = run_of("falling_balls", "stop.collisions=9")
    figure = plan(run)
    assert figure is not None
    for axes in (scene(run).axes[0], figure.axes[0]):
        (low, high), (bottom, top) = axes.get_xlim(), axes.get_ylim()
        assert low < 0.0 < high < 10.0
        assert bottom < 0.0 < top
    far = run_of("falling_balls", "stop.time=0.1", "balls[1].position=40", "balls[2].position=41")
    assert scene(far).axes[0].get_xlim()[0] > 10.0


def test_of_very_many_pieces_and_bodies_those_with_room_are_named() -> None:
    """A trace of 120 arcs with a body in every valley: names were on one another, in a minute."""
    shapes = [("valley", "50 deg"), ("hump", "-50 deg")] * 60
    arcs = [{"shape": one, "radius": 1.0, "end_slope": slope} for one, slope in shapes]
    balls = [scenes.ball(0.0, arc=2 * n + 1) for n in range(60)]
    trace = {"start_slope": "-50 deg", "arcs": arcs}
    document = scenes.scene(trace, balls, 1.0, "hedrih", time=0.1)
    figure = scene(scenes.solve_any(document), "double")
    assert_texts_are_apart(figure)
    names = [text.get_text() for text in figure.axes[0].texts]
    assert 40 < len(names) <= 60
    assert set(names) <= {str(number) for number in range(1, 61)}  # of bodies, not of pieces


def test_the_number_of_a_piece_is_beside_a_body_in_its_middle() -> None:
    """The name of the body's contact point was under the number, and its line across it."""
    axes = scene(run_of("horizontal_line_1_2")).axes[0]
    (number,) = (text for text in axes.texts if text.get_text() == "1")
    (touching,) = (text for text in axes.texts if text.get_text() == "$P_{2}$")
    assert abs(number.get_position()[0] - 3.0) > 0.2  # the body is at 3 m, the number was too
    assert abs(touching.get_position()[1]) < 0.3


def test_the_potential_energy_reaches_the_right_end_of_any_trace() -> None:
    """Also if the length of the trace is rounded to beyond the end of its last piece."""
    beyond = 0
    for number in range(20):
        slopes = np.random.default_rng(number).uniform(0.2, 1.0, 5) * (-1.0, 1.0, -1.0, 1.0, -1.0)
        arcs = [
            {"shape": "valley" if end > 0.0 else "hump", "radius": 1.0 / 3.0, "end_slope": end}
            for end in slopes[1:].tolist()
        ]
        trace = {"start_slope": float(slopes[0]), "arcs": arcs}
        run = scenes.solve(scenes.scene(trace, [scenes.ball(0.0)], time=0.5))
        whole, last = run.system.trace.length, run.system.trace.pieces[-1]
        beyond += whole > last.start_s + last.length
        along, energy = map(np.asarray, energy_portrait(run, 1).axes[1].lines[0].get_data())
        assert along[-1] == whole
        first = run.system.trace.pieces[0]
        rise = [
            on_trace(run.system, 1, piece.index + 1, end, np.zeros(()))
            for piece, end in ((last, last.angle_end), (first, first.angle_start))
        ]
        assert energy[-1] - energy[0] == pytest.approx(rise[0] - rise[1], rel=1e-12)
    assert beyond


def test_the_figure_eight_is_within_the_phase_plane_along_the_trace() -> None:
    """Of a body that oscillates in one of its halves, too."""
    trace = scenes.three_arcs(70)
    run = scenes.solve(scenes.scene(trace, [scenes.ball(-0.8)], time=9.0))
    upper = energy_portrait(run, 1).axes[0]
    (eight,) = (one for one in upper.collections if one.get_zorder() == 1.25)
    assert isinstance(eight, LineCollection)
    rates = np.concatenate([np.asarray(line)[:, 1] for line in eight.get_segments()])
    low, high = upper.get_ylim()
    assert low < np.min(rates)
    assert np.max(rates) < high


def test_the_saddle_beside_a_slow_motion_is_within_the_energies() -> None:
    """Above, the figure eight is drawn whole; below, the crest of the potential was cut off."""
    trace = scenes.three_arcs(70)
    run = scenes.solve(scenes.scene(trace, [scenes.ball(-0.8)], time=9.0))
    at = np.zeros(1)
    crest, bottom = (on_trace(run.system, 1, arc, at, at)[0] for arc in (2, 1))
    springs = run_of("springs/two_disks")
    spring = springs.system.springs[1]
    stretched = 0.5 * spring.stiffness * (spring.length - spring.height) ** 2
    beside = springs_portrait(springs, 2)
    for lower, saddle in (
        (energy_portrait(run, 1).axes[1], crest - bottom),
        (beside.axes[1], stretched),
    ):
        assert float(saddle) < lower.get_ylim()[1] < 1.3 * float(saddle)


def test_a_distant_separatrix_does_not_flatten_the_phase_plane_along_the_trace() -> None:
    """That of the outer saddles of this trace is five times as fast as the motion."""
    run = run_of("turning_valley")
    sampled = run.sample(np.linspace(0.0, run.end_time, 4001))
    reached = float(np.max(np.abs(np.asarray(sampled["speed"])[np.asarray(sampled["ball"]) == 1])))
    upper = energy_portrait(run, 1).axes[0]
    assert reached < upper.get_ylim()[1] < 3.5 * reached


def test_the_potential_energy_of_a_level_line_is_clear_of_the_frame() -> None:
    lower = energy_portrait(run_of("translation"), 1).axes[1]
    assert not np.any(lower.lines[0].get_ydata())
    low, high = lower.get_ylim()
    assert 0.03 < -low / (high - low) < 0.1
    assert 0.0 in lower.get_yticks()
