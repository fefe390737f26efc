"""Compiling the judge: with numba, apart from the solver's kernels and kept beside them."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic

from vibro_cli.numerics.cache import code_folder
from vibro_cli.numerics.cache_file import keep_in
from vibro_cli.numerics.engine import digest_of

Function = TypeVar("Function", bound=Callable[..., Any])

# Modules whose functions are compiled here; the machine code of one holds that of others.
SOURCES = ("compile", "double_double", "grazing", "judge")


@cache
def _folder() -> Path:
    paths = [Path(__file__).with_name(f"{name}.py") for name in SOURCES]
    return code_folder(f"judge-{digest_of(paths)}")


def compiled(function: Function) -> Function:
    """Compile a function of floats and arrays, without the interpreter's lock."""
    result: Any = numba.njit(nogil=True, error_model="numpy")(function)
    keep_in(_folder(), result)
    return cast(Function, result)


def _fused(typing_context: Any, a: Any, b: Any, c: Any) -> Any:
    """``a b + c``, rounded once (IEEE 754 fusedMultiplyAdd)."""
    signature = types.float64(types.float64, types.float64, types.float64)

    def generate(context: Any, builder: ir.IRBuilder, signature: Any, arguments: Any) -> Any:
        return builder.fma(*arguments)

    return signature, generate


fused: Any = intrinsic(_fused)
