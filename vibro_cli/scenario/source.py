"""Where a scenario came from: the text and its overrides, to find places after an error."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from vibro_cli.scenario.nodes import Node, line_and_column
from vibro_cli.scenario.problems import KeyPath, Place


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
