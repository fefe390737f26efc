"""What must hold for every text: a scenario or a ScenarioError, in little time and memory."""

import resource
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from tests.effort import processor_time
from tests.fuzz.mutation import mutated
from tests.scenario.texts import parse_any
from vibro_cli.assemble import build_any
from vibro_cli.scenario import ScenarioError

LONGEST = 1.0
"""Time (s) of the processor that a text may take."""
MOST_MEMORY = 300
"""Peak memory (MB) of the process."""
UNFORESEEN = "a text that cannot be read ("
"""What is said of an exception of a parser that nobody thought of."""


@dataclass
class Found:
    """The outcomes of some texts."""

    valid: int = 0
    invalid: int = 0
    slowest: float = 0.0
    longest: float = LONGEST
    """Time (s) of the processor from which on a text is a fault."""
    faults: list[str] = field(default_factory=list)


def judge(form: str, numbers: range, longest: float = LONGEST) -> Found:
    """Parse and build the texts with these numbers."""
    found = Found(longest=longest)
    for number in numbers:
        text = mutated(form, number)
        judge_one(partial(_read_and_build, text, form), found, f"{form} {number}")
    return found


def _read_and_build(text: str, form: str) -> None:
    build_any(parse_any(text, form))


def judge_one(read: Callable[[], object], found: Found, name: str) -> None:
    """Parse one text, and record the outcome."""
    begin = time.process_time()
    try:
        read()
        found.valid += 1
    except ScenarioError as error:
        found.invalid += 1
        if not error.problems or not str(error).strip():
            found.faults.append(f"{name}: an error that says nothing")
        if UNFORESEEN in str(error):
            found.faults.append(f"{name}: {error}")
    except Exception as fault:
        found.faults.append(f"{name}: {type(fault).__name__}: {fault}")
    taken = time.process_time() - begin
    if taken > found.longest:
        # The machine may have been busy: the least of several is the time of the text.
        taken = min(taken, processor_time(partial(_whatever_comes, read)))
    found.slowest = max(found.slowest, taken)
    if taken > found.longest:
        found.faults.append(f"{name}: {taken:.1f} s")


def _whatever_comes(read: Callable[[], object]) -> None:
    """Parse a text whose outcome has been recorded."""
    with suppress(Exception):
        read()


def peak_memory() -> float:
    """Largest memory (MB) this process has had.

    On Linux the peak that getrusage tells outlives exec: a process started by a larger one
    would answer with the size of its parent.
    """
    status = Path("/proc/self/status")
    if status.exists():
        peak = next(line for line in status.read_text().splitlines() if line.startswith("VmHWM"))
        return int(peak.split()[1]) * 1024 / 1e6
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e6
