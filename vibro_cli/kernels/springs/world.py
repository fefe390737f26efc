"""What the event loop of the springs works on: one tuple of records, rows of series, and logs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from vibro_cli.compile.kernel import struct
from vibro_cli.kernels.numerics.tridiagonal import ChainRow
from vibro_cli.kernels.world import BodyData, Instant

ORDER = 24  # of the Taylor series of a body's place
ROW = ORDER + 1
# Rows of a body: its place, the spring's length, place over length, free acceleration.
PLACE, LENGTH, RATIO, FORCE = 0, ROW, 2 * ROW, 3 * ROW
BODY_ROWS = 4 * ROW

# How much of the gap of a pair is known to be zero at the start of a step: nothing, the gap, its
# rate too, its second derivative too; greater numbers for more derivatives.
FREE = 0
PARTING = 1
RESTING = 2
RELEASED = 3

# What is still to be done at the present instant for bodies in contact.
SETTLED = 0
IMPACTS = 1  # those that approach collide
DECISION = 2  # which of the others stay in contact
CHANGES = 3  # to carry out what is decided, one pair after another

# ``stays`` of a pair that rolls on in contact, and of one that does if it is pressed together.
STAYS = 1
MAY = 2

# Not a cause of the end: there was an impact.
COLLIDED = -1

# What a state in the log begins with.
START = 0
COLLISION = 1
CONTACT_CLOSED = 2
CONTACT_OPENED = 3


@struct
class SpringBody:
    """A body with its spring, and its state at the present instant."""

    square: float  # w0^2 = c/(kappa m), 1/s^2
    length: float  # l, m
    height: float  # b, m
    foot: float  # m along the line
    x: float  # from the foot's place, m
    v: float  # m/s
    energy: float  # of its group over the group's rolling mass, m^2/s^2
    fastest: float  # of its speeds at this instant, and of what each impulse gave it, m/s


@struct
class SpringPair(ChainRow):
    """A body and its right neighbour, with its row in the system of a chain of contacts."""

    touch: float  # distance along the line of touching centres, m
    restitution: float
    held: int  # 1: in lasting contact
    known: int  # FREE, PARTING, RESTING, RELEASED or more
    closing: int  # 1: its impact of the present round is to come
    stays: int  # scratch of an instant: STAYS, MAY or 0
    needed: float  # and the acceleration (m/s^2) that has to press it together for that


@struct
class Clock(Instant):
    """The state of the run as a whole."""

    collisions: int
    contacts: int
    impact_rows: int
    state_rows: int
    begun: int
    steps: int  # since the last event
    work: int  # steps since the loop came back
    at_once: int  # impacts at the present instant
    rounds: int  # and rounds of them
    unsettled: int  # what to do for contacts at it: IMPACTS, DECISION or CHANGES, else 0
    hurried: int  # 1: a stop had contacts decided while bodies still approached
    energy_correction: float
    lost: float  # by impacts, J


@struct
class Settings:
    """What does not change."""

    law: int
    substitute: int
    stop_time: float
    stop_collisions: int
    capacity: int
    finishing: int  # 1: only go on from the last step to the stop


@struct
class ImpactRow(Instant):
    """One impact of a pair."""

    pair: int
    x_a: float  # along the line
    x_b: float
    v_a_pre: float
    v_b_pre: float
    v_a_post: float
    v_b_post: float
    restitution: float  # k of its impulse
    loss: float
    gap: float
    law: int
    admissible: int
    substituted: int
    simultaneous: int
    grazing: int
    contact: int


@struct
class StateRow(Instant):
    """One body after an event of any body."""

    event: int  # number of the event
    cause: int
    pair: int  # that it happened to
    body: int
    x: float
    v: float
    energy: float
    held: int  # with its right neighbour
    value: float  # contact_closed: how long the bounces before it would last, s


class World(NamedTuple):
    """All records of a run."""

    clock: Sequence[Clock]
    settings: Sequence[Settings]
    bodies: Sequence[BodyData]
    springs: Sequence[SpringBody]
    pairs: Sequence[SpringPair]
    series: list[float]  # BODY_ROWS of each body
    gaps: list[float]  # a row of each pair: its gap, or what presses it together (m/s^2)
    impacts: Sequence[ImpactRow]
    states: Sequence[StateRow]
