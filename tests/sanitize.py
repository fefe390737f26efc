"""The kernels with checks of addresses, bounds and undefined behaviour: python -m tests.sanitize.

A library of the same source is compiled with the sanitisers, and the gallery, the hard cases and a
short stress suite run with it, each in a process of its own. Ends with 1 if one of them fails or a
sanitiser has anything to say.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from vibro_cli.compile.build import NATIVE, build, compiler, library_name
from vibro_cli.programs import programs

ROOT = Path(__file__).parents[1]
CHECKS = ("-fsanitize=address,undefined,float-cast-overflow", "-fno-sanitize-recover=all")
FLAGS = (*CHECKS, "-fno-omit-frame-pointer", "-g", "-O1", "-DCHECK_BOUNDS")


def _runtime(name: str) -> str:
    """Where the compiler has a library."""
    asked = [*compiler(), f"-print-file-name={name}"]
    return subprocess.run(asked, capture_output=True, text=True, check=True).stdout.strip()


def environment(library: Path) -> dict[str, str]:
    """The variables with which a process loads the checked library, the checker before it."""
    # The checker looks for the exceptions of C++, which other libraries throw, where it is loaded.
    runtime = " ".join(map(_runtime, ("libasan.so", "libstdc++.so.6")))
    return {
        **os.environ,
        "VIBRO_LIBRARY": str(library),
        "LD_PRELOAD": runtime,
        "ASAN_OPTIONS": "detect_leaks=0:abort_on_error=1",
        "UBSAN_OPTIONS": "print_stacktrace=1:halt_on_error=1",
    }


def commands(folder: Path) -> Iterator[list[str]]:
    """What is run, as arguments of the interpreter."""
    for path in sorted((ROOT / "scenarios").rglob("*.toml")):
        if path.parent.name == "grids":
            yield ["-m", "vibro_cli", "grid", str(path), "-o", str(folder / path.stem), "-q"]
        else:
            output = ["-o", str(folder / path.stem), "--no-figures", "-q"]
            yield ["-m", "vibro_cli", "run", str(path), *output]
    cases = sorted((ROOT / "tests").rglob("hard_cases/*.toml"))
    given = ["-o", str(folder / "hard"), "--no-figures", "-q"]
    yield ["-m", "vibro_cli", "run", *map(str, cases), *given]
    yield ["-m", "vibro_cli", "stress", "--only", "energy", "--only", "impacts", "--only", "table"]


def main() -> int:
    """Run everything; return the exit code."""
    failed = 0
    with tempfile.TemporaryDirectory() as work:
        folder = Path(work)
        build(programs(), folder, more_flags=FLAGS)
        variables = environment(folder / library_name(NATIVE))
        for arguments in commands(folder):
            done = subprocess.run(
                [sys.executable, *arguments], cwd=ROOT, env=variables, capture_output=True,
                text=True, check=False,
            )  # fmt: skip
            sound = done.returncode in (0, 3) and "ERROR: AddressSanitizer" not in done.stderr
            sound = sound and "runtime error:" not in done.stderr
            failed += not sound
            print("ok    " if sound else "FAILED", " ".join(arguments)[:90], flush=True)
            if not sound:
                print(done.stderr[:4000])
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
