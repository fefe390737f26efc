"""Traces and bodies whose singular points and energies are known by hand."""

from __future__ import annotations

import math

from tests.bare_system import bare_system
from vibro_cli.analysis.levels import Landscape
from vibro_cli.mechanics.potential import Turning
from vibro_cli.mechanics.system import Body, InitialState, TraceSystem
from vibro_cli.mechanics.trace import ArcShape, Trace

DEGREE = math.pi / 180.0

BALL = Body("ball", radius=0.1, mass=2.0, inertia_ratio=2 / 5)


def valley(radius: float, end: float) -> ArcShape:
    return ArcShape("valley", radius=radius, end_slope=end * DEGREE)


def hump(radius: float, end: float) -> ArcShape:
    return ArcShape("hump", radius=radius, end_slope=end * DEGREE)


def line(length: float) -> ArcShape:
    return ArcShape("line", length=length)


def system(
    start: float,
    *shapes: ArcShape,
    closed: bool = False,
    body: Body = BALL,
    turning: Turning | None = None,
) -> TraceSystem:
    trace = Trace.chain(start * DEGREE, shapes, closed)
    initial = (InitialState(0, trace.pieces[0].angle_start, 0.0),)
    return bare_system(trace, (body,), initial, restitution=(), law="hedrih", turning=turning)


def landscape(
    start: float, *shapes: ArcShape, closed: bool = False, body: Body = BALL
) -> Landscape:
    return Landscape.of(system(start, *shapes, closed=closed, body=body), 1)


def three_arcs(outer: float = 120.0, body: Body = BALL) -> Landscape:
    """A's trace: R = 1, R₀ = 0.5, junctions at slopes ±50°, outer ends at ±`outer` degrees."""
    return landscape(-outer, valley(1.0, 50), hump(0.5, -50), valley(1.0, outer), body=body)


def circle(body: Body = BALL) -> Landscape:
    """B's trace: one closed circle of radius 1."""
    return landscape(-180.0, valley(1.0, 180), closed=True, body=body)
