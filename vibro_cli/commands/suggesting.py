"""A suggestion for a mistyped word."""

import difflib
from collections.abc import Iterable


def closest(word: str, known: Iterable[str]) -> str | None:
    """The known word that is most like a mistyped one, None without one that is."""
    return next(iter(difflib.get_close_matches(word[:100], list(known), n=1)), None)


def suggestion(word: str, known: Iterable[str]) -> str:
    """` (did you mean 'x'?)` for the known word that is most like it, or an empty text."""
    close = closest(word, known)
    return "" if close is None else f" (did you mean {close!r}?)"
