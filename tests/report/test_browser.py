"""Reports as a reader opens them: a real browser, offline, at phone and desktop width.

Needs a Chromium on the machine (`apt-get install chromium`, or `playwright install chromium`);
without one these tests are skipped.
"""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, BrowserContext, Page, expect, sync_playwright

from tests.grid_folder import product, write_grid
from tests.report.test_report import stored
from vibro_cli.figures.film import frame_times
from vibro_cli.report.content import report_html
from vibro_cli.report.grid_content import grid_html
from vibro_cli.report.html import film_html
from vibro_cli.storage.stored import open_grid, open_run
from vibro_cli.systems.trace.figures import film as film_on_trace

pytestmark = pytest.mark.long

PHONE, DESKTOP = 360, 1280
HIGH = 800
FILM = frame_times(0.0, 4.0, 1.0, 25)
GRAVE = {"serious", "critical"}
NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")


@dataclass
class Heard:
    """The console messages of a page, and its network requests."""

    said: list[str] = field(default_factory=list)
    asked: list[str] = field(default_factory=list)


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    found = next((path for name in NAMES if (path := shutil.which(name))), None)
    with sync_playwright() as playwright:
        own = Path(playwright.chromium.executable_path)
        if found is None and not own.exists():
            pytest.skip("no Chromium on this machine: apt-get install chromium")
        sandbox = [] if os.geteuid() else ["--no-sandbox"]  # root has none
        opened = playwright.chromium.launch(executable_path=found or str(own), args=sandbox)
        yield opened
        opened.close()


@pytest.fixture(scope="module")
def reports(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A report of a run, of two runs compared, of a grid, and a film."""
    folder = tmp_path_factory.mktemp("reports")
    first = stored(folder / "first", "three_arcs", "stop.collisions=15")
    second = stored(folder / "second", "three_arcs", "stop.collisions=5", "name=shorter")
    found = {}
    for name, runs in {"one": [first], "compared": [first, second]}.items():
        found[name] = folder / f"{name}.html"
        found[name].write_bytes(report_html(runs, folder))
    sweep = product({"balls[1].angle": [-1.2, -0.9, -0.2], "collision.k": [1.0, 0.9, 0.5]})
    grid = open_grid(write_grid(folder / "sweep", sweep, bad={4: ("invalid", "too steep")}))
    found["grid"] = folder / "grid.html"
    found["grid"].write_bytes(grid_html(grid, folder))
    found["film"] = folder / "film.html"
    shown = film_on_trace(first, FILM)
    found["film"].write_bytes(film_html(shown, 25, "three_arcs"))
    return found


@pytest.fixture
def opened(browser: Browser) -> Iterator[Callable[..., tuple[Page, Heard]]]:
    contexts: list[BrowserContext] = []

    def open_page(path: Path, width: int, scheme: Any = "light") -> tuple[Page, Heard]:
        context = browser.new_context(
            viewport={"width": width, "height": HIGH}, color_scheme=scheme, offline=True
        )
        contexts.append(context)
        page, heard = context.new_page(), Heard()
        page.on("console", lambda message: heard.said.append(message.text))
        page.on("pageerror", lambda error: heard.said.append(str(error)))
        page.on("request", lambda request: heard.asked.append(request.url))
        page.goto(path.as_uri())
        return page, heard

    yield open_page
    for context in contexts:
        context.close()


@pytest.mark.parametrize(
    ("name", "width", "scheme"),
    [
        ("one", PHONE, "light"),
        ("one", DESKTOP, "dark"),
        ("compared", PHONE, "dark"),
        ("compared", DESKTOP, "light"),
        ("grid", PHONE, "light"),
        ("grid", DESKTOP, "dark"),
        ("film", PHONE, "light"),
        ("film", DESKTOP, "dark"),
    ],
)
def test_the_page_is_quiet_fits_and_can_be_read_by_all(
    opened: Any, reports: dict[str, Path], name: str, width: int, scheme: str
) -> None:
    page, heard = opened(reports[name], width, scheme)
    assert heard.said == []
    assert heard.asked == [reports[name].as_uri()]
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    found = Axe().run(page).response
    assert len(found["passes"]) > 20  # it did look
    assert [one["id"] for one in found["violations"] if one["impact"] in GRAVE] == []
    ground = page.evaluate("getComputedStyle(document.body).backgroundColor")
    light = sum(map(int, ground.removeprefix("rgb(").removesuffix(")").split(","))) > 3 * 128
    assert light == (scheme == "light")


def test_the_accessibility_checker_would_find_something(opened: Any, tmp_path: Path) -> None:
    page_with_faults = tmp_path / "faults.html"
    page_with_faults.write_text("<html><img src='data:,'><p style='color:#eee'>pale</p></html>")
    page, _ = opened(page_with_faults, DESKTOP)
    found = {one["id"] for one in Axe().run(page).response["violations"] if one["impact"] in GRAVE}
    assert {"image-alt", "html-has-lang", "color-contrast"} <= found


@pytest.mark.parametrize(("width", "form"), [(PHONE, "narrow"), (DESKTOP, "wide")])
def test_every_figure_is_seen_in_the_form_made_for_the_width(
    opened: Any, reports: dict[str, Path], width: int, form: str
) -> None:
    page, _ = opened(reports["one"], width)
    images = page.locator("figure img")
    assert images.count() >= 8
    for image in images.all():
        image.scroll_into_view_if_needed()
        drawn, shown, narrow = image.evaluate(
            """one => [one.complete && one.naturalWidth, one.getBoundingClientRect().width,
                       one.currentSrc === one.previousElementSibling.srcset]"""
        )
        assert drawn > 300
        assert 0.9 * min(width, 800) < shown <= width
        assert narrow == (form == "narrow")


def column(page: Page, name: str) -> list[float]:
    """Return the values of a column of the table of impacts, in order."""
    script = """name => {
      const heads = [...document.querySelectorAll("table.sortable thead th")];
      const place = heads.findIndex(head => head.textContent.split(" ")[0] === name);
      return [...document.querySelectorAll("table.sortable tbody tr")].map(
        row => row.cells[place].dataset.key);
    }"""
    return [float(key) if key else float("nan") for key in page.evaluate(script, name)]


def test_the_table_sorts_by_click_and_by_key(opened: Any, reports: dict[str, Path]) -> None:
    page, _ = opened(reports["one"], DESKTOP)
    before = column(page, "energy_loss")
    button = page.get_by_role("button", name="energy_loss")
    button.click()
    assert column(page, "energy_loss") == sorted(before) != before
    head = page.locator("th", has=button)
    assert head.get_attribute("aria-sort") == "ascending"
    button.focus()
    page.keyboard.press("Enter")
    assert column(page, "energy_loss") == sorted(before, reverse=True)
    assert head.get_attribute("aria-sort") == "descending"
    page.get_by_role("button", name="dt [s]").click()
    assert column(page, "dt")[-1] != column(page, "dt")[-1]  # no value: always last
    assert head.get_attribute("aria-sort") == "none"
    page.get_by_role("button", name="n", exact=True).click()
    assert column(page, "energy_loss") == before


def test_words_and_missing_values_sort_too(opened: Any, reports: dict[str, Path]) -> None:
    page, _ = opened(reports["grid"], DESKTOP)
    button = page.get_by_role("button", name="end_cause")
    script = "[...document.querySelectorAll('tbody tr')].map(r => r.cells[4]?.textContent)"
    for order in (False, True):
        button.click()
        words = page.evaluate(script)[-9:]
        assert words[-1] == "–"  # the invalid point has no cause: last in both directions
        assert words[:-1] == sorted(words[:-1], reverse=order)
        assert len(set(words)) > 3


def test_the_keyboard_reaches_the_content(opened: Any, reports: dict[str, Path]) -> None:
    page, _ = opened(reports["one"], DESKTOP)
    page.keyboard.press("Tab")
    skip = page.locator("a.skip")
    assert skip.evaluate("one => one === document.activeElement")
    assert skip.bounding_box()["x"] >= 0  # and is seen then
    page.keyboard.press("Enter")
    assert page.url.endswith("#content")


def test_paper_shows_all_of_the_table_and_no_navigation(
    opened: Any, reports: dict[str, Path]
) -> None:
    page, _ = opened(reports["one"], DESKTOP, "dark")
    page.emulate_media(media="print")
    assert not page.locator("nav").is_visible()
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
    for region in page.locator(".scroll").all():
        assert region.evaluate("one => getComputedStyle(one).overflowY") == "visible"
    paper = page.pdf(format="A4")
    assert paper.startswith(b"%PDF-")
    assert paper.count(b"/Type /Page\n") + paper.count(b"/Type /Page ") >= 4


def test_the_film_shows_every_frame_where_the_bodies_are(
    opened: Any, reports: dict[str, Path]
) -> None:
    """The disks' places on the page, read back through the map of two other frames."""
    page, heard = opened(reports["film"], DESKTOP)
    run = open_run(reports["film"].parent / "first")
    exact = run.sample(FILM)
    disks = page.locator("#moving circle")
    seen = []
    for frame in (0, 50, 77):
        page.locator("#frame").fill(str(frame))
        assert page.locator("#clock").text_content() == f"t = {FILM[frame]:.3f} s"
        seen.append([float(disks.nth(n).get_attribute("cx")) for n in (0, 2)])
    x = exact["x"].reshape(-1, 2)[[0, 50, 77]]
    scale = (seen[2][0] - seen[0][0]) / (x[2, 0] - x[0, 0])
    for row in range(3):
        for body in (0, 1):
            expected = seen[0][0] + scale * (x[row, body] - x[0, 0])
            assert seen[row][body] == pytest.approx(expected, abs=1e-6)
    assert heard.said == []


def test_the_film_plays_pauses_and_ends(opened: Any, reports: dict[str, Path]) -> None:
    page, _ = opened(reports["film"], DESKTOP)
    button, slider = page.get_by_role("button"), page.locator("#frame")
    page.keyboard.press("Tab")
    page.keyboard.press("Enter")
    assert button.text_content() == "Pause"
    expect(slider).not_to_have_value(re.compile("^[012]$"))
    button.click()
    assert button.text_content() == "Play"
    slider.fill(str(len(FILM) - 3))
    slider.press("ArrowRight")
    assert slider.input_value() == str(len(FILM) - 2)
    button.click()
    expect(slider).to_have_value(str(len(FILM) - 1))
    expect(button).to_have_text("Play")
