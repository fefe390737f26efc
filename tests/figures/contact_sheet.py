"""A contact sheet of every kind of figure, to be looked at and judged.

    python -m tests.figures.contact_sheet sheet.png [scenario …]

One row for each scenario of the gallery: portraits of the runs, charts, and the portrait without a
run, all at the width of one column (85 mm).
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path

from PIL import Image

from vibro_cli import load_scenario, simulate
from vibro_cli.analysis.landscape import Landscape
from vibro_cli.analysis.portrait_type import portrait_of
from vibro_cli.figures.family import family
from vibro_cli.figures.kinds import KINDS, PORTRAIT, draw_all
from vibro_cli.figures.output import render
from vibro_cli.figures.structure import structure

SCENARIOS = Path(__file__).parents[2] / "scenarios"
_ROOM = 24
_GROUND = (200, 200, 215)


def pictures(name: str) -> Iterator[Image.Image]:
    """Every figure of a scenario of the gallery."""
    run = simulate(load_scenario(SCENARIOS / f"{name}.toml"))
    portrait = portrait_of(Landscape.of(run.system, 1))
    figures = [one.figure for one in draw_all(run, [PORTRAIT, *KINDS], "single")]
    for figure in (*figures, structure(portrait), family([(name, portrait)])):
        yield Image.open(BytesIO(render(figure, "png"))).convert("RGB")


def sheet(names: list[str]) -> Image.Image:
    """Return the figures of scenarios, a row for each."""
    rows = [list(pictures(name)) for name in names]
    width = max(sum(one.width + _ROOM for one in row) for row in rows) + _ROOM
    heights = [max(one.height for one in row) + _ROOM for row in rows]
    whole = Image.new("RGB", (width, sum(heights) + _ROOM), _GROUND)
    down = _ROOM
    for row, height in zip(rows, heights, strict=True):
        across = _ROOM
        for one in row:
            whole.paste(one, (across, down))
            across += one.width + _ROOM
        down += height
    return whole


if __name__ == "__main__":
    target, *chosen = sys.argv[1:]
    sheet(chosen or sorted(path.stem for path in SCENARIOS.glob("*.toml"))).save(target)
