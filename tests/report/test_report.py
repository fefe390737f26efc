"""Reports: self-contained, well-formed, harmless whatever the names, and true to the tables."""

from __future__ import annotations

import base64
import gc
import hashlib
import math
import re
import weakref
from collections.abc import Iterator
from importlib.resources import files
from itertools import pairwise
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
import pytest
from matplotlib.figure import Figure

from tests.report.page_parser import Page
from vibro_cli.api import simulate
from vibro_cli.figures.kinds import Drawn
from vibro_cli.report import html
from vibro_cli.report.content import FIRST_ROWS, energy_balance, key_figures, report_html
from vibro_cli.report.html import is_report, pictured
from vibro_cli.report.papers import analogy, forms
from vibro_cli.report.words import number
from vibro_cli.scenario import any_scenario_of, load_any
from vibro_cli.storage.folders import write_run
from vibro_cli.storage.stored import StoredRun, open_run

pytestmark = pytest.mark.long

GALLERY = Path(__file__).parents[2] / "scenarios"
NASTY = "<script>alert(1)<img src=x onerror=alert(2)>\"'&amp; {{ 7*7 }}"


def stored(folder: Path, name: str, *overrides: str) -> StoredRun:
    scenario = load_any(GALLERY / f"{name}.toml", [*overrides])
    write_run(simulate(scenario), scenario, folder, {})
    return open_run(folder)


@pytest.fixture(scope="module")
def beside(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("outputs")


@pytest.fixture(scope="module")
def run(beside: Path) -> StoredRun:
    return stored(beside / "three arcs #1 ü", "three_arcs")


@pytest.fixture(scope="module", autouse=True)
def version() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(html, "__version__", "1.2.3")
        yield


@pytest.fixture(scope="module")
def content(run: StoredRun, beside: Path) -> bytes:
    return report_html([run], beside)


@pytest.fixture(scope="module")
def page(content: bytes) -> Page:
    return Page(content)


def test_nothing_is_loaded_from_elsewhere(page: Page) -> None:
    for element in page.elements:
        for name in ("src", "href", "action", "data", "poster", "srcset"):
            target = element.attributes.get(name)
            if target is not None and not target.startswith(("data:", "#")):
                assert (element.tag, name) == ("a", "href")
                assert "//" not in target or target.startswith("https://doi.org/")
        assert not any(name.startswith("on") or name == "style" for name in element.attributes)
    assert "@import" not in page.all("style")[0].text
    assert "url(" not in page.all("style")[0].text


def test_the_content_policy_lets_only_our_own_script_and_style_through(page: Page) -> None:
    (policy,) = (
        one.attributes["content"]
        for one in page.all("meta")
        if one.attributes.get("http-equiv") == "Content-Security-Policy"
    )
    assert policy.startswith("default-src 'none'; img-src data:;")
    for tag in ("script", "style"):
        (element,) = page.all(tag)
        digest = base64.b64encode(hashlib.sha256(element.text.encode()).digest()).decode()
        assert f"{tag}-src 'sha256-{digest}'" in policy


def test_the_page_can_be_read_without_seeing_it(page: Page) -> None:
    assert page.all("html")[0].attributes["lang"] == "en"
    assert page.all("title")[0].text
    identities = [one.attributes["id"] for one in page.elements if "id" in one.attributes]
    assert len(identities) == len(set(identities))
    levels = [int(one.tag[1]) for one in page.elements if one.tag in ("h1", "h2", "h3", "h4")]
    assert levels[0] == 1
    assert levels.count(1) == 1
    assert all(after <= before + 1 for before, after in pairwise(levels))
    assert all(len(image.attributes["alt"]) > 20 for image in page.all("img"))
    assert all("scope" in head.attributes for head in page.all("th"))
    assert len(page.all("caption")) == len(page.all("table")) > 2
    assert all(button.text.strip() for button in page.all("button"))
    for element in page.elements:
        if "aria-labelledby" in element.attributes:
            assert page.with_id(element.attributes["aria-labelledby"]).text
        if element.tag == "a" and element.attributes["href"].startswith("#"):
            assert page.with_id(element.attributes["href"][1:])
    assert len(page.all("main")) == len(page.all("nav")) == 1


def test_every_kind_of_figure_is_there(page: Page) -> None:
    images = page.all("img")
    assert len(images) == 13  # two portraits, two with energies, and nine others
    for image in images:
        head, _, body = image.attributes["src"].partition(";base64,")
        start = b"<?xml" if head.endswith("svg+xml") else b"\x89PNG"
        assert base64.b64decode(body).startswith(start)
        assert int(image.attributes["width"]) > 300


def test_letters_are_as_large_in_every_figure(tmp_path: Path) -> None:
    """A plan of velocities of one impact is half as wide as the others, and is shown so."""
    one = stored(tmp_path / "one", "horizontal_line_2_3")
    images = Page(report_html([one], tmp_path)).all("img")
    style = (files("vibro_cli.report") / "templates/report.css").read_text(encoding="utf-8")
    wide, half = (
        float(re.findall(rf"figure img{form} {{[^}}]*\bwidth: ([\d.]+)rem", style)[0])
        for form in ("", r"\.half")
    )
    scales = [
        (half if image.attributes.get("class") == "half" else wide)
        / float(image.attributes["width"])
        for image in images
    ]
    assert len({round(int(image.attributes["width"])) for image in images}) == 2
    assert max(scales) < 1.01 * min(scales)


def test_the_table_has_the_first_impacts_with_units(run: StoredRun, page: Page) -> None:
    heads = [head.text for head in page.all("button")]
    assert heads[:3] == ["n", "t [s]", "dt [s]"]
    assert "energy_loss [J]" in heads
    cells = [one for one in page.all("td") if "data-key" in one.attributes]
    rows = np.array([one.attributes["data-key"] for one in cells]).reshape(-1, len(heads))
    assert len(rows) == min(FIRST_ROWS, len(run.collisions["n"]))
    for name in ("t", "angle_a", "energy_loss"):
        column = next(place for place, head in enumerate(heads) if head.split(" ")[0] == name)
        assert [float(key) for key in rows[:, column]] == run.collisions[name][: len(rows)].tolist()
    assert rows[0, 2] == ""  # the first row has no row before


def test_the_link_leads_to_the_table(run: StoredRun, beside: Path, page: Page) -> None:
    (link,) = (one for one in page.all("a") if one.text == "collisions.parquet")
    assert run.folder is not None
    assert (beside / unquote(link.attributes["href"])).resolve() == (
        run.folder / "collisions.parquet"
    ).resolve()


def test_the_words_are_those_of_the_summary(run: StoredRun, page: Page) -> None:
    text = page.with_id("run1-result").text
    assert "The stop time was reached." in text
    assert f"Impacts{len(run.collisions['n'])}" in text
    assert dict(key_figures(run))["End"] == "60 s"
    assert "hold bodies back" in page.with_id("run1-validity").text
    assert "1.2.3" in page.all("footer")[0].text
    assert "matplotlib" in page.with_id("run1-versions").text


def test_the_jump_across_the_figure_eight_is_told(page: Page) -> None:
    """Ball 1 comes over the crest and stays: it must have jumped into a loop."""
    cells = [one.text for one in page.all("td") + page.all("th")]
    text = page.with_id("run1-sides").text
    assert "outside" in cells
    assert "right loop" in cells
    assert "figure eight" in text


def test_an_impact_that_did_not_take_place_is_no_jump(beside: Path) -> None:
    """The run ends at an inadmissible impact whose row says "outside" for a body in a loop."""
    overrides = ("balls[1].angle=-1.223", "balls[2].radius=0.06")
    ended = stored(beside / "refused", "three_arcs", *overrides)
    table = ended.collisions
    assert ended.summary["end_cause"] == "inadmissible"
    assert len(table["n"]) == 1
    assert (table["eight_b_pre"][0], table["eight_b_post"][0]) == ("right loop", "outside")
    final = ended.sample([ended.summary["end_time"]])
    before = [table["speed_a_pre"][0], table["speed_b_pre"][0]]
    assert final["speed"].tolist() == pytest.approx(before, rel=1e-13)
    page = Page(report_html([ended], beside))
    assert not [one for one in page.elements if one.attributes.get("id") == "run1-sides"]


def test_the_energies_balance(run: StoredRun) -> None:
    start, lost, rest, end = (float(text.split(" ")[0]) for _, text in _plain(run))
    assert start - lost - rest == pytest.approx(end, rel=1e-5)
    assert abs(rest) < 1e-6 * start


def _plain(run: StoredRun) -> list[tuple[str, str]]:
    digits = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹−", "-0123456789-")
    plain = []
    for label, value in energy_balance(run):
        text = value.translate(digits)
        plain.append((label, text.replace("·10", "e") if "·10" in text else text))
    return plain


def test_names_with_markup_do_no_harm(beside: Path) -> None:
    run = stored(beside / "<b onclick=x>", "one_circle", f"name={NASTY}", "stop.collisions=3")
    page = Page(report_html([run], beside))
    assert NASTY in page.all("h1")[0].text
    assert len(page.all("script")) == 1
    assert len(page.all("img")) == 13
    assert not page.all("b")
    assert not any("onerror" in one.attributes for one in page.elements)


def test_several_runs_are_compared(run: StoredRun, beside: Path) -> None:
    other = stored(beside / "other", "three_arcs", "collision.k=0.5", "name=softer")
    page = Page(report_html([run, other], beside))
    text = page.with_id("comparison").text
    assert "collision.k" in text
    assert "gravity" not in text  # the same in both
    heads = [one.text for one in page.all("th")]
    assert "softer" in heads
    assert len(page.all("article")) == 2
    regions = [one.attributes["aria-label"] for one in page.elements if one.attributes.get("role")]
    assert len(regions) == len(set(regions))
    assert len(page.all("img")) == 26


def test_runs_of_the_same_name_are_told_apart(beside: Path) -> None:
    runs = [stored(beside / name, "one_circle", "stop.collisions=2") for name in ("one", "two")]
    page = Page(report_html(runs, beside))
    heads = [one.text for one in page.all("h2")]
    assert len(heads) == len(set(heads))
    regions = [one.attributes["aria-label"] for one in page.elements if one.attributes.get("role")]
    assert len(regions) == len(set(regions))


def test_a_run_without_impacts_says_so(beside: Path) -> None:
    run = stored(beside / "alone", "lone_particle", "stop.time=1")
    page = Page(report_html([run], beside))
    assert "There was no impact." in page.with_id("run1-impacts").text


def test_a_body_at_rest_at_the_bottom_has_no_swing(beside: Path) -> None:
    run = stored(beside / "at the bottom", "three_arcs", "balls[2].angle=0", "stop.collisions=3")
    assert b"</html>" in report_html([run], beside)


def test_an_inadmissible_end_is_told(beside: Path) -> None:
    run = stored(beside / "through", "unequal_hedrih")
    page = Page(report_html([run], beside))
    assert "pass through one another" in page.with_id("run1-result").text
    assert "Inadmissible impacts: 1." in page.with_id("run1-validity").text


def test_equal_runs_give_equal_bytes(run: StoredRun, beside: Path, content: bytes) -> None:
    assert run.folder is not None
    assert report_html([open_run(run.folder)], beside) == content
    assert is_report(content)


def test_the_stored_run_moves_as_the_simulated_one(run: StoredRun) -> None:
    fresh = simulate(load_any(GALLERY / "three_arcs.toml"))
    for name, values in fresh.flights().items():
        np.testing.assert_array_equal(run.flights()[name], values)
    for mine, theirs in zip(run.flight_curve(5, 9), fresh.flight_curve(5, 9), strict=True):
        np.testing.assert_array_equal(mine, theirs)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, "–"),
        (math.nan, "–"),
        (0.5, "0.5 m"),
        (-1.5e-9, "−1.5·10⁻⁹ m"),
        (1e-16, "10⁻¹⁶ m"),
        (12, "12 m"),
        (True, "yes"),
        ("word", "word"),
    ],
)
def test_numbers_in_words(value: float | None, text: str) -> None:
    assert number(value, "m") == text


def test_degrees_stand_at_their_number(page: Page) -> None:
    assert number(-120.0, "°") == "−120°"
    (body,) = page.all("body")
    assert "−120°" in body.text
    assert " °" not in body.text


def test_colours_can_be_told_apart_in_light_and_dark() -> None:
    """Contrast of WCAG 2: at least 7 for text, 4.5 for links and secondary text."""
    style = (files("vibro_cli.report") / "templates" / "report.css").read_text()
    themes = re.findall(r":root \{(.*?)\}", style, re.DOTALL)
    assert len(themes) == 3  # light, dark, paper
    for theme in themes:
        colour = dict(re.findall(r"--(\w+): (#[0-9a-f]{6})", theme))
        for ground in (colour["ground"], colour["panel"]):
            assert contrast(colour["text"], ground) >= 7.0
            assert contrast(colour["soft"], ground) >= 4.5
            assert contrast(colour["link"], ground) >= 4.5


def contrast(one: str, other: str) -> float:
    light, dark = sorted((luminance(one), luminance(other)), reverse=True)
    return (light + 0.05) / (dark + 0.05)


def luminance(colour: str) -> float:
    parts = [int(colour[at : at + 2], 16) / 255 for at in (1, 3, 5)]
    linear = [
        part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts
    ]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def test_impacts_that_are_solved_jointly_stand_in_no_form_of_two_bodies() -> None:
    """A ball hits two at once, then one of these a fourth: a pair alone would have other speeds."""
    places = ((-1.0, 0.0, 1.0), (0.0, 0.1, 0.0), (0.0, -0.1, 0.0), (0.6, 0.45, 0.0))
    balls = [
        {"radius": 0.1, "mass": 1.0, "x": x, "y": y, "velocity_x": speed} for x, y, speed in places
    ]
    document: dict[str, Any] = {
        "system": "table",
        "balls": balls,
        "collision": {"k": 1.0},
        "stop": {"time": 3.0},
    }
    run = simulate(any_scenario_of(document))
    assert list(run.collisions["n"]) == [1, 2, 3]
    _, first = forms(run.system, run.collisions, 0)
    assert abs(first.after[1] * 0.1 - run.collisions["normal_speed_b_post"][0]) > 0.1
    told = analogy(run.system, run.collisions)
    assert told is not None
    assert told["impact"] == "3"
    assert [row[0] for row in told["every"]] == ["3"]
    _, third = forms(run.system, run.collisions, 2)
    after = [run.collisions[f"normal_speed_{end}_post"][2] for end in "ab"]
    assert [0.1 * value for value in third.after] == pytest.approx(after, abs=1e-15)


def test_the_first_impact_stands_in_both_forms(run: StoredRun, page: Page) -> None:
    """The run used the form of rolling: its impulse, loss and velocities are those of the table."""
    table = run.collisions
    _, rolling = forms(run.system, run.collisions, 0)
    after = table["omega_a_post"][0], table["omega_b_post"][0]
    assert rolling.after == pytest.approx(after, rel=1e-12)
    assert rolling.impulse == pytest.approx(table["impulse_moment"][0], rel=1e-12)
    assert rolling.loss == pytest.approx(table["energy_loss"][0], rel=1e-10)
    text = page.with_id("run1-analogy").text
    assert "The run used the form for rolling." in text
    assert text.count(number(rolling.loss, "J")) == 3  # directly, by Carnot, and of all impacts
    assert "left body first" in text
    assert "along the line of centres" not in text


def test_a_skew_impact_stands_in_both_forms_with_its_normal_parts(tmp_path: Path) -> None:
    """The forms use normal components: the tangential ones are conserved."""
    scenario = load_any(GALLERY / "table/skew_impact.toml", ["balls[1].y=0.08"])
    write_run(simulate(scenario), scenario, tmp_path / "run", {})
    page = Page(report_html([open_run(tmp_path / "run")], tmp_path))
    text = page.with_id("run1-analogy").text
    assert "All values are those of the velocity components along the line of centres" in text
    assert "body a first" in text


def test_a_system_of_no_paper_needs_no_forms_of_the_papers(
    run: StoredRun, beside: Path, content: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nor the columns and the restitution that the forms use."""
    monkeypatch.setattr(type(run.kind), "papers", ())
    monkeypatch.setattr("vibro_cli.report.papers.forms", None)
    assert b'id="run1-analogy"' not in report_html([run], beside)
    assert b'id="run1-analogy"' in content


def drawn_line(width: float) -> Drawn:
    figure = Figure(figsize=(width, 2.0))
    figure.subplots().plot(np.arange(1000.0))
    return Drawn("name", "Title", "Caption.", figure)


def test_points_of_a_picture_are_freed_at_once() -> None:
    """A collection of garbage comes late, as many points are one object."""
    gc.disable()
    try:
        drawn = [drawn_line(3.0), drawn_line(2.0)]
        lines = [one.figure.axes[0].lines[0] for one in drawn]
        points = [weakref.ref(line.get_ydata(orig=True)) for line in lines]
        lines.clear()
        assert all(one() is not None for one in points)
        picture = pictured(drawn.pop(0), drawn.pop(0), "run")
        assert all(one() is None for one in points)
    finally:
        gc.enable()
    assert (picture["wide"]["width"], picture["narrow"]["width"]) == ("288", "192")
