"""The report of a grid: true to its tables, harmless, and honest about what is missing."""

from __future__ import annotations

import tracemalloc
from pathlib import Path
from urllib.parse import unquote

import numpy as np
import pytest

from tests.grid_folder import product, write_grid
from tests.report.page_parser import Page
from vibro_cli.report.grid_content import _refused, grid_html
from vibro_cli.report.html import is_report
from vibro_cli.storage.stored import open_grid

TWO = product({"balls[1].angle": [-1.2, -1.1, -0.9, -0.6, -0.2], "collision.k": [1.0, 0.9, 0.5]})
NASTY = "<script>alert(1)</script><img src=x onerror=alert(2)>\"'&amp; {{ 7*7 }}"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("grids") / "grid ü #1"
    return write_grid(
        made, TWO, planned=20, bad={4: ("invalid", "too steep"), 9: ("failed", "odd")}
    )


@pytest.fixture(scope="module")
def content(folder: Path) -> bytes:
    return grid_html(open_grid(folder), folder.parent)


@pytest.fixture(scope="module")
def page(content: bytes) -> Page:
    return Page(content)


def rows(page: Page, part: str) -> list[str]:
    return page.with_id(part).text.split("\n")


def test_it_says_how_much_is_solved_and_how_runs_end(page: Page) -> None:
    text = page.with_id("result").text
    assert "15 of 20 points are solved so far." in text
    # causes n mod 4, without the points 4 (time) and 9 (no more collisions)
    for cause, count in {
        "time": 3,
        "no more collisions": 3,
        "end of trace": 4,
        "invalid": 1,
    }.items():
        assert f"{cause}{count}" in text


def test_axes_have_units_and_ranges(page: Page) -> None:
    text = page.with_id("problem").text
    assert "balls[1].anglerad5−1.2−0.2" in text
    assert "collision.k130.51" in text
    assert "gravity9.81 m/s²" in text  # what no axis changes
    assert "collision.lawhedrih" in text


def test_quantities_are_those_of_the_summary(page: Page) -> None:
    text = page.with_id("quantities").text
    assert "collisions023" not in text
    values = np.arange(15) % 7
    middle = float(np.median(values))
    assert f"collisions{values.min()}{middle:g}{values.max()}" in text
    assert "energy end0.0666667 J" in text


def test_reasons_of_refused_points_are_told(page: Page) -> None:
    text = page.with_id("refused").text
    assert "1invalidtoo steep" in text
    assert "1failedodd" in text


def test_a_long_reason_takes_memory_once(tmp_path: Path) -> None:
    """Each reason took the room of the longest: 1.1 GB for 213,000 invalid points."""
    long = 20_000 * "x"
    bad = {n: ("invalid", f"reason {n // 2}") for n in range(1, 2000)} | {7: ("failed", long)}
    angles = np.linspace(-1.2, -0.2, 2000).tolist()
    grid = open_grid(write_grid(tmp_path / "bad", product({"balls[1].angle": angles}), bad=bad))
    assert long in grid.summary["reason"]  # read before memory is traced
    tracemalloc.start()
    shown = _refused(grid)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 5e6
    twice = sorted(f"reason {n}" for n in range(1, 1000) if n != 3)
    assert shown[:20] == [["2", "invalid", reason] for reason in twice[:20]]
    assert shown[20:] == [["…", "", "981 further reasons"]]


def test_the_points_can_be_sorted_and_the_link_leads_to_them(page: Page, folder: Path) -> None:
    heads = [head.text for head in page.all("button")]
    assert heads[:3] == ["scenario", "balls[1].angle [rad]", "collision.k"]
    cells = [one for one in page.all("td") if "data-key" in one.attributes]
    table = np.array([one.attributes["data-key"] for one in cells]).reshape(-1, len(heads))
    assert [float(key) for key in table[:, 1]] == TWO["balls[1].angle"]
    assert table[4, heads.index("end_cause")] == ""  # none, and so last
    (link,) = (one for one in page.all("a") if one.text == "summary")
    assert (folder.parent / unquote(link.attributes["href"])).resolve() == folder / "summary"


def test_figures_of_both_widths_are_inside(page: Page) -> None:
    assert len(page.all("img")) == len(page.all("source")) == 5
    for element in (*page.all("img"), *page.all("source")):
        address = element.attributes.get("src", element.attributes.get("srcset", ""))
        assert address.startswith("data:image/")


def test_equal_grids_give_equal_bytes(folder: Path, content: bytes) -> None:
    assert grid_html(open_grid(folder), folder.parent) == content
    assert is_report(content)


def test_names_and_reasons_with_markup_do_no_harm(tmp_path: Path) -> None:
    bad = {1: ("invalid", NASTY)}
    made = write_grid(tmp_path / "nasty", {"balls[1].body": ["ball", NASTY]}, name=NASTY, bad=bad)
    page = Page(grid_html(open_grid(made), tmp_path))
    assert NASTY in page.all("h1")[0].text
    assert len(page.all("script")) == 1
    assert not any("onerror" in one.attributes for one in page.elements)


def test_a_grid_without_a_changing_axis_says_so(tmp_path: Path) -> None:
    made = write_grid(tmp_path / "point", {"collision.k": [0.5]}, kept=False)
    text = Page(grid_html(open_grid(made), tmp_path)).with_id("figures").text
    assert "there is nothing to draw" in text
