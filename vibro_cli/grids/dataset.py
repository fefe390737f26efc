"""The folder of a grid: its parts, manifest, lock, shards and verification.

A chunk is finished when its parts, which are written atomically, exist on disk. The manifest lists
them with checksums. It is written from time to time; parts that it lacks are read from the disk.
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import re
import shutil
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from vibro_cli import __version__
from vibro_cli.errors import Failure, VibroError, exhausted
from vibro_cli.grids.chunks import Chunks, Division, Receipt, file_names, receipt_of
from vibro_cli.grids.document import Grid
from vibro_cli.storage.files import (
    GRID_NAME,
    LACKING,
    MANIFEST_NAME,
    Finding,
    FolderRefused,
    check_files,
    check_replaceable,
    differences,
    entry,
    flush_folder,
    is_changed,
    json_bytes,
    json_of,
    lock,
    make_folder,
    manifest_of,
    read_manifest,
    refusal,
    remove_partial_files,
    results_within,
    write_file,
)

_LOCK_NAME = ".lock"
SHARD = re.compile(r"shard-(\d+)-of-(\d+)")
"""Name of a shard's folder within the folder of its grid."""
_FOLDERS = ("summary", "collisions", "bounces")
# Least time (s) between two writes of the manifest before the end.
_EVERY = 5.0


class GridChanged(VibroError):
    """The folder holds another grid; the message shows the differences."""


class FolderInUse(VibroError):
    """Another process is working on the folder."""


@dataclass
class Dataset:
    """A grid on disk, open for writing."""

    folder: Path
    grid: Grid
    chunks: Chunks
    wanted: Sequence[int]
    """The chunks that this folder must hold: all of them, or those of a shard."""
    receipts: dict[int, Receipt] = field(default_factory=dict)
    _written: float = 0.0

    @property
    def missing(self) -> list[int]:
        """Unfinished chunks."""
        return [chunk for chunk in self.wanted if chunk not in self.receipts]

    def add(self, receipt: Receipt) -> None:
        """Record a finished chunk."""
        self.receipts[receipt.chunk] = receipt
        if time.monotonic() - self._written > _EVERY:
            self.write_manifest()

    def find_receipts(self) -> None:
        """Find the receipts of all finished chunks in the folder; write them to the manifest."""
        self.receipts = found_receipts(self.folder, self.grid, self.chunks)
        self.write_manifest()

    def write_manifest(self) -> None:
        """Write the manifest of the finished chunks; equal chunks give equal bytes."""
        write_file(self.folder / MANIFEST_NAME, json_bytes(self.manifest()))
        self._written = time.monotonic()

    def manifest(self) -> dict[str, Any]:
        """Return the manifest of the finished chunks."""
        receipts = [self.receipts[chunk] for chunk in sorted(self.receipts)]
        entries: dict[str, Any] = {GRID_NAME: entry(grid_content(self.grid, self.chunks))}
        for receipt in receipts:
            entries |= receipt.files
        details = {
            "complete": not self.missing,
            "wanted": len(self.wanted),
            "points": self.chunks.points,
            "chunk_points": self.chunks.division,
            "chunks": [receipt.counts() for receipt in receipts],
        }
        return manifest_of("grid", entries, details)


def grid_content(grid: Grid, chunks: Chunks) -> bytes:
    """Return the content of ``grid.json``: the resolved grid with its division."""
    return json_bytes({**grid.resolved(), "chunk_points": chunks.division})


def known_division(folder: Path) -> Division | None:
    """Return the division into chunks of the grid in a folder, or None without a grid."""
    found: Any = (_stored_grid(folder) or {}).get("chunk_points")
    sizes = found if isinstance(found, list) else [found]
    if not sizes or not all(isinstance(size, int) and size > 0 for size in sizes):
        return None
    return tuple(sizes) if isinstance(found, list) else found


@contextlib.contextmanager
def opened(
    folder: Path,
    grid: Grid,
    chunks: Chunks,
    anew: bool = False,
    wanted: Sequence[int] | None = None,
) -> Iterator[Dataset]:
    """Open the folder of a grid for writing, created if missing, and lock it.

    `anew` removes an existing grid; `wanted` are the chunks that the folder must hold, None for
    all. Raises as :func:`check_grid_folder` and :func:`check_same`, `FolderInUse` if another
    process is working on it, and ``OSError`` if it cannot be written.
    """
    check_grid_folder(folder)
    for name in ("summary", *grid.kept_tables):
        make_folder(folder / name)
    with locked(folder):
        if anew:
            drop(folder)
        check_same(folder, grid, chunks)
        for name in ("", *_FOLDERS):
            remove_partial_files(folder / name)
        dataset = Dataset(folder, grid, chunks, range(chunks.count) if wanted is None else wanted)
        if _stored_grid(folder) is None:
            write_file(folder / GRID_NAME, grid_content(grid, chunks))
        dataset.find_receipts()
        yield dataset


def check_grid_folder(folder: Path) -> None:
    """Raise `FolderRefused` unless the folder does not exist, is empty, or is a grid of vibro."""
    if (folder / GRID_NAME).exists():
        ours = str((read_manifest(folder) or {}).get("schema")).startswith("vibro-grid/")
        if _stored_grid(folder) is None and not ours:
            raise FolderRefused(f"{folder / GRID_NAME} is not a vibro grid; it is left as it is")
        return
    if folder.is_dir():
        names = {one.name for one in folder.iterdir() if not one.name.startswith(".")}
        if {name for name in names if not SHARD.fullmatch(name)} <= {*_FOLDERS, MANIFEST_NAME}:
            return  # left by a grid that was stopped at once
    check_replaceable(folder, "grid")


def _stored_grid(folder: Path) -> dict[str, Any] | None:
    found = json_of(folder / GRID_NAME)
    return found if isinstance(found, dict) and "axes" in found else None


def check_same(
    folder: Path,
    grid: Grid,
    chunks: Chunks,
    remedy: str = "--force starts afresh, -o names another folder",
) -> None:
    """Raise `GridChanged`, with a `remedy`, if the folder holds a different grid."""
    stored = _stored_grid(folder)
    wanted = json.loads(grid_content(grid, chunks))
    # A dataset must not mix parts of two versions of the program.
    version = (read_manifest(folder) or {}).get("program", {}).get("version", __version__)
    if stored is None or (stored == wanted and version == __version__):
        return
    found = differences({**stored, "version": version}, {**wanted, "version": __version__})
    raise GridChanged(*refusal(f"{folder} holds a different grid", found, remedy))


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Lock a folder; the system releases the lock when the process ends for any reason."""
    handle = os.open(folder / _LOCK_NAME, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
    try:
        try:
            lock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise FolderInUse(f"another process is using {folder}") from error
        yield
    finally:
        os.close(handle)


def drop(folder: Path) -> None:
    """Remove the grid in a folder: first its definition and manifest, then its parts."""
    for name in (MANIFEST_NAME, GRID_NAME):
        (folder / name).unlink(missing_ok=True)
    for name in _FOLDERS:
        for part in (folder / name).glob("part-*.parquet"):
            part.unlink()


def found_receipts(folder: Path, grid: Grid, chunks: Chunks) -> dict[int, Receipt]:
    """Return the receipts of all finished chunks, from the manifest or from the disk.

    A changed manifest and that of another grid are ignored, as `grid.json` may be missing.
    """
    manifest = read_manifest(folder) or {}
    of_this = entry(grid_content(grid, chunks))
    same = manifest.get("files", {}).get(GRID_NAME) == of_this and not is_changed(manifest)
    known = _receipts_of(manifest, grid) if same else {}
    found, sizes = {}, chunks.sizes
    for chunk in range(chunks.count):
        names = file_names(grid, chunk).values()
        receipt = known.get(chunk)
        if receipt is not None:
            whole = all(has_size(folder / name, receipt.files[name]) for name in names)
            if whole and receipt.points == sizes[chunk]:
                found[chunk] = receipt
        elif all((folder / name).exists() for name in names):
            read = _read_receipt(folder, grid, chunks, chunk)
            if read is not None:
                found[chunk] = read
    return found


def _receipts_of(manifest: dict[str, Any], grid: Grid) -> dict[int, Receipt]:
    files = manifest.get("files", {})
    receipts = {}
    for counts in filter(_is_known, manifest.get("chunks", ())):
        names = file_names(grid, counts["chunk"]).values()
        if all(name in files for name in names):
            own = {name: files[name] for name in names}
            receipts[counts["chunk"]] = Receipt(**counts, files=own)
    return receipts


def _is_known(counts: Any) -> bool:
    """Return whether a value has all numbers of a receipt; earlier versions kept fewer."""
    names = {one.name for one in fields(Receipt)} - {"files"}
    if not isinstance(counts, dict) or {*counts} != names:
        return False
    causes = counts["end_causes"]
    numbers = [counts[name] for name in names - {"end_causes"}]
    return isinstance(causes, dict) and all(
        isinstance(one, int) for one in (*numbers, *causes.values())
    )


def has_size(path: Path, described: dict[str, Any]) -> bool:
    """Return whether a file exists with the size given in a receipt."""
    return path.is_file() and path.stat().st_size == described["bytes"]


def _read_receipt(folder: Path, grid: Grid, chunks: Chunks, chunk: int) -> Receipt | None:
    """Return the receipt of parts missing in the manifest, or None if not of this chunk."""
    import numpy as np
    import pyarrow as pa

    from vibro_cli.storage.tables import read_parquet

    names = file_names(grid, chunk)
    files = {name: entry((folder / name).read_bytes()) for name in names.values()}
    try:
        table = read_parquet(folder / names["summary"])
    except (OSError, pa.ArrowException) as error:
        if exhausted(error):
            raise
        return None
    metadata = table.schema.metadata or {}
    wanted = json.dumps(grid.resolved(), ensure_ascii=False, allow_nan=False).encode()
    first, last = chunks.range_of(chunk)
    if metadata.get(b"vibro:grid") != wanted or metadata.get(b"vibro:part") != b"%d" % chunk:
        return None
    if table.num_rows != last - first:
        return None
    impacts = sum(int(np.nansum(table[one].to_numpy().astype(float))) for one in grid.counted)
    status, cause = (
        np.array(table[name].to_pylist(), dtype=object) for name in ("status", "end_cause")
    )
    return receipt_of(chunk, status, cause, impacts, files)


class NoManifest(VibroError):
    """The folder is not one of vibro, or its manifest cannot be read."""


@dataclass(frozen=True)
class Verdict:
    """The result of checking a folder."""

    kind: str
    files: int
    bytes: int
    complete: bool
    missing_chunks: int
    findings: tuple[Finding, ...]
    lacking: Mapping[str, Any]
    """What a signal left out of a run: `undrawn` kinds of figures, and samples of its motion,
    `unsampled_from` a time (s)."""

    @property
    def sound(self) -> bool:
        """Whether all files are present and unchanged, there is no other file, and no chunk is
        missing."""
        return not self.findings and self.complete


def verify(folder: Path) -> Verdict:
    """Check every file of a folder against its size and SHA-256 in the manifest, and that itself.

    Folders of shards that are not merged yet have their own manifests and are skipped.

    Raises `NoManifest` if the folder has no valid manifest, `OSError` if a file cannot be read.
    """
    found = read_manifest(folder)
    if not folder.exists():
        raise NoManifest(f"{folder}: no such folder")
    if folder.is_file():
        raise NoManifest(f"{folder} is a file; expected a folder of results")
    if found is None:
        within = results_within(folder)
        raise NoManifest(f"{folder} has no valid {MANIFEST_NAME} of vibro{within}")
    findings = list(check_files(folder, found["files"]))
    if is_changed(found):
        findings.insert(0, Finding(MANIFEST_NAME, "damaged", "it does not have its own SHA-256"))
    known = {*found["files"], MANIFEST_NAME}
    for path in sorted(folder.rglob("*")):
        name = str(path.relative_to(folder))
        hidden, of_shard = path.name.startswith("."), SHARD.fullmatch(Path(name).parts[0])
        if path.is_file() and not hidden and not of_shard and name not in known:
            findings.append(Finding(name, "unknown", "not in the manifest"))
    size = sum(one["bytes"] for one in found["files"].values())
    missing = int(found["wanted"] - len(found.get("chunks", []))) if "wanted" in found else 0
    kind = str(found["schema"]).removeprefix("vibro-").partition("/")[0]
    lacking = {name: found[name] for name in sorted(LACKING & found.keys())}
    count = len(found["files"])
    return Verdict(kind, count, size, missing == 0, missing, tuple(findings), lacking)


class MergeRefused(Failure):
    """Shards cannot be merged; the message says which and why."""


@dataclass(frozen=True)
class Shard:
    """One of several jobs on a grid: the ``number``-th of ``count``, from 1."""

    number: int
    count: int

    @staticmethod
    def read(text: str) -> Shard:
        """Return the shard given by a text such as ``3/16``.

        Raises `ValueError` for any other text.
        """
        match = re.fullmatch(r"\s*(\d{1,6})\s*/\s*(\d{1,6})\s*", text, re.ASCII)
        if match is None or not 1 <= int(match[1]) <= int(match[2]):
            raise ValueError(text)
        return Shard(int(match[1]), int(match[2]))

    def folder_in(self, folder: Path) -> Path:
        """Return the folder of this shard within the folder of the grid."""
        return folder / f"shard-{self.number}-of-{self.count}"

    def chunks_of(self, chunks: Chunks) -> range:
        """Return the indices of the chunks of this shard."""
        return range(self.number - 1, chunks.count, self.count)

    def wanted_of(self, folder: Path, grid: Grid, chunks: Chunks) -> list[int]:
        """Return the chunks of this shard that are not yet in the folder of the grid.

        Raises `GridChanged` if that folder holds a different grid, into which the shard could not
        be merged.
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
    """Return the division into chunks of the grid of shards, or None without shards."""
    found = [known_division(path) for path in shard_folders(folder)]
    return next((division for division in found if division is not None), None)


def _unfinished(folders: Sequence[Path], missing: Sequence[int]) -> str:
    """Name the shards of missing chunks, if the folders tell into how many the grid is divided."""
    counts = {int(SHARD.findall(folder.name)[0][1]) for folder in folders}
    if len(counts) != 1:
        return ""
    (count,) = counts
    numbers = sorted({chunk % count + 1 for chunk in missing})
    return f", also {', '.join(f'{number}/{count}' for number in numbers)}"


def merge(dataset: Dataset) -> None:
    """Move the parts of all shards into the folder of the grid.

    The checksums of all parts are verified first, and nothing is moved unless all chunks exist.

    Raises `MergeRefused` if chunks are missing or damaged, `FolderInUse` if a shard is in use,
    `GridChanged` if a shard belongs to another grid, `OSError` if a file cannot be moved.
    """
    with ExitStack() as stack:
        places: dict[int, tuple[Path, Receipt]] = {}
        folders = shard_folders(dataset.folder)
        for folder in folders:
            if not (folder / GRID_NAME).exists():
                continue
            stack.enter_context(locked(folder))
            check_same(folder, dataset.grid, dataset.chunks, "--shard … --force solves it afresh")
            _take_back(dataset, folder)
            found = found_receipts(folder, dataset.grid, dataset.chunks)
            places |= {chunk: (folder, receipt) for chunk, receipt in found.items()}
        missing = [chunk for chunk in dataset.missing if chunk not in places]
        if missing:
            raise MergeRefused(
                f"{len(missing)} of {dataset.chunks.count} chunks are in no shard of "
                f"{dataset.folder}, the first is {missing[0]}; expected all shards to be finished"
                f"{_unfinished(folders, missing)}"
            )
        moved = [places[chunk] for chunk in dataset.missing]
        for folder, receipt in moved:
            for damage in check_files(folder, receipt.files):
                raise MergeRefused(
                    f"{folder / damage.file} has changed since it was written (SHA-256); "
                    "vibro grid --shard … --repair solves it again"
                )
        for folder, receipt in moved:
            for name in receipt.files:
                os.replace(folder / name, dataset.folder / name)
            dataset.add(receipt)
        for name in {str(Path(name).parent) for r in dataset.receipts.values() for name in r.files}:
            flush_folder(dataset.folder / name)
        dataset.write_manifest()
        for folder in folders:
            shutil.rmtree(folder)


def _take_back(dataset: Dataset, shard: Path) -> None:
    """Return to a shard the files of a chunk that an interrupted merge has moved in part."""
    for chunk, receipt in _receipts_of(read_manifest(shard) or {}, dataset.grid).items():
        if chunk in dataset.receipts:
            continue
        for name in receipt.files:
            if (dataset.folder / name).exists() and not (shard / name).exists():
                os.replace(dataset.folder / name, shard / name)
