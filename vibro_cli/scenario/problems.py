"""Faults of scenarios and their places in the text, and the exception that reports them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from vibro_cli.errors import VibroError, printable, similar

KeyPath = tuple[str | int, ...]
"""A path into a scenario; lists are counted from 0 here, and from 1 in all texts."""

_LONGEST_SHOWN = 60


@dataclass(frozen=True)
class Place:
    """A place in a file: its name, and line and column from 1 if known."""

    file: str
    line: int | None = None
    column: int | None = None

    def __str__(self) -> str:
        numbers = [str(n) for n in (self.line, self.column) if n is not None]
        return ":".join([printable(self.file), *numbers])


@dataclass(frozen=True)
class Problem:
    """A fault with its place: the key path, what was found and what was expected."""

    path: str
    message: str
    found: str
    expected: str
    file: str
    line: int | None = None
    column: int | None = None

    @staticmethod
    def at(place: Place, path: str, found: str, expected: str) -> Problem:
        """Return the problem at a place."""
        return Problem(path, "", found, expected, place.file, place.line, place.column)

    def __str__(self) -> str:
        place = str(Place(self.file, self.line, self.column))
        pair = f"found {self.found}, expected {self.expected}"
        return ": ".join(part for part in (place, self.path, pair) if part)


def in_order(problems: Iterable[Problem]) -> list[Problem]:
    """Return problems in the order of the file."""
    return sorted(problems, key=lambda one: (one.line or 0, one.column or 0))


class ScenarioError(VibroError):
    """An invalid scenario; `problems` lists all its faults."""

    problems: tuple[Problem, ...]

    def __init__(self, problems: Iterable[Problem]) -> None:
        self.problems = tuple(problems)
        super().__init__(self.problems)

    @property
    def lines(self) -> list[str]:
        """One line per problem."""
        return [str(problem) for problem in self.problems]


@dataclass(unsafe_hash=True)
class Fault(Exception):
    """A problem whose place in the text is not known yet, only its path; returned or raised."""

    loc: KeyPath
    found: str
    expected: str
    on_key: bool = False
    """Whether the fault is in the key (an unknown one), not in its value."""

    def __str__(self) -> str:
        return f"found {self.found}, expected {self.expected}"


def path_text(loc: KeyPath) -> str:
    """Return a path as it is written in errors and overrides: `balls[2].radius`."""
    text = ""
    for part in loc:
        if isinstance(part, int):
            text += f"[{part + 1}]"
        else:
            text += f".{part}" if text else part
    return text


def shown(value: object) -> str:
    """Return a value of a file for an error message, shortened to one line."""
    if value is None:
        return "null"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return '"' + shortened(value) + '"'
    if isinstance(value, (list, tuple)):
        return "an empty list" if not value else f"a list of {len(value)}"
    if isinstance(value, Mapping):
        return "a table"
    if isinstance(value, (int, float)):
        return shortened(_number_text(value))
    return f"{type(value).__name__} {shortened(str(value))}"


def _number_text(value: int | float) -> str:
    try:
        return repr(value)
    except ValueError:  # Python refuses to print integers of more than 4300 digits
        return "a whole number of more than 4300 digits"


def shortened(text: str) -> str:
    """Return a text on one line, without control characters, at most 60 characters long."""
    line = printable(text[: _LONGEST_SHOWN + 1])
    return line if len(line) <= _LONGEST_SHOWN else line[: _LONGEST_SHOWN - 3] + "..."


def suggestion(word: str, known: Iterable[str]) -> str:
    """Return ` (did you mean "x"?)` for a mistyped word, or an empty string."""
    close = similar(word, known)
    return "" if close is None else f' (did you mean "{close}"?)'


@dataclass
class Node:
    """A value in a text: its offset, the offset of its key, and its child values."""

    offset: int
    key_offset: int | None = None
    children: dict[str | int, Node] = field(default_factory=dict)

    def offset_of(self, path: KeyPath, on_key: bool = False) -> int:
        """Return the offset of the value (or its key) at a path, or of the nearest table above."""
        node = self
        for part in path:
            child = node.children.get(part)
            if child is None:
                return node.offset
            node = child
        return node.key_offset if on_key and node.key_offset is not None else node.offset


class FormError(Exception):
    """A text with broken syntax or beyond the limits; `offset` is the position of the fault."""

    def __init__(self, offset: int, found: str, expected: str, loc: KeyPath = ()) -> None:
        super().__init__(found)
        self.offset = offset
        self.found = found
        self.expected = expected
        self.loc = loc


A_PATH = "a path such as collision.k or balls[1].angle, counted from 1"
"""What messages expect if a text is not a path."""


def parsed_path(text: str) -> KeyPath:
    """Return the parts of a path such as `balls[2].radius`, counted from 0.

    Raises `ValueError` for anything else.
    """
    path: list[str | int] = []
    for part in text.split(".") if isinstance(text, str) else [""]:
        match = re.fullmatch(r"\s*([A-Za-z_][\w-]*)((?:\[[0-9]{1,9}\])*)\s*", part, re.ASCII)
        if match is None:
            raise ValueError(f"found {shown(text)}, expected {A_PATH}")
        path.append(match[1])
        for number in re.findall(r"[0-9]+", match[2]):
            if int(number) < 1:
                raise ValueError(f"found {shown(text)}, expected {A_PATH}")
            path.append(int(number) - 1)
    return tuple(path)
