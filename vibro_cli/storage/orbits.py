"""The folder of periodic orbits: their table, the scenario, a figure."""

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
    with new_folder(target, check_orbit_folder) as folder:
        for name, content in files.items():
            folder.write(name, content)
        folder.write(MANIFEST_NAME, json_bytes(manifest("orbit", files, {})))
