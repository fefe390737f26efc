"""The plan of velocities: its vectors against the table of impacts."""

from __future__ import annotations

import re

import numpy as np
import pytest

from tests.figures.layout import WIDTHS, assert_texts_are_apart, texts
from tests.gallery import GALLERY, run_of
from vibro_cli.api import simulate
from vibro_cli.figures.kinds import draw_one
from vibro_cli.figures.runs.contact_points import contact_points
from vibro_cli.figures.runs.scene import scene, trace_points, visited
from vibro_cli.figures.runs.velocities import striking, touching_point, velocities
from vibro_cli.figures.style import render
from vibro_cli.mechanics.trace import Piece
from vibro_cli.scenario import any_scenario_of, load_any
from vibro_cli.stress import scenes

TWELVE = "stop.collisions=12"
NAMES = ["three_arcs", "unequal_hedrih", "closed_three_balls", "horizontal_line_1_3"]


@pytest.mark.parametrize("name", NAMES)
def test_velocities_of_the_touching_points_are_those_of_the_table(name: str) -> None:
    """The difference along the line of centres is the approach speed, then the separation speed."""
    run = run_of(name, TWELVE)
    for row in range(len(run.collisions["n"])):
        pair = striking(run, row)
        touch, normal = touching_point(pair)
        gap = float(np.hypot(*(pair[1].centre - pair[0].centre)))
        assert gap == pytest.approx(pair[0].body.radius + pair[1].body.radius, rel=1e-12)
        for when, column in enumerate(("approach_speed", "separation_speed")):
            one, other = (each.velocity(touch, when) for each in pair)
            closing = float((one - other) @ normal) * (1.0 if when == 0 else -1.0)
            assert closing == pytest.approx(float(run.collisions[column][row]), abs=1e-12)


@pytest.mark.parametrize("name", NAMES)
def test_the_bodies_roll(name: str) -> None:
    """The resting point is at rest, the centre moves along the trace, ω is that of the table."""
    run = run_of(name, TWELVE)
    for one in striking(run, 0):
        for when in (0, 1):
            speed = one.speed[when]
            np.testing.assert_allclose(one.velocity(one.resting, when), 0.0, atol=1e-12)
            np.testing.assert_allclose(
                one.velocity(one.centre, when), speed * one.tangent, atol=1e-12
            )
            assert one.omega[when] == pytest.approx(speed / one.body.radius, rel=1e-12)
            top = one.resting + 2.0 * (one.centre - one.resting)
            np.testing.assert_allclose(
                one.velocity(top, when), 2.0 * speed * one.tangent, atol=1e-12
            )


@pytest.mark.parametrize("kind", ["velocities", "contact_points", "scene"])
def test_a_body_without_inertia_slides_as_a_particle(kind: str) -> None:
    """κ = 1: the tables have no ω of it, and figures no rolling."""
    pictures = []
    for body in ({"body": "particle"}, {"inertia_ratio": 0.0}):
        document = load_any(GALLERY / "one_circle.toml", ["stop.collisions=2"]).given()
        for ball in document["balls"]:
            del ball["density"]
            ball |= {"mass": 1.0, **body}
            if "inertia_ratio" in body:
                ball.pop("body", None)
        run = simulate(any_scenario_of(document))
        assert np.isnan(run.collisions["omega_a_pre"]).all()
        one = draw_one(run, kind, 1, "single")
        assert one is not None
        pictures.append(render(one.figure, "png"))
    assert pictures[0] == pictures[1]


def test_a_sliding_particle_does_not_turn() -> None:
    path = GALLERY / "particle_on_arcs.toml"
    run = simulate(load_any(path, ["stop.collisions=1"]))
    one, _ = striking(run, 0)
    np.testing.assert_array_equal(one.velocity(one.resting, 0), one.velocity(one.centre, 0))


def test_bodies_in_translation_have_one_velocity_each_and_an_impulse() -> None:
    """B fig. 1: arrows of the centres alone; B (6): 8/3 N s."""
    figure = velocities(run_of("translation", TWELVE))
    assert figure is not None
    assert_texts_are_apart(figure)
    shown = [text.get_text() for text in texts(figure)]
    assert "= 2.67 N s" in shown
    assert {"centre $C$", "tangent"} <= set(shown)
    assert "impact point $T$" not in shown


@pytest.mark.parametrize("kind", ["velocities", "contact_points"])
@pytest.mark.parametrize("name", ["particle_on_arcs", "one_circle", "on a table"])
def test_nothing_is_said_of_the_turning_of_bodies_that_slide(name: str, kind: str) -> None:
    """Particles have no ω and no velocity due to rolling; balls have both."""
    if name == "on a table":
        ball = {"radius": 0.05, "mass": 1.0, "body": "particle"}
        balls = [ball | {"x": -1.0, "y": 0.0, "velocity_x": 1.0}, ball | {"x": 0.0, "y": 0.03}]
        data = {"system": "table", "balls": balls, "collision": {"k": 1.0}, "stop": {"time": 2.0}}
        run = simulate(any_scenario_of(data))
    else:
        run = run_of(name, TWELVE)
    one = draw_one(run, kind, 1, "single")
    assert one is not None
    assert_texts_are_apart(one.figure)
    shown = " ".join(text.get_text() for text in texts(one.figure))
    turning = name == "one_circle"
    assert [word in shown for word in ("rolling", r"\omega", "rad/s")] == 3 * [turning]


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("name", NAMES)
def test_no_text_is_cut_off_or_overlaps_another(name: str, width: str) -> None:
    figure = velocities(run_of(name, TWELVE), width)
    assert figure is not None
    impacts = min(len(run_of(name, TWELVE).collisions["n"]), 2 if width == "single" else 4)
    assert len(figure.axes) == 2 * impacts
    assert_texts_are_apart(figure)


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("gravity", [1e6, 3e11, 1e-5])
@pytest.mark.parametrize("radius", [0.1, 1e-4])
def test_large_and_small_values_have_a_prefix(radius: float, gravity: float, width: str) -> None:
    """As many rad/s in words as in the table, and no text over the next panel."""
    radii = [f"balls[{ball}].radius={radius}" for ball in (1, 2)]
    changes = [f"gravity={gravity}", "stop={collisions = 4}", *radii]
    run = simulate(load_any(GALLERY / "three_arcs.toml", changes))
    figure = velocities(run, width)
    assert figure is not None
    assert_texts_are_apart(figure)
    powers = {"p": -12, "n": -9, "µ": -6, "m": -3, "": 0, "k": 3, "M": 6, "G": 9}
    said = [re.fullmatch(r"= (\S+) (\S?)rad/s", text.get_text()) for text in texts(figure)]
    told = [float(one[1].replace("−", "-")) * 10.0 ** powers[one[2]] for one in said if one]
    shown = len(told) // 2
    table = [run.collisions[f"omega_b_{when}"][:shown] for when in ("pre", "post")]
    assert told == pytest.approx(np.transpose(table).ravel(), rel=6e-3)
    assert shown == (2 if width == "single" else 4)


def test_the_line_of_centres_and_the_tangent_cross_in_the_impact_point() -> None:
    run = run_of("three_arcs", TWELVE)
    figure = velocities(run)
    assert figure is not None
    for number, axes in enumerate(figure.axes):
        pair = striking(run, number // 2)
        touch, normal = touching_point(pair)
        lines = [np.asarray(line.get_xydata()) for line in axes.lines]
        halves = [
            line[1] - touch
            for line in lines
            if len(line) == 2 and np.allclose(line.mean(axis=0), touch) and np.ptp(line) > 0.0
        ]
        tangent, centres = sorted(halves, key=lambda half: abs(float(half @ normal)))
        assert tangent @ normal == pytest.approx(0.0, abs=1e-12)
        assert abs(centres @ normal) == pytest.approx(np.hypot(*centres), rel=1e-12)
        for half in (tangent, centres):
            assert np.hypot(*half) > max(one.body.radius for one in pair)


def test_the_angle_of_a_body_is_drawn_from_the_vertical_to_the_body() -> None:
    run = run_of("three_arcs", TWELVE)
    (axes,) = scene(run).axes
    for body, start in zip(run.system.bodies, run.system.initial, strict=True):
        piece = run.system.trace.pieces[start.piece]
        origin = np.array(piece.centre)
        towards = np.array(piece.body_centre(start.position, body.radius)) - origin
        lines = [np.asarray(line.get_xydata()) - origin for line in axes.lines]
        arcs = [line for line in lines if len(line) == 60 and np.ptp(np.hypot(*line.T)) < 1e-12]
        ends = [(one[0], one[-1]) / np.hypot(*one[0]) for one in arcs]
        expected = [[0.0, np.sign(towards[1])], towards / np.hypot(*towards)]
        assert any(np.allclose(one, expected, rtol=0.0, atol=1e-9) for one in ends)


@pytest.mark.parametrize("places", [[(0.1, -0.97), (0.2, -0.95)], [(0.95, -0.2), (0.97, -0.1)]])
def test_a_part_of_a_trace_is_shown_around_its_bodies(places: list[tuple[float, float]]) -> None:
    """Within the trace, with the whole bodies, and of a mirror image the mirror image."""
    centres, radius, end = np.array(places), 0.01, np.array([1.0, 1.0])
    balls = [scenes.ball(angle, radius=radius) for angle in (-1.0, 1.0)]
    system = scenes.system_of(scenes.scene(scenes.VALLEY, balls, time=1.0))
    low, high = visited(system, centres, -end, end)
    assert np.all(-end <= low)
    assert np.all(low < np.min(centres, axis=0) - radius)
    assert np.all(np.max(centres, axis=0) + radius < high)
    assert np.all(high <= end)
    assert np.all(high - low < 0.5)
    mirror = np.array([-1.0, 1.0])
    other = visited(system, centres * mirror, -end, end)
    assert np.sort(other * mirror, axis=0) == pytest.approx(np.array([low, high]), rel=1e-12)


def test_points_of_a_trace_are_found_piece_by_piece(monkeypatch: pytest.MonkeyPatch) -> None:
    """They were found one by one: a tenth of the time of a report on 1,001 arcs."""
    trace = run_of("line_between_valleys", TWELVE).system.trace
    centre_and_tangent, asked = Piece.centre_and_tangent, []

    def counted(piece: Piece, position: float, radius: float) -> object:
        asked.append(piece.index)
        return centre_and_tangent(piece, position, radius)

    monkeypatch.setattr(Piece, "centre_and_tangent", counted)
    points = trace_points(trace, 7, 3)
    assert asked == list(range(len(trace.pieces)))
    monkeypatch.undo()
    counts = [3 if piece.is_line else 7 for piece in trace.pieces]
    parts = np.split(points, np.cumsum(counts)[:-1])
    for piece, own, count in zip(trace.pieces, parts, counts, strict=True):
        for n, point in enumerate(own):
            share = n / (count - 1)
            if piece.is_line:
                expected = (1.0 - share) * np.array(piece.start) + share * np.array(piece.end)
            else:
                slope = (1.0 - share) * piece.start_slope + share * piece.end_slope
                normal = np.array([np.sin(slope), -np.cos(slope)])
                expected = np.array(piece.centre) + piece.sign * piece.radius * normal
            np.testing.assert_allclose(point, expected, rtol=0.0, atol=1e-14)


@pytest.mark.parametrize("width", ["single", "double"])
def test_every_value_stands_behind_its_symbol(width: str) -> None:
    figure = velocities(run_of("three_arcs", TWELVE), width)
    assert figure is not None
    for axes in figure.axes:
        shown = [(*text.get_position(), text.get_text()) for text in axes.texts]
        values = [one for one in shown if one[2].startswith("= ")]
        assert len(values) >= 4
        for x, line, _ in values:
            before = [one for one in shown if one[1] == line and one[0] < x]
            assert max(before)[2].startswith("$")


def test_an_inadmissible_impact_is_named() -> None:
    figure = velocities(run_of("unequal_hedrih", TWELVE), "double")
    assert figure is not None
    shown = [text.get_text() for text in texts(figure)]
    assert "after (inadmissible)" in shown


def test_no_impact_has_no_plan() -> None:
    run = simulate(load_any(GALLERY / "lone_particle.toml", ["stop.time=0.1"]))
    assert velocities(run) is None
    with pytest.raises(ValueError, match="triple"):
        velocities(run, "triple")


def test_the_circle_of_contact_points_is_seen_from_the_side_as_a_chord_of_the_body() -> None:
    figure = contact_points(run_of("three_arcs", TWELVE))
    assert figure is not None
    for axes in figure.axes[::2]:
        lines = [np.asarray(line.get_xydata()) for line in axes.lines]
        level = [line for line in lines if len(line) == 2 and np.ptp(line[:, 1]) == 0.0]
        (chord,) = [line for line in level if np.allclose(np.hypot(*line.T), 1.0)]
        assert chord[0, 0] == -chord[1, 0] != 0.0


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
def test_values_over_contact_points_stay_over_their_own_panel(unit: float, width: str) -> None:
    """Those of bodies of 0.1 µm used to overlap the text of the next panel."""
    lengths = {f"trace.arcs[{n}].radius": radius for n, radius in enumerate((1.0, 0.5, 1.0), 1)}
    lengths |= {"balls[1].radius": 0.1, "balls[2].radius": 0.08}
    scaled = [f"{path}={length * unit!r}" for path, length in lengths.items()]
    run = run_of("three_arcs", "stop.collisions=1", "stop.time=1e6", *scaled)
    figure = contact_points(run, width)
    assert figure is not None
    assert_texts_are_apart(figure)
    prefixes = {"µ": 1e-6, "n": 1e-9, "m": 1e-3, "k": 1e3, "M": 1e6, "": 1.0}
    shown = " ".join(text.get_text().replace("−", "-") for text in texts(figure))
    told = re.findall(r"= (-?[\d.]+) ([µnmkM]?)(m/s|rad/s)", shown)
    values = [float(number) * prefixes[prefix] for number, prefix, _ in told]
    wanted = [
        run.collisions[f"{what}_{side}_pre"][0] for side in "ab" for what in ("speed", "omega")
    ]
    assert values == pytest.approx(wanted, rel=5e-3)
