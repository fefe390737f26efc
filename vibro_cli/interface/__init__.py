"""The Python interface: what ``import vibro_cli`` offers, by what it is about; its figures."""

from __future__ import annotations

import logging
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

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
        from vibro_cli.scenario.base import checked_path
        from vibro_cli.storage.files import write_file

        target = checked_path("file", file)
        write_file(target, render(self.figure, target.suffix[1:].lower()))
        return target

    def _repr_png_(self) -> bytes:
        from vibro_cli.figures.style import render

        return render(self.figure, "png", 150.0)


def pictures(
    figures: Mapping[str, Figure] | Iterable[tuple[str, Figure]],
    forms: Sequence[str] = ("png", "pdf"),
) -> dict[str, bytes]:
    """Return the files of figures, which are given by their stems, by their names."""
    from vibro_cli.figures.style import render
    from vibro_cli.told import WORK

    files = {}
    for stem, figure in figures.items() if isinstance(figures, Mapping) else figures:
        for form in forms:
            WORK.tell(f"{stem}.{form}")
            files[f"{stem}.{form}"] = render(figure, form)
    return files


def figures_of(run: Any, kinds: Sequence[str]) -> dict[str, bytes]:
    """Return the files of some kinds of figures of a run."""
    from vibro_cli.figures.kinds import draw_all

    drawn = draw_all(run, kinds, run.kind.figure_width(run.system))
    return pictures((one.name, one.figure) for one in drawn)


def kinds_in(files: Iterable[str]) -> list[str]:
    """Return the kinds of figures among files, each as often as there are figures of it."""
    stems = [Path(file).stem for file in files if file.endswith(".png")]
    # Where there is a figure of each body, its number follows the kind: portrait_1.png.
    return [re.sub(r"_\d+$", "", stem) for stem in stems]


def nothing_shown(kinds: Iterable[str], files: Iterable[str]) -> list[str]:
    """Return what is to be told of kinds of figures that none of the files is of."""
    drawn = kinds_in(files)
    return [f"the run has nothing to show as {kind}" for kind in kinds if kind not in drawn]
