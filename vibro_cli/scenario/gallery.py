"""The gallery: commented scenarios that are distributed with the program."""

from __future__ import annotations

import re
import tomllib
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path

from vibro_cli.errors import listing
from vibro_cli.scenario.base import system_of as system_of_data
from vibro_cli.scenario.problems import Place, Problem, ScenarioError, shown, suggestion
from vibro_cli.systems import NAMES

_GRIDS = "grids"
_BASE = re.compile(r'^base = "(?:[^"]*/)?([^"/]+)\.toml"', re.MULTILINE)


def _folder() -> Traversable:
    """Return the folder of the scenarios: in the installed package, or beside it in a checkout."""
    installed = files("vibro_cli") / "gallery"
    return installed if installed.is_dir() else Path(__file__).parents[2] / "scenarios"


def names() -> list[str]:
    """Return the names of the scenarios, sorted."""
    return sorted(_entries("", *NAMES))


def grid_names() -> list[str]:
    """Return the names of the grids over scenarios of the gallery, sorted."""
    return sorted(_entries(_GRIDS))


def _entries(*parts: str) -> dict[str, Traversable]:
    """Return the files of subfolders by name; traces are in the folder itself, the part ""."""
    folders = [_folder() / part if part else _folder() for part in parts]
    entries = [entry for folder in folders if folder.is_dir() for entry in folder.iterdir()]
    return {e.name.removesuffix(".toml"): e for e in entries if e.name.endswith(".toml")}


def text(name: str) -> str:
    """Return the text (TOML, with comments) of a scenario or grid of the gallery.

    In the text of a grid the path of its scenario, `base_of`, is that of a file beside the grid.
    Raises `ScenarioError` for an unknown name.
    """
    entries = _entries("", *NAMES, _GRIDS)
    known = sorted(entries)
    if name not in known:
        expected = listing(known) + suggestion(name, known)
        raise ScenarioError([Problem.at(Place("gallery"), "", shown(name), expected)])
    found = entries[name].read_text(encoding="utf-8")
    return _BASE.sub(r'base = "\1.toml"', found) if name in grid_names() else found


def whole() -> dict[str, str]:
    """Return all texts of the gallery by path in its folder, such as ``grids/….toml``."""
    return {
        f"{part}/{entry.name}" if part else entry.name: entry.read_text(encoding="utf-8")
        for part in ("", *NAMES, _GRIDS)
        for entry in _entries(part).values()
    }


def title(name: str) -> str:
    """Return the title of a scenario or grid of the gallery, its first comment."""
    return text(name).partition("\n")[0].lstrip("# ")


def system_of(name: str) -> str:
    """Return the system of a scenario of the gallery."""
    return system_of_data(tomllib.loads(text(name)))


def base_of(name: str) -> str:
    """Return the name of the scenario on which a grid of the gallery is based."""
    found = _BASE.search(text(name))
    assert found is not None
    return found[1]
