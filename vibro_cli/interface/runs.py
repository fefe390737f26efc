"""Runs in the Python interface: solving, opening, sampling, drawing and saving them."""

from __future__ import annotations

import logging
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import cached_property
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

from vibro_cli import api
from vibro_cli.errors import NoTable, NothingToShow, counted
from vibro_cli.grids.dataset import verify as verify_folder
from vibro_cli.interface import Drawing, figures_of, nothing_shown
from vibro_cli.scenario.base import (
    Texts,
    check_scenarios,
    checked,
    checked_page,
    checked_path,
    plain,
)
from vibro_cli.scenario.quantities import FLAG, Count, Dictionary, Quantity
from vibro_cli.storage import folders
from vibro_cli.storage.files import available_cores, manifest_of, write_file
from vibro_cli.storage.frame import Table
from vibro_cli.storage.stored import in_memory
from vibro_cli.storage.stored import open_run as open_stored_run
from vibro_cli.storage.tables import AnyTable, FileTable, units_of_numbers
from vibro_cli.systems import system_named
from vibro_cli.systems.driver import CannotContinue
from vibro_cli.systems.request import CHANGEABLE

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from typing import Any

    from numpy.typing import ArrayLike

    from vibro_cli.grids.dataset import Verdict
    from vibro_cli.scenario.base import AnyScenario
    from vibro_cli.storage.stored import StoredRun
    from vibro_cli.systems.contract import System

_LOG = logging.getLogger("vibro_cli")


@dataclass(frozen=True)
class Run:
    """A finished run: its tables, its motion at any time, figures, a report and a folder.

    Returned by :func:`simulate` and :func:`open_run`.
    """

    stored: StoredRun = field(repr=False)
    """The run as needed by figures and reports; a stored run is solved again only for its motion.
    """
    _made: dict[str, AnyTable | None] = field(default_factory=dict, repr=False, compare=False)

    @property
    def scenario(self) -> AnyScenario:
        """The scenario that was solved."""
        return self.stored.scenario

    @property
    def solved(self) -> api.Run:
        """The run with all its logs; a stored run is solved again for them."""
        return self.stored.run

    @property
    def folder(self) -> Path | None:
        """The folder from which the run was opened, or None."""
        return self.stored.folder

    @property
    def name(self) -> str:
        """The name of the scenario."""
        return self.scenario.name

    @cached_property
    def summary(self) -> dict[str, Any]:
        """Columns of the table ``summary`` as plain values; missing ones are None."""
        return dict(self.stored.summary)

    @cached_property
    def tables(self) -> dict[str, Table]:
        """All tables of the run by name; ``OSError`` if its folder is gone or replaced."""
        found = {table.file: self._table(table.file) for table in self._kind.tables()}
        return {name: table for name, table in found.items() if table is not None}

    def _table(self, name: str) -> Table | None:
        """Return a table with its columns, or None if the run has no such table."""
        data = self._data(name)
        return None if data is None else Table(name, data)

    def _data(self, name: str) -> AnyTable | None:
        """Return an Arrow table by name, read or made on first use."""
        if name not in self._made:
            self._made[name] = self._found(name)
        return self._made[name]

    def _found(self, name: str) -> AnyTable | None:
        if name not in {table.file for table in self._kind.tables()}:
            return None
        if self.stored.place is None:
            columns = self.solved.table(name)
            return None if columns is None else folders.arrow_table(name, columns, self.scenario)
        self.stored.place.stat()  # raises if the folder is gone
        if f"{name}.parquet" not in self.stored.manifest["files"]:
            return None
        table = FileTable(self.stored.place / f"{name}.parquet")
        self.stored.check_not_replaced()
        return table

    @property
    def _kind(self) -> System:
        return system_named(self.scenario.system)

    @property
    def collisions(self) -> Table:
        """One row per impact of two bodies, in order of time."""
        return self._there("collisions")

    @property
    def bounces(self) -> Table:
        """One row per impact on the wall; ``KeyError`` unless the system is a table."""
        return self._there("bounces")

    @property
    def events(self) -> Table:
        """One row per event other than an impact; ``KeyError`` if the system is a table."""
        return self._there("events")

    @property
    def motion(self) -> Table | None:
        """The motion at the times requested in ``[output]``, or None."""
        return self._table("motion")

    def _there(self, name: str) -> Table:
        found = self._table(name)
        if found is None:
            raise NoTable(f"runs of system = {self.scenario.system} have no table {name}")
        return found

    def sample(self, times: ArrayLike, side: str = "after", extrapolate: bool = False) -> Table:
        """Return the exact motion at any times: one row per body and time.

        The log of a long stored run is not kept: each call solves the run again, which takes a
        second per million impacts, so many times are best requested together.

        Parameters
        ----------
        times
            Times in s, shape ``()`` or ``(n,)``, in any order, within the run.
        side
            ``"after"`` or ``"before"``: the state to return at the very instant of an event.
        extrapolate
            Whether times outside the run are allowed; the first and the last flights are extended.

        Raises
        ------
        ValueError
            For another ``side``, and for a time outside the run without ``extrapolate``.
        """
        import numpy as np

        extrapolate = checked("extrapolate", extrapolate, FLAG)
        columns = self.stored.sample(np.atleast_1d(times), side, extrapolate)
        return Table("motion", folders.arrow_table("motion", columns, self.scenario))

    def continued(self, changes: Mapping[str, Any], engine: str = "compiled") -> Run:
        """Continue the run to a later stop, bit for bit as if it had never stopped.

        Parameters
        ----------
        changes
            New values of ``stop`` and ``output`` by path, as for ``scenario.replace``, such as
            ``{"stop.time": 120}``.
        engine
            As for :func:`simulate`.

        Raises
        ------
        CannotContinue
            If the run had ended for good or is past the new stop, or for other changes.
        """
        for path in checked("changes", changes, Dictionary("values by their paths")):
            if str(path).partition(".")[0] not in CHANGEABLE:
                raise CannotContinue(
                    f"found a value for {path}, expected one of {' or '.join(CHANGEABLE)} (the "
                    "rest of the scenario of a continued run stays as it was)"
                )
        before = self.solved.checkpoint(), self.solved.history()
        return _solved(self.scenario.replace(changes), engine, *before)

    def save(
        self,
        folder: str | Path | None = None,
        figures: bool | Sequence[str] = True,
        force: bool = False,
    ) -> Path:
        """Write the folder of the run atomically, as ``vibro run`` does; return its path.

        Parameters
        ----------
        folder
            By default ``outputs/<name>``.
        figures
            Whether to draw the default figures (phase portraits for a trace, otherwise figures of
            the motion), or the kinds to draw (all: ``run.kinds``). The logger warns of kinds with
            nothing to show.
        force
            Whether to replace a run with other parameters.

        Raises
        ------
        FolderRefused
            If the folder holds something else, or a run with other parameters.
        OSError
            If it cannot be written.
        """
        folder = Path("outputs") / self.name if folder is None else folder
        target = checked_path("folder", folder, "folder")
        force, figures = checked("force", force, FLAG), plain(figures)
        are_named = not isinstance(figures, bool)
        if isinstance(figures, bool):
            figures = self._kind.default_figures if figures else ()
        kinds = checked("figures", figures, Texts("kinds of figures"))
        files = figures_of(self.stored, kinds)
        for text in nothing_shown(self.stored, kinds, files) if are_named else ():
            _LOG.warning("%s: %s", self.name, text)
        folders.write_run(self.solved, self.scenario, target, files, force)
        return target

    @property
    def kinds(self) -> tuple[str, ...]:
        """All kinds of figures of the system; `figure` refuses one that would be empty."""
        return tuple(self._kind.figures)

    def section(
        self,
        columns: Sequence[str] = (),
        pair: tuple[int, int] | None = None,
        transient: int = 0,
        width: str = "double",
    ) -> Drawing:
        """Draw the Poincaré section of the impacts: one column against another.

        Parameters
        ----------
        columns
            Two numeric columns of the impacts, for the horizontal and the vertical axis; by default
            position and speed of the left body. For a table they may be columns of the impacts on
            the wall, which are the default if no two balls collide.
        pair
            Restrict to impacts of these two bodies, from 1, in either order.
        transient
            Number of impacts to omit at the beginning.
        width
            ``"single"`` or ``"double"``.

        Raises ``ValueError`` for an invalid column or width, ``NothingToShow`` if there is no such
        impact.
        """
        from vibro_cli.figures.over_axis import (
            ANGLES,
            Section,
            own_columns,
            poincare,
            quantities_of,
        )
        from vibro_cli.figures.style import width_of

        width_of(width)
        columns, section = checked("columns", columns, Texts("columns")), Section(pair, transient)
        impacts, units = self._columns("collisions")
        walls = self._columns("bounces") if pair is None else ({}, {})
        if walls[0]:
            named = bool(columns) and set(columns) <= set(walls[0])
            impacts, units = walls if named or not len(impacts["n"]) else (impacts, units)
        names = columns or own_columns(impacts)
        quantities = quantities_of(names, units)
        if not columns and names[:1] == ["angle_a"]:  # all on one arc
            piece = self.stored.system.trace.pieces[int(impacts["arc_a"][0]) - 1]
            quantities[0] = "angle_a", ANGLES[piece.shape], "rad"
        if len(quantities) != 2:
            found = " and ".join(names) or "none"
            raise ValueError(f"found {found}, expected two columns of impacts")
        wanted = {name: impacts[name] for name in (*names, *section.columns)}
        drawn = poincare(wanted, (quantities[0], quantities[1]), section, width)
        return Drawing("section", drawn)

    def _columns(self, name: str) -> tuple[Any, dict[str, str]]:
        """Return a table (empty if the run has none) and the units of its columns of numbers."""
        data = self._data(name)
        return ({}, {}) if data is None else (Table(name, data), units_of_numbers(data.schema))

    def figure(self, kind: str = "portrait", body: int = 1, width: str = "double") -> Drawing:
        """Draw one figure of the run.

        Parameters
        ----------
        kind
            One of ``run.kinds``, such as ``"portrait"``.
        body
            Number of the body, from 1, for figures of single bodies, such as phase portraits.
        width
            ``"single"`` or ``"double"``: one column of a journal (85 mm) or two (170 mm).

        Raises
        ------
        ValueError
            For an invalid kind, body or width.
        NothingToShow
            If the figure would be empty.
        """
        from vibro_cli.figures.kinds import draw_one

        drawn = draw_one(self.stored, kind, body, width)
        if drawn is None:
            raise NothingToShow(f"{self.name} {self._kind.figures[kind].nothing(kind)}")
        return Drawing(drawn.name, drawn.figure)

    def film(
        self,
        file: str | Path,
        start: float = 0.0,
        end: float | None = None,
        pace: float = 1.0,
        fps: int = 25,
    ) -> Path:
        """Write the motion of the run as a film, exact at the time of every frame.

        Parameters
        ----------
        file
            ``.html``, ``.gif`` or ``.mp4`` (which needs the program ffmpeg).
        start, end
            Time span (s), by default from the start to the end of the run, or to 30 s of film.
        pace
            Time of the motion per second of the film (s).
        fps
            Frames per second, from 1 to 100; for a GIF a divisor of 100.

        Raises
        ------
        ValueError
            For an invalid suffix or pace, more than 20,000 frames, and times outside the run.
        NoFilm
            If ffmpeg is missing or fails, and for a system without films.
        """
        from vibro_cli.figures.film import FORMS, SECONDS

        target, last = checked_path("file", file), self.summary["end_time"]
        fps, pace = checked("fps", fps, _FPS), checked("pace", pace, _PACE)
        start = checked("start", start, Quantity())
        form = target.suffix.lower().removeprefix(".")
        end = min(last, start + SECONDS * pace) if end is None else end
        stop = checked("end", end, Quantity())
        if form not in (*FORMS, "html"):
            raise ValueError(f"found {target.name!r}, expected a .mp4, .gif or .html file")
        if form == "gif" and 100 % fps:
            raise ValueError(f"fps: found {fps}, expected a divisor of 100 for a GIF, such as 20")
        if not 0.0 <= start < stop <= last:
            order = "" if start < stop else ", end after start"
            raise ValueError(
                f"found {start:g} s to {stop:g} s, expected times from 0 to {last:g} s{order}"
            )
        write_film(self.stored, self.name, target, (start, stop), pace, fps)
        return target

    def report(self, file: str | Path) -> Path:
        """Write the report on the run (.html), as ``vibro report`` does; return its path."""
        from vibro_cli.report.content import report_html

        target = checked_page("file", file)
        stored = self.stored
        if self.folder is None:
            stored = replace(stored, manifest=manifest_of("run", {}, {"engine": stored.run.engine}))
        write_file(target, report_html([stored], target.parent))
        return target

    def __repr__(self) -> str:
        return f"<Run {_in_words(self)}>"

    def _repr_html_(self) -> str:
        """Return the summary as HTML, for notebooks."""
        rows = "".join(
            f"<tr><th>{escape(f'{name} [{unit}]' if unit else name)}</th>"
            f"<td>{escape(_shown(self.summary[name]))}</td></tr>"
            for name, unit in self._there("summary").units.items()
            if self.summary[name] is not None
        )
        return f"<table><caption>{escape(_in_words(self))}</caption>{rows}</table>"


_FPS, _PACE = Count(1, 100), Quantity(at_least=1e-6)
"""The same bounds as in `vibro report`."""


def write_film(
    run: Any, name: str, target: Path, span: tuple[float, float], pace: float, fps: int
) -> None:
    """Write the film of a stored run atomically; raises as `Run.film`."""
    from vibro_cli.figures.film import frame_times, movie
    from vibro_cli.report.html import film_html

    shown, form = run.kind.film(run, frame_times(*span, pace, fps)), target.suffix.lower()[1:]
    content = film_html(shown, fps, name) if form == "html" else movie(shown, fps, form)
    write_file(target, content)


def _in_words(run: Run) -> str:
    summary = run.summary
    impacts, end = counted(summary["collisions"], "impact"), summary["end_cause"].replace("_", " ")
    return f"{run.name}: {impacts}, ended at t = {summary['end_time']:.6g} s ({end})"


def _shown(value: Any) -> str:
    return f"{value:.9g}" if isinstance(value, float) else str(value)


def simulate(scenario: AnyScenario, engine: str = "compiled") -> Run:
    """Run a scenario to its end.

    The logger ``vibro_cli`` reports doubts about the scenario as warnings, and the result as info.

    Parameters
    ----------
    scenario
        From :func:`load_scenario`, :func:`example` or ``Scenario.from_dict``.
    engine
        ``"compiled"``, or ``"python"`` (interpreted); both give the same bits.

    Raises
    ------
    ScenarioError
        If the scenario is mechanically impossible, with all problems and their places.
    TooQuiet
        If no two bodies meet for millions of crossings, impacts on the wall or steps.
    """
    return _solved(scenario, engine)


def _solved(scenario: AnyScenario, engine: str, *before: Any) -> Run:
    run = Run(in_memory(api.simulate(scenario, engine, *before), scenario))
    for warning in run._kind.warnings(scenario, run.solved.system):
        _LOG.warning("%s: %s", scenario.name, warning)
    for omission in run.solved.skipped:
        _LOG.debug("%s: skipped: %s", scenario.name, omission)
    _LOG.info("%s", _in_words(run))
    return run


def simulate_many(
    scenarios: Iterable[AnyScenario], workers: int = 0, engine: str = "compiled"
) -> list[Run]:
    """Run scenarios to their ends in parallel; return the runs in the order given.

    To vary a few values of one scenario, or for more than some hundreds of runs, use :func:`sweep`,
    which keeps tables instead of runs.

    Parameters
    ----------
    scenarios, engine
        As for :func:`simulate`; scenarios may belong to different systems.
    workers
        Number of threads; 0 for one per processor.

    Raises as :func:`simulate`, for the first scenario that cannot be run.
    """
    check_scenarios(scenarios)
    with ThreadPoolExecutor(checked("workers", workers, Count(0)) or available_cores()) as pool:
        return list(pool.map(lambda one: _solved(one, engine), scenarios))


def open_run(folder: str | Path) -> Run:
    """Open the folder of a run, and verify the checksums of its files.

    Raises
    ------
    NotContinuable
        If it does not hold a run of this version of the program, or has changed.
    OSError
        If a file is missing or cannot be read.
    """
    return Run(open_stored_run(checked_path("folder", folder, "folder")))


def verify(folder: str | Path) -> Verdict:
    """Check the folder of a run or grid against its checksums, as ``vibro verify`` does.

    Raises ``NoManifest`` for a folder that is not vibro's. The ``findings`` of the verdict list
    missing and damaged files; ``sound`` is true if the folder is complete and unchanged.
    """
    return verify_folder(checked_path("folder", folder, "folder"))
