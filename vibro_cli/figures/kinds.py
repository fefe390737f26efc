"""Kinds of figures with titles and captions; the kinds of a grid by name."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from vibro_cli.errors import NothingToShow
from vibro_cli.figures.chart import MANY
from vibro_cli.figures.maps import ending_map, parameter_map, quantity_map
from vibro_cli.figures.over_axis import (
    ENERGY_LEFT,
    FIRST,
    LAST,
    bifurcation,
    curves,
    diagram,
    energy_left,
    first_times,
)
from vibro_cli.figures.runs.over_impacts import exponents, intervals
from vibro_cli.figures.runs.over_time import MOST_PERIODS
from vibro_cli.figures.style import width_of
from vibro_cli.figures.ticks import symbol_of
from vibro_cli.progress import WORK
from vibro_cli.scenario.base import checked
from vibro_cli.scenario.quantities import Count
from vibro_cli.systems.columns import COUNTED

if TYPE_CHECKING:
    from vibro_cli.storage.stored import StoredGrid


@dataclass(frozen=True)
class Drawn:
    """A figure with its title and caption."""

    name: str
    """Stem of its files."""
    title: str
    caption: str
    figure: Figure


@dataclass(frozen=True)
class Kind:
    """One kind of figure of a run or of a grid."""

    draw: Callable[..., Figure | None]
    """Draws a run or grid, or a body (from 1) of a run, `single` or `double` as in `style.WIDTHS`;
    None if there is nothing to show."""
    title: str
    """Title, to which the number of the body is appended, if any."""
    caption: str
    needs: str = ""
    """The condition under which there is something to show, if there is one."""
    dimensions: int = 2
    """For a grid: the number of its axes that the figure is over."""
    of_bodies: bool = False
    """Whether there is a figure for each body of a run."""

    def nothing(self, name: str) -> str:
        """Return in words that there is nothing to show as the kind `name`, and what it needs."""
        needed = f": expected that {self.needs}" if self.needs else ""
        return f"has nothing to show as {name}{needed}"

    def drawn(self, name: str, title: str, *drawn_from: Any) -> Drawn | None:
        """Return the figure with its name and title, or None if there is nothing to show."""
        WORK.report(title)
        figure = self.draw(*drawn_from)
        return None if figure is None else Drawn(name, title, self.caption, figure)


PORTRAIT = "portrait"
MET = "two bodies meet"
MET_TWICE = "there are two impacts"
INTERVALS = Kind(
    intervals,
    "Intervals between impacts",
    "Time since the previous impact; points on a falling straight line are an accumulation of "
    f"impacts.{MANY}",
    needs=f"{MET_TWICE}, at different times",
)
ENERGY_CAPTION = (
    "Energy of each body and total energy against time; below, the energy lost or gained at each "
    f"impact. Of lasting contact at the end, at most {MOST_PERIODS} periods of the slowest small "
    "oscillation are shown. If the energies of several bodies jump very often, their means over "
    "equal intervals are drawn, and the energies themselves are faint. If no body ever has a "
    "hundredth of the greatest total energy, only the total is drawn."
)
EXPONENTS = Kind(
    exponents,
    "Lyapunov exponents",
    "Exponents of the run up to its impacts, the greatest first, with a band of ±2 standard "
    "errors about the greatest. The first tenth of the run, where they fluctuate most, is "
    "omitted.",
    needs=f"analysis.lyapunov is true, and {MET_TWICE}",
)


def listed(run: Any, names: Sequence[str] | None = None) -> list[tuple[str, int]]:
    """Return kind and body (from 1) of every figure of a run, of all kinds or of those named.

    The body of a figure of the whole run is 1. Raises ValueError for an unknown kind.
    """
    kinds, found = run.kind.figures, []
    for name in kinds if names is None else names:
        if name not in kinds:
            known = ", ".join(kinds)
            raise ValueError(f"unknown kind of figure {name!r}, expected some of {known}")
        bodies = len(run.system.bodies) if kinds[name].of_bodies else 1
        found += [(name, body) for body in range(1, bodies + 1)]
    return found


def draw_all(
    run: Any, names: Sequence[str] | None = None, width: str = "double"
) -> Iterator[Drawn]:
    """Yield the figures of a run, of all kinds or of those named; empty figures are left out.

    Raises ValueError for an unknown kind.
    """
    for name, body in listed(run, names):
        drawn = draw_one(run, name, body, width)
        if drawn is not None:
            yield drawn


def draw_one(run: Any, name: str, body: int = 1, width: str = "double") -> Drawn | None:
    """Return one figure of a run of any system, or None if it has nothing to show.

    The arguments are those of `Run.figure`. Raises ValueError for an unknown kind, body or width.
    """
    kinds = run.kind.figures
    width_of(width)
    if not isinstance(name, str) or name not in kinds:
        known = ", ".join(kinds)
        raise ValueError(f"found the kind of figure {name!r}, expected one of {known}")
    kind: Kind = kinds[name]
    if not kind.of_bodies:
        return kind.drawn(name, kind.title, run, width)
    body = checked("body", body, Count(1, len(run.system.bodies)))
    return kind.drawn(f"{name}_{body}", f"{kind.title} {body}", run, body, width)


CONTACT_WORDS = "last impact before contact [s]"


def _impacts(grid: StoredGrid, width: str, counted: str = "collisions") -> Figure | None:
    """Draw the map of the number of impacts in the column `counted`; return None if all are 0."""
    values = np.asarray(grid.summary.get(counted, 0.0), dtype=np.float64)
    if not np.any(values > 0.0):
        return None
    there = np.where(values > 0.0, values, np.nan)
    return quantity_map(grid, width, there, COUNTED[counted], whole=True)


def _energy(grid: StoredGrid, width: str) -> Figure | None:
    return quantity_map(grid, width, energy_left(grid), ENERGY_LEFT, 1e3)


def _contact(grid: StoredGrid, width: str) -> Figure | None:
    """Draw the map of the time of the last impact of the runs in which lasting contact began."""
    begun = np.asarray(grid.summary.get("contacts", 0.0), dtype=np.float64) > 0.0
    last = np.asarray(grid.summary["last_collision_time"], dtype=np.float64)
    return quantity_map(grid, width, np.where(begun, last, np.nan), CONTACT_WORDS)


def _bifurcation(grid: StoredGrid, width: str) -> Figure | None:
    try:
        return bifurcation(grid, width)
    except NothingToShow:
        return None


def column_map(grid: StoredGrid, width: str, name: str) -> Figure | None:
    """Draw the map of a numeric column of the summary; counts of 0 are left white.

    Whole numbers without a unit are treated as counts, or as numbers from 1, such as those of arcs.
    """
    unit = grid.units[name]
    symbol = symbol_of(name)
    label = f"{symbol} [{unit}]" if unit else symbol
    values = np.asarray(grid.summary[name], dtype=np.float64)
    finite = values[np.isfinite(values)]
    whole = not unit and bool(np.all(finite == np.round(finite)))
    if whole and np.any(finite == 0.0):
        values, label = np.where(values != 0.0, values, np.nan), f"{label} (white: 0)"
    return quantity_map(grid, width, values, label, whole=whole)


def mapped_columns(grid: StoredGrid) -> list[str]:
    """Return the numeric columns of the summary."""
    return [name for name in grid.summary if _is_mapped(grid, name)]


def _is_mapped(grid: StoredGrid, name: str) -> bool:
    """Return whether a name is that of a numeric column of the summary; read only that column."""
    names = list(grid.summary)
    return name in names[names.index("status") :] and grid.summary[name].dtype != object


_OVER_TWO = "Over the two axes with the most values, the first of them horizontal"
GRID_KINDS = {
    "endings": Kind(
        ending_map,
        "How the runs end",
        f"{_OVER_TWO}: the end cause of each run, with the number of runs in brackets.",
        needs="two axes change, and runs end in different ways",
    ),
    "impacts": Kind(
        _impacts,
        "Number of impacts",
        f"{_OVER_TWO}: the number of impacts of each run; white where there is none.",
        needs="two axes change, and there are impacts",
    ),
    "bounces": Kind(
        partial(_impacts, counted="bounces"),
        "Number of impacts on the wall",
        f"{_OVER_TWO}: the number of impacts of each run on the wall; white where there is none.",
        needs="two axes change, and there are impacts on a wall",
    ),
    "energy": Kind(
        _energy,
        "Energy left",
        f"{_OVER_TWO}: the final energy of each run as a fraction of its initial energy.",
        needs="two axes change",
    ),
    "contact": Kind(
        _contact,
        "Last impact before contact",
        f"{_OVER_TWO}: the time of the last impact of each run in which lasting contact begins. Of "
        "two bodies that then stay together, contact begins at this impact or after the bounces "
        "that follow it. White where it never begins.",
        needs="two axes change, and lasting contact begins",
    ),
    "curves": Kind(
        curves,
        "Runs over one axis",
        "Number of impacts, fraction of the energy left, time of the first impact and, with "
        "analysis.lyapunov, the greatest Lyapunov exponent of each run, coloured by its end cause; "
        "quantities that are the same for all runs are omitted.",
        needs="an axis of numbers changes",
        dimensions=1,
    ),
    "diagram": Kind(
        diagram,
        "Positions of the impacts",
        "Position of the left body (on a table, of ball a) at every impact of every run, over one "
        "axis, coloured by the number of the impact.",
        needs="an axis of numbers changes, and impacts were kept with their positions",
        dimensions=1,
    ),
    "times": Kind(
        first_times,
        "Times of the first impacts",
        f"Times of the first {FIRST} impacts of each run, over one axis, coloured by the number of "
        "the impact; crosses mark the ends of runs that ended before that many impacts, at an "
        "inadmissible one, an end of the trace, lift-off, rolling along a wall or an accumulation.",
        needs="an axis of numbers changes, and impacts were kept with their times",
        dimensions=1,
    ),
    "bifurcation": Kind(
        _bifurcation,
        "Bifurcation diagram",
        f"Position and speed of the left body (on a table, of ball a) at the last {LAST} impacts "
        "of each run, over one axis.",
        needs=f"as `diagram`, and runs have more than {LAST} impacts",
        dimensions=1,
    ),
}


def draw_grid_kind(grid: StoredGrid, name: str, width: str = "double") -> Figure | None:
    """Return one figure of a grid, or None if it has nothing to show.

    `name` is one of `GRID_KINDS`, or a numeric column of the summary, of which a map over two axes
    is drawn. Raises ValueError for other names.
    """
    width_of(width)
    if isinstance(name, str) and name in GRID_KINDS:
        return GRID_KINDS[name].draw(grid, width)
    if _is_mapped(grid, name):
        return column_map(grid, width, name)
    known = ", ".join([*GRID_KINDS, *mapped_columns(grid)])
    raise ValueError(f"found the kind of figure {name!r}, expected one of {known}")


def draw_grid(
    grid: StoredGrid, width: str = "double", columns: Sequence[str] = ()
) -> Iterator[Drawn]:
    """Yield every kind of figure of a grid that has something to show.

    Maps of `columns` of the summary are drawn, too. Raises ValueError for an unknown column and
    `NothingToShow` for a column whose map would be empty.
    """
    kinds, maps = dict(GRID_KINDS), {f"map_{column}": column for column in columns}
    for name, column in maps.items():
        if not _is_mapped(grid, column):
            known = ", ".join(mapped_columns(grid))
            raise ValueError(f"maps: found {column!r}, expected some of {known}")
        caption = f"{_OVER_TWO}: the column {column} of the summary; white where it has no value."
        kinds[name] = Kind(
            partial(column_map, name=column), column.replace("_", " ").capitalize(), caption
        )
    for name, kind in kinds.items():
        drawn = kind.drawn(name, kind.title, grid, width)
        if drawn is not None:
            shown = parameter_map(grid, kind.dimensions, numbers_first=kind.dimensions == 1)
            held = f" Held: {shown.held}." if shown is not None and shown.fixed else ""
            yield replace(drawn, caption=drawn.caption + held)
        elif name in maps:
            why = "found no map, expected two axes that change, and values"
            raise NothingToShow(f"{maps[name]}: {why}")
