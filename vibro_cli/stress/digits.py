"""Scenes drawn at random against high precision: motions in 40 digits, tangent maps in 50.

A motion is compared with the oracle's at instants spread over it, in units of what a small change
of the inputs does to it, as far as that is not lost and nothing turns at a wall, but not amid
bounces that are summed; contacts by the instants at which they begin and end. A tangent map is
compared with differences of neighbouring motions, in the scenes whose motion has a derivative
through its first impacts: of two bodies or more that do not touch at the start, none of which comes
to rest at a wall, until the first impact that is not smooth.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from copy import deepcopy
from typing import Any, NamedTuple

import numpy as np

from vibro_cli.kernels.contact.contact_kinematics import CONTACT_ROUNDING
from vibro_cli.mechanics.system import TraceSystem
from vibro_cli.numerics.elementwise import EPSILON
from vibro_cli.scenario.problems import ScenarioError
from vibro_cli.stress.drawing import draw
from vibro_cli.stress.finding import Document, Finding, Plan, Worst
from vibro_cli.stress.left_open import (
    LeftOpen,
    begun,
    left_open,
    order_left_open,
    size_of,
    throw_left_open,
    untold,
)
from vibro_cli.stress.oracles.oracle import Oracle, Told
from vibro_cli.stress.oracles.reference_solver import happenings_of
from vibro_cli.stress.oracles.scene import mp, scene_of_system
from vibro_cli.stress.oracles.sensitivity import MOST_GROWTH, differences, error_of
from vibro_cli.stress.physics import first_graze
from vibro_cli.stress.scenes import GivenUp, Watched, system_of
from vibro_cli.systems.run import Run
from vibro_cli.systems.trace import simulate_system
from vibro_cli.systems.trace.tangents import follow_system, time_scale

MARK = 64.0  # of eps times the amplification
INSTANTS = 16
CHANGE = 2.0**-30  # of an input, relative
# Motion beyond this amplification says nothing any more.
LOST = 1.0e6
MOST_EVENTS = 300
SECONDS = 60.0  # of the processor
NEARBY = 1.0e-4  # s
CONTACT_KINDS = ("contact_closed", "contact_opened")

Floats = Any  # an array of numbers


class Verdict(NamedTuple):
    """How far a run is from the oracle's; None where there was nothing to compare."""

    motion: float | None = None
    """Greatest distance in units of eps times amplification, up to the first lasting contact."""
    after: float | None = None
    """Greatest distance (m, m/s) beyond 64 of these units, and what instants leave open, after."""
    contacts: float | None = None
    """Greatest distance (s) of instants at which a contact begins or ends, beyond what is known."""
    why: str = ""
    """Why there was nothing to compare, or what else is wrong."""


def check_digits(plan: Plan) -> list[Finding]:
    """Motion and contacts of drawn scenes."""
    motion, after, contacts, undecided = Worst(), Worst(), Worst(), Worst()
    watched = Watched(compared)
    for number in range(plan.scenes(6, 200)):
        document = draw(plan.seed, number)
        try:
            verdict = watched(document, SECONDS)
        except GivenUp as reason:
            verdict = Verdict(why=str(reason))
        if verdict.motion is not None:
            motion.take(verdict.motion, document)
        if verdict.after is not None:
            after.take(verdict.after, document)
        if verdict.contacts is not None:
            contacts.take(verdict.contacts, document)
        undecided.take(float(verdict.motion is None), document)
    tried = "scenes drawn at random, followed by an oracle of 40 digits"
    return [
        motion.finding("digits", "error of the motion / (eps x amplification)", tried, MARK),
        after.finding("digits", "error beyond that after lasting contact (m, m/s)", tried, 1e-10),
        contacts.finding("digits", "error of a contact's beginning or end (s)", tried, 1e-10),
        undecided.finding("digits", "scenes that were not compared", tried, None),
    ]


def compared(document: Document, engine: str = "compiled") -> Verdict:
    """Compare the run of a document with the oracle."""
    try:
        run = _solved(document)
    except Exception as fault:
        return Verdict(why=repr(fault))
    end = float(run.checkpoint()["end_time"])
    if end == 0.0:
        return Verdict(why=f"the run ends at once: {run.end_cause}")
    times = np.linspace(0.0, end, INSTANTS + 2)[1:-1]
    ours = motion_at(run, times)
    grown = amplification(document, run, times, ours)
    lost = (grown.max(axis=(1, 2)) > LOST) | (times >= first_graze(run))
    known = int(np.argmax(np.append(lost, True)))
    if known == 0:
        return Verdict(why="the motion is lost in rounding at once")
    oracle = Oracle(
        scene_of_system(run.system), run.system.law,
        run.system.inadmissible == "normal-impulse", MOST_EVENTS,
    )  # fmt: skip
    why = ""
    try:
        oracle.run(mp.mpf(float(times[known - 1])), [mp.mpf(t) for t in times[:known]])
    except ArithmeticError as reason:
        why = str(reason)
        known = len(oracle.told.samples)  # as far as it came
    if _decided_by_rounding(run, oracle.told):
        known = len(oracle.told.samples)
    if known == 0:
        return Verdict(why=why)
    return _verdict(run, oracle.told, ours, grown, times[:known])


def _solved(document: Document) -> Run:
    stop = document["stop"]
    return simulate_system(system_of(document), stop.get("time"), stop.get("collisions"))


def motion_at(run: Run, times: Floats) -> Floats:
    """Instants by bodies by ``x, y, speed`` (m, m/s)."""
    sample = run.sample(times)
    shape = (len(times), len(run.system.bodies))
    return np.stack([sample[name].reshape(shape) for name in ("x", "y", "speed")], axis=2)


def changed_documents(document: Document) -> Iterator[Document]:
    """The document with each of its numbers in turn a little different."""
    places: list[tuple[tuple[Any, ...], str]] = [((), "gravity")]
    for number in range(len(document["balls"])):
        places += [(("balls", number), key) for key in ("radius", "mass", "angle", "position")]
        places.append((("balls", number), "speed"))
    for number in range(len(document["trace"]["arcs"])):
        for key in ("radius", "length", "end_slope"):
            places.append((("trace", "arcs", number), key))
    for way, key in (*places, (("trace",), "start_slope"), (("collision",), "k")):
        changed = deepcopy(document)
        holder: Any = changed
        for step in way:
            holder = holder.get(step, {}) if isinstance(step, str) else holder[step]
        value = holder.get(key)
        if isinstance(value, float) and value != 0.0:
            holder[key] = value * (1.0 - CHANGE)
            yield changed


def parted_documents(document: Document, run: Run) -> Iterator[Document]:
    """The document with a gap before each body in turn that touches its neighbour at the start.

    No other change does that. Bodies that are pressed together are left: the rounding of their
    places does not make bounces of a contact.
    """
    begun = run.events["t"] == 0.0
    held = set(np.ma.filled(run.events["other"][begun], 0).tolist())  # crossings have no other
    for number, state in enumerate(run.system.initial):
        if "touching" not in document["balls"][number] or number + 1 in held:
            continue
        changed = deepcopy(document)
        ball = changed["balls"][number]
        del ball["touching"]
        ball["arc"] = state.piece + 1
        key = "position" if run.system.trace.pieces[state.piece].is_line else "angle"
        ball[key] = state.position + CHANGE * max(abs(state.position), 1.0)
        yield changed


def amplification(document: Document, run: Run, times: Floats, ours: Floats) -> Floats:
    """What a relative change of 1 of an input would do to the motion, at least its own size."""
    size = np.abs(ours).max(axis=0)
    grown = np.broadcast_to(np.maximum(size, 1.0), ours.shape).copy()
    for other in changed_documents(document):
        grown = np.maximum(grown, _growth_to(other, times, ours))
    for other in parted_documents(document, run):
        change = _growth_to(other, times, ours)
        if change.max() < LOST:  # else what was one impact of several is another sequence
            grown = np.maximum(grown, change)
    return np.maximum.accumulate(grown.max(axis=1, keepdims=True), axis=0) + 0.0 * grown


def _growth_to(document: Document, times: Floats, ours: Floats) -> Floats:
    """How far a changed motion is, in units of the change; 0 where there is none."""
    try:
        theirs = motion_at(_solved(document), times)
    except (ScenarioError, ArithmeticError, ValueError):
        return 0.0 * ours  # a closed trace does not close any more, bodies overlap, it ends before
    return np.abs(theirs - ours) / CHANGE


def _decided_by_rounding(run: Run, told: Told) -> bool:
    """Whether an inadmissible impact has ended a motion that goes on if it is none.

    Where a closed trace closes up to rounding only, or slopes at a junction are equal up to it, a
    body in contact that goes over them makes an impact, from a height lost in rounding.
    """
    height = float(told.end_approach) ** 2 / (2.0 * run.system.gravity)
    size = float(np.abs(motion_at(run, [0.0])[..., :2]).max()) + 1.0
    return told.end_cause == "inadmissible" and height <= CONTACT_ROUNDING * size


def _verdict(run: Run, told: Told, ours: Floats, grown: Floats, times: Floats) -> Verdict:
    if len(told.samples) < len(times):
        ended = f"the oracle ends {told.end_cause} at {float(told.end_time):.9g}"
        return Verdict(motion=np.inf, why=ended)
    closings = [float(event.t) for event in begun(told)]
    ours_closed = run.events["t"][run.events["event"] == "contact_closed"]
    first = min([*closings, *ours_closed.tolist()], default=np.inf)
    motion, after = 0.0, None
    size = size_of(run, told)
    thrown = throw_left_open(told, size)
    decided = (times < thrown) & ~_amid_bounces(run, times)
    growth = _Growth(told, times, grown.max(axis=(1, 2)), size, run.system.gravity)
    for row, bodies in enumerate(told.samples):
        if not decided[row]:
            continue
        pushed = growth.left_open(times[row]).speed
        for ball, (state, x, y) in enumerate(bodies):
            for column, exact in enumerate((x, y, state.speed)):
                off = abs(float(exact - mp.mpf(float(ours[row, ball, column]))))
                unit = EPSILON * float(grown[row, ball, column])
                if times[row] < first:
                    motion = max(motion, (off - pushed) / unit)
                else:
                    after = max(after or 0.0, off - MARK * unit - pushed)
    end = min(float(times[-1]), order_left_open(told, size), thrown)
    return Verdict(motion, after, _contacts_off(run, told, end, size, growth))


class _Growth:
    """How what events leave open has grown later: as changes of the inputs do from then on."""

    def __init__(
        self, told: Told, times: Floats, grown: Floats, size: float, gravity: float
    ) -> None:
        self._events = left_open(told, size, gravity)
        self._times = times
        self._grown = grown[: len(times)]

    def _at(self, t: float) -> float:
        """Growth from the start to the first compared instant from t on."""
        row = min(int(np.searchsorted(self._times, t)), len(self._times) - 1)
        return float(self._grown[row])

    def left_open(self, t: float) -> LeftOpen:
        """Root of the sum of squares of what all events before an instant (s) have left open."""
        before = [
            (one, self._at(t) / self._at(one.t)) for one in self._events if one.t < t <= one.until
        ]
        time = math.hypot(*(one.time * by for one, by in before))
        return LeftOpen(t, time, math.hypot(*(one.speed * by for one, by in before)))


def _amid_bounces(run: Run, times: Floats) -> Floats:
    """Whether an instant is within bounces that are summed: the motion told there is contact's."""
    closed = run.events["event"] == "contact_closed"
    end, lasted = (run.events[name][closed, None] for name in ("t", "value"))
    return ((end - lasted <= times) & (times < end)).any(axis=0)


def _contacts_off(run: Run, told: Told, end: float, size: float, growth: _Growth) -> float | None:
    """How far apart (s) contacts begin and end in both, beyond what doubles can tell.

    Where no force presses (two alike on a line) contact and none are one motion, and only one of
    both may speak of contact: events without one like them nearby are not compared.
    """
    events = run.events
    theirs = np.array([float(event.t) for event in told.events])
    worst: float | None = None
    for n in np.flatnonzero(np.isin(events["event"], CONTACT_KINDS) & (events["t"] < end)):
        one = (events["event"][n], int(events["ball"][n]) - 1, int(events["other"][n]) - 1)
        alike = [(event.kind, event.a, event.b) == one for event in told.events]
        off = np.abs(theirs - float(events["t"][n]))
        nearest = int(np.argmin(np.where(alike, off, np.inf))) if any(alike) else -1
        if nearest >= 0 and off[nearest] < NEARBY and theirs[nearest] < end:
            open_since = growth.left_open(theirs[nearest]).time
            beyond = off[nearest] - max(untold(told, told.events[nearest], size), open_since)
            worst = max(worst or 0.0, float(beyond))
    return worst


MOST_IMPACTS = 3


def check_tangent(plan: Plan) -> list[Finding]:
    """Errors of maps and of derivatives of instants, as shares of their largest elements."""
    maps, times = Worst(), Worst()
    number, wanted = 0, plan.scenes(4, 200)
    while maps.cases < wanted:
        document = draw(plan.seed, number)
        number += 1
        count = smooth_impacts(document)
        if count:
            document = document | {"stop": {"collisions": count}}
            found = errors_of(system_of(document), count)
            maps.take(found[0], document)
            times.take(found[1], document)
    tried = f"scenes drawn at random, up to {MOST_IMPACTS} impacts, with walls, junctions and laws"
    return [
        maps.finding("tangent", "error of the tangent map, of its largest element", tried, 1e-10),
        times.finding(
            "tangent", "error of the instants' derivatives, of the largest", tried, 1e-10
        ),
    ]


def smooth_impacts(document: Document) -> int:
    """Number of first impacts, up to a few, through which a motion has a derivative."""
    balls = document["balls"]
    if len(balls) < 2 or any("touching" in b for b in balls):
        return 0
    system = system_of(document)
    stop = float(document["stop"]["time"])
    found = follow_system(system, stop, MOST_IMPACTS)
    good = found.smooth & (found.amplification < MOST_GROWTH)
    count = len(good) if good.all() else int(np.argmin(good))
    # Lasting contact, and rest at a wall, take directions; the twin knows of neither.
    kept = count > 0 and bool(np.isfinite(follow_system(system, None, count).sums).all())
    return count if kept else 0


def errors_of(system: TraceSystem, count: int) -> tuple[float, float]:
    """Errors of the map after so many impacts and of their instants' derivatives.

    Ways (m) and speeds, as the way in the time scale of the system, are compared with one another.
    """
    told = happenings_of(simulate_system(system, None, count))
    found = follow_system(system, None, count)
    matrix, times = differences(scene_of_system(system), told, found.end_time)
    scale = np.tile([1.0, float(time_scale(system))], len(system.bodies))
    matrices = [one * scale[:, None] / scale[None, :] for one in (found.matrix, matrix)]
    instants = [one / scale for one in (found.times, times)]
    return error_of(*matrices), error_of(*instants)
