"""Bodies on a straight line, each held by a spring."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from vibro_cli.systems.contract import Columns, System

if TYPE_CHECKING:
    from vibro_cli.compile.kernel import Kernel


class BodiesOnSprings(System):
    """Bodies on springs."""

    name = "springs"
    papers = ("A", "B", "C")
    exponents = 2
    default_figures = ("portrait", "motion", "energy")
    has_families = True

    @property
    def kernels(self) -> tuple[Kernel, ...]:
        from vibro_cli.kernels.springs.loop import advance
        from vibro_cli.kernels.springs.series import sample_states
        from vibro_cli.kernels.springs.tangent import follow_bodies

        return advance, sample_states, follow_bodies

    def events(self, system: Any, logs: Any) -> Columns:
        from vibro_cli.systems.springs.tables import EVENTS, Contacts

        return EVENTS.filled(Contacts(logs["states"], len(system.bodies)))

    def method(self, scenario: Mapping[str, Any]) -> str:
        return (
            "Between impacts the motion is computed by Taylor series of order 24, whose remainder "
            "has a proved bound; impacts are certified first zeros of the distance within a step."
        )

    def understood(self, scenario: Any, system: Any) -> dict[str, Any]:
        from vibro_cli.systems.springs.portrait import swings

        found = super().understood(scenario, system)
        bodies = zip(found["bodies"], swings(system), strict=True)
        return found | {"bodies": [body | {"swing": swing} for body, swing in bodies]}

    def body_lines(self, body: dict[str, Any]) -> Iterator[str]:
        from vibro_cli.systems.springs.portrait import swing_line

        yield swing_line(body["swing"])


SYSTEM = BodiesOnSprings()
