"""The standard streams, whatever state they are in: closed, full, poor in letters."""

import codecs
import contextlib
import io
import json
import os
import sys
from typing import Any, TextIO

LEVELS = ("detail", "info", "warning", "error")
"""How much words matter: details are said with -v only, errors even with -q."""

_words: dict[str, Any] = {"as_json": False, "least": "info"}


def choose_words(as_json: bool | None = None, least: str | None = None) -> None:
    """Choose how words are said, as text or as JSON lines, and the least level that is said."""
    if as_json is not None:
        _words["as_json"] = as_json
    if least is not None:
        _words["least"] = least


def is_said(level: str, as_text: bool = False) -> bool:
    """Whether words of a level are said, `as_text`: and not as JSON."""
    said = LEVELS.index(level) >= LEVELS.index(_words["least"])
    return said and not (as_text and _words["as_json"])


def say(text: str, level: str = "info", **details: Any) -> None:
    """Print words for a human to standard error; as JSON an object on a line, with the details."""
    if not is_said(level):
        return
    if _words["as_json"]:
        text = json_text({"level": level, "message": text, **details}, sys.stderr)
    try:
        print("\n".join(map(printable, text.split("\n"))), file=sys.stderr, flush=True)
    except OSError:  # closed or full: nobody can be told, and the exit code still says it
        silence(sys.stderr)


def printable(text: str) -> str:
    """A text on one line that no terminal takes for a command, whatever a file is called."""
    return "".join(char if char.isprintable() else "�" for char in text)


def json_text(value: Any, stream: TextIO | None = None, indent: int | None = None) -> str:
    """JSON as a stream (standard output) can take it: with letters as they are only in UTF-8.

    Raises `ValueError` for numbers that are not finite.
    """
    encoding = getattr(stream or sys.stdout, "encoding", None) or "ascii"
    plain = codecs.lookup(encoding).name != "utf-8"
    return json.dumps(value, indent=indent, ensure_ascii=plain, allow_nan=False)


def prepare_streams() -> None:
    """Let no file be opened in the place of a closed stream, and strange letters be printed.

    What is written to a closed standard output fails; a closed standard error takes everything.
    """
    for number, access in enumerate((os.O_RDONLY, os.O_RDONLY, os.O_WRONLY)):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, access)  # takes the lowest free number, which is this one
    if sys.stdout is None:
        sys.stdout = open(1, "w", encoding="utf-8", closefd=False)  # noqa: SIM115 (to the end)
    if sys.stderr is None:
        sys.stderr = open(2, "w", encoding="utf-8", closefd=False)  # noqa: SIM115
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")


def drain_standard_output() -> None:
    """Leave nothing for Python to write, and to complain about, at exit."""
    try:
        sys.stdout.flush()
    except (OSError, ValueError):
        silence(sys.stdout)


def silence(stream: TextIO) -> None:
    """Let nothing more, flushed at exit or not, go to an output that takes nothing."""
    with contextlib.suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)
