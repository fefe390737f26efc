"""The world of the springs: the structs, rows of series and logs that its event loop works on."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from vibro_cli.compile.kernel import struct
from vibro_cli.kernels.numerics.tridiagonal import ChainRow
from vibro_cli.kernels.world import BodyData, Instant

ORDER = 24  # of the Taylor series of a body's position
ROW = ORDER + 1
# Rows of a body: its position, the spring's length, position over length, free acceleration.
PLACE, LENGTH, RATIO, FORCE = 0, ROW, 2 * ROW, 3 * ROW
BODY_ROWS = 4 * ROW

# What is known to be zero at the start of a step: nothing, the gap of a pair, also its rate, also
# its second derivative; greater numbers mean further derivatives.
FREE = 0
PARTING = 1
RESTING = 2
RELEASED = 3

# The next task at the present instant for bodies in contact.
SETTLED = 0
IMPACTS = 1  # collide the bodies that approach
DECISION = 2  # decide which of the others stay in contact
CHANGES = 3  # close and open contacts as decided, one pair after another

# ``stays`` of a pair that stays in contact, and of one that does so if it is pressed together.
STAYS = 1
MAY = 2

# Result of a round of impacts; not a cause of the end.
COLLIDED = -1

# Cause of a state in the log.
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
    # Near the separatrix: signed root of twice the energy above the saddle over the rolling mass,
    # m/s, which is the speed there if the body passes it. Else NEVER.
    root: float
    fastest: float  # greatest of its speeds and speed changes at this instant, m/s


@struct
class SpringPair(ChainRow):
    """A body and its right neighbour, with their row in the system of a chain of contacts."""

    touch: float  # distance along the line between the centres at contact, m
    restitution: float
    held: int  # 1: in lasting contact
    known: int  # FREE, PARTING, RESTING, RELEASED or more
    closing: int  # 1: its impact in the present round is pending
    stays: int  # scratch of an instant: STAYS, MAY or 0
    needed: float  # relative acceleration (m/s^2) that must press it together to stay


@struct
class Clock(Instant):
    """The state of the run as a whole."""

    collisions: int
    contacts: int
    impact_rows: int
    state_rows: int
    begun: int
    steps: int  # since the last event
    work: int  # steps since the loop last returned
    at_once: int  # impacts at the present instant
    rounds: int  # rounds of impacts at the present instant
    unsettled: int  # next task for contacts: IMPACTS, DECISION, CHANGES or SETTLED
    hurried: int  # 1: the stop forced a decision on contacts while bodies still approached
    energy_correction: float
    lost: float  # energy lost by impacts, J


@struct
class Settings:
    """Constants of the run."""

    law: int
    substitute: int
    stop_time: float
    stop_collisions: int
    capacity: int
    finishing: int  # 1: only move on from the last step to the stop


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
    restitution: float  # k of the impulse
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
    pair: int  # pair of the event
    body: int
    x: float
    v: float
    energy: float
    root: float  # of `SpringBody`
    held: int  # 1: in lasting contact with its right neighbour
    value: float  # contact_closed: time (s) that the replaced bounces would last


class World(NamedTuple):
    """All records of a run."""

    clock: Sequence[Clock]
    settings: Sequence[Settings]
    bodies: Sequence[BodyData]
    springs: Sequence[SpringBody]
    pairs: Sequence[SpringPair]
    series: list[float]  # BODY_ROWS of each body
    gaps: list[float]  # a row of each pair: its gap, or the acceleration pressing it together
    impacts: Sequence[ImpactRow]
    states: Sequence[StateRow]
