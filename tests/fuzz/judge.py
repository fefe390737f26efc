"""What must hold for every text: a scenario or a ScenarioError, soon, and in little memory."""

import resource
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path

from tests.fuzz.mutation import mutated
from vibro_cli.build import build_system
from vibro_cli.scenario import ScenarioError, parse_scenario

LONGEST = 1.0
"""Time (s) of the processor that a text may take."""
MOST_MEMORY = 300
"""Peak memory (MB) of the process."""


@dataclass
class Found:
    """What became of some texts."""

    valid: int = 0
    invalid: int = 0
    slowest: float = 0.0
    faults: list[str] = field(default_factory=list)


def judge(form: str, numbers: range) -> Found:
    """Read and build the texts with these numbers."""
    found = Found()
    for number in numbers:
        text = mutated(form, number)
        begin = time.process_time()
        try:
            build_system(parse_scenario(text, form))
            found.valid += 1
        except ScenarioError as error:
            found.invalid += 1
            if not error.problems or not str(error).strip():
                found.faults.append(f"{form} {number}: an error that says nothing")
        except Exception as fault:
            found.faults.append(f"{form} {number}: {type(fault).__name__}: {fault}")
        taken = time.process_time() - begin
        found.slowest = max(found.slowest, taken)
        if taken > LONGEST:
            found.faults.append(f"{form} {number}: {taken:.1f} s")
    return found


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
