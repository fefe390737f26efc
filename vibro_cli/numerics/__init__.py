"""Elliptic functions, certified steps, and the switch between interpreted and compiled kernels."""
