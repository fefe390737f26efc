"""A grid over one of its axes: curves, all impacts, bifurcation diagrams; Poincaré sections.

The section is the surface in state space on which two bodies touch; each impact is a point of it.
For a grid, one or two columns of the impacts are drawn over an axis; for a run, one over another.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.figure import Figure
from numpy.typing import NDArray

from vibro_cli.errors import NothingToShow
from vibro_cli.figures import style
from vibro_cli.figures.chart import (
    MOST_VECTOR_POINTS,
    draw_dots,
    is_wide,
    limits_around,
    log_axis,
    stacked,
    value_axis,
)
from vibro_cli.figures.labels import Bar, draw_legend
from vibro_cli.figures.maps import (
    Coordinate,
    ParameterMap,
    ended,
    endings,
    parameter_map,
    set_axis,
)
from vibro_cli.figures.source import Array, Flags, Integers, Table
from vibro_cli.figures.style import mark
from vibro_cli.figures.ticks import symbol_of
from vibro_cli.mechanics.trace import HUMP, VALLEY
from vibro_cli.scenario.base import Listed, Texts, checked
from vibro_cli.scenario.problems import suggestion
from vibro_cli.scenario.quantities import Count
from vibro_cli.systems.columns import COUNTED
from vibro_cli.systems.request import FINAL

if TYPE_CHECKING:
    from vibro_cli.storage.stored import StoredGrid

_ROW = {"single": 26.0, "double": 34.0}
_ROUNDING = 1e-12
"""Relative range below which values count as equal, such as a conserved energy."""
_DIAGRAM = {"single": 58.0, "double": 80.0}
FIRST = 20
"""Number of impacts of each run whose times are shown."""
ENDED = mark("x", 3.0, style.VERMILLION) | {"markeredgewidth": 0.7, "zorder": 2.5}
PLACES = (
    ("s_a", "$s$ of the left body", "m"),
    ("x_a", "$x$ of the left body", "m"),
)
"""Columns of the place of an impact that do not depend on the arc."""
ANGLES = {VALLEY: r"$\varphi$ of the left body", HUMP: r"$\psi$ of the left body"}


def curves(grid: StoredGrid, width: str = "single") -> Figure | None:
    """Draw impacts, energy left and time of the first impact over the axis with most values.

    Draw the greatest Lyapunov exponent too if there is one, and on a table the impacts on the wall.
    Dots have the colours of the end causes. Returns None if no axis of numbers changes or no point
    is a valid scenario.
    """
    shown = parameter_map(grid, 1, numbers_first=True)
    if shown is None:
        return None
    ends = endings(grid, shown.rows)

    def column(name: str) -> Array:
        return np.asarray(grid.summary[name][shown.rows], dtype=np.float64)

    counts = [
        (column(name), symbol, "") for name, symbol in COUNTED.items() if name in grid.summary
    ]
    panels = [
        *([one for one in counts if np.nansum(one[0]) > 0.0] or counts[:1]),
        (energy_left(grid)[shown.rows], ENERGY_LEFT, ""),
        (column("first_collision_time"), "first impact", "s"),
    ]
    if _EXPONENT in grid.summary:
        exponent = column(_EXPONENT)  # -inf where no perturbation outlasts the impacts
        exponent[~np.isfinite(exponent)] = np.nan
        panels.append((exponent, symbol_of(_EXPONENT), "1/s"))
    panels = [one for one in panels if np.any(np.isfinite(one[0]))]
    if not panels:
        return None
    panels = [one for one in panels if _varies(one[0])] or panels[:1]
    with style.journal():
        figure, drawn = stacked(width, [_ROW[width]] * len(panels), entries=ends.entries())
        across, colours, norm = shown.coordinates[0], ends.colours(), ends.norm()
        code = ends.code.astype(np.float64)
        size = float(np.clip(1500.0 / len(shown.rows), 0.5, 7.0))
        edge = 0.2 if size > 2.0 else 0.0
        for axes, (values, symbol, unit) in zip(drawn, panels, strict=True):
            _value(axes, values, symbol, unit)
            set_axis(axes.xaxis, across, labelled=axes is drawn[-1])
            draw_dots(axes, across.place, values, code, colours, norm, size, edge)
    return figure


def _varies(values: Array) -> bool:
    """Return whether values differ by more than rounding errors."""
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    return high - low > _ROUNDING * max(abs(low), abs(high))


_EXPONENT = "lyapunov_1"
ENERGY_LEFT = r"$E_\mathrm{end}/E_0$"


def energy_left(grid: StoredGrid) -> Array:
    """Return the energy at the end as a share of that at the start, NaN if that is not positive."""
    start, end = (
        np.asarray(grid.summary[f"energy_{at}"], dtype=np.float64) for at in ("start", "end")
    )
    left: Array = np.divide(end, start, out=np.full(len(start), np.nan), where=start > 0.0)
    return left


def _value(axes: Axes, values: Array, symbol: str, unit: str) -> None:
    finite = values[np.isfinite(values)]
    if is_wide(finite):
        log_axis(axes, finite, symbol, unit)
    else:
        shown = values if unit else np.append(values, 0.0)
        value_axis(axes, shown, symbol, unit, whole=symbol in COUNTED.values())


def place_column(grid: StoredGrid) -> tuple[str, str, str] | None:
    """Return column, symbol and unit of the place of the kept impacts, None if none was kept.

    It is the angle on a trace of a single arc; angles on several arcs cannot share an axis. On a
    table (recognised by its impacts on the wall) neither ball is the left one.
    """
    kept = grid.impact_columns()
    if "bounces" in grid.summary and "x_a" in kept:
        return "x_a", "$x$ of ball a", "m"
    if len(grid.shapes) == 1 and grid.shapes[0] in ANGLES and "angle_a" in kept:
        return "angle_a", ANGLES[grid.shapes[0]], "rad"
    return next((one for one in PLACES if one[0] in kept), None)


def diagram(grid: StoredGrid, width: str = "single") -> Figure | None:
    """Draw the places of all impacts over the axis with most values, coloured by their number.

    Returns None if no impact was kept with number and place, or no axis of numbers changes.
    """
    return _impacts_over(grid, width, place_column(grid), None)


def first_times(grid: StoredGrid, width: str = "single") -> Figure | None:
    """Draw the times of the first impacts of each run over the axis with most values.

    The ends of runs that were cut short earlier are marked. Returns None if no impact was kept with
    number and time, or no axis of numbers changes.
    """
    time = ("t", "$t$ of the impact", "s") if "t" in grid.impact_columns() else None
    return _impacts_over(grid, width, time, FIRST)


def _impacts_over(
    grid: StoredGrid, width: str, shown_column: tuple[str, str, str] | None, most: int | None
) -> Figure | None:
    """Draw a column (name, symbol, unit) of the first `most` impacts, or of all, over one axis."""
    shown = parameter_map(grid, 1, numbers_first=True)
    if shown_column is None or shown is None or "n" not in grid.impact_columns():
        return None
    name, symbol, unit = shown_column
    chosen = []
    for impacts, row in _impacts_of(grid, shown, ["n", name]):
        number = np.asarray(impacts["n"], dtype=np.float64)
        values = np.asarray(impacts[name], dtype=np.float64)
        kept = np.isfinite(values) & (number <= (np.inf if most is None else most))
        chosen.append((shown.coordinates[0].place[row][kept], number[kept], values[kept]))
    along, number, values = map(np.concatenate, zip(*chosen, strict=True))
    if not len(values):
        return None
    places, ends = (np.empty(0), np.empty(0)) if most is None else _early_ends(grid, shown, most)
    with style.journal():
        figure, (axes,) = stacked(width, [_DIAGRAM[width]])
        value_axis(axes, np.concatenate([values, ends]), symbol, unit)
        set_axis(axes.xaxis, shown.coordinates[0])
        size = float(np.clip(6000.0 / len(values), 0.15, 4.0))
        norm = Normalize(float(np.min(number)), float(np.max(number)))
        draw_dots(axes, along, values, number, style.time_colours(), norm, size)
        if len(ends):
            axes.plot(places, ends, rasterized=len(ends) > MOST_VECTOR_POINTS, **ENDED)
        entries = [[("run ended", ENDED)]] if len(ends) else []
        draw_legend(figure, entries, Bar("impact 1", str(int(np.max(number)))))
    return figure


def _impacts_of(
    grid: StoredGrid, shown: ParameterMap, columns: Sequence[str]
) -> Iterator[tuple[dict[str, NDArray[Any]], Integers]]:
    """Yield columns of the impacts of the points shown, and the index of each impact's point."""
    scenarios = grid.summary["scenario"][shown.rows]
    order = np.argsort(scenarios)
    for impacts in grid.impacts(list(dict.fromkeys(["scenario", *columns])), scenarios):
        yield impacts, order[np.searchsorted(scenarios, impacts["scenario"], sorter=order)]


def _early_ends(grid: StoredGrid, shown: ParameterMap, most: int) -> tuple[Array, Array]:
    """Return places and times (s) of the ends of runs cut short before `most` impacts."""
    early = np.isin(ended(grid)[shown.rows].astype(str), FINAL)
    early &= np.asarray(grid.summary["collisions"])[shown.rows] < most
    times = np.asarray(grid.summary["end_time"], dtype=np.float64)[shown.rows]
    early &= np.isfinite(times)
    return shown.coordinates[0].place[early], times[early]


LAST = 20
"""Number of last impacts of each run that are shown if no transient is given."""
_SPEED = ("speed_a_pre", r"$v_a$ before", "m/s")
_HIGH = {"single": 40.0, "double": 52.0}
_SQUARE = {"single": 62.0, "double": 90.0}

Quantity = tuple[str, str, str]
"""A column, its symbol or words, and its unit."""


def quantities_of(names: Sequence[str], units: Mapping[str, str]) -> list[Quantity]:
    """Return the quantities of the named columns of impacts, given the units of all columns.

    Raises ValueError for an unknown name and for more than two names, and `NothingToShow` if there
    are no columns, because the grid did not keep its impacts.
    """
    checked("columns", names, Texts("columns", most=2))
    if not units:
        how = "set collisions = true in [keep], or collisions=True of sweep"
        raise NothingToShow(f"the grid kept no impacts: {how}")
    for name in names:
        if name not in units:
            hint = suggestion(name, list(units))
            raise ValueError(f"found the column {name!r}{hint}, expected one of {', '.join(units)}")
    return [(name, symbol_of(name), units[name]) for name in names]


def own_columns(impacts: Table) -> list[str]:
    """Return the default columns of impacts: place and speed.

    The place is the angle if all impacts are on one arc: angles on several arcs cannot share an
    axis, and a line has none.
    """
    one = "arc_a" in impacts and len(set(impacts["arc_a"].tolist())) == 1
    on_arc = one and bool(np.any(np.isfinite(impacts["angle_a"])))
    places = (["angle_a"] if on_arc else []) + [name for name, _, _ in PLACES]
    places.append("normal_angle")
    speeds = [_SPEED[0], "approach_speed", "tangential_speed"]
    found = [next((one for one in some if one in impacts), None) for some in (places, speeds)]
    return [one for one in found if one is not None]


@dataclass(frozen=True)
class Section:
    """Selects the impacts that are shown, from tables of runs one after another, each in order."""

    pair: tuple[int, int] | None = None
    """The bodies whose impacts are shown (from 1, in either order), None for all bodies."""
    transient: int | None = None
    """Number of impacts left out at the beginning of a run. None: show the last 20 of each run
    that has more."""

    def __post_init__(self) -> None:
        """Check both; raises ValueError."""
        if self.transient is not None:
            checked("transient", self.transient, Count(0))
        if self.pair is not None:
            for body in checked("pair", self.pair, Listed("two bodies", 2, 2)):
                checked("pair", body, Count())

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns of the impacts that the selection needs."""
        return () if self.pair is None else ("ball_a", "ball_b")

    def why_none(self, most: int, held: str = "") -> str:
        """Return a text on why no impact is shown.

        `most` is the greatest number of impacts of a run (see `counts`), `held` tells the values
        at which other axes are held.
        """
        whose = "" if self.pair is None else f" of bodies {self.pair[0]} and {self.pair[1]}"
        where = f" (held: {held})" if held else ""
        if self.transient is None:
            few = f"no run has more than {LAST} impacts{whose}{where}"
            return f"{few}; with a transient of 0 every impact is shown"
        after = f" after the first {self.transient}" if self.transient else ""
        known = f"; the most that a run has are {most}" if 0 < most <= self.transient else ""
        return f"there is no impact{whose}{after}{where}{known}"

    def _of_pair(self, impacts: Table, run: Integers) -> Flags:
        if self.pair is None:
            return np.ones(len(run), dtype=np.bool_)
        # Across the seam of a closed trace the last body is the left one.
        one, other = (
            (impacts["ball_a"] == left) & (impacts["ball_b"] == right)
            for left, right in (self.pair, self.pair[::-1])
        )
        return np.asarray(one | other)

    def counts(self, impacts: Table, run: Integers, runs: int = 0) -> Integers:
        """Return the number of impacts of each run, with the transient, of `runs` runs at least."""
        return _numbers(self._of_pair(impacts, run), run, runs)

    def chosen(self, impacts: Table, run: Integers) -> Flags:
        """Return which impacts are shown; `run` is the index of the run of each impact."""
        shown = self._of_pair(impacts, run)
        count = _numbers(shown, run)
        before = np.cumsum(shown) - np.concatenate([[0], np.cumsum(count)])[run]
        if self.transient is not None:
            shown &= before > self.transient
        else:
            shown &= (count[run] > LAST) & (before > count[run] - LAST)
        return shown


def _numbers(shown: Flags, run: Integers, runs: int = 0) -> Integers:
    """Return how many impacts of each run are shown."""
    return np.bincount(run[shown], minlength=max(runs, int(run.max(initial=-1)) + 1))


def bifurcation(
    grid: StoredGrid,
    width: str = "single",
    quantities: Sequence[Quantity] = (),
    section: Section | None = None,
    shown: ParameterMap | None = None,
) -> Figure:
    """Draw columns of the impacts of each run over the axis with most values.

    `quantities` are at most two, by default place and speed of the left body. `section` selects the
    impacts, by default the last 20 of each run that has more. `shown` are the points, if they are
    already known. Raises `NothingToShow` if no such impact was kept, or no axis of numbers changes.
    """
    section = section or Section()
    kept = grid.impact_columns()
    missing = [name for name in ("n", *section.columns) if name not in kept]
    if missing:
        names = " and ".join(missing)
        how = "name such columns in [keep] columns, or in collisions=[…] of sweep"
        raise NothingToShow(f"the grid did not keep {names}: {how}")
    own = [one for one in (place_column(grid), _SPEED) if one is not None and one[0] in kept]
    panels = list(quantities) or own
    shown = shown or parameter_map(grid, 1, numbers_first=True)
    if shown is None:
        raise NothingToShow("no axis of numbers changes")
    if not panels:
        raise NothingToShow("the grid kept neither positions nor speeds of its impacts")
    wanted = ["n", *section.columns, *(name for name, _, _ in panels)]
    across, parts, most = shown.coordinates[0], [], 0
    for impacts, row in _impacts_of(grid, shown, wanted):
        sorting = np.lexsort((impacts["n"], row))
        impacts, row = {name: column[sorting] for name, column in impacts.items()}, row[sorting]
        chosen = section.chosen(impacts, row)
        most = max(most, int(section.counts(impacts, row).max(initial=0)))
        taken = [np.asarray(impacts[name], dtype=np.float64)[chosen] for name, _, _ in panels]
        parts.append((across.place[row][chosen], *taken))
    places, *columns = map(np.concatenate, zip(*parts, strict=True))
    if not len(places):
        raise NothingToShow(section.why_none(most, shown.held))
    with style.journal():
        figure, drawn = stacked(width, [_HIGH[width]] * len(panels), 2.0)
        for axes, panel, values in zip(drawn, panels, columns, strict=True):
            set_axis(axes.xaxis, across, labelled=axes is drawn[-1])
            _draw_over(axes, places, values, panel)
    return figure


def poincare(
    impacts: Table, quantities: tuple[Quantity, Quantity], section: Section, width: str
) -> Figure:
    """Draw one column of the impacts of a run over another.

    `impacts` has the columns of the horizontal and the vertical quantity, and those that the
    section needs. Raises `NothingToShow` if there is no such impact.
    """
    names = [name for name, _, _ in quantities]
    run = np.zeros(len(impacts[names[0]]), dtype=np.int64)
    chosen = section.chosen(impacts, run)
    # Missing whole numbers are masked.
    values = (np.ma.asarray(impacts[name], dtype=np.float64) for name in names)
    x, y = (np.ma.filled(column, np.nan)[chosen] for column in values)
    both = np.isfinite(x) & np.isfinite(y)
    if not np.any(both):
        raise NothingToShow(section.why_none(int(section.counts(impacts, run).max(initial=0))))
    x, y = x[both], y[both]
    name, symbol, unit = quantities[0]
    along = Coordinate(name, unit, x, (), symbol)
    with style.journal():
        figure, (axes,) = stacked(width, [_SQUARE[width]], 2.0)
        set_axis(axes.xaxis, along, limits=limits_around(x))
        _draw_over(axes, x, y, quantities[1])
    return figure


def _draw_over(axes: Axes, places: Array, values: Array, quantity: Quantity) -> None:
    """Draw values as dots over places; the horizontal axis must be set."""
    _, symbol, unit = quantity
    value_axis(axes, values, symbol, unit)
    black, size = ListedColormap([style.BLACK]), float(np.clip(6000 / len(values), 0.15, 4))
    draw_dots(axes, places, values, np.ones(len(values)), black, Normalize(0, 1), size)
