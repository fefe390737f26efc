"""Checks of instants and places of impacts, and of the ends of single flights, against 50 digits.

The oracle finds the events by itself, from the same initial doubles. Starts 1e-3 to 1e-300
rad off a crest are compared with elliptic integrals: when the body leaves, and where it goes. On
traces that rotate about a vertical axis, energy and lasting contact are checked, too.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from vibro_cli.kernels.numerics.constants import EPSILON
from vibro_cli.mechanics.initial_conditions import out_of_order
from vibro_cli.mechanics.system import InitialState, TraceSystem
from vibro_cli.stress.oracles.motion import State
from vibro_cli.stress.oracles.oracle import Event, Oracle
from vibro_cli.stress.oracles.scene import mp
from vibro_cli.stress.oracles.sensitivity import amplification
from vibro_cli.stress.scenes import (
    CIRCLE,
    GRAVITY,
    THREE_ARCS,
    VALLEY,
    WALLS,
    Document,
    Finding,
    Plan,
    ball,
    scene,
    solve,
    system_of,
    three_arcs,
    valley,
)
from vibro_cli.systems.run import Run
from vibro_cli.systems.trace import simulate_system

# The compared quantities of an impact.
QUANTITIES = ("t", "place_a", "place_b")


def solved(run: Run, quantity: str, row: int) -> Any:
    """Return one of `QUANTITIES` of a row without rounding; the time is the sum of two doubles."""
    table = run.collisions
    if quantity == "t":
        return mp.mpf(float(table["t"][row])) + mp.mpf(float(table["t_low"][row]))
    end = quantity[-1]
    angle = float(table[f"angle_{end}"][row])
    if math.isnan(angle):
        piece = run.system.trace.pieces[int(table[f"arc_{end}"][row]) - 1]
        return mp.mpf(float(table[f"s_{end}"][row])) - mp.mpf(piece.start_s)
    return mp.mpf(angle)


def columns(run: Run) -> dict[str, list[float]]:
    """Return all quantities of all rows, in doubles."""
    count = len(run.collisions["n"])
    return {name: [float(solved(run, name, row)) for row in range(count)] for name in QUANTITIES}


FIRST = 10
LONGEST = 30.0  # s
# Shift of the end of a flight, relative to its length, by a unit in the last place of its start. If
# it is greater than this, states rounded to doubles are too coarse for the mark of single flights.
RESOLVED = 2.5e-14
# Greatest amplification for which the response to a change of an input is linear.
MOST_AMPLIFIED = 1.0e6
LINE_BETWEEN: Document = {
    "start_slope": "-120 deg",
    "arcs": [
        {"shape": "valley", "radius": 0.8, "end_slope": "0 deg"},
        {"shape": "line", "length": 1.5},
        {"shape": "valley", "radius": 1.0, "end_slope": "120 deg"},
    ],
}


def check_impacts(plan: Plan) -> list[Finding]:
    """Check the first impacts of many scenes, and each of their flights separately."""
    tried = "2 and 3 bodies on a circle, a valley, three arcs, a line between valleys; 50 digits"
    again = "taken up from reference states"
    whole = Finding(
        f"error of the first {FIRST} impacts / (eps x amplification)",
        f"{tried}; times and places",
        64.0,
    )
    single = Finding("error of the end of a single flight / its length", f"{tried}; {again}", 1e-13)
    unresolved = Finding(
        "error of the end of a single flight / (eps x amplification)",
        f"{again}; flights so short that a unit in the last place of these moves their end by more"
        f" than {RESOLVED:g} of their length",
        64.0,
    )
    rng = np.random.default_rng([plan.seed, 29])
    for document, run, grown in _scenes(rng, plan.amount(4, 100)):
        oracle, last, errors = Oracle.of(run.system), None, list[float]()
        for states, lasts, event in _flights(oracle):
            if event.kind == "impact":
                errors.append(_error(run, len(errors), grown, oracle))
            flight = _single_flight(run.system, states, event._replace(t=lasts), last)
            last = event
            if flight is None:
                continue
            start, error, resolution = flight
            if resolution <= RESOLVED:
                single.take(error, _as_document(document, start))
            else:
                unresolved.take(error / resolution, _as_document(document, start))
        whole.take(max(errors), document)
    return [whole, single, unresolved] if unresolved.cases else [whole, single]


def _flights(oracle: Oracle) -> Iterator[tuple[list[State], Any, Event]]:
    """Yield every event up to the last impact, with the states at the one before, and the time (s).

    Raises ArithmeticError if the motion of the oracle ends earlier.
    """
    events, impacts = oracle.history.events, 0
    while impacts < FIRST:
        states, begin, known = list(oracle.now.states), oracle.t, len(events)
        oracle.run(mp.mpf(LONGEST), last=("crossing", "impact"))
        if len(events) == known:
            raise ArithmeticError(f"the oracle has {impacts} impacts, expected {FIRST}")
        impacts += events[-1].kind == "impact"
        yield states, oracle.t - begin, events[-1]


def _scenes(
    rng: np.random.Generator, count: int
) -> Iterator[tuple[Document, Run, dict[str, list[float]]]]:
    """Yield scenes with ten ordinary impacts each, their runs, and their amplification.

    Scenes with simultaneous impacts or lasting contact are drawn again.
    """
    found = 0
    while found < count:
        document = _scene(rng, found)
        run = _solve(system_of(document))
        kinds = set(run.events["event"].tolist())
        joint = bool(run.collisions["simultaneous"].any())
        if len(run.collisions["n"]) < FIRST or joint or "contact_closed" in kinds:
            continue
        try:
            grown = amplification(run.system, lambda changed: columns(_solve(changed)))
        except ArithmeticError:
            continue
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
            # Put the first body on the first piece, the others one after another on the last.
            own["arc"] = 1 if n == 0 else arcs
            place = float(rng.uniform(-1.4, -0.2)) if n == 0 else 0.5 * n + 0.1 * place
        balls.append(ball(place, radius=float(rng.uniform(0.05, 0.1)), **own))
    k, law = float(rng.choice([1.0, 0.9, 0.6])), str(rng.choice(["hedrih", "normal-impulse"]))
    document = scene(trace, balls, k, law, collisions=FIRST, time=LONGEST)
    document["collision"]["inadmissible"] = "normal-impulse"
    return document


KINDS = ("ball", "disk", "hollow_ball", "hoop")


def _solve(system: TraceSystem) -> Run:
    return simulate_system(system, LONGEST, FIRST, "python")


def _error(run: Run, row: int, grown: dict[str, list[float]], oracle: Oracle) -> float:
    """Return the greater error of the instant and places of an impact, in eps x amplification."""
    exact = {"t": oracle.t}
    for end in "ab":
        exact[f"place_{end}"] = oracle.now.states[int(run.collisions[f"ball_{end}"][row]) - 1].place
    off = {name: float(abs(solved(run, name, row) - value)) for name, value in exact.items()}
    return max(off[name] / (EPSILON * grown[name][row]) for name in QUANTITIES)


def _single_flight(
    system: TraceSystem, states: Sequence[State], event: Event, last: Event | None
) -> tuple[TraceSystem, float, float] | None:
    """Solve the motion from one event to the next, from the oracle's states rounded to doubles.

    Returns the system with this start, the error of the event's instant, and the instant's shift by
    an ulp of the start, both relative to the length of the flight; None if the bodies are not in
    order, as after crossing the seam once.

    Two bodies that have just collided are in contact: the left one is exactly at its rounded place,
    the right one where it touches the left one.
    """
    starts = [InitialState(now.piece, float(now.place), float(now.speed)) for now in states]
    if any(out_of_order(*both) for both in pairwise(starts)):
        return None
    system = replace(system, initial=tuple(starts))
    own = Oracle.of(system)
    begun = own.now.states
    own.run(2 * event.t, last=[event.kind])
    impact = event.kind == "impact"
    bounces = last is not None and impact and (event.a, event.b) == (last.a, last.b)
    moved = mp.zero
    for number in (event.a, event.b) if impact else (event.a,):
        now = begun[number]
        if not bounces:
            moved += abs(now.place) / own.now.path(number).per_length
        moved += abs(now.speed) * own.t
    error = abs(_first_event(system, event) - own.t)
    speed = own.history.bounces[0].before if impact else own.now.states[event.a].speed
    return system, float(error / own.t), float(EPSILON * moved / abs(speed) / own.t)


def _first_event(system: TraceSystem, event: Event) -> Any:
    """Return the solver's instant of the first event of the kind of `event`."""
    run = simulate_system(system, 2.0 * float(event.t), 1, "python")
    if event.kind == "impact":
        return solved(run, "t", 0) if len(run.collisions["n"]) else mp.inf
    events = run.events
    same = (events["event"] == event.kind) & (events["ball"] == event.a + 1)
    return mp.mpf(float(events["t"][same][0])) if same.any() else mp.inf


def _as_document(document: Document, system: TraceSystem) -> Document:
    """Return a scenario with its initial states replaced by those of a system."""
    balls = []
    for old, state in zip(document["balls"], system.initial, strict=True):
        own = {key: value for key, value in old.items() if key not in ("angle", "position")}
        line = system.trace.pieces[state.piece].is_line
        own |= {"arc": state.piece + 1, "speed": state.speed}
        balls.append(own | {"position" if line else "angle": state.position})
    return {**document, "balls": balls, "stop": {"collisions": 1, "time": LONGEST}}


HUMP, RADIUS, KAPPA, VALLEY_RADIUS = 0.5, 0.1, 1.4, 1.0
RETURNS = 6


def check_crest(plan: Plan) -> list[Finding]:
    """Check departure and first impact against 50 digits, and the decisions to pass the crest."""
    rng = np.random.default_rng([plan.seed, 13])
    exponents = np.linspace(-3.0, -300.0, plan.amount(12, 199))
    offsets = [float(10.0**e * rng.uniform(1.0, 9.0)) for e in exponents]
    return [*_times(offsets), _decisions(offsets)]


def time_from_rest(w: Any, offset: Any, angle: Any) -> Any:
    """Return the time (s) from rest at ``offset`` to ``angle`` on a hump, by Carlson's integral.

    ``w t = R_F(U12^2, U13^2, U23^2)`` (DLMF 19.29.4) of ``dx / sqrt(x (1-x) (x - x0))``, with
    ``x = sin^2(psi/2)``.
    """
    y, x = mp.sin(offset / 2), mp.sin(angle / 2)
    span = mp.sqrt((x - y) * (x + y))
    one, two = mp.sqrt(1 - x * x), mp.sqrt(1 - y * y)
    return mp.elliprf((y * two / span) ** 2, (x * two / span) ** 2, (one * y / span) ** 2) / w


def _exact(offset: float) -> tuple[Any, Any]:
    """Return the exact instants of the departure from the hump and of the first impact (s)."""
    junction = mp.mpf(5) / 18 * mp.pi
    radius = mp.mpf(RADIUS)
    kappa = mp.mpf(KAPPA)
    rho_hump, rho_valley = mp.mpf(HUMP) + radius, mp.mpf(VALLEY_RADIUS) - radius
    w = mp.sqrt(mp.mpf(GRAVITY) / (kappa * rho_hump))
    departure = time_from_rest(w, mp.mpf(offset), junction)
    y, x = mp.sin(mp.mpf(offset) / 2), mp.sin(junction / 2)
    speed = 2 * w * mp.sqrt((x - y) * (x + y)) * rho_hump
    pull = mp.mpf(GRAVITY) / (kappa * rho_valley)
    beta = 2 * mp.asin(radius / rho_valley)
    start = (speed / rho_valley) ** 2

    def slowness(angle: Any) -> Any:
        return 1 / mp.sqrt(start + 2 * pull * (mp.cos(angle) - mp.cos(junction)))

    return departure, departure + mp.quad(slowness, [-junction, -junction / 2, -beta])


def _times(offsets: list[float]) -> list[Finding]:
    tried = "at rest 1e-3 ... 1e-300 rad off a crest, against 50 digits"
    departure, impact = (
        Finding(f"relative error of the time of {name}", tried, 1e-12)
        for name in ("departure", "the first impact")
    )
    for offset in offsets:
        # The second ball is at rest at the bottom of the right valley.
        balls = [ball(offset, arc=2), ball(0.0, arc=3)]
        document = scene(THREE_ARCS, balls, 1.0, collisions=1, time=1.0e6)
        run = solve(document)
        exact = _exact(offset)
        crossings = run.events["t"][run.events["event"] == "crossing"]
        left = float(crossings[0]) if len(crossings) else math.nan
        met = float(run.collisions["t"][0]) if len(run.collisions["t"]) else math.nan
        departure.take(float(abs(left - exact[0]) / exact[0]), document)
        impact.take(float(abs(met - exact[1]) / exact[1]), document)
    return [departure, impact]


def _decisions(offsets: list[float]) -> Finding:
    """Check that a body at rest beside a crest never passes it and one moving on it always does."""
    tried = (
        f"alone on three arcs for {RETURNS} crossings or more, at rest beside or moving on a crest"
    )
    wrong = Finding("wrong decisions to return", tried, 0.0)
    for offset in offsets:
        for over in (False, True):
            one = ball(0.0, arc=2, rate=offset) if over else ball(offset, arc=2)
            # Each way down and back takes about 2 ln(1/offset)/w and some seconds.
            time = RETURNS * (2.0 * -math.log(offset) / 3.4 + 4.0)
            document = scene(THREE_ARCS, [one], time=time)
            events = solve(document).events
            crossing = events["event"] == "crossing"
            arcs = np.asarray(events["arc_to"][crossing]).tolist()
            expected = [3, 2, 1, 2] if over else [3, 2, 3, 2]
            enough = len(arcs) >= RETURNS
            right = enough and all(a == expected[n % 4] for n, a in enumerate(arcs))
            wrong.take(float(not right), document)
    return wrong


def check_turning(plan: Plan) -> list[Finding]:
    """Check, on rotating traces, first impacts, energy drift at k = 1, and the energy balance."""
    return [_first_impacts(), _energy(plan), _balance()]


def _turning_document(on_axis: bool, rate: float, k: float, law: str, **stop: float) -> Document:
    """Return two balls in a valley rotating about its axis, or on three arcs about the hump's."""
    body: Document = {"radius": 0.1, "density": 7800.0}
    balls = [
        {**body, "arc": 1, "angle": "-75 deg", "rate": 0.0 if on_axis else -5.0},
        {**body, "arc": 1 if on_axis else 3, "angle": "60 deg", "rate": 0.0 if on_axis else 5.0},
    ]
    turning = {"through_arc": 1 if on_axis else 2, "rate": rate}
    trace = (valley(90) if on_axis else three_arcs(90)) | {"turning": turning}
    return scene(trace, balls, k, law, **stop) | WALLS


def _first_impacts() -> Finding:
    tried = "first 10 impacts, circle and three arcs"
    error = Finding("relative error of the time of an impact", tried, 1e-12)
    for on_axis, rate in ((True, 1.7), (True, 3.6), (False, 0.8), (False, 1.2)):
        document = _turning_document(on_axis, rate, 0.95, "hedrih", collisions=10)
        run = solve(document, "compiled")
        impacts = Oracle.of(run.system).impacts(len(run.collisions["n"]), mp.mpf(LONGEST))
        for row, impact in enumerate(impacts):
            error.take(float(abs(solved(run, "t", row) / impact.t - 1)), document)
    return error


def _energy(plan: Plan) -> Finding:
    impacts = plan.amount(1_000, 100_000)
    drift = Finding("relative drift of energy", f"k = 1, circle, {impacts} impacts", 1e-12)
    document = _turning_document(True, 2.5, 1.0, "hedrih", collisions=impacts)
    drift.take(abs(solve(document, "compiled").summary_record()["energy_drift"]), document)
    return drift


def _balance() -> Finding:
    tried = "k = 0.4, into lasting contact"
    missing = Finding("energy missing in the balance (relative)", tried, 1e-11)
    for on_axis in (True, False):
        document = _turning_document(on_axis, 1.2, 0.4, "normal-impulse", time=25.0)
        run = solve(document, "compiled")
        record = run.summary_record()
        lost = record["energy_start"] - float(run.collisions["energy_loss"].sum())
        missing.take(abs(record["energy_end"] - lost) / record["energy_start"], document)
    return missing
