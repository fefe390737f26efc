"""The figures, the words and the page of a benchmark, from rows made by hand."""

from __future__ import annotations

import pytest

from tests.report.page_parser import Page
from vibro_cli.benchmark.conclusions import conclude
from vibro_cli.benchmark.measurement import Row
from vibro_cli.report import html
from vibro_cli.report.benchmark_page import benchmark_html, drawn, growth, work_precision


def timed(method: str, setting: str, microseconds: float, error: float) -> Row:
    made = Row("precision", "circle", method, setting, impacts=100, compared=10, error=error)
    made.take_times([microseconds * 1e-4])
    return made


def sized(part: str, size: int, microseconds: float) -> Row:
    made = Row(part, "circle", "vibro", size=size, impacts=100)
    made.take_times([microseconds * 1e-4])
    return made


def grid(method: str, setting: str, microseconds: float) -> Row:
    made = Row("grid", "circle", method, setting, size=10_000, impacts=100)
    made.take_times([microseconds * 1e-4])
    return made


def kept(method: str, microseconds: float) -> Row:
    made = Row("kept", "three_arcs", method, "every impact", size=1_000_000, impacts=100)
    made.take_times([microseconds * 1e-4])
    return made


def command(method: str, impacts: int, seconds: float) -> Row:
    made = Row("command", "circle", method, size=impacts, impacts=impacts, memory=200 * 2**20)
    made.take_times([seconds])
    return made


ROWS = [
    timed("vibro", "exact", 0.5, 2e-16),
    timed("series of the papers", "order 2", 150.0, 0.26),
    timed("series of the papers", "order 128", 1500.0, 0.039),
    timed("heyoka", "1e-16", 5.0, 3e-16),
    timed("heyoka", "1e-09", 4.0, 1e-12),
    Row("precision", "circle", "SciPy RK45", "0.0001", error=3.0, status="lost", note="astray"),
    sized("arcs", 3, 1.0), sized("arcs", 10, 1.02), sized("arcs", 30, 1.05),
    sized("bodies", 2, 1.0), sized("bodies", 20, 3.0),
    sized("cores", 1, 1.0), sized("cores", 2, 0.52),
    Row("skips", "circle", "rows", "skipped", seconds=1.0),
    Row("skips", "circle", "rows", "not skipped", seconds=1.5),
    grid("vibro, batch", "exact", 0.3), grid("heyoka, batch", "1e-16", 3.0),
    kept("kernel alone", 1.5), kept("grid on the disk", 2.4),
    Row("memory", "circle", "vibro grid", size=1000, memory=300 * 2**20),
    command("event loop alone", 1000, 0.001), command("vibro run", 1000, 0.5),
    command("event loop alone", 101_000, 0.051), command("vibro run", 101_000, 0.8),
]  # fmt: skip


@pytest.mark.parametrize(
    "text",
    [
        "takes 0.5 µs for an impact",
        "heyoka (1e-16), errs by 3.0e-16 and takes 10.0 times as long",
        "heyoka (1e-09), errs by 1.0e-12 and takes 8.0 times as long",
        "64 times the order gains a factor of 6.7",
        "SciPy RK45 0.0001",
        "from 3 to 30 arcs of which 3 are reached: flat within ±2 %",
        "a factor of 3.0",
        "2 threads solve a batch 1.92 times as fast as one",
        "Without skipping rows, on two balls in one circle, a run takes 1.50 times",
        "300 MiB for 1,000",
        "vibro run, circle: 0.50 s for 1,000 impacts, and 3 µs for each of the next 100,000, 6.0 "
        "times the 0.5 µs of the event loop alone; at most 200 MiB.",
        "A grid of 1,000,000 scenarios on three arcs, with crossings, every impact: 2.4 µs for an "
        "impact from end to end, 62 % of the rate of its kernel alone.",
        "10,000 scenarios on all cores, summaries only: 0.3 µs for an impact; heyoka, batch "
        "(1e-16) takes 10.0 times as long",
    ],
)
def test_words_follow_from_the_numbers(text: str) -> None:
    assert text in " ".join(conclude(ROWS))


def test_what_was_lost_is_not_drawn() -> None:
    figure = work_precision(ROWS)
    assert len(figure.axes[0].lines) == 3


def test_a_mark_near_the_end_of_the_axis_is_drawn_whole() -> None:
    panel = work_precision([timed("vibro", "exact", 0.102, 2e-16), *ROWS[1:5]]).axes[0]
    assert panel.get_ylim() == (0.01, 1e4)


def test_growth_has_a_panel_for_each_part() -> None:
    assert len(growth(ROWS).axes) == 3
    with pytest.raises(ValueError, match="nothing to draw"):
        growth(ROWS[:5])


def test_the_page_says_all_of_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(html, "__version__", "1.2.3")
    details = {"machine": {"Processor": "a processor"}, "plan": "quick"}
    page = Page(benchmark_html(ROWS, details, drawn(ROWS)))
    assert page.all("title")[0].text == "Benchmark · vibro bench"
    said = " ".join(element.text for element in page.elements)
    for text in ("a processor", "lost: astray", "2.6e−01", "arcs", "1.2.3", "the root diverges"):
        assert text in said


def test_a_part_of_the_growth_that_was_lost_is_not_drawn() -> None:
    lost = Row("arcs", "3 arcs", "vibro", size=3, status="lost", note="the run ended")
    figure = growth([sized("bodies", 2, 1.0), sized("bodies", 5, 1.5), lost])
    assert [axes.get_xlabel() for axes in figure.axes] == ["number of bodies"]
    with pytest.raises(ValueError, match="no growth was measured"):
        growth([lost])
