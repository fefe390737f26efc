"""Base classes of the package's errors, and helpers for their messages."""

import errno
import os
from collections.abc import Iterable
from shlex import quote


class VibroError(Exception):
    """Base class of all errors about a scenario, a run, a grid or a folder.

    Its subclasses can be imported from ``vibro_cli``. A wrong argument of a function raises
    ``ValueError`` or ``TypeError`` instead, a file that cannot be read or written ``OSError``.

    The request is wrong and the user can correct it: a command ends with exit code 2. The arguments
    of an error are the lines of its message.
    """

    def __str__(self) -> str:
        return "\n".join(self.lines)

    @property
    def lines(self) -> list[str]:
        """Lines of the message; a line break within one belongs to a name."""
        return [str(line) for line in self.args]


class Failure(VibroError, RuntimeError):
    """A valid request failed: a command ends with exit code 1."""


class NoPortrait(VibroError, ValueError):
    """The system has no portrait; the message says what was found and what was expected."""


class NothingToShow(VibroError, ValueError):
    """A figure would be empty; the message says why."""


class NoTable(KeyError, AttributeError):
    """A run or grid has no such table; for `hasattr` and lists of attributes it is not there."""


class NoLibrary(Failure):
    """No library of kernels is available for this machine; the message says what to do."""


def exhausted(fault: Exception) -> str:
    """Name the exhausted resource (memory or threads), or "" for other faults."""
    ends = ("failed to map segment from shared object", os.strerror(errno.ENOMEM))
    if isinstance(fault, MemoryError) or (
        isinstance(fault, (ImportError, OSError)) and str(fault).rstrip(") \n").endswith(ends)
    ):
        return "out of memory"
    threads = ("can't start new thread", "Failed to launch worker thread")
    if any(words in str(fault) for words in threads):
        return (
            "no thread can be started: the limit of processes (ulimit -u) or memory (ulimit -v) is "
            "reached"
        )
    return ""


def printable(text: str) -> str:
    """Return a text with unprintable characters (line breaks, terminal escapes) replaced."""
    if text.isprintable():  # as nearly all are, a million words of a table among them
        return text
    return "".join(char if char.isprintable() else "�" for char in text)


def in_command(path: str | os.PathLike[str]) -> str:
    """Return a path as a shell command has it, quoted, and never taken for an option."""
    text = printable(os.fspath(path))
    return quote(f"./{text}" if text.startswith("-") else text)


def counted(number: int, one: str, several: str = "") -> str:
    """Return a count with its noun: `1 impact`, `3 impacts`, `24,000 impacts`.

    The default of `several` adds an s to `one`.
    """
    return f"{number:,} {one if number == 1 else several or one + 's'}"


def listing(words: Iterable[str], last: str = "or") -> str:
    """Return words as a list in a sentence: `a, b or c`."""
    items = list(words)
    if len(items) < 2:
        return "".join(items)
    return f"{', '.join(items[:-1])} {last} {items[-1]}"


def similar(word: str, known: Iterable[str]) -> str | None:
    """Return the known word that is most similar to a mistyped one, or None."""
    from difflib import get_close_matches

    return next(iter(get_close_matches(word[:100], list(known), n=1)), None)
