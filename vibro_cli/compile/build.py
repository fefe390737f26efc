"""Build the library of kernels: C++ source files, compiled to a shared object for each processor.

The package's build hook calls it when the package is installed or a wheel is built;
``python -m vibro_cli.programs`` calls it in a source checkout.
"""

from __future__ import annotations

import fcntl
import json
import os
import platform
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from vibro_cli.compile.native import FOLDER, LEVELS, PACKAGE, RECORD, digest_of, reason_to_build
from vibro_cli.compile.translate import Program

PRELUDE = Path(__file__).parent / "prelude.hpp"
_MAIN = PACKAGE / "programs.py"
NATIVE = "native"
GENERIC = "generic"
ZIG = "ziglang"

# Same operations in the same order as the interpreter: no contraction and no reassociation. errno
# and traps are disabled since nothing reads them. The vectorisers are disabled since they only cost
# time, except in the programs whose own flags enable them.
_FLAGS = (
    *("-O3", "-std=c++17", "-fPIC", "-fvisibility=hidden", "-w"),
    *("-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math"),
    *("-fno-tree-vectorize", "-fno-tree-slp-vectorize"),
    # By default g++ does not inline kernels of medium size, whose tuples then go through memory.
    *("--param=max-inline-insns-auto=200", "--param=inline-unit-growth=200"),
)


class BuildError(Exception):
    """The library cannot be built; the message says why, and what to do."""


def system_compiler() -> list[str]:
    """Return the command of the C++ compiler: ``$CXX`` or the system's; empty if none is found."""
    named = os.environ.get("CXX")
    return named.split() if named else list(filter(shutil.which, ("c++", "g++", "clang++")))[:1]


def compiler() -> list[str]:
    """Return the command of the C++ compiler: :func:`system_compiler`, else that of ``ziglang``.

    Raises
    ------
    BuildError
        If no compiler is found.
    """
    if found := system_compiler():
        return found
    if find_spec(ZIG):
        return [sys.executable, "-m", ZIG, "c++"]
    raise BuildError(
        "no C++ compiler found: expected $CXX, c++, g++ or clang++ in PATH, or the package "
        f"{ZIG} (python -m pip install {ZIG})"
    )


def portable_levels() -> tuple[str, ...]:
    """Return the processor levels that a portable library is built for, best first."""
    return LEVELS if platform.machine().lower() in ("x86_64", "amd64") else (GENERIC,)


def flags(level: str, command: Sequence[str]) -> list[str]:
    """Return the compiler's options for a processor level."""
    if level == GENERIC:
        return list(_FLAGS)
    of_apple = level == NATIVE and platform.system() == "Darwin"
    option = "-mcpu" if of_apple or ZIG in command else "-march"
    name = level.replace("-", "_") if ZIG in command and level != NATIVE else level
    return [*_FLAGS, f"{option}={name}"]


def library_name(level: str) -> str:
    """Return the file name of the library for a processor level."""
    return f"kernels-{level}.so"


def build(
    programs: Sequence[Program],
    folder: Path = FOLDER,
    levels: Sequence[str] = (NATIVE,),
    more_flags: Sequence[str] = (),
    if_changed: bool = False,
) -> None:
    """Build the library in a folder with a record of its sources; a failure changes nothing.

    The folder is created if it does not exist. ``levels`` are the processor levels, best first;
    ``more_flags`` are further options of the compiler, after all others. With ``if_changed``
    nothing is built where another process has just built the library from the present sources.

    Raises
    ------
    BuildError
        If no compiler is found, or if it fails.
    TranslationError
        If a kernel is not in the compiled subset of Python.
    """
    command = compiler()
    record = _record(levels)  # of what is imported: sources changed from now on are noticed
    with _work_folder(folder) as work:
        if if_changed and not reason_to_build(folder):
            return
        shutil.copy(PRELUDE, work)
        for program in programs:
            (work / f"{program.name}.cpp").write_text(program.source())
        _compile(command, more_flags, programs, levels, work)
        (work / RECORD).write_text(json.dumps(record, indent=1) + "\n")
        for name in (*map(library_name, levels), RECORD):
            (work / name).replace(folder / name)


@contextmanager
def _work_folder(folder: Path) -> Iterator[Path]:
    """Yield a temporary folder inside the library's, which is locked: one build at a time."""
    folder.mkdir(parents=True, exist_ok=True)
    handle = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX)
        for left in folder.glob("making-*"):  # left behind by a process that was killed
            shutil.rmtree(left, ignore_errors=True)
        with tempfile.TemporaryDirectory(dir=folder, prefix="making-") as name:
            yield Path(name)
    finally:
        os.close(handle)


def _compile(
    command: Sequence[str],
    more_flags: Sequence[str],
    programs: Sequence[Program],
    levels: Sequence[str],
    work: Path,
) -> None:
    """Compile and link the sources for each processor level."""
    tasks = [
        [
            *(*command, *flags(level, command), *program.flags, *more_flags),
            *("-c", "-o", f"{program.name}-{level}.o", f"{program.name}.cpp"),
        ]
        for level in levels
        for program in programs
    ]
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        list(pool.map(lambda task: _run(task, work), tasks))
    # ziglang would first build its own runtime, which takes a minute and has sines that differ in
    # bits from those that Python calls. The machine's own libraries have all that kernels need.
    own_runtime = ["-nostdlib", "-lc"] if ZIG in command else []
    link = [*command, "-shared", "-fPIC", *more_flags]
    for level in levels:
        objects = [f"{program.name}-{level}.o" for program in programs]
        _run([*link, "-o", library_name(level), *objects, *own_runtime, "-lm"], work)


def _record(levels: Sequence[str]) -> dict[str, Any]:
    """Return the record of the libraries and their sources: the imported files of the package."""
    own = [module for name, module in sys.modules.items() if name.startswith(f"{PACKAGE.name}.")]
    files = {PRELUDE, _MAIN, *(Path(str(module.__file__)) for module in own)}
    sources = sorted(file.relative_to(PACKAGE).as_posix() for file in files)
    libraries = [library_name(level) for level in levels]
    return {"libraries": libraries, "sources": sources, "digest": digest_of(sources)}


def _run(command: Sequence[str], work: Path) -> None:
    done = subprocess.run(command, cwd=work, capture_output=True, text=True, check=False)
    if done.returncode:
        raise BuildError(f"{' '.join(command)}: exit {done.returncode}\n{done.stderr[:4000]}")
