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
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import Any

from vibro_cli.numerics import engine
from vibro_cli.numerics.cache import alone_in, code_folder, read_checked, tell, write_checked

_SCALARS = {"int": ctypes.c_int64, "bool": ctypes.c_int64, "float": ctypes.c_double}
_COMPILING = "compiling the kernels; this takes half a minute or so"
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


class CompiledKernel:
    """A kernel with its machine code (see :func:`compiled`)."""

    def __init__(self, kernel: Callable[..., Any]) -> None:
        kinds = dict(kernel.__annotations__)
        self._kernel = kernel
        self.symbol = f"{kernel.__module__}.{kernel.__name__}"
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
        layout = [
            [(array.dtype, array.ndim) for array in _arrays(argument)]
            for argument, number in zip(arguments, self._numbers, strict=True)
            if number is None
        ]
        if self._function is None:
            with _making:
                if self._function is None:
                    self._layout = layout
                    self._function = self._ready(arguments)
        if layout != self._layout:
            raise TypeError(f"{self.symbol}: arrays of another form than at the first call")
        blocks = [
            argument if number is not None else _block(argument)
            for argument, number in zip(arguments, self._numbers, strict=True)
        ]
        words = [block.ctypes.data if hasattr(block, "ctypes") else block for block in blocks]
        found = (ctypes.c_int64 * max(1, len(self.results)))()
        self._function(*words, found)
        return self._unpacked(found)

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

    def _ready(self, arguments: Sequence[Any]) -> Any:
        """The address of the machine code, as a function."""
        code = self._code(arguments)
        kinds: list[Any] = [number or ctypes.c_void_p for number in self._numbers]
        call = ctypes.CFUNCTYPE(None, *kinds, ctypes.POINTER(ctypes.c_int64))  # releases the GIL
        return call(_load(code, self.symbol))

    def _code(self, arguments: Sequence[Any]) -> bytes:
        form = hashlib.sha256(repr(self._layout).encode()).hexdigest()[:8]
        path = code_folder(f"kernels-{digest(self._kernel)}") / f"{self.symbol}-{form}.o"
        code = read_checked(path)
        self.kept = code is not None
        if code is not None:
            return code
        with alone_in(path.parent) as locked:
            code = read_checked(path)
            if code is None:
                tell(_COMPILING + (", and only once" if locked else ""))
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
        address = array.__array_interface__["data"][0]
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
    return digest_of([*paths, Path(__file__).with_name("compiling.py")], constants)


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


def _load(code: bytes, symbol: str) -> int:
    """The address of a function of an object file, once that is in memory and linked."""
    import llvmlite.binding as llvm

    loader = _loader()
    loader.add_object_file(llvm.ObjectFileRef.from_data(code))
    loader.finalize_object()
    address = loader.get_function_address(symbol)
    if not address:
        raise RuntimeError(f"the machine code has no function {symbol}")
    return int(address)
