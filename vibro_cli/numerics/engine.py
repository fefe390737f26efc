"""The switch between interpreted and compiled kernels, which are the same functions.

A kernel is a short function of floats and records. Decorated with :func:`kernel` it stays a plain
Python function; :func:`compiled` returns its compiled twin, in which every kernel it calls is
compiled too. A record is a class of annotated fields: an object with slots for the interpreter, an
element of a structured array for the compiler. Both engines evaluate the same floating-point
operations in the same order (no contraction, no reassociation), so they give the same bits.
"""

from __future__ import annotations

import atexit
import fcntl
import hashlib
import os
import shutil
import sys
import tempfile
import types
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Any, TextIO, TypeVar

Function = TypeVar("Function", bound=Callable[..., Any])
RecordClass = TypeVar("RecordClass", bound=type)

# Entries of a Series: the nodes of a collocation segment.
SERIES_LENGTH = 8
Series = list[float]

_kernels: dict[str, dict[str, Callable[..., Any]]] = {}
_compiled: dict[Callable[..., Any], Any] = {}
_twins: dict[Callable[..., Any], Any] = {}
# Same operations in the same order as the interpreter: no contraction, no reassociation.
_OPTIONS: dict[str, Any] = {"error_model": "numpy", "nogil": True}
_alone: dict[Callable[..., Any], _FirstCallAlone] = {}
_tell: Callable[[str], None] | None = None


def kernel(function: Function) -> Function:
    """Register a function as a kernel; it stays a plain Python function."""
    _kernels.setdefault(function.__module__, {})[function.__name__] = function
    return function


def record(cls: RecordClass) -> RecordClass:
    """Turn a class of annotated fields into one with slots and zero values.

    The mapping ``fields`` of the result gives their names and kinds. Fields are ``float``,
    ``int`` or ``Series`` (a short row of floats, such as the coefficients of a polynomial).
    The fields of base classes that are records come first.
    """
    fields: dict[str, str] = {}
    for base in reversed(cls.__mro__):
        fields.update(getattr(base, "fields", {}))
    fields.update(cls.__annotations__)
    names = tuple(fields)
    scalars = [(name, 0.0 if kind == "float" else 0) for name, kind in fields.items()]
    scalars = [(name, value) for name, value in scalars if fields[name] != "Series"]
    series = [name for name, kind in fields.items() if kind == "Series"]

    def initialise(self: object) -> None:
        for name, value in scalars:
            setattr(self, name, value)
        for name in series:
            setattr(self, name, [0.0] * SERIES_LENGTH)

    body = {
        "__slots__": names,
        "__init__": initialise,
        "__doc__": cls.__doc__,
        "__module__": cls.__module__,
        "fields": fields,
    }
    return type(cls.__name__, (), body)  # type: ignore[return-value]


def dtype(cls: type) -> Any:
    """Return the structured numpy type of a record."""
    import numpy as np

    kinds: dict[str, Any] = {
        "float": np.float64,
        "int": np.int64,
        "Series": (np.float64, (SERIES_LENGTH,)),
    }
    fields = cls.fields  # type: ignore[attr-defined]
    return np.dtype([(name, kinds[kind]) for name, kind in fields.items()])


def interpreted_rows(cls: type, count: int) -> list[Any]:
    """Return ``count`` zero records for the interpreter."""
    return [cls() for _ in range(count)]


def compiled_rows(rows: Sequence[Any], cls: type) -> Any:
    """Return a structured array with the contents of interpreted records."""
    import numpy as np

    names = tuple(cls.fields)  # type: ignore[attr-defined]
    array = np.zeros(len(rows), dtype=dtype(cls))
    for position, row in enumerate(rows):
        array[position] = tuple(getattr(row, name) for name in names)
    return array


def source_digest() -> str:
    """Return a digest of all that the machine code depends on: kernel sources, versions, processor.

    numba's own cache looks at one file only, so that a change in a called kernel would go unseen.
    """
    paths = []
    for name in sorted(_kernels):
        path = sys.modules[name].__file__
        if path is None:  # pragma: no cover - kernels are always defined in files
            raise RuntimeError(f"kernel module {name} has no source file")
        paths.append(Path(path))
    return digest_of(paths)


def digest_of(sources: Sequence[Path]) -> str:
    """Return a digest of source files and of what else decides the machine code made of them."""
    import llvmlite
    import llvmlite.binding
    import numba

    digest = hashlib.sha256()
    for path in sources:
        digest.update(path.read_bytes())
    processor = (
        llvmlite.binding.get_host_cpu_name(),
        str(llvmlite.binding.get_host_cpu_features()),
    )
    versions = (numba.__version__, llvmlite.__version__, sys.version)
    digest.update(repr((versions, processor)).encode())
    return digest.hexdigest()[:16]


def cache_folder() -> Path:
    """Return the folder of the machine code.

    ``VIBRO_CACHE_DIR``, else the platform's cache folder.
    """
    named = os.environ.get("VIBRO_CACHE_DIR")
    if named:
        return Path(named)
    import platformdirs

    return Path(platformdirs.user_cache_dir("vibro"))


def compiled(entry: Callable[..., Any]) -> Any:
    """Return the compiled twin of a kernel.

    Parameters
    ----------
    entry
        A function decorated with :func:`kernel`.

    Returns
    -------
    The numba dispatcher; machine code is made, or read from the cache, at its first call.
    """
    if not _twins:
        _make_twins()
    if entry not in _compiled:
        import numba

        _compiled[entry] = numba.njit(cache=True, **_OPTIONS)(_twins[entry])
    return _compiled[entry]


def compiled_once(entry: Callable[..., Any]) -> Any:
    """Return the compiled twin of a kernel for a program of which several run at one time.

    It is called like :func:`compiled`'s; of several processes with a cold cache one makes the
    machine code, and the others wait for it.
    """
    if entry not in _alone:
        twin = compiled(entry)
        _alone[entry] = _FirstCallAlone(twin, _machine_code())
    return _alone[entry]


def on_compiling(tell: Callable[[str], None] | None) -> None:
    """Choose what is called with a line for the user when machine code has to be made or awaited.

    ``None``, as at first, for nobody to be told.
    """
    global _tell
    _tell = tell


class _FirstCallAlone:
    """A compiled kernel whose first call, if it has to write into the cache, does so alone.

    numba replaces each file of its cache in one step, but two processes that add to the cache at
    once may give different functions the same file. Processes that only read need no lock: what
    is ready stays as it is.
    """

    def __init__(self, dispatcher: Any, folder: Path) -> None:
        name = f"{dispatcher.py_func.__module__}.{dispatcher.py_func.__name__}"
        self._dispatcher = dispatcher
        self._ready = folder / f"{name}.ready"
        self._lock = folder / "lock"
        self._called = False

    def __call__(self, *arguments: Any) -> Any:
        if self._called:
            return self._dispatcher(*arguments)
        self._called = True
        if self._ready.exists():
            return self._dispatcher(*arguments)
        with self._lock.open("w") as lock:
            _wait_for(lock)
            if _tell is not None and not self._ready.exists():
                _tell("compiling the kernels; this takes a minute or two, and only once")
            result = self._dispatcher(*arguments)
            self._ready.touch()
        return result


def _wait_for(lock: TextIO) -> None:
    """Hold a lock alone until its file is closed; where files cannot be locked, go on without."""
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        if _tell is not None:
            _tell("waiting for another process that compiles the kernels")
        fcntl.flock(lock, fcntl.LOCK_EX)
    except OSError:  # some network file systems
        pass


def _machine_code() -> Path:
    """The folder for this machine code."""
    return code_folder(f"kernels-{source_digest()}")


@cache
def code_folder(name: str) -> Path:
    """A folder for machine code; one of this process alone where it cannot be written."""
    folder = cache_folder() / name
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return folder
    except OSError as error:
        if _tell is not None:
            _tell(f"compiled kernels cannot be kept in {folder} ({error.strerror})")
        own = tempfile.mkdtemp(prefix="vibro-code-")
        atexit.register(shutil.rmtree, own, ignore_errors=True)
        return Path(own)


def _make_twins() -> None:
    """Make a twin of every kernel, in whose module every kernel means its compiled form.

    Kernels called by kernels only have no entry from Python and are not cached on their own:
    both would be made for every one of them, and take most of the time of compiling.
    """
    import numba

    numba.config.CACHE_DIR = str(_machine_code())  # type: ignore[attr-defined]
    namespaces: dict[str, dict[str, Any]] = {}
    twins: dict[Callable[..., Any], Any] = {}
    for module, functions in _kernels.items():
        namespaces[module] = dict(vars(sys.modules[module]))
        for function in functions.values():
            twin = types.FunctionType(
                function.__code__, namespaces[module], function.__name__, function.__defaults__
            )
            twin.__module__ = module
            twins[function] = twin
    # Options of numba that its type hints leave out.
    inside: dict[str, Any] = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    inner = {function: numba.njit(**_OPTIONS, **inside)(twin) for function, twin in twins.items()}
    for namespace in namespaces.values():
        for name, value in list(namespace.items()):
            if isinstance(value, types.FunctionType) and value in inner:
                namespace[name] = inner[value]
    _twins.update(twins)
