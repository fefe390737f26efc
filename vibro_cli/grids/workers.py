"""Solve a grid with threads of this process, or with the workers of a Dask cluster.

A few points are solved first, to estimate the number of impacts and choose the size of chunks.
"""

from __future__ import annotations

import ipaddress
import mmap
import threading
import time
import uuid
from collections import Counter
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from vibro_cli.errors import Failure, VibroError
from vibro_cli.grids.axes import Array
from vibro_cli.grids.chunk_writer import ChunkWriter, Encoded, part_bytes
from vibro_cli.grids.chunks import Chunks, Division, Expected, Receipt, has_many_parts
from vibro_cli.grids.dataset import has_size, known_division, opened
from vibro_cli.grids.document import Grid
from vibro_cli.grids.solving import Solver, counts_of, solver_of
from vibro_cli.scenario.models import section
from vibro_cli.storage.files import available_cores

Report = Callable[[int, int], None]
"""Called with the numbers of points and impacts of every solved stretch."""


def _stretches(
    grid: Grid, chunks: Chunks, wanted: Sequence[int]
) -> Iterator[tuple[ChunkWriter, int, Array]]:
    """Yield the stretches of all chunks, in order: writer, number in the chunk, and points."""
    spare: list[mmap.mmap] = []
    for chunk in wanted:
        writer = ChunkWriter.of(grid, chunks, chunk, spare)
        for number, stretch in enumerate(chunks.stretches(chunk)):
            yield writer, number, np.arange(*stretch)


def solve_in_threads(
    grid: Grid,
    chunks: Chunks,
    wanted: Sequence[int],
    folder: Path,
    threads: int,
    engine: str,
    report: Report,
) -> Generator[Receipt]:
    """Solve chunks, and yield the receipt of each as soon as it is on disk.

    An error in a thread (a full disk) stops all threads and is raised here. If the caller stops,
    every thread abandons its chunk after its present batch of points or impacts.
    """
    left, stop, own = _stretches(grid, chunks, wanted), threading.Event(), threading.local()

    def solve(writer: ChunkWriter, number: int, points: Array) -> Encoded | None:
        if not hasattr(own, "solver"):
            own.solver = solver_of(grid, engine)
            own.solver.interrupted = stop.is_set
        solved = own.solver.solve(points)
        if stop.is_set():
            return None
        report(len(points), solved.impacts)
        return writer.add(number, solved)

    # Separate threads wait for the disk, so that solvers never do.
    with ThreadPoolExecutor(threads) as solvers, ThreadPoolExecutor(threads) as writers:
        under_way: set[Future[Any]] = set()
        try:
            while True:
                room = 2 * threads - len(under_way)
                under_way |= {solvers.submit(solve, *one) for one in islice(left, room)}
                if not under_way:
                    return
                done, under_way = wait(under_way, return_when=FIRST_COMPLETED)
                for future in done:
                    found = future.result()
                    if isinstance(found, Encoded):
                        under_way.add(writers.submit(found.write, folder))
                    elif isinstance(found, Receipt):
                        yield found
        finally:
            stop.set()
            solvers.shutdown(cancel_futures=True)


# Number of sampled points that determine the division; it must not depend on the machine.
_POINTS = 32
_MOST_IMPACTS = 500
# Sampling of a grid with many parts: impacts per block, greatest number of blocks, sampled points
# per block, and least ratio of points to sampled points.
_IMPACTS_OF_A_BLOCK = 50_000
_MOST_BLOCKS = 4096
_POINTS_OF_A_BLOCK = 16
_LEAST_SHARE = 100
_GOLDEN = 0.5 * (5.0**0.5 - 1.0)
# Points with more than `_MOST_IMPACTS` count as having this many times as many, if the stop allows.
_MANY = 10.0
# Least time (s) for timing a sample.
_TIMED = 0.3


def spread(grid: Grid, count: int) -> Array:
    """Return the indices of about `count` points spread over a grid, along each of its axes."""
    points = grid.design.points
    if count >= points:
        return np.arange(points)
    # Equal steps would repeat the same values of the last axes.
    shares = (0.5 + _GOLDEN * np.arange(count)) % 1.0
    return np.unique((shares * points).astype(np.int64))


def expected_impacts(grid: Grid) -> Expected:
    """Return the expected numbers of impacts per point, which are the same on every machine."""
    stop = section(grid.base.data, "stop")
    given = [stop.get(name) for name in grid.counted]
    limits = [float(most) for most in given if isinstance(most, int) and most > 0]
    limit = sum(limits) if len(limits) == len(given) else _MANY * _MOST_IMPACTS
    free = [name for name in grid.counted if ("stop", name) not in grid.design.paths]
    limited = grid.stopped_at(min(int(limit), _MOST_IMPACTS), free)
    solved = solver_of(limited.without_collisions()).solve(spread(grid, _POINTS)).summary
    counts = counts_of(solved, grid)
    counts = np.where(counts >= _MOST_IMPACTS, limit, counts)
    return Expected(float(np.mean(counts)), float(np.max(counts)))


def impact_density(grid: Grid, impacts: Expected, engine: str) -> Array | None:
    """Return the expected impacts per point in equal sections of a grid, None if it has few parts.

    The result is the same with either engine, on every machine.
    """
    if not has_many_parts(grid, impacts):
        return None
    points = grid.design.points
    blocks = int(points * impacts.mean / _IMPACTS_OF_A_BLOCK)
    blocks = max(1, min(blocks, _MOST_BLOCKS, points // (_LEAST_SHARE * _POINTS_OF_A_BLOCK)))
    shares = (np.arange(_POINTS_OF_A_BLOCK) * _GOLDEN) % 1.0
    sample = ((np.arange(blocks)[:, None] + shares) * (points / blocks)).astype(np.int64)
    distinct, places = np.unique(sample, return_inverse=True)
    solver = solver_of(grid.without_collisions(), engine)
    solved = solver.solve(distinct).summary
    counts = counts_of(solved, grid)
    density: Array = counts[places].reshape(sample.shape).mean(axis=1)
    return density


def chunks_of(grid: Grid, known: Division | None, engine: str) -> Chunks:
    """Return the division of a grid: the known one of its folder, or one by expected impacts."""
    expected = expected_impacts(grid)
    fits = not isinstance(known, tuple) or sum(known) == grid.design.points
    if known is not None and fits and grid.chunk_points is None:
        return Chunks.of_division(grid, known, expected)
    return Chunks.of(grid, expected, impact_density(grid, expected, engine))


def estimate(grid: Grid, engine: str, stretch: int) -> tuple[int, float, float, float, int]:
    """Time the solution of points spread over the grid, in batches of `stretch` points.

    Returns the number of these points, per point the mean number of impacts, the time in one
    thread (s) and the bytes on disk, and how many of the points are invalid or failed.
    """
    solver = solver_of(grid, engine)
    solver.solve(spread(grid, 1))  # prepares what all points share
    count = 16
    while True:
        points = spread(grid, count)
        begin = time.perf_counter()
        solved = [
            solver.solve(points[first : first + stretch])
            for first in range(0, len(points), stretch)
        ]
        taken = time.perf_counter() - begin
        if taken >= _TIMED or len(points) == grid.design.points:
            break
        count *= 4
    impacts = sum(one.impacts for one in solved)
    odd = sum(int(np.count_nonzero(one.summary["status"] != "ok")) for one in solved)
    size = part_bytes(grid, solved, points)
    return len(points), impacts / len(points), taken / len(points), size, odd


def solve_into(folder: Path, grid: Grid, workers: int, force: bool) -> None:
    """Solve the missing chunks of a grid in a folder, with `workers` threads, 0 for one per core.

    `force` replaces a different grid in the folder. Raises as :func:`dataset.opened`, and
    ``OSError`` if a part cannot be written.
    """
    chunks = chunks_of(grid, None if force else known_division(folder), "compiled")
    with opened(folder, grid, chunks, force) as dataset:
        threads = workers or available_cores()
        given = grid, chunks, dataset.missing, folder, threads, "compiled"
        try:
            for receipt in solve_in_threads(*given, lambda points, impacts: None):
                dataset.add(receipt)
        finally:
            dataset.write_manifest()


# Chunks queued at the scheduler per solving thread.
_WAITING = 3
_CONNECT = "30s"
# How often a chunk is submitted if its receipt is lost.
_TRIES = 5


class ClusterError(Failure):
    """The cluster cannot be used, or did not solve all chunks; the message says why."""


class UnsafeAddress(VibroError):
    """An address that lets anybody on the network run programs on the workers."""


def check_address(address: str) -> None:
    """Raise `UnsafeAddress` unless an address is encrypted or local."""
    protocol, separator, rest = address.partition("://")
    host = rest.rpartition(":")[0].strip("[]")
    if separator and host and protocol == "tls":
        return
    if separator and protocol == "tcp" and (host == "localhost" or _is_loopback(host)):
        return
    raise UnsafeAddress(
        f'found the address "{address}", expected tls://host:port, or tcp://localhost:port: '
        "without encryption anybody on the network could run programs on the workers"
    )


def _is_loopback(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def solve_on_cluster(
    grid: Grid,
    chunks: Chunks,
    wanted: Sequence[int],
    folder: Path,
    address: str,
    engine: str,
    report: Report,
) -> Generator[Receipt]:
    """Solve chunks on the workers of a Dask scheduler, and yield each receipt when it arrives.

    A chunk that repeatedly kills its workers is skipped; an error follows once all other chunks are
    solved.

    Raises `UnsafeAddress` unless the address is encrypted or local; `ClusterError` if the scheduler
    cannot be reached or is lost, or if chunks were skipped.
    """
    check_address(address)
    from distributed import Client

    _silence()
    connect: Any = Client
    try:
        client = connect(address, timeout=_CONNECT, set_as_default=False, name="vibro")
    except (TimeoutError, OSError, ValueError) as error:
        raise ClusterError(f"no Dask scheduler at {address}: {_line(error)}") from error
    with client:
        try:
            client.wait_for_workers(1, timeout=_CONNECT)
        except TimeoutError as error:
            text = f"the Dask scheduler at {address} has had no worker for {_CONNECT}"
            raise ClusterError(text) from error
        lost: dict[int, str] = {}
        for chunk, found in _solved(client, grid, chunks, wanted, folder, engine):
            if isinstance(found, Receipt):
                _check_shared(folder, found)
                report(found.points, found.impacts)
                yield found
            else:
                lost[chunk] = found
        if lost:
            chunk, why = next(iter(lost.items()))
            raise ClusterError(
                f"{len(lost)} of {len(wanted)} chunks were not solved; chunk {chunk}: {why}"
            )


def _silence() -> None:
    """Disable the logging of the Dask libraries: relevant faults are raised as errors."""
    import logging

    for name in list(logging.root.manager.loggerDict):
        if name.partition(".")[0] in ("distributed", "tornado", "asyncio"):
            logging.getLogger(name).setLevel(logging.CRITICAL + 1)


def _solved(
    client: Any, grid: Grid, chunks: Chunks, wanted: Sequence[int], folder: Path, engine: str
) -> Generator[tuple[int, Receipt | str]]:
    """Yield every chunk with its receipt, or with the reason why it has none."""
    from concurrent.futures import CancelledError

    from distributed import as_completed
    from distributed.comm.core import CommClosedError

    run, place = uuid.uuid4().hex[:12], str(folder.absolute())
    tries, chunk_of = Counter[int](), dict[str, int]()

    def submit(chunk: int) -> Any:
        """Submit a chunk, possibly again; return its future."""
        tries[chunk] += 1
        key = f"vibro-{run}-{chunk}-{tries[chunk]}"
        chunk_of[key] = chunk
        return client.submit(
            solve_chunk, run, grid, chunks, chunk, place, engine, key=key, pure=False
        )

    left = iter(wanted)
    threads = sum(client.nthreads().values()) or 1
    ordered: Any = as_completed
    first = [submit(n) for _, n in zip(range(_WAITING * threads), left, strict=False)]
    stream = ordered(first, loop=client.loop)
    for future in stream:
        chunk = chunk_of[future.key]
        try:
            yield chunk, future.result()
        except (CommClosedError, CancelledError) as error:
            # A receipt is lost if its worker is; the chunk is solved again.
            if client.status != "running" or tries[chunk] >= _TRIES:
                raise ClusterError(f"lost the Dask scheduler: {_line(error)}") from error
            stream.add(submit(chunk))
            continue
        except Exception as error:
            yield chunk, _line(error)
        following = next(left, None)
        if following is not None:
            stream.add(submit(following))


def _check_shared(folder: Path, receipt: Receipt) -> None:
    for name, described in receipt.files.items():
        if not has_size(folder / name, described):
            raise ClusterError(
                f"{folder / name} was written by a worker and is not here; "
                "expected workers that share the folder"
            )


def _line(error: BaseException) -> str:
    return " ".join(f"{type(error).__name__}: {error}".split())[:300]


_of_thread = threading.local()


def solve_chunk(
    run: str, grid: Grid, chunks: Chunks, chunk: int, folder: str, engine: str
) -> Receipt:
    """Solve one chunk on a worker, write its parts, and return their receipt.

    ``run`` identifies the grid, so that a worker's thread can reuse its solver.
    """
    if getattr(_of_thread, "run", None) != run:
        _of_thread.solver, _of_thread.spare = solver_of(grid, engine), []
        _of_thread.run = run
    solver: Solver = _of_thread.solver
    writer = ChunkWriter.of(grid, chunks, chunk, _of_thread.spare)
    for number, stretch in enumerate(chunks.stretches(chunk)):
        made = writer.add(number, solver.solve(np.arange(*stretch)))
    assert made is not None
    return made.write(Path(folder))
