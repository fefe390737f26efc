"""The flow of one body on one piece of a trace that turns about a vertical axis.

``kappa v' = -g sin(alpha) + Omega^2 (x_C - x0) cos(alpha)``. On an arc, in the half-angle variables
of ``kernels.structs``, ``S' = wPC, C' = -wPS`` and ``P^2 = m - V`` with the potential ``V = S^2 -
tilt S C - spread S^2 C^2``, where ``tilt = sign Omega^2 (O_x - x0)/g`` and ``spread = Omega^2
rho/g``: seen from any place of the orbit ``tan(f/2)`` moves under a quartic
(``kernels.numerics.weierstrass_motion``).
On a line the acceleration is linear in the place, the motion a sum of cosh and sinh. The kernels
stand in for those of ``kernels.flow.flow``.
"""

from __future__ import annotations

import math

from vibro_cli.compile.kernel import kernel
from vibro_cli.kernels.flow.flow import (
    POLYNOMIAL,
    body_of_group,
    group_of_body,
    polynomial_flow,
)
from vibro_cli.kernels.numerics.weierstrass_motion import quartic_motion, set_quartic_constants
from vibro_cli.kernels.structs import Flight

# A flight's form on a line, beside those of kernels.flow.flow: two of them have no parabola as gap.
TURNING_LINE = 5


@kernel
def pull(tilt: float, spread: float, s: float, c: float) -> float:
    """``f''/w^2`` of a body on an arc: ``-sin f + tilt cos f + spread sin f cos f``."""
    sine = 2.0 * s * c
    cosine = (c - s) * (c + s)
    return sine * (spread * cosine - 1.0) + tilt * cosine


@kernel
def pull_of(flight: Flight, s: float, c: float) -> float:
    """:func:`pull` of a flight, of a group with its ``twist cos 2f``."""
    sine = 2.0 * s * c
    cosine = (c - s) * (c + s)
    double = (cosine - sine) * (cosine + sine)
    return pull(flight.tilt, flight.spread, s, c) + flight.twist * double


@kernel
def stiffness(tilt: float, spread: float, s: float, c: float) -> float:
    """Derivative of :func:`pull` with the angle."""
    sine = 2.0 * s * c
    cosine = (c - s) * (c + s)
    return -cosine - tilt * sine + spread * ((cosine - sine) * (cosine + sine))


@kernel
def set_motion(flight: Flight) -> None:
    """Set the constants of the motion on an arc from its start, but whether it turns over."""
    s = flight.flow_s
    c = flight.flow_c
    p = flight.flow_p
    sine = 2.0 * s * c
    cosine = (c - s) * (c + s)
    turned_sine = flight.tilt * cosine - sine
    turned_cosine = cosine + flight.tilt * sine
    double_cosine = flight.spread * ((cosine - sine) * (cosine + sine))
    double_sine = flight.spread * (sine * cosine)
    square = p * p
    set_quartic_constants(
        flight,
        square - turned_cosine,
        0.25 * (turned_sine - double_sine),
        (2.0 * square - turned_cosine + double_cosine) / 6.0,
        0.25 * (turned_sine + double_sine),
        p,
        flight.turns_over,
    )


@kernel
def flow(flight: Flight, t: float) -> tuple[float, float, float]:
    """Return ``(S, C, P)`` of the body a time ``t`` (s) after the start of a flight."""
    s0 = flight.flow_s
    c0 = flight.flow_c
    if flight.at_rest == 1:
        return flight.s, flight.c, flight.p
    if t == 0.0 and flight.grouped == 0:
        return s0, c0, flight.flow_p
    if flight.form == TURNING_LINE:
        way, speed = _on_line(flight, t)
        return s0 + way, c0, speed
    if flight.form == POLYNOMIAL:
        return polynomial_flow(flight, t)
    sine, cosine, rate = quartic_motion(flight, flight.frequency * t)
    if flight.grouped == 1:
        s, c = s0 * cosine + c0 * sine, c0 * cosine - s0 * sine
        return body_of_group(flight, s, c, rate)
    return s0 * cosine + c0 * sine, c0 * cosine - s0 * sine, rate


@kernel
def displacement(flight: Flight, t: float) -> tuple[float, float]:
    """Sine and cosine of half the angle through which a body has gone since its flight began.

    On a line the way (m) and 1.
    """
    if flight.at_rest == 1:
        return 0.0, 1.0
    if flight.form == TURNING_LINE:
        way, _ = _on_line(flight, t)
        return way, 1.0
    sine, cosine, _ = quartic_motion(flight, flight.frequency * t)
    return sine, cosine


@kernel
def _on_line(flight: Flight, t: float) -> tuple[float, float]:
    """Way (m) and speed (m/s) on a line: ``v' = a + b^2 way``."""
    v = flight.flow_p
    a = flight.line_acceleration
    b = flight.line_growth
    x = b * t
    if x == 0.0:
        return t * (v + 0.5 * a * t), v + a * t
    half = math.sinh(0.5 * x)
    sine = math.sinh(x) / b
    return v * sine + a * (2.0 * half * half / (b * b)), v * math.cosh(x) + a * sine


@kernel
def angular_acceleration(flight: Flight, s: float, c: float) -> float:
    """Second derivative (rad/s^2) of the angle of a body on an arc.

    On a segment of a motion in contact, 0 in place of it: there only its bound is used.
    """
    if flight.form == POLYNOMIAL or flight.at_rest == 1:
        return 0.0
    w = flight.frequency
    if flight.grouped == 1:
        s, c = group_of_body(flight, s, c)
        return w * w * pull_of(flight, s, c)
    return w * w * pull(flight.tilt, flight.spread, s, c)


@kernel
def angular_jerk(flight: Flight, s: float, c: float, p: float) -> float:
    """Third derivative (rad/s^3) of the angle of a body on an arc."""
    if flight.form == POLYNOMIAL:
        return 0.0
    w = flight.frequency
    if flight.grouped == 1:
        s, c = group_of_body(flight, s, c)
        bend = stiffness(flight.tilt, flight.spread, s, c)
        bend -= 4.0 * flight.twist * (2.0 * s * c) * ((c - s) * (c + s))
        return w * w * bend * (2.0 * flight.own_frequency * p)
    return w * w * stiffness(flight.tilt, flight.spread, s, c) * (2.0 * w * p)


@kernel
def tangential_acceleration(flight: Flight, path_radius: float, s: float, c: float) -> float:
    """Acceleration (m/s^2) of a body's centre along its path."""
    if flight.form == TURNING_LINE:
        if flight.at_rest == 1:
            return 0.0
        b = flight.line_growth
        return flight.line_acceleration + b * b * (s - flight.flow_s)
    return path_radius * angular_acceleration(flight, s, c)


@kernel
def nudge(
    flight: Flight, age: float, dt: float, s: float, c: float, p: float
) -> tuple[float, float, float]:
    """Carry the state at ``age`` (s) over a last small step ``dt`` (s), to second order."""
    if flight.grouped == 1 or flight.at_rest == 1 or flight.form == TURNING_LINE:
        return flow(flight, age + dt)
    a = flight.frequency * dt
    force = 0.5 * pull(flight.tilt, flight.spread, s, c)
    change = stiffness(flight.tilt, flight.spread, s, c) * p
    return (
        s + a * (p * c + 0.5 * a * (force * c - p * p * s)),
        c - a * (p * s + 0.5 * a * (force * s + p * p * c)),
        p + a * (force + 0.5 * a * change),
    )
