"""The whole benchmark in order."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from vibro_cli.benchmark import crowd, growth, kept, other_systems, precision, skips, whole
from vibro_cli.benchmark.measurement import Plan, Row


def run(plan: Plan, scenes: Sequence[str] = ()) -> Iterator[list[Row]]:
    """Measure scenes of these names; all of them, with growth and skips, when none is named."""
    yield from precision.measure(plan, scenes)
    if not scenes:
        yield from growth.measure(plan)
        yield crowd.measure(plan)
        yield kept.measure(plan)
        yield skips.measure(plan)
        yield other_systems.measure(plan)
        yield from whole.measure(plan)
