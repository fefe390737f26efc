"""Balls on a table, with or without a wall."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from vibro_cli.systems.contract import System

if TYPE_CHECKING:
    from vibro_cli.compile.kernel import Kernel


class BallsOnTable(System):
    """Balls on a table."""

    name = "table"
    impact_tables = ("collisions", "bounces")
    papers = ("A", "B", "C")
    exponents = 4
    default_figures = ("plan", "energy")
    flags = ("-ftree-vectorize",)  # for the loops over all balls, named `sift...`

    @property
    def kernels(self) -> tuple[Kernel, ...]:
        from vibro_cli.kernels.table.loop import advance
        from vibro_cli.kernels.table.tangent import follow_balls

        return advance, follow_balls

    def method(self, scenario: Mapping[str, Any]) -> str:
        return (
            "Between impacts each ball moves in a straight line; impacts of two balls and on the "
            "wall are certified first contacts in closed form, handled in order by an event queue. "
            "There is no time step."
        )


SYSTEM = BallsOnTable()
