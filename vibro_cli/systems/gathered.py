"""The motion in a run of any system but the trace, gathered while it is solved.

It is made stretch by stretch, so that no log is kept whole.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any

from vibro_cli.systems.contract import Rows, System
from vibro_cli.systems.run import ahead, begun
from vibro_cli.systems.wanted import Limits, within_run

MOST_ROWS = 200_000
"""Of a run whose logs have more rows than this none is kept for figures and reports."""


class Gathered:
    """The motion in a run, whole once every stretch was taken."""

    state: dict[str, Any]
    """All that changes in the run after its last event, of one that was `solved_again`."""

    def __init__(self, system: Any) -> None:
        self.system = system
        self._parts: list[Any] = []
        self._end = 0.0

    def take(self, trajectory: Any, end: float) -> None:
        """Take the motion in the next stretch, which ends at that time (s)."""
        self._parts.append(trajectory)
        self._end = end

    @cached_property
    def trajectory(self) -> Any:
        """The motion of all bodies, in closed form, see `Trajectory` of the contract."""
        whole, self._parts = self._parts, []
        whole[0].go_on(whole[1:])
        return whole[0]

    def sample(self, times: Any, side: str = "after", extrapolate: bool = False) -> Rows:
        """Return the motion of every body at given times, see ``systems.run.Run``."""
        return self.trajectory.sample(within_run(times, self._end, extrapolate), side)  # type: ignore[no-any-return]


def solved_again(
    kind: System, system: Any, limits: Limits, rows: Mapping[str, int], interrupted: bool
) -> Any:
    """Return the motion in a run with so many rows in its logs, see `System.long_motion`."""
    motion, run, most = Gathered(system), begun(kind, system, limits), sum(rows.values())
    before = None
    for stretch in ahead(run.until(lambda: interrupted and sum(run.driver.rows.values()) >= most)):
        trajectory = kind.trajectory(system, stretch, before)
        motion.take(trajectory, stretch.end[0])
        before = trajectory.last
    motion.state = run.state
    return motion
