"""The types of the compiled subset of Python, and their names in C++."""

from __future__ import annotations

import inspect
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, get_args, get_origin

from vibro_cli.compile.kernel import (
    CACHE_LINE,
    LANES,
    SERIES_LENGTH,
    Kernel,
    Overrides,
    has_lanes,
    is_struct,
)


@dataclass(frozen=True)
class Kind:
    """A type: its form and its name in C++."""

    form: str
    cpp: str
    item: Any = None
    """Type of the elements of an array or row; types of a tuple's items; class of a struct."""
    size: int = 0
    """Number of lanes or axes."""

    @property
    def is_numeric(self) -> bool:
        """Whether its values are numbers or booleans, in lanes or not."""
        return self.form in ("number", "lanes", "mask")

    @property
    def members(self) -> Mapping[str, Any]:
        """Types of the members of a struct, a named tuple or a tuple, by their names in C++."""
        if self.form == "tuple":
            return {f"at{n}": item for n, item in enumerate(self.item)}
        return _members(self.item) if self.form in ("struct", "world") else {}


def lanes_of(count: int) -> Kind:
    """Return the type of ``count`` lanes with a double in each."""
    return Kind("lanes", f"Lanes<{count}>", size=count)


def mask_of(kind: Kind) -> Kind:
    """Return the type of a comparison of numbers: boolean, in lanes if the numbers are."""
    return Kind("mask", f"Mask<{kind.size}>", size=kind.size) if kind.size else BOOL


def tuple_of(items: Iterable[Kind]) -> Kind:
    """Return the type of several values that a kernel returns together."""
    items = tuple(items)
    return Kind("tuple", f"Tuple<{', '.join(item.cpp for item in items)}>", items)


def array_of(item: Kind, axes: int = 1) -> Kind:
    """Return the type of an array of numbers or structs in C order."""
    element = item.cpp.rstrip("*")  # an array holds structs, not pointers to them
    return Kind("array", f"Array<{element}, {axes}>", item, axes)


class TranslationError(Exception):
    """A kernel is not in the compiled subset; the message gives file, line and reason."""


FLOAT, INT, BOOL = (Kind("number", name) for name in ("double", "int64_t", "bool"))
NOTHING = Kind("nothing", "void")
SERIES = Kind("row", "double*", FLOAT)
NAMED: Mapping[str, Kind] = {
    "float": FLOAT,
    "int": INT,
    "bool": BOOL,
    "None": NOTHING,
    "Lanes": lanes_of(LANES),
    "Two": lanes_of(2),
    "Series": SERIES,
    "FloatMatrix": array_of(FLOAT, 2),
    "IntMatrix": array_of(INT, 2),
    "BoolMatrix": array_of(BOOL, 2),
    "FloatArray3": array_of(FLOAT, 3),
    "FloatArray4": array_of(FLOAT, 4),
}


def joined(*kinds: Kind) -> Kind | None:
    """Return the type of a variable assigned values of the given types; None if there is none."""
    found: Kind | None = kinds[0]
    for kind in kinds[1:]:
        found = found and _joined(found, kind)
    return found


def _joined(one: Kind, other: Kind) -> Kind | None:
    if one == other:
        return one
    for kind, beside in ((one, other), (other, one)):
        if kind.size and kind.is_numeric:
            numbers = (FLOAT, INT, BOOL) if kind.form == "lanes" else (BOOL,)
            return kind if beside in numbers else None
    if one.is_numeric and other.is_numeric:
        return FLOAT if FLOAT in (one, other) else INT
    return None


@cache
def annotated(text: str, module: str) -> Any:
    """Return the type of an annotation in a module; None if it is not in the subset."""
    return _kind_of(eval(text, vars(sys.modules[module]), NAMED))


def _kind_of(value: Any) -> Any:
    if isinstance(value, Kind):
        return value
    if is_struct(value):
        return Kind("struct", f"{value.__name__}*", value)
    if hasattr(value, "_fields"):
        return Kind("world", f"const {value.__name__}*", value)
    items = tuple(map(_kind_of, get_args(value)))
    if not items or None in items:
        return NAMED.get(getattr(value, "__name__", str(value)))
    if get_origin(value) is tuple:
        return tuple_of(items)
    (item,) = items
    return array_of(item.item, item.size + 1) if item.form == "array" else array_of(item)


@cache
def _members(cls: Any) -> dict[str, Any]:
    texts = cls.fields if is_struct(cls) else cls.__annotations__
    return {
        name: annotated(getattr(text, "__forward_arg__", text), cls.__module__)
        for name, text in texts.items()
    }


def declaration(kind: Kind) -> str:
    """Return the C++ declaration of a type; structs have the layout of their structured array."""
    if not kind.members:
        return ""
    if kind.form == "tuple":
        head = f"template <>\nstruct {kind.cpp}"
    else:
        aligned = kind.form == "struct" and has_lanes(kind.item)
        head = f"struct {f'alignas({CACHE_LINE}) ' if aligned else ''}{kind.item.__name__}"
    members = [
        f"double {name}[{SERIES_LENGTH}]" if each == SERIES else f"{each.cpp} {name}"
        for name, each in kind.members.items()
    ]
    return "\n".join([f"{head} {{", *(f"  {one};" for one in members), "};\n"])


def symbol_of(kernel: Kernel, overrides: Overrides | None = None) -> str:
    """Return the name under which the library exports a kernel that is an entry point."""
    place = f"{kernel.__module__}.{kernel.__name__}".replace(".", "_")
    return f"{overrides.name}_{place}" if overrides else place


@cache
def signature(kernel: Kernel) -> tuple[tuple[str, ...], tuple[Any, ...], Any]:
    """Return the names and types of a kernel's parameters, and the type of its result.

    Raises
    ------
    TranslationError
        If an annotation is missing or not in the subset.
    """
    kinds = {}
    for name in (*inspect.signature(kernel).parameters, "return"):
        text = kernel.__annotations__.get(name)
        kind = annotated(str(text), kernel.__module__) if text is not None else None
        if kind is None:
            raise TranslationError(
                f"{place_of(kernel)}: {kernel.__name__}: {name}: found {text!r}, expected a type "
                "of numbers, structs, tuples or arrays of them"
            )
        kinds[name] = kind
    returned = kinds.pop("return")
    return tuple(kinds), tuple(kinds.values()), returned


def place_of(kernel: Kernel) -> str:
    """Return the file and line of a kernel."""
    return f"{shown(kernel.__code__.co_filename)}:{kernel.__code__.co_firstlineno}"


def shown(path: str) -> str:
    """Return a path as messages show it: relative to the root of the package if it is inside."""
    file = Path(path)
    root = Path(__file__).parents[2]
    return file.relative_to(root).as_posix() if file.is_relative_to(root) else path
