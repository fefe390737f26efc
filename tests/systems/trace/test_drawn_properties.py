"""Laws that every run obeys, on the scenes that the stress suite draws: most of them are hard."""

from __future__ import annotations

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.strategies import FEWER, NUMBERS, SETTINGS, drawn
from tests.systems.trace.test_continuing import assert_same_results
from vibro_cli.mechanics.system import TraceSystem
from vibro_cli.stress.physics import judge
from vibro_cli.stress.scenes import system_of
from vibro_cli.systems.driver import ENGINES
from vibro_cli.systems.run import Run
from vibro_cli.systems.trace import simulate_system

pytestmark = pytest.mark.usefixtures("no_hang")
# The interpreter would take minutes for some of the accumulations.
MOST_IMPACTS = 60
# In a process of its own, with limits of time and memory.
judged = judge()


@SETTINGS
@given(number=NUMBERS)
def test_a_run_ends_and_obeys_mechanics(number: int) -> None:
    """No overlap, order, energy, the laws' own balances, the mirror image."""
    assert judged(drawn(number)) == []


def solve(system: TraceSystem, time: float, engine: str) -> Run:
    return simulate_system(system, time, MOST_IMPACTS, engine)


@FEWER
@given(number=NUMBERS, share=st.floats(0.01, 0.99))
def test_split_run(number: int, share: float) -> None:
    """Stopped at any time and taken up again by the other engine, a run has the same bits."""
    document = drawn(number)
    system, time = system_of(document), document["stop"]["time"]
    whole = solve(system, time, "compiled")
    part = share * float(whole.summary_record()["end_time"])
    if part == 0.0:
        return
    begun = solve(system, part, ENGINES[number % 2])
    assert begun.end_cause == "time"
    rest = simulate_system(
        system, time, MOST_IMPACTS, ENGINES[1 - number % 2],
        checkpoint=json.loads(json.dumps(begun.checkpoint())), history=begun.history(),
    )  # fmt: skip
    assert_same_results(whole, rest)


@FEWER
@given(number=NUMBERS)
def test_both_engines_give_the_same_tables(number: int) -> None:
    document = drawn(number)
    system, time = system_of(document), document["stop"]["time"]
    interpreted, compiled = (solve(system, time, engine) for engine in ("python", "compiled"))
    assert interpreted.end_cause == compiled.end_cause
    for ours, theirs in (
        (interpreted.collisions, compiled.collisions),
        (interpreted.summary, compiled.summary),
    ):
        for name in ours:
            assert repr(ours[name].tolist()) == repr(theirs[name].tolist()), name
