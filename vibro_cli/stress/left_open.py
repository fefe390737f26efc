"""What of a motion with impacts the rounding of places leaves open, told by the oracle's bounces.

Bodies nearer than that rounding touch: a program in doubles cannot know bounces lower than it, nor
the order of two impacts that are nearer to one another in time than the way it takes.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from itertools import pairwise
from typing import Any, NamedTuple

from vibro_cli.kernels.contact.contact_kinematics import CONTACT_ROUNDING
from vibro_cli.numerics.elementwise import EPSILON
from vibro_cli.stress.oracles.oracle import Bounce, Event, Told
from vibro_cli.stress.oracles.scene import mp
from vibro_cli.systems.run import Run

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


def size_of_places(run: Run, places: Iterable[float]) -> float:
    """Return `size_of` of coordinates without their signs."""
    radii = [piece.radius for piece in run.system.trace.pieces if not piece.is_line]
    return 4.0 * float(max(*places, *radii))


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
