"""Chunks under construction: stretches in any order."""

from __future__ import annotations

import random
import threading
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import hypothesis
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import strategies as st

from tests.grids.conftest import Write
from vibro_cli.grids import chunk_writer, chunks, workers
from vibro_cli.grids.chunk_writer import ChunkWriter, Encoded
from vibro_cli.grids.chunks import Chunks
from vibro_cli.grids.dataset import known_division, opened, verify
from vibro_cli.grids.document import load_grid
from vibro_cli.grids.solving import Solved
from vibro_cli.grids.workers import solve_in_threads
from vibro_cli.storage.files import MemoryFile
from vibro_cli.systems.trace.grid_solver import TraceSolver


def tell(points: int, impacts: int) -> None:
    """Report nothing."""


def contents(made: Encoded) -> dict[str, bytes]:
    return {name: bytes(content) for name, content in made.files.items()}


def test_stretches_come_in_any_order(small: Write, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(chunk_writer, "_ROWS_OF_A_GROUP", 10)
    grid = load_grid(small(), ["stop.collisions=4"])
    whole = Chunks(grid.design.points, grid.design.points, 1)

    def solved() -> list[Solved]:
        solver = TraceSolver(grid, "python")
        return [solver.solve(np.arange(*stretch)) for stretch in whole.stretches(0)]

    writer = ChunkWriter.of(grid, whole, 0, [])
    in_order = [writer.add(number, one) for number, one in enumerate(solved())]
    assert in_order[:-1] == [None] * (len(in_order) - 1)
    assert in_order[-1] is not None
    read = pq.ParquetFile(pa.BufferReader(contents(in_order[-1])["collisions/part-000000.parquet"]))
    sizes = [read.metadata.row_group(n).num_rows for n in range(read.num_row_groups)]
    assert len(sizes) > 1
    assert all(10 <= size < 20 for size in sizes[:-1])

    others: list[Encoded | None] = []
    mixed = list(enumerate(solved()))
    random.Random(5).shuffle(mixed)
    writer = ChunkWriter.of(grid, whole, 0, [])
    workers = [
        threading.Thread(
            target=lambda some: others.extend(writer.add(*one) for one in some), args=(some,)
        )
        for some in (mixed[:4], mixed[4:8], mixed[8:])
    ]
    for thread in workers:
        thread.start()
    for thread in workers:
        thread.join()
    (made,) = [one for one in others if one is not None]
    assert contents(made) == contents(in_order[-1])


@hypothesis.given(
    st.lists(st.floats(0.0, 60.0), min_size=1, max_size=300),
    st.integers(1, 4_000_000),
)
def test_parts_are_cut_where_the_impacts_are(density: list[float], points: int) -> None:
    sizes = chunks._cut(points, np.array(density))
    assert sum(sizes) == points
    assert min(sizes) > 0
    # What a chunk has by the same estimate, counted point by point.
    each = np.maximum(density, 1.0)[np.arange(points) * len(density) // points]
    rows = np.add.reduceat(each, np.cumsum((0, *sizes[:-1])))
    wished = max(float(each.sum()) / max(1, each.sum() // 300_000), 1.0)
    assert np.all(np.abs(rows - wished) < 0.1 * wished + 200.0)


def test_a_grid_of_many_parts_is_divided_the_same_way_again(
    small: Write, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(chunks, "_IMPACTS_OF_A_PART", 5)
    monkeypatch.setattr(chunks, "_MANY_PARTS", 2)
    monkeypatch.setattr(workers, "_IMPACTS_OF_A_BLOCK", 4)
    monkeypatch.setattr(workers, "_POINTS_OF_A_BLOCK", 2)
    monkeypatch.setattr(workers, "_LEAST_SHARE", 1)
    grid = load_grid(small(), ["stop.collisions=4"])
    expected = workers.expected_impacts(grid)
    assert expected.most <= 4.0
    density = workers.impact_density(grid, expected, "python")
    compiled = workers.impact_density(grid, expected, "compiled")
    assert density is not None
    assert compiled is not None
    assert density.tolist() == compiled.tolist()
    # Sections have as many impacts as a block, or up to one more.
    assert len(density) <= grid.design.points * expected.mean / 4 < len(density) + 1
    divided = Chunks.of(grid, expected, density)
    assert isinstance(divided.division, tuple)
    assert divided.count > 2
    assert len(set(divided.sizes)) > 1
    with opened(tmp_path / "data", grid, divided) as data:
        for receipt in solve_in_threads(
            grid, divided, data.missing, data.folder, 2, "python", tell
        ):
            data.add(receipt)
        data.write_manifest()
    found = known_division(tmp_path / "data")
    assert found == divided.division
    again = Chunks.of_division(grid, found, expected)
    assert [again.stretches(n) for n in range(again.count)] == [
        divided.stretches(n) for n in range(divided.count)
    ]
    with opened(tmp_path / "data", grid, again) as data:
        assert not data.missing
    assert verify(tmp_path / "data").sound


def test_an_estimate_is_of_points_and_not_of_what_the_first_of_them_prepares(
    small: Write, monkeypatch: pytest.MonkeyPatch
) -> None:
    grid = load_grid(small(), [])
    solver = TraceSolver(grid, "compiled")
    clock = [0.0, 0.4]  # the time, and what the next solution takes in addition to its points

    def solve(points: np.ndarray) -> Solved:
        clock[:] = [clock[0] + clock[1] + 0.001 * len(points), 0.0]
        return TraceSolver.solve(solver, points)

    monkeypatch.setattr(workers, "solver_of", lambda *given: SimpleNamespace(solve=solve))
    monkeypatch.setattr("time.perf_counter", lambda: clock[0])
    assert workers.estimate(grid, "compiled", 1000)[2] == pytest.approx(0.001)


def test_a_column_with_few_numbers_has_a_dictionary() -> None:
    """It stands in the file once for each of them, and other numbers themselves."""
    rows = 20_000
    columns = {
        "few": np.tile(np.arange(5.0), rows // 5),
        "many": np.random.default_rng(1).random(rows),
        "late": np.append(np.zeros(rows // 4), np.random.default_rng(2).random(rows - rows // 4)),
    }
    table = pa.table(columns)
    part = chunk_writer.PartFile(table.schema, [], MemoryFile([]))
    part.add(table.to_batches())
    group = pq.read_metadata(pa.BufferReader(bytes(part.finish()))).row_group(0)
    found = {group.column(n).path_in_schema: group.column(n) for n in range(3)}
    named = [name for name, column in found.items() if column.has_dictionary_page]
    assert named == ["few"]
    assert 8 * found["few"].total_compressed_size < found["many"].total_compressed_size


@pytest.mark.parametrize("sizes", [(1000,), (25, 40), (10, 10, 10)])
@pytest.mark.parametrize("count", [32, 100])
def test_a_sample_is_spread_over_every_axis(sizes: tuple[int, ...], count: int) -> None:
    grid: Any = SimpleNamespace(design=SimpleNamespace(points=1000))
    found = workers.spread(grid, count)
    assert 0.9 * count < len(found) <= count
    assert np.all(np.diff(found) > 0)
    for size, places in zip(sizes, np.unravel_index(found, sizes), strict=True):
        # Between values that occur there are no gaps of more than a few mean distances.
        values = np.unique([-1, *places, size])
        assert np.max(np.diff(values)) <= 1 + 4.0 * size / count
    assert workers.spread(grid, 1000).tolist() == list(range(1000))
