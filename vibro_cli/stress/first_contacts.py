"""First contacts of the solver against those of the judge, of 50 digits and of SciPy.

The solver's contacts come from its compiled event loop, many flights one after another. SciPy's
DOP853 finds events by changes of sign.

Flights that just touch, or just do not, are constructed at the instant of grazing and followed
backwards. At that instant the gap is ``-overshoot``, its rate zero and its second derivative
positive. The backward motion uses plain doubles (short Taylor steps of the pendulum equation),
which places a flight within some 1e-15 R of the intended one; the judge decides what then happens.
"""

from __future__ import annotations

import math
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import count
from operator import mul
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial.polynomial import polyval

from vibro_cli.assemble import build_system
from vibro_cli.compile.native import compiled
from vibro_cli.kernels.world import World
from vibro_cli.mechanics.system import TraceSystem
from vibro_cli.mechanics.trace import Piece
from vibro_cli.scenario.loading import scenario_of
from vibro_cli.scenario.problems import ScenarioError
from vibro_cli.stress.drawing import slopes_of
from vibro_cli.stress.kernels import Answer, find_first_contacts
from vibro_cli.stress.oracles.interval_oracle import (
    CONTACT,
    NO_CONTACT,
    UNDECIDED,
    JudgedBody,
    JudgedFlight,
    judge_all,
)
from vibro_cli.stress.oracles.oracle import first_contact
from vibro_cli.stress.oracles.scene import Scene, mp, scene_of_system
from vibro_cli.stress.scenes import GRAVITY, Document, Finding, Plan
from vibro_cli.systems.driver import compiled_world, zeros
from vibro_cli.systems.request import Limits
from vibro_cli.systems.trace import SYSTEM
from vibro_cli.systems.trace.world import half_angle, make_world

KINDS = (
    "valley", "hump", "line", "valley hump", "hump valley", "valley line", "line valley",
    "hump line", "line hump", "valley valley", "hump hump",
)  # fmt: skip
BODIES = ("ball", "disk", "hollow_ball", "hoop", "particle")
# Bodies start at least this far apart, in units of the sum of their radii.
LEAST_GAP = 1.0e-6


@dataclass(frozen=True)
class Family:
    """A trace with two bodies whose initial states vary."""

    document: Document
    system: TraceSystem

    @property
    def pieces(self) -> tuple[Piece, Piece]:
        """The pieces of the left and of the right body: the first and the last."""
        return self.system.trace.pieces[0], self.system.trace.pieces[-1]

    @property
    def sizes(self) -> list[float]:
        """Sizes of both pieces: radii of arcs, lengths of lines (m)."""
        return [piece.length if piece.is_line else piece.radius for piece in self.pieces]

    @property
    def touch(self) -> float:
        """Distance (m) of the centres in contact."""
        return sum(body.radius for body in self.system.bodies)


def random_family(rng: np.random.Generator, number: int) -> Family:
    """Return a random family; `number` selects the kind. Impossible scenes are drawn again."""
    kind = KINDS[number % len(KINDS)]
    while True:
        document = _document(rng, kind)
        try:
            return Family(document, build_system(scenario_of(document)))
        except ScenarioError:
            continue


def _document(rng: np.random.Generator, kind: str) -> Document:
    shapes = kind.split()
    slope = _first_slope(rng, shapes)
    arcs, start = [], slope
    for shape in shapes:
        if shape == "line":
            arcs.append({"shape": shape, "length": float(rng.uniform(1.0, 4.0))})
            continue
        turn = float(rng.uniform(0.6, 1.6 if len(shapes) > 1 else 2.6))
        slope += turn if shape == "valley" else -turn
        arcs.append({"shape": shape, "radius": float(rng.uniform(0.5, 3.0)), "end_slope": slope})
    largest = float(rng.uniform(0.02, 0.15))
    radii = (largest, largest if rng.random() < 0.3 else largest * float(rng.uniform(0.3, 1.0)))
    balls = []
    for ball, radius in enumerate(radii):
        arc = 1 if ball == 0 else len(shapes)
        own: Document = {
            "body": str(rng.choice(BODIES)), "radius": radius,
            "mass": float(rng.uniform(0.1, 3.0)), "arc": arc,
        }  # fmt: skip
        balls.append(own | _middle(arcs, start, arc - 1, 0.3 if ball == 0 else 0.7))
    return {
        "gravity": GRAVITY,
        "trace": {"start_slope": start, "arcs": arcs},
        "balls": balls,
        "collision": {"law": "normal-impulse", "k": 1.0},
        "stop": {"collisions": 1, "time": 100.0},
    }


def _first_slope(rng: np.random.Generator, shapes: list[str]) -> float:
    """Return a slope at the left end such that the middle of the trace is about level."""
    if shapes[0] == "line":
        return float(rng.uniform(-0.6, 0.6))
    return float(rng.uniform(0.3, 1.3)) * (-1.0 if shapes[0] == "valley" else 1.0)


def _middle(arcs: list[Document], start: float, index: int, share: float) -> Document:
    """Return the place at a share of a piece."""
    arc = arcs[index]
    if arc["shape"] == "line":
        return {"position": share * arc["length"]}
    first, last = slopes_of(start, arcs)[index:][:2]
    sign = 1.0 if arc["shape"] == "valley" else -1.0
    return {"angle": sign * (first + share * (last - first))}


@dataclass(frozen=True)
class States:
    """Initial states of a family's two bodies: places (rad, m), speeds (m/s), longest time (s)."""

    places: Any  # (n, 2)
    speeds: Any  # (n, 2)
    horizon: Any  # (n,)

    def part(self, chosen: Any) -> States:
        """Return the states of the chosen flights."""
        return States(self.places[chosen], self.speeds[chosen], self.horizon[chosen])


def random_states(rng: np.random.Generator, family: Family, count: int) -> States:
    """Return random states of separate bodies, from nearly touching to far apart, slow and fast."""
    first, last = family.pieces
    places = np.empty((count, 2))
    for ball, piece in enumerate((first, last)):
        places[:, ball] = rng.uniform(piece.angle_start, piece.angle_end, count)
    if first is last:
        places.sort(axis=1)
    else:
        near = 10.0 ** rng.uniform(-1.5, 0.0, count)
        places[:, 0] = first.angle_end + (places[:, 0] - first.angle_end) * near
        places[:, 1] = last.angle_start + (places[:, 1] - last.angle_start) * near
    typical = math.sqrt(GRAVITY * min(family.sizes))
    speeds = rng.normal(0.0, 1.0, (count, 2)) * typical * 10.0 ** rng.uniform(-1.5, 0.3, (count, 1))
    longest = math.sqrt(max(family.sizes) / GRAVITY) * 10.0 ** rng.uniform(0.0, 1.0, count)
    states = States(places, speeds, longest)
    return states.part(distances(family, states) > family.touch * (1.0 + LEAST_GAP))


def _centres(piece: Piece, positions: Any, body_radius: float) -> tuple[Any, Any]:
    """Return the centres (m) of a body at many positions, as ``Piece.body_centre`` does for one."""
    if piece.is_line:
        sine, cosine = math.sin(piece.start_slope), math.cos(piece.start_slope)
        return (
            piece.start[0] + positions * cosine - body_radius * sine,
            piece.start[1] + positions * sine + body_radius * cosine,
        )
    rho = piece.path_radius(body_radius)
    return (
        piece.centre[0] + rho * np.sin(positions),
        piece.centre[1] - piece.sign * rho * np.cos(positions),
    )


def centres_of(family: Family, states: States) -> list[tuple[Any, Any]]:
    """Return the centres of both bodies at the start (m)."""
    return [
        _centres(piece, states.places[:, ball], family.system.bodies[ball].radius)
        for ball, piece in enumerate(family.pieces)
    ]


def distances(family: Family, states: States) -> Any:
    """Return the distances of the centres at the start (m)."""
    (ax, ay), (bx, by) = centres_of(family, states)
    return np.hypot(bx - ax, by - ay)


def for_judge(family: Family, states: States, horizon: Any) -> tuple[Any, Any]:
    """Return the judge's records of flights up to a horizon (s), and of their bodies."""
    count = len(states.places)
    flights, bodies = zeros(count, JudgedFlight), zeros(2 * count, JudgedBody)
    first, last = family.pieces
    flights["gravity"] = family.system.gravity
    flights["slope"] = first.start_slope if first is last else first.end_slope
    flights["horizon"] = horizon
    for ball, piece in enumerate((first, last)):
        record, body = bodies[ball::2], family.system.bodies[ball]
        record["sign"], record["size"] = piece.sign, piece.length if piece.is_line else piece.radius
        record["radius"], record["kappa"] = body.radius, body.kappa
        record["place"], record["speed"] = states.places[:, ball], states.speeds[:, ball]
        record["side"] = 0.0 if first is last else (-1.0 if ball == 0 else 1.0)
    return flights, bodies


def scene_of_flight(family: Family, states: States, number: int) -> Scene:
    """Return the scene of one flight with exactly the judge's doubles, including kappa."""
    scene = scene_of_system(family.system)
    bodies = tuple(
        replace(exact, kappa=mp.mpf(body.kappa))
        for exact, body in zip(scene.bodies, family.system.bodies, strict=True)
    )
    starts = tuple(
        (piece.index, mp.mpf(float(place)), mp.mpf(float(speed)))
        for piece, place, speed in zip(
            family.pieces, states.places[number], states.speeds[number], strict=True
        )
    )
    return replace(scene, bodies=bodies, starts=starts)


def scenario_of_flight(family: Family, states: States, number: int) -> Document:
    """Return the scenario that reproduces one flight."""
    document: Document = {**family.document, "balls": []}
    for ball, old in enumerate(family.document["balls"]):
        key = "position" if "position" in old else "angle"
        place, speed = float(states.places[number, ball]), float(states.speeds[number, ball])
        document["balls"].append({**old, key: place, "speed": speed})
    stop = {"collisions": 1, "time": float(states.horizon[number])}
    return {**document, "stop": stop}


_HALVINGS = 70
_CHECKS = 8  # instants of the backward motion at which the bodies must be on their pieces
_SMALLEST, _LARGEST = -13.0, -2.0  # powers of ten of the overshoot, in radii of the arc


_ORDER, _STEP = 18, 0.15  # of the series of a flight, and of a step in t max(1, f')


def _followed(sign: float, angle: Any, rate: Any, t: Any) -> tuple[Any, Any]:
    """Return angles and rates of ``f'' = -sign sin f`` after times, one for each flight."""
    steps = math.ceil(np.max(np.abs(t) * (2.0 + np.abs(rate)), initial=0.0) / _STEP) + 1
    for _ in range(steps):
        sines, cosines, rates = [np.sin(angle)], [np.cos(angle)], [rate]
        for k in range(1, _ORDER + 1):
            along, against = (sum(map(mul, one, rates[::-1])) for one in (cosines, sines))
            rates.append(-sign * sines[-1] / k)
            sines.append(along / k)
            cosines.append(-against / k)
        ways = [angle, *(one / k for k, one in enumerate(rates[:-1], 1))]
        angle, rate = (polyval(t / steps, np.array(one), tensor=False) for one in (ways, rates))
    return angle, rate


def _follow_body(family: Family, ball: int, states: States, times: Any) -> tuple[Any, Any]:
    """Return places and speeds of one body after the given times (negative: before)."""
    piece, body = family.pieces[ball], family.system.bodies[ball]
    places, speeds = states.places[:, ball].copy(), states.speeds[:, ball].copy()
    if piece.is_line:
        pull = -GRAVITY / body.kappa * math.sin(piece.start_slope)
        return places + times * (speeds + 0.5 * pull * times), speeds + pull * times
    rho = piece.path_radius(body.radius)
    rates = speeds / rho
    w = math.sqrt(GRAVITY / (body.kappa * rho))
    places, rates = _followed(piece.sign, places, rates / w, w * times)
    return places, rates * w * rho


def _place_beside(family: Family, places: Any, distance: Any) -> tuple[Any, Any]:
    """Return places of the right body at given distances of the centres, and which exist."""
    first, last = family.pieces
    low = places.copy() if first is last else np.full(len(places), last.angle_start)
    high = np.full(len(places), last.angle_end)
    if first is last and not last.is_line:
        high = np.minimum(high, places + math.pi)

    def apart(candidates: Any) -> Any:
        return distances(family, States(np.stack([places, candidates], axis=1), 0.0, 0.0))

    found = (apart(low) < distance) & (apart(high) > distance)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        near = apart(middle) < distance
        low, high = np.where(near, middle, low), np.where(near, high, middle)
    return 0.5 * (low + high), found


def _second_derivative(family: Family, states: States) -> tuple[Any, Any]:
    """Return the right body's speed at which the gap's rate is 0, and its second derivative."""
    centres = centres_of(family, states)
    dx, dy = (centres[1][axis] - centres[0][axis] for axis in range(2))
    tangents = []
    for ball, piece in enumerate(family.pieces):
        slopes = piece.slope(states.places[:, ball])
        tangents.append((np.cos(slopes), np.sin(slopes)))
    along = [dx * tx + dy * ty for tx, ty in tangents]
    speed_a = states.speeds[:, 0]
    speed_b = speed_a * along[0] / along[1]
    second = np.zeros(len(dx))
    for side, ball, speed in ((-1.0, 0, speed_a), (1.0, 1, speed_b)):
        piece, body = family.pieces[ball], family.system.bodies[ball]
        tx, ty = tangents[ball]
        central = 0.0 if piece.is_line else piece.sign * speed**2 / piece.path_radius(body.radius)
        pull = -GRAVITY / body.kappa * ty
        second += side * (dx * (pull * tx - central * ty) + dy * (pull * ty + central * tx))
    across_x = speed_b * tangents[1][0] - speed_a * tangents[0][0]
    across_y = speed_b * tangents[1][1] - speed_a * tangents[0][1]
    return speed_b, second + across_x**2 + across_y**2


def near_grazing(rng: np.random.Generator, family: Family, tries: int) -> tuple[States, Any]:
    """Return flights of a family close to grazing, and overshoots (m; negative: no contact).

    There are fewer than ``tries``: flights that leave their pieces or do not graze are dropped.
    """
    first, last = family.pieces
    sizes, touch = family.sizes, family.touch
    powers = rng.uniform(_SMALLEST, _LARGEST, tries)
    # Round every fourth to a whole power of ten, including both ends.
    powers = np.where(rng.random(tries) < 0.25, np.round(powers), powers)
    overshoot = min(sizes) * 10.0**powers
    overshoot *= rng.choice([-1.0, 1.0], tries)
    low = first.angle_start
    if first is not last:
        reach = 4.0 * touch / (1.0 if first.is_line else first.radius)
        low = max(low, first.angle_end - reach)
    places = np.zeros((tries, 2))
    places[:, 0] = rng.uniform(low, first.angle_end, tries)
    places[:, 1], found = _place_beside(family, places[:, 0], touch - overshoot)
    speeds = np.zeros((tries, 2))
    speeds[:, 0] = rng.normal(0.0, 1.0, tries) * math.sqrt(GRAVITY * min(sizes))
    backwards = math.sqrt(max(sizes) / GRAVITY) * 10.0 ** rng.uniform(-1.5, 0.3, tries)
    states, overshoot = States(places, speeds, backwards).part(found), overshoot[found]
    states.speeds[:, 1], second = _second_derivative(family, states)
    chosen = (second > 1.0e-3 * GRAVITY * touch) & (abs(states.speeds[:, 1]) < 20.0)
    return _go_back(family, states.part(chosen), overshoot[chosen])


def _go_back(family: Family, states: States, overshoot: Any) -> tuple[States, Any]:
    """Return the states before grazing of flights that stay on their pieces and start apart."""
    inside = np.ones(len(overshoot), dtype=bool)
    step = -states.horizon / _CHECKS
    before = States(states.places.copy(), states.speeds.copy(), 2.0 * states.horizon)
    for _ in range(_CHECKS):
        for ball, piece in enumerate(family.pieces):
            places, speeds = _follow_body(family, ball, before, step)
            before.places[:, ball], before.speeds[:, ball] = places, speeds
            inside &= (places > piece.angle_start) & (places < piece.angle_end)
    if family.pieces[0] is family.pieces[1]:
        inside &= before.places[:, 0] < before.places[:, 1]
    inside &= distances(family, before) > family.touch * (1.0 + LEAST_GAP)
    return before.part(inside), overshoot[inside]


TOLERANCES = (1.0e-9, 1.0e-12)


def first_event(one: Sample, tolerance: float) -> float | None:
    """Return the instant (s) at which ``solve_ivp`` finds the gap to close, or None.

    It uses DOP853 with ``rtol = tolerance``, a hundredth of it as ``atol``, and a terminal, falling
    event function for the gap, as a user would.
    """
    from scipy.integrate import solve_ivp

    pieces, bodies = one.family.pieces, one.family.system.bodies
    scales = [piece.path_scale(body.radius) for piece, body in zip(pieces, bodies, strict=True)]

    def change(t: float, y: Any) -> list[float]:
        found = []
        for n, (piece, body) in enumerate(zip(pieces, bodies, strict=True)):
            pull = -GRAVITY / body.kappa * math.sin(piece.slope(y[2 * n]))
            found += [y[2 * n + 1], pull / scales[n]]
        return found

    def gap(t: float, y: Any) -> Any:
        (ax, ay), (bx, by) = (
            _centres(piece, place, body.radius)
            for piece, place, body in zip(pieces, y[::2], bodies, strict=True)
        )
        return np.hypot(bx - ax, by - ay) - one.family.touch

    gap.terminal, gap.direction = True, -1.0  # type: ignore[attr-defined]
    rates = one.states.speeds[one.number] / scales
    start = np.stack([one.states.places[one.number], rates], axis=1).ravel()
    solution = solve_ivp(
        change, (0.0, one.horizon), start, method="DOP853", rtol=tolerance,
        atol=0.01 * tolerance, events=gap,
    )  # fmt: skip
    found = np.asarray(solution.t_events[0])
    return float(found[0]) if len(found) else None


def first_contacts(family: Family, states: States) -> Any:
    """Return an `Answer` for each flight: the solver's contact before either body's flight ends."""
    world = compiled_world(SYSTEM.loop, make_world(family.system, Limits(collisions=1)))
    copies: list[Any] = [np.array(array) for array in world]
    fresh = World(*copies)
    starts = np.tile(copies[World._fields.index("flights")], len(states.places))
    for ball, piece in enumerate(family.pieces):
        own, body = starts[ball::2], family.system.bodies[ball]
        halves = [half_angle(piece, place) for place in states.places[:, ball].tolist()]
        own["piece"] = piece.index
        own["s"], own["c"] = np.array(halves).reshape(-1, 2).T
        scale = 1.0
        if not piece.is_line:
            rho = piece.path_radius(body.radius)
            scale = 2.0 * math.sqrt(family.system.gravity / (body.kappa * rho)) * rho
        own["p"] = states.speeds[:, ball] / scale
    answers = zeros(len(states.places), Answer)
    answers["horizon"] = states.horizon
    compiled(find_first_contacts)(world, fresh, starts, answers)
    return answers


# Displacement, as a share of a radius, above which two contacts count as different.
DISPLACED = 1.0e-11
# Relative distance below which a contact and the end of a flight are not distinguished.
AT_THE_END = 1.0e-12
WORKERS = 2
FLIGHTS_OF_A_FAMILY = 2500


class Sample(NamedTuple):
    """A flight with the instants (s) of its first contact; infinite if there is none."""

    family: Family
    states: States
    number: int
    """Index of the flight among the states."""
    horizon: float
    """Time up to which the solver and the judge have searched (s)."""
    judged: float
    solved: float


@dataclass
class Tally:
    """The results of the flights of a family."""

    contacts: int = 0
    kinds: Counter[str] = field(default_factory=Counter)
    """Numbers of flights: missed, invented, undecided or agreed; their total is that of all."""
    displacement: float = 0.0
    """Greatest distance (relative to the largest radius) by which a contact is displaced."""
    wrong: Document | None = None
    worst: Document | None = None
    sample: list[Sample] = field(default_factory=list)


def compare(family: Family, states: States, keep: int) -> Tally:
    """Compare the results of the solver and of the judge for the flights of a family."""
    answers = first_contacts(family, states)
    on_the_way = np.flatnonzero(answers["horizon"] > 0.0)
    answers, states = answers[on_the_way], states.part(on_the_way)
    flights, bodies = for_judge(family, states, answers["horizon"])
    verdicts = judge_all(flights, bodies)
    tally = Tally()
    size = max(family.sizes)
    for number, (answer, verdict) in enumerate(zip(answers, verdicts, strict=True)):
        kind, displacement = _classify(answer, verdict, size)
        tally.kinds[kind] += 1
        if kind in ("missed", "invented") and tally.wrong is None:
            tally.wrong = scenario_of_flight(family, states, number)
        if displacement > tally.displacement:
            tally.displacement = displacement
            tally.worst = scenario_of_flight(family, states, number)
    tally.contacts = int((verdicts["status"] == CONTACT).sum())
    judged = np.where(verdicts["status"] == CONTACT, verdicts["high"], np.inf)
    solved = np.where(answers["met"] > 0, answers["t"], np.inf)
    instants = zip(range(keep), answers["horizon"], judged, solved, strict=False)
    tally.sample = [Sample(family, states, *one) for one in instants]
    return tally


def _classify(answer: Any, verdict: Any, size: float) -> tuple[str, float]:
    """Return the result of one flight: its kind, and the displacement of its contact."""
    horizon, met, instant = answer
    status, low, high, speed = verdict
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
    """Draw, solve and judge one family."""
    rng = np.random.default_rng(seed)
    family = random_family(rng, kind)
    if grazing:
        states, _ = near_grazing(rng, family, FLIGHTS_OF_A_FAMILY)
    else:
        states = random_states(rng, family, FLIGHTS_OF_A_FAMILY)
    return compare(family, states, keep)


def run_flights(seed: int, wanted: int, grazing: bool, keep: int) -> list[Tally]:
    """Judge family after family, on two cores, until `wanted` flights are judged."""
    seeds = np.random.SeedSequence([seed, int(grazing)])
    tallies, kinds = list[Tally](), count()
    portion = partial(_portion, grazing=grazing, keep=keep)
    with ThreadPoolExecutor(WORKERS) as workers:
        while sum(one.kinds.total() for one in tallies) < wanted:
            tallies += workers.map(portion, seeds.spawn(2 * WORKERS), kinds)
    return tallies


def check_contacts(plan: Plan) -> list[Finding]:
    """Check for missed and invented contacts on random and near-grazing flights."""
    findings: list[Finding] = []
    hostile: list[Sample] = []
    for name, grazing, wanted in (
        ("random flights", False, plan.amount(8_000, 1_000_000)),
        ("near-grazing flights (+-1e-13 R ... +-1e-2 R)", True, plan.amount(2_000, 100_000)),
    ):
        tallies = run_flights(plan.seed, wanted, grazing, plan.amount(8, 10))
        findings += _findings_of(tallies, name)
        if grazing:
            hostile = [one for tally in tallies for one in tally.sample]
    return [*findings, _by_fifty_digits(hostile, plan), *_by_scipy(hostile, plan)]


def _findings_of(tallies: list[Tally], name: str) -> list[Finding]:
    kinds = sum((one.kinds for one in tallies), Counter[str]())
    wrong = next((one.wrong for one in tallies if one.wrong), None)
    far = max(tallies, key=lambda one: one.displacement)
    contacts = sum(one.contacts for one in tallies)
    tried = f"{name}, {contacts} with contact, judged by interval bounds"
    return [
        Finding(quantity, tried, mark, cases=kinds.total(), worst=worst, scenario=scenario)
        for quantity, mark, worst, scenario in (
            ("missed first contacts", 0.0, kinds["missed"], wrong),
            ("invented contacts", 0.0, kinds["invented"], wrong),
            ("undecided by the judge", None, kinds["undecided"], None),
            ("displacement of a contact (R)", DISPLACED, far.displacement, far.worst),
        )
    ]


def _by_fifty_digits(sample: list[Sample], plan: Plan) -> Finding:
    wrong, chosen = 0, _spread(sample, plan.amount(20, 1000))
    for one in chosen:
        scene = scene_of_flight(one.family, one.states, one.number)
        exact = first_contact(scene, mp.mpf(float(one.horizon)))
        instant = float("inf") if exact is None else float(exact)
        agree = [
            instant == other or abs(instant - other) < 1.0e-6 for other in (one.judged, one.solved)
        ]
        wrong += not all(agree)
    tried = "near-grazing flights, 50 digits against the judge and the solver"
    return Finding("contacts decided otherwise", tried, 0.0, cases=len(chosen), worst=wrong)


def _by_scipy(sample: list[Sample], plan: Plan) -> list[Finding]:
    """Count the contacts of near-grazing flights that SciPy's event finder misses."""
    meeting = [one for one in sample if one.judged < np.inf]
    chosen = _spread(meeting, plan.amount(20, 200))
    findings = []
    for tolerance in TOLERANCES:
        missed = 0
        for one in chosen:
            found = first_event(one, tolerance)
            missed += found is None or bool(found > one.judged + 1.0e-3)
        tried = f"near-grazing flights with contact, SciPy's DOP853 at rtol {tolerance:g}"
        quantity = "missed by SciPy's event finder"
        findings.append(Finding(quantity, tried, None, cases=len(chosen), worst=missed))
    return findings


def _spread(items: list[Any], count: int) -> list[Any]:
    """Return at most `count` items, evenly chosen."""
    if len(items) <= count:
        return items
    return [items[int(k * len(items) / count)] for k in range(count)]
