"""Phase portraits: the values drawn, and that nothing overlaps or is cut off."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from tests.analysis.traces import hump, line, system, valley
from tests.bare_system import GRAVITY
from tests.effort import calls
from tests.figures.layout import assert_texts_are_apart, texts
from tests.figures.runs import (
    HandMade,
    at_rest,
    made,
    on_circle,
    on_line_between_valleys,
    on_many_arcs,
    on_three_arcs,
)
from vibro_cli import Scenario, example, simulate
from vibro_cli.analysis.levels import Landscape
from vibro_cli.analysis.singular import singular_points
from vibro_cli.figures import style
from vibro_cli.figures.portraits import layers
from vibro_cli.figures.portraits.portrait import phase_portrait
from vibro_cli.figures.portraits.trajectory import MOST_BRANCHES, MOST_NUMBERS, trajectory
from vibro_cli.mechanics.potential import Turning

pytestmark = pytest.mark.long

RUNS: dict[str, Callable[[], HandMade]] = {
    "circle": lambda: on_circle(5),
    "small": lambda: on_circle(5, start=-0.4, spread=0.1),
    "long": lambda: on_circle(300),
    "very long": lambda: on_circle(2 * MOST_BRANCHES),
    "three arcs": on_three_arcs,
    "line": on_line_between_valleys,
    "many arcs": on_many_arcs,
    "rest": at_rest,
    "inadmissible": lambda: refused(on_circle(5)),
}


def refused(run: HandMade) -> HandMade:
    """Make the last impact inadmissible."""
    run.struck[-1] |= {"admissible": False, "separation_speed": -1.0}
    return run


def lines(figure: Figure, panel: int, zorder: float) -> list[Any]:
    """Return the lines drawn on a panel at one level."""
    return [
        segment
        for collection in figure.axes[panel].collections
        if isinstance(collection, LineCollection) and collection.get_zorder() == zorder
        for segment in collection.get_segments()
    ]


def shown(figure: Figure) -> list[str]:
    """Return the texts on a figure."""
    return [text.get_text() for text in texts(figure)]


def test_a_panel_for_each_piece_with_quantities_and_units() -> None:
    figure = phase_portrait(on_three_arcs(), 1)
    panels = figure.axes
    assert [axes.get_title() for axes in panels] == [
        "arc 1, valley",
        "arc 2, hump",
        "arc 3, valley",
    ]
    assert [axes.get_xlabel() for axes in panels] == [
        r"$\varphi_{1}$ [rad]",
        r"$\psi_{1}$ [rad]",
        r"$\varphi_{1}$ [rad]",
    ]
    assert panels[0].get_ylabel() == r"$\dot{\varphi}_{1},\ \dot{\psi}_{1}$ [rad/s]"
    assert len({axes.get_ylim() for axes in panels}) == 1
    for axes, piece in zip(panels, on_three_arcs().system.trace.pieces, strict=True):
        assert axes.get_xlim() == (piece.angle_start, piece.angle_end)


def test_line_has_its_own_axis() -> None:
    figure = phase_portrait(on_line_between_valleys(), 1)
    first, middle, last = figure.axes
    assert middle.get_ylabel() == "$v_{1}$ [m/s]"
    assert middle.get_xlabel() == "$s_{1}$ [m]"
    assert first.get_ylim() == last.get_ylim()
    assert first.get_ylim() != middle.get_ylim()
    quarter = 0.5 * math.pi
    assert middle.get_xlim() == pytest.approx((quarter, quarter + 1.5), rel=1e-15)


def test_branches_have_constant_energy_and_join_the_recorded_states() -> None:
    run = on_three_arcs()
    figure = phase_portrait(run, 1)
    hills = Landscape.of(run.system, 1)
    drawn = 0
    for panel, piece in enumerate(run.system.trace.pieces):
        flights = [row for row in run.rows if row["arc"] == panel + 1]
        for segment, row in zip(lines(figure, panel, 2.0), flights, strict=True):
            energy = hills.energy(piece, segment[:, 0], segment[:, 1])
            np.testing.assert_allclose(energy, energy[0], rtol=1e-12)
            assert tuple(segment[0]) == (row["angle_start"], row["rate_start"])
            assert tuple(segment[-1]) == (row["angle_end"], row["rate_end"])
            drawn += 1
    assert drawn == len(run.rows)
    assert run.sampled == []  # all in closed form


def test_jumps_are_vertical_from_the_rate_before_to_the_one_after() -> None:
    run = on_three_arcs()
    segments = lines(phase_portrait(run, 1), 2, 2.2)
    assert len(segments) == len(run.struck)
    for segment, row in zip(segments, run.struck, strict=True):
        assert segment.tolist() == [
            [row["angle"], row["rate_pre"]],
            [row["angle"], row["rate_post"]],
        ]


def test_jump_on_a_line_is_at_its_arc_length() -> None:
    run = on_line_between_valleys()
    (segment,) = lines(phase_portrait(run, 1), 1, 2.2)
    row = run.struck[0]
    np.testing.assert_allclose(segment[:, 0], row["s"], rtol=1e-15)
    np.testing.assert_array_equal(segment[:, 1], [row["speed_pre"], row["speed_post"]])


def test_inadmissible_impact_is_marked_and_is_no_jump() -> None:
    run = refused(on_three_arcs())
    figure = phase_portrait(run, 1)
    assert len(lines(figure, 2, 2.2)) == len(run.struck) - 1
    assert "inadmissible" in shown(figure)
    last = run.struck[-1]
    numbers = [text for text in figure.axes[2].texts if text.get_text() == str(last["n"])]
    (x, y), top = numbers[0].get_position(), figure.axes[2].get_ylim()[1]
    assert abs(x - last["angle"]) < 0.5
    assert abs(y - last["rate_pre"]) < 0.2 * top  # where it was, not where the law would send it
    jumped = refused(on_three_arcs())
    jumped.struck[-1] |= {"substituted": True}  # the other law was used, and the body did jump
    assert len(lines(phase_portrait(jumped, 1), 2, 2.2)) == len(jumped.struck)


def test_separatrix_of_the_circle_is_drawn() -> None:
    """φ̇ = ±2w cos(φ/2) with w² = g/κρ."""
    segments = lines(phase_portrait(on_circle(5), 1), 0, 1.2)
    w = math.sqrt(GRAVITY / (1.4 * 0.9))
    assert np.min(np.concatenate(segments)[:, 1]) < -1.99 * w
    assert np.max(np.concatenate(segments)[:, 1]) > 1.99 * w
    for segment in segments:
        expected = 2 * w * np.cos(segment[:, 0] / 2)
        np.testing.assert_allclose(np.abs(segment[:, 1]), expected, rtol=1e-7, atol=1e-7)


def test_separatrix_runs_through_all_arcs() -> None:
    run = on_three_arcs()
    hills = Landscape.of(run.system, 1)
    saddle = singular_points(hills)[1].energy
    figure = phase_portrait(run, 1)
    for panel, piece in enumerate(run.system.trace.pieces):
        segments = lines(figure, panel, 1.2)
        assert segments
        for segment in segments:
            energy = hills.energy(piece, segment[:, 0], segment[:, 1])
            np.testing.assert_allclose(energy, saddle, rtol=1e-12)


def test_impacts_are_numbered_while_they_are_few() -> None:
    few = shown(phase_portrait(on_circle(MOST_NUMBERS), 1))
    assert {str(number) for number in range(1, MOST_NUMBERS + 1)} <= set(few)
    many = shown(phase_portrait(on_circle(MOST_NUMBERS + 40), 1))
    assert str(MOST_NUMBERS + 39) not in many
    assert "$t$ [s]: 0" in many


def test_long_run_is_rasterised_and_thinned() -> None:
    run = on_circle(3 * MOST_BRANCHES)
    path = trajectory(run, 1)
    assert path.every == 4
    assert len(path.branches[0].time) == math.ceil(len(run.rows) / 4)
    assert len(path.jumps.time) == math.ceil(len(run.struck) / 4)
    figure = phase_portrait(run, 1)
    assert "jump (1 in 4)" in shown(figure)
    (branches,) = (one for one in figure.axes[0].collections if one.get_zorder() == 2.0)
    assert branches.get_rasterized()


def test_flights_in_contact_are_sampled_from_the_run() -> None:
    run = on_circle(3)
    rate = run.rows[-1]["rate_end"]
    run.fly(1, (0.1, rate), (0.3, 0.5), cause_start="contact_closed", contact=True)
    run.fly(1, (0.3, 0.5), (0.3, 0.5), cause_start="crossing", contact=True)
    run.fly(1, (0.3, 0.5), (0.3, -0.5), cause_start="contact_opened")
    trajectory(run, 1)
    assert set(run.sampled) == {len(run.rows) - 3, len(run.rows) - 2}


def test_segments_of_lasting_contact_are_one_branch() -> None:
    run = on_circle(3)
    rate = run.rows[-1]["rate_end"]
    before = len(run.rows)
    run.fly(1, (0.1, rate), (0.2, 0.7), cause_start="contact_closed", contact=True)
    for angle in (0.2, 0.3, 0.4):
        ends = (angle, 0.9 - angle), (angle + 0.1, 0.8 - angle)
        run.fly(1, *ends, cause_start="segment", contact=True)
    drawn = trajectory(run, 1).branches[0]
    assert len(drawn.time) == before + 1
    assert (drawn.position[-1][0], drawn.rate[-1][0]) == (0.1, rate)
    assert (drawn.position[-1][-1], drawn.rate[-1][-1]) == pytest.approx((0.5, 0.4))
    assert np.all(np.diff(drawn.position[-1]) >= 0.0)


def test_points_drawn_in_lasting_contact_are_on_the_motion() -> None:
    data = example("one_circle").resolved()
    data["balls"][1]["density"] = data["balls"][0]["density"]
    data["collision"]["k"] = 0.5
    run = simulate(Scenario.model_validate(data))
    drawn = trajectory(run.stored, 1).branches[0]
    (lasting,) = np.flatnonzero(drawn.contact)
    # Two equal bodies that touch on a circle are one pendulum: the square of their rate is linear
    # in the cosine of the angle of their middle.
    last = {name: run.collisions[name][-1] for name in ("angle_a", "angle_b")}
    middle = drawn.position[lasting] + 0.5 * (last["angle_b"] - last["angle_a"])
    squared = drawn.rate[lasting] ** 2
    linear = np.polynomial.Polynomial.fit(np.cos(middle), squared, 1)(np.cos(middle))
    assert np.max(np.abs(linear - squared)) < 1e-9 * np.max(squared)


def test_thinned_curves_stay_within_a_hair_of_the_true_ones() -> None:
    run = on_circle(5)
    drawn = lines(phase_portrait(run, 1), 0, 2.0)
    full = trajectory(run, 1).branches[0]
    assert sum(map(len, drawn)) < full.position.size
    for segment, position, rate in zip(drawn, full.position, full.rate, strict=True):
        along = np.interp(
            np.linspace(0, 1, len(position)), np.linspace(0, 1, len(segment)), segment[:, 0]
        )
        across = np.interp(
            np.linspace(0, 1, len(rate)), np.linspace(0, 1, len(segment)), segment[:, 1]
        )
        assert np.max(np.abs(along - position)) < 1e-3 * 2 * math.pi
        assert np.max(np.abs(across - rate)) < 1e-3 * 2 * np.max(np.abs(full.rate))


def test_flight_without_constant_energy_is_sampled_from_the_run() -> None:
    run = on_circle(2)
    run.rows[1]["rate_end"] *= 0.9
    trajectory(run, 1)
    assert run.sampled == [1]


def test_turning_trace_is_sampled_and_has_its_separatrix() -> None:
    run = HandMade(system(-90, valley(1.0, 90), turning=Turning(0.0, 2.0)))
    run.fly(1, (-0.5, 0.0), (0.5, 0.0), cause_start="start", cause_end="end")
    figure = phase_portrait(run, 1)
    assert run.sampled == [0]
    assert lines(figure, 0, 1.0) != []


def test_small_motion_is_shown_close_and_on_the_whole_arc() -> None:
    run = on_circle(5, start=-0.4, spread=0.1)
    close, whole = phase_portrait(run, 1).axes
    low, high = close.get_xlim()
    assert -0.7 < low < -0.4
    assert high < 0.4
    assert whole.get_xlim() == (-math.pi, math.pi)


def test_many_arcs_stand_in_rows() -> None:
    figure = phase_portrait(on_many_arcs(), 1)
    assert len(figure.axes) == 9
    assert len({round(axes.get_position().y0, 6) for axes in figure.axes}) > 1


def test_panels_of_a_run_on_very_many_arcs_are_those_around_its_start() -> None:
    waves = [hump(0.5, -50), valley(1.0, 50)] * 100
    run = made(-50, valley(1.0, 50), *waves)
    run.fly(101, (-0.3, 2.5), (0.8, 2.0), cause_start="start")
    run.fly(102, (-0.8, 2.0), (0.5, 1.8), cause_end="end")
    figure = phase_portrait(run, 1, "double")
    titles = [axes.get_title() for axes in figure.axes]
    assert len(titles) == 36
    assert {"101, valley", "102, hump"} < set(titles)
    first, last = (title.split(",")[0] for title in (titles[0], titles[-1]))
    assert f"arcs {first}–{last} of 201" in {one.get_text() for one in texts(figure)}
    assert_texts_are_apart(figure)


def test_the_motion_along_four_times_as_many_arcs_takes_four_times_as_many_calls() -> None:
    """The lowest point of the trace was searched for on each arc: sixteen times as many."""

    def needed(pairs: int) -> int:
        run = made(-50, *[valley(1.0, 50), hump(0.5, -50)] * pairs)
        for pair in range(pairs):
            run.fly(2 * pair + 1, (-0.8, 2.0), (0.8, 2.0), cause_start="crossing")
            run.fly(2 * pair + 2, (-0.8, 2.0), (0.8, 2.0), cause_start="crossing")
        return calls(lambda: trajectory(run, 1))

    assert needed(120) < 5 * needed(30)


@pytest.mark.parametrize("width", ["single", "double"])
@pytest.mark.parametrize("name", RUNS)
def test_no_text_is_cut_off_or_overlaps_another(name: str, width: str) -> None:
    assert_texts_are_apart(phase_portrait(RUNS[name](), 1, width))


def test_unknown_width_and_body_are_refused() -> None:
    run = on_circle(2)
    with pytest.raises(ValueError, match="triple"):
        phase_portrait(run, 1, "triple")
    for ball in (0, 2):
        with pytest.raises(IndexError, match=str(ball)):
            phase_portrait(run, ball)


def test_colours_differ_in_grey_too() -> None:
    """Separatrix, branch and jump have lines of their own; time runs from dark to light."""
    styles = [
        str(look.get("linestyle", "solid"))
        for look in (layers.SEPARATRIX, layers.BRANCH, layers.JUMP)
    ]
    assert len(set(styles)) == 3
    colours = style.time_colours()(np.linspace(0.0, 1.0, 64))[:, :3]
    grey = colours @ [0.2126, 0.7152, 0.0722]
    assert np.all(np.diff(grey) > 0.0)


@pytest.mark.parametrize(("start", "seen"), [(-1.5, True), (-1.0, False)])
def test_the_separatrix_of_a_full_circle_is_named_where_it_is_seen(
    start: float, seen: bool
) -> None:
    """It takes no room: at the left end, -90 degrees, its rate is 2w cos 45 degrees."""
    run = made(-90, valley(1.0, 0), line(1.5), valley(1.0, 90))
    hills = Landscape.of(run.system, 1)
    first = run.system.trace.pieces[0]
    rate = float(hills.rate(first, 0.0, float(hills.energy(first, start, 0.0))))
    run.fly(1, (start, 0.0), (0.0, rate), cause_start="start", cause_end="end")
    figure = phase_portrait(run, 1)
    named = {text.get_text() for text in texts(figure)}
    assert ("separatrix of the full circle" in named) == seen
    assert "separatrix" not in named
    top = figure.axes[0].get_ylim()[1]
    assert top == pytest.approx(1.08 * rate)
    assert (top > hills.natural_rate(first) * math.sqrt(2.0)) == seen


def test_a_level_line_that_no_curve_reaches_shows_level_curves() -> None:
    """The upper line of a stadium, where a body could rest: its panel was empty."""
    halves = [line(1.5), valley(0.5, 180), line(1.5), valley(0.5, 360)]
    run = HandMade(system(0, *halves, closed=True))
    run.fly(1, (0.5, 1.0), (1.0, 1.0), cause_start="start", cause_end="end")
    figure = phase_portrait(run, 1)
    speeds = [abs(float(curve[0, 1])) for curve in lines(figure, 2, 1.0)]
    assert len(speeds) >= 2
    assert 0.0 < min(speeds) < figure.axes[2].get_ylim()[1]


def test_a_line_that_the_body_does_not_reach_shows_its_level_curves() -> None:
    run = made(-90, valley(1.0, 0), line(1.5), valley(1.0, 90))
    run.fly(1, (-1.0, 6.0), (-0.5, 6.5), cause_start="start", cause_end="end")
    figure = phase_portrait(run, 1)
    speeds = [np.max(np.abs(curve[:, 1])) for curve in lines(figure, 1, 1.0)]
    assert len(speeds) >= 4
    assert max(speeds) > 2.0
    assert figure.axes[1].get_ylim()[1] == pytest.approx(1.08 * max(speeds))


def turning_about(x: float, name: str = "turning_three_arcs", **more: Any) -> Any:
    """The run of an example that turns about an axis far from it."""
    turning = {"x": x, "rate": 0.8}
    return simulate(example(name).replace({"trace.turning": turning, **more})).solved


def test_pieces_that_the_energies_of_a_motion_do_not_reach_have_level_curves() -> None:
    figure = phase_portrait(turning_about(50.0), 1)
    assert len(figure.axes) > 2
    for panel, axes in enumerate(figure.axes[:3]):
        (low, high), top = axes.get_xlim(), axes.get_ylim()[1]
        within = [
            curve[(np.abs(curve[:, 1]) < top) & (curve[:, 0] > low) & (curve[:, 0] < high), 0]
            for curve in lines(figure, panel, 1.0)
        ]
        reach = np.concatenate(within)
        assert np.ptp(reach) > 0.4 * (high - low)


def test_bounces_too_small_to_be_seen_do_not_thin_out_the_other_branches() -> None:
    run = turning_about(500.0)
    path = trajectory(run, 1)
    starts = np.concatenate([branches.time for branches in path.branches])
    assert path.every == 1
    assert len(starts) < 300 < MOST_BRANCHES < len(run.flights()["ball"])
    struck = np.asarray(run.collisions["t"])
    assert np.all(np.isin(struck[:12], starts))  # what follows the first impacts is drawn


def test_a_free_motion_far_from_the_axis_is_drawn_as_smooth_as_near_it() -> None:
    """Its points lie on its level curve, though it oscillates many times as fast as by gravity."""
    arc = {"shape": "valley", "radius": 1.0, "end_slope": "179 deg"}
    far = {"trace.arcs": [arc], "balls[1].angle": 1.2, "stop.time": 3.0}
    run = turning_about(-5000.0, "lone_particle", **far)
    hills = Landscape.of(run.system, 1)
    (piece,) = run.system.trace.pieces
    (branches, *_) = trajectory(run, 1).branches
    for position, rate in zip(branches.position, branches.rate, strict=True):
        energy = hills.energy(piece, position, rate)
        assert np.ptp(energy) < 5e-3 * np.max(energy)


def test_numbers_of_impacts_are_clear_of_centres_and_saddles() -> None:
    drawing = simulate(example("two_disks")).figure("portrait", body=1, width="single")
    axes = drawing.figure.axes[0]
    crosses = [np.asarray(one.get_xydata()) for one in axes.lines if one.get_marker() in ("+", "x")]
    marks = axes.transData.transform(np.concatenate(crosses))
    drawing.figure.draw_without_rendering()
    for text in axes.texts:
        box = text.get_window_extent().padded(1.0)
        assert not any(box.contains(*mark) for mark in marks)


def resting(system: str, size: float) -> Any:
    """A run of a body that stays at rest, on a trace or a spring of a size (m)."""
    body: dict[str, Any] = {"radius": 0.1 * size, "mass": 1.0}
    scenario: dict[str, Any]
    if system == "springs":
        spring = {"stiffness": 10.0, "length": 0.6 * size, "height": size, "foot": 0.0}
        scenario = {"system": "springs", "balls": [body | {"position": 0.0, "spring": spring}]}
    else:
        arc = {"shape": "valley", "radius": size, "end_slope": "90 deg"}
        trace = {"start_slope": "-90 deg", "arcs": [arc]}
        scenario = {"gravity": 9.81, "trace": trace, "balls": [body | {"arc": 1, "angle": 0.0}]}
    return simulate(Scenario.from_dict(scenario | {"stop": {"time": 5.0}}))


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize(
    ("system", "kind"),
    [("trace", "portrait"), ("trace", "energy_portrait"), ("springs", "portrait")],
)
def test_a_body_that_stays_at_rest_is_seen_among_level_curves(
    system: str, kind: str, size: float
) -> None:
    """Its motion has no range: the axes are those of the portrait without a run."""
    figure = resting(system, size).figure(kind, body=1).figure
    upper = figure.axes[0]
    places, rates = np.concatenate(lines(figure, 0, 1.0)).T
    for limits, reached in ((upper.get_xlim(), places), (upper.get_ylim(), rates)):
        assert 0.5 < np.ptp(reached) / np.ptp(limits) < 2.0
    if len(figure.axes) > 1:
        energies = np.asarray(figure.axes[1].lines[0].get_ydata())
        bottom, top = figure.axes[1].get_ylim()
        assert 0.5 * (top - bottom) < np.ptp(energies) < top - bottom


@pytest.mark.parametrize("kind", ["portrait", "energy_portrait"])
def test_walls_are_where_the_bodies_meet_them(kind: str) -> None:
    """Compared with where the solver records the impacts on the walls; both bodies have one."""
    ends = {"ends.left.wall": 0.8, "ends.right.wall": 0.8}
    arc = {"trace.closed": False, "trace.start_slope": -1.0, "trace.arcs[1].end_slope": 1.0}
    start = {"balls[1].rate": 3.2, "stop.collisions": 6}
    run = simulate(example("one_circle").replace(arc | ends | start))
    for ball, side in ((1, -1.0), (2, 1.0)):
        met = (run.events["event"] == "wall") & (run.events["ball"] == ball)
        figure = run.figure(kind, body=ball).figure
        wide = [
            np.asarray(line.get_xdata()).tolist()
            for axes in figure.axes
            for line in axes.lines
            if line.get_linewidth() == layers.WALL["linewidth"]
        ]
        walls = [places[0] for places in wide if len(set(places)) == 1]
        rho = 1.0 - run.scenario.balls[ball - 1].radius
        place = side * (1.0 - math.asin(run.scenario.balls[ball - 1].radius / rho))
        if kind == "energy_portrait":
            place = 1.0 + place
            np.testing.assert_allclose(run.events["s"][met], place, rtol=1e-14)
        np.testing.assert_allclose(walls, place, rtol=1e-14)
        assert len(walls) == (1 if kind == "portrait" else 2)
        assert "wall" in shown(figure)


def test_a_wall_that_is_not_met_is_not_drawn() -> None:
    scenario = example("turning_valley")
    assert isinstance(scenario, Scenario)
    assert scenario.ends.left != "stop"
    run = simulate(scenario)
    assert not np.any((run.events["event"] == "wall") & (run.events["ball"] == 1))
    assert "wall" not in shown(run.figure("portrait", body=1).figure)


def test_a_portrait_of_a_few_impacts_has_no_bitmap() -> None:
    """Its overview drew the jumps as an image in vector files."""
    figure = phase_portrait(on_circle(5, start=-0.4, spread=0.1), 1)
    assert len(figure.axes) == 2
    assert not style.has_rasters(figure)
