"""The library of kernels: loaded once, called without the interpreter's lock.

In a source checkout, a library that is missing or older than the kernels is rebuilt first.
"""

from __future__ import annotations

import ctypes
import hashlib
import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

from vibro_cli.compile.kernel import NO_OVERRIDES, Kernel, Overrides, dtype, signature
from vibro_cli.errors import NoLibrary

PACKAGE = Path(__file__).parents[1]
FOLDER = Path(__file__).parent / "library"
"""Folder of the library."""
RECORD = "build.json"
"""File beside the library that records its sources."""
LEVELS = ("x86-64-v4", "x86-64-v3", "x86-64-v2")
"""Levels of a portable library: the best one that the processor supports is loaded."""
_MODULE = "vibro_cli.programs"
IF_CHANGED = "--if-changed"
"""Option of ``python -m vibro_cli.programs``: to leave a library as it is if it is up to date."""


@cache
def library() -> ctypes.CDLL:
    """Return the library of kernels; build it first if it is missing or out of date.

    The environment variable ``VIBRO_LIBRARY`` names another library, for tests of other compilers.

    Raises
    ------
    NoLibrary
        If the library cannot be built.
    """
    return ctypes.CDLL(os.environ.get("VIBRO_LIBRARY") or str(_path()))


def _path() -> Path:
    if why := reason_to_build(FOLDER):
        _make(why)
    names: list[str] = json.loads((FOLDER / RECORD).read_text())["libraries"]
    if len(names) == 1:
        return FOLDER / names[0]
    # Every library can report the processor's level; the lowest one runs on all processors.
    plainest = ctypes.CDLL(str(FOLDER / names[-1]))
    level: int = plainest.kernels_level()
    return FOLDER / names[max(0, len(LEVELS) + 1 - level)]


def reason_to_build(folder: Path) -> str:
    """Return what makes a build necessary in a folder, empty if its library is up to date."""
    try:
        record = json.loads((folder / RECORD).read_text())
    except (FileNotFoundError, ValueError):  # cut short, as by a power failure
        return "are not built yet"
    return "" if record["digest"] == digest_of(record["sources"]) else "have changed"


def _make(why: str) -> None:
    """Build the library in a separate process, which imports only what the build needs."""
    print(f"vibro: compiling the kernels, which {why}; this takes up to a minute", file=sys.stderr)
    # -P: the working folder may hold another package of this name.
    command = [sys.executable, "-P", "-m", _MODULE, IF_CHANGED]
    environment = {**os.environ, "PYTHONPATH": str(FOLDER.parents[2])}
    done = subprocess.run(
        command, env=environment, stdin=subprocess.DEVNULL, capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    if done.returncode == -signal.SIGINT:  # ^C in a terminal reaches both processes
        raise KeyboardInterrupt
    if done.returncode:
        why = f"the kernels cannot be compiled by python -m {_MODULE}:"
        raise NoLibrary(why, *done.stderr.splitlines())


def digest_of(sources: Sequence[str]) -> str:
    """Return a digest of files of the package; one that is missing counts as empty."""
    found = hashlib.sha256()
    for name in sources:
        path = PACKAGE / name
        found.update(f"{name}\0".encode() + (path.read_bytes() if path.is_file() else b""))
    return found.hexdigest()


@cache
def compiled(kernel: Kernel, overrides: Overrides = NO_OVERRIDES) -> Callable[..., Any]:
    """Return a kernel of the library, called like the kernel itself.

    It must be an entry point of a program (see ``vibro_cli.programs``) with the same overrides. Its
    parameters are numbers, numpy arrays in C order, or named tuples of arrays; it returns a number,
    a tuple of numbers, or None. A call raises TypeError if an array does not have the type of the
    kernel's annotation, or its records have lanes and do not begin a line of the cache.

    Raises
    ------
    NoLibrary
        If the library cannot be built, or does not have the kernel.
    """
    kinds, returned = signature(kernel)
    symbol = overrides.symbol(kernel)
    try:
        function = library()[symbol]  # a new object, so that argument types are not shared
    except AttributeError:
        found = f"the library of kernels has no {symbol}: it is named in no program"
        raise NoLibrary(found) from None
    function.argtypes = [kind.stored or ctypes.c_void_p for kind in kinds.values()]
    function.restype, results = returned.stored, returned.members
    if results:
        fields = [(name, kind.stored) for name, kind in results.items()]
        function.restype = type("Tuple", (ctypes.Structure,), {"_fields_": fields})
    layouts = [None if kind.stored else _layout(name, kind) for name, kind in kinds.items()]

    def call(*arguments: Any) -> Any:
        given = [
            argument if layout is None else _as_words(argument, layout)
            for argument, layout in zip(arguments, layouts, strict=True)
        ]
        found = function(*given)
        return tuple(getattr(found, name) for name in results) or found

    return call


def _layout(name: str, kind: Any) -> list[tuple[str, Any, int, int]]:
    """Return name, numpy type, axes and alignment (bytes) of an array, or of each in a tuple."""
    import numpy as np

    if kind.form != "array":
        return [one for field, each in kind.members.items() for one in _layout(field, each)]
    if stored := kind.item.stored:
        return [(name, np.dtype(stored), kind.size, 1)]
    cls = kind.item.item
    return [(name, dtype(cls), kind.size, cls.alignment)]


def _as_words(argument: Any, layout: Any) -> Any:
    """Return the addresses and extents of an array or of a named tuple of arrays, as C++ reads."""
    words: list[int] = []
    arrays = argument if isinstance(argument, tuple) else (argument,)
    for (name, wanted, axes, alignment), array in zip(layout, arrays, strict=True):
        if array.dtype != wanted or array.ndim != axes or not array.flags.c_contiguous:
            raise TypeError(
                f"{name}: found an array of {array.dtype}, shape {array.shape}; expected one of "
                f"{wanted} in C order, with {axes} axes"
            )
        address = array.ctypes.data
        if address % alignment:
            raise TypeError(f"{name}: found address {address}, expected a multiple of {alignment}")
        words += [address, *array.shape]
    return (ctypes.c_int64 * len(words))(*words)
