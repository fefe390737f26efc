"""The page of a benchmark and its figures: run time against error, growth of the cost."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vibro_cli.benchmark.conclusions import conclude
from vibro_cli.benchmark.measurement import Row
from vibro_cli.benchmark.scenes import BY_NAME, SCENES
from vibro_cli.errors import NothingToShow
from vibro_cli.figures import style
from vibro_cli.figures.chart import Cell, in_rows
from vibro_cli.figures.labels import LINE, draw_legend, rows_of
from vibro_cli.figures.style import width_of
from vibro_cli.report.html import rendered, shown

_METHOD = (
    "Every timing is the median over repeats, with the methods taking turns within one run; what a "
    "library can prepare once (compiling, building integrators, making records) is not timed. The "
    "error is the greatest relative error in the times of the first impacts, compared with a "
    "Taylor integration of the same doubles in 50 digits. A method whose impacts differ from those "
    "of the motion counts as lost. Times are wall-clock times of one thread, except for batches.",
    "heyoka: F. Biscani, D. Izzo, MNRAS 504 (2021) 2614. diffrax: P. Kidger, thesis, Oxford 2021.",
    "CyRK: J. P. Renaud. SciPy: P. Virtanen et al., Nature Methods 17 (2020) 261.",
)
_HEADS = ["Method", "Setting", "Time per impact [µs]", "Spread", "Error", "Energy drift",
          "Impacts timed", "Status"]  # fmt: skip


def benchmark_html(
    rows: Sequence[Row], details: Mapping[str, Any], wide: Mapping[str, Figure]
) -> bytes:
    """Return the page of a benchmark as the bytes of a self-contained HTML file.

    `wide` are its figures, two columns wide, as returned by :func:`drawn`.
    """
    narrow = drawn(rows, "single")
    figures = [
        shown(title, caption, title, wide[name], narrow[name])
        for name, (title, caption, _) in _FIGURES.items()
        if name in wide
    ]
    tables = [(scene.title, _precision(rows, scene.name)) for scene in SCENES]
    values = {
        "title": "Benchmark",
        "method": _METHOD,
        "conclusions": conclude(rows),
        "figures": figures,
        "heads": _HEADS,
        "scenes": [(title, lines) for title, lines in tables if lines],
        "further": [_further(row) for row in rows if row.part != "precision"],
        "machine": list(details["machine"].items()),
        "plan": details["plan"],
    }  # fmt: skip
    return rendered("benchmark", values)


def _precision(rows: Sequence[Row], scene: str) -> list[list[str]]:
    return [
        [
            row.method, row.setting,
            _shown(None if row.per_impact is None else row.per_impact * 1e6, "{:.3g}"),
            _shown(None if row.spread is None else 100.0 * row.spread, "{:.0f} %"),
            _shown(row.error, "{:.1e}"), _shown(row.energy_drift, "{:.1e}"),
            f"{row.impacts:,}" if row.impacts else "–",
            row.status if row.note is None else f"{row.status}: {row.note}",
        ]
        for row in rows
        if row.part == "precision" and row.scene == scene
    ]  # fmt: skip


def _further(row: Row) -> list[str]:
    return [
        row.part, row.method if not row.setting else f"{row.method}: {row.setting}", row.scene,
        "–" if row.size is None else f"{row.size:,}",
        _shown(None if row.per_impact is None else row.per_impact * 1e6, "{:.3g}"),
        _shown(row.seconds, "{:.3g}"),
        _shown(None if row.memory is None else row.memory / 2**20, "{:.0f}"),
        row.status if row.note is None else f"{row.status}: {row.note}",
    ]  # fmt: skip


def _shown(value: float | None, form: str) -> str:
    return "–" if value is None else form.format(value).replace("-", "−")


_LEFT, _RIGHT, _BETWEEN, _BOTTOM, _TITLE = 12.0, 2.5, 4.0, 9.0, 5.0
_HIGH = {"double": 42.0, "single": 40.0}
_COLUMNS = {"double": 3, "single": 1}
_LEAST = 1e-17
"""Errors below this, and exact results, are drawn at this value."""
_LOOKS: dict[str, dict[str, Any]] = {
    "vibro": {"color": style.BLUE, "marker": "*", "markersize": 8.0},
    "vibro, batch": {"color": style.BLUE, "marker": "p", "markerfacecolor": "white"},
    "vibro, all rows kept": {"color": style.BLUE, "marker": "h"},
    "vibro, interpreted": {"color": style.SKY, "marker": "*", "markersize": 6.5},
    "heyoka": {"color": style.VERMILLION, "marker": "s"},
    "heyoka, defaults": {"color": style.VERMILLION, "marker": "s", "markerfacecolor": "white"},
    "heyoka, batch": {"color": style.VERMILLION, "marker": "P"},
    "diffrax Tsit5": {"color": style.GREEN, "marker": "^"},
    "CyRK DOP853": {"color": style.ORANGE, "marker": "D"},
    "SciPy RK45": {"color": style.SEPARATRIX_GREY, "marker": "v"},
    "SciPy DOP853": {"color": style.BLACK, "marker": "o"},
    "SciPy LSODA": {"color": style.SEPARATRIX_GREY, "marker": "<", "markerfacecolor": "white"},
    "SciPy Radau": {"color": style.SEPARATRIX_GREY, "marker": ">", "markerfacecolor": "white"},
    "series of the papers": {"color": style.PURPLE, "marker": "X"},
}
_LINE: dict[str, Any] = {"linewidth": 0.7, "markersize": 3.6, "markeredgewidth": 0.7}
# Half the height of a mark, with some room, in powers of ten on the time axis.
_MARK = 0.12
_GROWTH = {
    "bodies": "number of bodies",
    "arcs": "number of arcs (the bodies reach 3)",
    "scenarios": "number of scenarios",
    "cores": "number of threads",
}


def look(method: str) -> dict[str, Any]:
    """Return the colour and mark of a method."""
    return _LINE | _LOOKS.get(method, {"color": style.SEPARATRIX_GREY, "marker": "."})


def work_precision(rows: Sequence[Row], width: str = "double") -> Figure:
    """Draw time per impact against error, with a panel for each scene.

    `width` is `single` or `double`. Raises ``NothingToShow`` if there is no row to draw.
    """
    drawn = [
        row for row in rows if row.part == "precision" and row.per_impact and row.error is not None
    ]
    if not drawn:
        raise NothingToShow("no method got through any scene: there is nothing to draw")
    scenes = list(dict.fromkeys(row.scene for row in drawn))
    methods = list(dict.fromkeys(row.method for row in drawn))
    legend = rows_of([(method, look(method)) for method in methods], width_of(width))
    with style.journal():
        columns = min(_COLUMNS[width], len(scenes))
        heights = _TITLE, _HIGH[width], _BETWEEN
        figure, axes = _sheet(len(scenes), width, columns, heights, 1.5 + LINE * len(legend))
        powers = [math.log10(row.per_impact * 1e6) for row in drawn if row.per_impact]
        low, high = min(powers) - _MARK, max(powers) + _MARK
        ends = 10.0 ** math.floor(low), 10.0 ** math.ceil(high)
        for number, (scene, panel) in enumerate(zip(scenes, axes, strict=True)):
            _draw(panel, [row for row in drawn if row.scene == scene], methods)
            panel.set_ylim(*ends)
            panel.set_title(BY_NAME[scene].title, loc="left", pad=2.5)
            first = number % columns == 0
            panel.set_ylabel("time per impact [µs]" if first else "")
            panel.tick_params(labelleft=first)
            panel.set_xlabel("relative error of the times")
        draw_legend(figure, legend)
    return figure


def _sheet(
    count: int, width: str, columns: int, heights: tuple[float, float, float], top: float = 0.0
) -> tuple[Figure, list[Axes]]:
    """Return a figure with panels in rows.

    `heights` are the room above a panel, the height of a panel and the room between two neighbours
    (mm); `top` is the room above all panels.
    """
    above, high, gap = heights
    wide = width_of(width)
    inner = (wide - _LEFT - _RIGHT - (columns - 1) * gap) / columns
    cell = Cell(inner, high, above, _BOTTOM, gap)
    sheet, corners = in_rows(cell, count, columns, wide, _LEFT, top)
    return sheet.figure, [sheet.panel(*corner, inner, high) for corner in corners]


def _draw(panel: Axes, rows: Sequence[Row], methods: Sequence[str]) -> None:
    panel.set_xscale("log")
    panel.set_yscale("log")
    panel.set_xlim(_LEAST, 3.0)
    panel.set_xticks([10.0**power for power in (-16, -12, -8, -4, 0)])
    panel.minorticks_off()
    panel.grid(True, color=style.BAND_GREY, linewidth=0.4)
    panel.set_axisbelow(True)
    for method in methods:
        own = [row for row in rows if row.method == method]
        own.sort(key=lambda row: row.error or 0.0)
        places = [max(row.error or 0.0, _LEAST) for row in own]
        times = [(row.per_impact or math.nan) * 1e6 for row in own]
        panel.plot(places, times, **look(method))


def growth(rows: Sequence[Row], width: str = "double") -> Figure:
    """Draw time per impact against the numbers of bodies, arcs, scenarios and threads.

    Raises ``NothingToShow`` if there is no row to draw.
    """
    measured = {
        part: [row for row in rows if row.part == part and row.per_impact] for part in _GROWTH
    }
    parts = {part: own for part, own in measured.items() if own}
    if not parts:
        raise NothingToShow("no growth was measured: there is nothing to draw")
    with style.journal():
        columns = len(parts) if width == "double" else 1
        figure, axes = _sheet(len(parts), width, columns, (2.5, 34.0, 9.0))
        for (part, own), panel in zip(parts.items(), axes, strict=True):
            sizes = [row.size or 0 for row in own]
            times = [(row.per_impact or math.nan) * 1e6 for row in own]
            panel.plot(sizes, times, **look(own[0].method))
            panel.set_xscale("log")
            panel.set_ylim(0.0, 1.25 * max(times))
            panel.set_xlabel(_GROWTH[part])
            panel.minorticks_off()
            if part != "scenarios":
                panel.set_xticks(sizes, [str(size) for size in sizes])
            panel.margins(x=0.12)
        for panel in axes if width == "single" else axes[:1]:
            panel.set_ylabel("time per impact [µs]")
    return figure


_FIGURES = {
    "work_precision": (
        "Run time against error",
        "One mark for each setting and one panel for each scene; lower and further left is better. "
        "Lost runs are not drawn.",
        work_precision,
    ),
    "growth": (
        "Growth of the cost",
        "Compiled solver, on one thread except in the panel over the number of threads.",
        growth,
    ),
}


def drawn(rows: Sequence[Row], width: str = "double") -> dict[str, Figure]:
    """Return the figures by the stems of their files; there is no growth if scenes were named."""
    figures = {}
    for name, (_, _, draw) in _FIGURES.items():
        with contextlib.suppress(NothingToShow):
            figures[name] = draw(rows, width)
    return figures
