"""The history of a run: the solver's logs, which a continued run takes up.

One parquet file of a single row: every field of every log is a list, named `log.field`, so that
logs of different lengths stand in one file, whole or not at all. It is written for the program, not
for reading: what it means is in the tables.
"""

import io
from collections.abc import Mapping
from importlib import import_module
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from vibro_cli.numerics.engine import dtype

HISTORY_NAME = "history.parquet"
_SCHEMA = b"history/1"


def history_bytes(logs: Mapping[str, Any]) -> bytes:
    """The logs of a run (structured arrays by name) as a file; equal logs give equal bytes."""
    columns = {}
    for log, rows in logs.items():
        for field in rows.dtype.names:
            flat = np.ascontiguousarray(rows[field]).reshape(-1)
            columns[f"{log}.{field}"] = _list_of_all(flat)
    data = pa.table(columns).replace_schema_metadata({b"vibro:schema": _SCHEMA})
    sink = io.BytesIO()
    pq.write_table(
        data, sink, compression="zstd", compression_level=3, use_dictionary=False,
        write_page_checksum=True, write_statistics=False,
    )  # fmt: skip
    return sink.getvalue()


def _list_of_all(values: Any) -> pa.Array:
    """One list with all the values (put together from buffers: see `storage.tables`)."""
    kind = pa.from_numpy_dtype(values.dtype)
    inner = pa.Array.from_buffers(kind, values.size, [None, pa.py_buffer(values)])
    ends = pa.py_buffer(np.array([0, values.size], dtype=np.int64))
    return pa.Array.from_buffers(pa.large_list(kind), 1, [None, ends], children=[inner])


def records_of(system: str) -> Mapping[str, type]:
    """The records of the logs of a system's runs, by the logs' names."""
    home = "vibro_cli.simulation" if system == "trace" else f"vibro_cli.systems.{system}"
    world = import_module(f"{home}.world")
    return {log: world.RECORDS[log] for log in world.LOGS}


def read_history(content: bytes, system: str = "trace") -> dict[str, Any]:
    """The logs of a run of a system from the bytes of a file, as structured arrays by name.

    Raises `ValueError` for a file that is damaged or of another version.
    """
    try:
        with pq.ParquetFile(io.BytesIO(content), page_checksum_verification=True) as file:
            data = file.read()
    except (OSError, pa.ArrowException) as error:
        raise ValueError(f"{HISTORY_NAME} is damaged") from error
    types = {log: dtype(record) for log, record in records_of(system).items()}
    expected = [f"{log}.{field}" for log, kind in types.items() for field in kind.names]
    metadata = data.schema.metadata or {}
    if data.column_names != expected or metadata.get(b"vibro:schema") != _SCHEMA:
        raise ValueError(f"{HISTORY_NAME} was written by another version")
    return {log: _rows(data, log, kind) for log, kind in types.items()}


def _rows(data: pa.Table, log: str, kind: Any) -> Any:
    """One log as a structured array."""
    columns = {
        field: data[f"{log}.{field}"].combine_chunks().values.to_numpy() for field in kind.names
    }
    rows = np.zeros(columns[kind.names[0]].size, dtype=kind)
    for field, values in columns.items():
        rows[field] = values.reshape(rows[field].shape)
    return rows
