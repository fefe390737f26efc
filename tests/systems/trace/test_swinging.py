"""The fast path of two bodies from impact to impact: the rows of the event loop, to the bit."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from vibro_cli.kernels.impact.laws import LAW_NAMES
from vibro_cli.mechanics.system import TraceSystem
from vibro_cli.stress.scenes import scene, system_of, three_arcs, valley
from vibro_cli.systems.driver import Driver
from vibro_cli.systems.request import Limits
from vibro_cli.systems.trace.system import LOOP
from vibro_cli.systems.trace.world import make_world

VALLEY, CHAIN = valley(80), three_arcs(80)


def _system(trace: dict[str, Any], angles: tuple[float, float], law: str, k: float) -> TraceSystem:
    ball = {"radius": 0.1, "density": 7800.0, "arc": 1}
    second = {"radius": 0.13 if law == "hedrih" else 0.1, "density": 2700.0}
    balls = [ball | {"angle": angles[0]}, ball | second | {"angle": angles[1]}]
    ends = {"left": {"wall": 0.9}, "right": {"wall": 0.9}}
    return system_of(scene(trace, balls, k, law, collisions=300) | {"ends": ends})


def _run(system: TraceSystem, engine: str) -> Driver:
    driver = Driver(LOOP, make_world(system, Limits(collisions=300)), engine)
    driver.run()
    return driver


@pytest.mark.parametrize("law", LAW_NAMES)
@pytest.mark.parametrize("k", [1.0, 0.99])
@pytest.mark.parametrize(
    ("trace", "angles"),
    [(VALLEY, (-0.72, 0.54)), (VALLEY, (-1.25, 0.2)), (VALLEY, (-0.6, 0.6)), (CHAIN, (-1.2, 0.1))],
    ids=["swings", "walls", "even", "chain"],
)
def test_rows_of_the_event_loop(
    trace: dict[str, Any], angles: tuple[float, float], k: float, law: str
) -> None:
    system = _system(trace, angles, law, k)
    ours, theirs = _run(system, "compiled"), _run(system, "python")
    logs, their_logs = ours.drain(), theirs.drain()
    for name in LOOP.logs:
        a, b = logs[name], their_logs[name]
        for field in a.dtype.names:
            np.testing.assert_array_equal(a[field], b[field], f"{name}.{field}")
    assert ours.clock_value("energy_correction") == theirs.clock_value("energy_correction")
    assert ours.clock_value("collisions") == theirs.clock_value("collisions") > 10
    for name in LOOP.work_done:
        assert ours.clock_value(name) == theirs.clock_value(name)


@pytest.mark.parametrize("engine", ["compiled", "python"])
def test_rows_keep_nothing_of_the_lasting_contact_logged_there_before(engine: str) -> None:
    driver = _run(_system(CHAIN, (-1.2, 0.1), law="normal-impulse", k=0.495), engine)
    rows = driver.drain()["log"]
    alone = rows[rows["grouped"] == 0]
    assert 100 < len(alone) < len(rows) - 100
    for field in ("group_count", "flow_s", "flow_c", "rate_ratio", "frequency", "segment"):
        assert not alone[field].any(), field
