"""Scenes that several checks share, their runs, and the findings of checks.

Runs that might never end or fill the memory are made in a separate process, which can be ended.
"""

from __future__ import annotations

import math
import multiprocessing
import resource
import signal
from collections.abc import Callable
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Generic, TypeVar

import numpy as np

from vibro_cli.api import simulate
from vibro_cli.assemble import build_system
from vibro_cli.mechanics.system import TraceSystem
from vibro_cli.scenario.loading import any_scenario_of, scenario_of
from vibro_cli.scenario.problems import ScenarioError
from vibro_cli.systems.run import Run
from vibro_cli.systems.trace import simulate_system

Document = dict[str, Any]


@dataclass(frozen=True)
class Plan:
    """The extent of the suite."""

    seed: int
    full: bool
    cases: int | None = None
    """Number of scenes that checks of random scenes draw; None for their own numbers."""

    def amount(self, short: int, long: int) -> int:
        """Return the number of cases for the short or the full form."""
        return long if self.full else short

    def scenes(self, short: int, long: int) -> int:
        """Return the number of random scenes: `cases`, or that of the form."""
        return self.amount(short, long) if self.cases is None else self.cases


@dataclass
class Finding:
    """The greatest of many values of one quantity: one row of the table."""

    check: str = field(default="", kw_only=True)
    """Name of the check (as for ``--only``), set by the suite."""
    quantity: str
    """The measured quantity, with its unit."""
    tried: str
    """The cases on which it is measured."""
    cases: int = field(default=0, kw_only=True)
    """Number of cases."""
    worst: float = field(default=0.0, kw_only=True)
    """The greatest value found."""
    mark: float | None
    """The greatest value allowed; None if the quantity is only reported."""
    scenario: Document | None = field(default=None, kw_only=True)
    """The scenario of the worst case."""

    def take(self, value: float, scenario: Document | None = None) -> None:
        """Include the value of one more case; NaN counts as infinite."""
        self.cases += 1
        value = float("inf") if value != value else float(value)
        if value > self.worst or self.scenario is None:
            self.worst, self.scenario = max(value, self.worst), scenario

    @property
    def met(self) -> bool:
        """Whether the mark is met; always true without a mark, otherwise never for NaN."""
        return self.mark is None or bool(self.worst <= self.mark)  # bool, not numpy.bool_


GRAVITY = 9.81
CIRCLE: Document = {
    "start_slope": "-180 deg",
    "closed": True,
    "arcs": [{"shape": "valley", "radius": 1.0, "end_slope": "180 deg"}],
}


def valley(slope: int) -> Document:
    """Return one valley of radius 1 m between the slopes ``-slope`` and ``slope`` (deg)."""
    return {
        "start_slope": f"-{slope} deg",
        "arcs": [{"shape": "valley", "radius": 1.0, "end_slope": f"{slope} deg"}],
    }


def three_arcs(slope: int) -> Document:
    """Return valleys of radius 1 m beside a hump of 0.5 m, from ``-slope`` to ``slope`` (deg)."""
    return {
        "start_slope": f"-{slope} deg",
        "arcs": [
            {"shape": "valley", "radius": 1.0, "end_slope": "50 deg"},
            {"shape": "hump", "radius": 0.5, "end_slope": "-50 deg"},
            {"shape": "valley", "radius": 1.0, "end_slope": f"{slope} deg"},
        ],
    }


VALLEY, THREE_ARCS = valley(170), three_arcs(120)
WALLS: Document = {"ends": {"left": {"wall": 1.0}, "right": {"wall": 1.0}}}
"""Part of a scenario: elastic walls at both ends of the trace."""


def ball(angle: float, arc: int = 1, **more: Any) -> Document:
    """Return a ball of radius 0.1 m and mass 1 kg at an angle on an arc."""
    return {"radius": 0.1, "mass": 1.0, "arc": arc, "angle": angle, **more}


def scene(
    trace: Document, balls: list[Document], k: float = 1.0, law: str = "normal-impulse", **stop: Any
) -> Document:
    """Return a scenario as a document."""
    document: Document = {"gravity": GRAVITY, "trace": trace, "balls": balls, "stop": stop}
    if len(balls) > 1:
        document["collision"] = {"law": law, "k": k}
    return document


def system_of(document: Document) -> TraceSystem:
    """Build the system of a document."""
    return build_system(scenario_of(document))


def solve(document: Document, engine: str = "python") -> Run:
    """Run the scenario of a document."""
    stop = document["stop"]
    return simulate_system(system_of(document), stop.get("time"), stop.get("collisions"), engine)


def solve_any(document: Document, engine: str = "compiled") -> Run:
    """Run the scenario of a document of any system."""
    return simulate(any_scenario_of(document), engine)


def energies(run: Run, speed: Any, x: Any, y: Any) -> tuple[Any, Any]:
    """Return kinetic and potential energies (J); bodies are along the last axis of the arrays."""
    system = run.system
    mass = np.array([body.mass for body in system.bodies])
    kappa = np.array([body.kappa for body in system.bodies])
    potential = mass * system.gravity * y
    if system.turning is not None:
        potential = potential - 0.5 * mass * system.turning.square * (x - system.turning.x) ** 2
    return 0.5 * kappa * mass * speed**2, potential


def energy_at(run: Run, t: float, side: str) -> float:
    """Return the energy (J), from places and speeds alone, before or after an instant."""
    sample = run.sample([t], side)
    return math.fsum(np.concatenate(energies(run, *(sample[name] for name in ("speed", "x", "y")))))


def energy_gained(run: Run) -> float:
    """Return the relative change of the energy from the start to the end of a run."""
    before = energy_at(run, 0.0, "before")
    after = energy_at(run, run.checkpoint()["end_time"], "after")
    return (after - before) / abs(before)


# Processor time (s), independent of other load; far more than any run takes.
PATIENCE = 20.0

Answer = TypeVar("Answer")


class GivenUp(Exception):
    """Raised if the other process did not answer; the message says why."""


def _limit_memory(function: Callable[[Document], Any], memory: int) -> None:
    """Limit the growth of this process's address space, after small runs, to `memory` bytes."""
    for trace in (VALLEY, {**VALLEY, "turning": {"through_arc": 1, "rate": 1.0}}):
        function(scene(trace, [ball(-0.5), ball(0.5)], 0.9, time=1.0))
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
    most = pages * resource.getpagesize() + memory
    resource.setrlimit(resource.RLIMIT_AS, (most, most))


def _serve(connection: Connection, function: Callable[[Document], Any], memory: int | None) -> None:
    """Answer documents as they come.

    A signal ends the process if a call takes too long, since it may be in machine code.
    """
    if memory is not None:
        _limit_memory(function, memory)
    while True:
        try:
            document, seconds = connection.recv()
        except EOFError:
            return  # the other end is closed
        signal.setitimer(signal.ITIMER_PROF, seconds)
        answer = function(document)
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        connection.send(answer)


class Watched(Generic[Answer]):
    """A function of a document, called in another process, which is started at the first call.

    The function is at the top level of a module and does not raise; `memory` is a limit in bytes.
    """

    def __init__(self, function: Callable[[Document], Answer], memory: int | None = None) -> None:
        self._function = function
        self._memory = memory
        self._process: Any = None
        self._connection: Any = None

    def __call__(self, document: Document, seconds: float = PATIENCE) -> Answer:
        """Return the function's answer, computed within `seconds` of processor time.

        Raises `GivenUp` if there is no answer by then, or the process has ended.
        """
        if self._process is None:
            context = multiprocessing.get_context("spawn")
            self._connection, other = context.Pipe()
            arguments = (other, self._function, self._memory)
            self._process = context.Process(target=_serve, args=arguments, daemon=True)
            self._process.start()
            other.close()
        try:
            self._connection.send((document, seconds))
            answer: Answer = self._connection.recv()
        except (EOFError, OSError):
            self._process.join()
            timed_out = self._process.exitcode == -signal.SIGPROF
            self._process = None
            why = f"no end within {seconds:g} s" if timed_out else "the process ended"
            raise GivenUp(why) from None
        return answer


def _fault(document: Document) -> str:
    try:
        run = solve(document)
        run.sample([run.checkpoint()["end_time"]])
    except ScenarioError:
        return ""
    except Exception as fault:
        return repr(fault)
    return ""


_watched_fault = Watched(_fault)


def fault_of(document: Document, seconds: float = PATIENCE) -> str:
    """Return how a run of a document fails: by an exception or a timeout (s); "" if it does not.

    An invalid scenario is not a failure.
    """
    try:
        return _watched_fault(document, seconds)
    except GivenUp as reason:
        return str(reason)


FAILED = "runs that hang or fail"


def attempted(document: Document, failed: Finding) -> Run | None:
    """Run a document; count a failure in `failed` and return None then."""
    fault = fault_of(document)
    failed.take(float(bool(fault)), document)
    return None if fault else solve(document)
