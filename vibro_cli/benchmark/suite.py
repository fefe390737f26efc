"""The whole benchmark in order, and what its numbers say in words."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from vibro_cli.benchmark import other_systems, precision
from vibro_cli.benchmark.cost import measure_growth, measure_on_all_cores, measure_skips
from vibro_cli.benchmark.end_to_end import (
    measure_command,
    measure_grid,
)
from vibro_cli.benchmark.measurement import Plan, Row


def run(plan: Plan, scenes: Sequence[str] = ()) -> Iterator[list[Row]]:
    """Measure scenes of these names; all of them, with growth and skips, when none is named."""
    yield from precision.measure(plan, scenes)
    if not scenes:
        yield from measure_growth(plan)
        yield measure_on_all_cores(plan)
        yield measure_grid(plan)
        yield measure_skips(plan)
        yield other_systems.measure(plan)
        yield from measure_command(plan)
