"""Constants shared by the whole package."""

EPSILON = 2.0**-52
"""The distance from 1 to the next double."""
NEVER = 1.0e303
"""A time (s) after the end of every run: a ``stop.time`` is at most 1e300."""
