"""Small grids to solve in tests."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

SCENARIOS = Path(__file__).parents[2] / "scenarios"

Write = Callable[..., Path]


@pytest.fixture
def small(tmp_path: Path) -> Write:
    """Write a grid of 12 points over two balls on three arcs, some of them invalid."""

    def write(head: str = "", name: str = "small") -> Path:
        path = tmp_path / f"{name}.toml"
        path.write_text(
            f'{head}base = "{SCENARIOS / "three_arcs.toml"}"\n'
            '[[axes]]\npath = "balls[1].angle"\nlinspace = [-1.4, -1.0, 4]\n'
            '[[axes]]\npath = "collision.k"\nvalues = [1.0, 0.6, 1.2]\n'
            "[keep]\ncollisions = true\n"
        )
        return path

    return write
