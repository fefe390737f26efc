"""Every kind of figure of a run on a table, with what it shows in words."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from vibro_cli.figures.runs.contact_points import POINTS_CAPTION, POINTS_TITLE
from vibro_cli.figures.runs.kinds import EXPONENTS, INTERVALS, Kind, KindOfBody
from vibro_cli.figures.runs.over_time import EnergyLines, energy_chart, energy_lines
from vibro_cli.figures.source import Array, kept
from vibro_cli.systems.run import Run
from vibro_cli.systems.table.plan import table_plan
from vibro_cli.systems.table.velocities import table_contact_points, table_velocities


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
