"""The event loop of a trace, in the form that the driver of all systems needs, and its stretches.

A stretch must be self-contained, though flights continue from one stretch to the next. Each stretch
therefore begins with the flights in progress at its start, one per body, followed by those that
start in it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from vibro_cli.compile.kernel import Overrides
from vibro_cli.compile.native import compiled
from vibro_cli.kernels.contact.first_contact import STEPS_AT_ONCE
from vibro_cli.kernels.ensemble.points import proceed
from vibro_cli.kernels.events.event_detection import ROUNDS
from vibro_cli.kernels.events.event_loop import advance, start
from vibro_cli.kernels.tangent.follow import follow_tangents
from vibro_cli.kernels.world import Flight, World
from vibro_cli.mechanics.system import TraceSystem
from vibro_cli.numerics.elementwise import greatest_of
from vibro_cli.systems import driver
from vibro_cli.systems.driver import Driver, joined, record_array, records_of, zeros
from vibro_cli.systems.run import Stretch, Stretches
from vibro_cli.systems.trace.motion import last_of_each
from vibro_cli.systems.trace.world import make_world as make_world  # a part of every system.py
from vibro_cli.systems.trace.world import two_bodies


def time_scale(system: TraceSystem) -> Any:
    """Return the time scale (s) of tangent maps: √(κρ/g) of body 1 on the widest arc.

    On lines alone, ρ is ten times its radius. For a system of arrays the scale is an array.
    """
    body = system.bodies[0]
    arcs = [piece for piece in system.trace.pieces if not piece.is_line]
    length: Any = 10.0 * body.radius
    if arcs:
        length = greatest_of([piece.path_radius(body.radius) for piece in arcs])
    return np.sqrt(body.kappa * length / system.gravity)


def enter_advance(world: World, overrides: Overrides) -> int:
    """Run the loop on a compiled world (see ``kernels.events.event_loop.advance``)."""
    return int(compiled(proceed, overrides)(world, two_bodies(not overrides.replaced)))


LOOP = driver.EventLoop(
    advance=advance,
    follow=follow_tangents,
    scratch=(Flight,),
    records=records_of(World),
    logs={
        "impacts": "impact_rows",
        "log": "flight_rows",
        "touches": "contact_rows",
        "segments": "segment_rows",
    },
    state=("clock", "flights", "pairs"),
    start=start,
    enter=enter_advance,
    counted={"log": "flights_before"},
    work_done=("searches", "evaluations", "skipped_apart"),
    quiet_log=("log", "flights between crossings"),
    steps_at_once=STEPS_AT_ONCE * ROUNDS,
)


class TraceStretches(Stretches):
    """The stretches of a run in progress (see ``systems.run.Stretches``)."""

    def __init__(self, driver: Driver, stop_time: float | None) -> None:
        super().__init__(LOOP, driver, stop_time)
        self._logged = 0
        self._nothing = {name: zeros(0, LOOP.records[name]) for name in LOOP.logs}
        self._carried: dict[str, Any] = self._nothing

    def _framed(self, logs: dict[str, Any]) -> Stretch:
        known = len(self._carried["log"])
        segments = logs["segments"].copy()
        segments["flight"] += known - self._logged
        self._logged += len(logs["log"])
        logs["segments"] = joined([self._carried["segments"], segments])
        logs["log"] = joined([self._carried["log"], logs["log"]])
        self._carried = self._nothing | under_way(logs)
        return self._stretch(logs)._replace(known=known)

    def _ended(self) -> Stretch:
        """Return the flights in progress, which the end of the run completes."""
        return self._stretch(self._carried)._replace(known=len(self._carried["log"]))

    def _stretch(self, logs: Mapping[str, Any]) -> Stretch:
        pairs = record_array(self.driver.world.pairs, LOOP.records["pairs"])
        unlogged = pairs[pairs["held"] != pairs["logged"]]  # lasting contacts that began or ended
        settled = np.min(unlogged["change_t"] + unlogged["delay"], initial=np.inf)
        return super()._stretch(logs)._replace(settled=float(settled))


def under_way(logs: Mapping[str, Any]) -> dict[str, Any]:
    """Return the last flight of each body and its segments, with which the next logs begin."""
    log, segments = logs["log"], logs["segments"]
    rows = last_of_each(log).tolist()
    kept = [
        (body, segment)
        for body, row in enumerate(rows)
        for segment in np.flatnonzero(segments["flight"] == row).tolist()
    ]
    carried = segments[[segment for _, segment in kept]]
    carried["flight"] = [body for body, _ in kept]
    return {"log": log[rows], "segments": carried}
