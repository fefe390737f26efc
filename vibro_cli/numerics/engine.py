"""The switch between interpreted and compiled kernels, which are the same functions.

A kernel is a short function of floats and records. Decorated with :func:`kernel` it stays a plain
Python function; :func:`compiled` returns its compiled twin, in which every kernel it calls is
compiled too. A record is a class of annotated fields: an object with slots for the interpreter, an
element of a structured array for the compiler. Both engines evaluate the same floating-point
operations in the same order (no contraction, no reassociation), so they give the same bits.
"""

from __future__ import annotations

import hashlib
import sys
import types
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

from vibro_cli.numerics.cache import FirstCallAlone, code_folder

Function = TypeVar("Function", bound=Callable[..., Any])
RecordClass = TypeVar("RecordClass", bound=type)

# Entries of a Series: the nodes of a collocation segment.
SERIES_LENGTH = 8
Series = list[float]

_kernels: dict[str, dict[str, Callable[..., Any]]] = {}
_compiled: dict[Callable[..., Any], Any] = {}
_twins: dict[Callable[..., Any], Any] = {}
# Same operations in the same order as the interpreter: no contraction, no reassociation.
_OPTIONS: dict[str, Any] = {"error_model": "numpy", "nogil": True, "_nrt": False}
_alone: dict[Callable[..., Any], FirstCallAlone] = {}


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


def interpreted_copies(rows: Any, cls: type) -> list[Any]:
    """Return interpreted records with the contents of a structured array."""
    names = tuple(cls.fields)  # type: ignore[attr-defined]
    series = [name for name, kind in cls.fields.items() if kind == "Series"]  # type: ignore[attr-defined]
    copies = []
    for values in rows.tolist():
        copy = cls()
        for name, value in zip(names, values, strict=True):
            setattr(copy, name, value)
        for name in series:
            setattr(copy, name, list(getattr(copy, name)))
        copies.append(copy)
    return copies


def compiled_rows(rows: Sequence[Any], cls: type) -> Any:
    """Return a structured array with the contents of interpreted records."""
    import numpy as np

    names = tuple(cls.fields)  # type: ignore[attr-defined]
    array = np.zeros(len(rows), dtype=dtype(cls))
    for position, row in enumerate(rows):
        array[position] = tuple(getattr(row, name) for name in names)
    return array


@cache
def source_digest() -> str:
    """Return a digest of all that the machine code depends on.

    These are the sources of the kernels, the constants of other modules that they use, the
    versions and the processor. numba's own cache looks at one file only, so that a change in a
    called kernel would go unseen.
    """
    paths = []
    constants = []
    for name in sorted(_kernels):
        path = sys.modules[name].__file__
        if path is None:  # pragma: no cover - kernels are always defined in files
            raise RuntimeError(f"kernel module {name} has no source file")
        paths.append(Path(path))
        constants.append(_constants(vars(sys.modules[name])))
    return digest_of(paths, repr(constants))


def digest_of(sources: Sequence[Path], constants: str = "") -> str:
    """Return a digest of source files, of constants and of what else decides the machine code."""
    import llvmlite
    import llvmlite.binding
    import numba

    digest = hashlib.sha256(constants.encode())
    for path in sources:
        digest.update(path.read_bytes())
    processor = (
        llvmlite.binding.get_host_cpu_name(),
        str(llvmlite.binding.get_host_cpu_features()),
    )
    versions = (numba.__version__, llvmlite.__version__, sys.version)
    digest.update(repr((versions, processor)).encode())
    return digest.hexdigest()[:16]


def _constants(namespace: Mapping[str, Any]) -> list[tuple[str, Any]]:
    """The plain values of a module, its own and imported ones: the compiler writes them down."""
    kinds = (bool, int, float, str, tuple)
    return sorted(
        (name, value)
        for name, value in namespace.items()
        if isinstance(value, kinds) and not name.startswith("__")
    )


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
    if entry not in _compiled:
        import numba

        from vibro_cli.numerics.compiling import WholeCompiler, entry_of

        function = entry_of(entry, lambda: _twin(entry))
        whole = numba.njit(pipeline_class=WholeCompiler, **_OPTIONS)
        _compiled[entry] = kept(whole(function))
    return _compiled[entry]


def compiled_once(entry: Callable[..., Any]) -> Any:
    """Return the compiled twin of a kernel for a program of which several run at one time.

    It is called like :func:`compiled`'s; of several processes with a cold cache one makes the
    machine code, and the others wait for it.
    """
    if entry not in _alone:
        _alone[entry] = FirstCallAlone(compiled(entry), _machine_code())
    return _alone[entry]


def kept(function: Any) -> Any:
    """Have the machine code of a compiled function that calls kernels kept with theirs."""
    from vibro_cli.numerics.cache_file import keep_in

    keep_in(_machine_code(), function)
    return function


def _machine_code() -> Path:
    """The folder for the machine code of these kernels."""
    return code_folder(f"kernels-{source_digest()}")


def _twin(function: Callable[..., Any]) -> Any:
    """The compiled form of a kernel."""
    if not _twins:
        _make_twins()
    return _twins[function]


def _make_twins() -> None:
    """Make a twin of every kernel, in whose module every kernel means its compiled form.

    Kernels called by kernels only have no entry from Python, and no machine code nor place in the
    cache of their own: it would be made for every one of them, and take most of the time.
    """
    import numba

    from vibro_cli.numerics.compiling import PartCompiler

    namespaces: dict[str, dict[str, Any]] = {}
    copies: dict[Callable[..., Any], Any] = {}
    for module, functions in _kernels.items():
        namespaces[module] = dict(vars(sys.modules[module]))
        for function in functions.values():
            twin = types.FunctionType(
                function.__code__, namespaces[module], function.__name__, function.__defaults__
            )
            twin.__module__ = module
            copies[function] = twin
    # Options of numba that its type hints leave out.
    inside: dict[str, Any] = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    part = numba.njit(pipeline_class=PartCompiler, **_OPTIONS, **inside)
    twins = {function: part(twin) for function, twin in copies.items()}
    for namespace in namespaces.values():
        for name, value in list(namespace.items()):
            if isinstance(value, types.FunctionType) and value in twins:
                namespace[name] = twins[value]
    _twins.update(twins)
