"""The Python interface, exported by ``vibro_cli``; this module has scenarios and drawings."""

from __future__ import annotations

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
    from vibro_cli.storage.stored import StoredRun


@dataclass(frozen=True)
class Drawing:
    """A figure of journal quality, which notebooks display directly."""

    name: str
    """Stem of its files."""
    figure: Figure = field(repr=False)
    """The matplotlib figure."""

    def save(self, file: str | Path) -> Path:
        """Write the figure as PNG, PDF or SVG, by the file's suffix, and return its path.

        Equal figures give equal bytes.

        Raises ``ValueError`` for another suffix and ``OSError`` if the file cannot be written.
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
    """Return a scenario of the gallery, such as ``"three_arcs"``, which ``vibro new`` writes.

    Raises ``ScenarioError``, with the known names, for any other name.
    """
    checked("name", name, Text("the name of a scenario of the gallery, a text"))
    return any_scenario_of(parse_document(gallery.text(name), "toml", f"{name}.toml", name))


def load_scenario(source: str | Path, overrides: Sequence[str] = ()) -> AnyScenario:
    """Read a scenario of any system from a TOML, JSON or YAML file, distinguished by its suffix.

    Parameters
    ----------
    source
        The file; ``"-"`` is standard input.
    overrides
        Values to change, as for ``--set``, such as ``"balls[1].angle=-60 deg"``.

    Raises
    ------
    ScenarioError
        With all faults of the scenario, each with line and column.
    OSError
        If the file cannot be read.
    """
    texts = checked("overrides", overrides, Texts("overrides path=value"))
    return load_any(checked_path("source", source), texts)


def check(scenario: AnyScenario) -> tuple[str, ...]:
    """Check the mechanics of a scenario without running it; return warnings.

    Raises ``ScenarioError``, with all reasons, if the scenario is impossible.
    """
    system = build_any(scenario)
    return system_named(scenario.system).warnings(scenario, system)


def portrait(scenario: AnyScenario, body: int = 1, width: str = "double") -> Drawing:
    """Draw the phase portrait of a body without a run, as ``vibro portrait`` does.

    It shows level curves and separatrices in closed form, centres and saddles, and on a trace the
    figure eight.

    Parameters
    ----------
    scenario
        Scenario of any system; a table needs an ellipse or a circle around the balls.
    body
        The body, from 1.
    width
        ``"single"`` or ``"double"``: one column of a journal (85 mm) or two (170 mm).

    Raises
    ------
    ScenarioError
        If the scenario is mechanically impossible.
    NoPortrait
        For a table without an ellipse or a circle around the balls.
    ValueError
        For an invalid body or width.
    """
    system = build_any(scenario)
    body = checked("body", body, Count(1, len(system.bodies)))
    _, figures = system_named(scenario.system).portrait(system, width, [body])
    ((stem, figure),) = figures.items()
    return Drawing(stem, figure)


def pictures(
    figures: Mapping[str, Figure], forms: Sequence[str] = ("png", "pdf")
) -> dict[str, bytes]:
    """Render figures, given by stem; return the contents of the files by name."""
    from vibro_cli.figures.style import render
    from vibro_cli.progress import WORK

    files = {}
    for stem, figure in figures.items():
        for form in forms:
            WORK.report(f"{stem}.{form}")
            files[f"{stem}.{form}"] = render(figure, form)
    return files


def figures_of(run: Any, kinds: Sequence[str]) -> dict[str, bytes]:
    """Draw figures of a run by kind; return the contents of the files by name."""
    return files_of({"": run}, kinds, run.kind.figure_width(run.system), ("png", "pdf"))


def files_of(
    runs: Mapping[str, Any], kinds: Sequence[str] | None, width: str, forms: Sequence[str]
) -> dict[str, bytes]:
    """Draw figures of runs, of all kinds or of those named; return the files' contents by name.

    The keys of `runs` are the beginnings of the names of its files.
    """
    from vibro_cli.figures.kinds import listed
    from vibro_cli.figures.processes import each_drawn

    jobs = [
        (place, (beginning, kind, body, width, forms))
        for place, (beginning, run) in enumerate(runs.items())
        for kind, body in listed(run, kinds)
    ]
    files: dict[str, bytes] = {}
    for found in each_drawn(_files, [*runs.values()], jobs):
        files |= found
    return files


def _files(
    run: Any, beginning: str, kind: str, body: int, width: str, forms: Sequence[str]
) -> dict[str, bytes]:
    """Draw one figure of a run; return the contents of its files by name, none if it is empty."""
    from vibro_cli.figures.kinds import draw_one

    drawn = draw_one(run, kind, body, width)
    return {} if drawn is None else pictures({f"{beginning}{drawn.name}": drawn.figure}, forms)


def kinds_in(files: Iterable[str]) -> list[str]:
    """Return the kinds of the figures among files, one entry per figure."""
    stems = [Path(file).stem for file in files if file.endswith(".png")]
    # Figures of single bodies have the body's number after the kind: portrait_1.png.
    return [re.sub(r"_\d+$", "", stem) for stem in stems]


def nothing_shown(run: StoredRun, kinds: Iterable[str], files: Iterable[str]) -> list[str]:
    """Return messages about kinds of figures of a run that are missing among files."""
    drawn, known = kinds_in(files), run.kind.figures
    return [f"the run {known[kind].nothing(kind)}" for kind in kinds if kind not in drawn]
