"""Scenarios in other units: lengths and times multiplied by powers of two."""

from __future__ import annotations

import math
from typing import Any

# Powers of length and time in the numbers of a scenario; masses stay.
POWERS = {
    "gravity": (1, -2),
    "stiffness": (0, -2),
    "rate": (0, -1),
    "omega": (0, -1),
    "time": (0, 1),
    **dict.fromkeys(("speed", "velocity_x", "velocity_y"), (1, -1)),
    **dict.fromkeys(("length", "position", "radius", "thickness", "x", "y"), (1, 0)),
    **dict.fromkeys(("semi_axis_x", "semi_axis_y", "width", "depth", "corners"), (1, 0)),
    **dict.fromkeys(("height", "foot"), (1, 0)),
}


def scaled(data: Any, length: int, time: int, key: str = "") -> Any:
    """Return a scenario with lengths times 2^length and times times 2^time."""
    if isinstance(data, dict):
        return {name: scaled(value, length, time, name) for name, value in data.items()}
    if isinstance(data, list):
        return [scaled(value, length, time, key) for value in data]
    if key not in POWERS:
        return data
    of_length, of_time = POWERS[key]
    return math.ldexp(data, length * of_length + time * of_time)
