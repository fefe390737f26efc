"""An oracle that computes the whole motion of a scene in 40 digits, event by event.

It implements the model independently of the solver: Taylor series of the equations of motion, first
zeros of polynomials, simultaneous impacts including walls, lasting contact with its forces.
Accumulating bounces are followed until the remaining time is shorter than ``REST``, which counts as
their end.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from vibro_cli.mechanics.system import TraceSystem
from vibro_cli.stress.oracles.arrangement import (
    LEFT_WALL,
    RIGHT_WALL,
    ZERO,
    Arrangement,
    Inadmissible,
    Laws,
    Touch,
    collide,
    speed_of,
)
from vibro_cli.stress.oracles.motion import (
    BITS,
    FIRST_STEP,
    GROWTH,
    ORDER,
    Group,
    Series,
    State,
    Undecided,
    Whole,
    expand_all,
    first_zero,
    order_for,
    real,
    squared_distance,
    whole,
    without_leading_zeros,
)
from vibro_cli.stress.oracles.scene import Path, Real, Scene, mp, scene_of_system

REST = mp.mpf(10) ** -17  # s
SAME = mp.mpf(10) ** -30  # s: events closer than this are simultaneous
# Ratio of a step that must reach the next bounce to the estimated time of flight.
BEYOND = mp.mpf("1.1")
# Relative speeds left by a truncated sequence of impacts, in units of ``arrangement.ZERO``.
LEFT_OVER = 1000
MOST_EVENTS = 20_000


class Event(NamedTuple):
    """An event; bodies are counted from 0."""

    t: Real
    kind: str  # impact, wall, crossing, contact_closed, contact_opened
    a: int
    b: int = -1


class Bounce(NamedTuple):
    """An impact of a pair, or of a body at a wall."""

    t: Real
    bodies: tuple[int, ...]
    before: Real
    """Separation speed (m/s) before it; positive only amid several impacts at one instant."""
    after: Real
    along: bool
    """Whether the law acts along the line of centres."""


@dataclass
class History:
    """The oracle's record of a motion."""

    events: list[Event] = field(default_factory=list)
    bounces: list[Bounce] = field(default_factory=list)
    samples: list[list[tuple[State, Real, Real]]] = field(default_factory=list)
    """State and centre of every body at each requested instant."""
    end_cause: str = "time"
    end_time: Real = mp.zero
    end_approach: Real = mp.zero
    """Approach speed (m/s) of the inadmissible impact that ended the motion."""


class _Watch(NamedTuple):
    """A polynomial whose first zero is an event."""

    kind: str  # crossing, wall, impact, opening
    key: int  # twice the body, plus one to the right; or the pair
    series: Series


class _EndOfTrace(Exception):
    """Raised if a body reaches an end of the trace without a wall."""


class Oracle:
    """The motion of the bodies of a scene, up to a number of events.

    The law is ``hedrih``, ``normal-impulse`` or ``translational``; with `substitute`, an
    inadmissible impact follows ``normal-impulse`` (else it ends the motion).
    """

    def __init__(
        self, scene: Scene, law: str, substitute: bool, most_events: int = MOST_EVENTS
    ) -> None:
        self.scene = scene
        self.laws = Laws(scene, law)
        self.substitute = substitute
        self.most_events = most_events
        self._left: Counter[int] | None = None  # impacts that pairs may still make
        self.now = Arrangement(scene)
        self.now.into_contact()
        self.t = mp.zero
        self.held: set[int] = set()  # pairs, and walls that hold a body
        self.history = History()
        self._guess = mp.mpf(FIRST_STEP)
        self._longest = 0.0  # s, of the last step of the full order

    @classmethod
    def of(
        cls, system: TraceSystem, most_events: int = MOST_EVENTS, scene: Scene | None = None
    ) -> Oracle:
        """Return the motion of a system, from exactly the doubles of the solver or from a scene."""
        substitute = system.inadmissible == "normal-impulse"
        return cls(scene or scene_of_system(system), system.law, substitute, most_events)

    def run(self, until: Real, times: Sequence[Real] = (), last: Collection[str] = ()) -> History:
        """Continue to an instant (s) and return the record, with samples at the given instants.

        The first event of one of the kinds ``last`` ends the motion, which may be continued. Raises
        `Undecided` if the events depend on digits beyond the working precision, or are too many.
        """
        waiting, events = list(times), self.history.events
        seen = len(events)
        try:
            self._happen([])
            while self.t < until and all(event.kind not in last for event in events[seen:]):
                seen = len(events)
                if seen > self.most_events:
                    raise Undecided("too many events")
                self._step(until, waiting)
        except Inadmissible as impact:
            self.history.end_cause = "inadmissible"
            self.history.end_approach = impact.approach
        except _EndOfTrace:
            self.history.end_cause = "end_of_trace"
        self.history.end_time = self.t
        return self.history

    def _step(self, until: Real, waiting: list[Real]) -> None:
        groups = self._groups()
        order = order_for(float(self._guess), self._longest)
        step = expand_all(groups, self._guess, order)
        if order == ORDER:
            self._longest = float(step)
        self._guess = min(step * GROWTH, mp.mpf(1))
        rest = whole((until - self.t) / step)
        u, happening = self._first(self._watches(groups), min(1 << BITS, rest))
        end = until if u == rest else self.t + real(u) * step
        while waiting and waiting[0] <= end:
            share = whole((waiting.pop(0) - self.t) / step)
            sample = [
                (state, *Path(self.scene, ball, state.piece).centre(state.place))
                for ball, state in enumerate(_states(groups, share))
            ]
            self.history.samples.append(sample)
        self.now.states = _states(groups, u)
        self.t = end
        if happening:
            self._happen(happening)

    def impacts(self, count: int, until: Real) -> list[Bounce]:
        """Continue to the impact of a number, counted from the start; return all impacts of pairs.

        Raises ArithmeticError if there are fewer until an instant (s).
        """
        while len(met := self._met()) < count:
            self.run(until, last=("impact",))
            if len(self._met()) == len(met):
                raise ArithmeticError(f"the oracle has {len(met)} impacts, expected {count}")
        return met

    def allow(self, pairs: Iterable[Collection[int]]) -> None:
        """Let pairs of bodies collide only as often as they are among these, then pass through."""
        keys = {frozenset(bodies): key for key, bodies in enumerate(self.now.pairs)}
        self._left = Counter(keys[frozenset(pair)] for pair in pairs)

    def _may_collide(self, key: int) -> bool:
        return self._left is None or key < 0 or self._left[key] > 0

    def _met(self) -> list[Bounce]:
        """Return the impacts of pairs."""
        return [one for one in self.history.bounces if len(one.bodies) == 2]

    def at(self, t: Real) -> list[State]:
        """Return the states at an instant (s) within a step of the present one, past or future."""
        groups = self._groups()
        step = expand_all(groups, mp.mpf(FIRST_STEP))
        return _states(groups, whole((t - self.t) / step))

    # -- possible events of a step ------------------------------------------------------------

    def _groups(self) -> list[Group]:
        """Return the groups of bodies that move together."""
        groups = []
        for balls in self._sets():
            pairs = self._held_among(balls)
            constraints = []
            for pair in pairs:
                a, b = (balls.index(n) for n in self.now.pairs[pair])
                constraints.append((a, b, self.now.reach(pair)))
            last = len(self.scene.bodies) - 1
            still = (LEFT_WALL in self.held and 0 in balls) or (
                RIGHT_WALL in self.held and last in balls
            )
            states = [self.now.states[n] for n in balls]
            groups.append(Group(self.scene, balls, states, constraints, still))
        return groups

    def _sets(self) -> list[list[int]]:
        """Return the sets of bodies that are joined by held pairs."""
        sets = [{n} for n in range(len(self.scene.bodies))]
        for pair, bodies in enumerate(self.now.pairs):
            if pair in self.held:
                one, other = (next(s for s in sets if n in s) for n in bodies)
                if one is not other:
                    sets.remove(other)
                    one |= other
        return [sorted(one) for one in sets]

    def _held_among(self, balls: Sequence[int]) -> list[int]:
        return [
            pair for pair, bodies in enumerate(self.now.pairs)
            if pair in self.held and bodies[0] in balls
        ]  # fmt: skip

    def _watches(self, groups: Sequence[Group]) -> list[_Watch]:
        """Return the polynomials of all possible events."""
        courses = {n: c for g in groups for n, c in zip(g.balls, g.courses, strict=True)}
        found = []
        for ball, course in courses.items():
            for right, wall in enumerate((LEFT_WALL, RIGHT_WALL)):
                place = self.now.wall_place(ball, wall)
                if self.scene.endless or (place is not None and wall in self.held):
                    continue
                shape = self.now.path(ball).shape
                goal = whole((shape.high if right else shape.low) if place is None else place)
                way = [-q for q in course.q] if right else list(course.q)
                way[0] += goal if right else -goal
                kind = "crossing" if place is None else "wall"
                found.append(_Watch(kind, 2 * ball + right, way))
        for pair, (a, b) in enumerate(self.now.pairs):
            if pair not in self.held and self._may_collide(pair):
                square = squared_distance(courses[a], courses[b])
                square[0] -= whole(self.now.reach(pair) ** 2)
                found.append(_Watch("impact", pair, square))
        return [*found, *self._openings(groups)]

    def _openings(self, groups: Sequence[Group]) -> list[_Watch]:
        """Return the polynomials of the contact forces."""
        found = []
        for group in groups:
            if not group.still:
                pairs = self._held_among(group.balls)
                for pair, force in zip(pairs, group.forces, strict=True):
                    found.append(_Watch("opening", pair, force))
        return found

    def _first(self, watches: Sequence[_Watch], end: Whole) -> tuple[Whole, list[_Watch]]:
        """Return the share of the step at which the first events happen, and these events."""
        found: list[tuple[Whole, _Watch]] = []
        for watch in watches:
            series = without_leading_zeros(watch.series)
            zero: Whole | None = None
            if series and series[0] < 0 and len(series) < len(watch.series):
                # It begins at zero and becomes negative.
                if watch.kind not in ("opening", "crossing"):
                    raise Undecided(f"{watch.kind} {watch.key} at once, t = {float(self.t)}")
                zero = 0
            elif series:
                zero = first_zero(series, end)
            if zero is not None:
                found.append((zero, watch))
                end = zero
        near = whole(SAME) + 2
        return end, [watch for zero, watch in found if zero <= end + near]

    # -- events -------------------------------------------------------------------------------

    def _happen(self, happening: Sequence[_Watch]) -> None:
        """Carry out all events of the present instant, crossings first."""
        for watch in happening:
            if watch.kind == "crossing":
                self._cross(watch.key // 2, watch.key % 2 == 1)
        touches = self.now.touches(self.held)
        before = self.now.speeds
        able = [touch for touch in touches if self._may_collide(touch.key)]
        self.now.speeds, used = collide(self.laws, able, before, self.substitute)
        if self._left is not None:
            self._left.subtract(key for key in used if key >= 0)
        for touch in touches:
            if touch.key in used:
                kind = "impact" if touch.key >= 0 else "wall"
                self.history.events.append(Event(self.t, kind, *touch.bodies))
                came, left = (speed_of(touch.row, one) for one in (before, self.now.speeds))
                along = self.laws.act_along(touch)
                self.history.bounces.append(Bounce(self.t, touch.bodies, came, left, along))
        self._settle(touches, used, max(abs(speed) for speed in before))

    def _cross(self, ball: int, to_right: bool) -> None:
        pieces = self.scene.pieces
        state = self.now.states[ball]
        target = state.piece + (1 if to_right else -1)
        if not self.scene.closed and not 0 <= target < len(pieces):
            raise _EndOfTrace
        target %= len(pieces)
        place = pieces[target].low if to_right else pieces[target].high
        self.now.states[ball] = state._replace(piece=target, place=place)
        self.history.events.append(Event(self.t, "crossing", ball))

    def _settle(self, touches: Sequence[Touch], used: dict[int, str], fastest: Real) -> None:
        """Determine lasting contacts; ``fastest`` is the greatest speed before impacts (m/s)."""
        held_before, speeds = self.held, self.now.speeds
        most = LEFT_OVER * ZERO * fastest
        still = [touch for touch in touches if abs(speed_of(touch.row, speeds)) <= most]
        ended = self._at_an_end(touches, still, used)
        still = [touch for touch in touches if touch in still or touch in ended]
        if still:
            # Remove what is left by a truncated sequence, by bounces at their end, or by rounding.
            law = next((used[t.key] for t in still if t.key in used), self.laws.law)
            self.now.speeds = self.laws.equalise(still, speeds, law)
        pressed, idle = self.now.pressing(still)
        self.held = {still[n].key for n in pressed}
        self._keep_idle({still[n].key for n in idle})
        for touch in touches:
            if touch.key >= 0 and (touch.key in self.held) != (touch.key in held_before):
                kind = "contact_closed" if touch.key in self.held else "contact_opened"
                self.history.events.append(Event(self.t, kind, *touch.bodies))

    def _at_an_end(
        self, touches: Sequence[Touch], still: Sequence[Touch], used: dict[int, str]
    ) -> list[Touch]:
        """Return touches whose further bounces take less time than `REST`."""
        found = []
        for touch in touches:
            if touch in still or touch.key not in used:
                continue
            closing = self.now.closing_acceleration([*still, touch])
            if closing > 0:
                flight = 2 * speed_of(touch.row, self.now.speeds) / closing
                if flight < REST * (1 - touch.restitution):
                    found.append(touch)
                else:
                    self._guess = min(self._guess, flight * BEYOND)
        return found

    def _keep_idle(self, waiting: set[int]) -> None:
        """Hold touches without a force, except those whose force would immediately become negative.

        If there is no force a little later either, the contact is kept.
        """
        self.held |= waiting
        while waiting:
            groups = self._groups()
            expand_all(groups, mp.mpf(FIRST_STEP))
            pulled = set()
            for watch in self._openings(groups):
                series = without_leading_zeros(watch.series)
                if series and series[0] < 0:
                    pulled.add(watch.key)
            if not pulled & waiting:
                return
            self.held -= pulled & waiting
            waiting -= pulled


def _states(groups: Sequence[Group], share: Whole) -> list[State]:
    """Return the states of all bodies, in order, at a share of the step."""
    found = {
        ball: state
        for group in groups
        for ball, state in zip(group.balls, group.at(share), strict=True)
    }
    return [found[ball] for ball in sorted(found)]


def first_contact(scene: Scene, until: Real) -> Real | None:
    """Return the first instant (s) up to ``until`` at which two bodies touch, or None.

    Each body stays on its piece, which extends beyond its ends.
    """
    free = replace(scene, endless=True, walls=(None, None))
    oracle = Oracle(free, "normal-impulse", substitute=True)
    met = oracle.run(until, last=("impact",)).bounces
    return met[0].t if met else None
