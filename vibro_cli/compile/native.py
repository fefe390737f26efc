"""The library of kernels: loaded once, called without the interpreter's lock.

In a source checkout, a library that is missing or older than the kernels is rebuilt first.
"""

from __future__ import annotations

import ctypes
import hashlib
import json
import os
import subprocess
import sys
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

from vibro_cli.compile import kinds as t
from vibro_cli.compile.kernel import CACHE_LINE, Kernel, Overrides, dtype, has_lanes
from vibro_cli.compile.kinds import signature, symbol_of
from vibro_cli.errors import NoLibrary

PACKAGE = Path(__file__).parents[1]
FOLDER = Path(__file__).parent / "library"
"""Folder of the library."""
RECORD = "build.json"
"""File beside the library that records its sources."""
LEVELS = ("x86-64-v4", "x86-64-v3", "x86-64-v2")
"""Levels of a portable library: the best one that the processor supports is loaded."""
_SCALARS = {t.FLOAT: ctypes.c_double, t.INT: ctypes.c_int64, t.BOOL: ctypes.c_bool}
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
    print(f"vibro: compiling the kernels, which {why}; this takes a few seconds", file=sys.stderr)
    command = [sys.executable, "-m", _MODULE, IF_CHANGED]
    environment = {**os.environ, "PYTHONPATH": str(FOLDER.parents[2])}
    done = subprocess.run(
        command, env=environment, stdin=subprocess.DEVNULL, capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    if done.returncode:
        why = f"the kernels cannot be compiled by python -m {_MODULE}:"
        raise NoLibrary(why, *done.stderr.splitlines())


def digest_of(sources: Sequence[str]) -> str:
    """Return a digest of files of the package; empty if one is missing."""
    found = hashlib.sha256()
    for name in sources:
        path = PACKAGE / name
        if not path.is_file():
            return ""
        found.update(f"{name}\0".encode() + path.read_bytes())
    return found.hexdigest()


class CompiledKernel:
    """A kernel of the library, called like the kernel itself.

    It must be an entry point of a program (see ``vibro_cli.programs``) with the same overrides. Its
    parameters are numbers, numpy arrays in C order, or named tuples of arrays; it returns a number,
    a tuple of numbers, or None.
    """

    def __init__(self, kernel: Kernel, overrides: Overrides | None = None) -> None:
        self._names, self._kinds, returned = signature(kernel)
        self._function = _exported(symbol_of(kernel, overrides))
        self._function.argtypes = [_SCALARS.get(kind, ctypes.c_void_p) for kind in self._kinds]
        self._function.restype = _SCALARS.get(returned)
        if returned.form == "tuple":
            fields = [(name, _SCALARS[kind]) for name, kind in returned.members.items()]
            self._function.restype = type("Tuple", (ctypes.Structure,), {"_fields_": fields})

    def __call__(self, *arguments: Any) -> Any:
        """Call the kernel and return its result.

        Raises
        ------
        TypeError
            If an array does not have the type of the kernel's annotation, or its records
            have lanes and do not begin a line of the cache.
        """
        given = [
            argument if kind in _SCALARS else _words(kind, argument, name)
            for kind, argument, name in zip(self._kinds, arguments, self._names, strict=True)
        ]
        found = self._function(*given)
        if isinstance(found, ctypes.Structure):
            return tuple(getattr(found, name) for name, *_ in found._fields_)
        return found


compiled = cache(CompiledKernel)
"""Return the compiled form of a kernel, created once."""


def _exported(symbol: str) -> Any:
    try:
        return library()[symbol]  # a new object each time, so that argument types are not shared
    except AttributeError:
        found = f"the library of kernels has no {symbol}: it is named in no program"
        raise NoLibrary(found) from None


def _words(kind: Any, argument: Any, name: str) -> Any:
    """Return an array or a named tuple of arrays as the words that C++ reads."""
    if kind.form != "world":
        words = _array_words(argument, kind, name)
    else:
        words = []
        for (field, each), array in zip(kind.members.items(), argument, strict=True):
            words += _array_words(array, each, field)
    return (ctypes.c_int64 * len(words))(*words)


def _array_words(array: Any, kind: Any, name: str) -> list[int]:
    """Return the address and extents of an array."""
    wanted, axes, alignment = _layout(kind)
    address = array.ctypes.data
    if array.dtype != wanted or array.ndim != axes or not array.flags.c_contiguous:
        raise TypeError(
            f"{name}: found an array of {array.dtype}, shape {array.shape}; expected one of "
            f"{wanted} in C order, with {axes} axes"
        )
    if address % alignment:
        raise TypeError(f"{name}: found address {address}, expected a multiple of {alignment}")
    return [address, *array.shape]


@cache
def _layout(kind: Any) -> tuple[Any, int, int]:
    """Return the type, axes and alignment (bytes) of an array."""
    import numpy as np

    item = kind.item
    if item in _SCALARS:
        return np.dtype(_SCALARS[item]), kind.size, 1
    return dtype(item.item), kind.size, CACHE_LINE if has_lanes(item.item) else 1
