"""Figures of a grid with very many points, of its last impacts, and of any column."""

from __future__ import annotations

import tracemalloc
from base64 import b64decode
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from io import BytesIO
from typing import Any

import numpy as np
import pytest
from matplotlib.collections import PathCollection, QuadMesh
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.image import imread

from vibro_cli.figures import chart
from vibro_cli.figures.kinds import GRID_KINDS, column_map, draw_grid, mapped_columns
from vibro_cli.figures.over_axis import LAST, bifurcation
from vibro_cli.figures.style import render, time_colours

RUNS = 12
IMPACTS = 30  # of the first run; each further one has one more


@dataclass(frozen=True, eq=False)
class Made:
    """A grid of two axes made by hand: run i has IMPACTS + i impacts; impact n is at 0.01 n + i."""

    logarithmic: tuple[str, ...] = ()
    axes: tuple[str, ...] = ("balls[1].angle", "collision.k")
    units: Mapping[str, str] = field(
        default_factory=lambda: {"balls[1].angle": "rad", "collision.k": "", "end_time": "s"}
    )

    @property
    def summary(self) -> Mapping[str, Any]:
        n = np.arange(RUNS)
        return {
            "scenario": n + 1,
            "balls[1].angle": 0.1 * (n // 2),
            "collision.k": np.where(n % 2, 0.9, 0.5),
            "status": np.full(RUNS, "ok", dtype=object),
            "end_cause": np.full(RUNS, "time", dtype=object),
            "collisions": IMPACTS + n,
            "contacts": n % 3,
            "end_time": 10.0 + n,
            "last_collision_time": 5.0 + n,
            "first_collision_time": 0.5 + 0.0 * n,
            "energy_start": np.ones(RUNS),
            "energy_end": np.full(RUNS, 0.5),
        }

    @property
    def shapes(self) -> tuple[str, ...]:
        return ("valley",)

    def impact_columns(self) -> tuple[str, ...]:
        return ("scenario", "n", "angle_a", "speed_a_pre")

    def impacts(self, columns: Sequence[str], scenarios: Any) -> Iterator[dict[str, Any]]:
        scenario = np.concatenate([np.full(IMPACTS + i - 1, i) for i in scenarios.tolist()])
        n = np.concatenate([np.arange(1, IMPACTS + i) for i in scenarios.tolist()])
        found = {"scenario": scenario, "n": n, "angle_a": 0.01 * n + scenario}
        found["speed_a_pre"] = -2.0 * found["angle_a"]
        yield {name: found[name] for name in columns}


def made() -> Any:
    """A grid as figures take it, in the place of one that is stored."""
    return Made()


def offsets(figure: Figure, panel: int) -> Any:
    (drawn,) = (one for one in figure.axes[panel].collections if isinstance(one, PathCollection))
    return np.asarray(drawn.get_offsets())


def test_the_bifurcation_diagram_has_the_last_impacts() -> None:
    figure = bifurcation(made())
    assert figure is not None
    places, speeds = offsets(figure, 0), offsets(figure, 1)
    shown = range(0, RUNS, 2)  # k is held at its first value
    expected = [
        (0.1 * (i // 2), 0.01 * n + i + 1)
        for i in shown
        for n in range(IMPACTS + i - LAST + 1, IMPACTS + i + 1)
    ]
    np.testing.assert_allclose(places, expected)
    np.testing.assert_allclose(speeds[:, 1], -2.0 * places[:, 1])
    assert [axes.get_ylabel() for axes in figure.axes][1] == "$v_a$ before [m/s]"


def cells(figure: Figure) -> Any:
    (mesh,) = (one for one in figure.axes[0].collections if isinstance(one, QuadMesh))
    return mesh.get_array()


def test_the_map_of_contacts_has_their_last_impacts_and_no_others() -> None:
    figure = GRID_KINDS["contact"].draw(made(), "single")
    assert figure is not None
    found = cells(figure)
    for n in range(RUNS):
        value = found[n % 2, n // 2]
        assert (value is np.ma.masked) if n % 3 == 0 else value == 5.0 + n


def test_any_column_of_numbers_has_a_map() -> None:
    grid = made()
    known = mapped_columns(grid)
    assert "end_time" in known
    assert not {"scenario", "collision.k", "status", "end_cause"} & set(known)
    figure = column_map(grid, "single", "end_time")
    assert figure is not None
    assert cells(figure)[1, 2] == 15.0
    assert figure.axes[1].get_ylabel() == "end time [s]"
    drawn = {one.name: one for one in draw_grid(grid, "single", ["end_time"])}
    assert drawn["map_end_time"].title == "End time"


def test_very_many_points_are_pixels_in_the_same_places(monkeypatch: pytest.MonkeyPatch) -> None:
    draw = np.random.default_rng(3)
    across, along, values = draw.random(400), draw.random(400), draw.random(400)
    across[0] = np.nan
    lines = []
    for most in (400, 399):
        monkeypatch.setattr(chart, "MOST_MARKS", most)
        figure = Figure(figsize=(3.0, 3.0), dpi=100)
        axes = figure.add_axes((0.1, 0.1, 0.8, 0.8))
        axes.set_xlim(0.0, 1.0)
        axes.set_ylim(0.0, 1.0)
        chart.draw_dots(axes, across, along, values, time_colours(), Normalize(0.0, 1.0), 1.0)
        assert (axes.get_xlim(), axes.get_ylim()) == ((0.0, 1.0), (0.0, 1.0))
        lines.append(axes.lines)
    assert not lines[0]
    colours = {
        (x, y): line.get_color()
        for line in lines[1]
        for x, y in np.asarray(line.get_xydata()).tolist()
    }

    def pixel(x: float, y: float) -> tuple[int, int]:
        return int(30.0 + 240.0 * x), int(30.0 + 240.0 * y)

    pixels = {pixel(*point) for point in colours}
    for x, y in zip(across[1:], along[1:], strict=True):
        assert pixel(x, y) in pixels
    assert 350 < len(colours) <= 399
    last = np.multiply(255.0, colours[across[-1], along[-1]])
    assert last.tolist() == pytest.approx(time_colours()(values[-1], bytes=True))


@pytest.mark.parametrize("dpi", [96.0, 192.0, 300.0, 700.0])
def test_no_pixel_of_very_many_points_is_lost_at_any_resolution(
    monkeypatch: pytest.MonkeyPatch, dpi: float
) -> None:
    """Isolated dots were left out between the rows and columns of files, 4 of 5 in reports."""
    monkeypatch.setattr(chart, "MOST_MARKS", 0)
    draw = np.random.default_rng(5)
    across, along = (draw.permutation(40) + draw.random(40) for _ in range(2))
    figure = Figure(figsize=(3.0, 2.0))
    axes = figure.add_axes((0.1, 0.1, 0.8, 0.8), xlim=(0.0, 40.0), ylim=(0.0, 40.0))
    axes.set_axis_off()
    black = ListedColormap(["#000000"])
    chart.draw_dots(axes, across, along, np.ones(40), black, Normalize(0.0, 1.0), 1.0)
    shown = imread(BytesIO(render(figure, "png", dpi)))
    dark = np.argwhere(shown[::-1, :, 0] < 0.5)[:, ::-1] + 0.5
    high, wide = shown.shape[:2]
    where = np.column_stack([across, along]) / 40.0 * 0.8 + 0.1
    apart = np.abs(dark[None] - (where * (wide, high))[:, None]).max(axis=2)
    assert np.all(apart.min(axis=1) <= 1.0 + 0.06 / 25.4 * dpi)
    svg = render(figure, "svg", dpi).decode()
    raster = b64decode("".join(svg.split("data:image/png;base64,")[1].split('"')[0].split()))
    assert np.sum(imread(BytesIO(raster))[..., 3] > 0.5) == len(dark)


class InParts(Made):
    """Runs of 50,000 impacts each, a part for each run."""

    def impacts(self, columns: Sequence[str], scenarios: Any) -> Iterator[dict[str, Any]]:
        for scenario in scenarios.tolist():
            n = np.arange(50_000) + 1
            found = {"scenario": np.full(len(n), scenario), "n": n, "angle_a": 1e-5 * n}
            yield {name: found[name] for name in columns}


def test_impacts_that_are_not_shown_take_no_memory() -> None:
    """The last 20 of each run need a few kilobytes, a part 1.2 MB, all impacts 7 MB and more."""
    grid: Any = InParts()
    bifurcation(grid, "single", [("angle_a", "$a$", "rad")])
    tracemalloc.start()
    try:
        figure = bifurcation(grid, "single", [("angle_a", "$a$", "rad")])
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert len(offsets(figure, 0)) == 20 * RUNS // 2
    assert peak < 6 * 50_000 * 3 * 8
