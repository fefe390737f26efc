"""Every kind of figure of a run on a table or with springs, with what it shows in words."""

from __future__ import annotations

from collections.abc import Iterator

from vibro_cli.figures.kinds import PORTRAIT, Drawn, Kind
from vibro_cli.figures.springs_portrait import springs_portrait
from vibro_cli.figures.system_courses import springs_places, system_energies
from vibro_cli.figures.table_plan import table_plan
from vibro_cli.systems.springs.run import SpringsRun
from vibro_cli.systems.table.run import TableRun

PLAN = Kind[TableRun](
    table_plan,
    "Plan of the table",
    "The wall, the path of every ball from its start (with its number), the balls as they touch, "
    "and arrows of the velocities before (open) and after (full) the impacts, where they are few.",
)
PLACES = Kind[SpringsRun](
    springs_places,
    "Motion along the line",
    "Places of the centres against time, with the impacts; thin horizontal lines are the feet of "
    "the springs.",
)
ENERGIES = Kind[TableRun | SpringsRun](
    system_energies,
    "Energies",
    "Energy of each body and of all against time; below, what each impact loses.",
)
_PORTRAIT_CAPTION = (
    "Above, speed against the displacement from the foot of the spring: the branches run through "
    "and the jumps at the impacts; behind them level curves of energy, the separatrix (dashed), "
    "centres (circles) and saddles (crosses). Below, the energy of the spring and the total energy."
)


def draw_system(run: TableRun | SpringsRun, width: str = "double") -> Iterator[Drawn]:
    """Draw every kind of figure of a run; those that show nothing are left out."""
    if isinstance(run, TableRun):
        yield Drawn("plan", PLAN.title, PLAN.caption, table_plan(run, width))
    else:
        for ball in range(1, len(run.system.bodies) + 1):
            title = f"Phase portrait and energies of body {ball}"
            figure = springs_portrait(run, ball, width)
            yield Drawn(f"{PORTRAIT}_{ball}", title, _PORTRAIT_CAPTION, figure)
        yield Drawn("motion", PLACES.title, PLACES.caption, springs_places(run, width))
    energies = system_energies(run, width)
    if energies is not None:
        yield Drawn("energy", ENERGIES.title, ENERGIES.caption, energies)
