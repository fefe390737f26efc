"""Limits on a scenario's text, checked before a parser sees it.

Parsers have inputs they cannot bear: `tomllib` needs seconds and gigabytes for one dotted key of
40 kB, 100,000 opening brackets end in a RecursionError (or the interpreter's end), a few hundred
bytes of YAML aliases stand for megabytes. A scenario comes nowhere near these limits.
"""

from __future__ import annotations

import re

from vibro_cli.scenario.nodes import FormError

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
