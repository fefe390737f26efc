"""How axes name the columns of tables."""

from __future__ import annotations

import pytest
from matplotlib.mathtext import MathTextParser

from vibro_cli.figures.ticks import symbol_of
from vibro_cli.systems import NAMES, system_named


@pytest.mark.parametrize(
    ("column", "symbol"),
    [
        ("t", "$t$"),
        ("s_a", "$s_{a}$"),
        ("speed_b_pre", "$v_{b}$ before"),
        ("kinetic_energy_a_post", r"$E_{\mathrm{k},a}$ after"),
        ("velocity_x_pre", "$v_{x}$ before"),
        ("angle_b", "angle of b"),
        ("approach_speed", "approach speed"),
        ("lyapunov_2", r"$\lambda_{2}$"),
    ],
)
def test_symbols(column: str, symbol: str) -> None:
    assert symbol_of(column) == symbol


def test_every_column_has_words_or_a_formula() -> None:
    parser = MathTextParser("agg")
    tables = [table for system in NAMES for table in system_named(system).tables()]
    for table in tables:
        for column in table.columns:
            symbol = symbol_of(column.name)
            assert "_" not in symbol or symbol.startswith("$"), column.name
            parser.parse(symbol)
