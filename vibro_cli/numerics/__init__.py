"""Jacobi's elliptic functions; functions of numbers, arrays and numbers with derivatives."""
