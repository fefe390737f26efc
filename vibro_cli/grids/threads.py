"""Solving chunks with threads of this process: the compiled kernels leave the interpreter free."""

from __future__ import annotations

import os
import queue
import threading
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

import numpy as np

from vibro_cli.grids.chunks import Chunks, Receipt
from vibro_cli.grids.document import Grid
from vibro_cli.grids.parts import Encoded, Making
from vibro_cli.grids.room import Rooms
from vibro_cli.grids.systems import solver_of

Told = Callable[[int, int], None]
"""Called with the points and impacts of every stretch that is solved."""


class _Stretch(NamedTuple):
    """A stretch to be solved."""

    parts: Making
    """Of its chunk."""
    number: int
    first: int
    last: int
    """Its first point and the one after its last."""


class _Work:
    """The stretches of all chunks, handed out in order."""

    def __init__(self, grid: Grid, chunks: Chunks, wanted: Sequence[int]) -> None:
        self._lock = threading.Lock()
        self._rooms = Rooms()
        self._next = self._stretches(grid, chunks, wanted)

    def _stretches(self, grid: Grid, chunks: Chunks, wanted: Sequence[int]) -> Iterator[_Stretch]:
        for chunk in wanted:
            parts = Making.of(grid, chunks, chunk, self._rooms)
            for number, (first, last) in enumerate(chunks.stretches(chunk)):
                yield _Stretch(parts, number, first, last)

    def take(self) -> _Stretch | None:
        """Return the next stretch, None after the last."""
        with self._lock:
            return next(self._next, None)


def available_cores() -> int:
    """Return how many processors this process may use."""
    if hasattr(os, "sched_getaffinity"):  # Linux
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def solve_in_threads(
    grid: Grid,
    chunks: Chunks,
    wanted: Sequence[int],
    folder: Path,
    threads: int,
    engine: str,
    tell: Told,
) -> Generator[Receipt]:
    """Solve chunks, and give the receipt of each as soon as it is on the disk.

    What goes wrong in a thread (a full disk) stops all of them and is raised here. When the caller
    stops, every thread drops its chunk after the stretch at hand.
    """
    work = _Work(grid, chunks, wanted)
    receipts: queue.SimpleQueue[Receipt | BaseException | None] = queue.SimpleQueue()
    stop = threading.Event()

    def write(parts: Encoded) -> None:
        receipt = parts.write(folder)
        parts.give_back()
        receipts.put(receipt)

    def serve(disk: ThreadPoolExecutor) -> None:
        try:
            solver = solver_of(grid, engine)
            writing: Future[None] | None = None
            while not stop.is_set() and (taken := work.take()) is not None:
                solved = solver.solve(np.arange(taken.first, taken.last))
                tell(taken.last - taken.first, solved.impacts)
                made = taken.parts.add(taken.number, solved)
                if made is not None:
                    if writing is not None:
                        writing.result()  # no more than one chunk of each thread waits
                    writing = disk.submit(write, made)
            if writing is not None:
                writing.result()
        except BaseException as error:
            receipts.put(error)
        finally:
            receipts.put(None)

    # The disk is waited for by threads of its own; those that solve have something else to do.
    with ThreadPoolExecutor(threads) as disk:
        crew = [threading.Thread(target=serve, args=(disk,), daemon=True) for _ in range(threads)]
        for thread in crew:
            thread.start()
        try:
            yield from _given(receipts, len(crew))
        finally:
            stop.set()
            for thread in crew:
                thread.join()


def _given(
    receipts: queue.SimpleQueue[Receipt | BaseException | None], running: int
) -> Iterator[Receipt]:
    """Receipts until all threads are done."""
    while running:
        try:
            # Waiting without an end would keep signals from being seen.
            got = receipts.get(timeout=0.1)
        except queue.Empty:
            continue
        if got is None:
            running -= 1
        elif isinstance(got, BaseException):
            raise got
        else:
            yield got
