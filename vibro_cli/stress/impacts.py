"""Instants and places of impacts, and of what ends a single flight, against the twin in 50 digits.

The twin is told which events happen and computes every one of them anew from the very doubles that
the solver starts from; it refuses a history in which bodies overlap or leave their pieces.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from vibro_cli.mechanics.system import InitialState, System
from vibro_cli.simulation.run import Run, simulate_system
from vibro_cli.stress.finding import Document, Finding, Plan, Worst
from vibro_cli.stress.highprecision.quantities import PLACES, TIME, columns, solved
from vibro_cli.stress.highprecision.scene import scene_of_system
from vibro_cli.stress.highprecision.sensitivity import amplification
from vibro_cli.stress.highprecision.taylor import mp
from vibro_cli.stress.highprecision.twin import Happening, Impact, Twin, happenings_of, in_contact
from vibro_cli.stress.scenes import CIRCLE, THREE_ARCS, VALLEY, ball, scene, system_of

CHECK = "impacts"
EPSILON = 2.0**-52
FIRST = 10
LONGEST = 30.0  # s
# Where a unit in the last place of a start moves the end by more than this part of a flight, the
# states taken up again, rounded to doubles, do not hold the flight to its mark.
RESOLVED = 2.5e-14
# What the response to a change of an input may be for it to be a linear one.
MOST_AMPLIFIED = 1.0e6
LINE_BETWEEN: Document = {
    "start_slope": "-120 deg",
    "arcs": [
        {"shape": "valley", "radius": 0.8, "end_slope": "0 deg"},
        {"shape": "line", "length": 1.5},
        {"shape": "valley", "radius": 1.0, "end_slope": "120 deg"},
    ],
}


def check(plan: Plan) -> list[Finding]:
    """The first impacts of many scenes, and every flight of them on its own."""
    rng = np.random.default_rng([plan.seed, 29])
    whole, single, unresolved = Worst(), Worst(), Worst()
    for document, run, grown in _scenes(rng, plan.amount(4, 100)):
        twin, exact, last = Twin(scene_of_system(run.system)), [], None
        for happening in happenings_of(run):
            flight = _Flight(run.system, twin, happening, last)
            last = happening
            exact += twin.follow([happening])
            error, resolution = flight.error_and_resolution()
            if resolution <= RESOLVED:
                single.take(error, _as_document(document, flight.system))
            else:
                unresolved.take(error / resolution, _as_document(document, flight.system))
        whole.take(_error(run, grown, exact), document)
    tried = "2 and 3 bodies on a circle, a valley, three arcs, a line between valleys; 50 digits"
    again = "taken up from reference states"
    findings = [
        whole.finding(
            CHECK,
            f"error of the first {FIRST} impacts / (eps x amplification)",
            f"{tried}; times and places",
            64.0,
        ),
        single.finding(
            CHECK, "error of the end of a single flight / its length", f"{tried}; {again}", 1e-13
        ),
    ]
    if unresolved.cases:
        findings.append(
            unresolved.finding(
                CHECK,
                "error of the end of a single flight / (eps x amplification)",
                f"{again}; flights so short that a unit in the last place of these moves their end"
                f" by more than {RESOLVED:g} of their length",
                64.0,
            )
        )
    return findings


def _scenes(
    rng: np.random.Generator, count: int
) -> Iterator[tuple[Document, Run, dict[str, list[float]]]]:
    """Scenes with ten ordinary impacts each, their runs, and how much a change of an input grows.

    Joint impacts and lasting contact are drawn again.
    """
    found = 0
    while found < count:
        document = _scene(rng, found)
        run = _solve(system_of(document))
        kinds = set(run.events["event"].tolist())
        joint = bool(run.collisions["simultaneous"].any())
        if len(run.collisions["n"]) < FIRST or joint or "contact_closed" in kinds:
            continue
        grown = _amplified(run)
        if max(grown["t"]) > MOST_AMPLIFIED:
            continue
        found += 1
        yield document, run, grown


def _scene(rng: np.random.Generator, number: int) -> Document:
    bodies = 2 + number // 4 % 2
    trace = (CIRCLE, VALLEY, THREE_ARCS, LINE_BETWEEN)[number % 4]
    arcs = len(trace["arcs"])
    edges = np.linspace(-1.3, 1.3, bodies + 1)
    balls = []
    for n in range(bodies):
        place = float(rng.uniform(edges[n] + 0.15, edges[n + 1] - 0.15))
        own: Document = {"mass": float(rng.uniform(0.3, 3.0)), "body": str(rng.choice(KINDS))}
        own["speed"] = float(rng.normal(0.0, 1.0))
        if arcs > 1:
            # The first body on the first piece, the others one after another on the last.
            own["arc"] = 1 if n == 0 else arcs
            place = float(rng.uniform(-1.4, -0.2)) if n == 0 else 0.5 * n + 0.1 * place
        balls.append(ball(place, radius=float(rng.uniform(0.05, 0.1)), **own))
    k, law = float(rng.choice([1.0, 0.9, 0.6])), str(rng.choice(["hedrih", "normal-impulse"]))
    document = scene(trace, balls, k, law, collisions=FIRST, time=LONGEST)
    document["collision"]["inadmissible"] = "normal-impulse"
    return document


KINDS = ("ball", "disk", "hollow_ball", "hoop")


def _solve(system: System) -> Run:
    return simulate_system(system, LONGEST, FIRST, "python")


def _amplified(run: Run) -> dict[str, list[float]]:
    try:
        return amplification(run.system, lambda changed: columns(_solve(changed)))
    except ArithmeticError:
        return {"t": [np.inf]}


def _error(run: Run, grown: dict[str, list[float]], exact: list[Impact]) -> float:
    """Greatest error of an instant or a place, in eps x the amplification of a change."""
    worst = 0.0
    for quantity, (_, value) in {**TIME, **PLACES}.items():
        for row, impact in enumerate(exact):
            off = float(abs(solved(run, quantity, row) - value(impact)))
            worst = max(worst, off / (EPSILON * grown[quantity][row]))
    return worst


class _Flight:
    """The time from one event to the next, begun anew from the twin's states, in doubles.

    Two bodies that have just hit one another are in contact: the left one is where its double says,
    the right one where it touches, which the doubles nearest to both places stand for.
    """

    def __init__(
        self, system: System, twin: Twin, event: Happening, last: Happening | None
    ) -> None:
        places = [twin.at(number, twin.t) for number in range(len(system.bodies))]
        states = [InitialState(now.piece, float(now.place), float(now.speed)) for now in places]
        self.system = replace(system, initial=tuple(states))
        self.event = event._replace(t=float(mp.mpf(event.t) - twin.t))
        scene = scene_of_system(self.system)
        self.bounces = False
        if last is not None and last.kind == "impact":
            scene = in_contact(scene, last.a, last.b)
            self.bounces = (event.a, event.b) == (last.a, last.b)
        self.twin = Twin(scene)

    def error_and_resolution(self) -> tuple[float, float]:
        """Error of the event's instant, and what a unit of the last place of the start does to it.

        Both relative to the flight's length.
        """
        event, twin = self.event, self.twin
        begun = [twin.at(number, mp.zero) for number in range(len(self.system.bodies))]
        impacts = twin.follow([event])
        error = abs(_first_event(self.system, event) - twin.t)
        movers = (event.a, event.b) if impacts else (event.a,)
        moved = mp.zero
        for number in movers:
            now = begun[number]
            if not self.bounces:
                on_arc = self.system.trace.pieces[now.piece].sign
                moved += abs(now.place) * (twin.path_radius(number, now.piece) if on_arc else 1)
            moved += abs(now.speed) * twin.t
        speed = impacts[0].approach if impacts else twin.at(event.a, twin.t).speed
        return float(error / twin.t), float(EPSILON * moved / abs(speed) / twin.t)


def _first_event(system: System, told: Happening) -> Any:
    """The solver's instant of the first event of a kind."""
    run = simulate_system(system, 2.0 * told.t, 1, "python")
    if told.kind == "impact":
        return solved(run, "t", 0) if len(run.collisions["n"]) else mp.inf
    events = run.events
    same = (events["event"] == told.kind) & (events["ball"] == told.a + 1)
    return mp.mpf(float(events["t"][same][0])) if same.any() else mp.inf


def _as_document(document: Document, system: System) -> Document:
    """The scenario of a system that differs from a scenario's in its start alone."""
    balls = []
    for old, state in zip(document["balls"], system.initial, strict=True):
        own = {key: value for key, value in old.items() if key not in ("angle", "position")}
        line = system.trace.pieces[state.piece].is_line
        own |= {"arc": state.piece + 1, "speed": state.speed}
        balls.append(own | {"position" if line else "angle": state.position})
    return {**document, "balls": balls, "stop": {"collisions": 1, "time": LONGEST}}
