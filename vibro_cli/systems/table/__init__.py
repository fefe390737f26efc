"""Balls on a horizontal plane, with skew impacts and a wall (C, parts 1 and 2)."""
