"""The contract of a system: everything that differs from one to another, as one object.

A system is a folder of this package. Its ``__init__`` has one object, ``SYSTEM``, of a class that
fulfils :class:`System`; what is heavy is imported when it is asked for. What a system has in a
module of a fixed name, such as ``FIGURES`` of ``figures.py``, its class need not name again. Nobody
outside its folder asks for a system by its name or its type: they ask its object.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from itertools import pairwise
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Protocol

if TYPE_CHECKING:
    from pathlib import Path

    import numpy as np
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from vibro_cli.compile.kernel import Kernel, Overrides
    from vibro_cli.figures.film import Frames
    from vibro_cli.figures.kinds import Kind, KindOfBody
    from vibro_cli.grids.document import Grid
    from vibro_cli.grids.solving import Solver
    from vibro_cli.scenario.base import AnyScenario
    from vibro_cli.storage.stored import StoredRun
    from vibro_cli.systems.columns import Table
    from vibro_cli.systems.driver import Driver, EventLoop
    from vibro_cli.systems.request import Limits, OutputRequest
    from vibro_cli.systems.run import Gathered, Stretch, Stretches
    from vibro_cli.systems.tables import Bodies, ImpactRows
    from vibro_cli.systems.tangents import LoggedMap

Columns = dict[str, Any]
"""Columns of equal length by their names."""
Document = dict[str, Any]
"""A scenario as a user writes it, as plain data."""
Sink = Callable[[str, Columns], None]
"""Takes the name of a table and more columns of it; words are given by their numbers."""


PaperRow = tuple[str, str, str, str]
"""Where in a paper, what it says there, the command that shows it, and where it then stands."""


class ShownOfPapers(NamedTuple):
    """What of the papers a system shows: `vibro help papers`."""

    rows: Mapping[str, Sequence[PaperRow]]
    """By the letter of the paper, in its order."""
    symbols: Sequence[tuple[str, str, str]] = ()
    """Symbols of the papers, the words for them here, and their units."""


class TimedScene(NamedTuple):
    """A scene whose run time `vibro bench` measures."""

    document: Document
    parts: tuple[str, ...] = ("systems",)
    """Of the benchmark: the event loop alone in ``"systems"``, whole commands in ``"command"``."""
    share: int = 1
    """The impacts are divided by it where each takes long."""


class NoPortrait(ValueError):
    """What is solved has no portrait; the message says what was found and expected."""


class Tables(Protocol):
    """What the tables of a run say, stretch by stretch."""

    motion: Gathered | None
    """The motion in it, if it is wanted for figures and kept by the system."""

    def take(self, stretch: Stretch) -> None:
        """Hand the rows of a stretch to the sink; the last one has a cause of the end."""

    def summary(self) -> Columns:
        """Return the columns of the summary, of one row, once the run has ended."""


class Trajectory(Protocol):
    """The motion of all bodies at any time of a stretch of the run, in closed form."""

    last: Any
    """What the motion in the next stretch goes on from."""

    def sample(self, instants: Any, side: str = "after") -> Columns:
        """Return the columns of the motion table: for each instant (s) a row for each body.

        `instants` is an array of shape (n,); before and after the stretch what it begins and ends
        with goes on. `side` is "after" or "before" an event that happens at just such an instant;
        raises ValueError for another one.
        """


class Flights(Protocol):
    """The motion in a run on a trace that is over, flight by flight."""

    @property
    def system(self) -> Any:
        """What was solved."""

    def flights(self) -> Columns:
        """Return every flight of every body on a trace: where and when it starts and ends, why."""

    def look_at(self, rows: Any) -> None:
        """Take note of the flights, rows of their table, that will be asked for."""

    def flight_curve(self, index: int, count: int, lasts: float = math.inf) -> tuple[Any, Any, Any]:
        """Return times (s), places and rates at ``count`` points of a flight, or its beginning."""


class Motion(Flights, Protocol):
    """The motion in a run that is over."""

    def sample(self, times: Any, side: str = "after", extrapolate: bool = False) -> Columns:
        """Return the columns of the motion table: for each time (s) a row for each body."""


class LongMotion(Motion, Protocol):
    """The motion in a run that is too long for its logs to be kept."""

    state: dict[str, Any]
    """All that changes in the run, after its last event."""


class ImpactLog(NamedTuple):
    """A table of impacts, and the log that it is made of."""

    log: str
    table: Table
    rows: type[ImpactRows]
    """Of the log, with the values of the table's columns."""
    bodies: type[Bodies]
    """Of systems, with what the rows need of them."""
    title: str = "Impacts"
    """Above the rows in a report."""
    words: str = "impacts"
    """What the rows are, after their number."""
    none: str = "was no impact of two bodies"
    """What is said after "There", where there is no row."""


class System(ABC):
    """Everything that differs from one system to another."""

    name: ClassVar[str]
    """As scenarios have it in ``system``."""

    def part(self, module: str) -> Any:
        """Return a module of the system's folder."""
        return import_module(f"vibro_cli.systems.{self.name}.{module}")

    def has_part(self, module: str) -> bool:
        """Whether there is a module in the system's folder."""
        return find_spec(f"vibro_cli.systems.{self.name}.{module}") is not None

    # From what a user wrote to what is solved: scenario/, assemble.py.

    @property
    def model(self) -> type[AnyScenario]:
        """The pydantic model of its scenarios: ``MODEL`` of ``scenario.py``."""
        model: type[AnyScenario] = self.part("scenario").MODEL
        return model

    def build(self, scenario: Any) -> Any:
        """Return what is solved; raises ``ScenarioError`` with everything that is wrong.

        It is ``build`` of ``build.py``.
        """
        return self.part("build").build(scenario)

    def warnings(self, scenario: Any, system: Any) -> tuple[str, ...]:
        """Return what a user should know about a sound system, a sentence each."""
        from vibro_cli.systems.request import many_samples

        rows = many_samples(scenario.output.step, scenario.stop.time, len(scenario.balls))
        return (*self.mechanics_warnings(scenario, system), *rows)

    def mechanics_warnings(self, scenario: Any, system: Any) -> tuple[str, ...]:
        """Return what is doubtful about its mechanics, a sentence each: here about the law."""
        from vibro_cli.mechanics.system import law_warnings

        # Whichever can meet: if any two are unequal, so are two that follow one another.
        return tuple(law_warnings(system, [*pairwise(system.bodies)]))

    def limits(self, scenario: Any) -> Limits:
        """Return where the run of a scenario stops."""
        from vibro_cli.systems.request import Limits

        stop = scenario.stop
        return Limits(stop.time, stop.collisions, getattr(stop, "bounces", None))

    def wanted(self, scenario: Any) -> OutputRequest:
        """Return what is to be computed of a scenario beside the impacts."""
        from vibro_cli.systems.request import OutputRequest

        analysis = getattr(scenario, "analysis", None)
        grown = analysis is not None and analysis.lyapunov
        return OutputRequest(**scenario.output.model_dump(), lyapunov=grown)

    def one_sided(self, scenario: Any) -> bool:
        """Whether bodies may lift off what they roll on."""
        return False

    # The solver: systems/driver.py, systems/run.py.

    @property
    def loop(self) -> EventLoop:
        """The event loop, its records, logs and causes of the end: ``LOOP`` of ``system.py``."""
        loop: EventLoop = self.part("system").LOOP
        return loop

    @property
    def kernels(self) -> tuple[Kernel, ...]:
        """The kernels that are called from Python; those of the trace are in programs.py.

        The library is built before numpy is there: nothing but kernels may be imported here.
        """
        return ()

    flags: ClassVar[tuple[str, ...]] = ()
    """For the compiler of these kernels, after those of all programs."""

    def world(self, system: Any, limits: Limits) -> Any:
        """Return the records of a system at the start, interpreted, with empty logs.

        They are from ``make_world`` of ``system.py``.
        """
        return self.part("system").make_world(system, limits)

    def overrides(self, system: Any) -> Overrides | None:
        """Return the kernels that stand for others in this system, None without any."""
        return None

    def stretches(self, driver: Driver, stop_time: float | None) -> Stretches:
        """Return the run of a driver in stretches."""
        from vibro_cli.systems.run import Stretches

        return Stretches(self.loop, driver, stop_time)

    def skipped(
        self, clock: Mapping[str, Any], wanted: OutputRequest, end: float
    ) -> tuple[str, ...]:
        """Say what was not computed of a run with this clock and end (s), and why."""
        return wanted.left_out(end)

    def solver(self, grid: Grid, engine: str) -> Solver:
        """Return a solver of the points of a grid: here each is a run of its own."""
        from vibro_cli.grids.solving import RunSolver

        return RunSolver(grid, engine)

    @property
    def timed_scenes(self) -> Mapping[str, TimedScene]:
        """Scenes by name whose run time is measured: ``TIMED_SCENES`` of ``timed_scenes.py``.

        None without that module.
        """
        if not self.has_part("timed_scenes"):
            return {}
        scenes: Mapping[str, TimedScene] = self.part("timed_scenes").TIMED_SCENES
        return scenes

    # Tables: systems/columns.py declares columns.

    impact_tables: ClassVar[tuple[str, ...]] = ("collisions",)
    """The tables of impacts, which grids can keep."""

    def tables(self) -> tuple[Table, ...]:
        """Return every table with all columns it may have; the summary's stand for a body `i`.

        Those beside impacts, summary and exponents are ``OTHER_TABLES`` of ``tables.py``.
        """
        from vibro_cli.systems.columns import converging, with_growth

        impacts = [self.impact_table(name) for name in self.impact_tables]
        others = self.part("tables").OTHER_TABLES
        if not self.exponents:
            return (*impacts, *others, self.summary_of("i", 0))
        return (*map(with_growth, impacts), *others, self.summary_of("i", "i"), converging("i"))

    def summary(self, bodies: int, grown: bool = False) -> Table:
        """Return the summary of runs with so many bodies, `grown` with exponents."""
        return self.summary_of(range(1, bodies + 1), self.exponents * bodies if grown else 0)

    def summary_of(self, bodies: Iterable[int | str], grown: int | str) -> Table:
        """Return the summary of runs with these bodies: numbers from 1, or a letter for any.

        It has so many exponents. Of the run it is ``SUMMARY`` of ``tables.py``, of each body what
        ``final_state`` there gives.
        """
        from vibro_cli.systems.columns import exponents, with_columns

        part = self.part("tables")
        states = [column for body in bodies for column in part.final_state(body)]
        return with_columns(part.SUMMARY, *states, *exponents(grown))

    def table(self, name: str, column_names: Collection[str]) -> Table:
        """Return the table with a name for data with these columns; `ValueError` for another."""
        from vibro_cli.systems.columns import GROWTH, converging, with_growth

        if name == "summary":
            # The final place of each, or on a trace the piece that it is on.
            bodies = sum(column.startswith(("x_", "arc_")) for column in column_names)
            return self.summary(bodies, grown="lyapunov_1" in column_names)
        if name == "exponents":
            numbers = {column for column in column_names if column.startswith("lyapunov_")}
            return converging(len(numbers - {"lyapunov_error"}))
        if name in self.impact_tables:
            table = self.impact_table(name, column_names)
            return with_growth(table) if GROWTH[0].name in column_names else table
        for table in self.tables():
            if table.file == name:
                return table
        raise ValueError(f"there is no table {name!r}")

    def impact_table(self, name: str, column_names: Collection[str] | None = None) -> Table:
        """Return a table of impacts for data with these columns, or with all it may have.

        It is without what the growth of small changes adds.
        """
        return self.impact_logs[name].table

    def table_maker(
        self, system: Any, wanted: OutputRequest, names: Collection[str], sink: Sink
    ) -> Tables:
        """Return what makes the tables with these names of a run, and its summary."""
        from vibro_cli.systems.tables import SystemTables

        return SystemTables(self, system, wanted, names, sink)

    @property
    def impact_logs(self) -> Mapping[str, ImpactLog]:
        """The tables of impacts by their names, where columns are made from rows of logs.

        They are ``IMPACT_LOGS`` of ``tables.py``.
        """
        logs: Mapping[str, ImpactLog] = self.part("tables").IMPACT_LOGS
        return logs

    def events(self, system: Any, logs: Any) -> Columns | None:
        """Return the columns of events of a stretch from its logs, None without such a table."""
        return None

    def trajectory(self, system: Any, stretch: Stretch, before: Any = None) -> Trajectory:
        """Return the motion in a stretch of a run, which may be all of it.

        `before` is the ``last`` of the trajectory of the stretch before it. It is ``Motion`` of
        ``tables.py``.
        """
        trajectory: Trajectory = self.part("tables").Motion(system, stretch, before)
        return trajectory

    def long_motion(
        self, system: Any, limits: Limits, rows: Mapping[str, int], interrupted: bool
    ) -> LongMotion | None:
        """Return the motion in a run that is too long to be kept, None for one that is not.

        `rows` is how many its logs have, where it ended or was `interrupted`.
        """
        from vibro_cli.systems import run

        if sum(rows.values()) <= run.MOST_ROWS:
            return None
        return run.solved_again(self, system, limits, rows, interrupted)  # type: ignore[no-any-return]

    exponents: ClassVar[int] = 0
    """How many Lyapunov exponents there are for each body, the numbers that are its state; none
    where tangent maps are not known."""

    def tangents(self, system: Any) -> LoggedMap:
        """Return the tangent map of a run, which goes through its logs, see systems/tangents.py.

        Its kernel is ``follow`` of the loop, its scale of time ``time_scale`` of ``system.py``.
        """
        from vibro_cli.systems.tangents import LoggedMap

        return LoggedMap(self, system)

    # Figures: figures/kinds.py.

    @property
    def figures(self) -> Mapping[str, Kind[Any] | KindOfBody]:
        """Every kind of figure of a run, by name: ``FIGURES`` of ``figures.py``."""
        figures: Mapping[str, Kind[Any] | KindOfBody] = self.part("figures").FIGURES
        return figures

    default_figures: ClassVar[tuple[str, ...]]
    """Those that are drawn where nothing is said."""

    def check_film(self) -> None:
        """Raise `NoFilm` where ``figures.py`` has no ``film``."""
        if not hasattr(self.part("figures"), "film"):
            from vibro_cli.figures.film import NoFilm

            raise NoFilm(f'found system = "{self.name}", expected a system that has films')

    def film(self, run: StoredRun, times: NDArray[np.float64]) -> Frames:
        """Return what a film shows of a run at the times (s) of its frames, see ``figures.py``.

        Raises `NoFilm` where there is none.
        """
        self.check_film()
        frames: Frames = self.part("figures").film(run, times)
        return frames

    def figure_width(self, system: Any) -> str:
        """Return how wide the figures of a run are drawn, ``"single"`` or ``"double"``."""
        return "single"

    # Reports and `vibro check`: report/, commands/.

    papers: ClassVar[tuple[str, ...]] = ()
    """Letters of the papers that the system is from, see report/words.py."""

    @property
    def shown_of_papers(self) -> ShownOfPapers:
        """What of the papers is shown by which command: ``SHOWN`` of ``papers.py``.

        Nothing without that module.
        """
        if not self.has_part("papers"):
            return ShownOfPapers({})
        shown: ShownOfPapers = self.part("papers").SHOWN
        return shown

    @abstractmethod
    def method(self, scenario: Mapping[str, Any]) -> str:
        """Return how a scenario (its plain values) is solved, in a sentence or two."""

    def report(self, run: StoredRun, name: str, beside: Path) -> dict[str, Any]:
        """Return what a report says of a run, see report/content.py."""
        from vibro_cli.report.content import section

        return section(run, name, beside)

    def understood(self, scenario: Any, system: Any) -> dict[str, Any]:
        """Return what a scenario means, as plain values, see systems/describe.py."""
        from vibro_cli.systems.describe import understood

        return understood(scenario, system, self.warnings(scenario, system))

    def understood_lines(self, found: dict[str, Any]) -> Iterator[str]:
        """Return that as lines of text."""
        from vibro_cli.scenario.fields import settings
        from vibro_cli.systems.describe import lines_of

        return lines_of(found, partial(settings, self.model), self.body_lines)

    def body_lines(self, body: dict[str, Any]) -> Iterator[str]:
        """Return what more was understood of a body, as lines of text."""
        return iter(())

    has_orbits: ClassVar[bool] = False
    """Whether periodic orbits are looked for, and numbers fitted, with its tangent maps."""
    has_comparisons: ClassVar[bool] = False
    """Whether portraits of a few bodies can be drawn over one another, on one trace."""
    has_families: ClassVar[bool] = False
    """Whether portraits can be drawn over a range of a parameter: by ``family_type``, the type of a
    body's portrait, and ``family_figure`` of ``portrait.py``."""

    def portrait(
        self, system: Any, width: str, drawn: Collection[int]
    ) -> tuple[dict[str, Any], dict[str, Figure]]:
        """Return what a portrait without a run shows, and figures by the stems of their files.

        Those of the bodies `drawn` (from 1); bodies that are alike share theirs. It is from
        ``portrait`` of ``portrait.py``. Raises `NoPortrait` where there is none.
        """
        if not self.has_part("portrait"):
            raise NoPortrait(f'found system = "{self.name}", expected a system that has portraits')
        found: tuple[dict[str, Any], dict[str, Figure]]
        found = self.part("portrait").portrait(system, width, drawn)
        return found

    def portrait_lines(self, found: dict[str, Any]) -> Iterator[str]:
        """Return what a portrait shows as lines of text, of a body ``point_lines`` tells it."""
        for body in found["bodies"]:
            yield f"ball {body['ball']}: {body['body']}, r = {body['radius']:g} m: {body['type']}"
            yield from self.part("portrait").point_lines(body)
