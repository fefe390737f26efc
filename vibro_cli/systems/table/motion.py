"""The motion of the balls between their events, from the logs: straight, so exact at any time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibro_cli.systems.table.system import TableSystem
from vibro_cli.systems.table.world import Ball

Floats = NDArray[np.float64]


class Motion:
    """Every ball's places and velocities at its events, in order of time."""

    def __init__(self, system: TableSystem, pairs: Any, bounces: Any) -> None:
        self._system = system
        self.balls = [_events(system, ball, pairs, bounces) for ball in range(len(system.bodies))]

    def at(self, ball: int, times: Floats, side: str = "after") -> dict[str, Floats]:
        """Return columns x, y (m), vx, vy (m/s) of a ball at some times.

        `side` is "after" or "before" an event that happens at just such an instant.
        Raises ValueError for another side.
        """
        if side not in ("after", "before"):
            raise ValueError(f'side must be "after" or "before", not {side!r}')
        events = self.balls[ball]
        count = np.searchsorted(events["t"], times, side="right" if side == "after" else "left")
        row = np.maximum(count - 1, 0)
        past = times - events["t"][row] - events["t_low"][row]
        return {
            "x": events["x"][row] + past * events["vx"][row],
            "y": events["y"][row] + past * events["vy"][row],
            "vx": events["vx"][row],
            "vy": events["vy"][row],
        }

    def sample(self, times: Any, side: str = "after") -> dict[str, NDArray[Any]]:
        """Return the columns of the motion table: for each time a row for each ball."""
        instants = np.asarray(times, dtype=np.float64)
        number = len(self.balls)
        each = [self.at(ball, instants, side) for ball in range(number)]
        column = {key: np.stack([one[key] for one in each], axis=1).ravel() for key in each[0]}
        return _motion_columns(self._system, instants, column)


def states_at(system: TableSystem, balls: Sequence[Ball], time: float) -> dict[str, NDArray[Any]]:
    """Return the columns of the motion table at one time (s), from the balls' last events."""
    past = np.array([time - ball.t - ball.t_low for ball in balls])
    x, y, vx, vy = np.array([(ball.x, ball.y, ball.vx, ball.vy) for ball in balls]).T
    column = {"x": x + past * vx, "y": y + past * vy, "vx": vx, "vy": vy}
    return _motion_columns(system, np.array([time]), column)


def _motion_columns(
    system: TableSystem, instants: Floats, column: dict[str, Floats]
) -> dict[str, NDArray[Any]]:
    number = len(system.bodies)
    masses = np.array([body.kappa * body.mass for body in system.bodies])
    square = column["vx"] ** 2 + column["vy"] ** 2
    return {
        "t": np.repeat(instants, number),
        "ball": np.tile(np.arange(1, number + 1), len(instants)),
        "x": column["x"],
        "y": column["y"],
        "velocity_x": column["vx"],
        "velocity_y": column["vy"],
        "speed": np.sqrt(square),
        "energy": 0.5 * np.tile(masses, len(instants)) * square,
    }


def _events(system: TableSystem, ball: int, pairs: Any, bounces: Any) -> dict[str, Floats]:
    """The states of a ball after its start and after each of its events."""
    start = system.initial[ball]
    parts = [np.array([[0.0, 0.0, 0.0, *start.place, *start.velocity]])]
    for letter in "ab":
        rows = pairs[(pairs[letter] == ball) & _carried_out(pairs)]
        own = [f"{name}_{letter}" for name in ("x", "y", "vx", "vy")]
        columns = ["event", "t", "t_low", *own[:2], *(f"{name}_post" for name in own[2:])]
        parts.append(np.column_stack([rows[name] for name in columns]))
    rows = bounces[bounces["ball"] == ball]
    columns = ["event", "t", "t_low", "x", "y", "vx_post", "vy_post"]
    parts.append(np.column_stack([rows[name] for name in columns]))
    table = np.concatenate(parts)
    names = ("event", "t", "t_low", "x", "y", "vx", "vy")
    return dict(zip(names, table[np.argsort(table[:, 0])].T, strict=True))


def _carried_out(pairs: Any) -> Any:
    """Which impacts changed the motion: an inadmissible one under `stop` did not."""
    return (pairs["admissible"] == 1) | (pairs["substituted"] == 1)
