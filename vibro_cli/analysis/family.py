"""Families of phase portraits: how the type depends on a parameter, and where it changes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

IMPOSSIBLE = "impossible"
"""Type of a member that is no valid scenario."""
_EVENT = 1e-9
"""Changes closer than this fraction of the parameter are one."""


@dataclass(frozen=True)
class Change:
    """Where the type of the portrait changes."""

    low: float
    """Largest value found with the type before."""
    high: float
    """Least value found with the type after: the next double, or, where the types between are those
    of the change itself (equal energies, a degenerate point), the end of these."""
    before: str
    after: str


def changes(type_of: Callable[[float], str], values: Sequence[float]) -> tuple[Change, ...]:
    """Return where the type changes between neighbouring values, each place found by bisection.

    `type_of` gives the type at a parameter value, `IMPOSSIBLE` where there is none; `values` rise.
    Between two values with different types one change is found, even if there are several.
    """
    types = [type_of(value) for value in values]
    found: list[Change] = []
    for (low, before), (high, after) in pairwise(zip(values, types, strict=True)):
        if before != after:
            found += _bisected(type_of, (low, before), (high, after))
    return _events(found)


def _events(found: Sequence[Change]) -> tuple[Change, ...]:
    """Return changes with those as one between which there is no room for a type of its own.

    A type that takes equal energies, or vanishing ones, is found where they are so to rounding.
    """
    joined: list[Change] = []
    for change in found:
        last = joined[-1] if joined else None
        near = last is not None and change.high - last.low <= _EVENT * max(
            abs(last.low), abs(change.high)
        )
        if last is not None and near and last.after == change.before != last.before:
            joined[-1] = Change(last.low, change.high, last.before, change.after)
        else:
            joined.append(change)
    return tuple(joined)


def _bisected(
    type_of: Callable[[float], str], left: tuple[float, str], right: tuple[float, str]
) -> list[Change]:
    """Return the change next to the left value, and what may still come to the right of it."""
    (low, before), (high, after) = left, right
    while low < (middle := 0.5 * (low + high)) < high:
        kind = type_of(middle)
        if kind == before:
            low = middle
        else:
            high, after = middle, kind
    change = Change(low, high, before, after)
    if after == right[1]:
        return [change]
    return [change, *_bisected(type_of, (high, after), right)]
