"""Solving a grid chunk by chunk: progress, interruptions, and what is told at the end."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from vibro_cli.commands.boundary import FAILED, CommandError, say
from vibro_cli.commands.progress import Progress
from vibro_cli.commands.streams import printable
from vibro_cli.commands.words import count, lines_of, report_command, size

if TYPE_CHECKING:
    from vibro_cli.commands.grid import Wishes
    from vibro_cli.grids.chunks import Chunks
    from vibro_cli.grids.dataset import Dataset
    from vibro_cli.grids.document import Grid


def sweep(wishes: "Wishes", grid: "Grid", workers: int) -> dict[str, Any]:
    """Solve what is missing of a grid's dataset; return what there is now, as plain values."""
    from vibro_cli.grids.cluster import ClusterError
    from vibro_cli.grids.dataset import FolderInUse, GridChanged, opened
    from vibro_cli.grids.shards import MergeRefused, merge
    from vibro_cli.storage.provenance import FolderRefused

    whole = wishes.folder_of(grid)
    folder = whole if wishes.shard is None else wishes.shard.folder_in(whole)
    try:
        chunks = _chunks(wishes, grid, folder)
        wanted = None
        if wishes.shard is not None:
            wanted = wishes.shard.wanted_of(whole, grid, chunks)
            if not wanted and not folder.exists():
                return _nothing_to_do(grid, whole)
        with opened(folder, grid, chunks, wishes.force, wanted) as dataset:
            if wishes.merge:
                for _ in merge(dataset):
                    pass
            else:
                if wishes.repair:
                    _drop_damaged(dataset)
                _solve(wishes, dataset, workers)
    except (FolderRefused, GridChanged, FolderInUse) as error:
        raise CommandError(f"vibro: {error}") from error
    except (MergeRefused, ClusterError) as error:
        raise CommandError(f"vibro: {error}", FAILED) from error
    state = _state(dataset)
    _tell(grid.name, state, folder, _first_reason(dataset))
    return state


def _chunks(wishes: "Wishes", grid: "Grid", folder: Path) -> "Chunks":
    """How the grid is divided: as its folder or that of a shard has it, if it is there already."""
    from vibro_cli.grids.dataset import known_division
    from vibro_cli.grids.shards import division_of_shards
    from vibro_cli.grids.threads import chunks_of

    known = None if wishes.force else known_division(folder)
    if known is None and wishes.shard is not None:
        known = known_division(wishes.folder_of(grid))
    if wishes.merge and known is None:
        known = division_of_shards(folder)
    return chunks_of(grid, known, wishes.engine)


def _nothing_to_do(grid: "Grid", folder: Path) -> dict[str, Any]:
    """Say that a shard has nothing to solve, because its grid has all of it."""
    say(f"{grid.name}: {folder} has all chunks of this shard already; nothing is solved")
    return {
        "name": grid.name,
        "folder": str(folder),
        "complete": True,
        **dict.fromkeys(("chunks", "points", "impacts", "invalid", "failed", "inadmissible"), 0),
        "bytes": 0,
    }


def _drop_damaged(dataset: "Dataset") -> None:
    """Forget chunks whose files are missing or not as they were written."""
    from vibro_cli.grids.dataset import verify

    damaged = {finding.file for finding in verify(dataset.folder).findings}
    for chunk, receipt in list(dataset.receipts.items()):
        if damaged & set(receipt.files):
            say(f"vibro: chunk {chunk} is damaged and is solved again", "warning", chunk=chunk)
            del dataset.receipts[chunk]


def _solve(wishes: "Wishes", dataset: "Dataset", workers: int) -> None:
    """Solve the missing chunks; what is finished is taken down, however it ends."""
    from vibro_cli.grids.cluster import solve_on_cluster
    from vibro_cli.grids.threads import solve_in_threads

    missing = dataset.missing
    if not missing:
        say(f"{dataset.grid.name}: the folder is complete already; nothing is solved")
    if 0 < len(missing) < len(dataset.wanted):
        done = len(dataset.wanted) - len(missing)
        say(f"vibro: going on after {done:,} of {len(dataset.wanted):,} chunks")
    progress = Progress(sum(_points(dataset, chunk) for chunk in missing))
    given = dataset.grid, dataset.chunks, missing, dataset.folder
    if wishes.dask is None:
        receipts = solve_in_threads(*given, workers, wishes.engine, progress.add)
    else:
        receipts = solve_on_cluster(*given, wishes.dask, wishes.engine, progress.add)
    try:
        for receipt in receipts:
            dataset.add(receipt)
            _check_failures(wishes, dataset)
    except BaseException:
        receipts.close()
        _keep(dataset)
        progress.end()
        say("vibro: the same command goes on from here", "error")
        raise
    progress.end()
    dataset.write_manifest()


def _keep(dataset: "Dataset") -> None:
    """Write the manifest after an interruption; a disk that is full has said so already."""
    try:
        dataset.write_manifest()
    except OSError:
        say("vibro: the manifest could not be written; no part on the disk is lost by that")


def _points(dataset: "Dataset", chunk: int) -> int:
    first, last = dataset.chunks.range_of(chunk)
    return last - first


def _check_failures(wishes: "Wishes", dataset: "Dataset") -> None:
    most = wishes.max_failures
    found = sum(one.invalid + one.failed for one in dataset.receipts.values())
    if most is not None and found > most:
        text = f"vibro: {found} points are invalid or failed, --max-failures allows {most}"
        raise CommandError(text, FAILED)


def _state(dataset: "Dataset") -> dict[str, Any]:
    receipts = dataset.receipts.values()
    names = ("points", "impacts", "invalid", "failed", "inadmissible")
    return {
        "name": dataset.grid.name,
        "folder": str(dataset.folder),
        "complete": not dataset.missing,
        "chunks": len(dataset.receipts),
        **{name: sum(getattr(one, name) for one in receipts) for name in names},
        "bytes": sum(file["bytes"] for one in receipts for file in one.files.values()),
    }


def _tell(name: str, state: dict[str, Any], folder: Path, reason: str | None) -> None:
    odd = [
        f"{state[word]:,} {word}" for word in ("invalid", "failed", "inadmissible") if state[word]
    ]
    items = {"points": ", ".join(odd) if odd else "all of them valid and admissible"}
    if reason is not None:
        items["such as"] = reason
    chunks = count(state["chunks"], "chunk", "chunks")
    items["files"] = f"{printable(str(folder))} ({chunks}, {size(state['bytes'])})"
    if state["complete"]:
        items["next"] = report_command(folder)
    say(
        lines_of(f"{name}: {state['points']:,} points, {state['impacts']:,} impacts", items),
        name=name,
    )


def _first_reason(dataset: "Dataset") -> str | None:
    """Why the first point that is invalid or failed is so, None where all are well."""
    import pyarrow.parquet as parquet

    from vibro_cli.grids.chunks import file_names

    for chunk, receipt in sorted(dataset.receipts.items()):
        if receipt.invalid + receipt.failed:
            part = dataset.folder / file_names(dataset.grid, chunk)["summary"]
            table = parquet.read_table(part, columns=["scenario", "status", "reason"])
            for row in table.to_pylist():
                if row["status"] != "ok":
                    return f"scenario {row['scenario']} is {row['status']}: {row['reason']}"
    return None
