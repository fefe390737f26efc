"""Interpreted and compiled kernels are the same functions: every number has the same bits."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vibro_cli.api import load_scenario, simulate
from vibro_cli.simulation.run import Run

FOLDER = Path(__file__).parents[2] / "scenarios"
NAMES = sorted(path.stem for path in FOLDER.glob("*.toml"))
# Long enough for crossings, accumulation and lasting contact, short enough for the interpreter.
AT_MOST = 300


def shortened(name: str) -> list[str]:
    text = (FOLDER / f"{name}.toml").read_text(encoding="utf-8")
    return [f"stop.collisions={AT_MOST}"] if "[collision]" in text else []


def bits(table: dict[str, Any]) -> bytes:
    """All columns, to the bit (a nan and its payload included)."""
    columns = []
    for name, column in table.items():
        values = column.filled(-1) if isinstance(column, np.ma.MaskedArray) else column
        columns.append((name, values.tolist() if values.dtype == object else values.tobytes()))
    return pickle.dumps(columns)


def both(name: str) -> tuple[Run, Run]:
    scenario = load_scenario(FOLDER / f"{name}.toml", shortened(name))
    return simulate(scenario, "python"), simulate(scenario, "numba")


@pytest.mark.usefixtures("compiled")
@pytest.mark.parametrize("name", NAMES)
def test_same_bits(name: str) -> None:
    interpreted, machine = both(name)
    assert (interpreted.engine, machine.engine) == ("python", "numba")
    assert interpreted.end_cause == machine.end_cause
    assert bits(interpreted.collisions) == bits(machine.collisions)
    assert bits(interpreted.flights()) == bits(machine.flights())
    assert bits(interpreted.events) == bits(machine.events)
    assert interpreted.summary_record() == machine.summary_record()
    assert interpreted.statistics() == machine.statistics()


@pytest.mark.usefixtures("compiled")
def test_a_run_that_changes_its_engine_on_the_way() -> None:
    """Left to itself, a long run is compiled half-way; nobody can tell from its tables."""
    overrides = ["collision.k=1", "stop.collisions=6000", "stop.time=1e5"]
    scenario = load_scenario(FOLDER / "one_circle.toml", overrides)
    changed, machine = simulate(scenario, "auto"), simulate(scenario, "numba")
    assert changed.engine == "numba"
    assert bits(changed.collisions) == bits(machine.collisions)
    assert bits(changed.flights()) == bits(machine.flights())


def test_a_short_run_is_never_compiled() -> None:
    scenario = load_scenario(FOLDER / "one_circle.toml", ["stop.collisions=20"])
    assert simulate(scenario, "auto").engine == "python"
