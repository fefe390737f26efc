"""The motion of the bodies at any time, from the states after each event."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibro_cli.compile.kernel import dtype, interpreted_copies, interpreted_rows
from vibro_cli.compile.native import compiled
from vibro_cli.kernels.springs.series import Found, Sample, sample_states
from vibro_cli.kernels.springs.world import SpringBody, StateRow
from vibro_cli.systems.driver import compiled_world, record_array
from vibro_cli.systems.springs.system import LOOP, SpringsSystem, make_world
from vibro_cli.systems.springs.tables import MOTION

Floats = NDArray[np.float64]


class Motion:
    """States after the start and after every event, an event a row, a body a column.

    Parameters
    ----------
    system, engine
        What is solved, and ``"compiled"`` or ``"python"``; both give the same bits.
    states
        The log of a stretch of the run.
    before
        The last states before it, from :attr:`last`; without them the stretch is the first.
    """

    def __init__(self, system: SpringsSystem, engine: str, states: Any, before: Any = None) -> None:
        self._system, self._engine = system, engine
        self._log = states if before is None else np.concatenate([before, states])
        self.last = self._log[-len(system.bodies) :]
        """The states after the last event."""
        self.states = self._log.reshape(-1, len(system.bodies))
        self.times = self.states["t"][:, 0]

    def sample(
        self, times: Any, side: str = "after", extrapolate: bool = False
    ) -> dict[str, NDArray[Any]]:
        """Return the columns of the motion table: for each time a row for each body.

        `side` is "after" or "before" an event that happens at just such an instant.
        Raises ValueError for another side.
        """
        if side not in ("after", "before"):
            raise ValueError(f'side must be "after" or "before", not {side!r}')
        instants = np.asarray(times, dtype=np.float64)
        bodies = len(self._system.bodies)
        events = np.searchsorted(self.times, instants, side="right" if side == "after" else "left")
        samples = np.zeros(len(instants), dtype=dtype(Sample))
        samples["row"] = np.maximum(events - 1, 0) * bodies
        # Before the start the motion is that from it with all speeds reversed, back in time.
        samples["way"] = np.where(instants < 0.0, -1.0, 1.0)
        samples["t"] = np.abs(instants)
        order = np.lexsort((samples["t"], samples["row"], samples["way"]))
        found = np.empty((len(instants), bodies), dtype=dtype(Found))
        found[order] = self._sampled(samples[order]).reshape(-1, bodies)
        return _motion_columns(self._system, instants, found)

    def _sampled(self, samples: Any) -> Any:
        """The states at some instants, those of one instant together."""
        world, bodies = make_world(self._system), len(self._system.bodies)
        if self._engine == "compiled":
            found = np.zeros(len(samples) * bodies, dtype=dtype(Found))
            arrays = compiled_world(LOOP, world)._replace(states=self._log)
            scratch = np.zeros(bodies, dtype=dtype(SpringBody))
            compiled(sample_states)(arrays, samples, len(samples), found, scratch)
            return found
        world = world._replace(states=interpreted_copies(self._log, StateRow))
        rows = interpreted_rows(Found, len(samples) * bodies)
        sample_states(
            world, interpreted_copies(samples, Sample), len(samples), rows,
            interpreted_rows(SpringBody, bodies),
        )  # fmt: skip
        return record_array(rows, Found)


def states_at(system: SpringsSystem, springs: Any, time: float) -> dict[str, NDArray[Any]]:
    """Return the columns of the motion table at one time (s), at which the bodies are."""
    found = np.empty((1, len(springs)), dtype=dtype(Found))
    found["x"], found["v"] = springs["x"], springs["v"]
    # As `kernels.springs.series.energy_of` has it, to the bit.
    length = np.sqrt(springs["height"] * springs["height"] + springs["x"] * springs["x"])
    stretch = length - springs["length"]
    square = springs["v"] * springs["v"] + springs["square"] * stretch * stretch
    found["energy"] = 0.5 * square
    return _motion_columns(system, np.array([time]), found)


def _motion_columns(system: SpringsSystem, instants: Floats, found: Any) -> dict[str, NDArray[Any]]:
    """Columns from states [time, body]."""
    number = len(system.bodies)
    return MOTION.filled(
        {
            "t": np.repeat(instants, number),
            "ball": np.tile(np.arange(1, number + 1), len(instants)),
            "foot": np.tile([spring.foot for spring in system.springs], len(instants)),
            "mass": np.tile([body.kappa * body.mass for body in system.bodies], len(instants)),
            **{name: found[name].ravel() for name in ("x", "v", "energy")},
        }
    )
