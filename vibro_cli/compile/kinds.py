"""The types of the compiled subset of Python, and their names in C++."""

from __future__ import annotations

import ast
import inspect
import sys
import types
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from vibro_cli.compile.kernel import (
    CACHE_LINE,
    LANES,
    SERIES_LENGTH,
    Kernel,
    Overrides,
    has_lanes,
    is_struct,
)


class Kind(NamedTuple):
    """A type: its form and its name in C++."""

    form: str
    cpp: str
    item: Any = None
    """Type of the elements of an array or row; types of a tuple's items; class of a struct."""
    size: Any = 0
    """Number of lanes or axes, or the extents of a constant."""

    @property
    def is_numeric(self) -> bool:
        """Whether its values are numbers or booleans, in lanes or not."""
        return self.form in ("number", "lanes", "mask")


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
    return _type_of(ast.parse(text, mode="eval").body, module)


def _type_of(node: ast.expr, module: str) -> Any:
    if isinstance(node, ast.Constant):
        return NOTHING if node.value is None else None
    if isinstance(node, ast.Name):
        if node.id in NAMED:
            return NAMED[node.id]
        return _of_value(getattr(sys.modules[module], node.id, None))
    if isinstance(node, ast.Subscript) and isinstance(node.value, ast.Name):
        parts = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        items = tuple(_type_of(part, module) for part in parts)
        if None in items:
            return None
        if node.value.id == "tuple":
            return tuple_of(items)
        if node.value.id in ("Sequence", "list"):
            (inner,) = items
            is_array = inner.form == "array"
            return array_of(inner.item, inner.size + 1) if is_array else array_of(inner)
    return None


def _of_value(value: Any) -> Any:
    if is_struct(value):
        return Kind("struct", f"{value.__name__}*", value)
    if isinstance(value, type) and issubclass(value, tuple) and hasattr(value, "_fields"):
        return Kind("world", f"const {value.__name__}*", value)
    if isinstance(value, types.GenericAlias) and value.__origin__ is tuple:
        return tuple_of(NAMED[item.__name__] for item in value.__args__)
    return None


@cache
def fields_of(world: type) -> dict[str, Any]:
    """Return the types of the arrays of a named tuple, by name."""
    return {
        name: annotated(kind if isinstance(kind, str) else kind.__forward_arg__, world.__module__)
        for name, kind in world.__annotations__.items()
    }


def field(cls: type, name: str) -> Any:
    """Return the type of a field of a struct; None if there is no such field."""
    return NAMED.get(cls.fields.get(name, ""))  # type: ignore[attr-defined]


def declaration(kind: Kind) -> str:
    """Return the C++ declaration of a type; structs have the layout of their structured array."""
    head = f"struct {getattr(kind.item, '__name__', '')}"
    if kind.form == "struct":
        if has_lanes(kind.item):
            head = f"struct alignas({CACHE_LINE}) {kind.item.__name__}"
        fields = [_in_struct(name, field(kind.item, name)) for name in kind.item.fields]
    elif kind.form == "world":
        fields = [f"{each.cpp} {name}" for name, each in fields_of(kind.item).items()]
    elif kind.form == "tuple":
        head = f"template <>\nstruct {kind.cpp}"
        fields = [f"{each.cpp} at{n}" for n, each in enumerate(kind.item)]
    else:
        return ""
    return "\n".join([f"{head} {{", *(f"  {one};" for one in fields), "};\n"])


def _in_struct(name: str, kind: Kind) -> str:
    if kind == SERIES:
        return f"double {name}[{SERIES_LENGTH}]"
    return f"{kind.cpp} {name}"


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
