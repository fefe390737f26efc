"""Other programs open the dataset, with its units and strings unchanged."""

from __future__ import annotations

import gc
import json
import os
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.grids.conftest import Write
from vibro_cli import example
from vibro_cli.commands.app import run_command_line
from vibro_cli.interface.grids import open_grid, sweep
from vibro_cli.storage.tables import PartsTable


@pytest.fixture
def folder(small: Write, tmp_path: Path) -> Path:
    arguments = ["grid", str(small(head="chunk_points = 5\n")), "-o", str(tmp_path / "data")]
    assert run_command_line([*arguments, "--set", "stop.collisions=4"]) == 0
    return tmp_path / "data"


def test_pandas(folder: Path) -> None:
    import pandas as pd
    import pyarrow.parquet as pq

    summary = pd.read_parquet(folder / "summary")
    assert summary["scenario"].tolist() == list(range(1, 13))
    assert summary["balls[1].angle"].nunique() == 4
    assert (summary["status"] == "invalid").sum() == 4
    assert summary.loc[summary["status"] == "invalid", "end_time"].isna().all()
    metadata = pq.read_schema(folder / "summary" / "part-000000.parquet").metadata
    units = json.loads(metadata[b"vibro:units"])
    assert list(units) == list(summary.columns)
    assert units["end_time"] == "s"
    collisions = pd.read_parquet(folder / "collisions")
    counts = collisions.groupby("scenario").size()
    expected = summary.set_index("scenario")["collisions"].loc[counts.index]
    assert counts.tolist() == expected.tolist()


def test_polars(folder: Path) -> None:
    import polars as pl

    summary = pl.read_parquet(str(folder / "summary" / "*.parquet"))
    assert summary["scenario"].to_list() == list(range(1, 13))
    assert summary.filter(pl.col("status") == "ok")["end_time"].null_count() == 0
    metadata = pl.read_parquet_metadata(folder / "summary" / "part-000000.parquet")
    assert "vibro:grid" in metadata
    assert json.loads(metadata["vibro:units"])["balls[1].angle"] == "rad"


def test_duckdb(folder: Path) -> None:
    import duckdb

    with duckdb.connect() as base:
        rows = base.sql(
            f"select s.scenario, s.collisions, count(c.n), max(c.energy_loss) "
            f"from '{folder}/summary/*.parquet' s left join '{folder}/collisions/*.parquet' c "
            "using (scenario) where s.status = 'ok' group by all order by all"
        ).fetchall()
        part = folder / "collisions" / "part-000000.parquet"
        ((units,),) = base.sql(
            f"select decode(value) from parquet_kv_metadata('{part}') "
            "where decode(key) = 'vibro:units'"
        ).fetchall()
    assert json.loads(units)["impulse_moment"] == "N m s"
    assert len(rows) == 8
    assert all(told == counted for _, told, counted, _ in rows)


def test_units_are_in_the_metadata(folder: Path) -> None:
    import pyarrow.dataset as ds

    for table, units in {
        "summary": {"balls[1].angle": b"rad", "end_time": b"s", "energy_start": b"J"},
        "collisions": {"t": b"s", "speed_a_pre": b"m/s", "impulse_moment": b"N m s"},
    }.items():
        schema = ds.dataset(folder / table).schema
        assert {name: schema.field(name).metadata[b"unit"] for name in units} == units
        assert all(b"description" in field.metadata for field in schema)


def test_columns_of_a_grid_are_read_as_they_are_asked_for(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Compare with the files as pyarrow reads them directly."""
    import pyarrow.dataset as dataset

    read: list[Any] = []
    really = PartsTable._read

    def spied(table: PartsTable, names: list[str] | None, rows: int | None = None) -> Any:
        read.append(names)
        return really(table, names, rows)

    monkeypatch.setattr(PartsTable, "_read", spied)
    grid = open_grid(folder)
    for table in (grid.summary, grid.collisions):
        read.clear()
        whole = dataset.dataset(folder / table.name, format="parquet").to_table()
        assert (table.rows, list(table)) == (whole.num_rows, whole.column_names)
        assert table["scenario"].tolist() == whole["scenario"].to_pylist()
        assert read == [["scenario"]]
        assert table._repr_html_().count("<tr>") == 1 + 5
        for found in (table.to_arrow(), pickle.loads(pickle.dumps(table)).to_arrow()):
            assert found.equals(whole)
            assert found.schema.equals(whole.schema, check_metadata=True)


def test_a_table_of_a_grid_that_was_replaced_is_not_mixed_with_it(folder: Path) -> None:
    table = open_grid(folder).collisions
    assert len(table["t"]) == table.rows
    part = folder / "collisions" / "part-000000.parquet"
    part.write_bytes(part.read_bytes())
    os.utime(part, ns=(0, 0))
    assert len(table["t"]) == table.rows  # was read before
    with pytest.raises(OSError, match="replaced"):
        table["n"]
    part.unlink()
    with pytest.raises(FileNotFoundError):
        table["n"]


def test_a_table_keeps_the_temporary_folder_of_its_grid() -> None:
    table = sweep(example("one_circle"), {"collision.k": [0.5, 1.0]}, collisions=["t"]).collisions
    gc.collect()
    assert len(table["t"]) == table.rows > 0


def test_a_grid_ended_between_the_tables_of_a_chunk(folder: Path, tmp_path: Path) -> None:
    """Impacts without a summary do not count yet, and every reader says that points are missing."""
    (folder / "summary" / "part-000000.parquet").unlink()
    manifest = json.loads((folder / "manifest.json").read_bytes())
    described = manifest["files"].items()
    manifest["files"] = {name: one for name, one in described if "part-000000" not in name}
    (folder / "manifest.json").write_text(json.dumps(manifest))
    grid = open_grid(folder)
    counts = np.ma.filled(grid.summary["collisions"], 0)
    assert grid.collisions.rows == counts.sum()
    assert set(grid.collisions["scenario"]) <= set(grid.summary["scenario"])
    assert "7 of 12 points are solved so far" in repr(grid)
    page = tmp_path / "page.html"
    assert run_command_line(["report", str(folder), "-o", str(page)]) == 0
    assert "7 of 12 points are solved so far." in page.read_text()


def test_a_damaged_page_of_a_grid_is_told(folder: Path) -> None:
    """One byte has changed by itself: size and date of the file are as before."""
    import pyarrow.parquet as pq

    grid = open_grid(folder)
    tables = grid.summary, grid.collisions
    for table in tables:
        part = folder / table.name / "part-000000.parquet"
        content, times = bytearray(part.read_bytes()), part.stat()
        column = pq.read_metadata(part).row_group(0).column(0)
        begin = column.dictionary_page_offset or column.data_page_offset
        content[begin + column.total_compressed_size - 1] ^= 1
        part.write_bytes(content)
        os.utime(part, ns=(times.st_atime_ns, times.st_mtime_ns))
        with pytest.raises(OSError, match="CRC"):
            table["scenario"]
    with pytest.raises(OSError, match="CRC"):
        grid.stored.summary["scenario"]
