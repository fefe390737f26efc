"""The types of the compiled subset of Python, each with its names in C++, numpy and ctypes."""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, get_args, get_origin

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
def _named(text: str, module: str) -> Any:
    return kind_of(eval(text, vars(sys.modules[module])))


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
