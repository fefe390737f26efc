"""Scenes drawn at random against high precision: motions in 40 digits, tangent maps in 50.

A motion is compared with the oracle's at instants spread over it, in units of what a small change
of the inputs does to it, as far as that is not lost and nothing turns at a wall, but not amid
bounces that are summed; contacts by the instants at which they begin and end. A tangent map is
compared with differences of neighbouring motions, in the scenes whose motion has a derivative
through its first impacts: of two bodies or more that do not touch at the start, none of which comes
to rest at a wall, until the first impact that is not smooth.

The rounding of places leaves something of a motion with impacts open, which the oracle's bounces
tell. Bodies nearer than it touch: a program in doubles cannot know bounces lower than it, nor the
order of two impacts that are nearer to one another in time than the way it takes.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from copy import deepcopy
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from vibro_cli.kernels.contact.contact_kinematics import CONTACT_ROUNDING
from vibro_cli.kernels.numerics.constants import EPSILON
from vibro_cli.mechanics.system import TraceSystem
from vibro_cli.scenario.problems import ScenarioError
from vibro_cli.stress.drawing import draw
from vibro_cli.stress.oracles.oracle import Bounce, Event, Oracle, Told
from vibro_cli.stress.oracles.reference_solver import events_of
from vibro_cli.stress.oracles.scene import mp, scene_of_system
from vibro_cli.stress.oracles.sensitivity import MOST_GROWTH, differences, error_of
from vibro_cli.stress.physics import first_graze, size_of_places
from vibro_cli.stress.scenes import (
    Document,
    Finding,
    GivenUp,
    Plan,
    Watched,
    solve,
    system_of,
)
from vibro_cli.systems.run import Run
from vibro_cli.systems.trace import simulate_system
from vibro_cli.systems.trace.tangents import follow_system, time_scale

# Times gravity: how fast the motion in contact and that of the bounces before it come apart.
PUSH = 4.0
STILL = 1.0e-20  # m/s: parting bodies that stay together
INTERRUPTED = ("contact_opened", "contact_closed")


Lasting = list[tuple[Bounce, Any]]
"""Bounces with the time (s) to the next of the same bodies; 0 for one that ends in contact."""


class LeftOpen(NamedTuple):
    """An instant (s) that is known up to a time (s), and later motion up to a speed (m/s) by it."""

    t: float
    time: float
    speed: float
    until: float = math.inf
    """When it is gone: relative speeds and their instants do not outlast a contact that closes."""


def begun(told: Told) -> list[Event]:
    """Beginnings of lasting contact."""
    return [event for event in told.events if event.kind == "contact_closed"]


def size_of(run: Run, told: Told) -> float:
    """Size (m) of the four coordinates, or twice the radii, of the places of a pair."""
    return size_of_places(
        run, (float(abs(x)) for row in told.samples for _, *xy in row for x in xy)
    )


def untold(told: Told, event: Event, size: float) -> float:
    """What of an instant (s) at which contact begins or ends the rounding of places leaves open.

    Bounces lower than it are one contact, unless they have a sum: those of one pair under a law
    along its line of centres. An impact above them comes as much earlier or later as its bodies
    take for such a way. Where contact opens and closes again without an impact, nothing has moved
    the bodies apart: it may as well have lasted, or close later from such a distance.
    """
    lost = _begin_and_time(_lasting(told), event, CONTACT_ROUNDING * size)[1]
    return max(lost, _without_force(told, event))


def _without_force(told: Told, event: Event) -> float:
    """How long (s) contact of the bodies is interrupted at an event, with no impact at its end."""
    alike = [e for e in told.events if (e.a, e.b) == (event.a, event.b)]
    for one, other in pairwise(alike):
        if event in (one, other) and (one.kind, other.kind) == INTERRUPTED:
            return float(other.t - one.t)
    return 0.0


def _begin_and_time(lasting: Lasting, event: Event, height: float) -> tuple[float, float]:
    """Return when the bounces that are lost before an event begin (s), and what is `untold` (s)."""
    lost = _lost_before(lasting, event, height)
    first = min((bounce.t for bounce in lost), default=event.t)
    if first == event.t:
        fastest = max((-float(bounce.before) for bounce in lost), default=0.0)
        return float(first), height / fastest if fastest > 0.0 else 0.0
    summed = len({bounce.bodies for bounce in lost}) == 1 and all(one.along for one in lost)
    summed = summed and first > 0  # at the start others may touch the pair: a row has no sum
    return float(first), 0.0 if summed else float(event.t - first)


def left_open(told: Told, size: float, gravity: float) -> list[LeftOpen]:
    """What each event leaves open."""
    return _bounces_left_open(told, size, gravity) + _impacts_left_open(told, size)


def _bounces_left_open(told: Told, size: float, gravity: float) -> list[LeftOpen]:
    """Instants at which contact begins, and at which bounces that are lost in rounding have passed.

    The latter need not end in contact: bodies pressed together may be drawn apart before. Until
    then the motion in contact and that of the bounces come apart.
    """
    height = CONTACT_ROUNDING * size
    lasting = _lasting(told)
    ends = begun(told)
    for bounce, lasts in lasting:
        if _is_low(bounce.after, lasts, height) and bounce.after > STILL:
            ends.append(Event(bounce.t, "impact", bounce.bodies[0], bounce.bodies[-1]))
    widest = dict[float, LeftOpen]()
    for event in ends:
        begin, time = _begin_and_time(lasting, event, height)
        if event.kind == "impact" and begin == float(event.t):
            continue  # what is left open here is told where the next ones have passed
        if begin not in widest or time > widest[begin].time:
            widest[begin] = LeftOpen(float(event.t), time, PUSH * gravity * time)
    return list(widest.values())


def _impacts_left_open(told: Told, size: float) -> list[LeftOpen]:
    """Impacts of bodies that have parted before: up to the time they take for a last place.

    The accelerations of both draw them together; who meets so much earlier does so at a speed that
    is so much lower. No change of the inputs is like that.
    """
    found = []
    opened = [(e.t, (e.a, e.b), mp.zero) for e in told.events if e.kind == "contact_opened"]
    parted: dict[tuple[int, ...], tuple[Any, Any]] = {}
    for bounce in told.bounces:
        while opened and opened[0][0] < bounce.t:
            t, bodies, speed = opened.pop(0)
            parted[bodies] = (t, speed)
        t, speed = parted.get(bounce.bodies, (bounce.t, mp.zero))
        if t < bounce.t and bounce.before < -STILL:
            drawn = (speed - bounce.before) / (bounce.t - t)
            time = float(EPSILON * size / -bounce.before)
            lost = min(float(abs(drawn)) * time, float(-bounce.before))
            closes = [e.t for e in begun(told) if (e.a, e.b) == bounce.bodies and e.t >= bounce.t]
            until = float(min(closes, default=mp.inf))
            if not bounce.along and _is_low(speed, bounce.t - t, CONTACT_ROUNDING * size):
                # What is one contact as well: the law may throw its bodies apart, or keep them.
                lost, until = max(lost, abs(float(bounce.after))), math.inf
            found.append(LeftOpen(float(bounce.t), time, lost, until))
        parted[bounce.bodies] = (bounce.t, bounce.after)
    return found


def order_left_open(told: Told, size: float) -> float:
    """The first instant (s) whose impacts may come one after the other, or at once; else infinite.

    A body is hit from two sides there within the time that the rounding of places takes. What
    follows from impacts one by one and from joint ones differs, by as much as their speeds.
    """
    height = CONTACT_ROUNDING * size
    for one, other in pairwise(told.bounces):
        apart = other.t - one.t
        shared = one.bodies != other.bodies and set(one.bodies) & set(other.bodies)
        if shared and 0 < apart < height / max(abs(other.before), STILL):
            return float(one.t)
    return float("inf")


def throw_left_open(told: Told, size: float) -> float:
    """The first instant (s) from which bodies that a law throws apart may stay together.

    A law that does not act along the line of centres may make each bounce higher than the one
    before: motion grows out of bounces that are one contact for the program. Infinite if none does.
    """
    height = CONTACT_ROUNDING * size
    lost = dict[tuple[int, ...], bool]()
    for bounce, lasts in _lasting(told):
        is_low = _is_low(bounce.after, lasts, height)
        grows = not bounce.along and STILL < -bounce.before < bounce.after
        if grows and lost.get(bounce.bodies) and not is_low:
            return float(bounce.t)
        lost[bounce.bodies] = is_low
    return math.inf


def _lost_before(lasting: Lasting, event: Event, height: float) -> list[Bounce]:
    """Bounces lower than the height that lead to an event, and those that end at it."""
    row, lost = {event.a, event.b}, list[Bounce]()
    high = -mp.inf  # when a bounce began that is not lost
    for bounce, lasts in reversed(lasting):
        if bounce.t > event.t or not row & set(bounce.bodies):
            continue
        if bounce.t < high:
            break
        if bounce.t < event.t and not _is_low(bounce.after, lasts, height):
            high = bounce.t
            continue
        row |= set(bounce.bodies)
        lost.append(bounce)
    return lost


def _is_low(speed: Any, lasts: Any, height: float) -> bool:
    """Whether parting bodies come no further apart until their next impact, 0 s later if held."""
    return bool(lasts == 0 or speed * lasts / 4 <= height)


def _lasting(told: Told) -> Lasting:
    """Bounces with the time (s) to the next of the same bodies; 0 for one that ends in contact."""
    closed = {(event.t, event.a, event.b) for event in begun(told)}
    following: dict[tuple[int, ...], Any] = {}
    found = []
    for bounce in reversed(told.bounces):
        ends = (bounce.t, *bounce.bodies) in closed
        after = bounce.t if ends else following.get(bounce.bodies, mp.inf)
        found.append((bounce, after - bounce.t))
        following[bounce.bodies] = bounce.t
    return found[::-1]


MARK = 64.0  # of eps times the amplification
INSTANTS = 16
# Of an input, relative. A greater one can grow to what it changes, such as the speeds of small
# bounces, and no further: what is lost by then would look as if it were known.
CHANGE = 2.0**-40
# Gaps (m) that part bodies: clear of the rounding of places, below which they touch. Where the
# narrower one grows as much as the wider one does, both tell what the motion does to a gap.
GAP, NARROW_GAP = 2.0**-30, 2.0**-38
ALIKE = 8.0  # times: what does not grow at all is 256 times as many of the narrower gaps
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
    tried = "scenes drawn at random, followed by an oracle of 40 digits"
    motion = Finding("error of the motion / (eps x amplification)", tried, MARK)
    after = Finding("error beyond that after lasting contact (m, m/s)", tried, 1e-10)
    contacts = Finding("error of a contact's beginning or end (s)", tried, 1e-10)
    undecided = Finding("scenes that were not compared", tried, None)
    watched = Watched(compared)
    for number in range(plan.scenes(6, 200)):
        document = draw(plan.seed, number)
        try:
            verdict = watched(document, SECONDS)
        except GivenUp as reason:
            verdict = Verdict(why=str(reason))
        for finding, value in zip((motion, after, contacts), verdict[:3], strict=True):
            if value is not None:
                finding.take(value, document)
        undecided.take(float(verdict.motion is None), document)
    return [motion, after, contacts, undecided]


def compared(document: Document) -> Verdict:
    """Compare the run of a document with the oracle."""
    try:
        run = solve(document, "compiled")
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


def parted_documents(document: Document, run: Run, gap: float = GAP) -> Iterator[Document]:
    """The document with a gap (m) before each body in turn that touches its neighbour at the start.

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
        ball[key] = state.position + gap * max(abs(state.position), 1.0)
        yield changed


def amplification(document: Document, run: Run, times: Floats, ours: Floats) -> Floats:
    """What a relative change of 1 of an input would do to the motion, at least its own size."""
    size = np.abs(ours).max(axis=0)
    grown = np.broadcast_to(np.maximum(size, 1.0), ours.shape).copy()
    for other in changed_documents(document):
        grown = np.maximum(grown, _growth_to(other, CHANGE, times, ours))
    both = (parted_documents(document, run, gap) for gap in (GAP, NARROW_GAP))
    for wide, narrow in zip(*both, strict=True):
        change = _growth_to(wide, GAP, times, ours)
        if change.max() >= LOST:
            wider, change = change, _growth_to(narrow, NARROW_GAP, times, ours)
            if change.max() >= ALIKE * wider.max():
                continue  # what was one impact of several is another sequence
        grown = np.maximum(grown, change)
    return np.maximum.accumulate(grown.max(axis=1, keepdims=True), axis=0) + 0.0 * grown


def _growth_to(document: Document, change: float, times: Floats, ours: Floats) -> Floats:
    """How far a changed motion is, in units of the change; 0 where there is none."""
    try:
        theirs = motion_at(solve(document, "compiled"), times)
    except (ScenarioError, ArithmeticError, ValueError):
        return 0.0 * ours  # a closed trace does not close any more, bodies overlap, it ends before
    return np.abs(theirs - ours) / change


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
    tried = f"scenes drawn at random, up to {MOST_IMPACTS} impacts, with walls, junctions and laws"
    maps = Finding("error of the tangent map, of its largest element", tried, 1e-10)
    times = Finding("error of the instants' derivatives, of the largest", tried, 1e-10)
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
    return [maps, times]


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
    told = events_of(simulate_system(system, None, count))
    found = follow_system(system, None, count)
    matrix, times = differences(scene_of_system(system), told, found.end_time)
    scale = np.tile([1.0, float(time_scale(system))], len(system.bodies))
    matrices = [one * scale[:, None] / scale[None, :] for one in (found.matrix, matrix)]
    instants = [one / scale for one in (found.times, times)]
    return error_of(*matrices), error_of(*instants)
