"""Scenarios in JSON: strict about keys given twice, with the places of keys and values."""

from __future__ import annotations

import json
import re
from typing import Any

from vibro_cli.scenario.problems import KeyPath, shown
from vibro_cli.scenario.source import FormError, Node, check_json

_SPACE = re.compile(r"[ \t\r\n]*")
_STRINGS = json.JSONDecoder()
_BARE = re.compile(r"[^\s,:\[\]{}\"]+")


class _GivenTwice(Exception):
    """A key was given twice; the tree of places tells which."""


def read(text: str) -> Any:
    """Return the data of a JSON text; NaN and infinities are left to the fields to refuse.

    Raises
    ------
    FormError
        If the text is not JSON, gives a key twice, or is beyond the limits.
    """
    check_json(text)
    try:
        return json.loads(text, object_pairs_hook=_unique)
    except json.JSONDecodeError as error:
        reason = error.msg[:1].lower() + error.msg[1:]
        raise FormError(error.pos, f"broken JSON ({reason})", "valid JSON") from None
    except _GivenTwice:
        places(text)
        raise


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    table = dict(pairs)
    if len(table) < len(pairs):
        raise _GivenTwice
    return table


def places(text: str) -> Node:
    """Return the tree of places of a JSON text; a key given twice is a `FormError`."""
    node, _ = _value(text, _after_space(text, 0), ())
    return node


def _after_space(text: str, at: int) -> int:
    match = _SPACE.match(text, at)
    return at if match is None else match.end()


def _value(text: str, at: int, path: KeyPath) -> tuple[Node, int]:
    node = Node(at)
    first = text[at : at + 1]
    if first == "{":
        return node, _table(text, at, node, path)
    if first == "[":
        return node, _list(text, at, node, path)
    if first == '"':
        return node, _STRINGS.raw_decode(text, at)[1]
    match = _BARE.match(text, at)
    return node, at + 1 if match is None else match.end()


def _table(text: str, at: int, node: Node, path: KeyPath) -> int:
    at = _after_space(text, at + 1)
    while text[at] != "}":
        start = at
        key, at = _STRINGS.raw_decode(text, at)
        if key in node.children:
            raise FormError(start, f"the key {shown(key)} twice", "each key once", (*path, key))
        at = _after_space(text, _after_space(text, at) + 1)  # over the colon
        child, at = _value(text, at, (*path, key))
        child.key_offset = start
        node.children[key] = child
        at = _after_comma(text, at)
    return at + 1


def _list(text: str, at: int, node: Node, path: KeyPath) -> int:
    at = _after_space(text, at + 1)
    while text[at] != "]":
        index = len(node.children)
        node.children[index], at = _value(text, at, (*path, index))
        at = _after_comma(text, at)
    return at + 1


def _after_comma(text: str, at: int) -> int:
    at = _after_space(text, at)
    return _after_space(text, at + 1) if text[at] == "," else at
