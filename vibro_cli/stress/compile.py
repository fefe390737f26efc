"""Compiling the judge: with numba as it is, apart from the solver's kernels."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba
from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic

Function = TypeVar("Function", bound=Callable[..., Any])


def compiled(function: Function) -> Function:
    """Compile a function of floats and arrays, without the interpreter's lock."""
    return cast(Function, numba.njit(nogil=True, error_model="numpy")(function))


def _fused(typing_context: Any, a: Any, b: Any, c: Any) -> Any:
    """``a b + c``, rounded once (IEEE 754 fusedMultiplyAdd)."""
    signature = types.float64(types.float64, types.float64, types.float64)

    def generate(context: Any, builder: ir.IRBuilder, signature: Any, arguments: Any) -> Any:
        return builder.fma(*arguments)

    return signature, generate


fused: Any = intrinsic(_fused)
