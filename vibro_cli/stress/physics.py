"""What every motion must keep, judged from a finished run: no formula of the solver is used.

No overlap of any two bodies at any sampled instant, the bodies in their order, none beyond a wall,
no jump, energy that never grows, and that only impacts and walls take away; bodies that touch at
their impacts, and impacts that obey their law; the motion of the mirror image is the mirror image
of the motion. Scenes drawn at random are held to it: every run ends, in little time and memory.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable
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

# m, at sizes of a few metres: what rounding of places may do.
OVERLAP = 1.0e-12
NEARBY = 1.0e-9  # m: touches
# Of the energy that moves.
ENERGY = 1.0e-10
# Impacts in less than this time (s) do not get on.
CROWDED, MOMENT = 10_000, 1.0e-9
# Relative, of what a law keeps at one impact.
LAW = 1.0e-12

Floats = Any  # an array of numbers


class Fault(NamedTuple):
    """One thing that is wrong with a run."""

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
    """The motion at so many instants spread evenly, and where flights end."""
    end = float(run.checkpoint()["end_time"])
    # Ends of flights: crossings, impacts, walls, and where contacts begin and end.
    known = run.flights()["t_end"][:samples]
    times = np.unique(np.concatenate([np.linspace(0.0, end, samples), known[known <= end]]))
    table = run.sample(times)
    count = len(run.system.bodies)
    columns = [table[name].reshape(-1, count) for name in ("s", "x", "y", "speed", "arc")]
    return Motion(times, *columns)


def faults_of(run: Run) -> list[Fault]:
    """Everything that is wrong with a run."""
    motion = motion_of(run, 500)
    faults = [*ending(run), *overlaps(run, motion), *order(run, motion), *walls(run, motion)]
    faults += [*jumps(run, motion), *standing(run, motion), *energy(run, motion)]
    return [*faults, *impacts(run)]


def ending(run: Run) -> list[Fault]:
    """Why the run may not have ended as it says."""
    system, cause = run.system, run.end_cause
    if cause == "inadmissible":
        newton = system.law == "normal-impulse" or system.inadmissible == "normal-impulse"
        return [Fault("ending", "inadmissible under normal-impulse")] if newton else []
    open_ends = not system.trace.closed and None in (system.left_end, system.right_end)
    if cause == "end_of_trace" and not open_ends:
        return [Fault("ending", "end of trace beyond walls")]
    if cause == "lift_off" and system.surface != "one-sided":
        return [Fault("ending", "lift-off from a two-sided trace")]
    hits = run.collisions["t"]
    if len(hits) > CROWDED and (hits[CROWDED:] - hits[:-CROWDED]).min() < MOMENT:
        return [Fault("ending", f"{CROWDED} impacts in less than {MOMENT:g} s")]
    if cause not in ("time", "collisions", "end_of_trace", "lift_off"):
        return [Fault("ending", f"end cause {cause}")]
    return []


def overlaps(run: Run, motion: Motion) -> list[Fault]:
    """Pairs of bodies, neighbours or not, that are inside one another."""
    faults = []
    radii = [body.radius for body in run.system.bodies]
    size = max(1.0, float(np.abs([motion.x, motion.y]).max()))
    for b in range(len(radii)):
        for a in range(b):
            dx, dy = (side[:, b] - side[:, a] for side in (motion.x, motion.y))
            depth = radii[a] + radii[b] - np.hypot(dx, dy)
            if not depth.max() <= OVERLAP * size:
                first = int(np.argmax(~(depth <= OVERLAP * size)))
                when = f"t = {motion.t[first]:.9g}, {depth.max():.3g} m deep"
                faults.append(Fault("overlap", f"bodies {a + 1}, {b + 1} from {when}"))
    return faults


def order(run: Run, motion: Motion) -> list[Fault]:
    """Bodies that are not in the order of the start."""
    trace = run.system.trace
    if trace.closed:
        around = np.mod(np.diff(motion.s, axis=1, append=motion.s[:, :1]), trace.length)
        wrong = np.abs(around.sum(axis=1) - trace.length) > 0.5 * trace.length
        if motion.s.shape[1] == 1:
            wrong = np.zeros(len(wrong), dtype=bool)
    else:
        wrong = (np.diff(motion.s, axis=1) <= 0.0).any(axis=1)
    if wrong.any():
        return [Fault("order", f"lost at t = {motion.t[np.argmax(wrong)]:.9g}")]
    return []


def walls(run: Run, motion: Motion) -> list[Fault]:
    """Bodies beyond a wall."""
    faults = []
    pieces = run.system.trace.pieces
    for right, wall in enumerate((run.system.left_end, run.system.right_end)):
        if wall is None or run.system.trace.closed:
            continue
        piece = pieces[-1 if right else 0]
        radii = np.array([body.radius for body in run.system.bodies])
        depth = _beyond_wall(run.system, bool(right), motion.x, motion.y) + radii
        # The plane goes on beyond the trace, which may come back to it on the other side.
        near = np.abs(motion.s - (piece.start_s + piece.length if right else 0.0))
        beside = (motion.arc == piece.index + 1) & (near < 1.5 * piece.radius)
        depth = np.where(beside, depth, -1.0)
        if depth.max() > OVERLAP * max(1.0, float(np.abs(motion.x).max())):
            where = "right" if right else "left"
            faults.append(Fault("wall", f"{depth.max():.3g} m beyond the {where} wall"))
    return faults


def _beyond_wall(system: TraceSystem, right: bool, x: Any, y: Any) -> Any:
    """How far (m) places are beyond the plane of the left or right wall."""
    piece = system.trace.pieces[-1 if right else 0]
    corner = piece.end if right else piece.start
    slope = piece.end_slope if right else piece.start_slope
    away = (x - corner[0]) * math.cos(slope) + (y - corner[1]) * math.sin(slope)
    return away if right else -away


def jumps(run: Run, motion: Motion) -> list[Fault]:
    """Centres that move farther between two instants than their speeds allow."""
    dt = np.diff(motion.t)[:, None]
    way = np.hypot(np.diff(motion.x, axis=0), np.diff(motion.y, axis=0))
    table = run.collisions
    told = [np.abs(table[f"speed_{end}_{when}"]) for end in "ab" for when in ("pre", "post")]
    fastest = max(float(column.max(initial=0.0)) for column in [*told, np.abs(motion.speed)])
    turning = run.system.turning.square if run.system.turning else 0.0
    pull = run.system.gravity + turning * float(np.abs(motion.x).max() + 10.0)
    excess = way - (fastest + 2.0 * pull * dt) * dt - 1.0e-12 * (1.0 + np.abs(motion.x[1:]))
    if not excess.max(initial=0.0) <= 0.0:
        row, body = np.unravel_index(np.argmax(excess), excess.shape)
        return [Fault("jump", f"body {body + 1} by {excess.max():.3g} m at {motion.t[row]:.9g}")]
    return []


def standing(run: Run, motion: Motion) -> list[Fault]:
    """Bodies that stand still with nothing to lean on.

    Not those that move between two instants, and are stopped at each of them.
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
            return [Fault("standing", f"body {body + 1} stands free at t = {motion.t[row]:.9g}")]
    return []


def _pull(run: Run, motion: Motion, row: int, body: int) -> float:
    """Force of gravity and turning along the trace (N/kg)."""
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
    """Whether a body touches a wall or a neighbour on a side (1 right, -1 left)."""
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
    """Energy (J) at every instant, and how much of it moves."""
    kinetic, height = energies(run, motion.speed, motion.x, motion.y)
    total = (kinetic + height).sum(axis=1)
    scale = float(kinetic.sum(axis=1).max() + np.ptp(height, axis=0).sum() + np.abs(height).max())
    return total, scale


def grows_by_its_law(run: Run) -> bool:
    """Whether impacts may add rolling energy: m v is kept, not kappa m v."""
    kappas = {body.kappa for body in run.system.bodies}
    return run.system.law == "translational" and len(kappas) > 1


def energy(run: Run, motion: Motion) -> list[Fault]:
    """Energy that grows, or is lost where nothing happens."""
    total, scale = _energy_of(run, motion)
    steps = np.diff(total) / scale
    flights = run.flights()
    hits = np.concatenate([run.collisions["t"], flights["t_end"][flights["cause_end"] == "wall"]])
    happens = np.histogram(hits, motion.t)[0] > 0 if len(motion.t) > 1 else np.zeros(0, bool)
    happens = happens | np.isin(motion.t[1:], hits) | np.isin(motion.t[:-1], hits)
    faults = []
    for kind, wrong in (
        ("energy_lost", ~happens & (steps < -ENERGY)),
        ("energy_grows", steps > ENERGY),
    ):
        if kind == "energy_grows" and grows_by_its_law(run):
            wrong = wrong & ~happens
        if wrong.any():
            row = int(np.argmax(wrong))
            faults.append(Fault(kind, f"by {steps[row]:.3g} of it at t = {motion.t[row]:.9g}"))
    if not faults and not grows_by_its_law(run) and (total[-1] - total[0]) > ENERGY * scale:
        faults.append(Fault("energy_grows", f"by {(total[-1] - total[0]) / scale:.3g} in all"))
    return faults


def impacts(run: Run) -> list[Fault]:
    """Impacts without contact, or against their law."""
    table = run.collisions
    faults = []
    gap = np.abs(table["gap"])
    if len(gap) and not gap.max() <= OVERLAP * 10.0:
        faults.append(Fault("gap", f"bodies {gap.max():.3g} m apart at an impact"))
    plain = ~table["simultaneous"] & ~table["contact"] & ~table["grazing"]
    before = np.abs(table["speed_a_pre"]) + np.abs(table["speed_b_pre"])
    receding = plain & (table["approach_speed"] < -1.0e-9 * before)
    if receding.any():
        faults.append(Fault("receding", f"impact {int(np.argmax(receding)) + 1}"))
    for row in np.flatnonzero(plain).tolist():
        one, two = (run.system.bodies[int(table[f"ball_{end}"][row]) - 1] for end in "ab")
        off = _against_law(table, row, one, two)
        if off > LAW:
            faults.append(Fault("law", f"impact {row + 1} off by {off:.3g}"))
            break
    return faults


def _against_law(table: Any, row: int, one: Any, two: Any) -> float:
    """How far (relative) an impact is from keeping what its law keeps."""
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


# Instants at which a motion and its mirror image are compared.
INSTANTS = 24
# Of the trace's length: what is not looked into any further.
NEAR = 1.0e-9
# The same under laws that do not act along the line of centres: what would come of bounces lower
# than the rounding of the places (1e-7 m/s) is not known there. From then on that a body turns at a
# wall, up to rounding, too: no change of the inputs shows it where the body, or its row, has
# started from that wall at rest.
FAINT = 1.0e-7
# Times the speed of bounces as high as that rounding: two bodies, in the motion and in its image,
# part faster or slower by so much for what decides whether they are in contact.
FEW = 8.0
# Rounding of a place, as a share of the size of its coordinates.
PLACES = 64.0 * EPSILON
# Rounding of places and speeds, as a relative change of the inputs.
ROUNDING = 2.0**-40
# Of the trace's length: where such a change does as much, nothing is told from rounding.
LOST = 1.0e-3

Solve = Any  # a function of a system that returns its run


def mirrored_system(system: TraceSystem) -> TraceSystem:
    """The mirror image of any system: right for left."""
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
    """Arc lengths (m) at some instants: a row for each, a column for each body."""
    count = len(run.system.bodies)
    return run.sample(times)["s"].reshape(-1, count)


def _distances(run: Run, one: Any, other: Any) -> Any:
    """How far apart (m) two motions are at every instant."""
    apart = np.abs(one - other)
    if run.system.trace.closed:
        apart = np.minimum(apart, run.system.trace.length - apart)
    return apart.max(axis=1)


def first_graze(run: Run) -> float:
    """When a body, or a row, first comes to a wall from elsewhere at a speed lost in rounding (s).

    It turns there, then, up to the rounding of its place: the height that is left over, or lacks,
    decides by rounding when it comes and with which speed. Infinite if none does.
    """
    flights = run.flights()
    hits = (flights["cause_end"] == "wall") & (flights["cause_start"] != "wall")
    hits &= flights["t_end"] > flights["t_start"]
    if not hits.any():
        return math.inf
    motion = run.sample(np.unique(flights["t_end"][hits]), "before")
    size = max(float(np.abs(motion[axis]).max()) for axis in ("x", "y"))
    slow = motion["speed"] ** 2 <= 2.0 * run.system.gravity * PLACES * size
    for t, ball in zip(motion["t"][slow], motion["ball"][slow], strict=True):
        if (hits & (flights["t_end"] == t) & (flights["ball"] == ball)).any():
            return float(t)
    return math.inf


def size_of_places(run: Run, places: Iterable[float]) -> float:
    """Size (m) of the four coordinates, or twice the radii, of the places of a pair."""
    radii = [piece.radius for piece in run.system.trace.pieces if not piece.is_line]
    return 4.0 * float(max(*places, *radii))


def _size(run: Run) -> float:
    """Return `size_of_places` of where the bodies start."""
    places = run.sample([0.0])
    return size_of_places(run, (float(np.abs(places[axis]).max()) for axis in ("x", "y")))


def _first_doubt(run: Run) -> tuple[float, float]:
    """When rounding first decides what comes of impacts (s), and the speed that is open then (m/s).

    Bounces as high as the rounding of places have that speed. They are in doubt, and so are
    sequences of impacts at one instant, which are what is left of such bounces of several pairs.
    """
    speed = math.sqrt(2.0 * run.system.gravity * CONTACT_ROUNDING * _size(run))
    t, approach = run.collisions["t"], run.collisions["approach_speed"]
    doubtful = approach < FEW * speed
    doubtful[1:] |= t[1:] == t[:-1]
    return float(t[doubtful].min(initial=math.inf)), speed


def _order_in_doubt(run: Run) -> float:
    """When bodies first meet again from a gap lost in rounding, one of them hit meanwhile (s).

    Which impact of such a row comes before which is then decided by rounding, and what comes of
    it differs by as much as the speeds of the impacts. Infinite if there is no such row.
    """
    height = CONTACT_ROUNDING * _size(run)
    parted = dict[tuple[int, int], tuple[float, float]]()  # of each pair: when, and how fast
    disturbed = set[tuple[int, int]]()  # those of which another pair has hit a body since
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
    """How far (m) the motion of the mirror image is from the mirror image of the motion, and when.

    Zero as long as it is no more than what rounding does. That of the inputs moves both of them by
    what changes of that size of every input in turn do: where contact begins or ends it grows with
    their square root. That of places leaves speeds open once bounces are as low.
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
            moved[~known] = np.inf  # it ends otherwise: nothing is told of what comes later
        before = min(moved[times <= doubt].max(initial=ROUNDING * length), length)
        grown = np.maximum.accumulate(np.clip(moved / before, 1.0, 1.0 / ROUNDING))
        bad = (off > near + 2.0 * moved + faint * grown) & (moved < LOST * length)
        if not bad.any():
            return 0.0, 0.0
    row = int(np.argmax(bad))
    return float(off[row]), float(times[row])


SECONDS = 10.0  # of the processor, for a run
JUDGING = 120.0  # for a scene, its mirror image and all runs that tell how far both may be apart
MEMORY = 2**30


def check_drawn(plan: Plan) -> list[Finding]:
    """Faults of the program, broken laws of mechanics, and wrong mirror images."""
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
    """A function that tells what is wrong with the run of a document, which may not end."""
    watched = Watched(faults_of_document, MEMORY)

    def judged(document: Document) -> list[Fault]:
        try:
            return watched(document, seconds)
        except GivenUp as reason:
            return [Fault("failed", str(reason))]

    return judged


def faults_of_document(document: Document) -> list[Fault]:
    """What is wrong with the run of a document."""
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
