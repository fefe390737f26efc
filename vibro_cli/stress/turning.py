"""Traces that turn about a vertical axis: first impacts in 50 digits, energy, lasting contact."""

from __future__ import annotations

import json

from vibro_cli.api import simulate
from vibro_cli.scenario import parse_scenario
from vibro_cli.simulation.run import Run
from vibro_cli.stress.finding import Document, Finding, Plan, Worst
from vibro_cli.stress.highprecision.quantities import solved
from vibro_cli.stress.highprecision.scene import scene_of_system
from vibro_cli.stress.highprecision.twin import Twin, happenings_of

CHECK = "turning"
_VALLEY: Document = {"shape": "valley", "radius": 1.0, "end_slope": "90 deg"}
_ARCS: list[Document] = [
    {"shape": "valley", "radius": 1.0, "end_slope": "50 deg"},
    {"shape": "hump", "radius": 0.5, "end_slope": "-50 deg"},
    _VALLEY,
]


def check(plan: Plan) -> list[Finding]:
    """Times of the first impacts, drift of energy at k = 1, balance of lasting contact."""
    return [_first_impacts(), _energy(plan), _balance()]


def solve(document: Document, engine: str = "compiled") -> Run:
    """Run a document."""
    return simulate(parse_scenario(json.dumps(document), "json"), engine)


def _document(on_axis: bool, rate: float, k: float, law: str, **stop: float) -> Document:
    """Two balls in a valley on its axis, or on three arcs about the axis of the hump."""
    ball: Document = {"radius": 0.1, "density": 7800.0}
    balls = [
        {**ball, "arc": 1, "angle": "-75 deg", "rate": 0.0 if on_axis else -5.0},
        {**ball, "arc": 1 if on_axis else 3, "angle": "60 deg", "rate": 0.0 if on_axis else 5.0},
    ]
    turning = {"through_arc": 1 if on_axis else 2, "rate": rate}
    return {
        "gravity": 9.81, "balls": balls, "collision": {"law": law, "k": k}, "stop": stop,
        "trace": {
            "start_slope": "-90 deg", "turning": turning, "arcs": [_VALLEY] if on_axis else _ARCS,
        },
        "ends": {"left": {"wall": 1.0}, "right": {"wall": 1.0}},
    }  # fmt: skip


def _first_impacts() -> Finding:
    worst = Worst()
    for on_axis, rate in ((True, 1.7), (True, 3.6), (False, 0.8), (False, 1.2)):
        document = _document(on_axis, rate, 0.95, "hedrih", collisions=10)
        run = solve(document)
        impacts = Twin(scene_of_system(run.system)).follow(happenings_of(run))
        for row, impact in enumerate(impacts):
            worst.take(float(abs(solved(run, "t", row) / impact.t - 1)), document)
    return worst.finding(
        CHECK,
        "relative error of the time of an impact",
        "first 10 impacts, circle and three arcs",
        1e-12,
    )


def _energy(plan: Plan) -> Finding:
    impacts = plan.amount(1_000, 100_000)
    worst = Worst()
    document = _document(True, 2.5, 1.0, "hedrih", collisions=impacts)
    worst.take(abs(solve(document).summary_record()["energy_drift"]), document)
    return worst.finding(
        CHECK, "relative drift of energy", f"k = 1, circle, {impacts} impacts", 1e-12
    )


def _balance() -> Finding:
    worst = Worst()
    for on_axis in (True, False):
        document = _document(on_axis, 1.2, 0.4, "normal-impulse", time=25.0)
        run = solve(document)
        record = run.summary_record()
        lost = record["energy_start"] - float(run.collisions["energy_loss"].sum())
        worst.take(abs(record["energy_end"] - lost) / record["energy_start"], document)
    return worst.finding(
        CHECK, "energy missing in the balance (relative)", "k = 0.4, into lasting contact", 1e-11
    )
