"""`vibro grid`: sweep parameters of a scenario into a dataset, chunk by chunk."""

import shlex
from collections import Counter
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from vibro_cli.commands.shared.error_handling import DONE, FAILED, NOT_STRICT, CommandError
from vibro_cli.commands.shared.options import Engine, Overrides, Strict, Task, scenario_files
from vibro_cli.commands.shared.terminal import (
    EARLY_ENDS,
    INADMISSIBLE_HINT,
    Progress,
    count,
    duration,
    json_text,
    lines_of,
    printable,
    report_command,
    say,
    size,
)

if TYPE_CHECKING:
    from vibro_cli.grids.chunks import Chunks
    from vibro_cli.grids.dataset import Dataset, Shard
    from vibro_cli.grids.document import Grid

GridFile = Annotated[
    str,
    typer.Argument(
        metavar="GRID",
        help="Grid file (TOML, JSON or YAML), or - for standard input.",
        show_default=False,
        autocompletion=scenario_files,
    ),
]


@dataclass(frozen=True)
class Wishes:
    """What was asked of `vibro grid`."""

    source: str
    output: str | None
    overrides: tuple[str, ...]
    engine: str
    workers: int
    max_failures: int | None
    strict: bool
    force: bool
    repair: bool
    merge: bool
    shard: "Shard | None"
    dask: str | None
    as_json: bool

    def folder_of(self, grid: "Grid") -> Path:
        """Where the dataset goes."""
        return Path(self.output) if self.output is not None else Path("outputs") / grid.name


def grid(
    source: GridFile,
    output: Annotated[
        str | None,
        typer.Option(
            "--output", "-o", metavar="DIR", help="Folder of the dataset [default: outputs/<name>]."
        ),
    ] = None,
    overrides: Overrides = [],  # noqa: B006 (typer copies it)
    dry_run: Annotated[
        bool,
        typer.Option(
            "--dry-run",
            help="Only estimate points, chunks, bytes and time, from a timed sample.",
        ),
    ] = False,
    workers: Annotated[
        int,
        typer.Option(
            "--workers",
            min=0,
            help="Threads that solve; 0 for one on each processor.",
            envvar="VIBRO_WORKERS",
        ),
    ] = 0,
    engine: Engine = "compiled",
    max_failures: Annotated[
        int | None,
        typer.Option(
            "--max-failures",
            min=0,
            metavar="N",
            help="Stop once more than N points are invalid or failed; else go on.",
        ),
    ] = None,
    strict: Strict = False,
    force: Annotated[
        bool, typer.Option("--force", help="Start anew where DIR holds another grid.")
    ] = False,
    repair: Annotated[
        bool,
        typer.Option(
            "--repair", help="Solve again what `vibro verify DIR` finds missing or damaged."
        ),
    ] = False,
    shard: Annotated[
        str | None,
        typer.Option(
            "--shard",
            metavar="I/N",
            help="Solve the I-th of N parts only, into a folder of its own within DIR.",
        ),
    ] = None,
    merge: Annotated[
        bool, typer.Option("--merge", help="Put the finished shards of DIR together.")
    ] = False,
    dask: Annotated[
        str | None,
        typer.Option(
            "--dask",
            metavar="ADDRESS",
            help="Solve on the workers of this Dask scheduler, tls://… or tcp://localhost…; they "
            "must share DIR.",
            envvar="VIBRO_DASK",
        ),
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print what was done as one JSON object.")
    ] = False,
) -> Task:
    """Sweep parameters of a scenario into a dataset. Summaries, and every impact if kept."""
    if merge and (shard is not None or dask is not None or repair or force):
        raise typer.BadParameter("--merge goes with none of --shard, --dask, --repair and --force")
    wishes = Wishes(
        source=source,
        output=output,
        overrides=tuple(overrides),
        engine=engine,
        workers=workers,
        max_failures=max_failures,
        strict=strict,
        force=force,
        repair=repair,
        merge=merge,
        shard=_read_shard(shard),
        dask=dask,
        as_json=as_json,
    )
    return partial(_estimate if dry_run else _sweep, wishes)


def _read_shard(text: str | None) -> "Shard | None":
    if text is None:
        return None
    from vibro_cli.grids.dataset import Shard

    try:
        return Shard.read(text)
    except ValueError:
        raise typer.BadParameter(
            f"found {text!r}, expected I/N such as 3/16", param_hint="--shard"
        ) from None


def load(wishes: Wishes) -> "Grid":
    """The grid that was asked for; raises `CommandError` with every problem of it."""
    from dataclasses import asdict

    from vibro_cli.commands.shared.error_handling import reason
    from vibro_cli.grids.document import load_grid
    from vibro_cli.scenario.problems import ScenarioError

    try:
        return load_grid(wishes.source, wishes.overrides)
    except ScenarioError as error:
        problems = [asdict(problem) for problem in error.problems]
        raise CommandError(str(error), problems=problems) from error
    except OSError as error:
        raise CommandError(f"{wishes.source}: cannot be read: {reason(error)}") from error


def _workers(wishes: Wishes) -> int:
    from vibro_cli.storage.files import available_cores

    return wishes.workers or available_cores()


def _estimate(wishes: Wishes) -> int:
    """Say what the grid would take: the start, which is made here too, and the solving."""
    import time

    from vibro_cli.grids.chunks import Chunks
    from vibro_cli.grids.workers import estimate, expected_impacts, impact_density

    begin = time.perf_counter()
    found = load(wishes)
    expected = expected_impacts(found)
    chunks = Chunks.of(found, expected, impact_density(found, expected, wishes.engine))
    start = time.perf_counter() - begin
    one = estimate(found, wishes.engine, chunks.stretch)
    workers = _workers(wishes)
    points = chunks.points
    seconds = start + points * one.seconds / min(workers, points)
    told = {
        "name": found.name,
        "points": points,
        "chunks": chunks.count,
        "chunk_points": chunks.division,
        "impacts": round(points * one.impacts),
        "bytes": round(points * one.bytes),
        "seconds": seconds,
        "workers": workers,
        "sampled": one.sampled,
    }
    if wishes.as_json:
        print(json_text(told))
    divided = count(chunks.count, "chunk", "chunks")
    say(
        lines_of(
            f"{found.name}: {points:,} points in {divided} of {_span(chunks.sizes)}",
            {
                "impacts": f"about {told['impacts']:,}",
                "disk": f"about {size(points * one.bytes)}",
                "time": f"about {duration(seconds)} with {count(workers, 'worker', 'workers')} "
                f"(from {one.sampled:,} points)",
            },
        )
    )
    return DONE


def _span(sizes: list[int]) -> str:
    least, most = min(sizes), max(sizes)
    return f"{least:,}" if least == most else f"{least:,} to {most:,}"


def _sweep(wishes: Wishes) -> int:
    """Solve what is missing of the dataset."""
    import os

    # Memory that arrow gives back between two parts would have to be cleared for it again; to be
    # said before it is imported.
    os.environ.setdefault("MIMALLOC_PURGE_DELAY", "-1")

    found = load(wishes)
    state = sweep(wishes, found, _workers(wishes))
    if wishes.as_json:
        print(json_text(state))
    if not state["complete"]:
        return FAILED
    unsound = state["invalid"] + state["failed"] + state["inadmissible"]
    return NOT_STRICT if wishes.strict and unsound else DONE


def sweep(wishes: "Wishes", grid: "Grid", workers: int) -> dict[str, Any]:
    """Solve what is missing of a grid's dataset; return what there is now, as plain values."""
    from vibro_cli.grids.dataset import FolderInUse, GridChanged, MergeRefused, merge, opened
    from vibro_cli.grids.workers import ClusterError
    from vibro_cli.storage.files import FolderRefused

    whole = wishes.folder_of(grid)
    folder = whole if wishes.shard is None else wishes.shard.folder_in(whole)
    try:
        chunks = _chunks(wishes, grid, folder)
        wanted = None
        if wishes.shard is not None:
            _warn_of_few_chunks(grid.name, chunks.count, wishes.shard.count)
            wanted = wishes.shard.wanted_of(whole, grid, chunks)
            if not wanted and not folder.exists():
                return _nothing_to_do(grid, whole, wishes.shard.number > chunks.count)
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
    from vibro_cli.grids.dataset import division_of_shards, known_division
    from vibro_cli.grids.workers import chunks_of

    known = None if wishes.force else known_division(folder)
    if known is None and wishes.shard is not None:
        known = known_division(wishes.folder_of(grid))
    if wishes.merge and known is None:
        known = division_of_shards(folder)
    return chunks_of(grid, known, wishes.engine)


def _warn_of_few_chunks(name: str, chunks: int, shards: int) -> None:
    if chunks < shards:
        divided = count(chunks, "chunk", "chunks")
        say(
            f"{name}: warning: {divided} for {shards} shards; a lower chunk_points in the "
            "grid file makes more",
            "warning",
        )


def _nothing_to_do(grid: "Grid", folder: Path, has_none: bool) -> dict[str, Any]:
    """Say that a shard has nothing to solve: it has no chunk, or its grid has all of it."""
    why = (
        "no chunk is of this shard"
        if has_none
        else f"{folder} has all chunks of this shard already"
    )
    say(f"{grid.name}: {why}; nothing is solved")
    return {
        "name": grid.name,
        "folder": str(folder),
        "complete": True,
        **dict.fromkeys(("chunks", "points", "impacts", "invalid", "failed", "inadmissible"), 0),
        "end_causes": {},
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
    from vibro_cli.grids.workers import solve_in_threads, solve_on_cluster

    missing = dataset.missing
    if not missing:
        check = f"vibro verify {shlex.quote(printable(str(dataset.folder)))}"
        say(
            f"{dataset.grid.name}: the folder is complete already; nothing is solved "
            f"({check} checks its files)"
        )
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
    names = ("points", "impacts", "invalid", "failed")
    causes = sum((Counter(one.end_causes) for one in receipts), Counter[str]())
    return {
        "name": dataset.grid.name,
        "folder": str(dataset.folder),
        "complete": not dataset.missing,
        "chunks": len(dataset.receipts),
        **{name: sum(getattr(one, name) for one in receipts) for name in names},
        "inadmissible": causes["inadmissible"],
        "end_causes": dict(sorted(causes.items())),
        "bytes": sum(file["bytes"] for one in receipts for file in one.files.values()),
    }


def _tell(name: str, state: dict[str, Any], folder: Path, reason: str | None) -> None:
    odd = [
        f"{state[word]:,} {word}" for word in ("invalid", "failed", "inadmissible") if state[word]
    ]
    sound = ", ".join(odd) or "all of them valid and admissible"
    causes: dict[str, int] = state["end_causes"]
    early = [f"{causes[cause]:,} {words}" for cause, words in EARLY_ENDS.items() if cause in causes]
    items = {"points": "; ".join([sound, *early])}
    if reason is not None:
        items["such as"] = reason
    chunks = count(state["chunks"], "chunk", "chunks")
    items["files"] = f"{printable(str(folder))} ({chunks}, {size(state['bytes'])})"
    if state["complete"]:
        items["next"] = report_command(folder)
    if state["inadmissible"]:
        items["hint"] = INADMISSIBLE_HINT
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
