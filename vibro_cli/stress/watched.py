"""Runs that may never end, in a process of their own, which can be given up."""

from __future__ import annotations

import multiprocessing
from multiprocessing.connection import Connection
from typing import Any

from vibro_cli.scenario import ScenarioError
from vibro_cli.stress.finding import Document
from vibro_cli.stress.scenes import solve

# Seconds of waiting; far more than any of the runs takes, on a busy machine too.
PATIENCE = 20.0


def _serve(connection: Connection) -> None:
    """Run documents as they come; answer each with a fault, or nothing; to be refused is none."""
    while True:
        document = connection.recv()
        try:
            run = solve(document)
            run.sample([run.checkpoint()["end_time"]])
        except ScenarioError:
            connection.send("")
        except Exception as fault:
            connection.send(repr(fault))
        else:
            connection.send("")


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
            self._connection.send(document)
            if self._connection.poll(seconds):
                return str(self._connection.recv())
            answer = f"no end within {seconds:g} s"
        except (EOFError, OSError):
            answer = "the process ended"
        self._process.kill()
        self._process.join()
        self._process = None
        return answer


_worker = _Worker()


def fault_of(document: Document, seconds: float = PATIENCE) -> str:
    """What a run of a document comes to grief by: a fault or no end in so many seconds; or ""."""
    return _worker.fault(document, seconds)
