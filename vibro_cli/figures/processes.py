"""Many figures of stored runs, drawn by several processes with the results of one.

The other processes are children in sessions of their own, not those of `multiprocessing`: these
import the script of the user again and receive Ctrl-C.
"""

from __future__ import annotations

import gc
import os
import pickle
import subprocess
import sys
import threading
import warnings
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import chain
from typing import Any, TypeVar

from vibro_cli.storage.files import available_cores
from vibro_cli.storage.stored import StoredRun

Child = subprocess.Popen[bytes]
Result = TypeVar("Result")
Job = tuple[int, tuple[Any, ...]]
"""The place of a run among several (from 0), and further arguments of the drawing function."""

_LEAST = 5
"""Least number of jobs per process, which starts in the time of about three."""
_MOST = 8
"""Greatest number of processes: each takes some 200 MB."""
_MOST_IMPACTS = 1_000_000
"""Greatest number of impacts in all processes together: their figures take another 1 to 2 GB."""


def each_drawn(
    draw: Callable[..., Result], runs: Sequence[StoredRun], jobs: Sequence[Job]
) -> list[Result]:
    """Return `draw(run, *arguments)` for every job, in order.

    Many jobs on stored runs are shared with other processes, which solve the runs again if they
    need their motion. A job that another process has not finished when no other is left, or during
    which it ended, failed or warned, is done here, so that errors and warnings are the same as with
    one process. `draw` has to be a function at the top level of a module.
    """
    count = min(available_cores(), _MOST, len(jobs) // _LEAST, _most_of(runs))
    left, found = deque(range(len(jobs))), dict[int, Result]()

    def work_here() -> None:
        for number in chain(_taken(left.popleft), range(len(jobs))):
            if number not in found:
                place, arguments = jobs[number]
                found[number] = draw(runs[place], *arguments)

    def work_there(process: Child) -> None:
        with suppress(Exception):
            _send(process, (draw, [replace(run, _solved=None) for run in runs]))
            # From the other end: few runs are then solved in more than one process.
            for number in _taken(left.pop):
                _send(process, jobs[number])
                found[number] = pickle.load(process.stdout)  # type: ignore[arg-type]

    _beside(work_there, count - 1, work_here)
    return [found[number] for number in range(len(jobs))]


def _most_of(runs: Sequence[StoredRun]) -> int:
    """Return how many processes there is memory for, as each may hold the longest of the runs."""
    if any(run.place is None for run in runs):  # in the memory of this process
        return 1
    counts = (run.summary.get(name) or 0 for run in runs for name in ("collisions", "bounces"))
    return _MOST_IMPACTS // max(*counts, 1)


def _taken(take: Callable[[], int]) -> Iterator[int]:
    """Yield numbers taken from a deque that several threads take from, until it is empty."""
    with suppress(IndexError):
        while True:
            yield take()


def _send(process: Child, message: Any) -> None:
    assert process.stdin is not None
    pickle.dump(message, process.stdin)
    process.stdin.flush()


def _beside(
    work_there: Callable[[Child], None],
    others: int,
    work_here: Callable[[], None],
) -> None:
    """Work here and, each from a thread, in other processes, which end with the work here."""
    processes: list[Child] = []
    threads: list[threading.Thread] = []
    try:
        with suppress(OSError, RuntimeError):  # no further process or thread is permitted
            for _ in range(others):
                processes.append(_started())
                thread = threading.Thread(target=work_there, args=processes[-1:])
                thread.start()
                threads.append(thread)
        work_here()
    finally:
        for process in processes:
            process.kill()
        for thread in threads:
            thread.join()
        for process in processes:
            with suppress(BrokenPipeError), process:  # closes its pipes
                pass


def _started() -> Child:
    """Start a process that executes `_serve`, with the modules of this one."""
    # Python ignores entries of sys.path that are no strings, and may not know its executable.
    folders = [entry for entry in sys.path if isinstance(entry, str)]
    return subprocess.Popen(
        [sys.executable or "", "-P", "-m", __name__],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,  # whatever fails is done again, and reported, by the caller
        env={**os.environ, "PYTHONPATH": os.pathsep.join(folders)},
        start_new_session=True,
    )


def _serve() -> None:
    """Draw what is requested on standard input until it is closed, as when the caller has ended.

    An error or a warning ends the process.
    """
    warnings.showwarning = _raised
    gc.set_threshold(50_000, 4, 2)  # drawing triggers many garbage collections
    requests, answers = sys.stdin.buffer, os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # nothing that is printed may come between the answers
    draw, runs = pickle.load(requests)
    gc.freeze()
    held, run = -1, None
    with suppress(EOFError):
        while True:
            place, arguments = pickle.load(requests)
            if place != held:  # of the others nothing is kept in memory
                held, run = place, replace(runs[place])
                gc.collect()
            pickle.dump(draw(run, *arguments), answers)
            answers.flush()


def _raised(message: Warning | str, category: type[Warning], *place: Any, **more: Any) -> None:
    raise category(message)


if __name__ == "__main__":
    _serve()
