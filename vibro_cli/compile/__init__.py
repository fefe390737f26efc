"""Kernels: short typed Python functions that are interpreted or run as machine code.

``kernel`` declares kernels and the structs they work on; ``kinds`` and ``translate`` translate them
to C++; ``build`` compiles the library; ``native`` loads and calls it.
"""
