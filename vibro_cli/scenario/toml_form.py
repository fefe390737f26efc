"""Scenarios in TOML: reading with `tomllib`, and the places of keys and values after an error."""

from __future__ import annotations

import re
import tomllib
from contextlib import suppress
from typing import Any

from vibro_cli.scenario.problems import KeyPath
from vibro_cli.scenario.source import FormError, Node, check_toml, offset_at

_AT = re.compile(r" \(at (?:line (\d+), column (\d+)|end of document)\)$")
_BLANK = re.compile(r"(?:[ \t\r\n]|#[^\n]*)*")
_SPACE = re.compile(r"[ \t]*")
_STRING = re.compile(
    r'"{3}(?:\\[\s\S]|[^\\])*?"{3,5}|' r"'{3}[\s\S]*?'{3,5}|" r'"(?:\\.|[^"\\\n])*"|' r"'[^'\n]*'"
)
_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")
_BARE_VALUE = re.compile(r"[^,\]}#\n]+")


def read(text: str) -> dict[str, Any]:
    """Return the data of a TOML text.

    Raises
    ------
    FormError
        If the text is not TOML (a key given twice is not), or beyond the limits.
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
        offset = offset_at(text, int(match[1]), int(match[2]))
    reason = _AT.sub("", message)
    scanner = Scanner(text[:offset])
    with suppress(FormError):
        scanner.scan()
    if reason == "Cannot overwrite a value" or reason.startswith(("Cannot declare", "Cannot mut")):
        where = scanner.last_key_offset
        return FormError(where, "a key given twice", "each key once", scanner.last_key)
    found = f"broken TOML ({reason[:1].lower()}{reason[1:]})"
    return FormError(offset, found, "valid TOML", scanner.last_key)


def places(text: str) -> Node:
    """Return the tree of places of a TOML text that `tomllib` has accepted."""
    scanner = Scanner(text)
    scanner.scan()
    return scanner.root


class Scanner:
    """Walks through valid TOML and notes where each key and value is.

    It understands structure only: which text is a key, a table, a list or a single value. On
    broken text it raises a `FormError`, and `last_key` is the key it got to.
    """

    def __init__(self, text: str) -> None:
        self.text = text
        self.at = 0
        self.root = Node(0)
        self.last_key: KeyPath = ()
        self.last_key_offset = 0

    def scan(self) -> None:
        """Walk through the whole text."""
        table: Node = self.root
        path: KeyPath = ()
        self._skip(_BLANK)
        while self.at < len(self.text):
            if self._peek("["):
                table, path = self._header()
            else:
                self._pair(table, path)
            self._skip(_BLANK)

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
        """Go into a table of the name, into the last one if it is a list of tables."""
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
            self._list(node, path)
        elif self._peek("{"):
            self._inline_table(node, path)
        elif self._peek('"') or self._peek("'"):
            self._skip(_STRING)
        else:
            self._skip(_BARE_VALUE)
        return node

    def _list(self, node: Node, path: KeyPath) -> None:
        self._take("[")
        self._skip(_BLANK)
        while not self._peek("]"):
            index = len(node.children)
            node.children[index] = self._value((*path, index))
            self._skip(_BLANK)
            if not self._peek("]"):
                self._take(",")
                self._skip(_BLANK)
        self._take("]")

    def _inline_table(self, node: Node, path: KeyPath) -> None:
        self._take("{")
        self._skip(_BLANK)
        while not self._peek("}"):
            self._pair(node, path)
            self._skip(_BLANK)
            if not self._peek("}"):
                self._take(",")
                self._skip(_BLANK)
        self._take("}")
