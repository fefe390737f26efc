"""The folders of results: of a run, a fit, periodic orbits, a portrait, basins, figures.

Each holds its tables and numbers, the scenario if any, and figures.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vibro_cli import __version__
from vibro_cli.errors import VibroError, in_command
from vibro_cli.storage.files import (
    MANIFEST_NAME,
    FolderRefused,
    NewFolder,
    abandoned_parts,
    check_files,
    check_replaceable,
    differences,
    entry,
    json_bytes,
    json_of,
    manifest_of,
    new_folder,
    read_manifest,
    refusal,
    results_within,
    write_folder,
)
from vibro_cli.storage.tables import (
    Counted,
    GrowingTable,
    arrow_schema,
    parquet_bytes,
    record_batch,
    to_arrow,
)
from vibro_cli.systems import system_named
from vibro_cli.systems.columns import Table, count, flag, number, word
from vibro_cli.systems.contract import Columns
from vibro_cli.systems.request import CHANGEABLE

if TYPE_CHECKING:
    import pyarrow

    from vibro_cli.scenario.base import AnyScenario
    from vibro_cli.storage import frame
    from vibro_cli.systems.run import Run, Streamed

SCENARIO_NAME = "scenario.json"
CHECKPOINT_NAME = "checkpoint.json"


BY_OPTIONS = "--force replaces it, -o names another folder"


def check_run_folder(
    folder: Path, scenario: AnyScenario, force: bool = False, hint: str = BY_OPTIONS
) -> None:
    """Raise `FolderRefused` unless the run of a scenario may replace a folder.

    It may replace nothing or a run of the same scenario; with `force`, a run of any scenario. The
    `hint` completes the message with a remedy.
    """
    check_replaceable(folder, "run")
    if force or read_manifest(folder) is None:
        return
    found = _changes(folder, scenario)
    if found:
        raise FolderRefused(
            *refusal(f"{folder} holds a run with different parameters", found, hint)
        )


def _changes(folder: Path, scenario: AnyScenario) -> list[str]:
    """Return the differences of a scenario from that of the run in a folder."""
    there = json_of(folder / SCENARIO_NAME)
    return differences(there, json.loads(json_bytes(scenario.resolved())))


def check_figures_folder(folder: Path, of: Any, force: bool) -> None:
    """Raise `FolderRefused` unless figures of runs or a grid, given as plain data, may replace one.

    They may replace nothing or figures of the same; with `force`, figures of anything.
    """
    check_replaceable(folder, "figures")
    there = (read_manifest(folder) or {}).get("of")
    found = [] if force or there is None else differences(there, json.loads(json_bytes(of)))
    if found:
        hint = "--force replaces them, --figures names another folder"
        raise FolderRefused(*refusal(f"{folder} holds figures of others", found, hint))


def goes_as_far(folder: Path, scenario: AnyScenario, end_time: float) -> bool:
    """Return whether a folder holds a run of a scenario that ended at `end_time` (s) or later.

    The scenarios may differ in what a continuation may change.
    """
    summary = json_of(folder / "summary.json")
    if read_manifest(folder) is None or not isinstance(summary, dict):
        return False
    found = _changes(folder, scenario)
    there = summary.get("end_time")
    is_same = all(line.startswith(CHANGEABLE) for line in found)
    return is_same and isinstance(there, float) and there >= end_time


def arrow_table(name: str, columns: Columns, scenario: AnyScenario) -> pyarrow.Table:
    """Return a table of a run ("collisions", "summary", …) as an Arrow table."""
    table = system_named(scenario.system).table(name, columns)
    return to_arrow(table, columns, scenario.resolved())


def write_run(
    run: Run,
    scenario: AnyScenario,
    target: Path,
    figures: Mapping[str, bytes],
    force: bool = False,
) -> None:
    """Write the folder of a run atomically; `figures` maps names of files to contents.

    Raises `FolderRefused` if `target` exists and is not a run of vibro, or is one of another
    scenario (which `force` allows), and `OSError` if it cannot be written.
    """
    with streamed_folder(scenario, target, force, "force=True replaces it") as folder:
        for table in run.kind.tables():
            rows = None if table.file == "summary" else run.table(table.file)
            if rows is not None:
                folder.add(table.file, rows)
        folder.finish(run, figures)


class StreamedFolder:
    """The unfinished folder of a run, to which rows of tables are added as they are computed."""

    def __init__(self, folder: NewFolder, scenario: AnyScenario) -> None:
        self._folder = folder
        self._scenario = scenario
        self._files = ExitStack()
        self._tables: dict[str, tuple[GrowingTable, Counted]] = {}
        self._entries: dict[str, Any] = {}

    def add(self, name: str, rows: Columns) -> None:
        """Add rows to a table; raises `OSError` if they cannot be written."""
        file = f"{name}.parquet"
        table = system_named(self._scenario.system).table(name, rows)
        batch = record_batch(table, rows)
        with self._folder.naming(file):
            if name not in self._tables:
                schema = arrow_schema(table, self._scenario.resolved())
                counted = Counted(self._files.enter_context(self._folder.growing(file)))
                self._tables[name] = GrowingTable(counted, schema), counted
            self._tables[name][0].write([batch])

    def end_tables(self) -> Path:
        """Finish the tables; return the unfinished folder; raises as :meth:`add`."""
        for name, (table, file) in self._tables.items():
            with self._folder.naming(f"{name}.parquet"):
                table.finish()
                self._entries[f"{name}.parquet"] = file.entry()
        self._tables = {}
        self._files.close()
        return self._folder.path

    def finish(
        self, run: Streamed | Run, figures: Mapping[str, bytes], lacking: Mapping[str, Any] = {}
    ) -> None:
        """Write all remaining files; raises as :meth:`add`.

        `lacking` is what a signal prevented and a continuation completes: `undrawn` kinds of
        figures, and samples of the motion, `unsampled_from` a time (s).
        """
        self.end_tables()
        summary = arrow_table("summary", run.summary, self._scenario)
        files = {
            "summary.parquet": parquet_bytes(summary),
            "summary.json": json_bytes(run.summary_record()),
            SCENARIO_NAME: json_bytes(self._scenario.resolved()),
            CHECKPOINT_NAME: json_bytes(run.checkpoint()),
            **figures,
        }
        for name, content in files.items():
            if name != SCENARIO_NAME:  # already written at the start
                self._folder.write(name, content)
            self._entries[name] = entry(content)
        details = {"engine": run.engine, **lacking}
        self._folder.write(MANIFEST_NAME, json_bytes(manifest_of("run", self._entries, details)))

    def close(self) -> None:
        """Close all open files."""
        for table, _ in self._tables.values():
            table.abandon()
        self._files.close()


@contextmanager
def streamed_folder(
    scenario: AnyScenario, target: Path, force: bool, hint: str = BY_OPTIONS
) -> Iterator[StreamedFolder]:
    """Create the folder of a run atomically, filled by the block.

    Raises as :func:`write_run`. The scenario is written first, so that the unfinished folder of a
    killed process says what to solve.
    """
    check = partial(check_run_folder, scenario=scenario, force=force, hint=hint)
    first = {SCENARIO_NAME: json_bytes(scenario.resolved())}
    with (
        new_folder(target, check, first) as folder,
        closing(StreamedFolder(folder, scenario)) as made,
    ):
        yield made


class NotContinuable(VibroError):
    """A folder does not hold a run that can be continued; the message says which and why."""


@dataclass(frozen=True)
class EarlierRun:
    """The stored data of a run that its continuation needs."""

    scenario: Path
    """File of the resolved scenario."""
    checkpoint: dict[str, Any]
    manifest: dict[str, Any]


def scenario_of_killed_run(folder: Path) -> Path | None:
    """Return the scenario file of a killed run for a folder, if newer than the run in it."""
    there = folder / SCENARIO_NAME
    begun = there.stat().st_mtime_ns if there.is_file() else 0
    for part in reversed(abandoned_parts(folder)):
        scenario = part / SCENARIO_NAME
        if scenario.is_file() and scenario.stat().st_mtime_ns > begun:
            return scenario
    return None


def read_earlier_run(folder: Path) -> EarlierRun:
    """Read the run in a folder for continuation, and check its files against the manifest.

    Raises `NotContinuable` if the folder is not a run of vibro, was written by another version of
    the program or with another layout of the state, or has changed since; `OSError` if a file
    cannot be read.
    """
    from vibro_cli.systems.driver import CHECKPOINT_FORMAT

    found = read_manifest(folder)
    if not folder.exists():
        there = Path("outputs") / folder
        hint = f" (did you mean {str(there)!r}?)" if there.is_dir() else ""
        raise NotContinuable(
            f"{folder} does not exist{hint}; expected a folder that `vibro run` wrote"
        )
    if found is None or not found["schema"].startswith("vibro-run/"):
        raise NotContinuable(
            f"{folder} is not a vibro run; expected a folder that `vibro run` wrote"
            f"{results_within(folder)}"
        )
    version = found.get("program", {}).get("version")
    if version != __version__:
        raise NotContinuable(
            f"{folder} was written by vibro {version}; expected {__version__}, this program; "
            f"{_solved_again(folder)}"
        )
    needed, unknown = (SCENARIO_NAME, CHECKPOINT_NAME), {"bytes": 0, "sha256": ""}
    check_intact(folder, {name: found["files"].get(name, unknown) for name in needed})
    checkpoint = json.loads((folder / CHECKPOINT_NAME).read_bytes())
    if checkpoint["format"] != CHECKPOINT_FORMAT:
        raise NotContinuable(
            f"{folder}/{CHECKPOINT_NAME} has format {checkpoint['format']}; expected "
            f"{CHECKPOINT_FORMAT}; {_solved_again(folder)}"
        )
    return EarlierRun(folder / SCENARIO_NAME, checkpoint, found)


def check_intact(folder: Path, described: Mapping[str, Mapping[str, Any]]) -> None:
    """Raise `NotContinuable` if a file of a run, by its entry in the manifest, is not intact."""
    for damage in check_files(folder, described):
        again = "" if damage.file == SCENARIO_NAME else f"; {_solved_again(folder)}"
        raise NotContinuable(f"{folder}/{damage}{again}")


def _solved_again(folder: Path) -> str:
    """Return the end of a message, with the command that writes the run in a folder anew."""
    scenario, target = (in_command(path) for path in (folder / SCENARIO_NAME, folder))
    return f"vibro run {scenario} -o {target} solves it again"


RESIDUALS = Table(
    "residuals",
    "one measured impact",
    (
        count("n", "number of the impact in the motion, from 1"),
        number("t", "s", "measured time"),
        number(
            "noise", "s", "standard deviation of the time, given or estimated from the residuals"
        ),
        number("residual", "s", "measured minus computed time"),
        number("first", "s", "residual before the fit (null: no such impact)", True),
    ),
)


def orbits(varied: str, positions: Sequence[str]) -> Table:
    """Return the table of periodic orbits.

    `varied` is the unit of the varied parameter, `positions` are those of each body's position.
    """
    states = [
        column
        for ball, unit in enumerate(positions, 1)
        for column in (
            count(f"arc_{ball}", f"piece that body {ball} starts on, from 1"),
            number(
                f"position_{ball}", unit, f"angle (rad) of body {ball}, or distance (m) on a line"
            ),
            number(f"speed_{ball}", "m/s", f"signed speed of the centre of body {ball}"),
        )
    ]
    columns = (
        number("value", varied, "value of the varied parameter (null for one orbit)", True),
        word(
            "special",
            "doubling, fold, exchange, torus, or how the family ends: bound, halving, grazing, …",
            nullable=True,
        ),
        number("period", "s", "period"),
        number("energy", "J", "energy, relative to the trace's left end"),
        number("residual", "", "distance between start and end, relative to the size of the state"),
        number("multiplier", "", "largest modulus of a multiplier"),
        flag("stable", "whether no multiplier has a modulus above 1"),
        number("least_speed", "m/s", "least speed of approach at an impact or a wall"),
        word("word", "events of a period, in order"),
        *states,
    )
    return Table("orbits", "one periodic orbit", columns)


def write_results(
    kind: str,
    target: Path,
    figures: Mapping[str, bytes],
    scenario: AnyScenario | None = None,
    record: Mapping[str, Any] | None = None,
    table: frame.Table | None = None,
    **details: Any,
) -> None:
    """Write the folder of a fit, orbits, a portrait, basins or figures atomically.

    The `kind` is ``fit``, ``orbit``, ``portrait``, ``basins`` or ``figures``; `figures` maps names
    of files to contents. Optional are the scenario, a `record` of plain values, stored under the
    name of the kind, a table of residuals or orbits, and further `details` in the manifest.

    Raises `FolderRefused` if `target` exists and is not such a folder of vibro, `OSError` if it
    cannot be written.
    """
    files = {} if record is None else {f"{kind}.json": json_bytes(record)}
    if scenario is not None:
        files[SCENARIO_NAME] = json_bytes(scenario.resolved())
    if table is not None:
        files[f"{table.name}.parquet"] = parquet_bytes(table.to_arrow())
    files |= figures
    write_folder(kind, target, files, details)
