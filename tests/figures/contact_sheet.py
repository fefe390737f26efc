"""A contact sheet of every kind of figure, to be looked at and judged.

    python -m tests.figures.contact_sheet sheet.png [scenario …]

One row for each scenario of the gallery: portraits of the runs, charts, the portrait without a run
and a frame of its film; below them particle, disk and ball compared, and the figures of a grid made
by hand. All at the width of one column (85 mm).
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from matplotlib.figure import Figure
from PIL import Image

from tests.grid_folder import product, write_grid
from vibro_cli.analysis.levels import Landscape
from vibro_cli.analysis.singular import portrait_of
from vibro_cli.api import simulate
from vibro_cli.assemble import build_any
from vibro_cli.figures.film import Film, frame_times
from vibro_cli.figures.kinds import draw_all, draw_grid
from vibro_cli.figures.portraits.trace_phase_plane import comparison, family, structure
from vibro_cli.figures.style import render
from vibro_cli.scenario import load_any
from vibro_cli.storage.stored import open_grid
from vibro_cli.systems.trace.figures import film as film_on_trace

BODIES = Path(__file__).parents[2] / "scenarios/ball_on_arcs.toml"
SCENARIOS = Path(__file__).parents[2] / "scenarios"
_ROOM = 24
_GROUND = (200, 200, 215)


def pictures(name: str) -> Iterator[Image.Image]:
    """Return every figure of a scenario of the gallery."""
    run = simulate(load_any(SCENARIOS / f"{name}.toml"))
    portrait = portrait_of(Landscape.of(run.system, 1))
    figures = [one.figure for one in draw_all(run, None, "single")]
    for figure in (*figures, structure(portrait), family([(name, portrait)])):
        yield picture(figure)
    yield Image.fromarray(
        Film(film_on_trace(run, frame_times(0.0, 1.0, 1.0, 25)), 150.0).picture(25)
    )


def others() -> Iterator[Image.Image]:
    """Return the figures that belong to no single run."""
    members = [
        (body, portrait_of(Landscape.of(build_any(load_any(BODIES, [override])), 1)))
        for body in ("particle", "disk", "ball")
        for override in (f"balls[1].body={body}",)
    ]
    yield picture(comparison(members))
    axes = {"collision.k": np.linspace(0.5, 1.0, 9).tolist()}
    axes["balls[1].angle"] = np.linspace(-1.2, -0.2, 25).tolist()
    with TemporaryDirectory() as folder:
        grid = open_grid(write_grid(Path(folder), product(axes), bad={7: ("invalid", "too steep")}))
        for drawn in draw_grid(grid, "single"):
            yield picture(drawn.figure)


def picture(figure: Figure) -> Image.Image:
    """Return a figure as a picture."""
    return Image.open(BytesIO(render(figure, "png"))).convert("RGB")


def sheet(names: list[str]) -> Image.Image:
    """Return the figures of scenarios, a row for each, and those of no single run."""
    rows = [*(list(pictures(name)) for name in names), list(others())]
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
