"""Scenarios in YAML 1.2: values by the core schema, no tags, few aliases, each key once.

Only the scanner and parser of ruamel.yaml are used. They give a stream of events with places, from
which data and tree are built here; nothing constructs objects, so a tag cannot run anything, and
the limits are checked while the text is read.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from vibro_cli.scenario.problems import KeyPath, shown
from vibro_cli.scenario.source import (
    LONGEST_BARE,
    LONGEST_KEY,
    MOST_ALIASES,
    MOST_DEPTH,
    MOST_KEYS,
    MOST_VALUES,
    FormError,
    Node,
    too_deep,
    too_long,
    too_many,
)

_INTEGER = re.compile(r"[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+", re.ASCII)
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?", re.ASCII)
_INFINITE = re.compile(r"[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)")
_WORDS: dict[str, Any] = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL")),
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
}


def plain_scalar(text: str) -> Any:
    """Return the value of a scalar without quotes by the core schema of YAML 1.2."""
    if text in _WORDS:
        return _WORDS[text]
    if _INTEGER.fullmatch(text):
        return int(text, 0) if text[:2] in ("0o", "0x") else int(text)
    if _FLOAT.fullmatch(text):
        return float(text)
    return float(text.replace(".", "", 1)) if _INFINITE.fullmatch(text) else text


def read(text: str) -> tuple[Any, Node]:
    """Return the data of a YAML text and the tree of its places.

    Raises
    ------
    FormError
        If the text is not YAML, gives a key twice, has a tag, or is beyond the limits.
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
    """Values in it with aliases written out; 0 while it is still being read."""


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
            value = self._scalar(event, path)
        elif depth >= MOST_DEPTH:
            raise too_deep(at)
        elif kind == "MappingStartEvent":
            value = self._mapping(node, path, depth)
        else:
            value = self._sequence(node, path, depth)
        if anchor is not None:
            anchor.value, anchor.node, anchor.size = value, node, self.size - before + 1
        return value, node

    def _check(self, event: Any, path: KeyPath) -> None:
        at = event.start_mark.index
        if self.size > MOST_VALUES:
            raise too_many("values", MOST_VALUES, at)
        tag = getattr(event, "tag", None)
        if tag is not None:
            raise FormError(at, f"the tag {shown(str(tag))}", "a value without a tag", path)

    def _scalar(self, event: Any, path: KeyPath) -> Any:
        if not event.implicit[0]:  # quoted
            return event.value
        if len(event.value) > LONGEST_BARE:
            raise too_long(event.start_mark.index, len(event.value))
        return plain_scalar(event.value)

    def _alias(self, event: Any, path: KeyPath) -> tuple[Any, Node]:
        at, name = event.start_mark.index, event.anchor
        self.aliases += 1
        if self.aliases > MOST_ALIASES:
            raise too_many("aliases", MOST_ALIASES, at)
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
                raise FormError(at, "a key that is no word", "a word as key", path)
            key = str(event.value)
            self.keys += 1
            self._check(event, path)
            self._check_key(key, at)
            if key in table:
                found = f"the key {shown(key)} twice"
                raise FormError(at, found, "each key once", (*path, key))
            table[key], child = self._value(next(self.events), (*path, key), depth + 1)
            child.key_offset = at
            node.children[key] = child
        return table

    def _check_key(self, key: str, at: int) -> None:
        if len(key) > LONGEST_KEY:
            expected = f"keys of at most {LONGEST_KEY} characters"
            raise FormError(at, f"a key of {len(key)} characters", expected)
        if self.keys > MOST_KEYS:
            raise too_many("keys", MOST_KEYS, at)

    def _sequence(self, node: Node, path: KeyPath, depth: int) -> list[Any]:
        values: list[Any] = []
        while type(event := next(self.events)).__name__ != "SequenceEndEvent":
            value, child = self._value(event, (*path, len(values)), depth + 1)
            node.children[len(values)] = child
            values.append(value)
        return values
