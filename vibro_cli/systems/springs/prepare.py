"""From the system to the records of the event loop."""

from __future__ import annotations

from vibro_cli.kernels.impact.laws import LAW_NAMES
from vibro_cli.kernels.springs.loop import MOST_STEPS, advance
from vibro_cli.kernels.springs.world import (
    BODY_ROWS,
    END_INTERRUPTED,
    END_NAMES,
    END_QUIET,
    END_TIME,
    LOG_FULL,
    LOGS,
    NEVER,
    RECORDS,
    ROW,
    STATE,
    Clock,
    Settings,
    SpringBody,
    SpringPair,
    World,
)
from vibro_cli.mechanics.body_record import body_record
from vibro_cli.systems.bodies import touching_distance
from vibro_cli.systems.driver import EventLoop
from vibro_cli.systems.springs.system import SpringsSystem

UNLIMITED = 2**62

LOOP = EventLoop(
    advance=advance,
    records=RECORDS,
    logs=LOGS,
    state=STATE,
    end_names=END_NAMES,
    end_time=END_TIME,
    end_interrupted=END_INTERRUPTED,
    log_full=LOG_FULL,
    rows_of_event=8,
    quiet_cause=(END_QUIET, f"{MOST_STEPS:,} steps"),
    finishes=True,
)


def make_world(
    system: SpringsSystem, stop_time: float | None = None, stop_collisions: int | None = None
) -> World:
    """Return the records of a system at the start, with empty logs."""
    count = len(system.bodies)
    settings = Settings()
    settings.law = LAW_NAMES.index(system.law)
    settings.substitute = 1 if system.inadmissible == "normal-impulse" else 0
    settings.stop_time = NEVER if stop_time is None else stop_time
    settings.stop_collisions = UNLIMITED if stop_collisions is None else stop_collisions
    settings.bodies = count
    return World(
        clock=[Clock()],
        settings=[settings],
        bodies=[body_record(body) for body in system.bodies],
        springs=[_spring(system, index) for index in range(count)],
        pairs=[_pair(system, index) for index in range(max(count - 1, 1))],
        series=[0.0] * (BODY_ROWS * count),
        gaps=[0.0] * (ROW * max(count - 1, 1)),
        impacts=[],
        states=[],
    )


def _spring(system: SpringsSystem, index: int) -> SpringBody:
    given, start = system.springs[index], system.initial[index]
    body = system.bodies[index]
    spring = SpringBody()
    spring.square = given.stiffness / (body.kappa * body.mass)
    spring.length, spring.height, spring.foot = given.length, given.height, given.foot
    spring.x, spring.v = start.position - given.foot, start.speed
    return spring


def _pair(system: SpringsSystem, index: int) -> SpringPair:
    pair = SpringPair()
    if index + 1 < len(system.bodies):
        pair.touch = touching_distance(system.bodies[index], system.bodies[index + 1])
        pair.restitution = system.restitution[index]
    return pair
