"""What something costs, in measures that mean the same on a slow or busy machine.

Tests compare two of them, measured side by side, or count; none knows how long a second is.
"""

import resource
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from types import FrameType
from typing import Any


def processor_time(act: Callable[[], object], times: int = 3) -> float:
    """Return the processor time (s), the least of several measurements."""
    taken = []
    for _ in range(times):
        begin = time.process_time()
        act()
        taken.append(time.process_time() - begin)
    return min(taken)


def ratio(command: Sequence[str], reference: Sequence[str], times: int = 5) -> float:
    """How much more time of the processor a command takes than a reference; the least of each.

    They are run in turn, so that both have the same neighbours on the machine.
    """
    measured = [(_child_time(command), _child_time(reference)) for _ in range(times)]
    return min(one for one, _ in measured) / min(other for _, other in measured)


def _child_time(command: Sequence[str]) -> float:
    begin = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    end = resource.getrusage(resource.RUSAGE_CHILDREN)
    return end.ru_utime + end.ru_stime - begin.ru_utime - begin.ru_stime


def calls(act: Callable[[], object]) -> int:
    """Return the number of function calls, in Python and in C."""
    count = 0

    def note(frame: FrameType, event: str, argument: Any) -> None:
        nonlocal count
        count += event in ("call", "c_call")

    before = sys.getprofile()
    sys.setprofile(note)
    try:
        act()
    finally:
        sys.setprofile(before)
    return count
