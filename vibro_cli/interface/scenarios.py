"""Scenarios as Python reads, checks and draws them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from vibro_cli.assemble import build_any, warnings_of
from vibro_cli.interface import Drawing
from vibro_cli.scenario import gallery
from vibro_cli.scenario.base import Texts, checked, checked_path
from vibro_cli.scenario.loading import any_scenario_of, load_any, parse_document
from vibro_cli.scenario.quantities import Count, Text

if TYPE_CHECKING:
    from collections.abc import Sequence

    from vibro_cli.scenario.base import AnyScenario


def example(name: str) -> AnyScenario:
    """Return a scenario of the gallery, such as ``"three_arcs"``: what ``vibro new`` writes.

    Raises ``ScenarioError`` with the names there are.
    """
    checked("name", name, Text("the name of a scenario of the gallery, a text"))
    return any_scenario_of(parse_document(gallery.text(name), "toml", f"{name}.toml", name))


def load_scenario(source: str | Path, overrides: Sequence[str] = ()) -> AnyScenario:
    """Read a scenario of any system from a file in TOML, JSON or YAML, told by its suffix.

    Parameters
    ----------
    source
        The file; ``"-"`` is standard input.
    overrides
        Values to change as ``--set`` takes them, such as ``"balls[1].angle=-60 deg"``.

    Raises
    ------
    ScenarioError
        With everything that is wrong with it, each with line and column.
    OSError
        If the file cannot be read.
    """
    texts = checked("overrides", overrides, Texts("texts path=value"))
    return load_any(checked_path("source", source), texts)


def check(scenario: AnyScenario) -> tuple[str, ...]:
    """Check the mechanics of a scenario without running it; return what is doubtful about it.

    Raises ``ScenarioError`` with everything that makes it impossible.
    """
    return warnings_of(scenario, build_any(scenario))


def portrait(scenario: AnyScenario, body: int = 1, width: str = "double") -> Drawing:
    """Draw the phase portrait of a body without a run, as ``vibro portrait`` does.

    Level curves and separatrices in closed form, centres and saddles; on a trace the figure eight.

    Parameters
    ----------
    scenario
        Of any system; of a table, one within an ellipse or a circle.
    body
        The body, from 1.
    width
        ``"single"`` or ``"double"``: one column of a journal (85 mm) or two (170 mm).

    Raises
    ------
    ScenarioError
        If the scenario is mechanically impossible.
    ValueError
        For another body or width, and for a table without a portrait.
    """
    from vibro_cli.systems import system_named

    system = build_any(scenario)
    bodies = len(system.bodies)
    body = checked("body", body, Count(1, bodies))
    _, figures = system_named(scenario.system).portrait(system, width, True)
    for stem, figure in figures.items():
        if str(body) in stem.split("_"):  # equal bodies share one: portrait_1_2
            return Drawing(stem, figure)
    radii = [one.radius for one in system.bodies]  # balls of a table do by their radius alone
    first = f"portrait_{radii.index(radii[body - 1]) + 1}"
    return Drawing(first, figures[first])
