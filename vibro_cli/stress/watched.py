"""Runs that may never end, in a process of their own, which can be given up."""

from __future__ import annotations

import multiprocessing
import signal
from multiprocessing.connection import Connection
from typing import Any

from vibro_cli.scenario import ScenarioError
from vibro_cli.stress.finding import Document
from vibro_cli.stress.scenes import solve

# Seconds of the processor, however many they are on a busy machine; far more than any run takes.
PATIENCE = 20.0


def _serve(connection: Connection) -> None:
    """Run documents as they come; answer each with a fault, or nothing; to be refused is none.

    A run that takes too long ends the process by a signal: it may be in machine code.
    """
    while True:
        document, seconds = connection.recv()
        signal.setitimer(signal.ITIMER_PROF, seconds)
        try:
            run = solve(document)
            run.sample([run.checkpoint()["end_time"]])
        except ScenarioError:
            answer = ""
        except Exception as fault:
            answer = repr(fault)
        else:
            answer = ""
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        connection.send(answer)


class _Worker:
    """The other process, made when it is first needed."""

    def __init__(self) -> None:
        self._process: Any = None
        self._connection: Any = None

    def _begin(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._connection, other = context.Pipe()
        self._process = context.Process(target=_serve, args=(other,), daemon=True)
        self._process.start()
        other.close()

    def fault(self, document: Document, seconds: float) -> str:
        """What a run of a document comes to grief by, empty if by nothing."""
        if self._process is None:
            self._begin()
        try:
            self._connection.send((document, seconds))
            return str(self._connection.recv())
        except (EOFError, OSError):
            self._process.join()
        timed_out = self._process.exitcode == -signal.SIGPROF
        self._process = None
        return f"no end within {seconds:g} s" if timed_out else "the process ended"


_worker = _Worker()


def fault_of(document: Document, seconds: float = PATIENCE) -> str:
    """What a run of a document comes to grief by: a fault or no end in so many seconds; or ""."""
    return _worker.fault(document, seconds)
