"""The motion of the bodies at any time, from the states after each event."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibro_cli.numerics.double import add_to_time
from vibro_cli.systems.springs.prepare import make_world
from vibro_cli.systems.springs.search import move
from vibro_cli.systems.springs.series import energy_of, expand, group_size, keep_energy
from vibro_cli.systems.springs.system import SpringsSystem
from vibro_cli.systems.springs.world import SpringBody, World

Floats = NDArray[np.float64]


class Motion:
    """States after the start and after every event, an event a row, a body a column."""

    def __init__(self, system: SpringsSystem, states: Any) -> None:
        self._system = system
        self.states = states.reshape(-1, len(system.bodies))
        self.times = self.states["t"][:, 0]

    def sample(self, times: Any, side: str = "after") -> dict[str, NDArray[Any]]:
        """Return the columns of the motion table: for each time a row for each body.

        `side` is "after" or "before" an event that happens at just such an instant.
        Raises ValueError for another side.
        """
        if side not in ("after", "before"):
            raise ValueError(f'side must be "after" or "before", not {side!r}')
        instants = np.asarray(times, dtype=np.float64)
        number = len(self._system.bodies)
        found = np.zeros((len(instants), number, 3))
        start = np.searchsorted(self.times, instants, side="right" if side == "after" else "left")
        rows = np.maximum(start - 1, 0)
        walk = _Walk(make_world(self._system))
        at = -1
        for place in np.lexsort((instants, rows)):
            if rows[place] != at:
                at = int(rows[place])
                self._restore(walk.world, at)
                walk.begin()
            found[place] = walk.at(float(instants[place]))
        return _motion_columns(self._system, instants, found)

    def _restore(self, world: World, event: int) -> None:
        """Put a world into the state after an event."""
        for body, row in enumerate(self.states[event]):
            spring = world.springs[body]
            spring.x, spring.v = float(row["x"]), float(row["v"])
            if body + 1 < len(self._system.bodies):
                world.pairs[body].held = int(row["held"])
        clock = world.clock[0]
        clock.t, clock.t_low = float(self.states[event, 0]["t"]), 0.0
        clock.t_low = float(self.states[event, 0]["t_low"])
        for first, count in groups(world):
            total = sum(
                world.bodies[n].rolling_mass * energy_of(world.springs[n])
                for n in range(first, first + count)
            )
            mass = sum(world.bodies[n].rolling_mass for n in range(first, first + count))
            world.springs[first].energy = total / mass


class _Walk:
    """A world that goes on from an event by the very steps of the solver."""

    def __init__(self, world: World) -> None:
        self.world = world
        self._step = 0.0

    def begin(self) -> None:
        """Take up the state that the world was put into."""
        self._step = expand(self.world)

    def at(self, until: float) -> list[tuple[float, float, float]]:
        """Return place, speed and energy over rolling mass of each body, before the next event.

        The instants (s) of several calls must not fall.
        """
        world, clock = self.world, self.world.clock[0]
        left = until - clock.t - clock.t_low
        while self._step <= left:
            self._go_on(self._step)
            clock.t, clock.t_low = add_to_time(clock.t, clock.t_low, self._step)
            self._step = expand(world)
            left = until - clock.t - clock.t_low
        begun = [(one.x, one.v) for one in world.springs]
        if left > 0.0:
            self._go_on(left)
        found = [(one.x, one.v, energy_of(one)) for one in world.springs]
        for one, (x, v) in zip(world.springs, begun, strict=True):
            one.x, one.v = x, v
        return found

    def _go_on(self, time: float) -> None:
        move(self.world, time)
        for first, count in groups(self.world):
            keep_energy(self.world, first, count)


def states_at(
    system: SpringsSystem, springs: Sequence[SpringBody], time: float
) -> dict[str, NDArray[Any]]:
    """Return the columns of the motion table at one time (s), at which the bodies are."""
    found = np.array([[(one.x, one.v, energy_of(one)) for one in springs]])
    return _motion_columns(system, np.array([time]), found)


def _motion_columns(
    system: SpringsSystem, instants: Floats, found: Floats
) -> dict[str, NDArray[Any]]:
    """Columns from [time, body, (displacement, speed, energy over rolling mass)]."""
    number = len(system.bodies)
    feet = np.array([spring.foot for spring in system.springs])
    masses = np.array([body.kappa * body.mass for body in system.bodies])
    return {
        "t": np.repeat(instants, number),
        "ball": np.tile(np.arange(1, number + 1), len(instants)),
        "x": (found[:, :, 0] + feet).ravel(),
        "displacement": found[:, :, 0].ravel(),
        "speed": found[:, :, 1].ravel(),
        "energy": (found[:, :, 2] * masses).ravel(),
    }


def groups(world: World) -> list[tuple[int, int]]:
    """Return the first body and the number of bodies of each group that moves as one."""
    found = []
    first = 0
    while first < len(world.springs):
        found.append((first, group_size(world, first)))
        first += found[-1][1]
    return found
