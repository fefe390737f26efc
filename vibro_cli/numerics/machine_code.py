"""Kernels run as machine code, which is kept between runs as plain object files.

The compiler (numba) is needed only to make an object file. One that is there is loaded by LLVM's
own loader and called through ctypes: a run with a warm cache never imports the compiler.
"""

from __future__ import annotations

import contextlib
import ctypes
import gc
import hashlib
import platform
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import Any

from vibro_cli.numerics import engine
from vibro_cli.numerics.cache import (
    alone_with,
    code_folder,
    is_there,
    read_checked,
    tell_once,
    write_checked,
)

_SCALARS = {"int": ctypes.c_int64, "bool": ctypes.c_int64, "float": ctypes.c_double}
_COMPILING = "compiling the kernels; this takes some ten seconds"
_entries: dict[Callable[..., Any], CompiledKernel] = {}
_making = threading.Lock()


def compiled(kernel: Callable[..., Any]) -> CompiledKernel:
    """Return the compiled form of a kernel, to be called like the kernel itself.

    Its machine code holds all kernels that it calls. It is made, or read from the cache, at the
    first call; of several processes with a cold cache one makes it, and the others wait.

    Parameters
    ----------
    kernel
        A function decorated with :func:`vibro_cli.numerics.engine.kernel`. Annotated ``int``,
        ``float`` or ``bool``, its parameters are numbers; all others are numpy arrays in C order,
        or named tuples of them. It returns numbers, or a tuple of them, or nothing.
    """
    if kernel not in _entries:
        _entries[kernel] = CompiledKernel(kernel)
    return _entries[kernel]


def prepare_together(calls: Sequence[tuple[Callable[..., Any], Any]], beside: str = "") -> None:
    """Make or load the machine code of kernels that call each other, for calls with arguments.

    Parameters
    ----------
    calls
        Each kernel with the arguments of a call; what takes longest to make first.
    beside
        ``"module:function"``, called in a process of its own if more than one of them is to be
        made; it is to make all but the first.
    """
    with _making:
        kernels = [(compiled(kernel), arguments) for kernel, arguments in calls]
        kernels = [(kernel, arguments) for kernel, arguments in kernels if not kernel.is_loaded]
        missing = [kernel for kernel, arguments in kernels if not kernel.is_made(arguments)]
        with helper(beside) if beside and len(missing) > 1 else contextlib.nullcontext():
            codes = [kernel.code(arguments) for kernel, arguments in kernels]
        _add(codes)
        for kernel, arguments in kernels:
            kernel.load(arguments)


@contextlib.contextmanager
def helper(task: str) -> Iterator[None]:
    """Have ``"module:function"`` done by another process, which ends with this one or earlier.

    Whatever it fails to do is done here: nothing is said of it.
    """
    module, _, function = task.partition(":")
    program = (
        "import os, sys, threading\n"
        "threading.Thread(target=lambda: (sys.stdin.read(), os._exit(1)), daemon=True).start()\n"
        f"from {module} import {function}\n{function}()\n"
    )
    command = [sys.executable, "-c", program]
    silent = subprocess.DEVNULL
    process = None
    with contextlib.suppress(OSError):
        process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=silent, stderr=silent, start_new_session=True
        )
    try:
        yield
    finally:
        if process is not None:
            process.kill()
            process.communicate()


class CompiledKernel:
    """A kernel with its machine code (see :func:`compiled`)."""

    def __init__(self, kernel: Callable[..., Any]) -> None:
        kinds = dict(kernel.__annotations__)
        self._kernel = kernel
        self.symbol = engine.symbol_of(kernel)
        self.results = results_of(kinds.pop("return"))
        self._numbers = [_SCALARS.get(kind) for kind in kinds.values()]
        self._layout: list[Any] = []
        self._function: Any = None
        self.kept = False
        """Whether the machine code is kept for the next process, once the kernel was called."""

    def __call__(self, *arguments: Any) -> Any:
        """Return what the kernel returns.

        Raises
        ------
        TypeError
            If the arguments are not of the form they had at the first call.
        """
        self.prepare(*arguments)
        blocks = [
            argument if number is not None else _block(argument)
            for argument, number in zip(arguments, self._numbers, strict=True)
        ]
        words = [block.ctypes.data if hasattr(block, "ctypes") else block for block in blocks]
        found = (ctypes.c_int64 * max(1, len(self.results)))()
        self._function(*words, found)
        return self._unpacked(found)

    def prepare(self, *arguments: Any) -> None:
        """Make or load the machine code for a call with these arguments, without calling it.

        Raises
        ------
        TypeError
            If the arguments are not of the form they had at the first call.
        """
        layout = self._layout_of(arguments)
        if self._function is None:
            prepare_together([(self._kernel, arguments)])
        if layout != self._layout:
            raise TypeError(f"{self.symbol}: arrays of another form than at the first call")

    def _layout_of(self, arguments: Sequence[Any]) -> list[Any]:
        return [
            [(array.dtype, array.ndim) for array in _arrays(argument)]
            for argument, number in zip(arguments, self._numbers, strict=True)
            if number is None
        ]

    def _unpacked(self, found: Any) -> Any:
        reals = ctypes.cast(found, ctypes.POINTER(ctypes.c_double))
        values = [
            reals[n] if kind == "float" else bool(found[n]) if kind == "bool" else found[n]
            for n, kind in enumerate(self.results)
        ]
        if self.results and not self._is_tuple:
            return values[0]
        return tuple(values) if values else None

    @property
    def _is_tuple(self) -> bool:
        return str(self._kernel.__annotations__["return"]).startswith("tuple")

    @property
    def is_loaded(self) -> bool:
        """Whether the machine code is in memory."""
        return self._function is not None

    def is_made(self, arguments: Sequence[Any]) -> bool:
        """Tell whether there is a file with the machine code for a call with these arguments."""
        return is_there(self._path(arguments))

    def load(self, arguments: Sequence[Any]) -> None:
        """Take the machine code, which is in memory, for a call with these arguments."""
        kinds: list[Any] = [number or ctypes.c_void_p for number in self._numbers]
        call = ctypes.CFUNCTYPE(None, *kinds, ctypes.POINTER(ctypes.c_int64))  # releases the GIL
        self._layout = self._layout_of(arguments)
        self._function = call(_address(self.symbol))

    def _path(self, arguments: Sequence[Any]) -> Path:
        form = hashlib.sha256(repr(self._layout_of(arguments)).encode()).hexdigest()[:8]
        return code_folder(f"kernels-{digest(self._kernel)}") / f"{self.symbol}-{form}.o"

    def code(self, arguments: Sequence[Any]) -> bytes:
        """Return the machine code for a call with these arguments: kept, or made and kept."""
        path = self._path(arguments)
        code = read_checked(path)
        self.kept = code is not None
        if code is not None:
            return code
        with alone_with(path) as locked:
            code = read_checked(path)
            if code is None:
                tell_once(_COMPILING + (", and only once" if locked else ""))
                code = self._make(arguments)
                write_checked(path, code)
        self.kept = read_checked(path) == code
        return code

    def _make(self, arguments: Sequence[Any]) -> bytes:
        with _no_collection():
            from vibro_cli.numerics.compiling import object_code

            kinds = [kind for name, kind in self._kernel.__annotations__.items()]
            forms = [
                kind if kind in _SCALARS else argument
                for kind, argument in zip(kinds, arguments, strict=False)
            ]
            code: bytes = object_code(self._kernel, forms, self.symbol)
        return code


def results_of(annotation: str) -> tuple[str, ...]:
    """The kinds of the numbers that a kernel returns."""
    if annotation == "None":
        return ()
    kinds = annotation.removeprefix("tuple[").removesuffix("]").split(", ")
    return tuple(kinds)


def _arrays(argument: Any) -> Sequence[Any]:
    return argument if isinstance(argument, tuple) else (argument,)


def _block(argument: Any) -> Any:
    """What the compiler knows of the arrays of an argument, as words of memory."""
    import numpy as np

    words: list[int] = []
    for array in _arrays(argument):
        if not array.flags.c_contiguous:
            raise TypeError("the arrays of a compiled kernel must be in C order")
        address = array.ctypes.data
        words += (0, 0, array.size, array.itemsize, address, *array.shape, *array.strides)
    return np.array(words, dtype=np.int64)


@contextlib.contextmanager
def _no_collection() -> Iterator[None]:
    """No search for garbage: the compiler makes millions of objects that live until it has done."""
    collecting = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collecting:
            gc.enable()


@cache
def digest(kernel: Callable[..., Any]) -> str:
    """Return a digest of all that the machine code of a kernel depends on.

    These are the sources of the modules of all kernels that it can call, the constants of other
    modules that they use, the compiler's own sources here, the versions and the processor.
    """
    modules = engine.modules_of(kernel)
    paths = [Path(str(module.__file__)) for module in modules]
    constants = repr([engine.constants_of(module) for module in modules])
    own = sorted((Path(__file__).parent / "compiling").glob("*.py"))
    return digest_of([*paths, *own], constants)


def digest_of(sources: Sequence[Path], constants: str = "") -> str:
    """Return a digest of source files, of constants and of what else decides the machine code."""
    from importlib.metadata import version

    import llvmlite.binding as llvm

    found = hashlib.sha256(constants.encode())
    for path in sources:
        found.update(path.read_bytes())
    processor = (platform.machine(), llvm.get_host_cpu_name(), str(llvm.get_host_cpu_features()))
    versions = (version("numba"), version("llvmlite"), sys.version)
    found.update(repr((versions, processor)).encode())
    return found.hexdigest()[:16]


@cache
def _loader() -> Any:
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    target = llvm.Target.from_triple(llvm.get_process_triple())
    return llvm.create_mcjit_compiler(llvm.parse_assembly(""), target.create_target_machine())


def _add(codes: Sequence[bytes]) -> None:
    """Bring object files into memory and link them."""
    import llvmlite.binding as llvm

    for code in codes:
        _loader().add_object_file(llvm.ObjectFileRef.from_data(code))
    _loader().finalize_object()


def _address(symbol: str) -> int:
    address = int(_loader().get_function_address(symbol))
    if not address:
        raise RuntimeError(f"the machine code has no function {symbol}")
    return address
