"""Parts as files written group by group: complete, and identical whatever the available space."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from vibro_cli.grids import chunk_writer
from vibro_cli.grids.chunk_writer import PartFile

SCHEMA = pa.schema([("n", pa.int64()), ("t", pa.float64()), ("law", pa.string())])
GROUPS = [[20_000, 0, 7_001], [30_000], [1, 40_000, 12_345], [3]]


def batches_of(lengths: list[int], seed: int) -> list[pa.RecordBatch]:
    rng = np.random.default_rng(seed)
    return [
        pa.record_batch(
            [
                pa.array(np.arange(length)),
                pa.array(rng.normal(size=length), mask=rng.random(length) < 0.1),
                pa.array(rng.choice(["hedrih", "translational"], length).tolist(), pa.string()),
            ],
            schema=SCHEMA,
        )
        for length in lengths
    ]


def written() -> tuple[bytes, list[int]]:
    """A file of all groups, and the sizes of the rooms that were asked for."""
    sizes: list[int] = []

    def room(size: int) -> Any:
        sizes.append(size)
        return np.empty(size, dtype=np.uint8)

    file = PartFile(room, SCHEMA, ["n"])
    for number, lengths in enumerate(GROUPS):
        file.add(batches_of(lengths, number))
    return bytes(file.finish()), sizes


def test_rows_come_back_in_their_groups() -> None:
    content, sizes = written()
    assert len(sizes) == 1
    read = pq.ParquetFile(pa.BufferReader(content))
    assert [read.metadata.row_group(n).num_rows for n in range(4)] == [sum(g) for g in GROUPS]
    expected = [b for number, lengths in enumerate(GROUPS) for b in batches_of(lengths, number)]
    assert read.read().equals(pa.Table.from_batches(expected))


def test_metadata_may_be_larger_than_the_rows() -> None:
    """As of a grid over a trace of 8,000 arcs, which failed: `Write out of bounds`."""
    definition = "arcs".ljust(3_000_000, ".")
    schema = SCHEMA.with_metadata({"vibro:grid": definition})
    file = PartFile(lambda size: np.empty(size, dtype=np.uint8), schema, ["n"])
    (rows,) = batches_of([2], 1)
    file.add([rows.replace_schema_metadata({"vibro:grid": definition})])
    read = pq.read_table(pa.BufferReader(bytes(file.finish())))
    assert read.schema.metadata[b"vibro:grid"].decode() == definition
    assert read.num_rows == 2


def test_the_bytes_do_not_depend_on_how_often_it_moved(monkeypatch: pytest.MonkeyPatch) -> None:
    whole, _ = written()
    monkeypatch.setattr(chunk_writer, "_GROUPS_AT_FIRST", 1)
    moved, sizes = written()
    assert len(sizes) > 1
    assert moved == whole
