"""The event loop of a trace, as the driver of every system calls it."""

from __future__ import annotations

from vibro_cli.kernels.events.event_loop import advance, start
from vibro_cli.kernels.world import END_INTERRUPTED, END_NAMES, END_TIME, LOG_FULL, RECORDS, World
from vibro_cli.simulation.entry import enter_advance
from vibro_cli.systems import driver

LOOP = driver.EventLoop(
    advance=advance,
    records=RECORDS,
    logs={
        "impacts": "impact_rows",
        "log": "flight_rows",
        "touches": "contact_rows",
        "segments": "segment_rows",
    },
    state=("clock", "flights", "pairs"),
    end_names=END_NAMES,
    end_time=END_TIME,
    end_interrupted=END_INTERRUPTED,
    log_full=LOG_FULL,
    rows_of_event=4,
    start=start,
    enter=enter_advance,
    counted={"log": "flights_before"},
    work_done=("searches", "evaluations", "skipped_apart"),
    quiet_log=("log", "flights between crossings"),
)


def compiled_world(world: World, logs_of: World | None = None) -> World:
    """Return a world of a trace as arrays, see :func:`systems.driver.compiled_world`."""
    arrays: World = driver.compiled_world(LOOP, world, logs_of)
    return arrays
