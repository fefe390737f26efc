"""The folder of a fit: its numbers, the residuals, the fitted scenario, a figure."""

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vibro_cli.storage.files import new_folder
from vibro_cli.storage.provenance import MANIFEST_NAME, check_replaceable, json_bytes, manifest
from vibro_cli.storage.runs import SCENARIO_NAME, origin_of
from vibro_cli.storage.tables import parquet_bytes, to_arrow
from vibro_cli.systems.columns import Table, count, number

if TYPE_CHECKING:
    from vibro_cli.scenario.base import AnyScenario

check_fit_folder = partial(check_replaceable, kind="fit")

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


def write_fit(
    scenario: "AnyScenario",
    record: Mapping[str, Any],
    columns: Mapping[str, Any],
    target: Path,
    figures: Mapping[str, bytes],
) -> None:
    """Write the folder of a fit, whole or not at all.

    Parameters
    ----------
    scenario
        With the fitted numbers.
    record, columns
        What ``fit.json`` and ``residuals.parquet`` hold.
    target, figures
        The folder; names and contents of its pictures.

    Raises `FolderRefused` when `target` is there and is none of ours, `OSError` when it cannot be
    written.
    """
    files = {
        "fit.json": json_bytes(record),
        "residuals.parquet": parquet_bytes(to_arrow(RESIDUALS, columns, origin_of(scenario))),
        SCENARIO_NAME: json_bytes(scenario.resolved()),
        **figures,
    }
    with new_folder(target, check_fit_folder) as folder:
        for name, content in files.items():
            folder.write(name, content)
        folder.write(MANIFEST_NAME, json_bytes(manifest("fit", files, {})))
