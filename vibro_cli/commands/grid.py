"""`vibro grid`: sweep parameters of a scenario into a dataset, chunk by chunk."""

import shlex
from collections import Counter
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from vibro_cli.commands.shared.error_handling import (
    DONE,
    FAILED,
    NOT_STRICT,
    CommandError,
)
from vibro_cli.commands.shared.options import (
    Engine,
    Overrides,
    Strict,
    json_option,
    output_option,
    scenario_argument,
)
from vibro_cli.commands.shared.terminal import (
    INADMISSIBLE_HINT,
    Progress,
    duration,
    json_text,
    lines_of,
    report_command,
    say,
    size,
)
from vibro_cli.errors import counted, in_command, printable

if TYPE_CHECKING:
    from vibro_cli.grids.chunks import Chunks, Receipt
    from vibro_cli.grids.dataset import Dataset, Shard
    from vibro_cli.grids.document import Grid


@dataclass(frozen=True, kw_only=True)
class GridCommand:
    """Sweep parameters of a scenario into a dataset. Store summaries and, on request, impacts."""

    source: Annotated[
        str,
        scenario_argument(
            metavar="GRID", help="Grid file (TOML, JSON or YAML), or - for standard input."
        ),
    ]
    output: Annotated[
        str | None,
        output_option(metavar="DIR", help="Folder for the dataset [default: outputs/<name>]."),
    ] = None
    overrides: Overrides
    dry_run: Annotated[
        bool,
        typer.Option(
            "--dry-run", help="Only estimate points, chunks, bytes and time from a timed sample."
        ),
    ] = False
    workers: Annotated[
        int,
        typer.Option(
            min=0,
            metavar="N",
            help="Number of solver threads; 0 uses one per core.",
            envvar="VIBRO_WORKERS",
        ),
    ] = 0
    engine: Engine = "compiled"
    max_failures: Annotated[
        int | None,
        typer.Option(
            min=0,
            metavar="N",
            help="Stop once more than N points are invalid or have failed [default: never].",
        ),
    ] = None
    strict: Strict = False
    force: Annotated[
        bool, typer.Option("--force", help="Start afresh if DIR holds a different grid.")
    ] = False
    repair: Annotated[
        bool,
        typer.Option(
            "--repair", help="Solve again whatever `vibro verify DIR` finds missing or damaged."
        ),
    ] = False
    shard: Annotated[
        str | None,
        typer.Option(
            metavar="I/N",
            help="Solve only part I of N, into its own folder within DIR.",
        ),
    ] = None
    merge: Annotated[bool, typer.Option("--merge", help="Merge the finished shards in DIR.")] = (
        False
    )
    dask: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS",
            help="Solve on the workers of this Dask scheduler (tls://… or tcp://localhost…), which "
            "must share DIR.",
            envvar="VIBRO_DASK",
        ),
    ] = None
    as_json: Annotated[bool, json_option(help="Print the result as one JSON object.")] = False

    def __post_init__(self) -> None:
        if self.merge and (
            self.shard is not None or self.dask is not None or self.repair or self.force
        ):
            expected = "--merge cannot be combined with --shard, --dask, --repair or --force"
            raise typer.BadParameter(expected)
        if self.dry_run and (self.shard is not None or self.merge or self.repair):
            expected = "--dry-run covers a whole grid; it cannot be combined with --shard, --merge"
            raise typer.BadParameter(f"{expected} or --repair")
        if self.shard is not None:
            _read_shard(self.shard)

    def __call__(self) -> int:
        """Estimate the cost of the grid, or solve the missing chunks of its dataset."""
        return _estimate(self) if self.dry_run else _sweep(self)

    def folder_of(self, grid: "Grid") -> Path:
        """Return the folder of the dataset."""
        return Path(self.output) if self.output is not None else Path("outputs") / grid.name

    def merge_command(self) -> str:
        """Return the command that merges the shards once all are finished, quoted for the shell."""
        words = ["vibro", "grid", self.source, "--merge"]
        words += [word for text in self.overrides for word in ("--set", text)]
        words += [] if self.output is None else ["-o", self.output]
        return shlex.join(map(printable, words))


def _read_shard(text: str) -> "Shard":
    from vibro_cli.grids.dataset import Shard

    try:
        return Shard.read(text)
    except ValueError:
        raise typer.BadParameter(
            f"--shard: found {text!r}, expected I/N such as 3/16, with I from 1 to N"
        ) from None


def load(options: GridCommand) -> "Grid":
    """Load the grid; raise `CommandError` with all its problems if it is invalid."""
    from vibro_cli.commands.shared.loading import refusals_reported
    from vibro_cli.grids.document import load_grid

    with refusals_reported(options.source):
        return load_grid(options.source, options.overrides)


def _workers(options: GridCommand) -> int:
    from vibro_cli.storage.files import available_cores

    return options.workers or available_cores()


def _estimate(options: GridCommand) -> int:
    """Print the estimated cost of the grid: the start, timed here, and the solving."""
    import time

    from vibro_cli.grids.workers import chunks_of, estimate

    begin = time.perf_counter()
    found = load(options)
    _hint_at_stop(found)
    chunks = chunks_of(found, None, options.engine)
    start = time.perf_counter() - begin
    sampled, impacts, seconds, size_each, invalid = estimate(found, options.engine, chunks.stretch)
    workers = _workers(options)
    points = chunks.points
    record = {
        "name": found.name,
        "points": points,
        "chunks": chunks.count,
        "chunk_points": chunks.division,
        "impacts": round(points * impacts),
        "bytes": round(points * size_each),
        "seconds": start + points * seconds / min(workers, points),
        "workers": workers,
        "sampled": sampled,
        "sampled_invalid": invalid,
    }
    if options.as_json:
        print(json_text(record))
    _print_estimate(record, chunks.sizes)
    return DONE


def _hint_at_stop(grid: "Grid") -> None:
    """Say, before points are solved, if some may lack a stop after their last impact."""
    from vibro_cli.grids.document import NO_END, may_lack_an_end

    if may_lack_an_end(grid):
        say(f"{grid.name}: hint: {NO_END}")


def _print_estimate(record: dict[str, Any], sizes: list[int]) -> None:
    """Print the estimated cost of a grid with chunks of these sizes."""
    chunks = counted(record["chunks"], "chunk")
    workers = counted(record["workers"], "worker")
    items = {
        "impacts": f"about {record['impacts']:,}",
        "disk": f"about {size(record['bytes'])}",
        "time": f"about {duration(record['seconds'])} with {workers} "
        f"(from {counted(record['sampled'], 'point')})",
    }
    if record["sampled_invalid"]:
        items["warning"] = (
            f"{record['sampled_invalid']:,} of {counted(record['sampled'], 'point')} solved for "
            "this are invalid or failed; vibro check says why"
        )
    least, most = min(sizes), max(sizes)
    each = f"{least:,}" if least == most else f"{least:,} to {most:,}"
    points = counted(record["points"], "point")
    say(lines_of(f"{record['name']}: {points} in {chunks} of {each}", items))


def _sweep(options: GridCommand) -> int:
    """Solve the missing chunks of the dataset and return the exit code."""
    found = load(options)
    state = sweep(options, found, _workers(options))
    if options.as_json:
        print(json_text(state))
    if not state["complete"]:
        return FAILED
    return NOT_STRICT if options.strict and _unsound(state) else DONE


def sweep(options: GridCommand, grid: "Grid", workers: int) -> dict[str, Any]:
    """Solve the missing chunks of a grid's dataset; return its state as plain values."""
    from vibro_cli.grids.dataset import merge, opened

    whole = options.folder_of(grid)
    shard = None if options.shard is None else _read_shard(options.shard)
    folder = whole if shard is None else shard.folder_in(whole)
    chunks = _chunks(options, grid, folder)
    wanted = None
    if shard is not None:
        if chunks.count < shard.count:
            divided = counted(chunks.count, "chunk")
            say(
                f"{grid.name}: warning: {divided} for {shard.count} shards; a lower chunk_points "
                "in the grid file gives more",
                "warning",
            )
        wanted = shard.wanted_of(whole, grid, chunks)
        if not wanted and not folder.exists():
            why = f"{whole} already has all chunks of this shard"
            if shard.number > chunks.count:
                why = "this shard has no chunks"
            say(f"{grid.name}: {why}; nothing to solve")
            return _state(grid.name, whole, [], complete=True)
    with opened(folder, grid, chunks, options.force, wanted) as dataset:
        if options.merge:
            merge(dataset)
        else:
            if options.repair:
                _drop_damaged(dataset)
            _solve(options, dataset, workers)
    state = _state(grid.name, folder, dataset.receipts.values(), not dataset.missing)
    following = {"next": report_command(folder)}
    if state["inadmissible"] and not options.merge:
        following["hint"] = INADMISSIBLE_HINT
    if shard is not None:
        following = {"next": options.merge_command(), "hint": "merge once all shards are finished"}
    level = "error" if options.strict and _unsound(state) else "info"
    say(_totals(grid.name, state, folder, _first_reason(dataset), following), level, name=grid.name)
    return state


def _unsound(state: dict[str, Any]) -> int:
    """Return the number of points that are invalid, have failed or ended inadmissibly."""
    return sum(state[word] for word in _ODD)


def _chunks(options: GridCommand, grid: "Grid", folder: Path) -> "Chunks":
    """Return the division into chunks: that of an existing folder or shard, else a new one."""
    from vibro_cli.grids.dataset import division_of_shards, known_division
    from vibro_cli.grids.workers import chunks_of

    known = None if options.force else known_division(folder)
    if known is None and options.shard is not None:
        known = known_division(options.folder_of(grid))
    if options.merge and known is None:
        known = division_of_shards(folder)
    return chunks_of(grid, known, options.engine)


def _drop_damaged(dataset: "Dataset") -> None:
    """Drop the receipts of chunks whose files are missing or damaged, and their files.

    A damaged file that stayed would be taken for a finished one after an interruption.
    """
    from vibro_cli.grids.dataset import verify

    damaged = {finding.file for finding in verify(dataset.folder).findings}
    for chunk, receipt in list(dataset.receipts.items()):
        if damaged & set(receipt.files):
            say(f"vibro: chunk {chunk} is damaged and will be solved again", "warning", chunk=chunk)
            for name in receipt.files:
                (dataset.folder / name).unlink(missing_ok=True)
            del dataset.receipts[chunk]


def _solve(options: GridCommand, dataset: "Dataset", workers: int) -> None:
    """Solve the missing chunks; record those that are finished, even after an interruption."""
    from vibro_cli.grids.workers import solve_in_threads, solve_on_cluster

    missing = dataset.missing
    if not missing:
        check = f"vibro verify {in_command(dataset.folder)}"
        say(
            f"{dataset.grid.name}: the folder is already complete; nothing to solve "
            f"({check} checks its files)"
        )
    else:
        _hint_at_stop(dataset.grid)
    if 0 < len(missing) < len(dataset.wanted):
        done = len(dataset.wanted) - len(missing)
        say(f"vibro: continuing after {done:,} of {len(dataset.wanted):,} chunks")
    sizes = dataset.chunks.sizes
    progress = Progress(sum(sizes[chunk] for chunk in missing))
    given = dataset.grid, dataset.chunks, missing, dataset.folder
    if options.dask is None:
        receipts = solve_in_threads(*given, workers, options.engine, progress.add)
    else:
        receipts = solve_on_cluster(*given, options.dask, options.engine, progress.add)
    try:
        for receipt in receipts:
            dataset.add(receipt)
            _check_failures(options, dataset)
    except BaseException as end:
        receipts.close()
        _keep(dataset)
        progress.end()
        if dataset.receipts:
            say("vibro: the same command continues from here", "error")
        else:
            end.add_note("no chunk was finished")
        raise
    progress.end()
    dataset.write_manifest()


def _keep(dataset: "Dataset") -> None:
    """Write the manifest after an interruption; a full disk has already been reported.

    A chunk may have been written whose receipt has not arrived.
    """
    try:
        dataset.write_manifest()
        dataset.find_receipts()
    except OSError:
        say("vibro: the manifest could not be written; no finished chunk is lost")


def _check_failures(options: GridCommand, dataset: "Dataset") -> None:
    most = options.max_failures
    found = sum(one.invalid + one.failed for one in dataset.receipts.values())
    if most is not None and found > most:
        points = counted(found, "point is", "points are")
        text = f"vibro: {points} invalid or failed, --max-failures allows {most}"
        raise CommandError(text, FAILED)


def _state(
    name: str, folder: Path, receipts: "Collection[Receipt]", complete: bool
) -> dict[str, Any]:
    """Return the totals of a dataset as plain values."""
    names = ("points", "impacts", "invalid", "failed")
    causes = sum((Counter(one.end_causes) for one in receipts), Counter[str]())
    return {
        "name": name,
        "folder": str(folder),
        "complete": complete,
        "chunks": len(receipts),
        **{key: sum(getattr(one, key) for one in receipts) for key in names},
        "inadmissible": causes["inadmissible"],
        "end_causes": dict(sorted(causes.items())),
        "bytes": sum(file["bytes"] for one in receipts for file in one.files.values()),
    }


_ODD = ("invalid", "failed", "inadmissible")


def _totals(
    name: str, state: dict[str, Any], folder: Path, reason: str | None, following: dict[str, str]
) -> list[str]:
    from vibro_cli.systems.request import EARLY_ENDS

    odd = [f"{state[word]:,} {word}" for word in _ODD if state[word]]
    sound = ", ".join(odd) or "all valid and admissible"
    causes: dict[str, int] = state["end_causes"]
    early = [f"{causes[cause]:,} {words}" for cause, words in EARLY_ENDS.items() if cause in causes]
    items = {"points": "; ".join([sound, *early])}
    if reason is not None:
        items["example"] = reason
    chunks = counted(state["chunks"], "chunk")
    items["files"] = f"{printable(str(folder))} ({chunks}, {size(state['bytes'])})"
    if state["complete"]:
        items |= following
    points, impacts = counted(state["points"], "point"), counted(state["impacts"], "impact")
    return lines_of(f"{name}: {points}, {impacts}", items)


def _first_reason(dataset: "Dataset") -> str | None:
    """Return the reason of the first invalid or failed point, or None if there is none."""
    from vibro_cli.grids.chunks import file_names
    from vibro_cli.storage.tables import read_parquet

    for chunk, receipt in sorted(dataset.receipts.items()):
        if receipt.invalid + receipt.failed:
            part = dataset.folder / file_names(dataset.grid, chunk)["summary"]
            table = read_parquet(part).select(["scenario", "status", "reason"])
            for row in table.to_pylist():
                if row["status"] != "ok":
                    return f"scenario {row['scenario']} ({row['status']}): {row['reason']}"
    return None
