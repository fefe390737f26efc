"""A grid solved into its folder from beginning to end, by this process."""

from __future__ import annotations

from pathlib import Path

from vibro_cli.grids.dataset import known_division, opened
from vibro_cli.grids.document import Grid
from vibro_cli.grids.sample import chunks_of
from vibro_cli.grids.threads import available_cores, solve_in_threads


def solve_into(
    folder: Path, grid: Grid, workers: int = 0, engine: str = "compiled", force: bool = False
) -> None:
    """Solve what a folder lacks of a grid.

    Parameters
    ----------
    folder, grid
        Where the dataset goes, and what it is to hold.
    workers
        Threads; 0 for one on each processor.
    engine
        ``"compiled"`` or ``"python"``; both give the same bytes.
    force
        Whether another grid in the folder is replaced.

    Raises as :func:`dataset.opened`, and ``OSError`` where a part cannot be written.
    """
    chunks = chunks_of(grid, None if force else known_division(folder), engine)
    with opened(folder, grid, chunks, force) as dataset:
        threads = workers or available_cores()
        given = grid, chunks, dataset.missing, folder, threads, engine
        try:
            for receipt in solve_in_threads(*given, lambda points, impacts: None):
                dataset.add(receipt)
        finally:
            dataset.write_manifest()
