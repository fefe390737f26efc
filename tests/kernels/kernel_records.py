"""Flights, bodies, pieces and tracks for tests of single kernels."""

from __future__ import annotations

import math
from typing import NamedTuple

from tests.bare_system import bare_system
from vibro_cli.kernels.numerics.elliptic import set_theta_constants
from vibro_cli.kernels.world import BodyData, Flight, PairTrack, PieceData, TrackData
from vibro_cli.mechanics.system import Body, InitialState
from vibro_cli.mechanics.trace import ArcShape, Trace
from vibro_cli.systems.request import Limits
from vibro_cli.systems.trace.world import make_world


class Records(NamedTuple):
    """The kernels' data of two bodies on a trace; ``tracks[body][piece]``."""

    bodies: list[BodyData]
    pieces: list[PieceData]
    tracks: list[list[TrackData]]
    contacts: list[PairTrack]
    flights: list[Flight]


def flight_on_arc(frequency: float, s: float, c: float, p: float) -> Flight:
    """A flight whose constants come from its state, as after an impact.

    1 - m = (C - P)(C + P), each factor under its own root, so that it is good near a crest.
    """
    flight = Flight()
    flight.frequency = flight.own_frequency = frequency
    flight.s, flight.c, flight.p = s, c, p
    flight.flow_s, flight.flow_c, flight.flow_p = s, c, p
    root = math.sqrt(abs(c - p)) * math.sqrt(abs(c + p))
    set_theta_constants(flight, s * s + p * p, -root if abs(p) > abs(c) else root)
    return flight


def records(
    trace: Trace,
    bodies: tuple[Body, ...],
    initial: tuple[InitialState, ...],
    law: str = "normal-impulse",
) -> Records:
    """Return the records that the solver itself makes for a system."""
    world = make_world(bare_system(trace, bodies, initial, law=law), Limits(1.0))
    count = len(trace.pieces)
    rows = list(world.tracks)
    return Records(
        list(world.bodies), list(world.pieces),
        [rows[body * count : (body + 1) * count] for body in range(len(bodies))],
        list(world.contacts), list(world.flights),
    )  # fmt: skip


def ball(radius: float = 0.1, mass: float = 1.0) -> Body:
    """Return a homogeneous ball."""
    return Body("ball", radius, mass, 0.4)


def three_arcs() -> Trace:
    """Return a trace of valley, hump, valley."""
    return Trace.chain(
        math.radians(-120.0),
        [
            ArcShape("valley", radius=1.0, end_slope=math.radians(50.0)),
            ArcShape("hump", radius=0.5, end_slope=math.radians(-50.0)),
            ArcShape("valley", radius=1.2, end_slope=math.radians(120.0)),
        ],
    )
