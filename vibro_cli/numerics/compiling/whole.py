"""From a kernel, with all that it calls, to one object file."""

from __future__ import annotations

import contextlib
import types
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numba
from numba.core import types as numba_types
from numba.core.compiler_lock import global_compiler_lock

from vibro_cli.numerics import engine
from vibro_cli.numerics.compiling.doors import door_of, from_outside
from vibro_cli.numerics.compiling.libraries import PartCompiler, WholeCompiler
from vibro_cli.numerics.compiling.references import type_of


@global_compiler_lock
def object_code(kernel: Callable[..., Any], forms: Sequence[Any], symbol: str) -> bytes:
    """Return an object file with a kernel and all that it calls.

    Parameters
    ----------
    kernel
        The kernel that is called from outside.
    forms
        Of each parameter ``"int"``, ``"bool"`` or ``"float"``, or an array, or a named tuple of
        arrays, of the types that it is to be called with.
    symbol
        Name of the function in the object file. It takes integers and doubles, and for arrays
        pointers to what numba holds of them, one after another; at last a pointer to where the
        results go, eight bytes each.
    """
    function = numba.njit(pipeline_class=WholeCompiler, **_OPTIONS)(_namesake(kernel))
    with _remembered_operators(function.typingctx):
        compiled = function._compiler.compile(tuple(type_of(form) for form in forms), None)
    library = compiled.library
    library.exported = symbol
    library.add_ir_module(door_of(compiled, symbol))
    library.finalize()
    return bytes(library.object_code)


@contextlib.contextmanager
def _remembered_operators(typing: Any) -> Iterator[None]:
    """What operations on numbers give is found out once, not at each of ten thousand uses."""
    found: dict[Any, Any] = {}
    find = typing.resolve_function_type

    def resolve(function: Any, kinds: Any, keywords: Any) -> Any:
        numbers = (numba_types.Number, numba_types.Boolean)
        if keywords or not all(isinstance(kind, numbers) for kind in kinds):
            return find(function, kinds, keywords)
        if (function, kinds) not in found:
            found[function, kinds] = find(function, kinds, keywords)
        return found[function, kinds]

    typing.resolve_function_type = resolve
    try:
        yield
    finally:
        del typing.resolve_function_type


def _namesake(kernel: Callable[..., Any]) -> types.FunctionType:
    """A function like a kernel, for which other kernels mean their compiled form."""
    _make_twins(kernel)
    return _twin_functions[kernel]


def _make_twins(kernel: Callable[..., Any]) -> None:
    """Make a twin of every kernel that a kernel can call.

    Kernels called by kernels only have no entry from Python, and no machine code of their own: it
    would be made for every one of them, and take most of the time.
    """
    part = numba.njit(pipeline_class=PartCompiler, **_OPTIONS)
    namespaces = {}
    for module in engine.modules_of(kernel):
        if module.__name__ in _twinned:
            continue
        _twinned.add(module.__name__)
        namespaces[module.__name__] = namespace = dict(vars(module))
        for function in engine.kernels_of(module.__name__):
            twin = types.FunctionType(
                function.__code__, namespace, function.__name__, function.__defaults__
            )
            twin.__module__ = module.__name__
            _twin_functions[function] = twin
            _twins[function] = (
                from_outside(function) if engine.is_apart(function) else _of_any_number(part(twin))
            )
    for namespace in namespaces.values():
        for name, value in list(namespace.items()):
            if isinstance(value, types.FunctionType) and value in _twins:
                namespace[name] = _twins[value]


def _of_any_number(function: Any) -> Any:
    """A compiled function that is not made again for each constant that it is called with."""
    general = function.get_call_template

    def template(kinds: Any, keywords: Any) -> Any:
        return general(tuple(numba_types.unliteral(kind) for kind in kinds), keywords)

    function.get_call_template = template
    return function


_twinned: set[str] = set()
_twins: dict[Any, Any] = {}
_twin_functions: dict[Any, types.FunctionType] = {}
# Same operations in the same order as the interpreter: no contraction, no reassociation. Options
# of numba that its type hints leave out.
_OPTIONS: dict[str, Any] = {
    "error_model": "numpy",
    "nogil": True,
    "_nrt": False,
    "no_cpython_wrapper": True,
    "no_cfunc_wrapper": True,
}
