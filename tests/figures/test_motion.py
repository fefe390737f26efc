"""Films: every frame shows the motion at its time, and the files have the stated content."""

from __future__ import annotations

import json
import math
import shutil
import subprocess
from dataclasses import replace
from functools import cache
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from tests.gallery import GALLERY, run_of
from vibro_cli import Run as Solved
from vibro_cli import example
from vibro_cli import simulate as solved
from vibro_cli.api import Run, simulate
from vibro_cli.figures.film import Film, FilmFrame, Frames, NoFilm, clock_digits, frame_times, movie
from vibro_cli.report.html import film_html
from vibro_cli.scenario import any_scenario_of
from vibro_cli.systems.trace.figures import film as film_on_trace

RATE = 25


@cache
def shown(name: str, end: float) -> tuple[Run, Frames]:
    run = run_of(name)
    return run, film_on_trace(run, frame_times(0.0, end, 1.0, RATE))


def turn_of(shown: Frames) -> NDArray[np.float64]:
    assert shown.turn is not None
    return shown.turn


def test_times_of_frames() -> None:
    np.testing.assert_array_equal(frame_times(1.0, 1.2, 0.5, 10), 1.0 + 0.05 * np.arange(5))
    assert len(frame_times(0.0, 8.0, 1.0, RATE)) == 8 * RATE + 1
    assert frame_times(0.0, 60.0, 7.0, 3)[-1] <= 60.0
    assert len(frame_times(0.0, 19999.0, 1.0, 1)) == 20000
    with pytest.raises(ValueError, match="a film of 20001 frames, expected at most 20000"):
        frame_times(0.0, 20000.0, 1.0, 1)


@pytest.mark.parametrize("pace", [1e-6, 5e-4, 0.02, 0.025, 1.0, 60.0])
@pytest.mark.parametrize("rate", [10, RATE, 50])
def test_the_clock_of_a_film_tells_its_frames_apart(pace: float, rate: int) -> None:
    times = frame_times(0.0, 20 * pace / rate, pace, rate)
    digits = clock_digits(times)
    assert len({f"{time:.{digits}f}" for time in times}) == len(times) == 21
    assert digits == 3 or (digits > 3 and pace / rate < 1e-3)
    assert clock_digits(times[:1]) == 3


def test_the_clock_is_drawn_with_its_decimals() -> None:
    """Frames within a thousandth of a second used to show the same time."""
    run = run_of("three_arcs")
    close = film_on_trace(run, frame_times(1.0, 1.0002, 0.0005, RATE))
    drawn = Film(close, 50.0)
    drawn.picture(1)
    assert "$t = 1.00002$ s" in [text.get_text() for text in drawn.figure.texts]
    page = film_html(close, RATE, "close").decode()
    assert '"digits": 5' in page.replace('":5', '": 5')


def test_a_motion_on_a_small_part_of_the_trace_is_filmed_close_up() -> None:
    """Two balls within 1.5 m of a line of 100 m lay on one another, and did not seem to move."""
    run, close = shown("falling_balls", 10.0)
    drawn = Film(close, 50.0)
    drawn.picture(0)
    (left, right), (bottom, top) = drawn.plan.get_xlim(), drawn.plan.get_ylim()
    radius = run.system.bodies[0].radius
    assert left < close.x.min() - radius
    assert close.x.max() + radius < right < left + 5.0
    assert bottom < close.y.min() - radius
    assert close.y.max() + radius < top
    assert drawn.drawn_radii == [radius, radius]


@pytest.mark.parametrize("beside", [0.0, 3.0])
def test_a_film_of_a_rotating_trace_shows_its_axis_and_its_rate(beside: float) -> None:
    still = example("turning_circle")
    turning = {"x": 1.0 + beside, "rate": 1.5}  # the centre of the circle is 1 m from its left end
    run = solved(still.replace({"trace.turning": turning, "stop": {"time": 0.1}}))
    frames = film_on_trace(run.stored.motion, frame_times(0.0, 0.1, 1.0, RATE))
    plan = FilmFrame(frames, 50.0).plan
    assert [1.0 + beside] * 2 in [np.asarray(line.get_xdata()).tolist() for line in plan.lines]
    assert plan.get_xlim()[0] < 1.0 + beside < plan.get_xlim()[1]
    assert [text.get_text() for text in plan.texts] == [r"$\Omega = 1.5$ rad/s"]


def test_a_frame_is_on_the_flight_of_its_time() -> None:
    """The energy of a frame is that of its flight, to rounding: states are not interpolated."""
    run, all_frames = shown("three_arcs", 8.0)
    sample = run.sample(all_frames.time)
    flights = run.flights()
    for body in (0, 1):
        mine = np.flatnonzero(flights["ball"] == body + 1)
        at = np.searchsorted(flights["t_start"][mine], all_frames.time, side="right") - 1
        starts = run.sample(flights["t_start"][mine][at])
        np.testing.assert_allclose(sample["energy"][body::2], starts["energy"][body::2], rtol=1e-12)
        kinetic = 0.5 * 1.4 * run.system.bodies[body].mass * all_frames.up[:, body] ** 2
        potential = run.system.bodies[body].mass * run.system.gravity * all_frames.y[:, body]
        own = kinetic + potential
        level = own - sample["energy"][body::2]
        np.testing.assert_allclose(level, level[0], atol=1e-11 * np.max(own))


def test_bodies_turn_as_they_roll() -> None:
    """The angle is the path of the centre divided by the radius: the time integral of v/r."""
    run, all_frames = shown("three_arcs", 1.5)
    end = float(all_frames.time[-1])
    fine = run.sample(np.linspace(0.0, end, 30001))
    step = end / 30000
    for body in (0, 1):
        speed = fine["speed"][body::2]
        turned = np.sum(0.5 * (speed[1:] + speed[:-1])) * step / run.system.bodies[body].radius
        assert turn_of(all_frames)[-1, body] == pytest.approx(turned, abs=1e-5)
        assert abs(turned) > 1.0


def test_turning_goes_on_over_the_seam() -> None:
    run, all_frames = shown("closed_three_balls", 10.0)
    steps = np.abs(np.diff(all_frames.across, axis=0))
    assert np.max(steps) > 0.5 * run.system.trace.length  # one did pass the seam
    fastest = np.max(np.abs(all_frames.up)) / min(body.radius for body in run.system.bodies)
    assert np.max(np.abs(np.diff(turn_of(all_frames), axis=0))) < 1.5 * fastest / RATE


def test_a_sliding_particle_does_not_turn() -> None:
    _, all_frames = shown("particle_on_arcs", 1.0)
    assert not np.any(turn_of(all_frames))


def test_trails_jump_where_the_impacts_are() -> None:
    run, all_frames = shown("three_arcs", 8.0)
    table = run.collisions
    rows = np.flatnonzero(table["t"] <= 8.0)
    assert len(rows) > 2
    for body, side in enumerate("ab"):
        way = all_frames.trails[body]
        assert np.all(np.diff(way.time) >= 0.0)
        for row in rows:
            (at,) = np.flatnonzero(
                (way.time[:-1] == table["t"][row]) & (way.time[1:] == table["t"][row])
            )
            assert way.across[at] == way.across[at + 1] == table[f"s_{side}"][row]
            assert way.up[at] == table[f"speed_{side}_pre"][row]
            assert way.up[at + 1] == table[f"speed_{side}_post"][row]


def test_trails_break_at_the_seam() -> None:
    run, all_frames = shown("closed_three_balls", 10.0)
    ways = all_frames.trails
    assert any(np.any(np.isnan(way.across)) for way in ways)
    for way in ways:
        assert np.nanmax(np.abs(np.diff(way.across))) < 0.5 * run.system.trace.length


def test_trails_go_on_from_wall_to_wall_of_an_open_trace() -> None:
    """A fast body that crosses more than half the trace between two points of its trail."""
    scenario = any_scenario_of({
        "gravity": 9.81,
        "trace": {
            "start_slope": -0.2,
            "arcs": [{"shape": "valley", "radius": 1.0, "end_slope": 0.2}],
        },
        "balls": [{"radius": 0.01, "mass": 1.0, "arc": 1, "angle": 0.0, "speed": 12.0}],
        "ends": {"left": {"wall": 1.0}, "right": {"wall": 1.0}},
        "stop": {"time": 1.0},
    })  # fmt: skip
    run = simulate(scenario)
    (way,) = film_on_trace(run, frame_times(0.0, 1.0, 1.0, RATE)).trails
    assert np.max(np.abs(np.diff(way.across))) > 0.9 * run.system.trace.length
    assert np.all(np.isfinite(way.across))


def test_the_plane_shows_the_speeds_at_impacts_between_frames() -> None:
    run = run_of("five_balls")
    frames = film_on_trace(run, frame_times(0.0, 2.0, 0.5, 10))
    table, plane = run.collisions, FilmFrame(frames, 50.0).plane
    rows = table["t"] <= 2.0
    speeds = np.concatenate(
        [table[f"speed_{side}_{when}"][rows] for side in "ab" for when in ("pre", "post")]
    )
    assert np.max(np.abs(speeds)) > np.max(np.abs(frames.up))
    low, high = plane.get_ylim()
    assert low < np.min(speeds)
    assert np.max(speeds) < high


def test_the_stage_places_what_it_shows() -> None:
    """Compare pixels by the map of the page with those of matplotlib."""
    _, all_frames = shown("three_arcs", 1.0)
    stage = FilmFrame(all_frames, 100.0)
    for axes in (stage.plan, stage.plane):
        a, b, c, d = stage.place(axes)
        x, y = axes.transData.transform((0.7, 0.3))
        assert (a + b * 0.7, 360.0 - (c + d * 0.3)) == pytest.approx((x, y), abs=1e-6)
    a, b, c, d = stage.place(stage.plan)
    assert -d == pytest.approx(b, rel=1e-9)  # to scale


@pytest.mark.parametrize("name", ["three_arcs", "one_circle"])
def test_gif_has_the_frames_and_the_bodies_where_they_are(name: str) -> None:
    run, all_frames = shown(name, 0.6)
    content = movie(all_frames, RATE, "gif")
    assert movie(all_frames, RATE, "gif") == content
    film = Image.open(BytesIO(content))
    assert film.n_frames == len(all_frames.time)  # type: ignore[attr-defined]
    assert film.info["duration"] == 1000 // RATE
    a, b, c, d = FilmFrame(all_frames, 100.0).place(FilmFrame(all_frames, 100.0).plan)
    for frame in (0, 7, 15):
        film.seek(frame)
        picture = np.asarray(film.convert("RGB"), dtype=np.int64)
        for body, colour in enumerate([(0, 114, 178), (213, 94, 0)]):
            # beside the mark, which points away from there
            turn = turn_of(all_frames)[frame, body]
            reach = 0.5 * run.system.bodies[body].radius
            x = a + b * (all_frames.x[frame, body] - reach * math.sin(turn))
            y = c + d * (all_frames.y[frame, body] - reach * math.cos(turn))
            assert np.max(np.abs(picture[int(y), int(x)] - colour)) < 40


def test_every_frame_of_a_gif_is_its_picture_and_has_its_time() -> None:
    """Nothing of the frames before is left, and frames in which nothing moves are there."""
    _, moving = shown("three_arcs", 0.6)
    rows = [0, 1, 1, *range(2, len(moving.time))]
    names = ("time", "x", "y", "turn", "across", "up")
    all_frames = replace(moving, **{name: getattr(moving, name)[rows] for name in names})
    film = Image.open(BytesIO(movie(all_frames, RATE, "gif")))
    drawn = Film(all_frames, 100.0)
    assert film.n_frames == len(rows)  # type: ignore[attr-defined]
    for frame in range(len(rows)):
        film.seek(frame)
        assert film.info["duration"] == 1000 // RATE
        picture = np.asarray(film.convert("RGB"), dtype=np.int64)
        # So coarse are 63 colours; a body or a line too many is off by twice as much.
        assert np.max(np.abs(picture - drawn.picture(frame))) < 80


@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="there is no ffmpeg")
def test_mp4_has_the_frames_and_the_same_bytes() -> None:
    _, all_frames = shown("three_arcs", 0.6)
    content = movie(all_frames, RATE, "mp4")
    assert movie(all_frames, RATE, "mp4") == content
    asked = "-v error -of json -count_frames -show_entries stream=width,height,nb_read_frames"
    told = subprocess.run(["ffprobe", *asked.split(), "-"], input=content, capture_output=True)
    (stream,) = json.loads(told.stdout)["streams"]
    assert (stream["width"], stream["height"]) == (1280, 720)
    assert int(stream["nb_read_frames"]) == len(all_frames.time)


def test_without_ffmpeg_the_reader_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    _, all_frames = shown("three_arcs", 0.6)
    monkeypatch.setenv("PATH", str(GALLERY))
    with pytest.raises(NoFilm, match=r"the program ffmpeg, which is not there; \.gif and"):
        movie(all_frames, RATE, "mp4")


def test_what_ffmpeg_says_is_passed_on(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    bad = tmp_path / "ffmpeg"
    bad.write_text("#!/bin/sh\necho 'Unknown encoder libx264' >&2\nexit 3\n")
    bad.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=":")
    _, all_frames = shown("three_arcs", 0.6)
    with pytest.raises(NoFilm, match="could not write the film: Unknown encoder libx264"):
        movie(all_frames, RATE, "mp4")


@cache
def film_of(name: str, pace: float) -> tuple[Solved, Frames]:
    """Return a run of any system, and a film of its first seconds."""
    run = solved(example(name))
    end = min(6.0, run.summary["end_time"])
    shown = run.stored
    return run, shown.kind.film(shown, frame_times(0.0, end, pace, RATE))


@pytest.mark.parametrize("name", ["two_disks", "elliptic_wall", "skew_impact"])
@pytest.mark.parametrize("pace", [0.5, 7.0])
def test_trails_of_springs_and_tables_are_on_the_motion(name: str, pace: float) -> None:
    """Corners of a trail, and the middles of its straight parts, against the motion sampled."""
    run, shown = film_of(name, pace)
    system, bodies = run.solved.system, len(shown.ground.radii)
    up = "speed" if shown.ground.panel else "y"
    size = [max(float(np.ptp(one)), 1e-3) for one in (shown.across, shown.up)]
    for body, way in enumerate(shown.trails):
        assert len(way.time) >= len(shown.time)
        whole = np.isfinite(way.across)
        early, late = (run.sample(way.time[whole], side=side) for side in ("before", "after"))
        for place, name_of, scale in ((way.across, "x", size[0]), (way.up, up, size[1])):
            apart = [np.abs(one[name_of][body::bodies] - place[whole]) for one in (early, late)]
            assert np.max(np.minimum(*apart)) < 1e-9 * scale
        steps = np.flatnonzero(np.diff(way.time) > 0.0)
        steps = steps[whole[steps] & whole[steps + 1]]
        middle = run.sample(0.5 * (way.time[steps] + way.time[steps + 1]))
        for place, name_of, scale in ((way.across, "x", size[0]), (way.up, up, size[1])):
            drawn = 0.5 * (place[steps] + place[steps + 1])
            # a line is 1/200 of the panel wide
            assert np.max(np.abs(middle[name_of][body::bodies] - drawn)) < 5e-3 * scale
    assert len(system.bodies) == bodies


def test_springs_reach_from_their_feet_to_the_bodies() -> None:
    run, shown = film_of("two_disks", 0.5)
    for body, link in enumerate(shown.ground.links):
        points = link.points(shown.x[9, body], shown.y[9, body])
        spring = run.solved.system.springs[body]
        assert points[0] == pytest.approx((spring.foot, spring.height))
        assert points[-1] == pytest.approx((shown.x[9, body], 0.0), abs=1e-15)


@pytest.mark.parametrize("name", ["two_disks", "elliptic_wall"])
def test_films_of_other_systems_show_the_bodies_where_they_are(name: str) -> None:
    _, shown = film_of(name, 0.5)
    film = Film(shown, 100.0)
    a, b, c, d = film.place(film.plan)
    for frame in (0, 7, 15):
        picture = film.picture(frame).astype(np.int64)
        for body, colour in enumerate([(0, 114, 178), (213, 94, 0)][: len(shown.trails)]):
            turn = 0.0 if shown.turn is None else shown.turn[frame, body]
            reach = 0.5 * film.drawn_radii[body]
            x = a + b * (shown.x[frame, body] - reach * math.sin(turn))
            y = c + d * (shown.y[frame, body] - reach * math.cos(turn))
            assert np.max(np.abs(picture[int(y), int(x)] - colour)) < 40


def test_balls_of_a_gas_do_not_overlap_in_a_film() -> None:
    """A quarter of the table is covered, as it is, not all of it: a ball has no more than its area.

    The wall is 150 pixels from its centre on a film of 640 by 360, a ball then two.
    """
    radius, n = 0.01, 400
    balls = [
        {"radius": radius, "mass": 1.0, "x": 0.033 * (i % 20), "y": 0.033 * (i // 20)}
        for i in range(n)
    ]
    wall = {"shape": "circle", "radius": 0.75, "x": 0.3, "y": 0.3, "k": 1.0}
    scenario = {"system": "table", "wall": wall, "balls": balls, "collision": {"k": 1.0}}
    run: Any = simulate(any_scenario_of(scenario | {"stop": {"time": 0.1}}))
    film = Film(run.kind.film(run, np.array([0.0, 0.1])), 100.0)
    a, b, c, d = film.place(film.plan)
    corner = [int(place + step * -0.0165) for place, step in ((a, b), (c, d))]
    opposite = [int(place + step * (0.033 * 19 + 0.0165)) for place, step in ((a, b), (c, d))]
    (left, right), (low, high) = (sorted(pair) for pair in zip(corner, opposite, strict=True))
    white = np.all(film.picture(0)[low:high, left:right] == 255, axis=2)
    assert np.mean(white) > 0.3
