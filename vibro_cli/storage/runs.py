"""The folder of one run: its tables, summary, checkpoint, resolved scenario and figures."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vibro_cli import __version__
from vibro_cli.storage.files import new_folder
from vibro_cli.storage.history import HISTORY_NAME, history_bytes, read_history
from vibro_cli.storage.provenance import (
    MANIFEST_NAME,
    check_replaceable,
    json_bytes,
    manifest,
    read_manifest,
)
from vibro_cli.storage.schema import table_named
from vibro_cli.storage.tables import Origin, parquet_bytes, to_arrow

if TYPE_CHECKING:
    import pyarrow

    from vibro_cli.api import AnyRun
    from vibro_cli.scenario.systems import AnyScenario

SCENARIO_NAME = "scenario.json"
CHECKPOINT_NAME = "checkpoint.json"
_TABLES = {
    "trace": ("collisions", "events", "summary", "motion"),
    "table": ("collisions", "bounces", "summary", "motion"),
    "springs": ("collisions", "events", "summary", "motion"),
}
"""The tables of a run of each system; motion is there only when it was asked for."""

check_run_folder = partial(check_replaceable, kind="run")


def origin_of(scenario: "AnyScenario") -> Origin:
    """Scenario and program version, as they stand in the metadata of every table."""
    return Origin(scenario.resolved(), __version__)


def run_table(run: "AnyRun", name: str, origin: Origin) -> "pyarrow.Table":
    """A table of a run ("collisions", "summary", …) in arrow form."""
    columns: Mapping[str, Any] = getattr(run, name)
    system = origin.scenario.get("system", "trace")
    return to_arrow(table_named(name, list(columns), system), columns, origin)


def run_files(run: "AnyRun", scenario: "AnyScenario") -> dict[str, bytes]:
    """Every file of a run except its figures: name to content."""
    origin = origin_of(scenario)
    system = origin.scenario.get("system", "trace")
    files = {}
    for name in _TABLES[system]:
        if getattr(run, name) is not None:
            files[f"{name}.parquet"] = parquet_bytes(run_table(run, name, origin))
    files["summary.json"] = json_bytes(run.summary_record())
    files[SCENARIO_NAME] = json_bytes(origin.scenario)
    files[CHECKPOINT_NAME] = json_bytes(run.checkpoint())
    files[HISTORY_NAME] = history_bytes(run.history())
    return files


def write_run(
    run: "AnyRun", scenario: "AnyScenario", target: Path, figures: Mapping[str, bytes]
) -> None:
    """Write the folder of a run, whole or not at all; `figures` are files' names and contents.

    Raises `FolderRefused` when `target` is there and is no run of ours, `OSError` when it cannot be
    written.
    """
    files = {**run_files(run, scenario), **figures}
    with new_folder(target, check_run_folder) as folder:
        for name, content in files.items():
            folder.write(name, content)
        folder.write(MANIFEST_NAME, json_bytes(manifest("run", files, {"engine": run.engine})))


class NotContinuable(Exception):
    """A folder holds no run that can be continued; the message says which and why."""


@dataclass(frozen=True)
class EarlierRun:
    """What a folder keeps of a run for its continuation."""

    scenario: Path
    """File of the resolved scenario."""
    checkpoint: dict[str, Any]
    history: dict[str, Any]


def read_earlier_run(folder: Path) -> EarlierRun:
    """The run of a folder, to be continued; its files are held to the manifest's checksums.

    Raises `NotContinuable` when the folder is no run of ours, was written by another version of the
    program, or has changed since; `OSError` when a file cannot be read.
    """
    found = read_manifest(folder)
    if found is None or not found["schema"].startswith("vibro-run/"):
        raise NotContinuable(f"{folder} is no vibro run; expected a folder that `vibro run` wrote")
    version = found.get("program", {}).get("version")
    if version != __version__:
        raise NotContinuable(
            f"{folder} was written by vibro {version}; expected {__version__}, this program"
        )
    content = {}
    for name in (SCENARIO_NAME, CHECKPOINT_NAME, HISTORY_NAME):
        content[name] = (folder / name).read_bytes()
        if hashlib.sha256(content[name]).hexdigest() != found["files"].get(name, {}).get("sha256"):
            raise NotContinuable(f"{folder / name} is not as it was written (SHA-256)")
    system = json.loads(content[SCENARIO_NAME]).get("system", "trace")
    try:
        history = read_history(content[HISTORY_NAME], system)
    except ValueError as error:
        raise NotContinuable(f"{folder}: {error}") from error
    return EarlierRun(folder / SCENARIO_NAME, json.loads(content[CHECKPOINT_NAME]), history)
