"""Kernels of the solver and the structs they work on; nothing else is compiled.

There is a folder for each stage of the event loop; ``docs/kernels.md`` describes what a kernel may
contain.
"""
