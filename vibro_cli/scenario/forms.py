"""Parsing of scenarios: their data, the places of keys and values in the text, and limits.

Limits are checked before parsing, since some inputs overwhelm a parser: `tomllib` needs seconds and
gigabytes for a dotted key of 40 kB, 100,000 opening brackets raise a RecursionError (or crash the
interpreter), and a few hundred bytes of YAML aliases stand for megabytes. Real scenarios are far
below these limits.

TOML is read with `tomllib`, JSON with `json`; places in the text are determined only after an
error. YAML 1.2 is read by the core schema, without tags, with few aliases and without repeated
keys, using only the scanner and parser of ruamel.yaml. From their stream of events with places the
data and the tree are built here. No objects are constructed, so a tag cannot run code, and limits
are checked while reading.
"""

from __future__ import annotations

import json
import re
import tomllib
from bisect import bisect_right
from collections.abc import Iterator
from contextlib import suppress
from copy import deepcopy
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import count
from typing import Any

from vibro_cli.scenario.problems import FormError, KeyPath, Node, Place, parsed_path, shown

MOST_BYTES = 1_000_000
MOST_DEPTH = 16
MOST_KEYS = 100_000
LONGEST_KEY = 256
LONGEST_BARE = 400
"""Greatest length of a number or another unquoted value, in characters."""
MOST_ALIASES = 100
MOST_VALUES = 200_000
"""Greatest number of values of a YAML text with expanded aliases."""

# An unterminated string is one token, up to where it would have to end: searching for its end again
# from each quote in it would take quadratic time.
_TOML_TOKEN = re.compile(
    r"""(?P<comment>\#[^\n]*)
    |(?P<string>\"{3}(?:\\[\s\S]|[^\\])*?(?:\"{3,5}|\\?\Z)|'{3}[\s\S]*?'{3,5}
                |"(?:\\.|[^"\\\n])*"?|'[^'\n]*')
    |(?P<open>[\[{])|(?P<close>[\]}])|(?P<key>=)|(?P<end>[,\n])|(?P<dot>\.)
    |(?P<bare>[^\s=,\[\]{}\#"'.]+)""",
    re.VERBOSE,
)
_JSON_TOKEN = re.compile(
    r"""(?P<key>"(?:\\.|[^"\\])*"\s*:)|(?P<string>"(?:\\.|[^"\\])*"?)
    |(?P<open>[\[{])|(?P<close>[\]}])|(?P<bare>[^\s,:\[\]{}"]+)""",
    re.VERBOSE,
)


def check_toml(text: str) -> None:
    """Raise a `FormError` if a TOML text is nested too deeply or has too long or too many keys."""
    depth = parts = keys = 0
    start: int | None = None  # offset of the present dotted key
    for token in _TOML_TOKEN.finditer(text):
        kind, at = token.lastgroup, token.start()
        if kind in ("bare", "string", "dot"):
            start = at if start is None else start
            if kind == "bare":
                _check_bare(at, len(token[0]))
            if kind == "dot":
                parts += 1
                _check_depth(parts, at)
        elif kind == "key":
            keys += 1
            start = at if start is None else start
            _check_key(start, at - start)
            _check_count("keys", keys, MOST_KEYS, at)
        elif kind == "open":
            depth += 1
            _check_depth(depth, at)
        elif kind == "close":
            depth -= 1
        if kind in ("key", "open", "close", "end"):
            start, parts = None, 0


def check_json(text: str) -> None:
    """Raise a `FormError` if a JSON text is nested too deeply or has too long keys."""
    depth = 0
    for token in _JSON_TOKEN.finditer(text):
        kind = token.lastgroup
        if kind == "open":
            depth += 1
            _check_depth(depth, token.start())
        elif kind == "close":
            depth -= 1
        elif kind == "key":
            _check_key(token.start(), len(token[0]))
        elif kind == "bare":
            _check_bare(token.start(), len(token[0]))


def _check_depth(depth: int, offset: int) -> None:
    if depth > MOST_DEPTH:
        found = f"more than {MOST_DEPTH} levels"
        raise FormError(offset, found, f"at most {MOST_DEPTH} levels of nesting")


def _check_bare(offset: int, length: int) -> None:
    if length > LONGEST_BARE:
        expected = f"at most {LONGEST_BARE} characters without quotes"
        raise FormError(offset, f"a value of {length} characters", expected)


def _check_key(start: int, length: int) -> None:
    if length > LONGEST_KEY:
        expected = f"keys of at most {LONGEST_KEY} characters"
        raise FormError(start, f"a key of {length} characters", expected)


def _check_count(what: str, count: int, most: int, offset: int) -> None:
    if count > most:
        raise FormError(offset, f"more than {most} {what}", f"at most {most} {what}")


_AT = re.compile(r" \(at (?:line (\d+), column (\d+)|end of document)\)$")
_BLANK = re.compile(r"(?:[ \t\r\n]|#[^\n]*)*")
_SPACE = re.compile(r"[ \t]*")
_STRING = re.compile(
    r'"{3}(?:\\[\s\S]|[^\\])*?"{3,5}|' r"'{3}[\s\S]*?'{3,5}|" r'"(?:\\.|[^"\\\n])*"|' r"'[^'\n]*'"
)
_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")
_BARE_VALUE = re.compile(r"[^,\]}#\n]+")


def read_toml(text: str) -> dict[str, Any]:
    """Return the data of a TOML text.

    Raises `FormError` if the text is not TOML (which excludes repeated keys) or exceeds the limits.
    """
    check_toml(text)
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise _syntax_error(text, str(error)) from None


def _syntax_error(text: str, message: str) -> FormError:
    match = _AT.search(message)
    offset = len(text)
    if match is not None and match[1] is not None:
        before = text.split("\n", int(match[1]) - 1)[:-1]
        offset = min(sum(map(len, before)) + len(before) + int(match[2]) - 1, len(text))
    reason = _AT.sub("", message)
    scanner = Scanner(text[:offset])
    with suppress(FormError):
        scanner.scan()
    if reason == "Cannot overwrite a value" or reason.startswith(("Cannot declare", "Cannot mut")):
        where = scanner.last_key_offset
        return FormError(where, "a key given twice", "each key once", scanner.last_key)
    found = f"broken TOML ({reason[:1].lower()}{reason[1:]})"
    return FormError(offset, found, "valid TOML", scanner.last_key)


class Scanner:
    """Scans valid TOML and records the places of all keys and values.

    It recognises structure only: keys, tables, lists and single values. On broken text it raises a
    `FormError`, and `last_key` is the last key that it reached.
    """

    def __init__(self, text: str) -> None:
        self.text = text
        self.at = 0
        self.root = Node(0)
        self.last_key: KeyPath = ()
        self.last_key_offset = 0

    def scan(self) -> Node:
        """Scan the whole text; return the tree of places."""
        table: Node = self.root
        path: KeyPath = ()
        self._skip(_BLANK)
        while self.at < len(self.text):
            if self._peek("["):
                table, path = self._header()
            else:
                self._pair(table, path)
            self._skip(_BLANK)
        return self.root

    def _peek(self, chars: str) -> bool:
        return self.text.startswith(chars, self.at)

    def _skip(self, pattern: re.Pattern[str]) -> str:
        match = pattern.match(self.text, self.at)
        if match is None:
            raise FormError(self.at, "an unexpected character", "TOML")
        self.at = match.end()
        return match[0]

    def _take(self, chars: str) -> None:
        if not self._peek(chars):
            raise FormError(self.at, "an unexpected character", chars)
        self.at += len(chars)

    def _key(self) -> list[tuple[str, int]]:
        """Return the parts of a dotted key with their offsets."""
        parts = []
        while True:
            self._skip(_SPACE)
            start = self.at
            quoted = self.text[start : start + 1] in ("'", '"')
            part = self._skip(_STRING if quoted else _BARE_KEY)
            name = str(tomllib.loads(f"value = {part}")["value"]) if quoted else part
            parts.append((name, start))
            self._skip(_SPACE)
            if not self._peek("."):
                return parts
            self.at += 1

    def _step(self, node: Node, part: str, offset: int, path: KeyPath) -> tuple[Node, KeyPath]:
        """Enter the table of this name, or the last one if it is a list of tables."""
        node = node.children.setdefault(part, Node(offset, offset))
        path = (*path, part)
        if node.children and isinstance(last := next(reversed(node.children)), int):
            return node.children[last], (*path, last)
        return node, path

    def _header(self) -> tuple[Node, KeyPath]:
        start, many = self.at, self._peek("[[")
        self.last_key = ()
        self._take("[[" if many else "[")
        *parents, (name, offset) = self._key()
        self._take("]]" if many else "]")
        node: Node = self.root
        path: KeyPath = ()
        for part, at in parents:
            node, path = self._step(node, part, at, path)
        if not many:
            node, path = self._step(node, name, offset, path)
            node.offset = start
        else:
            rows = node.children.setdefault(name, Node(start, offset))
            index = len(rows.children)
            node, path = Node(start, offset), (*path, name, index)
            rows.children[index] = node
        self.last_key, self.last_key_offset = path, offset
        return node, path

    def _pair(self, table: Node, path: KeyPath) -> None:
        *parents, (name, offset) = self._key()
        for part, at in parents:
            table, path = self._step(table, part, at, path)
        path = (*path, name)
        self.last_key, self.last_key_offset = path, offset
        self._take("=")
        self._skip(_SPACE)
        node = self._value(path)
        node.key_offset = offset
        table.children.setdefault(name, node)

    def _value(self, path: KeyPath) -> Node:
        node = Node(self.at)
        if self._peek("["):
            for index in self._entries("[", "]"):
                node.children[index] = self._value((*path, index))
        elif self._peek("{"):
            for _ in self._entries("{", "}"):
                self._pair(node, path)
        elif self._peek('"') or self._peek("'"):
            self._skip(_STRING)
        else:
            self._skip(_BARE_VALUE)
        return node

    def _entries(self, begin: str, end: str) -> Iterator[int]:
        """Yield the index of each entry of a list or inline table, positioned at its beginning."""
        self._take(begin)
        self._skip(_BLANK)
        for index in count():
            if self._peek(end):
                break
            yield index
            self._skip(_BLANK)
            if not self._peek(end):
                self._take(",")
                self._skip(_BLANK)
        self._take(end)


def read_json(text: str) -> Any:
    """Return the data of a JSON text; NaN and infinities are rejected later, by the fields.

    Raises `FormError` if the text is not JSON, repeats a key, or exceeds the limits.
    """
    check_json(text)

    def unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        table = dict(pairs)
        if len(table) < len(pairs):
            _JsonScanner(text).scan()  # raises the error with its place
        return table

    try:
        return json.loads(text, object_pairs_hook=unique)
    except json.JSONDecodeError as error:
        reason = error.msg[:1].lower() + error.msg[1:]
        raise FormError(error.pos, f"broken JSON ({reason})", "valid JSON") from None


class _JsonScanner(Scanner):
    """Scans valid JSON, whose values differ from those of TOML only in the keys of tables.

    A repeated key raises a `FormError`.
    """

    def scan(self) -> Node:
        self._skip(_BLANK)
        return self._value(())

    def _pair(self, table: Node, path: KeyPath) -> None:
        start, key = self.at, str(json.loads(self._skip(_STRING)))
        path = (*path, key)
        if key in table.children:
            raise FormError(start, f"the key {shown(key)} twice", "each key once", path)
        self._skip(_BLANK)
        self._take(":")
        self._skip(_BLANK)
        table.children[key] = self._value(path)
        table.children[key].key_offset = start


_INTEGER = re.compile(r"[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+", re.ASCII)
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?", re.ASCII)
_INFINITE = re.compile(r"[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)")
_WORDS: dict[str, Any] = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL")),
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
}


def plain_scalar(text: str) -> Any:
    """Return the value of an unquoted scalar by the core schema of YAML 1.2."""
    if text in _WORDS:
        return _WORDS[text]
    if _INTEGER.fullmatch(text):
        return int(text, 0) if text[:2] in ("0o", "0x") else int(text)
    if _FLOAT.fullmatch(text):
        return float(text)
    return float(text.replace(".", "", 1)) if _INFINITE.fullmatch(text) else text


@lru_cache(maxsize=1)
def read_yaml(text: str) -> tuple[Any, Node]:
    """Return the data of a YAML text and the tree of its places, cached for its first problems.

    Raises `FormError` if the text is not YAML, repeats a key, has a tag, or exceeds the limits.
    """
    from ruamel.yaml import YAML
    from ruamel.yaml.error import MarkedYAMLError, YAMLError

    try:
        return _Builder(text, YAML(typ="safe", pure=True).parse(text)).document()
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        offset = len(text) if mark is None else mark.index
        reason = str(error.problem or error.context)
        raise FormError(offset, f"broken YAML ({reason})", "valid YAML") from None
    except YAMLError as error:  # a character that YAML does not allow
        offset = getattr(error, "position", 0)
        reason = str(getattr(error, "reason", "unreadable"))
        raise FormError(offset, f"broken YAML ({reason})", "valid YAML") from None


@dataclass
class _Anchor:
    value: Any = None
    node: Node = field(default_factory=lambda: Node(0))
    size: int = 0
    """Number of values in it with expanded aliases; 0 while it is being read."""


class _Builder:
    """Builds data and places from the events of one document."""

    def __init__(self, text: str, events: Iterator[Any]) -> None:
        self.text = text
        self.events = events
        self.anchors: dict[str, _Anchor] = {}
        self.aliases = self.keys = self.size = 0

    def document(self) -> tuple[Any, Node]:
        value, node = None, Node(0)
        documents = 0
        for event in self.events:
            kind = type(event).__name__
            if kind == "DocumentStartEvent":
                documents += 1
                if documents > 1:
                    found = "a second document"
                    raise FormError(event.start_mark.index, found, "one document")
                value, node = self._value(next(self.events), (), 0)
        return value, node

    def _value(self, event: Any, path: KeyPath, depth: int) -> tuple[Any, Node]:
        at = event.start_mark.index
        self.size += 1
        self._check(event, path)
        kind = type(event).__name__
        if kind == "AliasEvent":
            return self._alias(event, path)
        anchor = None
        if event.anchor is not None:
            anchor = self.anchors[event.anchor] = _Anchor()
        before, node = self.size, Node(at)
        if kind == "ScalarEvent":
            value = self._scalar(event)
        else:
            _check_depth(depth + 1, at)
            read = self._mapping if kind == "MappingStartEvent" else self._sequence
            value = read(node, path, depth)
        if anchor is not None:
            anchor.value, anchor.node, anchor.size = value, node, self.size - before + 1
        return value, node

    def _check(self, event: Any, path: KeyPath) -> None:
        at = event.start_mark.index
        _check_count("values", self.size, MOST_VALUES, at)
        tag = getattr(event, "tag", None)
        if tag is not None:
            raise FormError(at, f"the tag {shown(str(tag))}", "a value without a tag", path)

    def _scalar(self, event: Any) -> Any:
        if not event.implicit[0]:  # quoted
            return event.value
        _check_bare(event.start_mark.index, len(event.value))
        return plain_scalar(event.value)

    def _alias(self, event: Any, path: KeyPath) -> tuple[Any, Node]:
        at, name = event.start_mark.index, event.anchor
        self.aliases += 1
        _check_count("aliases", self.aliases, MOST_ALIASES, at)
        anchor = self.anchors.get(name)
        if anchor is None or anchor.size == 0:
            found = f"the alias *{name[:20]}"
            raise FormError(at, found, "an alias of an earlier, finished value", path)
        self.size += anchor.size
        self._check(event, path)
        return anchor.value, Node(at, None, anchor.node.children)

    def _mapping(self, node: Node, path: KeyPath, depth: int) -> dict[str, Any]:
        table: dict[str, Any] = {}
        while type(event := next(self.events)).__name__ != "MappingEndEvent":
            at = event.start_mark.index
            if type(event).__name__ != "ScalarEvent":
                raise FormError(at, "a key that is not a word", "a word as key", path)
            key = str(event.value)
            self.keys += 1
            self._check(event, path)
            _check_key(at, len(key))
            _check_count("keys", self.keys, MOST_KEYS, at)
            if key in table:
                found = f"the key {shown(key)} twice"
                raise FormError(at, found, "each key once", (*path, key))
            table[key], child = self._value(next(self.events), (*path, key), depth + 1)
            child.key_offset = at
            node.children[key] = child
        return table

    def _sequence(self, node: Node, path: KeyPath, depth: int) -> list[Any]:
        values: list[Any] = []
        while type(event := next(self.events)).__name__ != "SequenceEndEvent":
            value, child = self._value(event, (*path, len(values)), depth + 1)
            node.children[len(values)] = child
            values.append(value)
        return values


def read(text: str, form: str) -> Any:
    """Return the data of a text in a format.

    Raises `FormError` if the text has broken syntax, repeats a key, or exceeds the limits.
    """
    if form == "yaml":
        return deepcopy(read_yaml(text)[0])
    return read_toml(text) if form == "toml" else read_json(text)


@lru_cache(maxsize=1)
def places(text: str, form: str) -> Node:
    """Return the tree of places of a text that is valid in a format, cached for its next problems.

    The points of a grid, of which thousands may be invalid, share a text.
    """
    if form == "yaml":
        return read_yaml(text)[1]
    return (Scanner if form == "toml" else _JsonScanner)(text).scan()


def line_and_column(text: str, offset: int) -> tuple[int, int]:
    """Return line and column, from 1, of an offset into a text."""
    offset = min(max(offset, 0), len(text))
    starts = _line_starts(text)
    line = bisect_right(starts, offset)
    return line, offset - starts[line - 1] + 1


@lru_cache(maxsize=1)
def _line_starts(text: str) -> list[int]:
    """Return the offsets of a text's lines, cached for its next problems."""
    return [0, *(match.end() for match in re.finditer("\n", text))]


@dataclass(eq=False)
class Source:
    """The text from which a scenario was read.

    All sources compare equal, so that scenarios are equal if their values are.
    """

    file: str = "<scenario>"
    form: str = ""
    text: str = field(default="", repr=False)
    overrides: tuple[tuple[KeyPath, str], ...] = ()
    """Overridden paths, with the names of the overrides in errors."""
    data: dict[str, Any] | None = field(default=None, repr=False)
    """The data as given, after overrides, to which further changes apply."""
    within: KeyPath = ()
    """Path of the scenario in the text; not empty in a grid file."""

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Source)

    def __hash__(self) -> int:
        return hash(Source)

    def place(self, key_path: str | KeyPath, on_key: bool = False) -> Place:
        """Return the place of a value, or of the nearest table above it.

        `key_path` is text such as `balls[2].radius`, counted from 1, or its parts counted from 0.
        With `on_key` return the place of the key, not of its value.
        """
        loc = parsed_path(key_path) if isinstance(key_path, str) else key_path
        for path, override in reversed(self.overrides):
            if loc[: len(path)] == path:
                return Place(override)
        if not self.text:
            return Place(self.file)
        offset = places(self.text, self.form).offset_of((*self.within, *loc), on_key)
        return Place(self.file, *line_and_column(self.text, offset))
