"""Every kind of figure of a grid, by name, with what it shows in words."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np
from matplotlib.figure import Figure

from vibro_cli.figures.grids.bifurcation import LAST, NothingToShow, bifurcation
from vibro_cli.figures.grids.curves import FIRST, curves, diagram, first_times
from vibro_cli.figures.grids.maps import Swept, ending_map, lattice, quantity_map
from vibro_cli.figures.runs.kinds import Drawn, Kind
from vibro_cli.figures.ticks import symbol_of

CONTACT_WORDS = "last impact, where contact begins [s]"


def _impacts(grid: Swept, width: str, counted: str = "collisions") -> Figure | None:
    """How many impacts of one kind there are, where there can be any."""
    values = np.asarray(grid.summary.get(counted, 0.0), dtype=np.float64)
    if not np.any(values > 0.0):
        return None
    return quantity_map(grid, width, np.where(values > 0.0, values, np.nan), "impacts")


def _energy(grid: Swept, width: str) -> Figure | None:
    start = np.asarray(grid.summary["energy_start"], dtype=np.float64)
    end = np.asarray(grid.summary["energy_end"], dtype=np.float64)
    share = np.divide(end, start, out=np.full(len(start), np.nan), where=start > 0.0)
    return quantity_map(grid, width, share, r"$E_\mathrm{end}/E_0$", 1e3)


def _contact(grid: Swept, width: str) -> Figure | None:
    """When the last impact was, of the runs in which lasting contact began."""
    begun = np.asarray(grid.summary.get("contacts", 0.0), dtype=np.float64) > 0.0
    last = np.asarray(grid.summary["last_collision_time"], dtype=np.float64)
    return quantity_map(grid, width, np.where(begun, last, np.nan), CONTACT_WORDS)


def _bifurcation(grid: Swept, width: str) -> Figure | None:
    try:
        return bifurcation(grid, width)
    except NothingToShow:
        return None


def column_map(grid: Swept, width: str, name: str) -> Figure | None:
    """Return the map of a column of numbers of the summary; counts are white where they are 0."""
    unit = grid.units[name]
    symbol = symbol_of(name)
    label = f"{symbol} [{unit}]" if unit else symbol
    column = grid.summary[name]
    values = np.asarray(column, dtype=np.float64)
    if column.dtype.kind in "iu":
        values, label = np.where(values != 0.0, values, np.nan), f"{label} (white: 0)"
    return quantity_map(grid, width, values, label)


def mapped_columns(grid: Swept) -> list[str]:
    """Return the columns of numbers of the summary."""
    names = list(grid.summary)
    results = names[names.index("status") :]
    return [name for name in results if grid.summary[name].dtype != object]


_OVER_TWO = "Over the two axes with the most values, the first of them across"
GRID_KINDS: dict[str, Kind[Swept]] = {
    "endings": Kind(
        ending_map,
        "How the runs end",
        f"{_OVER_TWO}: the cause that ended each run, in brackets for how many points.",
    ),
    "impacts": Kind(
        _impacts,
        "Number of impacts",
        f"{_OVER_TWO}: the impacts of each run, white where there was none.",
    ),
    "bounces": Kind(
        partial(_impacts, counted="bounces"),
        "Number of impacts on the wall",
        f"{_OVER_TWO}: the impacts of each run on the wall, white where there was none.",
    ),
    "energy": Kind(
        _energy, "Energy left", f"{_OVER_TWO}: energy at the end as a share of that at the start."
    ),
    "contact": Kind(
        _contact,
        "Last impact before contact",
        f"{_OVER_TWO}: the time of the last impact of each run in which lasting contact began, "
        "which is when it began, unless bodies part again; white where it never began.",
    ),
    "curves": Kind(
        curves,
        "Runs over one axis",
        "Impacts, share of the energy left and time of the first impact of each run, in the colour "
        "of the cause that ended it; what is the same for all of them is left out.",
    ),
    "diagram": Kind(
        diagram,
        "Places of the impacts",
        "Where the left body of each impact is, over one axis: every impact of every run, coloured "
        "by its number.",
    ),
    "times": Kind(
        first_times,
        "Times of the first impacts",
        f"Times of the first {FIRST} impacts of each run, over one axis, coloured by the number of "
        "the impact; crosses are ends of runs that were cut short before so many impacts, by an "
        "inadmissible one, the end of the trace, lift-off, a wall or an accumulation.",
    ),
    "bifurcation": Kind(
        _bifurcation,
        "The last impacts",
        f"Place and speed of the left body at the last {LAST} impacts of each run, over one axis.",
    ),
}
NEEDS = {
    "endings": "two axes change, and runs end in different ways",
    "impacts": "two axes change, and there are impacts",
    "bounces": "two axes change, and there are impacts on a wall",
    "energy": "two axes change",
    "contact": "two axes change, and lasting contact begins",
    "curves": "an axis of numbers changes",
    "diagram": "an axis of numbers changes, and impacts were kept with their places",
    "times": "an axis of numbers changes, and impacts were kept with their times",
    "bifurcation": f"as `diagram`, and runs have more than {LAST} impacts",
}
"""When a kind of figure has something to show."""
_DIMENSIONS = {"curves": 1, "diagram": 1, "times": 1, "bifurcation": 1}


def draw_grid_kind(grid: Swept, name: str, width: str = "double") -> Figure | None:
    """Return one figure of a grid, None where it has nothing to show.

    `name` is one of `GRID_KINDS`, or a column of numbers of the summary, for its map over two axes.
    Raises ValueError for another one.
    """
    if name in GRID_KINDS:
        return GRID_KINDS[name].draw(grid, width)
    if name in mapped_columns(grid):
        return column_map(grid, width, name)
    known = ", ".join([*GRID_KINDS, *mapped_columns(grid)])
    raise ValueError(f"found the kind of figure {name!r}, expected one of {known}")


def draw_grid(grid: Swept, width: str = "double", columns: Sequence[str] = ()) -> Iterator[Drawn]:
    """Draw every kind of figure of a grid that has something to show.

    `columns` are those of the summary whose maps are drawn too.
    """
    kinds = dict(GRID_KINDS)
    for column in columns:
        caption = f"{_OVER_TWO}: the column {column} of the summary; white where it has no value."
        kinds[f"map_{column}"] = Kind(
            partial(column_map, name=column), column.replace("_", " ").capitalize(), caption
        )
    for name, kind in kinds.items():
        figure = kind.draw(grid, width)
        if figure is None:
            continue
        one = _DIMENSIONS.get(name, 2)
        shown = lattice(grid, one, numbers_first=one == 1)
        held = f" Held: {shown.held}." if shown is not None and shown.fixed else ""
        yield Drawn(name, kind.title, kind.caption + held, figure)
