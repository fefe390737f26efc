"""The flow of one body on one piece in closed form.

On an arc the half-angle variables obey Euler's top ``S' = wPC, C' = -wPS, P' = -wSC``; the state at
``t`` follows from the state at 0 by the addition theorems. On a line the motion is a parabola.
Equations of motion: A (1), B (30)-(33); model of the half-angle form: DLMF 22.8.
"""

from __future__ import annotations

from vibro_cli.compile.kernel import SERIES_LENGTH, kernel
from vibro_cli.kernels.numerics.elliptic import (
    HYPERBOLIC_TINY,
    TRIGONOMETRIC,
    theta_functions,
    trigonometric_form,
)
from vibro_cli.kernels.numerics.trigonometry import sine_cosine
from vibro_cli.kernels.structs import Flight

LINE = 3  # a flight's form on a line, beside those of kernels.numerics.elliptic
POLYNOMIAL = 4  # ... and on a segment of a motion in contact across pieces


@kernel
def swings(flight: Flight) -> bool:
    """Tell whether a flight is that of a free pendulum: on an arc, moving, by itself."""
    return flight.form <= HYPERBOLIC_TINY and flight.grouped == 0 and flight.at_rest == 0


@kernel
def flow(flight: Flight, t: float) -> tuple[float, float, float]:
    """Return ``(S, C, P)`` of the body a time ``t`` (s) after the start of a flight."""
    s0 = flight.flow_s
    c0 = flight.flow_c
    p0 = flight.flow_p
    if flight.at_rest == 1:
        return flight.s, flight.c, flight.p
    if t == 0.0 and flight.grouped == 0:
        return s0, c0, p0
    if flight.form == LINE:
        a = flight.line_acceleration
        return s0 + t * (p0 + 0.5 * a * t), c0, p0 + a * t
    if flight.form == POLYNOMIAL:
        return polynomial_flow(flight, t)
    s, c, d, common = theta_functions(flight, flight.frequency * t)
    if flight.form == TRIGONOMETRIC and flight.grouped == 0:
        return by_addition(flight, s, c, d, common)
    if flight.form == HYPERBOLIC_TINY:
        # Homogeneous of degree 0 in (c, d, C, P): scaled against underflow at a crest.
        scale = 1.0 / (abs(c) + abs(s * c0))
        c *= scale
        d *= scale
        c0 *= scale
        p0 *= scale
    sc0 = s * c0
    inverse = 1.0 / (c * c + sc0 * sc0)
    s1 = (s0 * (c * d) + p0 * c0 * (s * common)) * inverse
    c1 = (c0 * (d * common) - s0 * p0 * (s * c)) * inverse
    p1 = (p0 * (c * common) - s0 * c0 * (s * d)) * inverse
    if flight.grouped == 1:
        return body_of_group(flight, s1, c1, p1)
    return s1, c1, p1


@kernel
def flow_of_two(
    a: Flight, b: Flight, age_a: float, age_b: float
) -> tuple[float, float, float, float, float, float]:
    """Return ``(S, C, P)`` of two bodies, each a time (s) after the start of its flight.

    The same operations as of :func:`flow` for each; for two librations they take turns, so that
    the processor need not wait for one to end before it begins the other.
    """
    both = a.form == TRIGONOMETRIC and b.form == TRIGONOMETRIC and swings(a) and swings(b)
    if not both or age_a == 0.0 or age_b == 0.0:
        a_s, a_c, a_p = flow(a, age_a)
        b_s, b_c, b_p = flow(b, age_b)
        return a_s, a_c, a_p, b_s, b_c, b_p
    a_s, a_c = sine_cosine(a.frequency * age_a * a.argument_scale)
    b_s, b_c = sine_cosine(b.frequency * age_b * b.argument_scale)
    a_s, a_c, a_d, a_common = trigonometric_form(a, a_s, a_c)
    b_s, b_c, b_d, b_common = trigonometric_form(b, b_s, b_c)
    a_s, a_c, a_p = by_addition(a, a_s, a_c, a_d, a_common)
    b_s, b_c, b_p = by_addition(b, b_s, b_c, b_d, b_common)
    return a_s, a_c, a_p, b_s, b_c, b_p


@kernel
def by_addition(
    flight: Flight, s: float, c: float, d: float, common: float
) -> tuple[float, float, float]:
    """State from that at the start, by the addition theorems."""
    s0 = flight.flow_s
    c0 = flight.flow_c
    p0 = flight.flow_p
    sc0 = s * c0
    inverse = 1.0 / (c * c + sc0 * sc0)
    return (
        (s0 * (c * d) + p0 * c0 * (s * common)) * inverse,
        (c0 * (d * common) - s0 * p0 * (s * c)) * inverse,
        (p0 * (c * common) - s0 * c0 * (s * d)) * inverse,
    )


@kernel
def path_on_segment(flight: Flight, t: float) -> tuple[float, float]:
    """Way along the path (m) and speed (m/s) a time ``t`` after the start of a segment."""
    x = t / flight.segment
    speed = 0.0
    way = 0.0
    for k in range(SERIES_LENGTH - 1, -1, -1):
        term = flight.series[k] / (k + 1.0)
        speed = speed * x + term
        way = way * x + term / (k + 2.0)
    start = flight.flow_p
    return t * (start + t * way), start + t * speed


@kernel
def polynomial_flow(flight: Flight, t: float) -> tuple[float, float, float]:
    """``(S, C, P)`` on a segment of a motion in lasting contact across pieces."""
    way, speed = path_on_segment(flight, t)
    p = speed * flight.rate_ratio
    if flight.half_curvature == 0.0:
        return flight.flow_s + way, flight.flow_c, p
    s, c = sine_cosine(way * flight.half_curvature)
    return flight.flow_s * c + flight.flow_c * s, flight.flow_c * c - flight.flow_s * s, p


@kernel
def body_of_group(flight: Flight, s: float, c: float, p: float) -> tuple[float, float, float]:
    """State of a body from that of its group's pendulum, which it leads by a constant angle."""
    return (
        s * flight.shift_c + c * flight.shift_s,
        c * flight.shift_c - s * flight.shift_s,
        p * flight.rate_ratio,
    )


@kernel
def group_of_body(flight: Flight, s: float, c: float) -> tuple[float, float]:
    """Half-angle of the group's pendulum from that of the body."""
    return s * flight.shift_c - c * flight.shift_s, c * flight.shift_c + s * flight.shift_s


@kernel
def angular_acceleration(flight: Flight, s: float, c: float) -> float:
    """Second derivative (rad/s^2) of the angle of a body on an arc, ``-w^2 sin f``.

    On a segment across pieces, 0 in place of it: there only its bound is used.
    """
    if flight.form == POLYNOMIAL or flight.at_rest == 1:
        return 0.0
    if flight.grouped == 1:
        s, c = group_of_body(flight, s, c)
    return pendulum_acceleration(flight.frequency, s, c)


@kernel
def pendulum_acceleration(w: float, s: float, c: float) -> float:
    """``-w^2 sin f`` (rad/s^2)."""
    return -2.0 * (w * w * s * c)


@kernel
def angular_jerk(flight: Flight, s: float, c: float, p: float) -> float:
    """Third derivative (rad/s^3) of the angle of a body on an arc, ``-w^2 cos f f'``."""
    if flight.form == POLYNOMIAL:
        return 0.0
    rate = 2.0 * flight.own_frequency * p
    if flight.grouped == 1:
        s, c = group_of_body(flight, s, c)
    return pendulum_jerk(flight.frequency, s, c, rate)


@kernel
def pendulum_jerk(w: float, s: float, c: float, rate: float) -> float:
    """``-w^2 cos f f'`` (rad/s^3)."""
    return -(w * w) * ((c - s) * (c + s)) * rate


@kernel
def tangential_acceleration(flight: Flight, path_radius: float, s: float, c: float) -> float:
    """Acceleration (m/s^2) of a body's centre along its path."""
    if flight.form == LINE:
        return flight.line_acceleration if flight.at_rest == 0 else 0.0
    return path_radius * angular_acceleration(flight, s, c)


@kernel
def acceleration_at(flight: Flight, path_radius: float, age: float, s: float, c: float) -> float:
    """As :func:`tangential_acceleration`, on a segment across pieces too (at its ``age``, s)."""
    if flight.form != POLYNOMIAL or flight.at_rest == 1:
        return tangential_acceleration(flight, path_radius, s, c)
    x = age / flight.segment
    acceleration = 0.0
    for k in range(SERIES_LENGTH - 1, -1, -1):
        acceleration = acceleration * x + flight.series[k]
    return acceleration


@kernel
def angular_acceleration_at(flight: Flight, age: float, s: float, c: float) -> float:
    """As :func:`angular_acceleration`, on a segment across pieces too (at its ``age``, s)."""
    if flight.form != POLYNOMIAL or flight.at_rest == 1:
        return angular_acceleration(flight, s, c)
    return 2.0 * flight.half_curvature * acceleration_at(flight, 0.0, age, s, c)


@kernel
def nudge(
    flight: Flight, age: float, dt: float, s: float, c: float, p: float
) -> tuple[float, float, float]:
    """Carry the state at ``age`` (s) over a last small step ``dt`` (s)."""
    if flight.grouped == 1 or flight.at_rest == 1:
        return flow(flight, age + dt)
    if flight.form == LINE:
        a = flight.line_acceleration
        return s + dt * (p + 0.5 * a * dt), c, p + a * dt
    return advance_slightly(flight.frequency, dt, s, c, p)


@kernel
def advance_slightly(
    frequency: float, dt: float, s: float, c: float, p: float
) -> tuple[float, float, float]:
    """Third-order step of the half-angle variables, for ``w dt`` below about 1e-4."""
    a = frequency * dt
    s2 = s * s
    c2 = c * c
    p2 = p * p
    half = 0.5 * a
    third = a * a * (1.0 / 6.0)
    return (
        s + a * (p * c * (1.0 + third * (4.0 * s2 - p2 - c2)) - half * s * (p2 + c2)),
        c - a * (p * s * (1.0 - third * (4.0 * c2 + p2 - s2)) + half * c * (p2 - s2)),
        p - a * (s * c * (1.0 - third * (4.0 * p2 + c2 - s2)) + half * p * (c2 - s2)),
    )
