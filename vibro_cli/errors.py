"""What every error of the package that a caller may meet has in common, and what it may suggest."""

from collections.abc import Iterable


class VibroError(Exception):
    """The base of all errors that say something about a scenario, a run, a grid or a folder.

    Those there are can be imported from ``vibro_cli``; a wrong argument of a function is a
    ``ValueError`` or ``TypeError``, a file that cannot be read or written an ``OSError``.

    What was asked for is wrong, and whoever asked can mend it: a command ends with exit code 2.
    The arguments of an error are the lines of its message.
    """

    def __str__(self) -> str:
        return "\n".join(self.lines)

    @property
    def lines(self) -> list[str]:
        """The lines of the message; a line break within one is of a name."""
        return [str(line) for line in self.args]


class Failure(VibroError, RuntimeError):
    """What was asked for may be right, and yet it failed: a command ends with exit code 1."""


class NoLibrary(Failure):
    """There is no library of kernels for this machine; the message says what to do."""


def printable(text: str) -> str:
    """Return a text on one line that no terminal takes for a command, whatever a file is called."""
    return "".join(char if char.isprintable() else "�" for char in text)


def similar(word: str, known: Iterable[str]) -> str | None:
    """Return the known word that a mistyped one is most like, or None."""
    from difflib import get_close_matches

    return next(iter(get_close_matches(word[:100], list(known), n=1)), None)
