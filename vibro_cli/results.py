"""What Python works with: scenarios solved to runs and grids, their tables, figures and folders."""

from __future__ import annotations

import logging
import shutil
import tempfile
import weakref
from collections.abc import Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import cached_property
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from vibro_cli import __version__, api
from vibro_cli.assemble import build_any, warnings_of
from vibro_cli.grids.dataset import Verdict
from vibro_cli.grids.dataset import verify as verify_folder
from vibro_cli.grids.document import Grid as GridDocument
from vibro_cli.grids.document import grid_of, load_grid
from vibro_cli.grids.threads import available_cores, solve_into
from vibro_cli.scenario import any_scenario_of, gallery, load_any
from vibro_cli.scenario.loading import Document, parse_document
from vibro_cli.storage import runs
from vibro_cli.storage.frame import Table
from vibro_cli.storage.schema import table_named
from vibro_cli.storage.stored import StoredRun, as_if_stored
from vibro_cli.storage.stored import open_run as open_stored_run
from vibro_cli.storage.stored_grid import StoredGrid
from vibro_cli.storage.stored_grid import open_grid as open_stored_grid
from vibro_cli.storage.tables import read_parquet, to_arrow, units_of_numbers

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike

    from vibro_cli.analysis.fit import Fit
    from vibro_cli.analysis.orbit_branch import Branch
    from vibro_cli.analysis.orbits import Orbit
    from vibro_cli.figures.grids.basins import Mapped
    from vibro_cli.scenario import Scenario
    from vibro_cli.scenario.base import AnyScenario

_LOG = logging.getLogger("vibro_cli")
_LOG.addHandler(logging.NullHandler())


@dataclass(frozen=True)
class Drawing:
    """A figure at journal standard, shown as it is in a notebook."""

    name: str
    """The stem of its files."""
    figure: Figure = field(repr=False)
    """The figure of matplotlib."""

    def save(self, file: str | Path) -> Path:
        """Write the figure as PNG, PDF or SVG, by the file's suffix; equal figures, equal bytes.

        Raises ``ValueError`` for another suffix and ``OSError`` where it cannot be written.
        """
        from vibro_cli.figures.output import save

        target = Path(file)
        (written,) = save(self.figure, target.with_suffix(""), (target.suffix[1:].lower(),))
        return written

    def _repr_png_(self) -> bytes:
        from vibro_cli.figures.output import render

        return render(self.figure, "png", 150.0)


@dataclass(frozen=True)
class Run:
    """A finished run: its tables, its motion at any time, figures, a report and a folder.

    From :func:`simulate` or :func:`open_run`.
    """

    scenario: AnyScenario
    """What was solved."""
    _solved: api.Run | None = field(repr=False)
    """The run as the solver made it, with all its logs; None for one from a folder."""
    stored: StoredRun | None = field(default=None, repr=False)
    """As it was read from its folder, if it was."""

    @property
    def solved(self) -> api.Run:
        """The run with all its logs; one from a folder is solved again for that."""
        if self._solved is not None:
            return self._solved
        assert self.stored is not None
        return self.stored.run

    @property
    def _shown(self) -> Any:
        """The run as figures take it, of a long one from a folder without its logs."""
        return self._solved or (self.stored and self.stored.whole) or self.stored

    @property
    def folder(self) -> Path | None:
        """The folder the run was opened from, None if it was not."""
        return None if self.stored is None else self.stored.folder

    @property
    def name(self) -> str:
        """The name of the scenario."""
        return self.scenario.name

    @cached_property
    def summary(self) -> dict[str, Any]:
        """The columns of the table ``summary`` as plain values, None where there is none."""
        stored = self.stored
        return self.solved.summary_record() if stored is None else dict(stored.summary)

    @cached_property
    def tables(self) -> dict[str, Table]:
        """Every table of the run by its name, as its folder has them."""
        if self.folder is not None:
            files = {name: self.folder / f"{name}.parquet" for name in self._table_names}
            return {n: Table(n, read_parquet(file)) for n, file in files.items() if file.exists()}
        made = {n: runs.run_table(self.solved, n, self.scenario) for n in self._table_names}
        return {name: Table(name, data) for name, data in made.items() if data is not None}

    @property
    def _table_names(self) -> Sequence[str]:
        return [table.file for table in self._shown.kind.tables()]

    @property
    def collisions(self) -> Table:
        """A row for each impact of two bodies, in order of time."""
        return self.tables["collisions"]

    @property
    def bounces(self) -> Table:
        """A row for each impact on the wall; on a table only, else ``KeyError``."""
        return self.tables["bounces"]

    @property
    def events(self) -> Table:
        """A row for each event other than an impact; not on a table, there ``KeyError``."""
        return self.tables["events"]

    @property
    def motion(self) -> Table | None:
        """The motion at the times that ``[output]`` asks for; None where it asks for none."""
        return self.tables.get("motion")

    def sample(self, times: ArrayLike, side: str = "after", extrapolate: bool = False) -> Table:
        """Return the motion at any times, exactly: for each time a row for each body.

        Of a long run from a folder no log is kept: each call goes through the run again, a second
        for a million impacts, so that many times are best asked for at once.

        Parameters
        ----------
        times
            Instants in s, shape ``()`` or ``(n,)``, in any order, within the run.
        side
            ``"after"`` or ``"before"`` an event that happens at just such an instant.
        extrapolate
            Whether times outside the run are answered too, as if the first and the last flights
            went on.

        Raises
        ------
        ValueError
            For another ``side``, and for a time outside the run that is not to be extrapolated.
        """
        import numpy as np

        motion = self._solved if self.stored is None else self.stored.motion
        assert motion is not None
        columns = motion.sample(np.atleast_1d(times), side, extrapolate)
        described = table_named("motion", list(columns), self.scenario.system)
        return Table("motion", to_arrow(described, columns, runs.origin_of(self.scenario)))

    def continued(self, changes: Mapping[str, Any], engine: str = "compiled") -> Run:
        """Return the run with a later stop, to the bit as if it had never stopped.

        Parameters
        ----------
        changes
            Values by their paths as for ``scenario.replace``, such as ``{"stop.time": 120}``.
        engine
            As for :func:`simulate`.

        Raises ``CannotContinue`` if the run had ended for good, or is past the new stop.
        """
        before = self.solved.checkpoint(), self.solved.history()
        return _solved(self.scenario.replace(changes), engine, *before)

    def save(
        self,
        folder: str | Path | None = None,
        figures: bool | Sequence[str] = True,
        force: bool = False,
    ) -> Path:
        """Write the folder of the run, as ``vibro run`` does, whole or not at all; return it.

        Parameters
        ----------
        folder
            By default ``outputs/<name>``.
        figures
            Whether figures are drawn too: for a trace the phase portraits, else of every kind; or
            the names of the kinds that are.
        force
            Whether a run with other parameters is replaced.

        Raises
        ------
        FolderRefused
            If the folder holds something else, or a run with other parameters.
        OSError
            If it cannot be written.
        """
        from vibro_cli.figures.output import render
        from vibro_cli.figures.runs.kinds import draw_all

        target = Path("outputs") / self.name if folder is None else Path(folder)
        if isinstance(figures, bool):
            figures = self._shown.kind.default_figures if figures else ()
        width = self._shown.kind.figure_width(self._shown.system)
        drawn = draw_all(self._shown, figures, width)
        files = {f"{one.name}.{form}": render(one.figure, form) for one in drawn for form in _FORMS}
        runs.write_run(self.solved, self.scenario, target, files, force)
        return target

    @property
    def kinds(self) -> tuple[str, ...]:
        """The kinds of figures there are."""
        return tuple(self._shown.kind.figures)

    def section(
        self,
        columns: Sequence[str],
        pair: tuple[int, int] | None = None,
        transient: int = 0,
        width: str = "double",
    ) -> Drawing:
        """Draw the Poincaré section of the impacts: one column over another.

        Parameters
        ----------
        columns
            Two columns of numbers of the impacts, along and up.
        pair
            Only impacts of these bodies, from 1, the left one first.
        transient
            How many are left out at the beginning.
        width
            ``"single"`` or ``"double"``.

        Raises ``ValueError`` for another column or width, and where there is no such impact.
        """
        from vibro_cli.figures.grids.bifurcation import Section, poincare, quantities_of

        table, section = self.collisions, Section(pair, transient)
        quantities = quantities_of(columns, units_of_numbers(table.to_arrow().schema))
        if len(quantities) != 2:
            raise ValueError(f"found {len(quantities)} columns of impacts, expected two")
        wanted = {name: table[name] for name in (*columns, *section.columns)}
        drawn = poincare(wanted, (quantities[0], quantities[1]), section, width)
        if drawn is None:
            raise ValueError(f"{self.name} has no such impact")
        return Drawing("section", drawn)

    def figure(self, kind: str = "portrait", body: int = 1, width: str = "double") -> Drawing:
        """Draw one figure of the run.

        Parameters
        ----------
        kind
            One of ``run.kinds``, such as ``"portrait"``.
        body
            The body of a phase portrait, from 1.
        width
            ``"single"`` or ``"double"``: one column of a journal (85 mm) or two (170 mm).

        Raises
        ------
        ValueError
            For another kind, body or width, and where the run has nothing to show in it.
        """
        from vibro_cli.figures.runs.kinds import draw_one

        drawn = draw_one(self._shown, kind, body, width)
        if drawn is None:
            raise ValueError(f"{self.name} has nothing to show as {kind}")
        return Drawing(f"{kind}_{body}" if kind == "portrait" else kind, drawn)

    def film(
        self,
        file: str | Path,
        start: float = 0.0,
        end: float | None = None,
        pace: float = 1.0,
        fps: int = 25,
    ) -> Path:
        """Write the motion of a run on a trace as a film, exact at every frame's time.

        Parameters
        ----------
        file
            ``.html``, ``.gif`` or ``.mp4`` (which needs the program ffmpeg).
        start, end
            The times shown, s; by default from the start to the end of the run, or to 30 s of film.
        pace
            Motion's time in a second of the film, s.
        fps
            Frames in a second of the film; of a GIF a divisor of 100.

        Raises
        ------
        ValueError
            For a run of another system, another suffix, and times outside the run.
        NoFilm
            If ffmpeg is not there, or fails.
        """
        from vibro_cli.figures.film import FORMS, frame_times, frames, movie
        from vibro_cli.report.film_page import film_html
        from vibro_cli.storage.files import write_file

        target, run, last = Path(file), self._shown, self.summary["end_time"]
        form = target.suffix.lower().removeprefix(".")
        stop = min(last, start + _SECONDS * pace) if end is None else end
        if not run.kind.has_film:
            raise ValueError(f"found a run of {self.scenario.system}, expected one of a trace")
        if form not in (*FORMS, "html") or (form == "gif" and 100 % fps):
            raise ValueError(
                f"found {target.name!r} with {fps} frames a second, expected .html, .mp4, or .gif "
                "with a divisor of 100"
            )
        if not 0.0 <= start < stop <= last:
            raise ValueError(
                f"found {start:g} s to {stop:g} s, expected times from 0 to {last:g} s"
            )
        shown = frames(run, frame_times(start, stop, pace, fps))
        if form == "html":
            write_file(target, film_html(run, shown, fps, self.name, __version__))
        else:
            write_file(target, movie(run, shown, fps, form))
        return target

    def report(self, file: str | Path) -> Path:
        """Write the page that explains the run, as ``vibro report`` does; return its path."""
        from vibro_cli.report.page import report_html
        from vibro_cli.storage.files import write_file

        target = Path(file)
        stored = self.stored or self._as_if_stored()
        write_file(target, report_html([stored], target.parent, __version__))
        return target

    def _as_if_stored(self) -> StoredRun:
        tables = {name: dict(table) for name, table in self.tables.items()}
        return as_if_stored(self.solved, self.scenario, tables)

    def __repr__(self) -> str:
        return f"<Run {_in_words(self)}>"

    def _repr_html_(self) -> str:
        """Show the summary in a notebook."""
        rows = "".join(
            f"<tr><th>{escape(name)}{f' [{unit}]' if unit else ''}</th>"
            f"<td>{escape(_shown(self.summary[name]))}</td></tr>"
            for name, unit in self.tables["summary"].units.items()
            if self.summary[name] is not None
        )
        return f"<table><caption>{escape(_in_words(self))}</caption>{rows}</table>"


_FORMS = ("png", "pdf")
_SECONDS = 30.0
"""Length of a film (s) where no end is asked for."""


def _in_words(run: Run) -> str:
    summary = run.summary
    count, end = summary["collisions"], summary["end_cause"].replace("_", " ")
    impacts = f"{count:,} {'impact' if count == 1 else 'impacts'}"
    return f"{run.name}: {impacts}, ended at t = {summary['end_time']:.6g} s ({end})"


def _shown(value: Any) -> str:
    return f"{value:.9g}" if isinstance(value, float) else str(value)


def simulate(scenario: AnyScenario, engine: str = "compiled") -> Run:
    """Run a scenario to its end.

    What is doubtful about it is a warning of the logger ``vibro_cli``, what came of it an
    information.

    Parameters
    ----------
    scenario
        From :func:`load_scenario`, :func:`example` or ``Scenario.from_dict``.
    engine
        ``"compiled"``, or ``"python"`` (interpreted); both give the same bits.

    Raises
    ------
    ScenarioError
        If the scenario is mechanically impossible; every problem with its place.
    TooQuiet
        If millions of crossings follow one another without an impact.
    """
    return _solved(scenario, engine)


def _solved(scenario: AnyScenario, engine: str, *before: Any) -> Run:
    run = Run(scenario, api.simulate(scenario, engine, *before))
    for warning in warnings_of(scenario, run.solved.system):
        _LOG.warning("%s: %s", scenario.name, warning)
    for omission in run.solved.skipped:
        _LOG.debug("%s: skipped: %s", scenario.name, omission)
    _LOG.info("%s", _in_words(run))
    return run


def simulate_many(
    scenarios: Iterable[AnyScenario], workers: int = 0, engine: str = "compiled"
) -> list[Run]:
    """Run scenarios to their ends, several at a time; the runs are in the order given.

    To change a few values of one scenario, and for more than some hundreds, :func:`sweep` is the
    better way: it keeps tables in place of runs.

    Parameters
    ----------
    scenarios, engine
        As for :func:`simulate`; they may be of different systems.
    workers
        Threads; 0 for one on each processor.

    Raises as :func:`simulate`, for the first scenario that cannot be run.
    """
    with ThreadPoolExecutor(workers or available_cores()) as pool:
        return list(pool.map(lambda one: _solved(one, engine), scenarios))


def orbit(scenario: AnyScenario, impacts: int | None = None, period: float | None = None) -> Orbit:
    """Find the periodic orbit of impacts next to the start of a scenario, as ``vibro orbit`` does.

    Parameters
    ----------
    scenario
        Of a trace at rest, with k = 1.
    impacts, period
        Impacts of one period, or a guess of the period (s); by default those of the nearest return.

    Raises
    ------
    NoOrbit, NoTangents
        If there is none, or no tangent map of the scenario.
    ScenarioError, ValueError
        If the scenario is mechanically impossible, or of another system.
    """
    from vibro_cli.analysis.orbits import find_orbit

    system = _system_of_trace(scenario)
    return find_orbit(system, impacts, period, scenario.stop.time or 1000.0)


def orbit_family(scenario: AnyScenario, found: Orbit, vary: str, low: float, high: float) -> Branch:
    """Follow a periodic orbit over a number of its scenario, as ``vibro orbit --vary`` does.

    Parameters
    ----------
    scenario, found
        The scenario, and its :func:`orbit`.
    vary, low, high
        Path of the number, such as ``"balls[2].mass"``, and its range (SI units, radians); or
        ``"energy"`` (J).

    Raises as :func:`orbit`.
    """
    from vibro_cli.analysis.orbit_branch import family_of

    _system_of_trace(scenario)
    return family_of(cast("Scenario", scenario), found, vary, low, high)


def _system_of_trace(scenario: AnyScenario) -> Any:
    """The checked system of a scenario, which has to be of a trace."""
    from vibro_cli.systems import system_named

    system = build_any(scenario)
    if not system_named(scenario.system).has_orbits:
        raise ValueError(f"found a scenario of {scenario.system}, expected one of a trace")
    return system


def fit(
    scenario: AnyScenario,
    measured: str | Path | Mapping[str, Any] | ArrayLike,
    free: Sequence[str] | Mapping[str, tuple[float, float]],
    noise: float | None = None,
) -> Fit:
    """Fit numbers of a scenario of a trace at rest to measured instants of impacts.

    Parameters
    ----------
    scenario
        With the values to begin with.
    measured
        The instants (s), a table with them (``t``, and if wanted ``n``, ``error``, ``ball_a``,
        ``ball_b``), or a CSV or parquet file, as for ``vibro fit``.
    free
        Paths of the numbers, such as ``"collision.k"``, or their bounds by their paths (SI units,
        radians).
    noise
        Standard deviation of the instants (s), if it is known and stands not in the table.

    Raises
    ------
    NoFit
        If the numbers cannot be fitted to these instants.
    NotMeasured
        If the table does not tell of instants.
    ScenarioError, ValueError
        If the scenario is mechanically impossible or of another system; for a text that is no path.
    """
    from vibro_cli.analysis.fit import Free, fit_impacts, measured_of, read_measured

    _system_of_trace(scenario)
    bounds: Any = free.items() if isinstance(free, Mapping) else [(path, ()) for path in free]
    numbers = [Free.of(path, *ends) for path, ends in bounds]
    if isinstance(measured, (str, Path)):
        told = read_measured(measured)
    else:
        told = measured_of(measured if isinstance(measured, Mapping) else {"t": measured})
    return fit_impacts(cast("Scenario", scenario), told, numbers, noise)


def check(scenario: AnyScenario) -> tuple[str, ...]:
    """Check the mechanics of a scenario without running it; return what is doubtful about it.

    Raises ``ScenarioError`` with everything that makes it impossible.
    """
    return warnings_of(scenario, build_any(scenario))


def portrait(scenario: AnyScenario, body: int = 1, width: str = "double") -> Drawing:
    """Draw the phase portrait of a body without a run, as ``vibro portrait`` does.

    Level curves and separatrices in closed form, centres and saddles; on a trace the figure eight.

    Parameters
    ----------
    scenario
        Of a trace, of springs, or of a table within an ellipse or a circle.
    body
        The body, from 1.
    width
        ``"single"`` or ``"double"``: one column of a journal (85 mm) or two (170 mm).

    Raises
    ------
    ScenarioError
        If the scenario is mechanically impossible.
    ValueError
        For another body or width, and for a table without a portrait.
    """
    from vibro_cli.systems import system_named

    system = build_any(scenario)
    bodies = len(system.bodies)
    if not 1 <= body <= bodies:
        raise ValueError(f"found body {body}, expected a number from 1 to {bodies}")
    _, figures = system_named(scenario.system).portrait(system, width, True)
    for stem, figure in figures.items():
        if str(body) in stem.split("_"):  # equal bodies share one: portrait_1_2
            return Drawing(stem, figure)
    radii = [one.radius for one in system.bodies]  # balls of a table do by their radius alone
    first = f"portrait_{radii.index(radii[body - 1]) + 1}"
    return Drawing(first, figures[first])


def example(name: str) -> AnyScenario:
    """Return a scenario of the gallery, such as ``"three_arcs"``: what ``vibro new`` writes.

    Raises ``ScenarioError`` with the names there are.
    """
    return any_scenario_of(parse_document(gallery.text(name), "toml", f"{name}.toml", name))


def load_scenario(source: str | Path, overrides: Sequence[str] = ()) -> AnyScenario:
    """Read a scenario of any system from a file in TOML, JSON or YAML, told by its suffix.

    Parameters
    ----------
    source
        The file; ``"-"`` is standard input.
    overrides
        Values to change as ``--set`` takes them, such as ``"balls[1].angle=-60 deg"``.

    Raises
    ------
    ScenarioError
        With everything that is wrong with it, each with line and column.
    OSError
        If the file cannot be read.
    """
    return load_any(source, overrides)


def open_run(folder: str | Path) -> Run:
    """Open the folder of a run; its files are held to their checksums.

    Raises
    ------
    NotContinuable
        If it holds no run of this version of the program, or one that has changed.
    OSError
        If a file is missing or cannot be read.
    """
    stored = open_stored_run(Path(folder))
    return Run(stored.scenario, None, stored)


def verify(folder: str | Path) -> Verdict:
    """Check the folder of a run or grid against its checksums, as ``vibro verify`` does.

    Raises ``NoManifest`` for a folder that is none of vibro's. What is missing or damaged is in the
    ``findings`` of the verdict, and ``sound`` says whether there is nothing.
    """
    return verify_folder(Path(folder))


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
        shutil.copytree(self.stored.folder, folder)
        return Path(folder)

    @cached_property
    def kinds(self) -> tuple[str, ...]:
        """The kinds of figures there are."""
        from vibro_cli.figures.grids.kinds import GRID_KINDS

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
        from vibro_cli.figures.grids.kinds import draw_grid_kind

        drawn = draw_grid_kind(self.stored, kind, width)
        if drawn is None:
            raise ValueError(f"{self.name} has nothing to show as {kind}")
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
        from vibro_cli.figures.grids.bifurcation import Section, bifurcation, quantities_of

        quantities = quantities_of(columns, self.stored.impact_units())
        drawn = bifurcation(self.stored, width, quantities, Section(pair, transient))
        if drawn is None:
            raise ValueError(f"{self.name} kept no such impact, or no axis of numbers changes")
        return Drawing("section", drawn)

    def basins(self, outcome: Sequence[str] = ()) -> Mapped:
        """Tell which outcome each point leads to, and how finely the outcomes are mixed.

        Parameters
        ----------
        outcome
            Columns of the summary that tell the outcome together, as for ``vibro basins``.

        Its ``basins`` has the measures; ``map(width)`` and ``scaling(width)`` draw.

        Raises `NoBasins` where they cannot be told.
        """
        from vibro_cli.figures.grids.basins import mapped_basins

        return mapped_basins(self.stored, outcome)

    def report(self, file: str | Path, maps: Sequence[str] = ()) -> Path:
        """Write the page that explains the grid, as ``vibro report`` does; return its path.

        ``maps`` are columns of the summary that are shown over two axes too.
        """
        from vibro_cli.report.page import grid_html
        from vibro_cli.storage.files import write_file

        target = Path(file)
        write_file(target, grid_html(self.stored, target.parent, __version__, maps))
        return target

    def __repr__(self) -> str:
        return f"<Grid {self.name}: {self.stored.points:,} points over {', '.join(self.axes)}>"

    def _repr_html_(self) -> str:
        """Show the first points in a notebook."""
        return self.summary._repr_html_()


def sweep(
    source: AnyScenario | str | Path,
    axes: Mapping[str, Any] | None = None,
    folder: str | Path | None = None,
    *,
    mode: str = "product",
    collisions: bool | Sequence[str] = False,
    workers: int = 0,
    force: bool = False,
    **more: int,
) -> Grid:
    """Solve a scenario for many values of some of its keys, as ``vibro grid`` does.

    Parameters
    ----------
    source
        A scenario; or a grid file, which has the axes and all else in it.
    axes
        The values by their paths: a sequence or array of them, or what a grid file says of an axis,
        such as ``{"linspace": ["-80 deg", "-65 deg", 121]}``. Of a product, the last axis changes
        fastest.
    folder
        Where the dataset goes; what it holds of this grid already is not solved again. By default
        it is kept in a temporary folder for as long as the grid is used.
    mode
        How the axes are combined: ``"product"``, ``"zip"``, ``"latin-hypercube"`` or ``"sobol"``;
        the latter two take ``n`` (and ``seed``) too.
    collisions
        Whether every impact is kept too; or the names of the columns that are.
    workers
        Threads; 0 for one on each processor.
    force
        Whether another grid in the folder is replaced.

    Raises
    ------
    ScenarioError
        With everything that is wrong with the grid. A point that is no valid scenario is a row with
        status ``invalid`` and the reason.
    GridChanged
        If the folder holds another grid.
    """
    grid = _grid_of(source, axes, {"mode": mode, **more}, collisions)
    target = Path(tempfile.mkdtemp(prefix="vibro-") if folder is None else folder)
    try:
        solve_into(target, grid, workers, force=force)
        found = Grid(open_stored_grid(target))
    except BaseException:
        if folder is None:
            shutil.rmtree(target)
        raise
    if folder is None:
        weakref.finalize(found, shutil.rmtree, target)
    _LOG.info("%s: %s points", found.name, f"{found.stored.points:,}")
    return found


def _grid_of(
    source: AnyScenario | str | Path,
    axes: Mapping[str, Any] | None,
    settings: Mapping[str, Any],
    collisions: bool | Sequence[str],
) -> GridDocument:
    """The grid that was asked for."""
    from vibro_cli.scenario.base import plain

    if isinstance(source, str | Path):
        if axes is not None:
            raise TypeError("a grid file has its axes in it; expected a scenario with axes=")
        return load_grid(source)
    kept = {"collisions": bool(collisions)}
    data = {
        "name": source.name,
        "scenario": source.given(),
        "axes": [
            {"path": path, **(plain(one) if isinstance(one, Mapping) else {"values": plain(one)})}
            for path, one in (axes or {}).items()
        ],
        "keep": kept if isinstance(collisions, bool) else {**kept, "columns": list(collisions)},
        **settings,
    }
    return grid_of(Document(data, name=source.name), Path())


def open_grid(folder: str | Path) -> Grid:
    """Open the folder of a grid, all its points or those that are finished.

    Raises ``NotAGrid`` when it is none of vibro's, or a file of it is missing or has changed.
    """
    return Grid(open_stored_grid(Path(folder)))
