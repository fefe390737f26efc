"""Films: every frame is the motion at its time, and the files are what they say."""

from __future__ import annotations

import json
import math
import shutil
import subprocess
from functools import cache
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from vibro_cli.api import Run, simulate
from vibro_cli.figures.film import Frames, NoFilm, Stage, frame_times, frames, movie, trail
from vibro_cli.scenario import load_scenario

FOLDER = Path(__file__).parents[2] / "scenarios"
RATE = 25


@cache
def run_of(name: str, *overrides: str) -> Run:
    return simulate(load_scenario(FOLDER / f"{name}.toml", [*overrides]))


@cache
def shown(name: str, end: float) -> tuple[Run, Frames]:
    run = run_of(name)
    return run, frames(run, frame_times(0.0, end, 1.0, RATE))


def test_times_of_frames() -> None:
    np.testing.assert_array_equal(frame_times(1.0, 1.2, 0.5, 10), 1.0 + 0.05 * np.arange(5))
    assert len(frame_times(0.0, 8.0, 1.0, RATE)) == 8 * RATE + 1
    assert frame_times(0.0, 60.0, 7.0, 3)[-1] <= 60.0


def test_a_frame_is_on_the_flight_of_its_time() -> None:
    """Energy of a frame is that of its flight, to rounding: nothing lies between two states."""
    run, all_frames = shown("three_arcs", 8.0)
    sample = run.sample(all_frames.time)
    flights = run.flights()
    for body in (0, 1):
        mine = np.flatnonzero(flights["ball"] == body + 1)
        at = np.searchsorted(flights["t_start"][mine], all_frames.time, side="right") - 1
        starts = run.sample(flights["t_start"][mine][at])
        np.testing.assert_allclose(sample["energy"][body::2], starts["energy"][body::2], rtol=1e-12)
        kinetic = 0.5 * 1.4 * run.system.bodies[body].mass * all_frames.speed[:, body] ** 2
        potential = run.system.bodies[body].mass * run.system.gravity * all_frames.y[:, body]
        own = kinetic + potential
        level = own - sample["energy"][body::2]
        np.testing.assert_allclose(level, level[0], atol=1e-11 * np.max(own))


def test_bodies_turn_as_they_roll() -> None:
    """By the way of the centre through the radius: the time integral of v/r."""
    run, all_frames = shown("three_arcs", 1.5)
    end = float(all_frames.time[-1])
    fine = run.sample(np.linspace(0.0, end, 30001))
    step = end / 30000
    for body in (0, 1):
        speed = fine["speed"][body::2]
        turned = np.sum(0.5 * (speed[1:] + speed[:-1])) * step / run.system.bodies[body].radius
        assert all_frames.turn[-1, body] == pytest.approx(turned, abs=1e-5)
        assert abs(turned) > 1.0


def test_turning_goes_on_over_the_seam() -> None:
    run, all_frames = shown("closed_three_balls", 10.0)
    steps = np.abs(np.diff(all_frames.s, axis=0))
    assert np.max(steps) > 0.5 * run.system.trace.length  # one did pass the seam
    fastest = np.max(np.abs(all_frames.speed)) / min(body.radius for body in run.system.bodies)
    assert np.max(np.abs(np.diff(all_frames.turn, axis=0))) < 1.5 * fastest / RATE


def test_a_sliding_particle_does_not_turn() -> None:
    _, all_frames = shown("particle_on_arcs", 1.0)
    assert not np.any(all_frames.turn)


def test_trails_jump_where_the_impacts_are() -> None:
    run, all_frames = shown("three_arcs", 8.0)
    table = run.collisions
    rows = np.flatnonzero(table["t"] <= 8.0)
    assert len(rows) > 2
    for body, side in enumerate("ab"):
        way = trail(run, all_frames, body)
        assert np.all(np.diff(way.time) >= 0.0)
        for row in rows:
            (at,) = np.flatnonzero(
                (way.time[:-1] == table["t"][row]) & (way.time[1:] == table["t"][row])
            )
            assert way.s[at] == way.s[at + 1] == table[f"s_{side}"][row]
            assert way.speed[at] == table[f"speed_{side}_pre"][row]
            assert way.speed[at + 1] == table[f"speed_{side}_post"][row]


def test_trails_break_at_the_seam() -> None:
    run, all_frames = shown("closed_three_balls", 10.0)
    ways = [trail(run, all_frames, body) for body in range(3)]
    assert any(np.any(np.isnan(way.s)) for way in ways)
    for way in ways:
        assert np.nanmax(np.abs(np.diff(way.s))) < 0.5 * run.system.trace.length


def test_the_stage_places_what_it_shows() -> None:
    """Pixels from the map of the page against matplotlib's own."""
    run, all_frames = shown("three_arcs", 1.0)
    stage = Stage(run, all_frames, 100.0)
    for axes in (stage.plan, stage.phase):
        a, b, c, d = stage.place(axes)
        x, y = axes.transData.transform((0.7, 0.3))
        assert (a + b * 0.7, 360.0 - (c + d * 0.3)) == pytest.approx((x, y), abs=1e-6)
    a, b, c, d = stage.place(stage.plan)
    assert -d == pytest.approx(b, rel=1e-9)  # to scale


@pytest.mark.parametrize("name", ["three_arcs", "one_circle"])
def test_gif_has_the_frames_and_the_bodies_where_they_are(name: str) -> None:
    run, all_frames = shown(name, 0.6)
    content = movie(run, all_frames, RATE, "gif")
    assert movie(run, all_frames, RATE, "gif") == content
    film = Image.open(BytesIO(content))
    assert film.n_frames == len(all_frames.time)  # type: ignore[attr-defined]
    assert film.info["duration"] == 1000 // RATE
    a, b, c, d = Stage(run, all_frames, 100.0).place(Stage(run, all_frames, 100.0).plan)
    for frame in (0, 7, 15):
        film.seek(frame)
        picture = np.asarray(film.convert("RGB"), dtype=np.int64)
        for body, colour in enumerate([(0, 114, 178), (213, 94, 0)]):
            # beside the mark, which points away from there
            turn = all_frames.turn[frame, body]
            reach = 0.5 * run.system.bodies[body].radius
            x = a + b * (all_frames.x[frame, body] - reach * math.sin(turn))
            y = c + d * (all_frames.y[frame, body] - reach * math.cos(turn))
            assert np.max(np.abs(picture[int(y), int(x)] - colour)) < 40


@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="there is no ffmpeg")
def test_mp4_has_the_frames_and_the_same_bytes() -> None:
    run, all_frames = shown("three_arcs", 0.6)
    content = movie(run, all_frames, RATE, "mp4")
    assert movie(run, all_frames, RATE, "mp4") == content
    asked = "-v error -of json -count_frames -show_entries stream=width,height,nb_read_frames"
    told = subprocess.run(["ffprobe", *asked.split(), "-"], input=content, capture_output=True)
    (stream,) = json.loads(told.stdout)["streams"]
    assert (stream["width"], stream["height"]) == (1280, 720)
    assert int(stream["nb_read_frames"]) == len(all_frames.time)


def test_without_ffmpeg_the_reader_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    run, all_frames = shown("three_arcs", 0.6)
    monkeypatch.setenv("PATH", str(FOLDER))
    with pytest.raises(NoFilm, match=r"the program ffmpeg, which is not there; \.gif and"):
        movie(run, all_frames, RATE, "mp4")


def test_what_ffmpeg_says_is_passed_on(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    bad = tmp_path / "ffmpeg"
    bad.write_text("#!/bin/sh\necho 'Unknown encoder libx264' >&2\nexit 3\n")
    bad.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=":")
    run, all_frames = shown("three_arcs", 0.6)
    with pytest.raises(NoFilm, match="could not write the film: Unknown encoder libx264"):
        movie(run, all_frames, RATE, "mp4")
