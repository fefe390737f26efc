"""The whole benchmark in order."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from vibro_cli.benchmark import crowd, growth, kept, other_systems, precision, skips
from vibro_cli.benchmark.measurement import Plan, Row
from vibro_cli.simulation.batch import Batch


def run(plan: Plan, scenes: Sequence[str] = ()) -> Iterator[list[Row]]:
    """Measure scenes of these names; all of them, with growth and skips, when none is named."""
    Batch.compile(in_lanes=True)
    yield from precision.measure(plan, scenes)
    if not scenes:
        yield from growth.measure(plan)
        yield crowd.measure(plan)
        yield kept.measure(plan)
        yield skips.measure(plan)
        yield other_systems.measure(plan)
