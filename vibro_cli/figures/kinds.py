"""Every kind of figure of a run, by name, with what it shows in words."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

from matplotlib.figure import Figure

from vibro_cli.figures.over_impacts import accuracy, impact_map, intervals
from vibro_cli.figures.over_time import energies, space_time
from vibro_cli.figures.plan import plan
from vibro_cli.figures.portrait import phase_portrait
from vibro_cli.figures.scene import scene
from vibro_cli.figures.source import Recorded, Remembered
from vibro_cli.figures.velocities import velocities

Source = TypeVar("Source")


@dataclass(frozen=True)
class Kind(Generic[Source]):
    """One kind of figure of a whole run, or of a grid."""

    draw: Callable[[Source, str], Figure | None]
    """From a run or grid and a width; None where it has nothing to show."""
    title: str
    caption: str


PORTRAIT = "portrait"
_PORTRAIT_CAPTION = (
    "Rate against angle on each arc (speed against arc length on lines): the branches run through, "
    "and the jumps at the impacts; behind them separatrices, level curves of energy, centres (+) "
    "and saddles (×)."
)
KINDS: dict[str, Kind[Recorded]] = {
    "scene": Kind(
        scene,
        "The trace and the bodies at the start",
        "To scale: the pieces of the trace between the dots, with their numbers below, and the "
        "bodies with theirs, arrows where they start with a speed.",
    ),
    "plan": Kind(
        plan,
        "Configurations at the impacts",
        "The trace with the bodies at the start, at the first impacts and at the last one; bodies "
        "that do not collide then are pale.",
    ),
    "velocities": Kind(
        velocities,
        "Plan of velocities",
        "The bodies of the first impacts as they touch, before and after: the velocities of the "
        "centres, those of the touching points as points of the rolling bodies, and the components "
        "of these along the line of centres, which decide on approach and separation.",
    ),
    "energy": Kind(
        energies,
        "Energies",
        "Energy of each body and of all against time, each from the lowest place of its centre; "
        "below, what each impact loses.",
    ),
    "space_time": Kind(
        space_time,
        "Motion along the trace",
        "Arc length of the contact points against time, with the impacts; horizontal lines are "
        "junctions of the trace. Of a long run the first part only.",
    ),
    "impact_map": Kind(
        impact_map,
        "Impact map",
        "Approach speed along the line of centres against the place of the impact.",
    ),
    "intervals": Kind(
        intervals,
        "Intervals between impacts",
        "Time since the impact before; a falling straight line is an accumulation of impacts.",
    ),
    "accuracy": Kind(
        accuracy,
        "Accuracy reached",
        "Distance of the surfaces left at each impact, and the relative change of energy along "
        "each free flight, where it should be 0.",
    ),
}


@dataclass(frozen=True)
class Drawn:
    """A figure with its words."""

    name: str
    """Stem of its files."""
    title: str
    caption: str
    figure: Figure


def draw_all(run: Recorded, names: Sequence[str], width: str = "double") -> Iterator[Drawn]:
    """Draw the kinds of figures with the given names; those that show nothing are left out.

    `portrait` gives one of each body. Raises ValueError for an unknown kind.
    """
    unknown = [name for name in names if name not in (PORTRAIT, *KINDS)]
    if unknown:
        known = ", ".join((PORTRAIT, *KINDS))
        raise ValueError(f"unknown kind of figure {unknown[0]!r}, expected some of {known}")
    once = Remembered(run)
    for name in names:
        if name == PORTRAIT:
            yield from _portraits(once, width)
            continue
        kind = KINDS[name]
        figure = kind.draw(once, width)
        if figure is not None:
            yield Drawn(name, kind.title, kind.caption, figure)


def _portraits(run: Recorded, width: str) -> Iterator[Drawn]:
    for ball in range(1, len(run.system.bodies) + 1):
        figure = phase_portrait(run, ball, width)
        title = f"Phase portrait of body {ball}"
        yield Drawn(f"{PORTRAIT}_{ball}", title, _PORTRAIT_CAPTION, figure)
