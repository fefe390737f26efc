"""Randomly drawn scenes, and the checks of their runs."""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tests.gallery import hard_case
from vibro_cli.kernels.impact.laws import LAW_NAMES
from vibro_cli.mechanics.system import TraceSystem
from vibro_cli.stress import physics
from vibro_cli.stress.drawing import draw
from vibro_cli.stress.physics import (
    check_drawn,
    distance_from_image,
    faults_of_document,
    judge,
    mirrored_system,
)
from vibro_cli.stress.scenes import (
    VALLEY,
    Document,
    GivenUp,
    Plan,
    Watched,
    ball,
    scene,
    solve,
    system_of,
)
from vibro_cli.stress.suite import line_of
from vibro_cli.systems.run import Run
from vibro_cli.systems.trace import simulate_system


@pytest.fixture(scope="module")
def documents() -> list[Document]:
    return [draw(3, number) for number in range(400)]


def test_the_same_number_is_the_same_scene() -> None:
    assert draw(3, 17) == draw(3, 17)
    assert draw(3, 17) != draw(3, 18)
    assert draw(3, 17)["name"] == "drawn-3-17"


def test_everything_is_drawn(documents: list[Document]) -> None:
    def some(wanted: Any, least: int = 8) -> bool:
        return sum(bool(wanted(document)) for document in documents) >= least

    assert some(lambda d: d["trace"]["closed"])
    assert some(lambda d: "turning" in d["trace"])
    assert some(lambda d: d["trace"].get("surface") == "one-sided")
    assert some(lambda d: any("touching" in one for one in d["balls"]))
    assert some(lambda d: len({one["radius"] for one in d["balls"]}) > 1)
    for count in range(2, 6):
        assert some(lambda d, count=count: len(d["balls"]) == count)
    for law in LAW_NAMES:
        assert some(lambda d, law=law: d.get("collision", {}).get("law") == law)
    for k in (0.0, 1.0):
        assert some(lambda d, k=k: d.get("collision", {}).get("k") == k)
        assert some(lambda d, k=k: {"wall": k} in d.get("ends", {}).values())
    lines = [
        slope
        for document in documents
        for piece in system_of(document).trace.pieces
        for slope in [piece.start_slope] if piece.is_line
    ]  # fmt: skip
    assert lines.count(0.0) > 8
    assert min(lines) < -1.6
    assert max(lines) > 1.6


@pytest.fixture(scope="module")
def a_run() -> Run:
    document = scene(VALLEY, [ball(-0.6), ball(0.5)], 0.7, time=3.0)
    document["ends"] = {"left": {"wall": 0.5}, "right": {"wall": 0.5}}
    return solve(document)


def test_a_good_run_has_no_faults(a_run: Run) -> None:
    assert physics.faults_of(a_run) == []


def kinds(faults: Iterable[physics.Fault]) -> list[str]:
    return [fault.kind for fault in faults]


def test_faults_are_found(a_run: Run) -> None:
    motion = physics.motion_of(a_run, 200)
    nearer = motion._replace(x=motion.x * (1.0 - 1e-9))
    assert kinds(physics.overlaps(a_run, nearer)) == ["overlap"]
    assert kinds(physics.order(a_run, motion._replace(s=motion.s[:, ::-1]))) == ["order"]
    assert kinds(physics.jumps(a_run, motion._replace(x=np.round(motion.x, 1)))) == ["jump"]
    faster = motion.speed * np.linspace(1.0, 1.001, len(motion.t))[:, None]
    assert "energy_grows" in kinds(physics.energy(a_run, motion._replace(speed=faster)))
    slower = motion.speed * np.linspace(1.0, 0.999, len(motion.t))[:, None]
    assert "energy_lost" in kinds(physics.energy(a_run, motion._replace(speed=slower)))
    frozen = motion.speed.copy()
    frozen[20:30, 1] = 0.0
    assert kinds(physics.standing(a_run, motion._replace(speed=frozen))) == ["standing"]
    last = a_run.system.trace.pieces[-1]
    x, y, s = motion.x.copy(), motion.y.copy(), motion.s.copy()
    x[3, 1], y[3, 1] = last.body_centre(last.angle_end - 0.05, 0.1)
    s[3, 1] = last.start_s + last.length
    assert kinds(physics.walls(a_run, motion._replace(x=x, y=y, s=s))) == ["wall"]


def test_the_mirror_image_of_a_good_run(a_run: Run) -> None:
    def solved(system: TraceSystem) -> Run:
        return simulate_system(system, 3.0, None, "python")

    assert distance_from_image(a_run, solved) == (0.0, 0.0)

    def heavier_image(system: TraceSystem) -> Run:
        is_image = system.initial[0].position == -0.5
        return solved(replace(system, gravity=system.gravity * (1.01 if is_image else 1.0)))

    assert distance_from_image(a_run, heavier_image)[0] > 1e-6


def test_the_image_of_the_image_is_the_system(documents: list[Document]) -> None:
    for document in documents[:60]:
        system = system_of(document)
        again = mirrored_system(mirrored_system(system))
        assert again.bodies == system.bodies
        assert again.restitution == system.restitution
        assert [one.piece for one in again.initial] == [one.piece for one in system.initial]
        for one, other in zip(again.initial, system.initial, strict=True):
            assert one.position == pytest.approx(other.position, abs=1e-14)


def _use_up(document: Document) -> int:
    """Use memory or time without limit."""
    if document["what"] == "memory":
        try:
            return len(bytearray(3 * 2**30))
        except MemoryError:
            return -1
    begin = time.process_time()
    while time.process_time() - begin < document["seconds"]:
        pass
    return 0


def _small_run(document: Document) -> int:
    return _use_up(document) if "what" in document else 0


def test_limits_of_time_and_memory() -> None:
    watched = Watched(_small_run, 2**30)
    assert watched({"what": "memory"}) == -1
    with pytest.raises(GivenUp, match="no end within"):
        watched({"what": "time", "seconds": 20.0}, 0.2)
    # Another process is started then.
    assert watched({"what": "time", "seconds": 0.0}) == 0


def test_a_run_without_an_end_is_a_fault() -> None:
    judged = judge(seconds=1.0)
    endless = scene(VALLEY, [ball(-0.5), ball(0.5)], 1.0, time=1e9)
    assert kinds(judged(endless)) == ["failed"]
    assert judged({**endless, "stop": {"time": 1.0}}) == []


def test_a_single_run_that_takes_too_long_is_a_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("vibro_cli.stress.physics.SECONDS", 0.0)
    (fault,) = faults_of_document(draw(1, 0))
    assert fault.kind == "failed"
    assert "a run took" in fault.text


def test_so_many_scenes_as_asked_for() -> None:
    findings = check_drawn(Plan(3, False, 4))
    assert {finding.cases for finding in findings} == {4}
    assert [line_of(one) for one in findings if one.mark != 0.0] == []


@pytest.mark.parametrize(
    "name",
    [
        "laws_of_two_pairs_at_once",
        "contracting_to_rest_across",
        "row_struck_again_and_again_at_a_wall",
    ],
)
def test_sequences_at_one_instant_have_mirror_images(name: str) -> None:
    document = hard_case(name)

    def solved(system: TraceSystem) -> Run:
        return simulate_system(system, document["stop"]["time"], None)

    assert distance_from_image(solved(system_of(document)), solved) == (0.0, 0.0)


def test_impacts_that_do_not_get_on_are_told(a_run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    assert list(physics.ending(a_run)) == []
    monkeypatch.setattr(physics, "CROWDED", 1)
    assert list(physics.ending(a_run)) == []
    monkeypatch.setattr(physics, "MOMENT", 10.0)
    assert kinds(physics.ending(a_run)) == ["ending"]


def test_a_row_that_turns_at_its_wall_is_told_up_to_rounding(a_run: Run) -> None:
    """It starts from rest at the wall and returns to it at rest, at 1e-7 m/s by rounding."""
    document = draw(7101, 1390)
    run = simulate_system(system_of(document), document["stop"]["time"], None)
    assert physics.first_graze(run) == pytest.approx(2.9317888, rel=1e-7)
    assert physics.faults_of_document(document) == []
    assert physics.first_graze(a_run) == np.inf


def test_a_pair_that_parts_by_rounding_only_does_not_jump() -> None:
    document = hard_case("launched_without_parting")
    run = simulate_system(system_of(document), document["stop"]["time"], None)
    assert list(physics.jumps(run, physics.motion_of(run, 500))) == []


def test_a_row_whose_order_rounding_decides_has_no_mirror_image_from_there_on(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A body bounces between its neighbours, in the last gaps 1e-15 m wide."""
    document = draw(20261125, 44921)
    run = simulate_system(system_of(document), document["stop"]["time"], None)
    assert physics._order_in_doubt(run) == pytest.approx(1.13506404189, rel=1e-9)
    assert physics.faults_of_document(document) == []
    monkeypatch.setattr(physics, "_order_in_doubt", lambda _: np.inf)
    assert kinds(physics.faults_of_document(document)) == ["mirror"]


def test_the_order_of_impacts_with_gaps_between_is_in_no_doubt() -> None:
    document = draw(20261125, 44921)
    run = simulate_system(system_of(document), 1.13, None)
    assert physics._order_in_doubt(run) == np.inf


def test_a_slow_body_at_a_high_bottom_stays_in_contact() -> None:
    """Its energy, measured from the far lower end of the trace, used to move it at each bounce."""
    run = solve(draw(141421, 1137), "compiled")
    assert len(run.collisions["gap"]) > 1000
    assert np.abs(run.collisions["gap"]).max() <= 1e-13
