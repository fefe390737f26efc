"""How kernels become machine code: one module of all of them, and one pointer to their world.

Two things are added to numba. Kernels take a named tuple of arrays by value: some hundred machine
words for each call, which would cost more than what the kernels do. Compiled, they are handed a
:class:`Reference` to it instead. And numba makes machine code of every function for itself, before
it is part of the function that calls it; a kernel called by kernels only is kept as it is
(:class:`PartLibrary`) until all of them together are optimised, once.
"""

from __future__ import annotations

import contextlib
import operator
import types
import zlib
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numba
from llvmlite import ir
from numba import _dynfunc
from numba.core import cgutils, typed_passes, untyped_passes
from numba.core import types as numba_types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_lock import global_compiler_lock
from numba.core.compiler_machinery import register_pass
from numba.core.datamodel import models
from numba.core.extending import register_model
from numba.core.imputils import lower_builtin, lower_getattr_generic
from numba.core.typed_passes import NativeLowering
from numba.core.typing.templates import (
    AbstractTemplate,
    AttributeTemplate,
    infer_getattr,
    infer_global,
    signature,
)
from numba.extending import intrinsic
from numba.np.numpy_support import from_dtype

from vibro_cli.numerics import engine


class Reference(numba_types.Type):
    """A pointer to a named tuple of arrays that its owner keeps."""

    def __init__(self, value: Any) -> None:
        self.value = value
        # A short name, since those of all functions contain it.
        super().__init__(name=f"Reference({zlib.crc32(str(value).encode()):x})")


class Rows(numba_types.Type):
    """The records of an array: a pointer to the first one, and their number."""

    def __init__(self, row: Any) -> None:
        self.row = row
        super().__init__(name=f"Rows({row})")


@register_model(Reference)
class _ReferenceModel(models.PrimitiveModel):
    def __init__(self, manager: Any, of: Reference) -> None:
        super().__init__(manager, of, manager.lookup(of.value).get_value_type().as_pointer())


@register_model(Rows)
class _RowsModel(models.StructModel):
    def __init__(self, manager: Any, of: Rows) -> None:
        members = [("first", numba_types.voidptr), ("count", numba_types.intp)]
        super().__init__(manager, of, members)


def _seen(array: Any) -> Any:
    """Type of a field seen through a reference."""
    if (
        isinstance(array, numba_types.Array)
        and array.ndim == 1
        and isinstance(array.dtype, numba_types.Record)
    ):
        return Rows(array.dtype)
    return array


@infer_getattr
class _ReferenceAttribute(AttributeTemplate):
    key = Reference

    def generic_resolve(self, of: Reference, name: str) -> Any:
        if name not in of.value.fields:
            return None
        return _seen(of.value[of.value.fields.index(name)])


@lower_getattr_generic(Reference)
def _lower_attribute(context: Any, builder: Any, of: Reference, value: Any, name: str) -> Any:
    index = of.value.fields.index(name)
    array = builder.load(cgutils.gep_inbounds(builder, value, 0, index))
    field = of.value[index]
    if not isinstance(_seen(field), Rows):
        return array
    return _rows_of(context, builder, field, array)


def _rows_of(context: Any, builder: Any, kind: Any, array: Any) -> Any:
    """The records of an array."""
    whole = context.make_array(kind)(context, builder, array)
    rows = cgutils.create_struct_proxy(Rows(kind.dtype))(context, builder)
    rows.first = builder.bitcast(whole.data, rows.first.type)
    rows.count = whole.nitems
    return rows._getvalue()


@infer_global(operator.getitem)
class _RowTemplate(AbstractTemplate):
    def generic(self, arguments: Any, keywords: Any) -> Any:
        if len(arguments) == 2 and isinstance(arguments[0], Rows):
            return signature(arguments[0].row, arguments[0], numba_types.intp)
        return None


@infer_global(operator.setitem)
class _PutTemplate(AbstractTemplate):
    def generic(self, arguments: Any, keywords: Any) -> Any:
        if len(arguments) == 3 and isinstance(arguments[0], Rows):
            row = arguments[0].row
            return signature(numba_types.none, arguments[0], numba_types.intp, row)
        return None


@infer_global(len)
class _CountTemplate(AbstractTemplate):
    def generic(self, arguments: Any, keywords: Any) -> Any:
        if len(arguments) == 1 and isinstance(arguments[0], Rows):
            return signature(numba_types.intp, arguments[0])
        return None


def _row_at(context: Any, builder: Any, of: Rows, rows: Any, index: Any) -> Any:
    first = cgutils.create_struct_proxy(of)(context, builder, value=rows).first
    size = context.get_constant(numba_types.intp, of.row.size)
    row = builder.gep(first, [builder.mul(index, size)])
    return builder.bitcast(row, context.get_value_type(of.row))


@lower_builtin(operator.getitem, Rows, numba_types.intp)
def _lower_row(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    return _row_at(context, builder, signature.args[0], *values)


@lower_builtin(operator.setitem, Rows, numba_types.intp, numba_types.Record)
def _lower_put(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    rows, index, row = values
    of = signature.args[0]
    target = _row_at(context, builder, of, rows, index)
    size = context.get_constant(numba_types.intp, of.row.size)
    cgutils.raw_memcpy(builder, target, row, size, 1)
    return context.get_dummy_value()


@lower_builtin(len, Rows)
def _lower_count(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    return cgutils.create_struct_proxy(signature.args[0])(context, builder, value=values[0]).count


class PartLibrary(JITCodeLibrary):
    """The code of a kernel that is called by kernels only: a part of theirs, not yet optimised."""

    def _ensure_finalized(self) -> None:
        """Leave the code open: it is finished as a part of the whole."""

    def _get_module_for_linking(self) -> Any:
        return self._final_module

    def _optimize_functions(self, ll_module: Any) -> None:
        ll_module.data_layout = self._codegen._data_layout


class WholeLibrary(JITCodeLibrary):
    """The code of an entry, of which all kernels that it calls become a part."""

    exported = ""
    """Name of the one function that is called from outside."""
    object_code = b""
    """The machine code, once all is finished."""

    def finalize(self) -> None:
        """Gather the parts, then link, optimise and make machine code, which is not loaded."""
        reached = _reached(self)
        parts = [library for library in reached if isinstance(library, PartLibrary)]
        others = [library for library in reached if not isinstance(library, PartLibrary)]
        # The linker takes from numba's own libraries what is called by then.
        self._linking_libraries = parts + others
        super().finalize()

    def _optimize_final_module(self) -> None:
        for function in self._final_module.functions:
            if function.name != self.exported and not function.is_declaration:
                function.linkage = "internal"
        # Once: numba's cheaper passes before these are for reference counts, and here are none.
        passes, builder = self._codegen._module_pass_manager()
        passes.run(self._final_module, builder)

    def _finalize_final_module(self) -> None:
        self.object_code = self._codegen._tm.emit_object(self._final_module)
        self._finalized = True


def _reached(library: Any) -> list[Any]:
    """Libraries of all that the code of a library calls, directly or through parts."""
    reached: dict[Any, None] = {}
    open_ones = [library]
    while open_ones:
        for called in open_ones.pop()._linking_libraries:
            if called not in reached:
                reached[called] = None
                if isinstance(called, PartLibrary):
                    open_ones.append(called)
    return list(reached)


@register_pass(mutates_CFG=True, analysis_only=False)
class PartLowering(NativeLowering):
    """Lower a kernel that is called by kernels only, without making machine code of it."""

    _name = "part_lowering"

    def run_pass(self, state: Any) -> bool:
        """Make the code, and the name under which callers find it."""
        state.library = PartLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        state.flags.no_compile = True
        super().run_pass(state)
        lowered = state["cr"]
        # What its callers ask for; from Python it cannot be called.
        name = _dynfunc.make_function(
            lowered.fndesc.lookup_module(),
            lowered.fndesc.qualname.split(".")[-1],
            "called by kernels only",
            0,
            lowered.env,
            (state.library,),
        )
        state.targetctx.insert_user_function(name, lowered.fndesc, [state.library])
        state["cr"] = lowered._replace(cfunc=name)
        return True


@register_pass(mutates_CFG=True, analysis_only=False)
class WholeLowering(NativeLowering):
    """Lower an entry, in a library that is to gather all that it calls."""

    _name = "whole_lowering"

    def run_pass(self, state: Any) -> bool:
        """Make the code; it stays open for the function by which it is called."""
        state.library = WholeLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.flags.no_compile = True
        return bool(super().run_pass(state))


# Passes for what kernels do not contain: closures, context managers, arrays, literal arguments.
NOT_NEEDED = (
    untyped_passes.DeadBranchPrune,
    untyped_passes.FindLiterallyCalls,
    untyped_passes.GenericRewrites,
    untyped_passes.InlineClosureLikes,
    untyped_passes.InlineInlinables,
    untyped_passes.LiteralPropagationSubPipelinePass,
    untyped_passes.LiteralUnroll,
    untyped_passes.MakeFunctionToJitFunction,
    untyped_passes.RewriteDynamicRaises,
    untyped_passes.WithLifting,
    typed_passes.AnnotateTypes,
    typed_passes.DumpParforDiagnostics,
    typed_passes.InlineOverloads,
    typed_passes.NoPythonSupportedFeatureValidation,
    typed_passes.NopythonRewrites,
)


class PartCompiler(CompilerBase):
    """Compiles a kernel that is called by kernels only."""

    def define_pipelines(self) -> Any:
        """Return the one pipeline there is."""
        return [_pipeline(self.state, PartLowering)]


class WholeCompiler(CompilerBase):
    """Compiles an entry."""

    def define_pipelines(self) -> Any:
        """Return the one pipeline there is."""
        return [_pipeline(self.state, WholeLowering)]


def _pipeline(state: Any, lowering: Any) -> Any:
    manager = DefaultPassBuilder.define_nopython_pipeline(state)
    manager.passes = [
        (lowering, "lowering") if each is NativeLowering else (each, text)
        for each, text in manager.passes
        if each not in NOT_NEEDED
    ]
    manager._finalized = False
    manager.finalize()
    return manager


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
        compiled = function._compiler.compile(tuple(_type_of(form) for form in forms), None)
    library = compiled.library
    library.exported = symbol
    library.add_ir_module(_door(compiled, symbol))
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


def _type_of(form: Any) -> Any:
    if isinstance(form, str):
        return _SCALARS[form]
    if isinstance(form, tuple):
        arrays = [_array_type(array) for array in form]
        return Reference(numba_types.NamedTuple(arrays, type(form)))
    return _seen(_array_type(form))


def _array_type(array: Any) -> Any:
    return numba_types.Array(from_dtype(array.dtype), array.ndim, "C")


def _door(compiled: Any, symbol: str) -> Any:
    """The function by which an entry is called from outside."""
    context, inside = compiled.target_context, compiled.fndesc
    word, pointer, real = ir.IntType(64), ir.IntType(8).as_pointer(), ir.DoubleType()
    kinds = {numba_types.int64: word, numba_types.boolean: word, numba_types.float64: real}
    outside = [kinds.get(kind, pointer) for kind in inside.argtypes]
    module = compiled.library.create_ir_module(symbol)
    door = ir.Function(module, ir.FunctionType(ir.VoidType(), [*outside, pointer]), symbol)
    builder = ir.IRBuilder(door.append_basic_block())
    values = [
        _taken(context, builder, kind, value)
        for kind, value in zip(inside.argtypes, door.args, strict=False)
    ]
    callee = context.declare_function(module, inside)
    _, result = context.call_conv.call_function(
        builder, callee, inside.restype, inside.argtypes, values
    )
    results = builder.bitcast(door.args[-1], word.as_pointer())
    for position, value in enumerate(_numbers(builder, inside.restype, result)):
        place = builder.gep(results, [ir.Constant(word, position)])
        if value.type == real:
            place = builder.bitcast(place, real.as_pointer())
        elif value.type != word:
            value = builder.zext(value, word)
        builder.store(value, place)
    builder.ret_void()
    return module


def _handed(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    """A number as it is, and a pointer for what doors take pointers to."""
    word, pointer = ir.IntType(64), ir.IntType(8).as_pointer()
    if kind == numba_types.boolean:
        return builder.zext(value, word)
    if isinstance(kind, Rows):
        rows = cgutils.create_struct_proxy(kind)(context, builder, value=value)
        held = context.make_array(numba_types.Array(kind.row, 1, "C"))(context, builder)
        held.data = builder.bitcast(rows.first, held.data.type)
        held.nitems = rows.count
        value = held._getpointer()
    return (
        value
        if kind in (numba_types.int64, numba_types.float64)
        else builder.bitcast(value, pointer)
    )


def _from_outside(kernel: Callable[..., Any]) -> Any:
    """What calls a kernel that is apart, through its door."""
    symbol, returned = engine.symbol_of(kernel), _SCALARS.get(kernel.__annotations__["return"])
    word, pointer = ir.IntType(64), ir.IntType(8).as_pointer()

    def call(typing: Any, *kinds: Any) -> Any:
        kinds = tuple(numba_types.unliteral(kind) for kind in kinds)

        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            values = cgutils.unpack_tuple(builder, arguments[0], len(kinds))
            values = [
                _handed(context, builder, kind, value)
                for kind, value in zip(kinds, values, strict=True)
            ]
            found = cgutils.alloca_once(builder, word)
            values.append(builder.bitcast(found, pointer))
            form = ir.FunctionType(ir.VoidType(), [value.type for value in values])
            builder.call(cgutils.get_or_insert_function(builder.module, form, symbol), values)
            if returned is None:
                return context.get_dummy_value()
            if returned == numba_types.float64:
                found = builder.bitcast(found, ir.DoubleType().as_pointer())
            result = builder.load(found)
            boolean = returned == numba_types.boolean
            return builder.trunc(result, ir.IntType(1)) if boolean else result

        return (returned or numba_types.none)(numba_types.StarArgTuple.from_types(kinds)), generate

    return intrinsic(call)


def _numbers(builder: Any, kind: Any, result: Any) -> list[Any]:
    """The numbers of a result."""
    if isinstance(kind, numba_types.BaseTuple):
        return [builder.extract_value(result, n) for n in range(len(kind))]
    return [] if kind == numba_types.none else [result]


def _taken(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    """A number as it is, and what a pointer means for the type of a parameter."""
    if kind == numba_types.boolean:
        return builder.trunc(value, ir.IntType(1))
    if isinstance(kind, Reference):
        return builder.bitcast(value, context.get_value_type(kind))
    if isinstance(kind, Rows):
        array = numba_types.Array(kind.row, 1, "C")
        held = builder.load(builder.bitcast(value, context.get_value_type(array).as_pointer()))
        return _rows_of(context, builder, array, held)
    if isinstance(kind, numba_types.Array):
        return builder.load(builder.bitcast(value, context.get_value_type(kind).as_pointer()))
    return value


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
                _from_outside(function) if engine.is_apart(function) else _of_any_number(part(twin))
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


_SCALARS = {
    "int": numba_types.int64,
    "bool": numba_types.boolean,
    "float": numba_types.float64,
}
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
