"""How kernels become machine code: one module of all of them, and one pointer to their world.

Two things are added to numba. Kernels take a named tuple of arrays by value: some hundred machine
words for each call, which would cost more than what the kernels do. Compiled, they are handed a
:class:`Reference` to it instead. And numba makes machine code of every function for itself, before
it is part of the function that calls it; a kernel called by kernels only is kept as it is
(:class:`PartLibrary`) until all of them together are optimised, once.
"""

from __future__ import annotations

import operator
import types
import zlib
from collections.abc import Callable
from typing import Any

from numba import _dynfunc
from numba.core import cgutils, typed_passes, untyped_passes
from numba.core import types as numba_types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
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
    whole = context.make_array(field)(context, builder, array)
    rows = cgutils.create_struct_proxy(_seen(field))(context, builder)
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


@intrinsic
def referenced(typing: Any, values: Any) -> Any:
    """Return arguments with references to named tuples in place of these.

    They are good until the calling function returns.
    """
    kinds = [Reference(v) if isinstance(v, numba_types.BaseNamedTuple) else v for v in values]
    result = numba_types.Tuple(kinds)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        items = cgutils.unpack_tuple(builder, arguments[0], len(kinds))
        items = [
            cgutils.alloca_once_value(builder, item) if isinstance(kind, Reference) else item
            for kind, item in zip(kinds, items, strict=True)
        ]
        return context.make_tuple(builder, result, items)

    return result(values), generate


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

    def finalize(self) -> None:
        """Gather the parts, then link, optimise and make machine code."""
        reached = _reached(self)
        parts = [library for library in reached if isinstance(library, PartLibrary)]
        others = [library for library in reached if not isinstance(library, PartLibrary)]
        self._names = {f.name for part in parts for f in part.get_defined_functions()}
        # The linker takes from numba's own libraries what is called by then.
        self._linking_libraries = parts + others
        super().finalize()

    def _optimize_final_module(self) -> None:
        for function in self._final_module.functions:
            if function.name in self._names:
                function.linkage = "internal"
        # Once: numba's cheaper passes before these are for reference counts, and here are none.
        passes, builder = self._codegen._module_pass_manager()
        passes.run(self._final_module, builder)


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
    """Lower an entry, with all that it calls."""

    _name = "whole_lowering"

    def run_pass(self, state: Any) -> bool:
        """Make the code in a library that gathers its parts."""
        state.library = WholeLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
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
        """Have the kernel made that the entry calls; return the one pipeline there is."""
        entry = self.state.func_id.func
        if entry in _kernels_of_entries:
            entry.__globals__["_kernel"] = _kernels_of_entries.pop(entry)()
        return [_pipeline(self.state, WholeLowering)]


_kernels_of_entries: dict[types.FunctionType, Callable[[], Any]] = {}


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


def entry_of(kernel: Callable[..., Any], make: Callable[[], Any]) -> types.FunctionType:
    """Return what is compiled as the entry of a kernel; ``make`` returns its compiled form.

    Where the machine code is read from the cache, it is never made.
    """
    entry = types.FunctionType(_enter.__code__, {"referenced": referenced}, kernel.__name__)
    entry.__qualname__ = kernel.__name__
    entry.__module__ = kernel.__module__
    _kernels_of_entries[entry] = make
    return entry


def _enter(*arguments):
    return _kernel(*referenced(arguments))  # noqa: F821
