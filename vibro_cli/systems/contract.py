"""The interface of a system: one object with everything that differs between systems.

A system is a folder of this package. Its ``__init__`` defines one object, ``SYSTEM``, whose class
derives from :class:`System` and imports heavy modules only on use. Objects in modules of a fixed
name, such as ``FIGURES`` in ``figures.py``, are found without being named in the class. Code
outside the folder never tests the name or the type of a system; it calls this object.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from itertools import pairwise
from typing import TYPE_CHECKING, Any, ClassVar, Generic, NamedTuple, Protocol, TypeVar

if TYPE_CHECKING:
    from pathlib import Path

    import numpy as np
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from vibro_cli.compile.kernel import Kernel, Overrides
    from vibro_cli.figures.film import Frames
    from vibro_cli.figures.kinds import Kind
    from vibro_cli.grids.document import Grid
    from vibro_cli.grids.solving import Solver
    from vibro_cli.scenario.base import AnyScenario
    from vibro_cli.storage.stored import StoredRun
    from vibro_cli.systems.columns import Table
    from vibro_cli.systems.driver import Driver, EventLoop
    from vibro_cli.systems.request import Limits, OutputRequest, Sampling
    from vibro_cli.systems.run import Gathered, Stretch, Stretches
    from vibro_cli.systems.tables import ImpactRows

Columns = dict[str, Any]
"""Columns of equal length, by name."""
Document = dict[str, Any]
"""A scenario as a user writes it, as plain data."""
Sink = Callable[[str, Columns], None]
"""Receives the name of a table and further rows, as columns; words are given as integer codes."""


PaperRow = tuple[str, str, str, str]
"""Place in a paper, its statement, the command that reproduces it, where to find the result."""


class ShownOfPapers(NamedTuple):
    """What a system reproduces from the papers, for `vibro help papers`."""

    rows: Mapping[str, Sequence[PaperRow]]
    """By letter of the paper, in the order of the paper."""
    symbols: Sequence[tuple[str, str, str]] = ()
    """Symbol in the papers, term in this project, unit."""


class TimedScene(NamedTuple):
    """A scene whose run time `vibro bench` measures."""

    document: Document
    parts: tuple[str, ...] = ("systems",)
    """Parts of the benchmark: ``"systems"`` times the event loop, ``"command"`` whole commands."""
    share: int = 1
    """Divisor of the number of impacts, for scenes with slow impacts."""


class Tables(Protocol):
    """Makes the tables of a run, stretch by stretch."""

    motion: Gathered | None
    """The motion of the run, if figures need it and the system keeps it."""
    sampling: Sampling | None
    """The instants of the motion table, if it is made."""
    tangents: Any
    """The tangent map (``systems.tangents.TangentMap``) if exponents are requested, or None."""

    def take(self, stretch: Stretch) -> None:
        """Pass the rows of a stretch to the sink; the last stretch has the cause of the end."""

    def summary(self) -> Columns:
        """Return the columns of the summary (one row) once the run has ended."""


class Trajectory(Protocol):
    """The motion of all bodies during a stretch of a run, in closed form."""

    last: Any
    """State from which the motion of the next stretch continues."""

    def sample(self, instants: Any, side: str = "after") -> Columns:
        """Return the columns of the motion table: one row per body at each instant (s).

        `instants` is an array of shape (n,); outside the stretch its first and last flights are
        extended. `side`, "after" or "before", selects the state at the very instant of an event;
        any other value raises ValueError.
        """


class Flights(Protocol):
    """The motion of a finished run on a trace, flight by flight."""

    @property
    def system(self) -> Any:
        """The system that was solved."""

    def flights(self) -> Columns:
        """Return all flights of all bodies on a trace: start, end and why each one ended."""

    def look_at(self, rows: Any) -> None:
        """Announce the flights, as rows of their table, whose curves will be requested."""

    def flight_curve(self, index: Any, count: Any, lasts: float = math.inf) -> tuple[Any, Any, Any]:
        """Return times (s), positions and rates at points of flights, see ``systems.run.Run``."""


class Motion(Flights, Protocol):
    """The motion of a finished run, whose logs need not be kept."""

    @property
    def state(self) -> dict[str, Any]:
        """The complete state of the run after its last event."""

    def sample(self, times: Any, side: str = "after", extrapolate: bool = False) -> Columns:
        """Return the columns of the motion table: one row per body at each time (s)."""


class ImpactLog(NamedTuple):
    """A table of impacts and the log from which it is made."""

    log: str
    table: Table
    rows: type[ImpactRows]
    """Rows of the log, with the values of the table's columns."""
    title: str = "Impacts"
    """Heading of the table in a report."""
    words: str = "impacts"
    """Noun for the rows, printed after their number."""
    none: str = "was no impact of two bodies"
    """End of the sentence "There ..." that stands for an empty table."""


Found = TypeVar("Found")


class Part(Generic[Found]):
    """Attribute of a system: an object of a fixed name in a module of its folder."""

    def __init__(self, module: str, name: str, without: Found | None = None) -> None:
        """Let `without`, if given, stand for the object in a system that has no such module."""
        self._module, self._name, self._without = module, name, without

    def __get__(self, system: System, owner: type) -> Found:
        if self._without is not None and not system.has_part(self._module):
            return self._without
        found: Found = getattr(system.part(self._module), self._name)
        return found


class System(ABC):
    """Everything that differs between systems."""

    name: ClassVar[str]
    """Value of the key ``system`` in scenarios."""

    def part(self, module: str) -> Any:
        """Return a module of the system's folder."""
        return import_module(f"vibro_cli.systems.{self.name}.{module}")

    def has_part(self, module: str) -> bool:
        """Return whether the system's folder has a module of this name."""
        return find_spec(f"vibro_cli.systems.{self.name}.{module}") is not None

    # From the user's scenario to the system to solve: scenario/, assemble.py.

    model: Part[type[AnyScenario]] = Part("scenario", "MODEL")
    """The pydantic model of the system's scenarios."""

    def build(self, scenario: Any) -> Any:
        """Build the system to solve from a scenario, with ``build`` in ``build.py``.

        Raises ``ScenarioError``, which lists every fault of the scenario.
        """
        return self.part("build").build(scenario)

    def warnings(self, scenario: Any, system: Any) -> tuple[str, ...]:
        """Return warnings about a valid system, one sentence each."""
        from vibro_cli.systems.request import many_samples

        rows = many_samples(scenario.output.step, scenario.stop.time, len(scenario.balls))
        return (*self.mechanics_warnings(scenario, system), *rows)

    def mechanics_warnings(self, scenario: Any, system: Any) -> tuple[str, ...]:
        """Return warnings about the mechanics, one sentence each; by default about the law."""
        from vibro_cli.mechanics.system import law_warnings

        # Any two bodies may meet; if any two differ, so do two consecutive ones.
        return tuple(law_warnings(system, [*pairwise(system.bodies)]))

    def limits(self, scenario: Any) -> Limits:
        """Return the limits at which the run of a scenario stops."""
        from vibro_cli.systems.request import STOPS, Limits

        return Limits(*(getattr(scenario.stop, name, None) for name in STOPS))

    def wanted(self, scenario: Any) -> OutputRequest:
        """Return the outputs that a scenario requests besides the impacts."""
        from vibro_cli.systems.request import OutputRequest

        analysis = getattr(scenario, "analysis", None)
        grown = analysis is not None and analysis.lyapunov
        return OutputRequest(**scenario.output.model_dump(), lyapunov=grown)

    def one_sided(self, scenario: Any) -> bool:
        """Return whether bodies may lift off their support."""
        return False

    # The solver: systems/driver.py, systems/run.py.

    loop: Part[EventLoop] = Part("system", "LOOP")
    """The event loop with its records and logs."""

    @property
    def kernels(self) -> tuple[Kernel, ...]:
        """Kernels that Python calls; those of the trace are listed in programs.py.

        The library is built before numpy is installed: import nothing but kernels here.
        """
        return ()

    flags: ClassVar[tuple[str, ...]] = ()
    """Compiler flags for these kernels, appended to those of all programs."""

    def world(self, system: Any, limits: Limits) -> Any:
        """Return the interpreted records of a system at the start, with empty logs.

        They come from ``make_world`` in ``system.py``.
        """
        return self.part("system").make_world(system, limits)

    def overrides(self, system: Any) -> Overrides:
        """Return the kernels that replace others in this system."""
        from vibro_cli.compile.kernel import NO_OVERRIDES

        return NO_OVERRIDES

    def stretches(self, driver: Driver, stop_time: float | None) -> Stretches:
        """Return the stretches of the run that a driver is about to begin."""
        from vibro_cli.systems.run import Stretches

        return Stretches(self.loop, driver, stop_time)

    def skipped(
        self, clock: Mapping[str, Any], wanted: OutputRequest, end: float
    ) -> tuple[str, ...]:
        """Return which outputs a run with this clock and end (s) lacks, and why."""
        return wanted.left_out(end)

    def solver(self, grid: Grid, engine: str) -> Solver:
        """Return a solver of the points of a grid; by default each point is a separate run."""
        from vibro_cli.grids.solving import RunSolver

        return RunSolver(grid, engine)

    timed_scenes: Part[Mapping[str, TimedScene]] = Part("timed_scenes", "TIMED_SCENES", without={})
    """Benchmark scenes by name."""

    # Tables, see systems/columns.py.

    impact_tables: ClassVar[tuple[str, ...]] = ("collisions",)
    """Names of the tables of impacts, which grids can store."""

    def tables(self) -> tuple[Table, ...]:
        """Return every table with all the columns it may have; in the summary `i` is any body.

        ``OTHER_TABLES`` in ``tables.py`` adds to the impacts, the summary and the exponents.
        """
        from vibro_cli.systems.columns import GROWTH, converging, with_columns

        impacts = [self.impact_table(name) for name in self.impact_tables]
        others = self.part("tables").OTHER_TABLES
        if not self.exponents:
            return (*impacts, *others, self.summary("i"))
        grown = (with_columns(table, *GROWTH) for table in impacts)
        return (*grown, *others, self.summary("i", grown=True), converging("i"))

    def summary(self, bodies: int | str, grown: bool = False) -> Table:
        """Return the summary table for a number of bodies, or for any body, named by a letter.

        ``SUMMARY`` in ``tables.py`` has the columns of the run, ``final_state`` there those of each
        body; `grown` adds Lyapunov exponents.
        """
        from vibro_cli.systems.columns import exponents, with_columns

        part, each, number = self.part("tables"), [bodies], bodies
        if isinstance(bodies, int):
            each, number = [*range(1, bodies + 1)], self.exponents * bodies
        states = [column for body in each for column in part.final_state(body)]
        return with_columns(part.SUMMARY, *states, *exponents(number if grown else 0))

    def table(self, name: str, column_names: Collection[str]) -> Table:
        """Return the table of this name for data with these columns.

        Raises `ValueError` for an unknown name.
        """
        from vibro_cli.systems.columns import GROWTH, converging, with_columns

        if name == "summary":
            # Each body has its final position, or on a trace the piece that it is on.
            bodies = sum(column.startswith(("x_", "arc_")) for column in column_names)
            return self.summary(bodies, grown="lyapunov_1" in column_names)
        if name == "exponents":
            numbers = {column for column in column_names if column.startswith("lyapunov_")}
            return converging(len(numbers - {"lyapunov_error"}))
        if name in self.impact_tables:
            table = self.impact_table(name, column_names)
            return with_columns(table, *GROWTH) if GROWTH[0].name in column_names else table
        for table in self.tables():
            if table.file == name:
                return table
        raise ValueError(f"there is no table {name!r}")

    def impact_table(self, name: str, column_names: Collection[str] | None = None) -> Table:
        """Return a table of impacts for data with these columns, by default all it may have.

        It lacks the columns of ``columns.GROWTH``.
        """
        return self.impact_logs[name].table

    def table_maker(
        self, system: Any, wanted: OutputRequest, names: Collection[str], sink: Sink
    ) -> Tables:
        """Return the maker of these tables of a run and of its summary."""
        from vibro_cli.systems.tables import SystemTables

        return SystemTables(self, system, wanted, names, sink)

    impact_logs: Part[Mapping[str, ImpactLog]] = Part("tables", "IMPACT_LOGS")
    """The tables of impacts by name, with their logs."""

    def impact_log(self, table: str) -> str:
        """Return the name of the log from which a table of impacts is made."""
        return self.impact_logs[table].log

    def events(self, system: Any, logs: Any) -> Columns | None:
        """Return the columns of the table of events from a stretch's logs, or None without one."""
        return None

    def trajectory(self, system: Any, stretch: Stretch, before: Any = None) -> Trajectory:
        """Return the motion in a stretch of a run or in the whole run: ``Motion`` in ``tables.py``.

        `before` is the ``last`` of the preceding stretch's trajectory.
        """
        trajectory: Trajectory = self.part("tables").Motion(system, stretch, before)
        return trajectory

    def long_motion(
        self, system: Any, limits: Limits, rows: Mapping[str, int], interrupted: bool
    ) -> Motion | None:
        """Return the motion of a run that is too long to be kept, or None if it is short enough.

        `rows` are the lengths of its logs when it ended or was `interrupted`.
        """
        from vibro_cli.systems import run

        if sum(rows.values()) <= run.MOST_ROWS:
            return None
        return run.solved_again(self, system, limits, rows, interrupted)  # type: ignore[no-any-return]

    exponents: ClassVar[int] = 0
    """Lyapunov exponents per body: the dimension of its state, or 0 without tangent maps."""

    def time_scale(self, system: Any) -> Any:
        """Return the time scale (s) of tangent maps, with ``time_scale`` in ``system.py``."""
        return self.part("system").time_scale(system)

    # Figures: figures/kinds.py.

    figures: Part[Mapping[str, Kind]] = Part("figures", "FIGURES")
    """The kinds of figure of a run, by name."""

    default_figures: ClassVar[tuple[str, ...]]
    """Kinds of figure that are drawn by default."""

    def check_film(self) -> None:
        """Raise `NoFilm` if ``figures.py`` has no ``film``."""
        if not hasattr(self.part("figures"), "film"):
            from vibro_cli.figures.film import NoFilm

            raise NoFilm(f'found system = "{self.name}", expected a system that has films')

    def film(self, run: StoredRun, times: NDArray[np.float64]) -> Frames:
        """Return the frames of a film of a run at these times (s), from ``figures.py``.

        Raises `NoFilm` if the system has no films.
        """
        self.check_film()
        frames: Frames = self.part("figures").film(run, times)
        return frames

    def figure_width(self, system: Any) -> str:
        """Return the width of the figures of a run, ``"single"`` or ``"double"`` column."""
        return "single"

    # Reports and `vibro check`: report/, commands/.

    papers: ClassVar[tuple[str, ...]] = ()
    """Letters of the papers that describe the system, see report/words.py."""

    shown_of_papers: Part[ShownOfPapers] = Part("papers", "SHOWN", without=ShownOfPapers({}))
    """What is reproduced from the papers, by which commands."""

    @abstractmethod
    def method(self, scenario: Mapping[str, Any]) -> str:
        """Describe in a sentence or two how a scenario (as plain values) is solved."""

    def report(self, run: StoredRun, name: str, beside: Path) -> dict[str, Any]:
        """Return the content of a report on a run, see report/content.py."""
        from vibro_cli.report.content import section

        return section(run, name, beside)

    def understood(self, scenario: Any, system: Any) -> dict[str, Any]:
        """Return what a scenario means as plain values, see systems/describe.py."""
        from vibro_cli.systems.describe import understood

        return understood(scenario, system, self.warnings(scenario, system))

    def understood_lines(self, found: dict[str, Any]) -> Iterator[str]:
        """Yield the result of :meth:`understood` as lines of text."""
        from vibro_cli.scenario.fields import settings
        from vibro_cli.systems.describe import lines_of

        return lines_of(found, partial(settings, self.model), self.body_lines)

    def body_lines(self, body: dict[str, Any]) -> Iterator[str]:
        """Yield further lines of text on a body."""
        return iter(())

    has_orbits: ClassVar[bool] = False
    """Whether its tangent maps support the search for periodic orbits and the fit of parameters."""
    has_comparisons: ClassVar[bool] = False
    """Whether the portraits of several bodies on one trace can be overlaid."""
    has_families: ClassVar[bool] = False
    """Whether portraits can be drawn over a range of a parameter, with ``family_type`` (the type of
    a body's portrait) and ``family_figure`` in ``portrait.py``."""

    def portrait(
        self, system: Any, width: str, drawn: Collection[int]
    ) -> tuple[dict[str, Any], dict[str, Figure]]:
        """Return the data of a portrait without a run, and its figures by file stem.

        Figures are drawn for the bodies `drawn` (from 1); identical bodies share one. Calls
        ``portrait`` in ``portrait.py``; raises `NoPortrait` if the system has none.
        """
        if not self.has_part("portrait"):
            from vibro_cli.errors import NoPortrait

            raise NoPortrait(f'found system = "{self.name}", expected a system that has portraits')
        found: tuple[dict[str, Any], dict[str, Figure]]
        found = self.part("portrait").portrait(system, width, drawn)
        return found

    def portrait_lines(self, found: dict[str, Any]) -> Iterator[str]:
        """Yield a portrait as lines of text; ``point_lines`` describes the points of a body."""
        for body in found["bodies"]:
            yield f"ball {body['ball']}: {body['body']}, r = {body['radius']:g} m: {body['type']}"
            yield from self.part("portrait").point_lines(body)
