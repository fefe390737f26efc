"""Arithmetic of the kernels: double-double, elliptic functions, certified roots."""
