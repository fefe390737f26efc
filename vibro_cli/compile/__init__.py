"""Kernels: short typed Python functions that are interpreted or run as machine code.

``kernel`` declares kernels, the structs they work on and their types; ``translate`` translates them
to C++; ``build`` compiles the library; ``native`` loads and calls it.
"""
