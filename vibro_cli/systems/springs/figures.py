"""Every kind of figure of a run of bodies on springs, with what it shows in words."""

from __future__ import annotations

from typing import Any

from vibro_cli.figures.dots import MANY
from vibro_cli.figures.kinds import INTERVALS, PORTRAIT, Kind, KindOfBody
from vibro_cli.systems.run import Run
from vibro_cli.systems.springs.courses import springs_energies, springs_impact_map, springs_places
from vibro_cli.systems.springs.portrait import springs_portrait
from vibro_cli.systems.springs.scene import springs_scene

_PORTRAIT_CAPTION = (
    "Above, speed against the displacement from the foot of the spring: the branches run through "
    "and the jumps at the impacts, lasting contact in a colour of its own, many branches in the "
    "colours of time up to the last impact; behind them level curves of energy, the separatrix, "
    "centres (+) and saddles (×). Below, the energy of the spring and the total energy. "
    "As C fig. 5b."
)
FIGURES: dict[str, Kind[Any] | KindOfBody] = {
    "scene": Kind[Run](
        springs_scene,
        "The bodies with their springs",
        "To scale, at the start and at the first impacts: centres C, feet A of the springs at the "
        "heights b above the line of the centres, and the line on which each body rolls; "
        "of an impact how far apart its centres are. As C fig. 5a.",
    ),
    PORTRAIT: KindOfBody(
        springs_portrait, "Phase portrait and energies of body", _PORTRAIT_CAPTION
    ),
    "motion": Kind[Run](
        springs_places,
        "Motion along the line",
        "Places of the centres against time, with the impacts; thin horizontal lines are the feet "
        "of the springs. Of a long run the first part only.",
    ),
    "energy": Kind[Run](
        springs_energies,
        "Energies",
        "Energy of each body and of all against time; below, what each impact loses. Of lasting "
        "contact at the end some periods only.",
    ),
    "impact_map": Kind[Run](
        springs_impact_map,
        "Impact map",
        f"Approach speed against the place of the centre of the left body at the impact.{MANY}",
    ),
    "intervals": INTERVALS,
}
