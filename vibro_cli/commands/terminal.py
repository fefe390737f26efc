"""The reference, which is Markdown, as a terminal shows it: tables in columns, lines that fit."""

import re
import shutil
import sys
import textwrap
from collections.abc import Iterator, Sequence
from itertools import groupby

from vibro_cli.commands.words import COLUMNS

_WIDEST = 100
# Of a table the last column is broken into lines, and gets at least this width.
_LEAST_TEXT = 28
_BETWEEN = 2
_CELL = re.compile(r"(?<!\\)\|")


def terminal_width() -> int:
    """The width to write in: that of the terminal, within reason, or the usual one."""
    if not sys.stdout.isatty():
        return COLUMNS
    return min(max(shutil.get_terminal_size().columns, COLUMNS // 2), _WIDEST)


def as_terminal_text(markdown: str, width: int) -> str:
    """Markdown of the kind the reference has, tables, paragraphs, lists and code, as plain text."""
    lines: list[str] = []
    within_code = False
    for kind, group in groupby(markdown.splitlines(), key=_kind):
        block = list(group)
        if kind == "fence":
            within_code = not within_code
        elif within_code or kind == "code":
            lines += block
        elif kind == "table":
            lines += _table([_cells(row) for row in block], width)
        elif kind == "text":
            lines += [line for part in _paragraphs(block) for line in _filled(part, width)]
        else:
            lines += block
    return "\n".join(lines) + "\n"


def _kind(line: str) -> str:
    """What a line belongs to."""
    if line.startswith("```"):
        return "fence"
    if line.startswith("|"):
        return "table"
    if line.startswith("    "):
        return "code"
    return "text" if line.strip() else "empty"


def _paragraphs(block: Sequence[str]) -> Iterator[str]:
    """The paragraphs and entries of lists of some lines."""
    text = ""
    for line in block:
        if line.startswith("- ") and text:
            yield text
            text = ""
        text = f"{text} {line.strip()}".strip()
    yield text


def _filled(text: str, width: int) -> list[str]:
    """A paragraph, or an entry of a list, in lines."""
    return _broken(_plain(text), width, "  " if text.startswith("- ") else "")


def _broken(text: str, width: int, others: str = "") -> list[str]:
    return textwrap.wrap(
        text, width, subsequent_indent=others, break_long_words=False, break_on_hyphens=False
    )


def _plain(text: str) -> str:
    """A text without the marks of Markdown."""
    return re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", text).replace("`", "").replace("\\|", "|")


def _cells(row: str) -> list[str]:
    return [_plain(cell.strip()) for cell in _CELL.split(row)[1:-1]]


def _table(rows: Sequence[Sequence[str]], width: int) -> Iterator[str]:
    """A table, head first, then the line below it: in columns where there is room for them."""
    head, body = rows[0], rows[2:]
    used = [n for n, name in enumerate(head) if any(row[n] for row in body)]
    *short, last = used
    widths = [max(len(row[n]) for row in [head, *body]) for n in short]
    # A few long cells of the first column stand on a line of their own.
    widths[0] = min(widths[0], width // 3)
    offset = sum(widths) + _BETWEEN * len(widths)
    if width - offset < _LEAST_TEXT:
        yield from _entries(body, short, last, width)
        return
    for row in [head, *body]:
        cells = [row[n] for n in short]
        start = "".join(c.ljust(w + _BETWEEN) for c, w in zip(cells, widths, strict=True))
        text = _broken(row[last], width - offset) or [""]
        if len(cells[0]) > widths[0]:
            yield cells[0]
            start = " " * (widths[0] + _BETWEEN) + "".join(
                c.ljust(w + _BETWEEN) for c, w in zip(cells[1:], widths[1:], strict=True)
            )
        yield (start + text[0]).rstrip()
        yield from (" " * offset + line for line in text[1:])


def _entries(
    body: Sequence[Sequence[str]], short: Sequence[int], last: int, width: int
) -> Iterator[str]:
    """A table without room for its columns: each row a line, and its text below that.

    A command stands on a line of its own, whole, so that it can be copied.
    """
    for row in body:
        cells = [row[n] for n in short if row[n]]
        commands = [cell for cell in cells if cell.startswith("vibro ")]
        words = "  ".join(cell for cell in cells if cell not in commands)
        yield from _broken(words, width, "    ")
        yield from (f"    {command}" for command in commands)
        yield from (f"    {line}" for line in _broken(row[last], width - 4))
