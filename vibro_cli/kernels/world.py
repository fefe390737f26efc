"""What the event loop works on: one tuple of records, and the logs that it fills."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from vibro_cli.compile.kernel import Series, struct
from vibro_cli.kernels.structs import (
    BodyData,
    BodyForces,
    Clock,
    Flight,
    PairData,
    PairTrack,
    PieceData,
    Settings,
    TrackData,
)

# Why a flight began.
START = 0
COLLISION = 1
CROSSING = 2
WALL = 3
CONTACT_CLOSED = 4
CONTACT_OPENED = 5
SEGMENT = 6  # the next piece of a motion that is integrated so, or one with a change beside it
CAUSE_NAMES = (
    "start",
    "collision",
    "crossing",
    "wall",
    "contact_closed",
    "contact_opened",
    "segment",
)

# Why the loop came back; the first ones are causes of the end of a run.
RUNNING = 0
END_TIME = 1
END_COLLISIONS = 2
END_NO_MORE_COLLISIONS = 3
END_INADMISSIBLE = 4
END_OF_TRACE = 5
END_LIFT_OFF = 6
END_REST = 7
LOG_FULL = 8
END_INTERRUPTED = 9
END_NAMES = {
    END_TIME: "time",
    END_COLLISIONS: "collisions",
    END_NO_MORE_COLLISIONS: "no_more_collisions",
    END_INADMISSIBLE: "inadmissible",
    END_OF_TRACE: "end_of_trace",
    END_LIFT_OFF: "lift_off",
    END_REST: "rest",
    END_INTERRUPTED: "interrupted",
}


@struct
class ImpactRow:
    """One impact, as the kernels see it."""

    t: float
    t_low: float
    pair: int
    a: int
    b: int
    piece_a: int
    piece_b: int
    lap_a: int
    lap_b: int
    a_s: float
    a_c: float
    b_s: float
    b_c: float
    speed_a_pre: float
    speed_b_pre: float
    speed_a_post: float
    speed_b_post: float
    normal_a: float
    normal_b: float
    head_a_pre: float
    head_b_pre: float
    head_a_post: float
    head_b_post: float
    loss: float
    gap: float
    law: int
    admissible: int
    substituted: int
    simultaneous: int
    grazing: int
    contact: int
    crossings: int


@struct
class FlightRow:
    """The start of one flight."""

    body: int
    piece: int
    lap: int
    t: float
    t_low: float
    s: float
    c: float
    p: float
    before_s: float  # at the end of the body's flight before this one
    before_c: float
    before_p: float
    parameter: float
    root_complement: float
    head: float
    cause: int
    exit_kind: int
    at_rest: int
    flow_s: float
    flow_c: float
    flow_p: float
    grouped: int
    group_first: int
    group_count: int
    shift_s: float
    shift_c: float
    rate_ratio: float
    frequency: float
    line_acceleration: float
    segment: float


@struct
class SegmentRow:
    """The motion of one body on a segment across pieces: belongs to flight row ``flight``."""

    flight: int  # rows of all flights before it
    series: Series


@struct
class ContactRow:
    """A lasting contact that closes or opens."""

    t: float
    t_low: float
    delay: float  # time from the last impact to the end of the accumulation, s
    a: int
    b: int
    opened: int
    piece_a: int
    piece_b: int
    b_s: float
    b_c: float
    speed: float  # of b's centre, m/s


class World(NamedTuple):
    """All that one run is made of; lists of records or structured arrays."""

    settings: Sequence[Settings]  # one
    clock: Sequence[Clock]  # one
    bodies: Sequence[BodyData]
    pieces: Sequence[PieceData]
    tracks: Sequence[TrackData]  # body by body
    pairs: Sequence[PairData]
    contacts: Sequence[PairTrack]  # pair by pair
    far: Sequence[Sequence[int]]  # far[pair * pieces + piece of a][piece of b]: never in contact
    flights: Sequence[Flight]
    forces: Sequence[BodyForces]  # scratch: one for each body of a group, at last one for others
    impacts: Sequence[ImpactRow]
    log: Sequence[FlightRow]
    touches: Sequence[ContactRow]
    segments: Sequence[SegmentRow]


LOGS = ("impacts", "log", "touches", "segments")
RECORDS: dict[str, Any] = {
    "settings": Settings,
    "clock": Clock,
    "bodies": BodyData,
    "pieces": PieceData,
    "tracks": TrackData,
    "pairs": PairData,
    "contacts": PairTrack,
    "flights": Flight,
    "forces": BodyForces,
    "impacts": ImpactRow,
    "log": FlightRow,
    "touches": ContactRow,
    "segments": SegmentRow,
}
