"""Kinds of figures, and those of a run on a trace, by name, with what they show in words."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from matplotlib.figure import Figure

from vibro_cli.figures.dots import MANY
from vibro_cli.figures.portraits.energies import energy_portrait
from vibro_cli.figures.portraits.portrait import phase_portrait
from vibro_cli.figures.runs.contact_points import POINTS_CAPTION, POINTS_TITLE, contact_points
from vibro_cli.figures.runs.over_impacts import accuracy, exponents, impact_map, intervals
from vibro_cli.figures.runs.over_time import energies, space_time
from vibro_cli.figures.runs.plan import plan
from vibro_cli.figures.runs.scene import scene
from vibro_cli.figures.runs.velocities import velocities
from vibro_cli.figures.source import Recorded

Source = TypeVar("Source")


@dataclass(frozen=True)
class Drawn:
    """A figure with its words."""

    name: str
    """Stem of its files."""
    title: str
    caption: str
    figure: Figure


@dataclass(frozen=True)
class Kind(Generic[Source]):
    """One kind of figure of a whole run, or of a grid."""

    draw: Callable[[Source, str], Figure | None]
    """From a run or grid and a width; None where it has nothing to show."""
    title: str
    caption: str

    def drawn(self, name: str, run: Source, width: str) -> Iterator[Drawn]:
        """Draw it, if it shows anything."""
        figure = self.draw(run, width)
        if figure is not None:
            yield Drawn(name, self.title, self.caption, figure)


@dataclass(frozen=True)
class KindOfBody:
    """One kind of figure of each body of a run."""

    draw: Callable[[Any, int, str], Figure]
    """From a run, a body from 1, and a width."""
    title: str
    """Before the number of the body."""
    caption: str

    def drawn(self, name: str, run: Any, width: str) -> Iterator[Drawn]:
        """Draw it of every body."""
        for ball in range(1, len(run.system.bodies) + 1):
            figure = self.draw(run, ball, width)
            yield Drawn(f"{name}_{ball}", f"{self.title} {ball}", self.caption, figure)


PORTRAIT = "portrait"
_PORTRAIT_CAPTION = (
    "Rate against angle on each arc (speed against arc length on lines): the branches run through, "
    "and the jumps at the impacts, lasting contact in a colour of its own, many branches in the "
    "colours of time up to the last impact; behind them separatrices, level curves of energy, "
    "centres (+) and saddles (×). As A figs 1b and 2, B fig. 8, D fig. 1."
)
INTERVALS: Kind[Any] = Kind(
    intervals,
    "Intervals between impacts",
    f"Time since the impact before; a falling straight line is an accumulation of impacts.{MANY}",
)
EXPONENTS: Kind[Any] = Kind(
    exponents,
    "Lyapunov exponents",
    "The exponents of the run until each of its impacts, the greatest first, and twice the "
    "standard error of the greatest. The first tenth of the run, where they jump, is left out.",
)
KINDS: dict[str, Kind[Recorded] | KindOfBody] = {
    "scene": Kind(
        scene,
        "The trace and the bodies at the start",
        "To scale: the pieces of the trace between the dots, with their numbers below, centres O "
        "and radii R of the arcs, and the bodies with their centres C, contact points P and angles "
        "φ (in a valley) and ψ (on a hump); arrows where they start with a speed. "
        "As A fig. 2a, B fig. 6, D fig. 1a, b.",
    ),
    PORTRAIT: KindOfBody(phase_portrait, "Phase portrait of body", _PORTRAIT_CAPTION),
    "energy_portrait": KindOfBody(
        energy_portrait,
        "Phase portrait and energies along the trace of body",
        "Above, speed of the centre against arc length: the branches of the run and its jumps, a "
        "figure eight as one closed curve, separatrices, level curves, centres (+) and saddles "
        "(×). Below, potential energy and, branch by branch, the total energy of the body. "
        "As A (abstract), B III.3.6, D.",
    ),
    "plan": Kind(
        plan,
        "Configurations at the impacts",
        "The trace with the bodies at the start, at the first impacts and at the last one; bodies "
        "that do not collide then are pale. As B fig. 9.",
    ),
    "velocities": Kind(
        velocities,
        "Plan of velocities",
        "The bodies of the first impacts as they touch, before and after: the velocities of the "
        "centres C, those of the touching points T as points of the rolling bodies with what "
        "rolling adds to those of the centres, and the components along the line of centres, which "
        "decide on approach and separation. Arcs are angular velocities about the contact points "
        "P, three quarters of a turn the greatest of the impact; the tangent is common to both "
        "bodies. As A fig. 1a, B figs 1, 5 and 7.",
    ),
    "contact_points": Kind(contact_points, POINTS_TITLE, POINTS_CAPTION + " As B figs 2–4."),
    "energy": Kind(
        energies,
        "Energies",
        "Energy of each body and of all against time, each from the lowest place of its centre; "
        "below, what each impact loses. Of lasting contact at the end some periods only; steps too "
        "close to be told apart are bands, from the least to the greatest.",
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
        f"Approach speed along the line of centres against the place of the impact.{MANY}",
    ),
    "intervals": INTERVALS,
    "accuracy": Kind(
        accuracy,
        "Accuracy reached",
        "Distance of the surfaces left at each impact, and the relative change of energy along "
        f"each free flight, where it should be 0.{MANY}",
    ),
    "exponents": EXPONENTS,
}


def draw_all(
    run: Any, names: Sequence[str] | None = None, width: str = "double"
) -> Iterator[Drawn]:
    """Draw kinds of figures of a run, all or those named; those that show nothing are left out.

    Raises ValueError for an unknown kind.
    """
    kinds = run.kind.figures
    for name in kinds if names is None else names:
        if name not in kinds:
            known = ", ".join(kinds)
            raise ValueError(f"unknown kind of figure {name!r}, expected some of {known}")
        yield from kinds[name].drawn(name, run, width)


def draw_one(run: Any, name: str, body: int = 1, width: str = "double") -> Figure | None:
    """Return one figure of a run, None where it has nothing to show.

    Parameters
    ----------
    run
        Of any system.
    name
        One of the kinds of its system.
    body
        From 1, where there is a figure of each body.
    width
        ``"single"`` or ``"double"``: one column of a journal (85 mm) or two (170 mm).

    Raises
    ------
    ValueError
        For another kind, body or width.
    """
    kinds = run.kind.figures
    if name not in kinds:
        known = ", ".join(kinds)
        raise ValueError(f"found the kind of figure {name!r}, expected one of {known}")
    kind, bodies = kinds[name], len(run.system.bodies)
    if isinstance(kind, Kind):
        return kind.draw(run, width)
    if not 1 <= body <= bodies:
        raise ValueError(f"found body {body}, expected a number from 1 to {bodies}")
    return kind.draw(run, body, width)  # type: ignore[no-any-return]
