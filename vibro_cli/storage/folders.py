"""Folders of a fit, of periodic orbits, of a portrait, of basins and of a report's figures.

Each has its tables and numbers, the scenario where there is one, and its figures.
"""

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vibro_cli.storage.files import new_folder
from vibro_cli.storage.provenance import MANIFEST_NAME, check_replaceable, json_bytes, manifest
from vibro_cli.storage.runs import SCENARIO_NAME, origin_of
from vibro_cli.storage.tables import parquet_bytes, to_arrow
from vibro_cli.systems.columns import Column, Table, count, flag, number

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
    _write(files, target, "fit")


check_orbit_folder = partial(check_replaceable, kind="orbit")


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
        Column(
            "special",
            "string",
            "",
            "doubling, fold, exchange, or how the family ends: bound, grazing, coincidence, …",
            nullable=True,
        ),
        number("period", "s", "period"),
        number("energy", "J", "energy, potential from the level of the trace's left end"),
        number("residual", "", "distance of end and start as a share of the state"),
        number("multiplier", "", "size of the largest multiplier"),
        flag("stable", "whether no multiplier is larger than one"),
        number("least_speed", "m/s", "least speed of approach of an impact or at a wall"),
        Column("word", "string", "", "events of a period, in order"),
        *states,
    )
    return Table("orbits", "one periodic orbit", columns)


def write_orbits(
    scenario: "AnyScenario", columns: Mapping[str, Any], target: Path, figures: Mapping[str, bytes]
) -> None:
    """Write the folder of orbits, whole or not at all; `figures` are names and contents.

    Raises `FolderRefused` when `target` is there and is none of ours, `OSError` when it cannot be
    written.
    """
    table = orbits(len(scenario.balls))
    files = {
        "orbits.parquet": parquet_bytes(to_arrow(table, columns, origin_of(scenario))),
        SCENARIO_NAME: json_bytes(scenario.resolved()),
        **figures,
    }
    _write(files, target, "orbit")


check_portrait_folder = partial(check_replaceable, kind="portrait")
check_basins_folder = partial(check_replaceable, kind="basins")


def write_portraits(
    scenario: "AnyScenario", found: Mapping[str, Any], target: Path, figures: Mapping[str, bytes]
) -> None:
    """Write the folder of a portrait, whole or not at all; `figures` are names and contents.

    Raises `FolderRefused` when `target` is there and is no portrait of ours, `OSError` when it
    cannot be written.
    """
    files = {
        "portrait.json": json_bytes(found),
        "scenario.json": json_bytes(scenario.resolved()),
        **figures,
    }
    _write(files, target, "portrait")


def write_basins(found: Mapping[str, Any], target: Path, figures: Mapping[str, bytes]) -> None:
    """Write the folder of the basins of a grid; raises as `write_portraits`."""
    _write({"basins.json": json_bytes(found), **figures}, target, "basins")


def write_figures(figures: Mapping[str, bytes], target: Path) -> None:
    """Write a folder of figures, whole or not at all; raises as `write_portraits`."""
    _write(figures, target, "figures")


def _write(files: Mapping[str, bytes], target: Path, kind: str) -> None:
    with new_folder(target, partial(check_replaceable, kind=kind)) as folder:
        for name, content in files.items():
            folder.write(name, content)
        folder.write(MANIFEST_NAME, json_bytes(manifest(kind, files, {})))
