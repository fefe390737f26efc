"""The motion of the balls between their events, from the logs: straight, so exact at any time."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibro_cli.systems.table.system import TableSystem
from vibro_cli.systems.table.tables import MOTION

Floats = NDArray[np.float64]
_NAMES = ("event", "t", "t_low", "x", "y", "vx", "vy")


class Motion:
    """Every ball's places and velocities at its events, in order of time.

    Parameters
    ----------
    system
        What is solved.
    pairs, bounces
        The logs of a stretch of the run.
    before
        The last event of each ball before it, from :attr:`last`; without it the stretch is the
        first.
    """

    def __init__(
        self, system: TableSystem, pairs: Any, bounces: Any, before: Floats | None = None
    ) -> None:
        self._system = system
        number = len(system.bodies)
        if before is None:
            starts = [(0.0, 0.0, 0.0, *one.place, *one.velocity) for one in system.initial]
            before = np.array(starts)
        balls, rows = _events(pairs, bounces)
        balls = np.concatenate([np.arange(number), balls])
        rows = np.concatenate([before, rows])
        order = np.lexsort((rows[:, 0], balls))
        rows = rows[order]
        firsts = np.searchsorted(balls[order], np.arange(number + 1))
        self.last: Floats = rows[firsts[1:] - 1]
        """The last event of each ball: a row for each."""
        columns = rows.T
        self.balls: list[dict[str, Floats]] = [
            dict(zip(_NAMES, columns[:, low:high], strict=True))
            for low, high in pairwise(firsts.tolist())
        ]
        """Events of each ball, from its start: `t`, `t_low` (s), `x`, `y` (m), `vx`, `vy` (m/s)."""

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

    def sample(
        self, times: Any, side: str = "after", extrapolate: bool = False
    ) -> dict[str, NDArray[Any]]:
        """Return the columns of the motion table: for each time a row for each ball."""
        instants = np.asarray(times, dtype=np.float64)
        each = [self.at(ball, instants, side) for ball in range(len(self.balls))]
        column = {key: np.stack([one[key] for one in each], axis=1).ravel() for key in each[0]}
        return _motion_columns(self._system, instants, column)


def states_at(system: TableSystem, balls: Any, time: float) -> dict[str, NDArray[Any]]:
    """Return the columns of the motion table at one time (s), from the balls' last events."""
    past = time - balls["t"] - balls["t_low"]
    x, y = (balls[axis] + past * balls[f"v{axis}"] for axis in "xy")
    column = {"x": x, "y": y, "vx": balls["vx"], "vy": balls["vy"]}
    return _motion_columns(system, np.array([time]), column)


def _motion_columns(
    system: TableSystem, instants: Floats, column: dict[str, Floats]
) -> dict[str, NDArray[Any]]:
    number = len(system.bodies)
    masses = np.array([body.kappa * body.mass for body in system.bodies])
    more = {
        "t": np.repeat(instants, number),
        "ball": np.tile(np.arange(1, number + 1), len(instants)),
        "mass": np.tile(masses, len(instants)),
        "square": column["vx"] ** 2 + column["vy"] ** 2,
    }
    return MOTION.filled(column | more)


def _events(pairs: Any, bounces: Any) -> tuple[Any, Floats]:
    """The balls to which something happens, and their states after it, a row for each."""
    # An inadmissible impact under `stop` changes nothing.
    made = pairs[(pairs["admissible"] == 1) | (pairs["substituted"] == 1)]
    balls, parts = [made["a"], made["b"], bounces["ball"]], []
    for end in "ab":
        own = [f"{name}_{end}" for name in ("x", "y", "vx", "vy")]
        names = ["event", "t", "t_low", *own[:2], *(f"{name}_post" for name in own[2:])]
        parts.append(np.column_stack([made[name] for name in names]))
    names = ["event", "t", "t_low", "x", "y", "vx_post", "vy_post"]
    parts.append(np.column_stack([bounces[name] for name in names]))
    return np.concatenate(balls), np.concatenate(parts)
