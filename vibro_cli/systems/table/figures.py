"""Every kind of figure of a run on a table, and what a film of it shows."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vibro_cli.figures.film import Frames, Ground, States, trail
from vibro_cli.figures.kinds import EXPONENTS, INTERVALS, Kind, KindOfBody
from vibro_cli.figures.runs.contact_points import POINTS_CAPTION, POINTS_TITLE
from vibro_cli.figures.runs.over_time import EnergyLines, energy_chart, energy_lines
from vibro_cli.figures.source import Array, kept
from vibro_cli.systems.run import Run
from vibro_cli.systems.table.plan import draw_wall, table_plan, wall_corners
from vibro_cli.systems.table.velocities import table_contact_points, table_velocities

_ROOM = 0.03
"""Around what is shown, as a share of its size."""


def film_on_table(run: Any, times: Array) -> Frames:
    """Return the places of all balls at the times of frames (s).

    Between events paths are straight, so that frames and events are all that a trail needs.
    """
    bodies, times = run.system.bodies, np.asarray(times)
    sampled = run.sample(times)
    x, y = (np.asarray(sampled[name]).reshape(len(times), len(bodies)) for name in "xy")
    trails = tuple(
        trail(times, math.inf, [(times, x[:, n], y[:, n], 2), *_events(run, n)])
        for n in range(len(bodies))
    )
    span = float(times[-1] - times[0])
    return Frames(_ground(run, x, y), times, x, y, None, x, y, trails, span)


def _events(run: Any, ball: int) -> Iterator[States]:
    """Yield where a ball (from 0) meets others and the wall."""
    bounces = run.table("bounces")
    for table, end in ((run.collisions, "_a"), (run.collisions, "_b"), (bounces, "")):
        rows = np.flatnonzero(np.asarray(table[f"ball{end}"]) == ball + 1)
        time, x, y = (
            np.asarray(table[name], dtype=np.float64)[rows] for name in ("t", f"x{end}", f"y{end}")
        )
        yield time, x, y, 0


def _ground(run: Any, x: Array, y: Array) -> Ground:
    """Return the wall, and without one the part of the table on which the balls are seen."""
    wall, radii = run.system.wall, tuple(body.radius for body in run.system.bodies)
    low = np.array([np.min(x - radii), np.min(y - radii)])
    high = np.array([np.max(x + radii), np.max(y + radii)])
    if wall is not None:
        corners = wall_corners(wall)
        low, high = np.minimum(low, corners[0]), np.maximum(high, corners[1])
    room = _ROOM * float(np.max(high - low))

    def draw(axes: Axes, half: float) -> None:
        if wall is not None:
            draw_wall(axes, wall)

    return Ground(radii, low - room, high + room, draw, "the table from above", None)


def table_energies(run: Run, width: str = "single") -> Figure | None:
    """Return the energy of each ball and of all against time, and what the impacts lose.

    None where no energy changes.
    """
    tables = (run.collisions, run.bounces)
    t, lost = (np.concatenate([table[name] for table in tables]) for name in ("t", "energy_loss"))
    if len(run.system.bodies) == 1 and not np.any(lost > 0.0):
        return None
    times = run.end_time, run.end_time
    return energy_chart(run, _lines(run), (t, lost), [], times, width)


@kept
def _lines(run: Run) -> EnergyLines:
    """Return the lines of the energies."""
    return energy_lines([_energy(run, ball) for ball in range(1, len(run.system.bodies) + 1)])


def _energy(run: Run, ball: int) -> tuple[Array, Array]:
    """Return times (s) and the energy (J) of a ball (from 1); at a jump a time stands twice."""
    motion: Any = run.trajectory
    events, body = motion.balls[ball - 1], run.system.bodies[ball - 1]
    energy = 0.5 * body.kappa * body.mass * (events["vx"] ** 2 + events["vy"] ** 2)
    ends = np.append(events["t"][1:], run.end_time)
    return np.column_stack([events["t"], ends]).ravel(), np.repeat(energy, 2)


FIGURES: dict[str, Kind[Any] | KindOfBody] = {
    "plan": Kind[Run](
        table_plan,
        "Plan of the table",
        "The wall, the path of every ball from its start (with its number), the balls as they "
        "touch, and arrows of the velocities before (open) and after (full) the impacts, where "
        "they are few. As C figs 1 and 4.",
    ),
    "velocities": Kind[Run](
        table_velocities,
        "Plan of velocities and angles",
        "The first impacts from above, before and after: velocities and paths of the centres C, "
        "components along the normal, angular velocities along the axes of rolling, the tangent at "
        "the contact T, and the angles of arrival α and of outgoing α′ between paths and normal. "
        "As C figs 1, 2b, 2c and 4.",
    ),
    "contact_points": Kind[Run](
        table_contact_points, POINTS_TITLE, POINTS_CAPTION + " As C figs 2a and 3."
    ),
    "energy": Kind[Run](
        table_energies,
        "Energies",
        "Energy of each body and of all against time; below, what each impact loses. Of lasting "
        "contact at the end some periods only.",
    ),
    "intervals": INTERVALS,
    "exponents": EXPONENTS,
}
