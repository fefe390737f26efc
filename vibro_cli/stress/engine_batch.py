"""Many flights through the solver's own compiled event loop, one after another."""

from __future__ import annotations

from typing import Any

import numpy as np

from vibro_cli.mechanics.records import NEVER
from vibro_cli.mechanics.system import System
from vibro_cli.numerics.engine import kernel
from vibro_cli.numerics.machine_code import compiled
from vibro_cli.simulation.drive import compiled_world
from vibro_cli.simulation.entry import prepare_event_loop
from vibro_cli.simulation.loop import proceed
from vibro_cli.simulation.prepare import make_world
from vibro_cli.simulation.world import World

# Columns of a start: piece, S, C, P of each body, and the longest time to look ahead.
START_COLUMNS = 9
# Columns of an answer: contact (1) or none (0), its instant in two doubles, the horizon looked to,
# and whether the solver called it grazing.
MET, T, T_LOW, HORIZON, GRAZING = range(5)
ANSWER_COLUMNS = 5


@kernel
def _reset(world: World, fresh: World, starts: Any, number: int) -> None:
    """Two bodies at the start of a flight, nothing known of it."""
    world.clock[0] = fresh.clock[0]  # type: ignore[index]
    for j in range(len(world.pairs)):
        world.pairs[j] = fresh.pairs[j]  # type: ignore[index]
    for ball in range(2):
        world.flights[ball] = fresh.flights[ball]  # type: ignore[index]
        world.flights[ball].piece = int(starts[number, 4 * ball])
        world.flights[ball].s = starts[number, 4 * ball + 1]
        world.flights[ball].c = starts[number, 4 * ball + 2]
        world.flights[ball].p = starts[number, 4 * ball + 3]


@kernel
def _first_contacts(world: World, fresh: World, starts: Any, answers: Any) -> None:
    settings = world.settings[0]
    for number in range(len(starts)):
        _reset(world, fresh, starts, number)
        settings.stop_t = starts[number, 8]
        proceed(world, True)
        horizon = starts[number, 8]
        for ball in range(2):
            horizon = min(horizon, world.flights[ball].exit_t)
        settings.stop_t = horizon
        answers[number, HORIZON] = horizon
        if horizon > 0.0:
            proceed(world, False)
        met = world.clock[0].impact_rows > 0
        answers[number, MET] = 1.0 if met else 0.0
        answers[number, T] = world.impacts[0].t if met else NEVER
        answers[number, T_LOW] = world.impacts[0].t_low if met else 0.0
        answers[number, GRAZING] = float(world.impacts[0].grazing) if met else 0.0


def first_contacts(system: System, starts: Any) -> Any:
    """The solver's first contact of each start, up to the first end of a flight.

    Parameters
    ----------
    system
        Two bodies; their initial states are not used.
    starts
        Rows of ``START_COLUMNS``; the last one in s.

    Returns
    -------
    Rows of ``ANSWER_COLUMNS``.
    """
    world = compiled_world(make_world(system, NEVER, 1))
    copies: list[Any] = [np.array(array) for array in world]
    fresh = World(*copies)
    answers: Any = np.zeros((len(starts), ANSWER_COLUMNS))
    if len(starts):
        prepare_event_loop(world)
        compiled(_first_contacts)(world, fresh, np.ascontiguousarray(starts), answers)
    return answers
