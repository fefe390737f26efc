"""The motion between impacts: samples on both sides of events, the twin, splits of times."""

from __future__ import annotations

import math
import os
import signal
import time
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests import references
from tests.highprecision.reference_solver import ReferenceSolver, events_of
from vibro_cli.api import simulate, simulate_streamed
from vibro_cli.errors import VibroError
from vibro_cli.scenario import load_any
from vibro_cli.stress.oracles.scene import mp, scene_of_system
from vibro_cli.systems.request import OutputRequest, Sampling
from vibro_cli.systems.run import Run

FOLDER = Path(__file__).parents[3] / "scenarios"
EPSILON = 2.0**-52
NAMES = ("three_arcs", "line_between_valleys", "two_balls_circle", "five_balls_valley")


def of(sample: dict[str, Any], ball: int) -> dict[str, Any]:
    """Return the rows of one ball (from 1)."""
    mine = sample["ball"] == ball
    return {name: column[mine] for name, column in sample.items()}


@pytest.mark.parametrize("name", NAMES)
def test_either_side_of_every_impact(name: str) -> None:
    run = references.run(name)
    table = run.collisions
    for side, when in (("before", "pre"), ("after", "post")):
        sample = run.sample(table["t"], side)
        for row in range(len(table["n"])):
            for end in "ab":
                mine = of(sample, int(table[f"ball_{end}"][row]))
                # The sample is at the time's high double, up to half a unit before the impact.
                assert mine["speed"][row] == pytest.approx(
                    table[f"speed_{end}_{when}"][row], abs=2e-14
                )
                for column in ("s", "x", "y"):
                    assert mine[column][row] == pytest.approx(
                        table[f"{column}_{end}"][row], abs=4e-14
                    )
                assert mine["arc"][row] == table[f"arc_{end}"][row]
                energy = table[f"energy_{end}_{when}"][row]
                assert mine["energy"][row] == pytest.approx(energy, rel=8 * EPSILON)


@pytest.mark.parametrize("name", NAMES)
def test_against_the_ends_of_flights(name: str) -> None:
    run = references.run(name)
    flights = run.flights()
    pieces = run.system.trace.pieces
    for side, when in (("after", "start"), ("before", "end")):
        for index in range(len(flights["ball"])):
            t = float(flights[f"t_{when}"][index])
            if flights["t_end"][index] == flights["t_start"][index]:
                continue
            mine = of(run.sample([t], side), int(flights["ball"][index]))
            assert mine["arc"][0] == flights["arc"][index]
            piece = pieces[int(flights["arc"][index]) - 1]
            place = float(flights[f"angle_{when}"][index])
            assert mine["s"][0] == pytest.approx(piece.arc_length(place), abs=4e-14)
            radius = run.system.bodies[int(flights["ball"][index]) - 1].radius
            rate = float(flights[f"rate_{when}"][index])
            speed = rate if piece.is_line else rate * piece.path_radius(radius)
            assert mine["speed"][0] == pytest.approx(speed, abs=4e-14)


@pytest.mark.parametrize("name", NAMES)
def test_against_the_twin(name: str) -> None:
    """Between events a body is where the twin places it, within the rounding so far."""
    run = references.run(name)
    twin = ReferenceSolver(scene_of_system(references.system(name)))
    checked = 0
    happenings = events_of(run)
    for happening, following in pairwise(happenings[:15]):
        twin.follow([happening])
        if following.t - happening.t < 1e-9:
            continue
        for share in (0.1, 0.5, 0.93):
            t = happening.t + share * (following.t - happening.t)
            sample = run.sample([t])
            for ball in range(len(run.system.bodies)):
                place = twin.at(ball, mp.mpf(t))
                assert sample["arc"][ball] == place.piece + 1
                assert abs(sample["speed"][ball] - place.speed) < 1e-12
                assert abs(sample["x"][ball] - place.centre[0]) < 1e-12
                assert abs(sample["y"][ball] - place.centre[1]) < 1e-12
                if run.system.trace.pieces[place.piece].is_line:
                    assert math.isnan(sample["angle"][ball])
                else:
                    assert abs(sample["angle"][ball] - place.place) < 1e-12
                checked += 1
    assert checked >= 30


@pytest.mark.parametrize("name", NAMES)
def test_times_may_be_split_and_shuffled(name: str) -> None:
    run = references.run(name)
    end = run.summary_record()["end_time"]
    times = np.linspace(0.0, end, 97)
    whole = run.sample(times)
    parts = [run.sample(part) for part in np.array_split(times, 7)]
    for column, values in whole.items():
        np.testing.assert_array_equal(np.concatenate([part[column] for part in parts]), values)
    backwards = run.sample(times[::-1])
    bodies = len(run.system.bodies)
    for column, values in whole.items():
        grid = values.reshape(-1, bodies)
        np.testing.assert_array_equal(backwards[column].reshape(-1, bodies)[::-1], grid)


def test_shape_of_a_sample() -> None:
    run = references.run("five_balls_valley")
    sample = run.sample([0.1, 0.2])
    assert sample["t"].tolist() == [0.1] * 5 + [0.2] * 5
    assert sample["ball"].tolist() == [1, 2, 3, 4, 5] * 2
    assert list(sample) == ["t", "ball", "arc", "angle", "s", "x", "y", "speed", "energy"]
    with pytest.raises(ValueError, match="side: found 'beside', expected 'after'"):
        run.sample([0.1], "beside")


def motion_of(step: str) -> Run:
    return simulate(
        load_any(FOLDER / "three_arcs.toml", ["stop.time=3.0", "stop.collisions=50", step])
    )


def test_motion_table_by_step() -> None:
    run = motion_of("output.step=0.25")
    assert run.motion is not None
    times = np.unique(run.motion["t"])
    np.testing.assert_array_equal(times, 0.25 * np.arange(13))
    sample = run.sample(times)
    for column, values in run.motion.items():
        np.testing.assert_array_equal(sample[column], values)


def test_motion_table_by_times() -> None:
    run = motion_of("output.times=[0.0, 0.3, 2.999]")
    assert run.motion is not None
    assert run.motion["t"].tolist() == [0.0, 0.0, 0.3, 0.3, 2.999, 2.999]


@pytest.mark.parametrize(
    ("wanted", "ends"),
    [
        (OutputRequest(step=0.1), [0.0, 0.3, 0.3, 0.70001, 0.7 + 1e-15, 2.0]),
        (OutputRequest(times=(0.0, 0.1, 0.5, 0.7, 2.0, 3.0)), [0.05, 0.1, 0.5, 0.6, 2.0]),
    ],
)
def test_each_instant_is_in_the_stretch_it_lies_in(
    wanted: OutputRequest, ends: list[float]
) -> None:
    every = [k * 0.1 for k in range(21)] if wanted.times is None else [0.0, 0.1, 0.5, 0.7, 2.0]
    sampling = Sampling(wanted)
    told: list[float] = []
    for end in ends:
        for instants in sampling.until(end, ended=False):
            told += instants.tolist()
        assert told == [t for t in every if t < end]
    for instants in sampling.until(2.0, ended=True):
        told += instants.tolist()
    assert told == every


def test_instants_without_number_take_no_memory() -> None:
    """More instants than any machine could store: 480 TB."""
    parts = Sampling(OutputRequest(step=1e-12)).until(60.0, ended=True)
    first, second = next(parts), next(parts)
    expected = np.arange(len(first) + len(second)) * 1e-12
    assert np.array_equal(np.concatenate([first, second]), expected)


@pytest.mark.parametrize("step", [5e-324, 1e-300, 60.0 * 2.0**-54])
@pytest.mark.parametrize("ended", [False, True])
def test_instants_whose_numbers_are_not_exact_are_refused(step: float, ended: bool) -> None:
    """They were counted down from 1e301 one by one for ever, or overflowed."""
    with pytest.raises(VibroError, match=r"output.step: found .* expected a longer step"):
        next(Sampling(OutputRequest(step=step)).until(60.0, ended))


def test_a_signal_ends_a_run_in_the_midst_of_very_many_samples() -> None:
    """The table is made in a thread of its own; waiting for its 120 million rows takes a minute.

    The signal comes after the first million, however busy the machine is.
    """
    scenario = load_any(FOLDER / "three_arcs.toml", ["output.step=1e-6"])
    rows = 0

    def count(name: str, columns: Any) -> None:
        nonlocal rows
        before = rows
        rows += len(columns["t"]) if name == "motion" else 0
        if before < 1_000_000 <= rows:
            os.kill(os.getpid(), signal.SIGALRM)

    def end(number: int, frame: Any) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGALRM, end)
    began = time.monotonic()
    try:
        with pytest.raises(KeyboardInterrupt):
            simulate_streamed(scenario, count)
    finally:
        signal.signal(signal.SIGALRM, before)
    assert 0 < rows < 120_000_000
    assert time.monotonic() - began < 10.0


def test_no_motion_unless_asked_for() -> None:
    assert references.run("three_arcs").motion is None


def test_energy_of_samples_is_kept_between_impacts() -> None:
    run = references.run("three_arcs")
    first = float(run.collisions["t"][0])
    sample = run.sample(np.linspace(0.0, 0.999 * first, 41))
    for ball in (1, 2):
        mine, body = of(sample, ball), run.system.bodies[ball - 1]
        low = min(piece.body_centre(0.0, body.radius)[1] for piece in run.system.trace.pieces)
        height = mine["y"] - low
        energy = body.mass * (0.5 * body.kappa * mine["speed"] ** 2 + 9.81 * height)
        np.testing.assert_allclose(energy, mine["energy"], rtol=1e-13)


def test_flight_curve_runs_from_end_to_end() -> None:
    run = references.run("line_between_valleys")
    flights = run.flights()
    for index in range(min(12, len(flights["ball"]))):
        t, place, rate = run.flight_curve(index, 9)
        assert len(t) == len(place) == len(rate) == 9
        for column, values in (("t", t), ("angle", place), ("rate", rate)):
            assert values[0] == pytest.approx(flights[f"{column}_start"][index], abs=1e-13)
            assert values[-1] == pytest.approx(flights[f"{column}_end"][index], abs=1e-13)


def test_a_circle_that_begins_at_its_bottom_ends_there(tmp_path: Path) -> None:
    """A body that has come round to the seam is at the end of the circle, not at its beginning."""
    path = tmp_path / "circle.toml"
    path.write_text(
        'gravity = 9.81\ntrace = {start_slope = 0, closed = true, arcs = [{shape = "valley", '
        'radius = 1.5, end_slope = "360 deg"}]}\n'
        "balls = [{radius = 0.1, mass = 1.0, arc = 1, angle = 3.0, rate = 4.0}]\n"
        "stop = {time = 60.0}\n"
    )
    run = simulate(load_any(path))
    flights = run.flights()
    ends = np.flatnonzero(flights["cause_end"] == "crossing")
    assert len(ends) > 30
    for index in ends.tolist():
        assert run.flight_curve(index, 5)[1][-1] == pytest.approx(2.0 * math.pi, abs=1e-13)
    sample = run.sample(flights["t_end"][ends], "before")
    np.testing.assert_allclose(sample["s"], run.system.trace.length, rtol=1e-13)
