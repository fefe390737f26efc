"""A figure as Python shows and saves it."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Drawing:
    """A figure at journal standard, shown as it is in a notebook."""

    name: str
    """The stem of its files."""
    figure: Figure = field(repr=False)
    """The figure of matplotlib."""

    def save(self, file: str | Path) -> Path:
        """Write the figure as PNG, PDF or SVG, by the file's suffix; equal figures, equal bytes.

        Raises ``ValueError`` for another suffix and ``OSError`` where it cannot be written.
        """
        from vibro_cli.figures.style import save

        target = Path(file)
        (written,) = save(self.figure, target.with_suffix(""), (target.suffix[1:].lower(),))
        return written

    def _repr_png_(self) -> bytes:
        from vibro_cli.figures.style import render

        return render(self.figure, "png", 150.0)
