"""A scenario's text: its limits, where its parts are, and finding places after an error.

Limits are checked before a parser sees the text. Parsers have inputs they cannot bear: `tomllib`
needs seconds and gigabytes for one dotted key of 40 kB, 100,000 opening brackets end in a
RecursionError (or the interpreter's end), a few hundred bytes of YAML aliases stand for megabytes.
A scenario comes nowhere near these limits.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import Any

from vibro_cli.scenario.problems import KeyPath, Place


@dataclass
class Node:
    """A value in a text: its offset, that of its key, and the values in it."""

    offset: int
    key_offset: int | None = None
    children: dict[str | int, Node] = field(default_factory=dict)

    def offset_of(self, path: KeyPath, on_key: bool = False) -> int:
        """Return where the value (or its key) at a path is, or the nearest table above it."""
        node = self
        for part in path:
            child = node.children.get(part)
            if child is None:
                return node.offset
            node = child
        return node.key_offset if on_key and node.key_offset is not None else node.offset


class FormError(Exception):
    """A text that is not of its form, or beyond the limits; `offset` is where."""

    def __init__(self, offset: int, found: str, expected: str, loc: KeyPath = ()) -> None:
        super().__init__(found)
        self.offset = offset
        self.found = found
        self.expected = expected
        self.loc = loc


def line_and_column(text: str, offset: int) -> tuple[int, int]:
    """Return line and column, counted from 1, of an offset into a text."""
    offset = min(max(offset, 0), len(text))
    return text.count("\n", 0, offset) + 1, offset - (text.rfind("\n", 0, offset) + 1) + 1


def offset_at(text: str, line: int, column: int) -> int:
    """Return the offset of a line and column counted from 1."""
    start = 0
    for _ in range(line - 1):
        start = text.find("\n", start) + 1
    return min(start + column - 1, len(text))


@dataclass(eq=False)
class Source:
    """The text a scenario was read from.

    Any two are equal, so that scenarios are equal when their values are, wherever they came from.
    """

    file: str = "<scenario>"
    form: str = ""
    text: str = field(default="", repr=False)
    overrides: tuple[tuple[KeyPath, str], ...] = ()
    """Paths that were overridden, and what errors call the override."""
    data: dict[str, Any] | None = field(default=None, repr=False)
    """The data as it was given, after overrides: what further changes start from."""
    _tree: Node | None = field(default=None, repr=False)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Source)

    def __hash__(self) -> int:
        return hash(Source)

    def place(self, key_path: str | KeyPath, on_key: bool = False) -> Place:
        """Return where a key was given, or the nearest table to it.

        Parameters
        ----------
        key_path : str or KeyPath
            `balls[2].radius` counted from 1, or its parts counted from 0.
        on_key : bool
            Whether the place of the key is wanted, rather than that of its value.
        """
        loc = parsed_path(key_path) if isinstance(key_path, str) else key_path
        for path, override in reversed(self.overrides):
            if loc[: len(path)] == path:
                return Place(override)
        if not self.text:
            return Place(self.file)
        offset = self.tree().offset_of(loc, on_key)
        return Place(self.file, *line_and_column(self.text, offset))

    def tree(self) -> Node:
        """Return the tree of places, made when it is first needed."""
        if self._tree is None:
            self._tree = _tree(self.form, self.text)
        return self._tree


def _tree(form: str, text: str) -> Node:
    if form == "toml":
        from vibro_cli.scenario import toml_form

        return toml_form.places(text)
    if form == "json":
        from vibro_cli.scenario import json_form

        return json_form.places(text)
    from vibro_cli.scenario import yaml_form

    return yaml_form.read(text)[1]


def parsed_path(text: str) -> KeyPath:
    """Return the parts of a path such as `balls[2].radius`, counted from 0.

    Raises
    ------
    ValueError
        If the text is no path.
    """
    import re

    path: list[str | int] = []
    for part in text.split("."):
        match = re.fullmatch(r"\s*([A-Za-z_][\w-]*)((?:\[[0-9]{1,9}\])*)\s*", part, re.ASCII)
        if match is None:
            raise ValueError(f"no path: {text}")
        path.append(match[1])
        for number in re.findall(r"[0-9]+", match[2]):
            if int(number) < 1:
                raise ValueError("counted from 1")
            path.append(int(number) - 1)
    return tuple(path)


MOST_BYTES = 1_000_000
MOST_DEPTH = 16
MOST_KEYS = 10_000
LONGEST_KEY = 256
LONGEST_BARE = 400
"""Characters of a number or another value without quotes."""
MOST_ALIASES = 100
MOST_VALUES = 200_000
"""Values of a YAML text with its aliases written out."""

_TOML_TOKEN = re.compile(
    r"""(?P<comment>\#[^\n]*)
    |(?P<string>\"{3}(?:\\[\s\S]|[^\\])*?\"{3,5}|'{3}[\s\S]*?'{3,5}
                |"(?:\\.|[^"\\\n])*"|'[^'\n]*')
    |(?P<open>[\[{])|(?P<close>[\]}])|(?P<key>=)|(?P<end>[,\n])|(?P<dot>\.)
    |(?P<bare>[^\s=,\[\]{}\#"'.]+)""",
    re.VERBOSE,
)
_JSON_TOKEN = re.compile(
    r"""(?P<key>"(?:\\.|[^"\\])*"\s*:)|(?P<string>"(?:\\.|[^"\\])*")
    |(?P<open>[\[{])|(?P<close>[\]}])|(?P<bare>[^\s,:\[\]{}"]+)""",
    re.VERBOSE,
)


def check_toml(text: str) -> None:
    """Raise a `FormError` if a TOML text is nested too deeply or has too long or too many keys."""
    depth = parts = keys = 0
    start: int | None = None  # of the dotted key that is being read
    for token in _TOML_TOKEN.finditer(text):
        kind, at = token.lastgroup, token.start()
        if kind == "bare" or kind == "string" or kind == "dot":
            start = at if start is None else start
            if kind == "bare":
                _check_bare(token)
            if kind == "dot":
                parts += 1
                _check_depth(parts, at)
        elif kind == "key":
            keys += 1
            _check_key(keys, at, at - (at if start is None else start))
        elif kind == "open":
            depth += 1
            _check_depth(depth, at)
        elif kind == "close":
            depth -= 1
        if kind in ("key", "open", "close", "end"):
            start, parts = None, 0


def check_json(text: str) -> None:
    """Raise a `FormError` if a JSON text is nested too deeply or has too long or too many keys."""
    depth = keys = 0
    for token in _JSON_TOKEN.finditer(text):
        kind = token.lastgroup
        if kind == "open":
            depth += 1
            _check_depth(depth, token.start())
        elif kind == "close":
            depth -= 1
        elif kind == "key":
            keys += 1
            _check_key(keys, token.end(), token.end() - token.start())
        elif kind == "bare":
            _check_bare(token)


def _check_depth(depth: int, offset: int) -> None:
    if depth > MOST_DEPTH:
        raise too_deep(offset)


def _check_bare(token: re.Match[str]) -> None:
    length = token.end() - token.start()
    if length > LONGEST_BARE:
        raise too_long(token.start(), length)


def _check_key(count: int, offset: int, length: int) -> None:
    if length > LONGEST_KEY:
        expected = f"keys of at most {LONGEST_KEY} characters"
        raise FormError(offset - length, f"a key of {length} characters", expected)
    if count > MOST_KEYS:
        raise too_many("keys", MOST_KEYS, offset)


def too_deep(offset: int) -> FormError:
    """Return the error of a text nested too deeply."""
    found = f"more than {MOST_DEPTH} levels"
    return FormError(offset, found, f"at most {MOST_DEPTH} levels of nesting")


def too_long(offset: int, length: int) -> FormError:
    """Return the error of a number or bare word that is too long."""
    expected = f"at most {LONGEST_BARE} characters without quotes"
    return FormError(offset, f"a value of {length} characters", expected)


def too_many(what: str, most: int, offset: int) -> FormError:
    """Return the error of a text with too many keys, aliases or values."""
    return FormError(offset, f"more than {most} {what}", f"at most {most} {what}")
