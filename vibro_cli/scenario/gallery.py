"""The gallery: commented scenarios that come with the program."""

from __future__ import annotations

from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path

from vibro_cli.scenario.problems import Place, Problem, ScenarioError, listing, shown, suggestion


def _folder() -> Traversable:
    """Return where the scenarios are: in the installed package, or beside it in a checkout."""
    installed = files("vibro_cli") / "gallery"
    return installed if installed.is_dir() else Path(__file__).parents[2] / "scenarios"


def names() -> list[str]:
    """Return the names of the scenarios, sorted."""
    entries = [entry.name for entry in _folder().iterdir()]
    return sorted(name.removesuffix(".toml") for name in entries if name.endswith(".toml"))


def text(name: str) -> str:
    """Return the text (TOML, with comments) of a scenario of the gallery.

    Raises
    ------
    ScenarioError
        If there is no scenario of that name.
    """
    known = names()
    if name not in known:
        expected = listing(known) + suggestion(name, known)
        raise ScenarioError([Problem.at(Place("gallery"), "", shown(name), expected)])
    return (_folder() / f"{name}.toml").read_text(encoding="utf-8")
