"""The scenarios of the gallery and the hard cases: their paths, and their runs."""

from __future__ import annotations

import tomllib
from functools import cache
from pathlib import Path
from typing import Any

from vibro_cli.api import simulate
from vibro_cli.scenario import load_any

GALLERY = Path(__file__).parents[1] / "scenarios"


@cache
def run_of(name: str, *overrides: str) -> Any:
    """Return the run of a scenario of the gallery."""
    return simulate(load_any(GALLERY / f"{name}.toml", [*overrides]))


def hard_case(name: str) -> dict[str, Any]:
    """Return a hard case as a document."""
    path = Path(__file__).parent / "hard_cases" / f"{name}.toml"
    return tomllib.loads(path.read_text(encoding="utf-8"))
