"""Solving chunks with threads of this process: the compiled kernels leave the interpreter free."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

import numpy as np

from vibro_cli.grids.chunks import Chunks, Encoded, Receipt, encode_chunk
from vibro_cli.grids.document import Grid
from vibro_cli.grids.room import Room
from vibro_cli.grids.solving import Solved
from vibro_cli.grids.systems import system_of_grid

Told = Callable[[int, int], None]
"""Called with the points and impacts of every stretch that is solved."""


class _Work:
    """The stretches of all chunks, handed out in order; a chunk is written when it is whole."""

    def __init__(self, chunks: Chunks, wanted: Sequence[int]) -> None:
        self._lock = threading.Lock()
        self._next = self._stretches(chunks, wanted)
        self._solved: dict[int, list[Solved | None]] = {}
        self._left: dict[int, int] = {}

    def _stretches(
        self, chunks: Chunks, wanted: Sequence[int]
    ) -> Iterator[tuple[int, int, int, int]]:
        for chunk in wanted:
            stretches = chunks.stretches(chunk)
            self._solved[chunk] = [None] * len(stretches)
            self._left[chunk] = len(stretches)
            for number, (first, last) in enumerate(stretches):
                yield chunk, number, first, last

    def take(self) -> tuple[int, int, int, int] | None:
        """Return chunk, number, first point and end of the next stretch, None after the last."""
        with self._lock:
            return next(self._next, None)

    def put(self, chunk: int, number: int, solved: Solved) -> list[Solved] | None:
        """Take in a solved stretch; return all of its chunk if it was the last one missing."""
        with self._lock:
            self._solved[chunk][number] = solved
            self._left[chunk] -= 1
            if self._left[chunk]:
                return None
            del self._left[chunk]
            return [one for one in self._solved.pop(chunk) if one is not None]


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
    if engine == "numba":
        system_of_grid(grid).solver(grid, engine).compile()  # here, where it can be interrupted
    work = _Work(chunks, wanted)
    receipts: queue.SimpleQueue[Receipt | BaseException | None] = queue.SimpleQueue()
    stop = threading.Event()

    def write(parts: Encoded) -> None:
        receipts.put(parts.write(folder))

    def serve(disk: ThreadPoolExecutor) -> None:
        try:
            solver, room = system_of_grid(grid).solver(grid, engine), Room()
            writing: Future[None] | None = None
            while not stop.is_set() and (taken := work.take()) is not None:
                chunk, number, first, last = taken
                solved = solver.solve(np.arange(first, last))
                tell(last - first, solved.impacts)
                whole = work.put(chunk, number, solved)
                if whole is not None:
                    if writing is not None:
                        writing.result()  # its parts are in the room
                    parts = encode_chunk(grid, chunks, chunk, whole, room)
                    writing = disk.submit(write, parts)
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
