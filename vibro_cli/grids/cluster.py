"""Solving chunks on a Dask cluster: its workers write the parts themselves and return receipts."""

from __future__ import annotations

import ipaddress
import threading
import uuid
from collections.abc import Generator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vibro_cli.errors import VibroError
from vibro_cli.grids.buffers import Rooms
from vibro_cli.grids.chunk_writer import Making
from vibro_cli.grids.chunks import Chunks, Receipt
from vibro_cli.grids.document import Grid
from vibro_cli.grids.solving import Solver, solver_of
from vibro_cli.grids.threads import Told

# Chunks that wait at the scheduler for each thread that solves.
_WAITING = 3
_CONNECT = "30s"
# How often a chunk is handed out whose receipt was lost on the way.
_TRIES = 5


class ClusterError(VibroError):
    """The cluster cannot be used, or has not solved every chunk; the message says why."""


def check_address(address: str) -> None:
    """Raise `ClusterError` unless an address is encrypted, or of this machine."""
    protocol, separator, rest = address.partition("://")
    host = rest.rpartition(":")[0].strip("[]")
    if separator and host and protocol == "tls":
        return
    if separator and protocol == "tcp" and (host == "localhost" or _is_loopback(host)):
        return
    raise ClusterError(
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
    tell: Told,
) -> Generator[Receipt]:
    """Solve chunks on the workers of a Dask scheduler, and give each receipt as it comes.

    A chunk that kills its workers again and again is left out; the others are solved first.

    Raises
    ------
    ClusterError
        If the scheduler cannot be reached or is lost, or chunks were left out.
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
        _wait_for_workers(client, address)
        lost: dict[int, str] = {}
        for chunk, found in _solved(client, grid, chunks, wanted, folder, engine):
            if isinstance(found, Receipt):
                _check_shared(folder, found)
                tell(found.points, found.impacts)
                yield found
            else:
                lost[chunk] = found
        if lost:
            chunk, why = next(iter(lost.items()))
            raise ClusterError(
                f"{len(lost)} of {len(wanted)} chunks were not solved; chunk {chunk}: {why}"
            )


def _silence() -> None:
    """Turn off what the libraries log here: what is worth knowing is told once, as an error."""
    import logging

    for name in list(logging.root.manager.loggerDict):
        if name.partition(".")[0] in ("distributed", "tornado", "asyncio"):
            logging.getLogger(name).setLevel(logging.CRITICAL + 1)


def _wait_for_workers(client: Any, address: str) -> None:
    try:
        client.wait_for_workers(1, timeout=_CONNECT)
    except TimeoutError as error:
        text = f"the Dask scheduler at {address} has had no worker for {_CONNECT}"
        raise ClusterError(text) from error


def _solved(
    client: Any, grid: Grid, chunks: Chunks, wanted: Sequence[int], folder: Path, engine: str
) -> Generator[tuple[int, Receipt | str]]:
    """Every chunk with its receipt, or with why there is none."""
    from concurrent.futures import CancelledError

    from distributed import as_completed
    from distributed.comm.core import CommClosedError

    given = _Submitter(client, grid, chunks, folder, engine)
    left = iter(wanted)
    threads = sum(client.nthreads().values()) or 1
    ordered: Any = as_completed
    first = [given.submit(n) for _, n in zip(range(_WAITING * threads), left, strict=False)]
    stream = ordered(first, loop=client.loop)
    for future in stream:
        chunk = given.chunk_of(future)
        try:
            yield chunk, future.result()
        except (CommClosedError, CancelledError) as error:
            # A receipt is lost with the worker that has it; the chunk is solved again.
            if client.status != "running" or given.tries(chunk) >= _TRIES:
                raise ClusterError(f"the Dask scheduler is lost: {_line(error)}") from error
            stream.add(given.submit(chunk))
            continue
        except Exception as error:
            yield chunk, _line(error)
        following = next(left, None)
        if following is not None:
            stream.add(given.submit(following))


class _Submitter:
    """Hands chunks to a cluster."""

    def __init__(self, client: Any, grid: Grid, chunks: Chunks, folder: Path, engine: str) -> None:
        self._client = client
        self._arguments = (chunks, str(folder.absolute()), engine)
        self._grid = grid
        self._run = uuid.uuid4().hex[:12]
        self._tries: dict[int, int] = {}
        self._chunks: dict[str, int] = {}

    def submit(self, chunk: int) -> Any:
        """Have a chunk solved; return its future."""
        chunks, folder, engine = self._arguments
        self._tries[chunk] = self.tries(chunk) + 1
        key = f"vibro-{self._run}-{chunk}-{self._tries[chunk]}"
        self._chunks[key] = chunk
        return self._client.submit(
            solve_chunk, self._run, self._grid, chunks, chunk, folder, engine, key=key, pure=False
        )

    def chunk_of(self, future: Any) -> int:
        """Return the chunk of a future."""
        return self._chunks[future.key]

    def tries(self, chunk: int) -> int:
        """Return how often a chunk was handed out."""
        return self._tries.get(chunk, 0)


def _check_shared(folder: Path, receipt: Receipt) -> None:
    for name, described in receipt.files.items():
        path = folder / name
        if not path.is_file() or path.stat().st_size != described["bytes"]:
            raise ClusterError(
                f"{path} was written by a worker and is not here; "
                "expected workers that share the folder"
            )


def _line(error: BaseException) -> str:
    """An error on one line."""
    return " ".join(f"{type(error).__name__}: {error}".split())[:300]


_of_thread = threading.local()


def solve_chunk(
    run: str, grid: Grid, chunks: Chunks, chunk: int, folder: str, engine: str
) -> Receipt:
    """Solve one chunk on a worker, write its parts, and return their receipt.

    ``run`` tells chunks of one grid from those of another.
    """
    if getattr(_of_thread, "run", None) != run:
        _of_thread.solver = solver_of(grid, engine)
        _of_thread.rooms = Rooms()
        _of_thread.run = run
    solver: Solver = _of_thread.solver
    making = Making.of(grid, chunks, chunk, _of_thread.rooms)
    for number, stretch in enumerate(chunks.stretches(chunk)):
        made = making.add(number, solver.solve(np.arange(*stretch)))
    assert made is not None
    receipt = made.write(Path(folder))
    made.give_back()
    return receipt
