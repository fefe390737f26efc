"""The page of a benchmark: conclusions in words, figures, the whole table, machine and versions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from vibro_cli.benchmark.conclusions import conclude
from vibro_cli.benchmark.measurement import Row
from vibro_cli.benchmark.scenes import SCENES
from vibro_cli.figures.over_axis import NothingToShow
from vibro_cli.figures.work_precision import growth, work_precision
from vibro_cli.report.html import rendered, shown

GENERATOR = "vibro bench"
_METHOD = (
    "Every timing is the median over repeats, the methods by turns within one run; what a library "
    "can prepare once (compiling, building integrators, making records) is not timed. The error "
    "is the greatest relative error among the times of the first impacts, against a Taylor "
    "integration in 50 digits of the same doubles. A method whose impacts are not those of the "
    "motion counts as lost. Times are wall-clock times of one thread, batches apart.",
    "heyoka: F. Biscani, D. Izzo, MNRAS 504 (2021) 2614. diffrax: P. Kidger, thesis, Oxford 2021.",
    "CyRK: J. P. Renaud. SciPy: P. Virtanen et al., Nature Methods 17 (2020) 261.",
)
_HEADS = ["Method", "Setting", "Time per impact [µs]", "Spread", "Error", "Energy drift",
          "Impacts timed", "Status"]  # fmt: skip


def benchmark_html(rows: Sequence[Row], details: Mapping[str, Any], version: str) -> bytes:
    """Return the page of a benchmark as the bytes of an HTML file that needs no other."""
    figures = []
    for title, caption, draw in (
        ("Run time against error", "Lower and further left is better; one mark for each setting, "
         "a panel for each scene. What a method lost is not drawn.", work_precision),
        ("Growth of the cost", "Compiled; one thread but where threads are counted.", growth),
    ):  # fmt: skip
        try:
            wide, narrow = draw(rows, "double"), draw(rows, "single")
        except NothingToShow:
            continue  # a benchmark of some scenes only has no such part
        figures.append(shown(title, caption, title, wide, narrow))
    tables = [(scene.title, _precision(rows, scene.name)) for scene in SCENES]
    values = {
        "title": "Benchmark",
        "version": version,
        "generator": GENERATOR,
        "method": _METHOD,
        "conclusions": conclude(rows),
        "figures": figures,
        "heads": _HEADS,
        "scenes": [(title, lines) for title, lines in tables if lines],
        "further": [_further(row) for row in rows if row.part != "precision"],
        "machine": list(details["machine"].items()),
        "plan": details["plan"],
    }  # fmt: skip
    return rendered("benchmark", values, assets="report")


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
