"""Grids as Python works with them: a scenario solved for many values."""

from __future__ import annotations

import logging
import shutil
import tempfile
import weakref
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn, TypedDict, Unpack

import numpy as np

from vibro_cli.grids.document import grid_of, load_grid
from vibro_cli.grids.workers import solve_into
from vibro_cli.interface import Drawing
from vibro_cli.scenario.base import (
    Texts,
    check_scenario,
    checked,
    checked_page,
    checked_path,
    plain,
)
from vibro_cli.scenario.loading import Document
from vibro_cli.scenario.quantities import FLAG, Count, Dictionary
from vibro_cli.storage.frame import Table
from vibro_cli.storage.stored import open_grid as open_stored_grid

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any

    from numpy.typing import NDArray

    from vibro_cli.figures.maps import ParameterMap
    from vibro_cli.grids.document import Grid as GridDocument
    from vibro_cli.interface.analyses import GridBasins
    from vibro_cli.scenario.base import AnyScenario
    from vibro_cli.storage.stored import StoredGrid

_LOG = logging.getLogger("vibro_cli")


class _Temporary:
    """A temporary folder, which a grid and its copies share: removed once none of them is used."""

    def __init__(self) -> None:
        self.path = Path(tempfile.mkdtemp(prefix="vibro-"))
        self.remove = weakref.finalize(self, shutil.rmtree, self.path)

    def __deepcopy__(self, memo: object) -> _Temporary:
        return self

    def __reduce__(self) -> NoReturn:
        raise TypeError(
            "found a grid in a temporary folder, which ends with this process; expected one in a "
            "folder, sweep(..., folder=...), to be pickled or handed to another process"
        )


@dataclass(frozen=True)
class Grid:
    """A scenario solved for many values: the summary of every point, and the impacts if kept.

    From :func:`sweep` or :func:`open_grid`.
    """

    stored: StoredGrid = field(repr=False)
    """The folder as it was read."""

    @property
    def name(self) -> str:
        """The name of the grid."""
        return self.stored.name

    @property
    def axes(self) -> tuple[str, ...]:
        """Paths of the values that change: the names of their columns."""
        return self.stored.axes

    @cached_property
    def summary(self) -> Table:
        """A row for each point: its number, the values of the axes, the summary of its run."""
        return Table("summary", self.stored.table("summary"))

    @cached_property
    def collisions(self) -> Table:
        """A row for each impact of every point; ``KeyError`` where they were not kept."""
        return Table("collisions", self.stored.table("collisions"))

    def save(self, folder: str | Path) -> Path:
        """Copy the dataset to a folder that is not there yet; return it.

        Raises ``FileExistsError`` where something is there.
        """
        target = checked_path("folder", folder, "folder")
        shutil.copytree(self.stored.place, target)
        return target

    @cached_property
    def shown(self) -> ParameterMap | None:
        """The points of its section, over the axis of numbers with most values, if there is one."""
        from vibro_cli.figures.maps import parameter_map

        return parameter_map(self.stored, 1, numbers_first=True)

    @cached_property
    def kinds(self) -> tuple[str, ...]:
        """The kinds of figures there are."""
        from vibro_cli.figures.kinds import GRID_KINDS

        return tuple(GRID_KINDS)

    def figure(self, kind: str, width: str = "double") -> Drawing:
        """Draw one figure of the grid.

        Parameters
        ----------
        kind
            One of ``grid.kinds``, or a column of numbers of the summary: its map over two axes.
        width
            ``"single"`` or ``"double"``: one column of a journal (85 mm) or two (170 mm).

        Raises ``ValueError`` for another kind or width, and where the grid has nothing to show.
        """
        from vibro_cli.figures.kinds import GRID_KINDS, draw_grid_kind

        drawn = draw_grid_kind(self.stored, kind, width)
        if drawn is None:
            needs = GRID_KINDS[kind].needs if kind in GRID_KINDS else "two axes change"
            raise ValueError(f"{self.name} has nothing to show as {kind}: expected that {needs}")
        return Drawing(kind, drawn)

    def section(
        self,
        columns: Sequence[str] = (),
        pair: tuple[int, int] | None = None,
        transient: int | None = None,
        width: str = "double",
    ) -> Drawing:
        """Draw the bifurcation diagram: impacts of every run over the axis with most values.

        Parameters
        ----------
        columns
            One or two columns of numbers of the impacts; place and speed by default.
        pair
            Only impacts of these bodies, from 1, the left one first.
        transient
            How many of each run are left out at its beginning; by default all but the last 20 of
            runs with more.
        width
            ``"single"`` or ``"double"``.

        Raises ``ValueError`` for another column or width, and where no such impact was kept.
        """
        from vibro_cli.figures.over_axis import Section, bifurcation, quantities_of
        from vibro_cli.figures.style import width_of

        width_of(width)
        quantities = quantities_of(columns, self.stored.impact_units())
        section = Section(pair, transient)
        drawn = bifurcation(self.stored, width, quantities, section, self.shown)
        return Drawing("section", drawn)

    def impacts_of_runs(self, pair: tuple[int, int] | None = None) -> NDArray[np.int64]:
        """Return how many impacts each run of the bifurcation diagram has that were kept.

        ``pair``: those of two bodies only, as for :meth:`section`.
        """
        from vibro_cli.figures.over_axis import Section

        shown, section = self.shown, Section(pair)
        wanted = ["scenario", *section.columns]
        if shown is None or not set(wanted) <= set(self.stored.impact_columns()):
            return np.zeros(0, dtype=np.int64)
        scenarios = self.stored.summary["scenario"][shown.rows]
        impacts = self.stored.impacts(wanted, scenarios)
        return section.counts(impacts, impacts["scenario"], int(scenarios.max()) + 1)[scenarios]

    def basins(self, outcome: Sequence[str] = ()) -> GridBasins:
        """Tell which outcome each point leads to, and how finely the outcomes are mixed.

        Parameters
        ----------
        outcome
            Columns of the summary that tell the outcome together, as for ``vibro basins``.

        Its ``basins`` has the measures; ``map(width)`` and ``scaling(width)`` draw.

        Raises `NoBasins` where they cannot be told.
        """
        from vibro_cli.figures.analyses import mapped_basins
        from vibro_cli.interface.analyses import GridBasins

        columns = checked("outcome", outcome, Texts("columns of the summary"))
        return GridBasins(mapped_basins(self.stored, columns))

    def report(self, file: str | Path, maps: Sequence[str] = ()) -> Path:
        """Write the page that explains the grid (.html), as ``vibro report`` does; return its path.

        ``maps`` are columns of the summary that are shown over two axes too.
        """
        from vibro_cli.report.grid_content import grid_html
        from vibro_cli.storage.files import write_file

        target = checked_page("file", file)
        columns = checked("maps", maps, Texts("columns of the summary"))
        write_file(target, grid_html(self.stored, target.parent, columns))
        return target

    def __repr__(self) -> str:
        unsolved = f"; {self.stored.unsolved}" if self.stored.unsolved else ""
        points = f"{self.stored.points:,} points over {', '.join(self.axes)}"
        return f"<Grid {self.name}: {points}{unsolved}>"

    def _repr_html_(self) -> str:
        """Show the first points in a notebook."""
        return self.summary._repr_html_()


class Design(TypedDict, total=False):
    """What the modes take that draw points."""

    n: int
    """How many"""
    seed: int


def sweep(
    source: AnyScenario | str | Path,
    axes: Mapping[str, Any] | None = None,
    folder: str | Path | None = None,
    *,
    mode: str | None = None,
    collisions: bool | Sequence[str] | None = None,
    workers: int = 0,
    force: bool = False,
    **design: Unpack[Design],
) -> Grid:
    """Solve a scenario for many values of some of its keys, as ``vibro grid`` does.

    Parameters
    ----------
    source
        A scenario; or a grid file, which has the axes, the mode and what is kept in it: with one,
        only ``folder``, ``workers`` and ``force`` may be given.
    axes
        The values by their paths: a sequence or array of them, or what a grid file says of an axis,
        such as ``{"linspace": ["-80 deg", "-65 deg", 121]}``. Of a product, the last axis changes
        fastest.
    folder
        Where the dataset goes; what it holds of this grid already is not solved again. By default
        it is kept in a temporary folder for as long as the grid or a copy of it is used; such a
        grid cannot be pickled.
    mode
        How the axes are combined: ``"product"``, as by default, ``"zip"``, ``"latin-hypercube"`` or
        ``"sobol"``.
    collisions
        Whether every impact is kept too; or the names of the columns that are. By default none is.
    workers
        Threads; 0 for one on each processor.
    force
        Whether another grid in the folder is replaced.
    n, seed
        Of the modes that draw points: how many, and the seed, 0 by default.

    Raises
    ------
    ScenarioError
        With everything that is wrong with the grid. A point that is no valid scenario is a row with
        status ``invalid`` and the reason.
    GridChanged
        If the folder holds another grid.
    TypeError
        For axes and the like beside a grid file.
    """
    workers, force = checked("workers", workers, Count(0)), checked("force", force, FLAG)
    grid = _grid_of(source, axes=axes, mode=mode, collisions=collisions, **design)
    temporary = None
    if folder is None:
        temporary = _Temporary()
        folder = temporary.path
    target = checked_path("folder", folder, "folder")
    try:
        solve_into(target, grid, workers, force)
        found = Grid(open_stored_grid(target, temporary))
    except BaseException:
        if temporary is not None:
            temporary.remove()
        raise
    _LOG.info("%s: %s points", found.name, f"{found.stored.points:,}")
    return found


def _grid_of(source: AnyScenario | str | Path, **settings: Any) -> GridDocument:
    """The grid that was asked for, settings as :func:`sweep` takes them, None if not given."""
    given = {name: value for name, value in settings.items() if value is not None}
    if isinstance(source, str | Path):
        if given:
            found = ", ".join(f"{name}=" for name in given)
            raise TypeError(f"found {found} beside a grid file, which says this; expected none")
        return load_grid(checked_path("source", source))
    check_scenario(source)
    axes = checked("axes", given.pop("axes", {}), Dictionary("values by their paths"))
    kept = plain(given.pop("collisions", False))
    keep = {"collisions": kept is not False}
    data = {
        "name": source.name,
        "scenario": source.given(),
        "axes": [
            {"path": path, **(one if isinstance(one, Mapping) else {"values": one})}
            for path, one in axes.items()
        ],
        "keep": keep if isinstance(kept, bool) else {**keep, "columns": kept},
        **given,
    }
    return grid_of(Document(data, name=source.name), Path())


def open_grid(folder: str | Path) -> Grid:
    """Open the folder of a grid, all its points or those that are finished.

    Raises ``NotAGrid`` when it is none of vibro's, or a file of it is missing or has changed.
    """
    return Grid(open_stored_grid(checked_path("folder", folder, "folder")))
