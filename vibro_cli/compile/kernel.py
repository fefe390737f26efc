"""Declare kernels, structs and their types; the same functions are interpreted and compiled.

A kernel is a short function of numbers and structs. Decorated with :func:`kernel` it stays a plain
Python function; ``native.compiled`` returns its compiled form. A struct is a class of annotated
fields: the interpreter uses an object with slots, compiled code an element of a structured array.
Both evaluate the same floating-point operations in the same order (no contraction, no
reassociation), so they give the same bits. The build imports this module, so it imports nothing
heavy.

A kernel without branches may work on lanes instead of numbers. Each lane then undergoes the same
operations in the same order as a single number, and has the same bits. Where lanes differ in a
condition, both values of ``a if condition else b`` are computed, and each lane takes its own. Only
compiled kernels have lanes; the functions here define their meaning for a single number.
"""

from __future__ import annotations

import ctypes
import sys
import threading
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cache, update_wrapper
from pathlib import Path
from types import FunctionType
from typing import Annotated, Any, TypeVar, get_args, get_origin

# Lanes of a register of 512 bits; on processors with shorter registers several are used.
LANES = 8
# Bytes of a line of the processor's cache. Lanes that cross one take twice as long to read.
CACHE_LINE = 64
# Number of entries of a Series: the nodes of a collocation segment.
SERIES_LENGTH = 8


@dataclass(frozen=True)
class Kind:
    """A type: its form and its name in C++."""

    form: str
    cpp: str
    item: Any = None
    """Type of the elements of an array or row; types of a tuple's items; class of a struct."""
    size: int = 0
    """Number of lanes or axes."""
    stored: Any = field(default=None, compare=False)
    """Type in ctypes of a number, which numpy knows too; with its shape if it has several."""

    @property
    def members(self) -> Mapping[str, Any]:
        """Types of the members of a struct or a tuple, by their names in C++."""
        if self.form == "tuple":
            return {f"at{n}": item for n, item in enumerate(self.item)}
        return _members(self.item) if self.form == "struct" else {}


FLOAT = Kind("number", "double", stored=ctypes.c_double)
INT = Kind("number", "int64_t", stored=ctypes.c_int64)
BOOL = Kind("truth", "bool", stored=ctypes.c_bool)
NOTHING = Kind("nothing", "void")
SERIES = Kind("row", "double*", FLOAT, stored=(ctypes.c_double, SERIES_LENGTH))
_PLAIN = {"float": FLOAT, "int": INT, "bool": BOOL, "None": NOTHING}


def lanes_of(count: int) -> Kind:
    """Return the type of ``count`` lanes with a double in each."""
    return Kind("number", f"Lanes<{count}>", size=count, stored=(ctypes.c_double, (1, count)))


def truth_of(kind: Kind) -> Kind:
    """Return the type of a comparison of numbers: a truth value, or one for each lane."""
    return Kind("truth", f"Mask<{kind.size}>", size=kind.size) if kind.size else BOOL


def tuple_of(items: Iterable[Kind]) -> Kind:
    """Return the type of several values that a kernel returns together."""
    items = tuple(items)
    return Kind("tuple", f"Tuple<{', '.join(item.cpp for item in items)}>", items)


def array_of(item: Kind, axes: int = 1) -> Kind:
    """Return the type of an array of numbers or structs in C order."""
    element = item.cpp.rstrip("*")  # an array holds structs, not pointers to them
    return Kind("array", f"Array<{element}, {axes}>", item, axes)


def joined(*kinds: Kind) -> Kind | None:
    """Return the type to which values of the given types are converted; None if there is none.

    Integers become floats, and numbers and truth values take part in every lane.
    """

    def takes(kind: Kind, given: Kind) -> bool:
        widens = kind.form == given.form and not given.size and (kind.size or kind == FLOAT)
        return kind == given or bool(widens)

    return next((kind for kind in kinds if all(takes(kind, one) for one in kinds)), None)


def in_one_lane(kind: Kind) -> Kind:
    """Return a type with numbers in place of lanes."""
    if kind.form == "tuple":
        return tuple_of(map(in_one_lane, kind.item))
    is_in_lanes = kind.form in ("number", "truth") and kind.size
    return kind if not is_in_lanes else FLOAT if kind.form == "number" else BOOL


class TranslationError(Exception):
    """A kernel is not in the compiled subset; the message gives file, line and reason."""


def kind_of(hint: Any) -> Any:
    """Return the type that an annotation means; None if it is not in the subset."""
    if hasattr(hint, "__metadata__"):
        return hint.__metadata__[0]
    if hasattr(hint, "fields"):
        return Kind("struct", f"{hint.__name__}*", hint)
    if hasattr(hint, "_fields"):
        return Kind("struct", f"const {hint.__name__}*", hint)
    items, origin = tuple(map(kind_of, get_args(hint))), get_origin(hint)
    if not items or None in items or origin not in (tuple, list, Sequence):
        return None if items else _PLAIN.get(getattr(hint, "__name__", str(hint)))
    if origin is tuple:
        return tuple_of(items)
    (item,) = items
    return array_of(item.item, item.size + 1) if item.form == "array" else array_of(item)


def kinds_in(annotated: Any) -> dict[str, Any]:
    """Return the types of the annotations of a class or a function by name."""
    texts = annotated.__annotations__.items()
    home = annotated.__module__
    return {name: _named(getattr(one, "__forward_arg__", one), home) for name, one in texts}


@cache  # structs have many fields of few types, and are declared whenever the program starts
def _named(hint: Any, module: str) -> Any:
    return kind_of(eval(hint, vars(sys.modules[module])) if isinstance(hint, str) else hint)


@cache
def _members(cls: Any) -> Mapping[str, Any]:
    return getattr(cls, "fields", None) or kinds_in(cls)


def declaration(kind: Kind) -> str:
    """Return the C++ declaration of a type; structs have the layout of their structured array."""
    if not kind.members:
        return ""
    if kind.form == "tuple":
        head = f"template <>\nstruct {kind.cpp}"
    else:
        aligned = getattr(kind.item, "alignment", 1) > 1
        head = f"struct {f'alignas({CACHE_LINE}) ' if aligned else ''}{kind.item.__name__}"
    members = [
        f"double {name}[{SERIES_LENGTH}]" if each == SERIES else f"{each.cpp} {name}"
        for name, each in kind.members.items()
    ]
    return "\n".join([f"{head} {{", *(f"  {one};" for one in members), "};\n"])


@cache
def signature(kernel: Any) -> tuple[dict[str, Any], Any]:
    """Return the types of a kernel's parameters by name, and the type of its result.

    Raises
    ------
    TranslationError
        If an annotation is missing or not in the subset.
    """
    kinds, code = kinds_in(kernel), kernel.__code__
    names = code.co_varnames[: code.co_argcount]
    for name in (*names, "return"):
        if kinds.get(name) is None:
            text = kernel.__annotations__.get(name)
            raise TranslationError(
                f"{shown(code.co_filename)}:{code.co_firstlineno}: {kernel.__name__}: {name}: "
                f"found {text!r}, expected a type of numbers, structs, tuples or arrays of them"
            )
    return {name: kinds[name] for name in names}, kinds["return"]


def shown(path: str) -> str:
    """Return a path as messages show it: relative to the root of the package if it is inside."""
    file = Path(path)
    root = Path(__file__).parents[2]
    return file.relative_to(root).as_posix() if file.is_relative_to(root) else path


Kernel = Callable[..., Any]
Function = TypeVar("Function", bound=Kernel)
StructClass = TypeVar("StructClass", bound=type)

# For the type checker, lanes are numbers and comparisons of them booleans.
Lanes = Annotated[float, lanes_of(LANES)]
# Two lanes: the same quantity of both bodies of a pair.
Two = Annotated[float, lanes_of(2)]
Series = Annotated[list[float], SERIES]
# Arrays of two or more axes in C order; the type checker does not check them.
FloatMatrix = Annotated[Any, array_of(FLOAT, 2)]
IntMatrix = Annotated[Any, array_of(INT, 2)]
BoolMatrix = Annotated[Any, array_of(BOOL, 2)]
FloatArray3 = Annotated[Any, array_of(FLOAT, 3)]
FloatArray4 = Annotated[Any, array_of(FLOAT, 4)]

_kernels: set[Kernel] = set()


def kernel(function: Function) -> Function:
    """Register a function as a kernel; it stays a plain Python function."""
    _kernels.add(function)
    return function


def is_kernel(value: Any) -> bool:
    """Return whether a value is a function decorated with :func:`kernel`."""
    return isinstance(value, FunctionType) and value in _kernels


def struct(cls: StructClass) -> StructClass:
    """Turn a class of annotated fields into one with slots and zeros as initial values.

    The mapping ``fields`` of the result gives the type of each field by name: ``float``, ``int``,
    ``Series`` (a short row of floats, such as the coefficients of a polynomial), ``Lanes`` or
    ``Two``. The fields of a base class that is a struct come first, and those in lanes before all,
    with which a struct has the ``alignment`` (bytes) of a line of the cache.

    Raises
    ------
    TranslationError
        If a field has another type, which numpy and C++ would not place alike.
    """
    own = kinds_in(cls)
    for name, kind in own.items():
        if kind is None or kind.form not in ("number", "row"):
            raise TranslationError(
                f"{cls.__module__}.{cls.__name__}: {name}: found {cls.__annotations__[name]!r}, "
                "expected float, int, Series, Lanes or Two"
            )
    fields: dict[str, Any] = {**getattr(cls, "fields", {}), **own}
    fields = dict(sorted(fields.items(), key=lambda field: field[1].size != LANES))
    zeros: dict[str, Any] = {INT.cpp: int, SERIES.cpp: lambda: [0.0] * SERIES_LENGTH}
    values = [(name, zeros.get(kind.cpp, float)) for name, kind in fields.items()]

    def initialise(self: object) -> None:
        for name, zero in values:
            setattr(self, name, zero())

    body = {
        "__slots__": tuple(fields),
        "__init__": initialise,
        "__doc__": cls.__doc__,
        "__module__": cls.__module__,
        "fields": fields,
        "alignment": CACHE_LINE if LANES in [kind.size for kind in fields.values()] else 1,
    }
    return type(cls.__name__, (), body)  # type: ignore[return-value]


@cache
def dtype(cls: Any) -> Any:
    """Return the structured numpy type of a struct; one with lanes fills whole cache lines."""
    import numpy as np

    formats = [kind.stored for kind in cls.fields.values()]
    size = np.dtype({"names": list(cls.fields), "formats": formats}).itemsize
    size += -size % cls.alignment
    return np.dtype({"names": list(cls.fields), "formats": formats, "itemsize": size})


def fused(a: float, b: float, c: float) -> float:
    """Return ``a b + c``, rounded once (IEEE 754 fusedMultiplyAdd)."""
    return float(Fraction(a) * Fraction(b) + Fraction(c))


_COPYING = threading.RLock()  # no thread may call copies that another one has not completed


class Overrides:
    """Kernels that replace others, for the same event loop with different mechanics.

    A kernel that is called by name is looked up in its module; if it is a key of ``replaced``, the
    value is called instead, with the same parameters and result. Kernels do not refer to overrides,
    so programs without them pay no cost. ``name`` prefixes the entry points in the library.
    """

    def __init__(self, name: str, replaced: Mapping[Kernel, Kernel]) -> None:
        self.name = name
        self.replaced = replaced
        self._functions: dict[Kernel, Kernel] = {}
        self._namespaces: dict[str, dict[str, Any]] = {}

    def resolved(self, value: Any) -> Any:
        """Return the override of a kernel if it has one, else the value itself."""
        return self.replaced.get(value, value) if isinstance(value, FunctionType) else value

    def symbol(self, kernel: Kernel) -> str:
        """Return the name under which the library exports a kernel that is an entry point."""
        return f"{self.name}.{kernel.__module__}.{kernel.__name__}".lstrip(".").replace(".", "_")

    def interpreted(self, function: Function) -> Function:
        """Return a kernel for the interpreter, with overrides for all kernels that it calls."""
        if not self.replaced:
            return function
        meant = self.resolved(function)
        with _COPYING:
            if meant not in self._functions:
                namespace = self._namespace(meant.__module__)
                copy = FunctionType(meant.__code__, namespace, meant.__name__)
                self._functions[meant] = update_wrapper(copy, meant)
            return self._functions[meant]  # type: ignore[return-value]

    def _namespace(self, module: str) -> dict[str, Any]:
        """Return the names of a module, with its kernels replaced by their overrides."""
        if module not in self._namespaces:
            self._namespaces[module] = names = dict(vars(sys.modules[module]))
            for name, value in list(names.items()):
                if is_kernel(value):
                    names[name] = self.interpreted(value)
        return self._namespaces[module]


NO_OVERRIDES = Overrides("", {})


def any_lane(condition: bool) -> bool:
    """Return whether a condition holds in any lane."""
    return condition


def has_bit(x: float, bit: int) -> bool:
    """Return in each lane whether an integer has a bit set; ``bit`` is the bit's value."""
    return int(x) & bit != 0


def pack(first: float, second: float) -> float:
    """Return two numbers as two lanes."""
    assert first == second
    return first


def extract(lanes: float, number: int) -> float:
    """Return the number in one lane."""
    assert number == 0
    return lanes


def insert(lanes: float, number: int, value: float) -> float:
    """Return lanes with the number in one of them replaced."""
    assert number == 0
    return value if number == 0 else lanes
