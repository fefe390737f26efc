"""Events of a motion in words.

``12`` is an impact of bodies 1 and 2, ``9-10`` one of bodies of which a number has several digits;
``1>`` and ``1<`` are crossings of a junction to the right and left, ``1|`` is an impact on a wall.
"""

from __future__ import annotations

from collections.abc import Sequence


def impact_word(one: int, other: int) -> str:
    """Return the word of an impact of two bodies, counted from 1."""
    return f"{one}{other}" if max(one, other) < 10 else f"{one}-{other}"


def is_impact(word: str) -> bool:
    """Return whether a word is that of an impact of two bodies."""
    return word[-1].isdigit()


def by_body(word: Sequence[str], bodies: int) -> tuple[tuple[str, ...], ...]:
    """Return the sequence of events of each body."""
    involved = [_bodies_of(one) for one in word]
    numbers = map(str, range(1, bodies + 1))
    return tuple(
        tuple(one for one, named in zip(word, involved, strict=True) if number in named)
        for number in numbers
    )


def _bodies_of(word: str) -> list[str]:
    """Return the numbers of the bodies of an event."""
    if not is_impact(word):
        return [word[:-1]]
    return word.split("-") if "-" in word else list(word)
