"""Elliptic functions by themselves; functions of numbers, arrays and derivatives alike."""
