"""Laws that every motion must obey, checked on finished runs without formulas of the solver.

At sampled instants no two bodies overlap, all are in order, none is beyond a wall, and none jumps.
Energy never grows, and only impacts and walls dissipate it. Bodies touch at their impacts, and
impacts obey their law. The motion of the mirror image is the mirror image of the motion. Random
scenes are checked, whose runs must also end in little time and memory.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from vibro_cli.kernels.contact.contact_kinematics import CONTACT_ROUNDING
from vibro_cli.kernels.numerics.constants import EPSILON
from vibro_cli.mechanics.system import TraceSystem
from vibro_cli.stress.drawing import draw
from vibro_cli.stress.oracles.scene import weight_and_response
from vibro_cli.stress.oracles.sensitivity import neighbouring
from vibro_cli.stress.scenes import (
    Document,
    Finding,
    GivenUp,
    Plan,
    Watched,
    energies,
    system_of,
)
from vibro_cli.systems.run import Run
from vibro_cli.systems.trace import simulate_system

# Overlap (m) that rounding of places may cause, at sizes of a few metres.
OVERLAP = 1.0e-12
NEARBY = 1.0e-9  # m: distance of bodies that touch
# Relative tolerance of the energy that varies.
ENERGY = 1.0e-10
# A run with so many impacts in so short a time (s) makes no progress.
CROWDED, MOMENT = 10_000, 1.0e-9
# Relative tolerance of the quantity that a law conserves at an impact.
LAW = 1.0e-12

Floats = Any  # an array of numbers


class Fault(NamedTuple):
    """One fault of a run."""

    kind: str
    text: str


class Motion(NamedTuple):
    """A sampled motion: an array with a row for each instant, a column for each body."""

    t: Floats
    s: Floats
    x: Floats
    y: Floats
    speed: Floats
    arc: Floats


def motion_of(run: Run, samples: int) -> Motion:
    """Sample the motion at evenly spaced instants and at the ends of flights."""
    end = float(run.checkpoint()["end_time"])
    # Flights end at crossings, impacts and walls, and where contacts begin and end.
    known = run.flights()["t_end"][:samples]
    times = np.unique(np.concatenate([np.linspace(0.0, end, samples), known[known <= end]]))
    table = run.sample(times)
    count = len(run.system.bodies)
    columns = [table[name].reshape(-1, count) for name in ("s", "x", "y", "speed", "arc")]
    return Motion(times, *columns)


def faults_of(run: Run) -> list[Fault]:
    """Return all faults of a run."""
    motion = motion_of(run, 500)
    at_instants = (overlaps, order, walls, jumps, standing, energy)
    faults = [fault for check in at_instants for fault in check(run, motion)]
    return [*ending(run), *faults, *impacts(run)]


def ending(run: Run) -> Iterator[Fault]:
    """Yield the fault of the end cause, if there is one."""
    system, cause, hits = run.system, run.end_cause, run.collisions["t"]
    open_ends = not system.trace.closed and None in (system.left_end, system.right_end)
    if cause == "inadmissible":
        if "normal-impulse" in (system.law, system.inadmissible):
            yield Fault("ending", "inadmissible under normal-impulse")
    elif cause == "end_of_trace" and not open_ends:
        yield Fault("ending", "end of trace beyond walls")
    elif cause == "lift_off" and system.surface != "one-sided":
        yield Fault("ending", "lift-off from a two-sided trace")
    elif len(hits) > CROWDED and (hits[CROWDED:] - hits[:-CROWDED]).min() < MOMENT:
        yield Fault("ending", f"{CROWDED} impacts in less than {MOMENT:g} s")
    elif cause not in ("time", "collisions", "end_of_trace", "lift_off"):
        yield Fault("ending", f"end cause {cause}")


def overlaps(run: Run, motion: Motion) -> Iterator[Fault]:
    """Yield pairs of bodies, neighbours or not, that overlap."""
    radii = [body.radius for body in run.system.bodies]
    size = max(1.0, float(np.abs([motion.x, motion.y]).max()))
    for b in range(len(radii)):
        for a in range(b):
            dx, dy = (side[:, b] - side[:, a] for side in (motion.x, motion.y))
            depth = radii[a] + radii[b] - np.hypot(dx, dy)
            if not depth.max() <= OVERLAP * size:
                first = int(np.argmax(~(depth <= OVERLAP * size)))
                when = f"t = {motion.t[first]:.9g}, {depth.max():.3g} m deep"
                yield Fault("overlap", f"bodies {a + 1}, {b + 1} from {when}")


def order(run: Run, motion: Motion) -> Iterator[Fault]:
    """Yield a fault if the bodies are not in their initial order."""
    trace = run.system.trace
    if trace.closed:
        around = np.mod(np.diff(motion.s, axis=1, append=motion.s[:, :1]), trace.length)
        wrong = np.abs(around.sum(axis=1) - trace.length) > 0.5 * trace.length
        if motion.s.shape[1] == 1:
            wrong = np.zeros(len(wrong), dtype=bool)
    else:
        wrong = (np.diff(motion.s, axis=1) <= 0.0).any(axis=1)
    if wrong.any():
        yield Fault("order", f"lost at t = {motion.t[np.argmax(wrong)]:.9g}")


def walls(run: Run, motion: Motion) -> Iterator[Fault]:
    """Yield walls that bodies have passed."""
    pieces = run.system.trace.pieces
    for right, wall in enumerate((run.system.left_end, run.system.right_end)):
        if wall is None or run.system.trace.closed:
            continue
        piece = pieces[-1 if right else 0]
        radii = np.array([body.radius for body in run.system.bodies])
        depth = _beyond_wall(run.system, bool(right), motion.x, motion.y) + radii
        # The plane extends beyond the trace, which may return to its other side.
        near = np.abs(motion.s - (piece.start_s + piece.length if right else 0.0))
        beside = (motion.arc == piece.index + 1) & (near < 1.5 * piece.radius)
        depth = np.where(beside, depth, -1.0)
        if depth.max() > OVERLAP * max(1.0, float(np.abs(motion.x).max())):
            where = "right" if right else "left"
            yield Fault("wall", f"{depth.max():.3g} m beyond the {where} wall")


def _beyond_wall(system: TraceSystem, right: bool, x: Any, y: Any) -> Any:
    """Return how far (m) places are beyond the plane of the left or right wall."""
    piece = system.trace.pieces[-1 if right else 0]
    corner = piece.end if right else piece.start
    slope = piece.end_slope if right else piece.start_slope
    away = (x - corner[0]) * math.cos(slope) + (y - corner[1]) * math.sin(slope)
    return away if right else -away


def jumps(run: Run, motion: Motion) -> Iterator[Fault]:
    """Yield a fault if a centre moves farther between two instants than its speed allows."""
    dt = np.diff(motion.t)[:, None]
    way = np.hypot(np.diff(motion.x, axis=0), np.diff(motion.y, axis=0))
    table = run.collisions
    speeds = [np.abs(table[f"speed_{end}_{when}"]) for end in "ab" for when in ("pre", "post")]
    fastest = max(float(column.max(initial=0.0)) for column in [*speeds, np.abs(motion.speed)])
    turning = run.system.turning.square if run.system.turning else 0.0
    pull = run.system.gravity + turning * float(np.abs(motion.x).max() + 10.0)
    excess = way - (fastest + 2.0 * pull * dt) * dt - 1.0e-12 * (1.0 + np.abs(motion.x[1:]))
    if not excess.max(initial=0.0) <= 0.0:
        row, body = np.unravel_index(np.argmax(excess), excess.shape)
        yield Fault("jump", f"body {body + 1} by {excess.max():.3g} m at {motion.t[row]:.9g}")


def standing(run: Run, motion: Motion) -> Iterator[Fault]:
    """Yield a fault if a body stands still against a force without a support.

    A body that moves between two instants and is at rest at both is not a fault.
    """
    flights = run.flights()
    still = (motion.speed[:-1] == 0.0) & (motion.speed[1:] == 0.0)
    still &= np.diff(motion.t)[:, None] > 1.0e-6
    for row, body in np.argwhere(still).tolist():
        pull = _pull(run, motion, row, body)
        leans = _leans(run, motion, row, body, 1 if pull > 0.0 else -1)
        between = (flights["t_end"] > motion.t[row]) & (flights["t_end"] < motion.t[row + 1])
        moved = (between & (flights["ball"] == body + 1)).any()
        if abs(pull) > 1.0e-9 * run.system.gravity and not leans and not moved:
            yield Fault("standing", f"body {body + 1} stands free at t = {motion.t[row]:.9g}")
            return


def _pull(run: Run, motion: Motion, row: int, body: int) -> float:
    """Return the force of gravity and rotation along the trace (N/kg)."""
    system: TraceSystem = run.system
    piece = system.trace.pieces[int(motion.arc[row, body]) - 1]
    slope = piece.start_slope
    if not piece.is_line:
        slope += piece.sign * (motion.s[row, body] - piece.start_s) / piece.radius
    pull = -system.gravity * math.sin(slope)
    if system.turning is not None:
        arm = float(motion.x[row, body]) - system.turning.x
        pull += system.turning.square * arm * math.cos(slope)
    return pull


def _leans(run: Run, motion: Motion, row: int, body: int, side: int) -> bool:
    """Return whether a body touches a wall or a neighbour on a side (1 right, -1 left)."""
    system, count = run.system, len(run.system.bodies)
    wall = system.right_end if side > 0 else system.left_end
    radius = system.bodies[body].radius
    depth = radius + _beyond_wall(system, side > 0, motion.x[row, body], motion.y[row, body])
    if wall is not None and not system.trace.closed and abs(depth) < NEARBY:
        return True
    other = body + side
    if system.trace.closed:
        other %= count
    if not 0 <= other < count or other == body:
        return False
    dx, dy = (place[row, other] - place[row, body] for place in (motion.x, motion.y))
    return bool(math.hypot(dx, dy) < radius + system.bodies[other].radius + NEARBY)


def _energy_of(run: Run, motion: Motion) -> tuple[Floats, float]:
    """Return the energy (J) at every instant, and a scale (J) for its changes."""
    kinetic, height = energies(run, motion.speed, motion.x, motion.y)
    total = (kinetic + height).sum(axis=1)
    scale = float(kinetic.sum(axis=1).max() + np.ptp(height, axis=0).sum() + np.abs(height).max())
    return total, scale


def grows_by_its_law(run: Run) -> bool:
    """Return whether impacts may add rolling energy, since they conserve m v, not kappa m v."""
    kappas = {body.kappa for body in run.system.bodies}
    return run.system.law == "translational" and len(kappas) > 1


def energy(run: Run, motion: Motion) -> Iterator[Fault]:
    """Yield faults where energy grows, or is lost without an impact."""
    total, scale = _energy_of(run, motion)
    steps = np.diff(total) / scale
    flights = run.flights()
    hits = np.concatenate([run.collisions["t"], flights["t_end"][flights["cause_end"] == "wall"]])
    happens = np.histogram(hits, motion.t)[0] > 0 if len(motion.t) > 1 else np.zeros(0, bool)
    happens = happens | np.isin(motion.t[1:], hits) | np.isin(motion.t[:-1], hits)
    sound = True
    for kind, wrong in (
        ("energy_lost", ~happens & (steps < -ENERGY)),
        ("energy_grows", steps > ENERGY),
    ):
        if kind == "energy_grows" and grows_by_its_law(run):
            wrong = wrong & ~happens
        if wrong.any():
            row, sound = int(np.argmax(wrong)), False
            yield Fault(kind, f"by {steps[row]:.3g} of it at t = {motion.t[row]:.9g}")
    if sound and not grows_by_its_law(run) and (total[-1] - total[0]) > ENERGY * scale:
        yield Fault("energy_grows", f"by {(total[-1] - total[0]) / scale:.3g} in all")


def impacts(run: Run) -> Iterator[Fault]:
    """Yield impacts without contact, or that violate their law."""
    table = run.collisions
    gap = np.abs(table["gap"])
    if len(gap) and not gap.max() <= OVERLAP * 10.0:
        yield Fault("gap", f"bodies {gap.max():.3g} m apart at an impact")
    plain = ~table["simultaneous"] & ~table["contact"] & ~table["grazing"]
    before = np.abs(table["speed_a_pre"]) + np.abs(table["speed_b_pre"])
    receding = plain & (table["approach_speed"] < -1.0e-9 * before)
    if receding.any():
        yield Fault("receding", f"impact {int(np.argmax(receding)) + 1}")
    for row in np.flatnonzero(plain).tolist():
        one, two = (run.system.bodies[int(table[f"ball_{end}"][row]) - 1] for end in "ab")
        off = _against_law(table, row, one, two)
        if off > LAW:
            yield Fault("law", f"impact {row + 1} off by {off:.3g}")
            return


def _against_law(table: Any, row: int, one: Any, two: Any) -> float:
    """Return the relative error of the quantity that the law of an impact conserves."""
    law = str(table["law"][row])
    if law == "normal-impulse":
        return 0.0
    own = [float(1 / weight_and_response(law, body, 1)[1]) for body in (one, two)]
    change_a = table["speed_a_post"][row] - table["speed_a_pre"][row]
    change_b = table["speed_b_post"][row] - table["speed_b_pre"][row]
    given, taken = own[0] * change_a, own[1] * change_b
    before = abs(table["speed_a_pre"][row]) + abs(table["speed_b_pre"][row])
    most = max(abs(one.kappa * one.mass * before), abs(two.kappa * two.mass * before), 1e-300)
    return float(abs(given + taken) / (abs(given) + abs(taken) + most))


# Number of instants at which a motion and its mirror image are compared.
INSTANTS = 24
# Difference, as a share of the trace's length, that is not examined further.
NEAR = 1.0e-9
# The same for laws that do not act along the line of centres, where the outcome of bounces lower
# than the rounding of places (1e-7 m/s) is unknown. It also holds after a body turns at a wall up
# to rounding: no change of the inputs shows this if the body, or its row, started at rest there.
FAINT = 1.0e-7
# Multiple of the speed of bounces as high as that rounding. Separation speeds in a motion and its
# image may differ by so much where rounding decides whether bodies are in contact.
FEW = 8.0
# Rounding of a place, as a share of the size of its coordinates.
PLACES = 64.0 * EPSILON
# Rounding of places and speeds, as a relative change of the inputs.
ROUNDING = 2.0**-40
# Effect of such a change, as a share of the trace's length, at which the motion is lost.
LOST = 1.0e-3

Solve = Any  # a function of a system that returns its run


def mirrored_system(system: TraceSystem) -> TraceSystem:
    """Return the mirror image of a system, with left and right exchanged."""
    pieces = system.trace.pieces
    starts = []
    for state in reversed(system.initial):
        piece = pieces[state.piece]
        place = piece.length - state.position if piece.is_line else -state.position
        starts.append(
            replace(state, piece=len(pieces) - 1 - state.piece, position=place, speed=-state.speed)
        )
    count = len(system.bodies)
    pairs, seam = system.restitution[: count - 1], system.restitution[count - 1 :]
    turning = system.turning
    if turning is not None:
        turning = replace(turning, x=pieces[-1].end[0] - turning.x)
    return replace(
        system,
        trace=system.trace.mirrored(),
        bodies=system.bodies[::-1], initial=tuple(starts), restitution=(*pairs[::-1], *seam),
        left_end=system.right_end, right_end=system.left_end, turning=turning,
    )  # fmt: skip


def _places(run: Run, times: Any) -> Any:
    """Return arc lengths (m) at some instants, shape (instants, bodies)."""
    count = len(run.system.bodies)
    return run.sample(times)["s"].reshape(-1, count)


def _distances(run: Run, one: Any, other: Any) -> Any:
    """Return the distance (m) of two motions at every instant."""
    apart = np.abs(one - other)
    if run.system.trace.closed:
        apart = np.minimum(apart, run.system.trace.length - apart)
    return apart.max(axis=1)


def first_graze(run: Run) -> float:
    """Return when a body, or a row, first reaches a wall at a speed lost in rounding (s).

    There it turns, up to the rounding of its place; rounding decides when it arrives and with what
    speed. Flights that begin at a wall do not count. Infinite if there is none.
    """
    flights = run.flights()
    hits = (flights["cause_end"] == "wall") & (flights["cause_start"] != "wall")
    hits &= flights["t_end"] > flights["t_start"]
    turned = _first_turn(flights)
    if not hits.any():
        return turned
    motion = run.sample(np.unique(flights["t_end"][hits]), "before")
    size = max(float(np.abs(motion[axis]).max()) for axis in ("x", "y"))
    slow = motion["speed"] ** 2 <= 2.0 * run.system.gravity * PLACES * size
    for t, ball in zip(motion["t"][slow], motion["ball"][slow], strict=True):
        if (hits & (flights["t_end"] == t) & (flights["ball"] == ball)).any():
            return min(float(t), turned)
    return turned


def _first_turn(flights: dict[str, Any]) -> float:
    """Return when a body that has rolled off a wall first turns there without an impact (s).

    A segment at rest follows one that ends with the speed left by rounding. Infinite if none.
    """
    order = np.lexsort((flights["t_start"], flights["ball"]))
    own = {name: values[order] for name, values in flights.items()}
    turns = (own["cause_end"][:-1] == "segment") & (own["cause_start"][1:] == "segment")
    turns &= (own["rate_end"][:-1] != 0.0) & (own["rate_start"][1:] == 0.0)
    turns &= (own["t_end"] > own["t_start"])[:-1] & (own["ball"][:-1] == own["ball"][1:])
    return float(own["t_start"][1:][turns].min(initial=math.inf))


def size_of_places(run: Run, places: Iterable[float]) -> float:
    """Return the size (m) that scales the rounding of places: four times the largest coordinate.

    The radii of the arcs count as coordinates.
    """
    radii = [piece.radius for piece in run.system.trace.pieces if not piece.is_line]
    return 4.0 * float(max(*places, *radii))


def _size(run: Run) -> float:
    """Return `size_of_places` of the start."""
    places = run.sample([0.0])
    return size_of_places(run, (float(np.abs(places[axis]).max()) for axis in ("x", "y")))


def _first_doubt(run: Run) -> tuple[float, float]:
    """Return when rounding first decides the outcome of impacts (s), and the uncertain speed (m/s).

    It is the speed of bounces as high as the rounding of places. The outcome is also uncertain for
    sequences of impacts at one instant, which may stand for such bounces of several pairs.
    """
    speed = math.sqrt(2.0 * run.system.gravity * CONTACT_ROUNDING * _size(run))
    t, approach = run.collisions["t"], run.collisions["approach_speed"]
    doubtful = approach < FEW * speed
    doubtful[1:] |= t[1:] == t[:-1]
    return float(t[doubtful].min(initial=math.inf)), speed


def _order_in_doubt(run: Run) -> float:
    """Return when bodies first meet again from a gap lost in rounding, one hit meanwhile (s).

    Rounding then decides the order of the impacts in the row, and outcomes differ by as much as
    the speeds of the impacts. Infinite if there is no such row.
    """
    height = CONTACT_ROUNDING * _size(run)
    parted = dict[tuple[int, int], tuple[float, float]]()  # per pair: time and separation speed
    disturbed = set[tuple[int, int]]()  # pairs of which another impact has hit a body since
    names = ("t", "ball_a", "ball_b", "approach_speed", "separation_speed")
    for t, a, b, came, left in zip(*(run.collisions[name].tolist() for name in names), strict=True):
        since, speed = parted.get((a, b), (t, 0.0))
        if (a, b) in disturbed and since < t and min(speed, came) * (t - since) < height:
            return float(since)
        parted[a, b] = t, left
        disturbed.discard((a, b))
        disturbed |= {pair for pair in parted if len({a, b} & set(pair)) == 1}
    return math.inf


def distance_from_image(run: Run, solve: Solve) -> tuple[float, float]:
    """Return the distance (m) of the motion of the image from the image of the motion, and when.

    It is zero if rounding explains it. The effect of rounding of the inputs is measured by changes
    of that size of each input; where contact begins or ends, it grows with their square root.
    Rounding of places makes speeds uncertain once bounces are as low.
    """
    system, length = run.system, run.system.trace.length
    image = solve(mirrored_system(system))
    end = min(float(one.checkpoint()["end_time"]) for one in (run, image))
    times = np.linspace(0.0, end, INSTANTS + 1)[1:]
    ours = _places(run, times)
    off = _distances(run, ours, length - _places(image, times)[:, ::-1])
    normal = system.law == "normal-impulse"
    near = length * np.where(normal & (times < first_graze(run)), NEAR, FAINT)
    if (off > near).any():
        near[times > min(map(_order_in_doubt, (run, image)))] = math.inf
    if not (off > near).any():
        return 0.0, 0.0
    doubt, speed = _first_doubt(run)
    faint = FEW * speed * np.maximum(times - doubt, 0.0)
    moved = np.zeros(len(times))
    for other in neighbouring(system, ROUNDING):
        changed = solve(other)
        there = float(changed.checkpoint()["end_time"])
        known = times <= there
        places = _distances(run, ours[known], _places(changed, times[known]))
        moved[known] = np.maximum(moved[known], places)
        if there < end * (1.0 - NEAR):
            moved[~known] = np.inf  # it ends otherwise: nothing is known of later instants
        before = min(moved[times <= doubt].max(initial=ROUNDING * length), length)
        grown = np.maximum.accumulate(np.clip(moved / before, 1.0, 1.0 / ROUNDING))
        bad = (off > near + 2.0 * moved + faint * grown) & (moved < LOST * length)
        if not bad.any():
            return 0.0, 0.0
    row = int(np.argmax(bad))
    return float(off[row]), float(times[row])


SECONDS = 10.0  # of processor time, for a run
JUDGING = 120.0  # for a scene, its mirror image and all runs with changed inputs
MEMORY = 2**30


def check_drawn(plan: Plan) -> list[Finding]:
    """Check random scenes for program faults, broken laws of mechanics, wrong mirror images."""
    tried = "scenes drawn at random, open and closed, 1 to 6 bodies, and their mirror images"
    failed = Finding("runs that fail, or take over 10 s or 1 GB", tried, 0.0)
    broken = Finding("laws of mechanics that a run breaks", tried, 0.0)
    lopsided = Finding("motions that are not those of the mirror image", tried, 0.0)
    judged = judge()
    for number in range(plan.scenes(40, 4000)):
        document = draw(plan.seed, number)
        kinds = {fault.kind for fault in judged(document)}
        failed.take(float("failed" in kinds), document)
        lopsided.take(float("mirror" in kinds), document)
        broken.take(float(len(kinds - {"failed", "mirror"})), document)
    return [failed, broken, lopsided]


def judge(seconds: float = JUDGING) -> Callable[[Document], list[Fault]]:
    """Return a function that finds the faults of the run of a document, even if it never ends."""
    watched = Watched(faults_of_document, MEMORY)

    def judged(document: Document) -> list[Fault]:
        try:
            return watched(document, seconds)
        except GivenUp as reason:
            return [Fault("failed", str(reason))]

    return judged


def faults_of_document(document: Document) -> list[Fault]:
    """Return the faults of the run of a document."""
    stop = document["stop"]

    def solve(system: TraceSystem) -> Run:
        begin = time.process_time()
        run = simulate_system(system, stop.get("time"), stop.get("collisions"))
        if (taken := time.process_time() - begin) > SECONDS:
            raise TimeoutError(f"a run took {taken:.1f} s")
        return run

    try:
        run = solve(system_of(document))
        run.summary_record()
        faults = faults_of(run)
        if not faults:
            distance, t = distance_from_image(run, solve)
            if distance > 0.0:
                faults.append(Fault("mirror", f"{distance:.3g} m off at t = {t:.9g}"))
    except Exception as fault:
        return [Fault("failed", repr(fault))]
    return faults
