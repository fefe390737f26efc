"""The kernel for the checks of first contacts: the solver's search from many starts."""

from __future__ import annotations

from collections.abc import Sequence

from vibro_cli.compile.kernel import kernel, struct
from vibro_cli.kernels.events.event_loop import advance, start
from vibro_cli.kernels.numerics.constants import NEVER
from vibro_cli.kernels.world import Flight, World


@struct
class Answer:
    """The first contact of two bodies that the solver finds."""

    horizon: float  # s: of the search; on return, at most the first end of a flight
    met: int  # 0 if there is no contact
    t: float  # s


@kernel
def find_first_contacts(
    world: World, fresh: World, starts: Sequence[Flight], answers: Sequence[Answer]
) -> None:
    """Find the first contact of the two bodies from one start after another.

    Clock and pairs are reset from ``fresh`` for each start.
    """
    settings = world.settings[0]
    for number in range(len(answers)):
        answer = answers[number]
        world.clock[0] = fresh.clock[0]  # type: ignore[index]
        for j in range(len(world.pairs)):
            world.pairs[j] = fresh.pairs[j]  # type: ignore[index]
        for ball in range(2):
            world.flights[ball] = starts[2 * number + ball]  # type: ignore[index]
        settings.stop_t = answer.horizon
        start(world)
        for ball in range(2):
            answer.horizon = min(answer.horizon, world.flights[ball].exit_t)
        settings.stop_t = answer.horizon
        if answer.horizon > 0.0:
            advance(world)
        answer.met = world.clock[0].impact_rows
        answer.t = world.impacts[0].t if answer.met > 0 else NEVER
