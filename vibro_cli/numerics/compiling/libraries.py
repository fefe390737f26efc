"""One module of all kernels: how numba's libraries and passes are made to give it."""

from __future__ import annotations

from typing import Any

from numba import _dynfunc
from numba.core import typed_passes, untyped_passes
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import register_pass
from numba.core.typed_passes import NativeLowering


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
