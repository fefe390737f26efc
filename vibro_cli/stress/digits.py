"""Random scenes against high precision: motions in 40 digits, tangent maps in 50.

A motion is compared with the oracle's at instants spread over it, in units of the effect of a small
change of the inputs. Instants are left out after the motion is lost in rounding, after a body turns
at a wall up to rounding, and within summed bounces. Contacts are compared by the instants at which
they begin and end. A tangent map is compared with differences of neighbouring motions, up to the
first impact that is not smooth, in scenes of two or more bodies that neither touch at the start nor
come to rest at a wall.

The rounding of places makes motions with impacts uncertain; the oracle's bounces tell by how much.
Bodies closer than this rounding touch. A program in doubles cannot know bounces lower than it, nor
the order of two impacts that are closer in time than a body takes for such a distance.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from copy import deepcopy
from itertools import pairwise, product
from typing import Any, NamedTuple

import numpy as np

from vibro_cli.kernels.contact.contact_kinematics import CONTACT_ROUNDING
from vibro_cli.kernels.numerics.constants import EPSILON
from vibro_cli.mechanics.system import TraceSystem
from vibro_cli.scenario.problems import ScenarioError
from vibro_cli.stress.drawing import draw
from vibro_cli.stress.oracles.oracle import Bounce, Event, History, Oracle
from vibro_cli.stress.oracles.scene import mp
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
from vibro_cli.systems.request import Limits
from vibro_cli.systems.run import Run
from vibro_cli.systems.tangents import followed
from vibro_cli.systems.trace import SYSTEM, simulate_system

# Greatest relative acceleration of motion in contact and with bounces instead, times gravity.
PUSH = 4.0
STILL = 1.0e-20  # m/s: separation speed of bodies that stay together
INTERRUPTED = ("contact_opened", "contact_closed")


Lasting = list[tuple[Bounce, Any]]
"""Bounces with the time (s) to the next of the same bodies; 0 for one that ends in contact."""


class Uncertainty(NamedTuple):
    """An uncertain instant (s): its uncertainty (s), and that of speeds (m/s) after it."""

    t: float
    time: float
    speed: float
    until: float = math.inf
    """When the uncertainty ends (s): that of relative speeds does not outlast a closing contact."""


def contact_beginnings(history: History) -> list[Event]:
    """Return the beginnings of lasting contact."""
    return [event for event in history.events if event.kind == "contact_closed"]


def contact_uncertainty(history: History, event: Event, size: float) -> float:
    """Return the uncertainty (s) of the beginning or end of a contact due to rounding of places.

    Bounces lower than the rounding count as one contact, unless they can be summed: those of one
    pair under a law along its line of centres. A higher impact is uncertain by the time that its
    bodies take for such a distance. A contact that opens and closes again without an impact may as
    well have lasted, or close later from such a distance, since nothing has moved the bodies apart.
    """
    lost = _begin_and_time(_lasting(history), event, CONTACT_ROUNDING * size)[1]
    return max(lost, _without_force(history, event))


def _without_force(history: History, event: Event) -> float:
    """Return how long (s) the contact at an event is interrupted without an impact, else 0."""
    alike = [e for e in history.events if (e.a, e.b) == (event.a, event.b)]
    for one, other in pairwise(alike):
        if event in (one, other) and (one.kind, other.kind) == INTERRUPTED:
            return float(other.t - one.t)
    return 0.0


def _begin_and_time(lasting: Lasting, event: Event, height: float) -> tuple[float, float]:
    """Return when the bounces lost before an event begin, and the uncertainty of the event (s)."""
    lost = _lost_before(lasting, event, height)
    first = min((bounce.t for bounce in lost), default=event.t)
    if first == event.t:
        fastest = max((-float(bounce.before) for bounce in lost), default=0.0)
        return float(first), height / fastest if fastest > 0.0 else 0.0
    summed = len({bounce.bodies for bounce in lost}) == 1 and all(one.along for one in lost)
    summed = summed and first > 0  # other bodies may touch at the start: a row cannot be summed
    return float(first), 0.0 if summed else float(event.t - first)


def uncertain_instants(history: History, size: float, gravity: float) -> list[Uncertainty]:
    """Return the uncertainties of all events."""
    return _uncertain_bounces(history, size, gravity) + _uncertain_impacts(history, size)


def _uncertain_bounces(history: History, size: float, gravity: float) -> list[Uncertainty]:
    """Return the uncertain instants at which contact begins, or bounces lost in rounding end.

    Such bounces need not end in contact: bodies pressed together may be pulled apart first. Until
    then, motions in contact and with bounces diverge.
    """
    height = CONTACT_ROUNDING * size
    lasting = _lasting(history)
    ends = contact_beginnings(history)
    for bounce, lasts in lasting:
        if _is_low(bounce.after, lasts, height) and bounce.after > STILL:
            ends.append(Event(bounce.t, "impact", bounce.bodies[0], bounce.bodies[-1]))
    widest = dict[float, Uncertainty]()
    for event in ends:
        begin, time = _begin_and_time(lasting, event, height)
        if event.kind == "impact" and begin == float(event.t):
            continue  # included in the uncertainty after the next bounces
        if begin not in widest or time > widest[begin].time:
            widest[begin] = Uncertainty(float(event.t), time, PUSH * gravity * time)
    return list(widest.values())


def _uncertain_impacts(history: History, size: float) -> list[Uncertainty]:
    """Return the uncertain instants of impacts of bodies that have separated before.

    The uncertainty is the time that they take for a unit of rounding of places. Since they
    accelerate towards each other, an earlier impact is slower. No change of the inputs shows this.
    """
    found = []
    opened = [(e.t, (e.a, e.b), mp.zero) for e in history.events if e.kind == "contact_opened"]
    parted: dict[tuple[int, ...], tuple[Any, Any]] = {}
    for bounce in history.bounces:
        while opened and opened[0][0] < bounce.t:
            t, bodies, speed = opened.pop(0)
            parted[bodies] = (t, speed)
        t, speed = parted.get(bounce.bodies, (bounce.t, mp.zero))
        if t < bounce.t and bounce.before < -STILL:
            drawn = (speed - bounce.before) / (bounce.t - t)
            time = float(EPSILON * size / -bounce.before)
            lost = min(float(abs(drawn)) * time, float(-bounce.before))
            closes = [
                e.t
                for e in contact_beginnings(history)
                if (e.a, e.b) == bounce.bodies and e.t >= bounce.t
            ]
            until = float(min(closes, default=mp.inf))
            if not bounce.along and _is_low(speed, bounce.t - t, CONTACT_ROUNDING * size):
                # In doubles this is one contact: the law may throw its bodies apart, or keep them.
                lost, until = max(lost, abs(float(bounce.after))), math.inf
            found.append(Uncertainty(float(bounce.t), time, lost, until))
        parted[bounce.bodies] = (bounce.t, bounce.after)
    return found


def first_uncertain_order(history: History, size: float) -> float:
    """Return the first instant (s) whose impacts may be successive or simultaneous, else infinity.

    There a body is hit from two sides within the time that it takes for a distance lost in
    rounding. Successive and simultaneous impacts lead to speeds that differ by as much as they are.
    """
    height = CONTACT_ROUNDING * size
    for one, other in pairwise(history.bounces):
        apart = other.t - one.t
        shared = one.bodies != other.bodies and set(one.bodies) & set(other.bodies)
        if shared and 0 < apart < height / max(abs(other.before), STILL):
            return float(one.t)
    return float("inf")


def first_uncertain_separation(history: History, size: float) -> float:
    """Return the first instant (s) after which bodies that a law throws apart may stay together.

    A law that does not act along the line of centres may make each bounce higher than the previous
    one: motion grows out of bounces that are one contact for the program. Infinite if none does.
    """
    height = CONTACT_ROUNDING * size
    lost = dict[tuple[int, ...], bool]()
    for bounce, lasts in _lasting(history):
        is_low = _is_low(bounce.after, lasts, height)
        grows = not bounce.along and STILL < -bounce.before < bounce.after
        if grows and lost.get(bounce.bodies) and not is_low:
            return float(bounce.t)
        lost[bounce.bodies] = is_low
    return math.inf


def _lost_before(lasting: Lasting, event: Event, height: float) -> list[Bounce]:
    """Return the bounces lower than a height that lead to an event or end at it."""
    row, lost = {event.a, event.b}, list[Bounce]()
    high = -mp.inf  # when a bounce that is not lost began
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
    """Return whether separating bodies stay within a height until their next impact (0 s: held)."""
    return bool(lasts == 0 or speed * lasts / 4 <= height)


def _lasting(history: History) -> Lasting:
    """Return all bounces, each with the time to the next one, as `Lasting` describes."""
    closed = {(event.t, event.a, event.b) for event in contact_beginnings(history)}
    following: dict[tuple[int, ...], Any] = {}
    found = []
    for bounce in reversed(history.bounces):
        ends = (bounce.t, *bounce.bodies) in closed
        after = bounce.t if ends else following.get(bounce.bodies, mp.inf)
        found.append((bounce, after - bounce.t))
        following[bounce.bodies] = bounce.t
    return found[::-1]


MARK = 64.0  # in units of eps times the amplification
INSTANTS = 16
# Relative change of an input. The effect of a greater change may saturate, such as that on the
# speeds of small bounces: a lost motion would then look as if it were known.
CHANGE = 2.0**-40
# Gaps (m) that separate bodies: wider than the rounding of places, below which they touch. If the
# narrower gap grows as much as the wider one, both show the effect of the motion on a gap.
GAP, NARROW_GAP = 2.0**-30, 2.0**-38
ALIKE = 8.0  # ratio of growths: 256 for a change that does not depend on the gap
# Amplification beyond which a motion is lost.
LOST = 1.0e6
MOST_EVENTS = 300
SECONDS = 60.0  # of processor time
NEARBY = 1.0e-4  # s
CONTACT_KINDS = ("contact_closed", "contact_opened")

Floats = Any  # an array of numbers


class Verdict(NamedTuple):
    """Differences of a run from the oracle's; None if there was nothing to compare."""

    motion: float | None = None
    """Greatest difference in units of eps times amplification, up to the first lasting contact."""
    after: float | None = None
    """Greatest difference (m, m/s) after it, beyond `MARK` of these units and the uncertainty."""
    contacts: float | None = None
    """Greatest difference (s) of beginnings and ends of contacts, beyond their uncertainty."""
    why: str = ""
    """Why there was nothing to compare, or what else is wrong."""


def check_digits(plan: Plan) -> list[Finding]:
    """Check motions and contacts of random scenes."""
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
    oracle = Oracle.of(run.system, MOST_EVENTS)
    why = ""
    try:
        oracle.run(mp.mpf(float(times[known - 1])), [mp.mpf(t) for t in times[:known]])
    except ArithmeticError as reason:
        why = str(reason)
        known = len(oracle.history.samples)  # as far as the oracle came
    if _decided_by_rounding(run, oracle.history):
        known = len(oracle.history.samples)
    if known == 0:
        return Verdict(why=why)
    return _verdict(run, oracle.history, ours, grown, times[:known])


def motion_at(run: Run, times: Floats) -> Floats:
    """Return the motion as an array: instants by bodies by ``x, y, speed`` (m, m/s)."""
    sample = run.sample(times)
    shape = (len(times), len(run.system.bodies))
    return np.stack([sample[name].reshape(shape) for name in ("x", "y", "speed")], axis=2)


def changed_documents(document: Document) -> Iterator[Document]:
    """Yield the document with each of its numbers slightly changed, one at a time."""
    of_balls = ("radius", "mass", "angle", "position", "speed")
    of_arcs = ("radius", "length", "end_slope")
    places: list[tuple[Any, ...]] = [
        ("gravity",),
        *product(["balls"], range(len(document["balls"])), of_balls),
        *product(["trace"], ["arcs"], range(len(document["trace"]["arcs"])), of_arcs),
        ("trace", "start_slope"),
        ("collision", "k"),
    ]
    for *way, key in places:
        changed = deepcopy(document)
        holder: Any = changed
        for step in way:
            holder = holder.get(step, {}) if isinstance(step, str) else holder[step]
        value = holder.get(key)
        if isinstance(value, float) and value != 0.0:
            holder[key] = value * (1.0 - CHANGE)
            yield changed


def parted_documents(document: Document, run: Run, gap: float = GAP) -> Iterator[Document]:
    """Yield the document with a gap (m) before each body that touches its neighbour at the start.

    No other change separates bodies. Those that are pressed together are left out: rounding of
    their places does not turn a contact into bounces.
    """
    at_start = run.events["t"] == 0.0
    held = set(np.ma.filled(run.events["other"][at_start], 0).tolist())  # crossings have no other
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
    """Return the change of the motion per relative change of an input, at least its own size."""
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
                continue  # the gap turns a simultaneous impact into another sequence
        grown = np.maximum(grown, change)
    return np.maximum.accumulate(grown.max(axis=1, keepdims=True), axis=0) + 0.0 * grown


def _growth_to(document: Document, change: float, times: Floats, ours: Floats) -> Floats:
    """Return the difference of a changed motion, divided by the change; 0 if it has no motion."""
    try:
        theirs = motion_at(solve(document, "compiled"), times)
    except (ScenarioError, ArithmeticError, ValueError):
        return 0.0 * ours  # the trace no longer closes, bodies overlap, or the run ends earlier
    return np.abs(theirs - ours) / change


def _decided_by_rounding(run: Run, history: History) -> bool:
    """Return whether an inadmissible impact that rounding decides has ended the motion.

    If a closed trace, or the slopes at a junction, match only up to rounding, a body in contact
    that crosses makes an impact, from a height lost in rounding.
    """
    height = float(history.end_approach) ** 2 / (2.0 * run.system.gravity)
    size = float(np.abs(motion_at(run, [0.0])[..., :2]).max()) + 1.0
    return history.end_cause == "inadmissible" and height <= CONTACT_ROUNDING * size


def _verdict(run: Run, history: History, ours: Floats, grown: Floats, times: Floats) -> Verdict:
    if len(history.samples) < len(times):
        ended = f"the oracle ends {history.end_cause} at {float(history.end_time):.9g}"
        return Verdict(motion=np.inf, why=ended)
    closings = [float(event.t) for event in contact_beginnings(history)]
    ours_closed = run.events["t"][run.events["event"] == "contact_closed"]
    first = min([*closings, *ours_closed.tolist()], default=np.inf)
    motion, after = 0.0, None
    places = (float(abs(x)) for row in history.samples for _, *xy in row for x in xy)
    size = size_of_places(run, places)
    thrown = first_uncertain_separation(history, size)
    decided = (times < thrown) & ~_amid_bounces(run, times)
    growth = _Growth(history, times, grown.max(axis=(1, 2)), size, run.system.gravity)
    for row, bodies in enumerate(history.samples):
        if not decided[row]:
            continue
        pushed = growth.uncertainty(times[row]).speed
        for ball, (state, x, y) in enumerate(bodies):
            for column, exact in enumerate((x, y, state.speed)):
                off = abs(float(exact - mp.mpf(float(ours[row, ball, column]))))
                unit = EPSILON * float(grown[row, ball, column])
                if times[row] < first:
                    motion = max(motion, (off - pushed) / unit)
                else:
                    after = max(after or 0.0, off - MARK * unit - pushed)
    end = min(float(times[-1]), first_uncertain_order(history, size), thrown)
    return Verdict(motion, after, _contacts_off(run, history, end, size, growth))


class _Growth:
    """Growth of the uncertainties of events: as that of changes of the inputs from then on."""

    def __init__(
        self, history: History, times: Floats, grown: Floats, size: float, gravity: float
    ) -> None:
        self._events = uncertain_instants(history, size, gravity)
        self._times = times
        self._grown = grown[: len(times)]

    def _at(self, t: float) -> float:
        """Return the growth from the start to the first compared instant not before t."""
        row = min(int(np.searchsorted(self._times, t)), len(self._times) - 1)
        return float(self._grown[row])

    def uncertainty(self, t: float) -> Uncertainty:
        """Return the root sum square of the uncertainties of all events before an instant (s)."""
        before = [
            (one, self._at(t) / self._at(one.t)) for one in self._events if one.t < t <= one.until
        ]
        time = math.hypot(*(one.time * by for one, by in before))
        return Uncertainty(t, time, math.hypot(*(one.speed * by for one, by in before)))


def _amid_bounces(run: Run, times: Floats) -> Floats:
    """Return which instants lie within summed bounces, where the run reports motion in contact."""
    closed = run.events["event"] == "contact_closed"
    end, lasted = (run.events[name][closed, None] for name in ("t", "value"))
    return ((end - lasted <= times) & (times < end)).any(axis=0)


def _contacts_off(
    run: Run, history: History, end: float, size: float, growth: _Growth
) -> float | None:
    """Return the greatest difference (s) of contact events, beyond their uncertainty.

    Without a contact force (two equal bodies on a line), motions with and without contact are the
    same, and only one of run and oracle may report it. Events without a match nearby are not
    compared.
    """
    events = run.events
    theirs = np.array([float(event.t) for event in history.events])
    worst: float | None = None
    for n in np.flatnonzero(np.isin(events["event"], CONTACT_KINDS) & (events["t"] < end)):
        one = (events["event"][n], int(events["ball"][n]) - 1, int(events["other"][n]) - 1)
        alike = [(event.kind, event.a, event.b) == one for event in history.events]
        off = np.abs(theirs - float(events["t"][n]))
        nearest = int(np.argmin(np.where(alike, off, np.inf))) if any(alike) else -1
        if nearest >= 0 and off[nearest] < NEARBY and theirs[nearest] < end:
            open_since = growth.uncertainty(theirs[nearest]).time
            beyond = off[nearest] - max(
                contact_uncertainty(history, history.events[nearest], size), open_since
            )
            worst = max(worst or 0.0, float(beyond))
    return worst


MOST_IMPACTS = 3


def check_tangent(plan: Plan) -> list[Finding]:
    """Check tangent maps and derivatives of instants, relative to their largest elements."""
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
    """Return the number of first impacts, at most `MOST_IMPACTS`, with a smooth tangent map."""
    balls = document["balls"]
    if len(balls) < 2 or any("touching" in b for b in balls):
        return 0
    system = system_of(document)
    stop = float(document["stop"]["time"])
    _, rows, _ = followed(SYSTEM, system, Limits(stop, MOST_IMPACTS))
    impacts = rows["collisions"]
    good = impacts["smooth"] & (impacts["amplification"] < MOST_GROWTH)
    count = len(good) if good.all() else int(np.argmin(good))
    # Lasting contact and rest at a wall remove directions; neighbouring motions show neither.
    if count == 0:
        return 0
    found, *_ = followed(SYSTEM, system, Limits(None, count))
    return count if np.isfinite(found.sums).all() else 0


def errors_of(system: TraceSystem, count: int) -> tuple[float, float]:
    """Return the errors of the map after `count` impacts and of their instants' derivatives.

    Displacements (m) and speeds are made comparable by the time scale of the system.
    """
    found, rows, _ = followed(SYSTEM, system, Limits(None, count), times=True)
    matrix, times = differences(simulate_system(system, None, count))
    units = found.units
    maps = [one / units[:, None] * units for one in (found.matrix(), matrix)]
    instants = [one * units for one in (rows["collisions"]["times"], times)]
    return error_of(*maps), error_of(*instants)
