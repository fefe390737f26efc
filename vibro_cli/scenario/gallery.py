"""The gallery: commented scenarios that come with the program."""

from __future__ import annotations

from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path

from vibro_cli.scenario.models import SYSTEMS
from vibro_cli.scenario.problems import Place, Problem, ScenarioError, listing, shown, suggestion


def _folder() -> Traversable:
    """Return where the scenarios are: in the installed package, or beside it in a checkout."""
    installed = files("vibro_cli") / "gallery"
    return installed if installed.is_dir() else Path(__file__).parents[2] / "scenarios"


def names() -> list[str]:
    """Return the names of the scenarios, sorted."""
    return sorted(_entries())


def _entries() -> dict[str, Traversable]:
    """Return the scenarios by name: those of a trace, and those of other systems in folders."""
    folders = [_folder(), *(_folder() / system for system in SYSTEMS)]
    entries = [entry for folder in folders if folder.is_dir() for entry in folder.iterdir()]
    return {e.name.removesuffix(".toml"): e for e in entries if e.name.endswith(".toml")}


def text(name: str) -> str:
    """Return the text (TOML, with comments) of a scenario of the gallery.

    Raises
    ------
    ScenarioError
        If there is no scenario of that name.
    """
    entries = _entries()
    known = sorted(entries)
    if name not in known:
        expected = listing(known) + suggestion(name, known)
        raise ScenarioError([Problem.at(Place("gallery"), "", shown(name), expected)])
    return entries[name].read_text(encoding="utf-8")
