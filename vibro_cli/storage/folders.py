"""The folders of results: of one run, of a fit, of periodic orbits, of a portrait, of figures.

Each has its tables and numbers, the scenario where there is one, and its figures.
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
from vibro_cli.errors import VibroError
from vibro_cli.storage.files import (
    MANIFEST_NAME,
    FolderRefused,
    NewFolder,
    abandoned_parts,
    check_replaceable,
    differences,
    entry,
    json_bytes,
    json_of,
    manifest_of,
    new_folder,
    read_manifest,
    refusal,
    write_folder,
)
from vibro_cli.storage.tables import (
    Counted,
    GrowingTable,
    Origin,
    parquet_bytes,
    to_arrow,
)
from vibro_cli.systems import system_named
from vibro_cli.systems.columns import Table, count, flag, number, word
from vibro_cli.systems.contract import Columns

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
    """Raise `FolderRefused` unless the results of a scenario may take the place of a folder.

    They may where there is nothing or a run of the same scenario; with `force`, a run of any. The
    `hint` says how to go on where they may not.
    """
    check_replaceable(folder, "run")
    if force or read_manifest(folder) is None:
        return
    found = differences(
        json_of(folder / SCENARIO_NAME), json.loads(json_bytes(scenario.resolved()))
    )
    if found:
        raise FolderRefused(*refusal(f"{folder} holds a run with other parameters", found, hint))


def origin_of(scenario: AnyScenario) -> Origin:
    """Scenario and program version, as they stand in the metadata of every table."""
    return Origin(scenario.resolved(), __version__)


def arrow_table(name: str, columns: Columns, scenario: AnyScenario) -> pyarrow.Table:
    """A table of a run ("collisions", "summary", …) in arrow form."""
    table = system_named(scenario.system).table(name, columns)
    return to_arrow(table, columns, origin_of(scenario))


def write_run(
    run: Run,
    scenario: AnyScenario,
    target: Path,
    figures: Mapping[str, bytes],
    force: bool = False,
) -> None:
    """Write the folder of a run, whole or not at all; `figures` are files' names and contents.

    Raises `FolderRefused` when `target` is there and is no run of ours, or one of another scenario
    (which `force` allows), and `OSError` when it cannot be written.
    """
    with streamed_folder(scenario, target, force, "force=True replaces it") as folder:
        for table in run.kind.tables():
            rows = None if table.file == "summary" else run.table(table.file)
            if rows is not None:
                folder.add(table.file, rows)
        folder.finish(run, figures)


class StreamedFolder:
    """The folder of a run in the making, into which the rows of its tables are put as they come."""

    def __init__(self, folder: NewFolder, scenario: AnyScenario) -> None:
        self._folder = folder
        self._scenario = scenario
        self._files = ExitStack()
        self._tables: dict[str, tuple[GrowingTable, Counted]] = {}
        self._entries: dict[str, Any] = {}

    def add(self, name: str, rows: Columns) -> None:
        """Add rows to a table; raises `OSError` when they cannot be written."""
        file = f"{name}.parquet"
        with self._folder.naming(file):
            if name not in self._tables:
                table = system_named(self._scenario.system).table(name, rows)
                counted = Counted(self._files.enter_context(self._folder.growing(file)))
                growing = GrowingTable(counted, table, origin_of(self._scenario))
                self._tables[name] = growing, counted
            self._tables[name][0].add(rows)

    def end_tables(self) -> Path:
        """Write the ends of the tables; return the folder in the making; else as :meth:`add`."""
        for name, (table, file) in self._tables.items():
            with self._folder.naming(f"{name}.parquet"):
                table.finish()
                self._entries[f"{name}.parquet"] = file.entry()
        self._tables = {}
        self._files.close()
        return self._folder.path

    def finish(
        self, run: Streamed | Run, figures: Mapping[str, bytes], undrawn: Sequence[str] = ()
    ) -> None:
        """Write all that is not written yet; else as :meth:`add`.

        `undrawn` are kinds of figures that a signal did not wait for: a continuation draws them.
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
            if name != SCENARIO_NAME:  # there since the start
                self._folder.write(name, content)
            self._entries[name] = entry(content)
        details = {"engine": run.engine} | ({"undrawn": list(undrawn)} if undrawn else {})
        self._folder.write(MANIFEST_NAME, json_bytes(manifest_of("run", self._entries, details)))

    def close(self) -> None:
        """Close what is open."""
        for table, _ in self._tables.values():
            table.abandon()
        self._files.close()


@contextmanager
def streamed_folder(
    scenario: AnyScenario, target: Path, force: bool, hint: str = BY_OPTIONS
) -> Iterator[StreamedFolder]:
    """Make the folder of a run, whole or not at all: the block fills it.

    Raises as :func:`write_run`. The scenario is there first, so that a part that is left of a
    process that was killed tells what is to be solved.
    """
    check = partial(check_run_folder, scenario=scenario, force=force, hint=hint)
    first = {SCENARIO_NAME: json_bytes(scenario.resolved())}
    with (
        new_folder(target, check, first) as folder,
        closing(StreamedFolder(folder, scenario)) as made,
    ):
        yield made


class NotContinuable(VibroError):
    """A folder holds no run that can be continued; the message says which and why."""


@dataclass(frozen=True)
class EarlierRun:
    """What a folder keeps of a run for its continuation."""

    scenario: Path
    """File of the resolved scenario."""
    checkpoint: dict[str, Any]
    manifest: dict[str, Any]


def scenario_of_killed_run(folder: Path) -> Path | None:
    """The scenario of a run that was killed on its way to a folder, begun after the one there."""
    there = folder / SCENARIO_NAME
    begun = there.stat().st_mtime_ns if there.is_file() else 0
    for part in reversed(abandoned_parts(folder)):
        scenario = part / SCENARIO_NAME
        if scenario.is_file() and scenario.stat().st_mtime_ns > begun:
            return scenario
    return None


def read_earlier_run(folder: Path) -> EarlierRun:
    """The run of a folder, to be continued; its files are held to the manifest's checksums.

    Raises `NotContinuable` when the folder is no run of ours, was written by another version of the
    program, or has changed since; `OSError` when a file cannot be read.
    """
    found = read_manifest(folder)
    if not folder.exists():
        there = Path("outputs") / folder
        hint = f" (did you mean {str(there)!r}?)" if there.is_dir() else ""
        raise NotContinuable(
            f"{folder} does not exist{hint}; expected a folder that `vibro run` wrote"
        )
    if found is None or not found["schema"].startswith("vibro-run/"):
        raise NotContinuable(f"{folder} is no vibro run; expected a folder that `vibro run` wrote")
    version = found.get("program", {}).get("version")
    if version != __version__:
        raise NotContinuable(
            f"{folder} was written by vibro {version}; expected {__version__}, this program"
        )
    content: dict[str, bytes] = {}
    for name in (SCENARIO_NAME, CHECKPOINT_NAME):
        content[name] = (folder / name).read_bytes()
        if entry(content[name])["sha256"] != found["files"].get(name, {}).get("sha256"):
            raise NotContinuable(f"{folder / name} is not as it was written (SHA-256)")
    return EarlierRun(folder / SCENARIO_NAME, json.loads(content[CHECKPOINT_NAME]), found)


RESIDUALS = Table(
    "residuals",
    "one measured impact",
    (
        count("n", "number of the impact in the motion, from 1"),
        number("t", "s", "measured instant"),
        number("noise", "s", "its standard deviation, given or from the residuals"),
        number("residual", "s", "measured less computed instant"),
        number("first", "s", "the same before the fit (null: no such impact)", True),
    ),
)


def orbits(balls: int) -> Table:
    """The table of periodic orbits of some bodies."""
    states = [
        column
        for ball in range(1, balls + 1)
        for column in (
            count(f"arc_{ball}", f"piece that body {ball} starts on, from 1"),
            number(
                f"position_{ball}", "", f"angle (rad) of body {ball}, or distance (m) on a line"
            ),
            number(f"speed_{ball}", "m/s", f"signed speed of the centre of body {ball}"),
        )
    ]
    columns = (
        number("value", "", "number of the scenario that was varied (null for one orbit)", True),
        word(
            "special",
            "doubling, fold, exchange, torus, or how it ends: bound, halving, grazing, …",
            nullable=True,
        ),
        number("period", "s", "period"),
        number("energy", "J", "energy, potential from the level of the trace's left end"),
        number("residual", "", "distance of end and start as a share of the state"),
        number("multiplier", "", "size of the largest multiplier"),
        flag("stable", "whether no multiplier is larger than one"),
        number("least_speed", "m/s", "least speed of approach of an impact or at a wall"),
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
) -> None:
    """Write the folder of a fit, orbits, a portrait, basins or figures, whole or not at all.

    The `kind` is ``fit``, ``orbit``, ``portrait``, ``basins`` or ``figures``; `figures` are names
    and contents of its pictures. Beside them there may be the scenario, a record of plain values
    under the name of the kind, and a table of residuals or orbits.

    Raises `FolderRefused` when `target` is there and is none of ours, `OSError` when it cannot be
    written.
    """
    files = {} if record is None else {f"{kind}.json": json_bytes(record)}
    if scenario is not None:
        files[SCENARIO_NAME] = json_bytes(scenario.resolved())
    if table is not None:
        files[f"{table.name}.parquet"] = parquet_bytes(table.to_arrow())
    files |= figures
    write_folder(kind, target, files, {})
