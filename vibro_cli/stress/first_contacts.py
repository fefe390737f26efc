"""First contacts: the solver's against the judge's, 50 digits and SciPy's event finder.

The solver's come from its own compiled event loop, many flights one after another; SciPy's DOP853
finds its events by changes of sign.
"""

from __future__ import annotations

import math
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from vibro_cli.compile.native import compiled
from vibro_cli.kernels.world import NEVER, World
from vibro_cli.mechanics.system import TraceSystem
from vibro_cli.stress import kernels
from vibro_cli.stress.finding import Document, Finding, Plan
from vibro_cli.stress.flights import (
    Family,
    States,
    for_judge,
    for_solver,
    near_grazing,
    random_family,
    random_states,
    scenario_of_flight,
    scene_of_flight,
)
from vibro_cli.stress.kernels import ANSWER_COLUMNS, find_first_contacts
from vibro_cli.stress.oracles.interval_oracle import (
    BODY_A,
    BODY_B,
    CONTACT,
    GRAVITY,
    HORIZON,
    KAPPA,
    NO_CONTACT,
    PLACE,
    RADIUS,
    SIDE,
    SIGN,
    SIZE,
    SLOPE,
    SPEED,
    UNDECIDED,
    judge_all,
)  # fmt: skip
from vibro_cli.stress.oracles.oracle import first_contact
from vibro_cli.stress.oracles.scene import Scene, mp
from vibro_cli.systems.trace.world import compiled_world, make_world

TOLERANCES = (1.0e-9, 1.0e-12)


def first_event(flight: Any, tolerance: float) -> float | None:
    """Instant (s) at which ``solve_ivp`` finds the gap to close, None if it finds no such.

    ``flight`` is a row for the judge; DOP853 with ``rtol = tolerance`` and a hundredth of it as
    ``atol``, an event function for the gap, terminal and falling: as a user writes it.
    """
    from scipy.integrate import solve_ivp

    bodies = (BODY_A, BODY_B)
    touch = flight[BODY_A + RADIUS] + flight[BODY_B + RADIUS]

    def rate(t: float, y: Any) -> list[float]:
        return [*_motion(flight, BODY_A, y[0], y[1]), *_motion(flight, BODY_B, y[2], y[3])]

    def gap(t: float, y: Any) -> float:
        ax, ay = _centre(flight, BODY_A, y[0])
        bx, by = _centre(flight, BODY_B, y[2])
        return math.hypot(bx - ax, by - ay) - float(touch)

    gap.terminal, gap.direction = True, -1.0  # type: ignore[attr-defined]
    start = [value for body in bodies for value in _start(flight, body)]
    solution = solve_ivp(
        rate, (0.0, flight[HORIZON]), start, method="DOP853", rtol=tolerance,
        atol=0.01 * tolerance, events=gap,
    )  # fmt: skip
    found = np.asarray(solution.t_events[0])
    return float(found[0]) if len(found) else None


def _path_radius(flight: Any, body: int) -> float:
    return float(flight[body + SIZE] - flight[body + SIGN] * flight[body + RADIUS])


def _start(flight: Any, body: int) -> tuple[float, float]:
    scale = 1.0 if flight[body + SIGN] == 0.0 else _path_radius(flight, body)
    return float(flight[body + PLACE]), float(flight[body + SPEED] / scale)


def _motion(flight: Any, body: int, place: float, rate: float) -> tuple[float, float]:
    pull = -flight[GRAVITY] / flight[body + KAPPA]
    if flight[body + SIGN] == 0.0:
        return rate, pull * math.sin(flight[SLOPE])
    return rate, flight[body + SIGN] * pull / _path_radius(flight, body) * math.sin(place)


def _centre(flight: Any, body: int, place: float) -> tuple[float, float]:
    """Centre of a body, from the junction of the two pieces (or the centre of the one arc)."""
    sine, cosine = math.sin(flight[SLOPE]), math.cos(flight[SLOPE])
    sign, radius = flight[body + SIGN], flight[body + RADIUS]
    if sign == 0.0:
        along = place - (flight[body + SIZE] if flight[body + SIDE] < 0.0 else 0.0)
        return along * cosine - radius * sine, along * sine + radius * cosine
    rho = _path_radius(flight, body)
    x, y = rho * math.sin(place), -sign * rho * math.cos(place)
    if flight[body + SIDE] != 0.0:
        x, y = x - sign * flight[body + SIZE] * sine, y + sign * flight[body + SIZE] * cosine
    return x, y


def first_contacts(system: TraceSystem, starts: Any) -> Any:
    """The solver's first contact of each start, up to the first end of a flight.

    Parameters
    ----------
    system
        Two bodies; their initial states are not used.
    starts
        Rows of ``START_COLUMNS``; the last one in s.

    Returns
    -------
    Rows of ``ANSWER_COLUMNS``.
    """
    world = compiled_world(make_world(system, NEVER, 1))
    copies: list[Any] = [np.array(array) for array in world]
    fresh = World(*copies)
    answers: Any = np.zeros((len(starts), ANSWER_COLUMNS))
    if len(starts):
        compiled(find_first_contacts)(world, fresh, np.ascontiguousarray(starts), answers)
    return answers


# A contact is another one, not the same a little displaced, beyond this part of a radius.
DISPLACED = 1.0e-11
# A contact and the end of a flight closer than this (relative) are not told apart.
AT_THE_END = 1.0e-12
WORKERS = 2
FLIGHTS_OF_A_FAMILY = 2500


class Sample(NamedTuple):
    """A flight with the instants (s) of its first contact; infinite if there is none."""

    row: Any
    """As the judge is told of it."""
    scene: Scene
    judged: float
    solved: float


@dataclass
class Tally:
    """What became of many flights."""

    flights: int = 0
    contacts: int = 0
    kinds: Counter[str] = field(default_factory=Counter)
    """How many are missed, invented, undecided or agreed upon."""
    displacement: float = 0.0
    """Greatest distance (relative to the largest radius) by which a contact is displaced."""
    wrong: Document | None = None
    worst: Document | None = None
    sample: list[Sample] = field(default_factory=list)

    def add(self, other: Tally) -> None:
        """Add what became of other flights."""
        self.flights += other.flights
        self.contacts += other.contacts
        self.kinds += other.kinds
        if other.displacement >= self.displacement:
            self.displacement, self.worst = other.displacement, other.worst or self.worst
        self.wrong = self.wrong or other.wrong
        self.sample += other.sample


def compare(family: Family, states: States, keep: int) -> Tally:
    """Give the flights of a family to the solver and to the judge."""
    answers = first_contacts(family.system, for_solver(family, states))
    on_the_way = np.flatnonzero(answers[:, kernels.HORIZON] > 0.0)
    answers, states = answers[on_the_way], states.part(on_the_way)
    rows = for_judge(family, states, answers[:, kernels.HORIZON])
    verdicts = judge_all(rows)
    tally = Tally(flights=len(rows))
    size = max(p.length if p.is_line else p.radius for p in family.pieces)
    for number, (answer, verdict) in enumerate(zip(answers, verdicts, strict=True)):
        kind, displacement = _classify(answer, verdict, size)
        tally.kinds[kind] += 1
        if kind in ("missed", "invented") and tally.wrong is None:
            tally.wrong = scenario_of_flight(family, states, number)
        if displacement > tally.displacement:
            tally.displacement = displacement
            tally.worst = scenario_of_flight(family, states, number)
    tally.contacts = int((verdicts[:, 0] == CONTACT).sum())
    for number in range(min(keep, len(rows))):
        true = verdicts[number, 2] if verdicts[number, 0] == CONTACT else np.inf
        found = answers[number, kernels.T] if answers[number, kernels.MET] > 0.0 else np.inf
        scene = scene_of_flight(family, states, number)
        tally.sample.append(Sample(rows[number], scene, true, found))
    return tally


def _classify(answer: Any, verdict: Any, size: float) -> tuple[str, float]:
    """What became of one flight: its kind, and by how much its contact is displaced."""
    met, instant = answer[kernels.MET] > 0.0, answer[kernels.T]
    status, low, high, speed = verdict
    horizon = answer[kernels.HORIZON]
    if status == UNDECIDED or (status == CONTACT and (high - low) * speed > DISPLACED * size):
        return "undecided", 0.0
    if status == NO_CONTACT:
        if met and horizon - instant < AT_THE_END * horizon:
            return "undecided", 0.0
        return ("invented", 0.0) if met else ("agreed", 0.0)
    if not met:
        return ("undecided" if horizon - high < AT_THE_END * horizon else "missed"), 0.0
    displaced = max(low - instant, instant - high, 0.0) * speed / size
    if displaced > DISPLACED:
        return ("missed" if instant > high else "invented"), displaced
    return "agreed", displaced


def _portion(seed: np.random.SeedSequence, kind: int, grazing: bool, keep: int) -> Tally:
    """One family: drawn, solved and judged."""
    rng = np.random.default_rng(seed)
    family = random_family(rng, kind)
    if grazing:
        states, _ = near_grazing(rng, family, FLIGHTS_OF_A_FAMILY)
    else:
        states = random_states(rng, family, FLIGHTS_OF_A_FAMILY)
    return compare(family, states, keep)


def run_flights(seed: int, wanted: int, grazing: bool, keep: int) -> Tally:
    """Families one after another, on two cores, until so many flights are judged."""
    seeds = np.random.SeedSequence([seed, int(grazing)])
    total, kind = Tally(), 0
    with ThreadPoolExecutor(WORKERS) as workers:
        while total.flights < wanted:
            some = seeds.spawn(2 * WORKERS)
            kinds = range(kind, kind + len(some))
            kind += len(some)
            parts = workers.map(
                lambda one, number: _portion(one, number, grazing, keep), some, kinds
            )
            for part in parts:
                total.add(part)
    return total


def check_contacts(plan: Plan) -> list[Finding]:
    """Missed and invented contacts on random and near-grazing flights."""
    findings: list[Finding] = []
    hostile: list[Sample] = []
    for name, grazing, wanted in (
        ("random flights", False, plan.amount(8_000, 1_000_000)),
        ("near-grazing flights (+-1e-13 R ... +-1e-2 R)", True, plan.amount(2_000, 100_000)),
    ):
        tally = run_flights(plan.seed, wanted, grazing, plan.amount(8, 10))
        n = tally.flights
        tried = f"{name}, {tally.contacts} with contact, judged by interval bounds"
        findings += [
            Finding("contacts", quantity, tried, n, tally.kinds[kind], mark, scenario)
            for kind, quantity, mark, scenario in (
                ("missed", "missed first contacts", 0.0, tally.wrong),
                ("invented", "invented contacts", 0.0, tally.wrong),
                ("undecided", "undecided by the judge", None, None),
            )
        ]
        findings.append(
            Finding(
                "contacts", "displacement of a contact (R)", tried, n, tally.displacement,
                DISPLACED, tally.worst,
            )
        )  # fmt: skip
        if grazing:
            hostile = tally.sample
    findings.append(_by_fifty_digits(hostile, plan))
    return findings + _by_scipy(hostile, plan)


def _by_fifty_digits(sample: list[Sample], plan: Plan) -> Finding:
    wrong, chosen = 0, _spread(sample, plan.amount(20, 1000))
    for one in chosen:
        exact = first_contact(one.scene, mp.mpf(float(one.row[HORIZON])))
        instant = float("inf") if exact is None else float(exact)
        agree = [
            instant == other or abs(instant - other) < 1.0e-6 for other in (one.judged, one.solved)
        ]
        wrong += not all(agree)
    tried = "near-grazing flights, 50 digits against the judge and the solver"
    return Finding("contacts", "contacts decided otherwise", tried, len(chosen), wrong, 0.0)


def _by_scipy(sample: list[Sample], plan: Plan) -> list[Finding]:
    """What SciPy's event finder makes of near-grazing flights that do meet."""
    meeting = [one for one in sample if one.judged < np.inf]
    chosen = _spread(meeting, plan.amount(20, 200))
    findings = []
    for tolerance in TOLERANCES:
        missed = 0
        for one in chosen:
            found = first_event(one.row, tolerance)
            missed += found is None or found > one.judged + 1.0e-3
        tried = f"near-grazing flights with contact, SciPy's DOP853 at rtol {tolerance:g}"
        findings.append(
            Finding("contacts", "missed by SciPy's event finder", tried, len(chosen), missed, None)
        )
    return findings


def _spread(items: list[Any], count: int) -> list[Any]:
    """So many items, evenly from all."""
    if len(items) <= count:
        return items
    return [items[int(k * len(items) / count)] for k in range(count)]
