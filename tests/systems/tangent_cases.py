"""How tests of tangent maps solve a scene, and what the tables of every system must contain."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from vibro_cli.api import simulate, simulate_streamed
from vibro_cli.mechanics.system import TraceSystem
from vibro_cli.scenario import any_scenario_of
from vibro_cli.stress.oracles import sensitivity
from vibro_cli.stress.scenes import Document, Plan
from vibro_cli.systems import system_named
from vibro_cli.systems.request import Limits
from vibro_cli.systems.run import Stretch
from vibro_cli.systems.tangents import TangentMap, followed
from vibro_cli.systems.trace import SYSTEM

TOLD = {"n", "amplification", "digits_left", "smooth", "lyapunov_1", "lyapunov_error"}


def follow(document: Document, engine: str = "compiled") -> tuple[TangentMap, Any, Stretch]:
    scenario = any_scenario_of(document)
    system = system_named(scenario.system)
    return followed(system, system.build(scenario), system.limits(scenario), engine)


def follow_system(
    system: TraceSystem, time: float | None, impacts: int | None, engine: str = "compiled"
) -> Any:
    """Return what is known of the tangent map of a run on a trace, its impacts included."""
    found, columns, whole = followed(SYSTEM, system, Limits(time, impacts), engine, times=True)
    return SimpleNamespace(
        end_time=whole.end[0], matrix=found.matrix(), sums=found.sums, growth=found.growth,
        **columns["collisions"],
    )  # fmt: skip


def check_random_maps(stress: Any, plan: Plan, most: float, patch: pytest.MonkeyPatch) -> None:
    """Compare maps of drawn scenes with exact ones, which tell an error that is put in, too."""
    matrix, derivative = TangentMap.matrix, sensitivity.derivative
    exact: dict[tuple[Any, ...], Any] = {}

    def once(follow: Any, start: Any) -> Any:
        key = tuple(start)
        if key not in exact:
            exact[key] = derivative(follow, start)
        return exact[key]

    patch.setattr(sensitivity, "derivative", once)
    (found,) = stress.check_tangent(plan)
    assert found.cases == plan.cases
    assert found.worst <= most, found
    patch.setattr(TangentMap, "matrix", lambda own: matrix(own) * (1.0 + 1e-8))
    (found,) = stress.check_tangent(plan)
    assert found.cases == plan.cases
    assert not found.met


def solved_and_streamed(scenario: Any) -> tuple[Any, dict[str, dict[str, Any]]]:
    """Return a run and its tables, once kept and once streamed, with the same exponents."""
    told: dict[str, list[Any]] = {}
    streamed = simulate_streamed(
        scenario, lambda name, columns: told.setdefault(name, []).append(columns)
    )
    run = simulate(scenario, "python")
    assert run.exponents is not None
    assert streamed.summary_record() == run.summary_record()
    tables: dict[str, dict[str, Any]] = {"collisions": run.collisions, "exponents": run.exponents}
    if "bounces" in told:
        tables["bounces"] = run.bounces
    for name, columns in tables.items():
        (rows,) = [one for one in told[name] if len(one["n"])]
        assert rows.keys() == columns.keys()
        for key in rows.keys() & TOLD:
            np.testing.assert_array_equal(rows[key], columns[key])
    return run, tables
