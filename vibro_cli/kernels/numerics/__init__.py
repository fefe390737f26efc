"""Arithmetic of the kernels: double-double, elliptic functions, roots found with a certificate."""
