"""Where the parts of a text are: a tree of offsets beside the data, and the error of a reader."""

from __future__ import annotations

from dataclasses import dataclass, field

from vibro_cli.scenario.problems import KeyPath


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
