"""Many flights through the solver's own compiled event loop, one after another."""

from __future__ import annotations

from typing import Any

import numpy as np

from vibro_cli.compile.native import compiled
from vibro_cli.kernels.structs import NEVER
from vibro_cli.kernels.world import World
from vibro_cli.mechanics.system import System
from vibro_cli.simulation.drive import compiled_world
from vibro_cli.simulation.prepare import make_world
from vibro_cli.stress.kernels import ANSWER_COLUMNS, find_first_contacts


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
        compiled(find_first_contacts)(world, fresh, np.ascontiguousarray(starts), answers)
    return answers
