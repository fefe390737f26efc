"""Parts of a grid solved by jobs that know nothing of one another, and putting them together."""

from __future__ import annotations

import hashlib
import os
import re
import shutil
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from vibro_cli.errors import VibroError
from vibro_cli.grids.chunks import Chunks, Division, Receipt
from vibro_cli.grids.dataset import (
    GRID_NAME,
    SHARD,
    Dataset,
    check_same,
    found_receipts,
    known_division,
    locked,
)
from vibro_cli.grids.document import Grid
from vibro_cli.storage.files import flush_folder


class MergeRefused(VibroError):
    """Shards that cannot be put together; the message says which and why."""


@dataclass(frozen=True)
class Shard:
    """One of several jobs: the ``number``-th of ``count``, from 1."""

    number: int
    count: int

    @staticmethod
    def read(text: str) -> Shard:
        """Return the shard of a text such as ``3/16``.

        Raises
        ------
        ValueError
            For another text.
        """
        match = re.fullmatch(r"\s*(\d{1,6})\s*/\s*(\d{1,6})\s*", text, re.ASCII)
        if match is None or not 1 <= int(match[1]) <= int(match[2]):
            raise ValueError(text)
        return Shard(int(match[1]), int(match[2]))

    def folder_in(self, folder: Path) -> Path:
        """Return the folder of this shard within that of the grid."""
        return folder / f"shard-{self.number}-of-{self.count}"

    def chunks_of(self, chunks: Chunks) -> range:
        """Return the numbers of the chunks of this shard."""
        return range(self.number - 1, chunks.count, self.count)

    def wanted_of(self, folder: Path, grid: Grid, chunks: Chunks) -> list[int]:
        """Return the chunks of this shard that the folder of the grid does not have already.

        Raises
        ------
        GridChanged
            If that folder holds another grid, to which no shard of this one could be added.
        """
        check_same(folder, grid, chunks, "-o names another folder")
        done = found_receipts(folder, grid, chunks)
        own = found_receipts(self.folder_in(folder), grid, chunks)
        return [one for one in self.chunks_of(chunks) if one in own or one not in done]


def shard_folders(folder: Path) -> list[Path]:
    """Return the folders of shards within the folder of a grid, in order."""
    found = [path for path in folder.glob("shard-*-of-*") if SHARD.fullmatch(path.name)]
    return sorted(found, key=lambda path: [int(n) for n in SHARD.findall(path.name)[0]])


def division_of_shards(folder: Path) -> Division | None:
    """Return how the grid of shards is divided into chunks; None without any."""
    found = [known_division(path) for path in shard_folders(folder)]
    return next((division for division in found if division is not None), None)


def merge(dataset: Dataset) -> Iterator[Receipt]:
    """Move the parts of all shards into the folder of the grid.

    Every part is held to its checksum first, and nothing is moved unless all chunks are there.

    Raises
    ------
    MergeRefused
        If chunks are missing or damaged.
    FolderInUse
        If a shard is being worked on.
    GridChanged
        If a shard is of another grid.
    OSError
        If a file cannot be moved.
    """
    with ExitStack() as stack:
        places: dict[int, tuple[Path, Receipt]] = {}
        folders = shard_folders(dataset.folder)
        for folder in folders:
            if not (folder / GRID_NAME).exists():
                continue
            stack.enter_context(locked(folder))
            check_same(folder, dataset.grid, dataset.chunks)
            found = found_receipts(folder, dataset.grid, dataset.chunks)
            places |= {chunk: (folder, receipt) for chunk, receipt in found.items()}
        missing = [chunk for chunk in dataset.missing if chunk not in places]
        if missing:
            raise MergeRefused(
                f"{len(missing)} of {dataset.chunks.count} chunks are in no shard of "
                f"{dataset.folder}, the first is {missing[0]}; expected all shards to be finished"
            )
        wanted = dataset.missing
        for chunk in wanted:
            _check(*places[chunk])
        for chunk in wanted:
            folder, receipt = places[chunk]
            for name in receipt.files:
                os.replace(folder / name, dataset.folder / name)
            dataset.add(receipt)
            yield receipt
        for name in {str(Path(name).parent) for r in dataset.receipts.values() for name in r.files}:
            flush_folder(dataset.folder / name)
        dataset.write_manifest()
        for folder in folders:
            shutil.rmtree(folder)


def _check(folder: Path, receipt: Receipt) -> None:
    for name, described in receipt.files.items():
        content = (folder / name).read_bytes()
        if hashlib.sha256(content).hexdigest() != described["sha256"]:
            raise MergeRefused(
                f"{folder / name} is not as it was written (SHA-256); "
                "vibro grid --shard … --repair solves it again"
            )
