"""Which modules a number passes: those with a function that holds it, or holds what holds it.

``python -m tests.value_followed`` prints those that the initial angle of a ball passes in
``vibro run``, from the scenario to the tables.
"""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from types import FrameType
from typing import Any

import numpy as np

from vibro_cli.commands.app import run_command_line

ROOT = Path(__file__).parents[1]
PACKAGE = str(ROOT / "vibro_cli") + "/"
ANGLE = -1.2345678901234567  # no other number of a run is this one
ARGUMENTS = (
    "run", str(ROOT / "scenarios" / "three_arcs.toml"), "--engine", "python", "--no-figures", "-q",
    "--set", f"balls[1].angle={ANGLE!r}", "--set", "stop.collisions=2", "--set", "output.step=0.5",
)  # fmt: skip


def modules_with_the_angle() -> set[str]:
    """Modules with a function that has the angle in a variable, or one level within it."""
    found: set[str] = set()

    def look(frame: FrameType, event: str, result: Any) -> None:
        file = frame.f_code.co_filename
        if event not in ("call", "return") or not file.startswith(PACKAGE) or file in found:
            return
        values = [*frame.f_locals.values(), result]
        if any(_is_it(one) for value in values for one in (value, *_within(value))):
            found.add(file)

    before = sys.getprofile()
    with TemporaryDirectory() as folder:
        threading.setprofile(look)
        sys.setprofile(look)
        try:
            code = run_command_line([*ARGUMENTS, "-o", f"{folder}/run"])
        finally:
            sys.setprofile(before)
            threading.setprofile(None)
    assert code == 0
    return {file.removeprefix(PACKAGE) for file in found}


def _is_it(value: object) -> bool:
    return isinstance(value, float) and value == ANGLE


def _within(value: Any) -> Iterator[object]:
    """Return the elements of a container, the fields of an object, the numbers of an array."""
    if isinstance(value, dict):
        yield from value.values()
    elif isinstance(value, (list, tuple)):
        yield from value
    elif isinstance(value, np.ndarray) and value.dtype == np.float64:
        yield from (float(one) for one in value[value == ANGLE])
    elif type(value).__module__.startswith("vibro_cli"):
        yield from getattr(value, "__dict__", {}).values()
        yield from (getattr(value, name, None) for name in getattr(value, "__slots__", ()))


if __name__ == "__main__":
    print("\n".join(sorted(modules_with_the_angle())))
