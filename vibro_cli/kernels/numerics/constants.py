"""Constants shared by the whole package."""

EPSILON = 2.0**-52
"""The distance from 1 to the next double."""
NEVER = 1.0e303
"""A time (s) after the end of every run: a ``stop.time`` is at most 1e300."""
LATEST = 1.0e100
"""The time (s) at which a run without a ``stop.time`` ends if it still has events to come.

On level lines impacts go on for ever, ever more slowly. Beyond 1e150 s the squares of the speeds
would be lost.
"""
