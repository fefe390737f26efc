"""The Python interface: what ``import vibro_cli`` offers; here scenarios, and figures as files."""

from __future__ import annotations

import logging
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vibro_cli.assemble import build_any
from vibro_cli.scenario import gallery
from vibro_cli.scenario.base import Texts, checked, checked_path
from vibro_cli.scenario.loading import any_scenario_of, load_any, parse_document
from vibro_cli.scenario.quantities import Count, Text
from vibro_cli.systems import system_named

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from vibro_cli.scenario.base import AnyScenario

# Whoever imports the package decides whether its messages are shown.
logging.getLogger("vibro_cli").addHandler(logging.NullHandler())


@dataclass(frozen=True)
class Drawing:
    """A figure at journal standard, shown as it is in a notebook."""

    name: str
    """The stem of its files."""
    figure: Figure = field(repr=False)
    """The figure of matplotlib."""

    def save(self, file: str | Path) -> Path:
        """Write the figure as PNG, PDF or SVG, by the file's suffix, and return its path.

        Equal figures give equal bytes.

        Raises ``ValueError`` for another suffix and ``OSError`` where it cannot be written.
        """
        from vibro_cli.figures.style import render
        from vibro_cli.storage.files import write_file

        target = checked_path("file", file)
        write_file(target, render(self.figure, target.suffix[1:].lower()))
        return target

    def _repr_png_(self) -> bytes:
        from vibro_cli.figures.style import render

        return render(self.figure, "png", 150.0)


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
    system = build_any(scenario)
    return system_named(scenario.system).warnings(scenario, system)


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
    system = build_any(scenario)
    body = checked("body", body, Count(1, len(system.bodies)))
    _, figures = system_named(scenario.system).portrait(system, width, [body])
    ((stem, figure),) = figures.items()
    return Drawing(stem, figure)


def pictures(
    figures: Mapping[str, Figure], forms: Sequence[str] = ("png", "pdf")
) -> dict[str, bytes]:
    """Return the files of figures, which are given by their stems, by their names."""
    from vibro_cli.figures.style import render
    from vibro_cli.progress import WORK

    files = {}
    for stem, figure in figures.items():
        for form in forms:
            WORK.report(f"{stem}.{form}")
            files[f"{stem}.{form}"] = render(figure, form)
    return files


def figures_of(run: Any, kinds: Sequence[str]) -> dict[str, bytes]:
    """Return the files of some kinds of figures of a run."""
    from vibro_cli.figures.kinds import draw_all

    files: dict[str, bytes] = {}
    for one in draw_all(run, kinds, run.kind.figure_width(run.system)):
        files |= pictures({one.name: one.figure})
    return files


def kinds_in(files: Iterable[str]) -> list[str]:
    """Return the kinds of figures among files, each as often as there are figures of it."""
    stems = [Path(file).stem for file in files if file.endswith(".png")]
    # Where there is a figure of each body, its number follows the kind: portrait_1.png.
    return [re.sub(r"_\d+$", "", stem) for stem in stems]


def nothing_shown(kinds: Iterable[str], files: Iterable[str]) -> list[str]:
    """Return what is to be told of kinds of figures that none of the files is of."""
    drawn = kinds_in(files)
    return [f"the run has nothing to show as {kind}" for kind in kinds if kind not in drawn]
