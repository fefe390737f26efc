"""Kernels: short typed Python functions, interpreted as they are or run as machine code.

``kernel`` declares them and the structs they work on, ``kinds`` and ``translate`` write them as
C++, ``build`` makes the library with a C++ compiler, ``native`` loads it and calls it.
"""
