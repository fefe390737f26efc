"""The folder of one run: its tables, summary, checkpoint, resolved scenario and figures."""

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vibro_cli import __version__
from vibro_cli.storage.files import new_folder
from vibro_cli.storage.provenance import MANIFEST_NAME, check_replaceable, json_bytes, manifest
from vibro_cli.storage.schema import table_named
from vibro_cli.storage.tables import Origin, parquet_bytes, to_arrow

if TYPE_CHECKING:
    import pyarrow

    from vibro_cli.scenario import Scenario
    from vibro_cli.simulation.run import Run

_TABLES = ("collisions", "events", "summary", "motion")

check_run_folder = partial(check_replaceable, kind="run")


def origin_of(scenario: "Scenario") -> Origin:
    """Scenario and program version, as they stand in the metadata of every table."""
    return Origin(scenario.resolved(), __version__)


def run_table(run: "Run", name: str, origin: Origin) -> "pyarrow.Table":
    """A table of a run ("collisions", "events", "summary", "motion") in arrow form."""
    columns: Mapping[str, Any] = getattr(run, name)
    return to_arrow(table_named(name, list(columns)), columns, origin)


def run_files(run: "Run", scenario: "Scenario") -> dict[str, bytes]:
    """Every file of a run except its figures: name to content."""
    origin = origin_of(scenario)
    files = {}
    for name in _TABLES:
        if getattr(run, name) is not None:  # motion is there only when it was asked for
            files[f"{name}.parquet"] = parquet_bytes(run_table(run, name, origin))
    files["summary.json"] = json_bytes(run.summary_record())
    files["checkpoint.json"] = json_bytes(run.checkpoint())
    files["scenario.json"] = json_bytes(origin.scenario)
    return files


def write_run(run: "Run", scenario: "Scenario", target: Path, figures: Mapping[str, bytes]) -> None:
    """Write the folder of a run, whole or not at all; `figures` are files' names and contents.

    Raises `FolderRefused` when `target` is there and is no run of ours, `OSError` when it cannot be
    written.
    """
    files = {**run_files(run, scenario), **figures}
    with new_folder(target, check_run_folder) as folder:
        for name, content in files.items():
            folder.write(name, content)
        folder.write(MANIFEST_NAME, json_bytes(manifest("run", files, {"engine": run.engine})))
