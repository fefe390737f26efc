"""Energies of bodies from their definitions, independent of the program's own formulas."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def on_trace(system: Any, ball: int, arc: int, place: Array, rate: Array) -> Array:
    """Kinetic and potential energy (J) of a body (from 1) on an arc (from 1), up to a constant."""
    body, piece = system.bodies[ball - 1], system.trace.pieces[arc - 1]
    if piece.shape == "line":
        scale = 1.0
        x = piece.start[0] + place * math.cos(piece.start_slope)
        y = piece.start[1] + place * math.sin(piece.start_slope)
    else:
        side = 1.0 if piece.shape == "valley" else -1.0
        scale = piece.radius - side * body.radius
        x = piece.centre[0] + scale * np.sin(place)
        y = piece.centre[1] - side * scale * np.cos(place)
    height = system.gravity * y
    if piece.shape == "line":
        height = height + system.gravity * body.radius * math.cos(piece.start_slope)
        x = x - body.radius * math.sin(piece.start_slope)
    if system.turning is not None:
        height = height - 0.5 * system.turning.square * (x - system.turning.x) ** 2
    energy: Array = body.mass * (0.5 * body.kappa * (scale * rate) ** 2 + height)
    return energy


def on_spring(system: Any, ball: int, place: Array, speed: Array) -> Array:
    """Kinetic energy and that of the spring (J) of a body (from 1), from the spring's foot."""
    body, spring = system.bodies[ball - 1], system.springs[ball - 1]
    stretch = np.sqrt(spring.height**2 + place**2) - spring.length
    energy: Array = 0.5 * body.kappa * body.mass * speed**2 + 0.5 * spring.stiffness * stretch**2
    return energy
