"""Many flights through the solver's own compiled event loop, one after another."""

from __future__ import annotations

from functools import cache
from types import FunctionType
from typing import Any

import numba
import numpy as np

from vibro_cli.mechanics.records import NEVER
from vibro_cli.mechanics.system import System
from vibro_cli.numerics import engine
from vibro_cli.simulation.drive import compiled_world
from vibro_cli.simulation.loop import advance, start
from vibro_cli.simulation.prepare import make_world
from vibro_cli.simulation.world import World

# Columns of a start: piece, S, C, P of each body, and the longest time to look ahead.
START_COLUMNS = 9
# Columns of an answer: contact (1) or none (0), its instant in two doubles, the horizon looked to,
# and whether the solver called it grazing.
MET, T, T_LOW, HORIZON, GRAZING = range(5)
ANSWER_COLUMNS = 5


def _reset(world: Any, fresh: Any, row: Any) -> None:
    """Two bodies at the start of a flight, nothing known of it."""
    world.clock[0] = fresh.clock[0]
    for j in range(len(world.pairs)):
        world.pairs[j] = fresh.pairs[j]
    for ball in range(2):
        world.flights[ball] = fresh.flights[ball]
        world.flights[ball].piece = int(row[4 * ball])
        world.flights[ball].s = row[4 * ball + 1]
        world.flights[ball].c = row[4 * ball + 2]
        world.flights[ball].p = row[4 * ball + 3]


def _batch(world: Any, fresh: Any, starts: Any, answers: Any) -> None:
    settings = world.settings[0]
    for number in range(starts.shape[0]):
        _reset(world, fresh, starts[number])
        settings.stop_t = starts[number, 8]
        start(world)
        horizon = starts[number, 8]
        for ball in range(2):
            horizon = min(horizon, world.flights[ball].exit_t)
        settings.stop_t = horizon
        answers[number, HORIZON] = horizon
        if horizon > 0.0:
            advance(world)
        met = world.clock[0].impact_rows > 0
        answers[number, MET] = 1.0 if met else 0.0
        answers[number, T] = world.impacts[0].t if met else NEVER
        answers[number, T_LOW] = world.impacts[0].t_low if met else 0.0
        answers[number, GRAZING] = world.impacts[0].grazing if met else 0.0


@cache
def _entry() -> Any:
    """The batch, calling the compiled twins of the event loop; kept with their machine code."""
    namespace = globals() | {"start": engine.compiled(start), "advance": engine.compiled(advance)}
    options: Any = {"nogil": True, "error_model": "numpy"}
    namespace["_reset"] = numba.njit(**options)(_reset)
    twin = FunctionType(_batch.__code__, namespace, _batch.__name__)
    twin.__module__ = __name__
    return engine.kept(numba.njit(**options)(twin))


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
        _entry()(world, fresh, starts, answers)
    return answers
