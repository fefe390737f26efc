"""Folders of figures: of a portrait with its table and scenario, of basins, of a report."""

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vibro_cli.storage.files import new_folder
from vibro_cli.storage.provenance import MANIFEST_NAME, check_replaceable, json_bytes, manifest

if TYPE_CHECKING:
    from vibro_cli.scenario.base import AnyScenario

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
