"""Parts as files written group by group: complete, and identical in memory and on the disk."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from vibro_cli.grids.chunk_writer import _PAGE, PartFile
from vibro_cli.storage.files import MemoryFile
from vibro_cli.storage.tables import parquet_options

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


def written() -> bytes:
    """A file of all groups."""
    file = PartFile(SCHEMA, ["n"], MemoryFile([]))
    for number, lengths in enumerate(GROUPS):
        file.add(batches_of(lengths, number))
    return bytes(file.finish())


def test_rows_come_back_in_their_groups() -> None:
    content = written()
    read = pq.ParquetFile(pa.BufferReader(content))
    assert [read.metadata.row_group(n).num_rows for n in range(4)] == [sum(g) for g in GROUPS]
    expected = [b for number, lengths in enumerate(GROUPS) for b in batches_of(lengths, number)]
    assert read.read().equals(pa.Table.from_batches(expected))


def test_metadata_may_be_larger_than_the_rows() -> None:
    """As of a grid over a trace of 8,000 arcs, which failed: `Write out of bounds`."""
    definition = "arcs".ljust(3_000_000, ".")
    schema = SCHEMA.with_metadata({"vibro:grid": definition})
    file = PartFile(schema, ["n"], MemoryFile([]))
    (rows,) = batches_of([2], 1)
    file.add([rows.replace_schema_metadata({"vibro:grid": definition})])
    read = pq.read_table(pa.BufferReader(bytes(file.finish())))
    assert read.schema.metadata[b"vibro:grid"].decode() == definition
    assert read.num_rows == 2


def test_the_bytes_are_those_of_a_file_on_the_disk(tmp_path: Path) -> None:
    path, options = tmp_path / "part.parquet", parquet_options(SCHEMA)
    writer = pq.ParquetWriter(path, SCHEMA, write_statistics=["n"], data_page_size=_PAGE, **options)
    with writer:
        for number, lengths in enumerate(GROUPS):
            group = pa.Table.from_batches(batches_of(lengths, number))
            writer.write_table(group, row_group_size=group.num_rows)
    assert written() == path.read_bytes()
