"""Grids in the Python interface: a scenario solved for many values."""

from __future__ import annotations

import logging
import shutil
import tempfile
import weakref
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from inspect import signature
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn, TypedDict, Unpack

import numpy as np

from vibro_cli.errors import NothingToShow, counted, listing
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
from vibro_cli.scenario.problems import Place, Problem, ScenarioError, shown, suggestion
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
    """A temporary folder shared by a grid and its copies, and removed with the last of them."""

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

    Returned by :func:`sweep` and :func:`open_grid`.
    """

    stored: StoredGrid = field(repr=False)
    """The stored grid."""

    @property
    def name(self) -> str:
        """The name of the grid."""
        return self.stored.name

    @property
    def axes(self) -> tuple[str, ...]:
        """Paths of the values that vary, which are the names of their columns."""
        return self.stored.axes

    @cached_property
    def summary(self) -> Table:
        """One row per point: its number, the values of the axes, the summary of its run."""
        return Table("summary", self.stored.table("summary"))

    @cached_property
    def collisions(self) -> Table:
        """One row per impact of every point; ``KeyError`` if impacts were not kept."""
        return Table("collisions", self.stored.table("collisions"))

    @cached_property
    def bounces(self) -> Table:
        """The same for impacts on the wall; ``KeyError`` too unless the system is a table."""
        return Table("bounces", self.stored.table("bounces"))

    def save(self, folder: str | Path) -> Path:
        """Copy the dataset to a new folder; return its path.

        Raises ``FileExistsError`` if the folder exists.
        """
        target = checked_path("folder", folder, "folder")
        shutil.copytree(self.stored.place, target)
        return target

    @cached_property
    def shown(self) -> ParameterMap | None:
        """Points of the bifurcation diagram, over the numeric axis with most values, if any."""
        from vibro_cli.figures.maps import parameter_map

        return parameter_map(self.stored, 1, numbers_first=True)

    @cached_property
    def kinds(self) -> tuple[str, ...]:
        """All kinds of figures of grids; `figure` refuses one that would be empty."""
        from vibro_cli.figures.kinds import GRID_KINDS

        return tuple(GRID_KINDS)

    def figure(self, kind: str, width: str = "double") -> Drawing:
        """Draw one figure of the grid.

        Parameters
        ----------
        kind
            One of ``grid.kinds``, or a numeric column of the summary for its map over two axes.
        width
            ``"single"`` or ``"double"``: one column of a journal (85 mm) or two (170 mm).

        Raises ``ValueError`` for an invalid kind or width, ``NothingToShow`` for an empty figure.
        """
        from vibro_cli.figures.kinds import GRID_KINDS, draw_grid_kind

        drawn = draw_grid_kind(self.stored, kind, width)
        if drawn is None:
            why = GRID_KINDS.get(kind, GRID_KINDS["energy"]).nothing(kind)  # as every map
            raise NothingToShow(f"{self.name} {why}")
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
            One or two numeric columns of the impacts; by default position and speed.
        pair
            Restrict to impacts of these two bodies, from 1, in either order.
        transient
            Number of impacts to omit at the beginning of each run; by default all but the last 20.
        width
            ``"single"`` or ``"double"``.

        Raises ``ValueError`` for an invalid column or width, ``NothingToShow`` if no such impact
        was kept.
        """
        from vibro_cli.figures.over_axis import Section, bifurcation, quantities_of
        from vibro_cli.figures.style import width_of

        width_of(width)
        quantities = quantities_of(columns, self.stored.impact_units())
        section = Section(pair, transient)
        drawn = bifurcation(self.stored, width, quantities, section, self.shown)
        return Drawing("section", drawn)

    def impacts_of_runs(self, pair: tuple[int, int] | None = None) -> NDArray[np.int64]:
        """Return the number of kept impacts of each run in the bifurcation diagram.

        ``pair`` restricts them to two bodies, as for :meth:`section`.
        """
        from vibro_cli.figures.over_axis import Section

        shown, section = self.shown, Section(pair)
        wanted = ["scenario", *section.columns]
        if shown is None or not set(wanted) <= set(self.stored.impact_columns()):
            return np.zeros(0, dtype=np.int64)
        scenarios = self.stored.summary["scenario"][shown.rows]
        counts = np.zeros(int(scenarios.max()) + 1, dtype=np.int64)
        for impacts in self.stored.impacts(wanted, scenarios):
            counts += section.counts(impacts, impacts["scenario"], len(counts))
        return counts[scenarios]

    def basins(self, outcome: Sequence[str] = ()) -> GridBasins:
        """Determine the outcome of each point, and how finely the outcomes are mixed.

        Parameters
        ----------
        outcome
            Columns of the summary whose combination is the outcome, as for ``vibro basins``.

        The measures are in ``basins`` of the result; ``map(width)`` and ``scaling(width)`` draw.

        Raises `NoBasins` if the basins cannot be determined.
        """
        from vibro_cli.figures.analyses import mapped_basins
        from vibro_cli.interface.analyses import GridBasins

        columns = checked("outcome", outcome, Texts("columns of the summary"))
        return GridBasins(mapped_basins(self.stored, columns))

    def report(self, file: str | Path, maps: Sequence[str] = ()) -> Path:
        """Write the report on the grid (.html), as ``vibro report`` does; return its path.

        ``maps`` are further columns of the summary to show over two axes.
        """
        from vibro_cli.report.grid_content import grid_html
        from vibro_cli.storage.files import write_file

        target = checked_page("file", file)
        columns = checked("maps", maps, Texts("columns of the summary"))
        write_file(target, grid_html(self.stored, target.parent, columns))
        return target

    def __repr__(self) -> str:
        unsolved = f"; {self.stored.unsolved}" if self.stored.unsolved else ""
        points = f"{counted(self.stored.points, 'point')} over {', '.join(self.axes)}"
        return f"<Grid {self.name}: {points}{unsolved}>"

    def _repr_html_(self) -> str:
        """Return the first points as HTML, for notebooks."""
        return self.summary._repr_html_()


class Design(TypedDict, total=False):
    """Arguments of the modes that draw points."""

    n: int
    """Number of points."""
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
        A scenario, or a grid file. A grid file defines axes, mode and what is kept, so that only
        ``folder``, ``workers`` and ``force`` may be given with it.
    axes
        Values by path: a sequence or array of values, or an axis as in a grid file, such as
        ``{"linspace": ["-80 deg", "-65 deg", 121]}``. In a product the last axis changes fastest.
    folder
        Folder of the dataset; points of this grid that it already holds are not solved again. By
        default the dataset is in a temporary folder, which is removed with the grid and its copies;
        such a grid cannot be pickled.
    mode
        Combination of the axes: ``"product"`` (default), ``"zip"``, ``"latin-hypercube"`` or
        ``"sobol"``.
    collisions
        Whether to keep every impact too, or the columns of impacts to keep. By default none.
    workers
        Number of threads; 0 for one per processor.
    force
        Whether to replace a different grid in the folder.
    n, seed
        Number of points and seed (0 by default) of the modes that draw points.

    Raises
    ------
    ScenarioError
        With all faults of the grid. A point that is not a valid scenario becomes a row with the
        status ``invalid`` and the reason; the logger warns of such points.
    GridChanged
        If the folder holds a different grid.
    TypeError
        For axes and other settings beside a grid file.
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
    summary = Table("summary", found.stored.table("summary"))  # `found` reads it when it is used
    status, number = summary["status"], summary["scenario"]
    odd = np.flatnonzero(status != "ok")
    if len(odd):
        first = f"{number[odd[0]]} ({status[odd[0]]}): {summary['reason'][odd[0]]}"
        count = f"{len(odd):,} of {counted(len(status), 'point')}"
        _LOG.warning("%s: %s invalid or failed, such as scenario %s", found.name, count, first)
    return found


def _grid_of(source: AnyScenario | str | Path, **settings: Any) -> GridDocument:
    """Return the requested grid; settings as for :func:`sweep`, None if not given."""
    given = {name: value for name, value in settings.items() if value is not None}
    if isinstance(source, str | Path):
        if given:
            found = ", ".join(f"{name}=" for name in given)
            raise TypeError(f"found {found} beside a grid file, which has its own; expected none")
        return load_grid(checked_path("source", source))
    check_scenario(source)
    # Without the first, the source, and the last, in place of which come the keys of a design.
    known = (*list(signature(sweep).parameters)[1:-1], *Design.__annotations__)
    wrong = [name for name in given if name not in known]
    if wrong:
        expected = listing(known)
        raise ScenarioError(
            Problem.at(Place("sweep"), name, f"the unknown key {shown(name)}", expected + hint)
            for name, hint in ((name, suggestion(name, known)) for name in wrong)
        )
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
    try:
        return grid_of(Document(data, name=source.name), Path())
    except ScenarioError as error:
        raise ScenarioError(
            replace(one, path=one.path.replace("keep.columns", "collisions"))
            for one in error.problems
        ) from None


def open_grid(folder: str | Path) -> Grid:
    """Open the folder of a grid, with all points finished so far.

    Raises ``NotAGrid`` if it is not a grid of vibro, or a file is missing or has changed.
    """
    return Grid(open_stored_grid(checked_path("folder", folder, "folder")))
