"""`vibro grid`: sweep parameters of a scenario into a dataset."""

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vibro_cli.commands.boundary import DONE, FAILED, NOT_STRICT, CommandError, say
from vibro_cli.commands.completing import scenario_files
from vibro_cli.commands.options import Engine, Overrides, Strict, Task
from vibro_cli.commands.streams import json_text

if TYPE_CHECKING:
    from vibro_cli.grids.document import Grid
    from vibro_cli.grids.shards import Shard

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
    from vibro_cli.grids.shards import Shard

    try:
        return Shard.read(text)
    except ValueError:
        raise typer.BadParameter(
            f"found {text!r}, expected I/N such as 3/16", param_hint="--shard"
        ) from None


def load(wishes: Wishes) -> "Grid":
    """The grid that was asked for; raises `CommandError` with every problem of it."""
    from dataclasses import asdict

    from vibro_cli.commands.boundary import reason
    from vibro_cli.grids.document import load_grid
    from vibro_cli.scenario import ScenarioError

    try:
        return load_grid(wishes.source, wishes.overrides)
    except ScenarioError as error:
        problems = [asdict(problem) for problem in error.problems]
        raise CommandError(str(error), problems=problems) from error
    except OSError as error:
        raise CommandError(f"{wishes.source}: cannot be read: {reason(error)}") from error


def _workers(wishes: Wishes) -> int:
    from vibro_cli.grids.threads import available_cores

    return wishes.workers or available_cores()


def _estimate(wishes: Wishes) -> int:
    """Say what the grid would take: the start, which is made here too, and the solving."""
    import time

    from vibro_cli.commands.words import count, duration, lines_of, size
    from vibro_cli.grids.chunks import Chunks
    from vibro_cli.grids.threads import estimate, expected_impacts, impact_density

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
    from vibro_cli.commands.sweeping import sweep

    found = load(wishes)
    state = sweep(wishes, found, _workers(wishes))
    if wishes.as_json:
        print(json_text(state))
    if not state["complete"]:
        return FAILED
    unsound = state["invalid"] + state["failed"] + state["inadmissible"]
    return NOT_STRICT if wishes.strict and unsound else DONE
