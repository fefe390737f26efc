"""Branches of a phase trajectory between two events: what a body runs through in free flight."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from vibro_cli.analysis.landscape import Array, Landscape
from vibro_cli.mechanics.trace import Piece

Mask = NDArray[np.bool_]

_NO_TURN = 1e-6
"""A sweep within this (rad) of none or a whole turn is the one for which the time is right."""


def free_branches(
    landscape: Landscape,
    piece: Piece,
    start: tuple[Array, Array],
    end: tuple[Array, Array],
    duration: Array,
    count: int,
) -> tuple[Array, Array]:
    """Return the phase curves of free flights on one piece, from state to state.

    `start` and `end` are positions and rates, each of shape (flights,), `duration` the times (s)
    between them; the result is positions and rates of shape (flights, count). Energy is constant
    along each; a flight of several periods gives its closed curve once, and on to its end.
    On an arc the curve is part of the circle S² + P² = q with S = sin(f/2), P = ḟ/2w, f the angle
    from the centre about which the body oscillates, or a curve without turning (q ≥ 1).
    """
    fraction = np.linspace(0.0, 1.0, count)
    if piece.is_line:
        position, rate = _on_line(landscape, piece, start, duration, fraction)
    else:
        position, rate = _on_arc(landscape, piece, start, end, duration, fraction)
    position[:, 0], rate[:, 0] = start
    position[:, -1], rate[:, -1] = end
    return position, rate


def _on_arc(
    landscape: Landscape,
    piece: Piece,
    start: tuple[Array, Array],
    end: tuple[Array, Array],
    duration: Array,
    fraction: Array,
) -> tuple[Array, Array]:
    position = start[0][:, None] + (end[0] - start[0])[:, None] * fraction
    rate = _without_turning(landscape, piece, start, position)
    if landscape.gravity > 0.0:
        offset = 0.0 if piece.sign > 0 else math.pi
        centre = offset + 2.0 * math.pi * np.round((start[0] - offset) / (2.0 * math.pi))
        w = landscape.natural_rate(piece)
        q = np.sin(0.5 * (start[0] - centre)) ** 2 + (0.5 / w * start[1]) ** 2
        swings = _swings(q, start, end, centre)
        swinging = _oscillation(
            w,
            (start[0] - centre)[swings],
            start[1][swings],
            (end[0] - centre)[swings],
            end[1][swings],
            duration[swings],
            fraction,
        )
        position[swings] = centre[swings, None] + swinging[0]
        rate[swings] = swinging[1]
    return position, rate


def _swings(q: Array, start: tuple[Array, Array], end: tuple[Array, Array], centre: Array) -> Mask:
    """Return which flights oscillate; on the separatrix their ends decide, not q."""
    turned = start[1] * end[1] < 0.0
    passed = np.abs(end[0] - centre) > math.pi
    swings: Mask = ((q < 1.0) & ~passed) | turned
    return swings


def _without_turning(
    landscape: Landscape, piece: Piece, start: tuple[Array, Array], position: Array
) -> Array:
    """Return the rates at positions that a body passes in the direction it started in."""
    fall = 2.0 * landscape.natural_rate(piece) * np.sin(0.5 * position)
    from_start = 2.0 * landscape.natural_rate(piece) * np.sin(0.5 * start[0])
    square = (start[1] ** 2 + piece.sign * from_start**2)[:, None] - piece.sign * fall**2
    rate: Array = np.copysign(np.sqrt(np.maximum(square, 0.0)), start[1][:, None])
    return rate


def _oscillation(
    w: float,
    angle_start: Array,
    rate_start: Array,
    angle_end: Array,
    rate_end: Array,
    duration: Array,
    fraction: Array,
) -> tuple[Array, Array]:
    """Return angles and rates about a centre: S = √q sin θ, P = √q cos θ, with θ growing."""
    s_start, p_start = np.sin(0.5 * angle_start), 0.5 / w * rate_start
    s_end, p_end = np.sin(0.5 * angle_end), 0.5 / w * rate_end
    theta = np.arctan2(s_start, p_start)
    modulus = np.hypot(s_start, p_start)
    period = _period(w, modulus)
    sweep = np.mod(np.arctan2(s_end, p_end) - theta, 2.0 * math.pi)
    short = duration < 0.5 * period
    sweep = np.where((sweep > 2.0 * math.pi - _NO_TURN) & short, 0.0, sweep)
    again = (duration >= period) | ((sweep < _NO_TURN) & ~short)
    sweep = np.where(again, sweep + 2.0 * math.pi, sweep)
    along = theta[:, None] + sweep[:, None] * fraction
    sine = np.minimum(modulus[:, None], 1.0) * np.sin(along)
    return 2.0 * np.arcsin(sine), 2.0 * w * modulus[:, None] * np.cos(along)


def _period(w: float, modulus: Array) -> Array:
    """Return the periods (s) of oscillations of modulus k: 4K(k)/w, by the mean of Gauss."""
    upper = np.ones_like(modulus)
    lower = np.sqrt(np.maximum((1.0 - modulus) * (1.0 + modulus), 0.0))
    for _ in range(8):
        upper, lower = 0.5 * (upper + lower), np.sqrt(upper * lower)
    mean = np.maximum(0.5 * (upper + lower), np.finfo(np.float64).tiny)
    period: Array = 2.0 * math.pi / (w * mean)
    return period


def _on_line(
    landscape: Landscape,
    piece: Piece,
    start: tuple[Array, Array],
    duration: Array,
    fraction: Array,
) -> tuple[Array, Array]:
    acceleration = -landscape.gravity / landscape.body.kappa * math.sin(piece.start_slope)
    time = duration[:, None] * fraction
    speed = start[1][:, None] + acceleration * time
    position = start[0][:, None] + 0.5 * (start[1][:, None] + speed) * time
    return position, speed
