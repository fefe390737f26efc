"""Figures as files: the same bytes, the right size, fonts that journals take."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from threading import Event, Thread

import matplotlib
import pytest
from matplotlib.figure import Figure

from tests.figures.runs import on_circle, on_three_arcs
from vibro_cli.figures.portraits.portrait import phase_portrait
from vibro_cli.figures.style import FORMATS, journal, render
from vibro_cli.interface import Drawing

pytestmark = pytest.mark.long


def png_size(content: bytes) -> tuple[int, int]:
    """Return width and height from the header of a PNG."""
    return int.from_bytes(content[16:20], "big"), int.from_bytes(content[20:24], "big")


@pytest.mark.parametrize("form", FORMATS)
@pytest.mark.parametrize("impacts", [3, 200])
def test_same_run_gives_the_same_bytes(form: str, impacts: int) -> None:
    contents = {render(phase_portrait(on_circle(impacts), 1), form) for _ in range(2)}
    assert len(contents) == 1


@pytest.mark.parametrize("form", FORMATS)
def test_the_readers_own_settings_change_nothing(form: str) -> None:
    expected = render(phase_portrait(on_three_arcs(), 1), form)
    with matplotlib.rc_context({"font.size": 20.0, "axes.facecolor": "red", "savefig.dpi": 50.0}):
        assert render(phase_portrait(on_three_arcs(), 1), form) == expected
        assert matplotlib.rcParams["font.size"] == 20.0  # and are left as they were


def test_threads_leave_the_readers_settings_as_they_were() -> None:
    before = dict(matplotlib.rcParams)
    begun, go = Event(), Event()

    def draw() -> None:
        with journal():
            begun.set()
            go.wait()

    other = Thread(target=draw)
    with journal():
        other.start()
        begun.wait(0.2)  # were it let in, it would restore the settings of this one
    go.set()
    other.join()
    assert dict(matplotlib.rcParams) == before


@pytest.mark.parametrize(("width", "millimetres"), [("single", 85), ("double", 170)])
def test_widths_are_those_of_journals(width: str, millimetres: int) -> None:
    content = render(phase_portrait(on_three_arcs(), 1, width), "png")
    assert png_size(content)[0] == pytest.approx(millimetres / 25.4 * 300, abs=1.0)


def test_pdf_has_truetype_fonts_and_no_date() -> None:
    content = render(phase_portrait(on_three_arcs(), 1), "pdf")
    assert b"/CIDFontType2" in content or b"/TrueType" in content
    assert b"/Type3" not in content
    assert b"CreationDate" not in content


def test_svg_has_no_date() -> None:
    assert b"<dc:date>" not in render(phase_portrait(on_three_arcs(), 1), "svg")


def test_files_are_written_as_they_are_named(tmp_path: Path) -> None:
    figure = phase_portrait(on_three_arcs(), 1)
    names = ["portrait_1.5.PNG", "portrait_1.5.svg"]
    paths = [Drawing("portrait_1", figure).save(tmp_path / name) for name in names]
    assert [path.name for path in paths] == names
    assert paths[0].read_bytes() == render(figure, "png")
    assert sorted(path.name for path in tmp_path.iterdir()) == names


def test_unknown_format_is_refused() -> None:
    with pytest.raises(ValueError, match="bmp"):
        render(Figure(), "bmp")


def test_pyplot_is_not_imported() -> None:
    code = (
        "import sys, vibro_cli.figures.portraits.portrait, vibro_cli.figures.style;"
        "sys.exit('matplotlib.pyplot' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
