"""Runs against the oracle of 40 digits, from walls, simultaneous impacts, lasting contact."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tests.gallery import hard_case
from vibro_cli.stress import digits
from vibro_cli.stress.drawing import draw
from vibro_cli.stress.oracles.oracle import History, Oracle
from vibro_cli.stress.oracles.scene import mp
from vibro_cli.stress.scenes import VALLEY, Document, ball, scene, solve, system_of
from vibro_cli.systems.run import Run

# Each takes the oracle only seconds.
NAMES = (
    "hit_on_a_group_across", "three_against_a_wall", "contact_on_a_turning_line",
    "wall_hit_while_others_close", "bounces_on_a_held_row", "hedrih_stopped_as_it_bounces",
    "turning_slow_crossing", "closes_up_to_rounding", "hit_again_and_again_under_translational",
)  # fmt: skip


@pytest.mark.usefixtures("no_hang")
@pytest.mark.parametrize("name", NAMES)
def test_hard_cases(name: str) -> None:
    document = hard_case(name)
    assert_right(digits.compared(document))


def assert_right(verdict: digits.Verdict) -> None:
    assert verdict.motion is not None, verdict.why
    assert verdict.motion <= digits.MARK
    assert verdict.after is None or verdict.after <= 1e-10
    assert verdict.contacts is None or verdict.contacts <= 1e-10


def two_balls(law: str = "normal-impulse") -> Document:
    document = scene(VALLEY, [ball(-0.7), ball(0.4, mass=2.0)], 0.6, law, time=1.5)
    document["ends"] = {"left": {"wall": 0.5}, "right": {"wall": 0.5}}
    return document


def test_an_inadmissible_impact_from_a_height_lost_in_rounding_is_none() -> None:
    hard = hard_case("closes_up_to_rounding")
    run = solve(hard, "compiled")
    history = History(end_cause="inadmissible", end_approach=mp.mpf("1e-8"))
    assert digits._decided_by_rounding(run, history)
    history.end_approach = mp.mpf("1e-5")
    assert not digits._decided_by_rounding(run, history)


def test_motion_amid_summed_bounces_is_not_compared() -> None:
    # They take 1e-3 s from an impact on, which is known, and end in contact.
    document = scene(VALLEY, [ball(-0.3), ball(0.0)], 0.5, time=2.0)
    run = solve(document, "compiled")
    first = int(np.argmax(run.collisions["contact"]))
    begun, closed = float(run.collisions["t"][first]), float(run.events["t"][0])
    assert run.events["event"][0] == "contact_closed"
    assert begun < closed
    times = np.array([begun - 1e-9, 0.5 * (begun + closed), closed])
    assert digits._amid_bounces(run, times).tolist() == [False, True, False]


def test_a_wrong_motion_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    assert_right(digits.compared(two_balls()))
    exact = digits.motion_at

    def off(run: Run, times: Any) -> Any:
        found = exact(run, times)
        found[-1, 0, 2] *= 1.0 + 1e-11
        return found

    monkeypatch.setattr(digits, "motion_at", off)
    worst = digits.compared(two_balls())
    errors = (worst.motion or 0.0, (worst.after or 0.0) / 1e-14)
    assert max(errors) > 100.0


def test_what_is_not_compared_says_why() -> None:
    still = scene(VALLEY, [ball(-0.7), ball(0.4)], 0.5, time=1.0)
    assert "stop" in digits.compared({**still, "stop": {}}).why


def test_every_number_of_a_document_is_changed() -> None:
    changed = list(digits.changed_documents(two_balls()))
    assert len(changed) == 1 + 2 * 3 + 1 + 1
    assert all(one != two_balls() for one in changed)


def test_bodies_that_touch_without_a_force_are_changed_by_a_gap() -> None:
    def parted(document: Document) -> list[Document]:
        return list(digits.parted_documents(document, solve(document, "compiled")))

    # The second one rolls away from the first; at rest beside it, it leans on it.
    row = [ball(0.1, mass=2.0), {"radius": 0.1, "mass": 1.0, "arc": 1, "touching": "previous"}]
    apart = scene(VALLEY, [row[0], {**row[1], "speed": 1.0}], 0.5, time=1.0)
    (changed,) = parted(apart)
    assert system_of(changed).initial[1].position > system_of(apart).initial[1].position
    assert len(parted(scene(VALLEY, [row[0], {**row[1], "speed": -1.0}], 0.5, time=1.0))) == 1
    assert parted(scene(VALLEY, row, 0.5, time=1.0)) == []


ARCS = [{"shape": "valley", "radius": 0.63, "end_slope": 0.7}]


def three_that_touch(k: float, speed: float) -> Document:
    first = {"body": "hollow_ball", "radius": 0.074, "mass": 2.9, "arc": 1, "angle": -0.14}
    row = {"radius": 0.074, "mass": 2.9, "arc": 1, "touching": "previous", "speed": 0.0}
    balls = [{**first, "speed": speed}, row, {**row, "body": "hollow_ball"}]
    return scene({"start_slope": -0.5, "arcs": ARCS}, balls, k, "normal-impulse", time=0.3)


def motion_of_oracle(document: Document, t: float) -> Any:
    system = system_of(document)
    oracle = Oracle.of(system, digits.MOST_EVENTS)
    oracle.run(mp.mpf(t), [mp.mpf(t)])
    (bodies,) = oracle.history.samples
    return [value for state, x, y in bodies for value in (x, y, state.speed)]


def test_what_parts_bodies_grows_as_the_oracle_says() -> None:
    # Half a hundred impacts among three bodies: 3e6 times, which a gap of 2^-30 m shows in part.
    document, times = three_that_touch(0.97, 0.05), np.array([0.27])
    run = solve(document, "compiled")
    grown = digits.amplification(document, run, times, digits.motion_at(run, times)).max()
    gap = 2.0**-44
    exact = motion_of_oracle(document, 0.27)
    parted = [motion_of_oracle(one, 0.27) for one in digits.parted_documents(document, run, gap)]
    assert len(parted) == 2
    worst = max(abs(x - y) / gap for one in parted for x, y in zip(one, exact, strict=True))
    assert float(worst) > digits.LOST
    assert grown == pytest.approx(float(worst), rel=0.02)


def test_another_sequence_of_impacts_is_no_growth() -> None:
    document, times = draw(5, 44), np.linspace(0.1, 1.0, 10)  # three that touch
    run = solve(document, "compiled")
    ours = digits.motion_at(run, times)
    for gap in (2.0**-30, 2.0**-36, 2.0**-42):
        parted = list(digits.parted_documents(document, run, gap))
        jumps = [np.abs(digits.motion_at(solve(one, "compiled"), times) - ours) for one in parted]
        assert [jump.max() for jump in jumps] == pytest.approx([0.12, 0.12], abs=0.02)
    assert digits.amplification(document, run, times, ours).max() < 100.0
