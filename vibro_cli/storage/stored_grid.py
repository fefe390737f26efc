"""A grid as its folder has it: axes, summaries, impacts, without solving anything again."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from vibro_cli.errors import VibroError
from vibro_cli.storage.provenance import check_files, read_manifest

if TYPE_CHECKING:
    import pyarrow

GRID_NAME = "grid.json"
Column = NDArray[Any]


class NotAGrid(VibroError):
    """A folder holds no grid of ours that can be read; the message says why."""


@dataclass(frozen=True)
class StoredGrid:
    """A grid of scenarios, or what there is of it so far."""

    folder: Path
    definition: Mapping[str, Any]
    """What was asked for, as `grid.json` has it."""
    manifest: Mapping[str, Any]
    axes: tuple[str, ...]
    """Key paths of the axes: the names of their columns."""
    units: Mapping[str, str]
    """Units of the columns of the summary."""
    summary: Mapping[str, Column]
    """A row for each point: the axes' values, then the columns of the summary table."""

    @property
    def name(self) -> str:
        """The name of the grid."""
        return str(self.definition["name"])

    @property
    def system(self) -> str:
        """The system of its scenarios."""
        return str(self.definition["scenario"].get("system", "trace"))

    @property
    def shapes(self) -> tuple[str, ...]:
        """Shapes of the pieces of the trace, none for another system."""
        trace = self.definition["scenario"].get("trace", {})
        return tuple(str(piece["shape"]) for piece in trace.get("arcs", ()))

    @property
    def points(self) -> int:
        """Number of points that are there."""
        return len(self.summary["scenario"])

    def table(self, name: str) -> "pyarrow.Table":
        """Return a table of all points, such as ``collisions``.

        Raises ``KeyError`` where the grid has none of that name.
        """
        import pyarrow.dataset as dataset

        parts = [str(part) for part in _parts(self.folder / name)]
        if not parts:
            raise KeyError(f"the grid {self.name} kept no table {name}")
        return dataset.dataset(parts, format="parquet").to_table()

    def impact_columns(self) -> tuple[str, ...]:
        """Return the columns of the table of impacts, none where none was kept."""
        import pyarrow.parquet as parquet

        part = next(iter(_parts(self.folder / "collisions")), None)
        return () if part is None else tuple(parquet.read_schema(part).names)

    def impact_units(self) -> dict[str, str]:
        """Return the units of the columns of numbers of the impacts, by name."""
        import pyarrow.parquet as parquet

        from vibro_cli.storage.tables import units_of_numbers

        part = next(iter(_parts(self.folder / "collisions")), None)
        return {} if part is None else units_of_numbers(parquet.read_schema(part))

    def impacts(self, columns: Sequence[str], scenarios: Column) -> dict[str, Column]:
        """Return some columns of the impacts of some scenarios, in their order."""
        import pyarrow.compute as compute
        import pyarrow.dataset as dataset

        parts = [str(part) for part in _parts(self.folder / "collisions")]
        wanted = compute.field("scenario").isin(scenarios.tolist())
        data = dataset.dataset(parts, format="parquet").to_table(list(columns), filter=wanted)
        return _columns(data)


def is_grid(folder: Path) -> bool:
    """Return whether a folder says that it holds a grid."""
    return (folder / GRID_NAME).is_file()


def open_grid(folder: Path) -> StoredGrid:
    """Read the folder of a grid, all its points or those that are finished.

    Raises `NotAGrid` when it is none of ours, holds no finished point, or when a file of it is
    missing or not as it was written.
    """
    import pyarrow.dataset as dataset

    try:
        definition = json.loads((folder / GRID_NAME).read_bytes())
    except (OSError, ValueError) as error:
        raise NotAGrid(f"{folder} holds no grid: {error}") from error
    manifest = read_manifest(folder)
    if manifest is None or not str(manifest["schema"]).startswith("vibro-grid/"):
        raise NotAGrid(f"{folder} holds no grid of vibro; expected its manifest")
    parts = [str(part) for part in _parts(folder / "summary")]
    if not parts:
        raise NotAGrid(f"{folder} holds no finished point of its grid")
    for damage in check_files(folder, manifest["files"]):
        raise NotAGrid(f"{folder}/{damage}; vibro grid GRID --repair solves it again")
    data = dataset.dataset(parts, format="parquet").to_table()
    names = data.column_names
    return StoredGrid(
        folder=folder,
        definition=definition,
        manifest=manifest,
        axes=tuple(names[names.index("scenario") + 1 : names.index("status")]),
        units={field.name: _unit(field) for field in data.schema},
        summary=_columns(data),
    )


def _parts(folder: Path) -> list[Path]:
    return sorted(folder.glob("part-*.parquet"))


def _unit(field: "pyarrow.Field") -> str:
    return str((field.metadata or {}).get(b"unit", b""), "utf-8")


def _columns(data: "pyarrow.Table") -> dict[str, Column]:
    """The columns as arrays; null is NaN in numbers and None in words."""
    from vibro_cli.storage.tables import as_array

    return {name: as_array(data[name]) for name in data.column_names}
