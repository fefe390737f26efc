"""Bodies rolling on a straight line, each held by a spring (C, part 3)."""
