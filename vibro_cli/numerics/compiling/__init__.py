"""How kernels become machine code: one module of all of them, and one pointer to their world.

Two things are added to numba. Kernels take a named tuple of arrays by value: some hundred machine
words for each call, which would cost more than what the kernels do. Compiled, they are handed a
:class:`~references.Reference` to it instead. And numba makes machine code of every function for
itself, before it is part of the function that calls it; a kernel called by kernels only is kept as
it is (:class:`~libraries.PartLibrary`) until all of them together are optimised, once.
"""

from vibro_cli.numerics.compiling.whole import object_code

__all__ = ["object_code"]
