"""The tables of a run on a trace, stretch by stretch."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np

from vibro_cli.kernels.world import RUNNING
from vibro_cli.mechanics.system import System
from vibro_cli.systems.contract import Sink
from vibro_cli.systems.stream import Stretch
from vibro_cli.systems.tangents import exponent_table, grown_columns
from vibro_cli.systems.trace.events import Events, event_columns
from vibro_cli.systems.trace.flights import Paths
from vibro_cli.systems.trace.geometry import Places
from vibro_cli.systems.trace.impacts import Impacts
from vibro_cli.systems.trace.summary import Tally, summary_columns, with_logs
from vibro_cli.systems.trace.tangents import TangentMap
from vibro_cli.systems.trace.world import make_world, overrides_of
from vibro_cli.systems.wanted import Sampling, Wanted


class Tables:
    """What the tables of a run say, stretch by stretch.

    Parameters
    ----------
    system, wanted
        What is solved, and what is to be computed beside the collisions.
    names
        Tables that are wanted, of ``collisions``, ``events``, ``motion`` and ``exponents``.
    sink
        Takes their rows.
    """

    def __init__(self, system: System, wanted: Wanted, names: Collection[str], sink: Sink) -> None:
        self._world = make_world(system, None, None)
        self._places = Places(system)
        self._system = system
        self._sink = sink
        overrides = overrides_of(system)
        bodies = len(system.bodies)
        self._impacts = Impacts(system) if "collisions" in names else None
        self._events = self._motion = None
        if "events" in names:
            self._events = Events(bodies, wanted.turning_points, wanted.friction, overrides)
        if "motion" in names and wanted.motion:
            self._motion = Sampling(wanted)
        self._overrides = overrides
        self._tally = Tally(bodies, overrides)
        self._tangents = TangentMap(system) if wanted.lyapunov else None
        self._wants_exponents = "exponents" in names

    def take(self, stretch: Stretch) -> None:
        """Tell of a stretch."""
        logs, known = stretch.logs, stretch.known
        self._world = world = with_logs(self._world, stretch.engine, logs, stretch.clock)
        ended = stretch.cause != RUNNING
        grown = None
        if self._tangents is not None:
            grown = self._tangents.take(world, known, stretch.cause, stretch.end)
            if self._wants_exponents and ended:
                self._sink("exponents", exponent_table(self._tangents))
        if self._impacts is not None and not (ended and known):
            columns = self._impacts.take(world, stretch.engine, logs["impacts"])
            if grown is not None:
                columns |= grown_columns(grown, columns["grazing"])
            self._sink("collisions", columns)
        self._tally.take(world, known, stretch.cause, stretch.end)
        if self._events is None and self._motion is None:
            return
        paths = Paths(self._places, world, logs["log"], *stretch.end, self._overrides)
        touches = logs["touches"]
        if self._events is not None:
            if not ended:
                rows = self._events.take(paths, world, touches, known, stretch.settled)
            else:
                ball = int(stretch.clock["last_ball"])
                rows = self._events.finish(paths, world, touches, known, stretch.cause, ball)
            self._sink("events", event_columns(rows))
        if self._motion is not None:
            for instants in self._motion.until(stretch.end[0], ended):
                self._sink("motion", paths.sample(instants))

    def summary(self) -> dict[str, Any]:
        """Return the columns of ``summary.parquet``, once the run has ended."""
        restitution = np.array([self._system.restitution])
        tally = self._tally
        columns = summary_columns(self._places, restitution, tally.outcomes, tally.finals)
        return columns if self._tangents is None else columns | self._tangents.summary()


def trajectory_of(system: System, run: Stretch) -> Paths:
    """Return the motion in a whole run, given as one stretch."""
    world = with_logs(make_world(system, None, None), run.engine, run.logs, run.clock)
    return Paths(Places(system), world, run.logs["log"], *run.end, overrides_of(system))
