"""Families of periodic orbits over a parameter of the scenario, by pseudo-arclength continuation.

A point of the branch is (state, period, value). The energy is constant along the branch unless it
is the parameter itself. H. B. Keller, "Numerical solution of bifurcation and nonlinear eigenvalue
problems", in *Applications of Bifurcation Theory* (Academic Press 1977); E. Doedel, *Congressus
Numerantium* 30 (1981) 265.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from itertools import pairwise

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from vibro_cli.analysis.event_words import by_body
from vibro_cli.analysis.impact_times import NoDerivative, number_at
from vibro_cli.analysis.orbits import (
    CLOSED,
    MOST_STEPS,
    NEARLY_CLOSED,
    PARTED,
    ROUNDING,
    NoOrbit,
    Orbit,
    admitted,
    begun_between,
    energy_of,
    equations,
    gap_of,
    newton,
    over_period,
    residual_of,
    scale_of,
    shoot,
    size_of,
    started,
    velocity,
)
from vibro_cli.assemble import build_system
from vibro_cli.kernels.numerics.constants import EPSILON
from vibro_cli.mechanics.system import TraceSystem
from vibro_cli.numerics.elementwise import Floats
from vibro_cli.progress import WORK
from vibro_cli.scenario.models import Scenario
from vibro_cli.scenario.problems import ScenarioError, parsed_path
from vibro_cli.systems.trace import SYSTEM

ENERGY = "energy"
"""Stands for the path if the parameter is the energy."""
FIRST_STEP = 0.01
"""Length of the first step, as a fraction of the range."""
LONGEST_STEP = 0.04
LEAST_STEP = 1.0e-7
# Limits for one step: turn of the family (rad), and change of the arctangent of the multipliers'
# distance from 1 or -1. Where multipliers jump, the step is cut to the last number and accepted.
_TURN, _PASSING, _CUT = 0.2, 0.4, 5.0e-4
MOST_POINTS = 2000
MOST_PERIODS = 30.0
"""A family ends where its orbits are this many times as long as the first."""
# An impact about to vanish is slower than this fraction of the usual speeds.
GRAZING = 0.02
# Multipliers grow as 1/speed: below this fraction of a grazing speed they hide grazing motions.
_NEARLY_GRAZING = 1.0e-3
# Change of the value for its derivative, as a fraction of the range.
_CHANGE = 1.0e-7
# Values closer to an end of the range than this fraction of it count as the end.
_ROUNDING = 1.0e-12
# A smaller part of a direction may be the rounding of differences over `_CHANGE`.
_LEAST_CHANGE = 1.0e-3
# Number of orbits tried between points to find whether multipliers pass a number and return.
_DIPS = 12
# Relative gap over part of its period below which an orbit has this shorter period.
_PART = 1.0e-7
# Relative gap over half of the period below which values of orbits beside a halving are inaccurate.
_BESIDE_HALVING = 1.0e-2
# Fractions of the way back from a halving of the period, of the orbits that locate it.
_NEARING = (0.2, 0.4, 0.6, 0.8)
# Fractions of a step from a doubling at which further unstable orbits are computed.
_APPROACH = (1.0 / 64.0, 1.0 / 16.0, 1.0 / 4.0)
# Number of orbits tried to locate a fold.
_TRIED = 9
_JUMP = "the multipliers jump, as when an impact passes a junction"
_NOT_ONE = "no multiplier reaches 1"
# Orbits that close worse, such as motions nearly at rest, have meaningless multipliers.
_CLOSED_WELL = 10.0 * CLOSED

SystemAt = Callable[[float], TraceSystem]
"""Returns the system at a value of the parameter."""


@dataclass(frozen=True)
class Point:
    """A point of a branch."""

    value: float
    orbit: Orbit
    along: Floats = field(repr=False)
    """(state, period, value), scaled to comparable lengths."""


@dataclass(frozen=True)
class Special:
    """A point at which a branch changes its stability, turns back or ends."""

    kind: str  # fold, doubling, exchange, torus, or the cause of an end: bound, halving, grazing, …
    point: Point
    after: int
    """Index of the last point of the branch that does not lie beyond it."""
    fault: str = ""
    """Why `point` is only the nearest orbit found; empty if it is accurate."""


@dataclass(frozen=True)
class Branch:
    """A family of orbits."""

    points: list[Point]
    special: list[Special]
    """Special points in order along the branch, including its ends."""


def family_of(scenario: Scenario, found: Orbit, path: str, low: float, high: float) -> Branch:
    """Return the family of an orbit over a parameter of its scenario.

    `path`, `low` and `high` are the path of the parameter and its range (SI units, radians), which
    is followed at constant energy; or `ENERGY` as the path, and its range (J). Raises `NoOrbit` if
    the scenario has no such number, or its value is outside the range, `ScenarioError` if the
    scenario is invalid at an end of the range, and `ValueError` if the text is not a path.
    """

    @lru_cache(maxsize=64)
    def at(value: float) -> TraceSystem:
        return build_system(scenario.replace({path: value}))

    try:
        here = found.energy if path == ENERGY else number_at(scenario, parsed_path(path), ENERGY)
    except NoDerivative as error:
        raise NoOrbit(str(error)) from error
    if not low <= here <= high:
        value = f"the scenario's value, {here:.6g}"
        if path == ENERGY:
            value = f"the orbit's, {here:.6g} J relative to the trace's left end"
        raise NoOrbit(f"{path}: found the range {low:g}:{high:g}, expected one with {value}")
    # Report faults at the ends of the range first.
    if path != ENERGY and _restitutions(at(low)) != _restitutions(at(high)):
        expected = "another parameter: periodic orbits need 1"
        raise NoOrbit(f"{path}: found a coefficient of restitution, expected {expected}")
    if path != ENERGY and replace(at(low), initial=()) == replace(at(high), initial=()):
        expected = "one of the trace, the bodies or the impacts"
        raise NoOrbit(f"{path}: found a parameter on which no orbit depends, expected {expected}")
    return Family(None if path == ENERGY else at, found, here, low, high).follow()


def _restitutions(system: TraceSystem) -> tuple[float | None, ...]:
    """Return the coefficients of restitution of all pairs and of both walls, if any."""
    walls = (system.left_end, system.right_end)
    return (*system.restitution, *(None if wall is None else wall.restitution for wall in walls))


class Family:
    """A family of orbits over a parameter.

    `system_at` returns the system at a value of the parameter; it is None if the parameter is the
    energy. `value` is that of the orbit `first`; the range from `low` to `high` is followed.
    """

    def __init__(
        self, system_at: SystemAt | None, first: Orbit, value: float, low: float, high: float
    ) -> None:
        self._system_at = system_at
        self._system = first.system
        self._low, self._high, self._range = low, high, high - low
        self._jumps = first.shot.jumps
        self._energy = first.energy
        scale = scale_of(first.system)
        unit = first.system.gravity * float(SYSTEM.time_scale(first.system))
        self._units = np.concatenate(
            [scale, [unit, size_of(first.system, first.state) / self._range]]
        )
        self._across = np.eye(len(self._units))[-1]  # normal of the plane of equal values
        first = begun_between(first)
        self._first = self._point(value, first)
        # In a narrow range tangents would be dominated by the value and equal for two families
        # that cross. The value is therefore weighted no more than the quantities that change.
        tangent = self._first_tangent()
        changes = float(np.linalg.norm(tangent[:-1]))
        self._share = changes / max(changes, abs(tangent[-1])) if changes > _LEAST_CHANGE else 1.0
        self._units[-1] *= self._share
        self._first = self._point(value, first)

    def _point(self, value: float, orbit: Orbit) -> Point:
        along: Floats = np.concatenate([orbit.state, [orbit.period, value]]) * self._units
        return Point(value, orbit, along)

    def _system_of(self, value: float) -> TraceSystem:
        if self._system_at is None:
            return self._system
        try:
            return self._system_at(value)
        except ScenarioError as error:
            one = error.problems[0]
            raise NoOrbit(f"{one.path}: found {one.found}, expected {one.expected}") from error

    def _energy_of(self, value: float) -> float:
        return value if self._system_at is None else self._energy

    def follow(self) -> Branch:
        """Follow the branch in both directions from its first orbit, up to its ends."""
        tangent = self._first_tangent()
        back, start = self._one_way(-tangent)
        ahead, end = self._one_way(tangent)
        points = [*back[::-1], self._first, *ahead]
        for at in (-1.0, 1.0):
            points = self._with_dips(points, at)
        places = {0: start, len(points) - 1: end}
        halved = {place for place, cause in places.items() if cause == "halving"}
        special = [*self._passed(points, halved), *self._out_of_the_circle(points)]
        folds = {one.after for one in special if one.kind == "fold"}
        for n, three in enumerate(zip(points, points[1:], points[2:], strict=False), 1):
            # Rounding moves the values of the orbits beside a halving.
            at_halving = halved & {n - 1, n + 1} and _nearly_halved(points[n])
            if _turn(*three) and not folds & {n - 1, n} and not at_halving:
                special.append(self._turning(n, *three))
        special.sort(key=lambda one: (one.after, _apart(one.point, points[one.after])))
        points, special = self._with_approaches(points, special)
        last = len(points) - 1
        ends = Special(start, points[0], 0), Special(end, points[last], last)
        return Branch(points, [ends[0], *special, ends[1]])

    def _first_tangent(self) -> Floats:
        """Return the tangent at the first orbit, towards greater values or away from a halving.

        Beside a halving the orbits of half the period, traversed twice, are another branch, and
        rounding mixes both tangents. Along this branch only the gap over half the period changes.
        """
        if not _nearly_halved(self._first):
            return self._tangent(self._first, self._across)
        gap = self._first.orbit.part_gaps[2][: len(self._units) - 2]
        return self._tangent(self._first, -np.append(gap, [0.0, 0.0]) / np.linalg.norm(gap))

    def _one_way(self, tangent: Floats) -> tuple[list[Point], str]:
        """Follow the branch in one direction; return its points, and the cause of its end."""
        size = self._units[-1] * self._range
        points: list[Point] = []
        here, step = self._first, FIRST_STEP
        while len(points) < MOST_POINTS:
            # Steps grow with the period, so that ever longer orbits need few steps.
            longer = here.orbit.period / self._first.orbit.period
            if longer > MOST_PERIODS:
                return points, "period"
            ahead = step * size * max(longer, 1.0) ** 1.5
            guess, across = self._ahead(here, ahead * tangent, tangent)
            try:
                new = self._corrected(guess, across)
                if _share_left(here, new) < _NEARING[0]:
                    return [*points, self._halved(here, new)], "halving"
                turned = self._tangent(new, tangent)
                if across is not tangent:
                    return [*points, *([new] if new.value != here.value else [])], "bound"
                bound = min(max(new.value, self._low), self._high)
                if bound != new.value:
                    return [*points, self._at_value(here, new, bound)], "bound"
            except NoOrbit as error:
                step *= 0.5
                if step < LEAST_STEP:
                    return points, self._ending(here, tangent, size, str(error))
                continue
            excess = self._excess(here, new, tangent, turned)
            # If a phase is free at the first value only, the first step must leave this value.
            leaves = not points and abs(tangent[-1]) == 1.0
            if excess > 2.0 and step > _CUT and not leaves:
                step *= 0.5
                continue
            tangent = turned
            points.append(new)
            least = min(step, _CUT)
            longest = LONGEST_STEP / float(
                np.hypot(self._share * np.linalg.norm(tangent[:-1]), tangent[-1])
            )
            here, step = new, min(max(step / max(excess, 2.0 / 3.0), least), longest)
        return points, "points"

    def _ahead(self, here: Point, change: Floats, tangent: Floats) -> tuple[Floats, Floats]:
        """Return a guess beyond a point, and the normal of the plane in which to correct it.

        The value is limited to the range, as the scenario may be invalid beyond it.
        """
        value = here.value + float(change[-1] / self._units[-1])
        bound = min(max(value, self._low), self._high)
        if bound == value:
            return here.along + change, tangent
        return here.along + (bound - here.value) / (value - here.value) * change, self._across

    def _corrected(self, guess: Floats, tangent: Floats) -> Point:
        """Return the orbit near a guess in the plane normal to a tangent (Newton's method)."""
        WORK.report(f"orbit near {guess[-1] / self._units[-1]:.6g}")
        along, residual, best = guess, np.inf, None
        for _ in range(MOST_STEPS):
            state, (period, value) = (along / self._units)[:-2], (along / self._units)[-2:]
            value = self._without_rounding(float(value))
            system = admitted(self._system_of(value), state)
            energy = self._energy_of(value)
            shot = shoot(system, float(period))
            if shot.jumps != self._jumps:
                raise NoOrbit("the events change")
            before, residual = residual, residual_of(system, shot, state, energy)
            # Where Newton's method comes to rounding its last step may go back.
            if best is None or residual < best[1].residual:
                own = energy_of(system, state)
                best = value, Orbit(system, float(period), state, shot, residual, own)
            if residual < CLOSED or (best[1].residual < NEARLY_CLOSED and residual > 0.5 * before):
                return self._accepted(*best)
            # Near a fold a step may increase the residual before the next one converges.
            if residual > 4.0 * max(before, 100.0 * NEARLY_CLOSED) or residual > 1.0:
                break
            rows, right = equations(system, shot, state, energy)
            by_value = self._by_value(state, float(period), value, right)
            matrix = np.column_stack([rows, by_value]) / self._units
            matrix = np.vstack([matrix, tangent])
            right = np.append(right, -float(tangent @ (along - guess)))
            along = along + np.linalg.lstsq(matrix, right, rcond=1e-12)[0]
        raise NoOrbit("Newton's method does not converge")

    def _accepted(self, value: float, orbit: Orbit) -> Point:
        """Return the point of an orbit, begun midway between two events.

        Raises `NoOrbit` if it has other events than the family, has no multipliers, or repeats
        within its period.
        """
        found = begun_between(orbit)
        if found.shot.jumps != self._jumps:
            raise NoOrbit("the events change")
        gaps = found.part_gaps.values()
        least = min(map(np.linalg.norm, gaps), default=np.inf)
        if least < _PART * size_of(orbit.system, orbit.state):
            raise NoOrbit("the orbits come to repeat within their period")
        return self._point(value, found)

    def _without_rounding(self, value: float) -> float:
        """Return a value, or the end of the range that it equals up to rounding."""
        ends = (self._low, self._high)
        return next((end for end in ends if abs(value - end) < _ROUNDING * self._range), value)

    def _by_value(self, state: Floats, period: float, value: float, right: Floats) -> Floats:
        """Return the derivative of the equations with respect to the value, by a difference.

        The difference is central where possible: the error of a one-sided one grows with the
        greatest multiplier, and tangents would then deviate from the family.
        """
        beside = []
        for at in (value + _CHANGE * self._range, value - _CHANGE * self._range):
            if self._low <= at <= self._high:
                system = started(self._system_of(at), state)
                shot = shoot(system, period)
                if shot.jumps == self._jumps:
                    beside.append((at, equations(system, shot, state, self._energy_of(at))[1]))
        if not beside:
            raise NoOrbit("the events change")
        (one, ahead), (other, behind) = [*beside, (value, right)][:2]
        derivative: Floats = (behind - ahead) / (one - other)
        return derivative

    def _tangent(self, point: Point, side: Floats) -> Floats:
        """Return the tangent of the branch at a point, on the same side as the direction `side`.

        Unlike a chord, it shows that a step has led to another branch where two cross. With a free
        phase there are many tangents: the nearest one is taken, or `side` if it is normal to all.
        """
        orbit, energy = point.orbit, self._energy_of(point.value)
        rows, right = equations(orbit.system, orbit.shot, orbit.state, energy)
        by_value = self._by_value(orbit.state, orbit.period, point.value, right)
        matrix = np.column_stack([rows, by_value]) / self._units
        _, sizes, directions = np.linalg.svd(matrix)
        free = directions[sizes <= max(sizes[-1], ROUNDING)]
        tangent: Floats = free.T @ (free @ side)
        if np.linalg.norm(tangent) < ROUNDING:
            tangent = side
        return tangent / np.linalg.norm(tangent)

    def _excess(self, here: Point, new: Point, tangent: Floats, turned: Floats) -> float:
        """Return the change over a step relative to its limit, by turn and by multipliers.

        The turn is that from the first tangent to the chord (without its part along the orbit) and
        on to the last tangent; it is large if the step has led to another branch.
        """
        orbit, chord = here.orbit, new.along - here.along
        flow = np.append(velocity(orbit.system, orbit.state), [0.0, 0.0]) * self._units
        chord -= chord @ flow / (flow @ flow) * flow
        chord /= np.linalg.norm(chord)
        cosines = np.array([tangent @ chord, chord @ turned])
        turn = float(np.sum(np.arccos(np.minimum(cosines, 1.0)))) / _TURN
        # For a circular arc, whose chord lies midway, this is a quarter of its turn squared.
        aside = float(np.linalg.norm(tangent + turned - 2.0 * chord))
        turn = max(turn, aside / (0.5 * _TURN**2))
        for at in (-1.0, 1.0):
            passing = np.arctan(_distance(new.orbit, at)) - np.arctan(_distance(orbit, at))
            turn = max(turn, abs(float(passing)) / _PASSING)
        return turn

    def _at_value(self, one: Point, other: Point, value: float) -> Point:
        """Return the orbit at a value between those of two points."""
        share = (value - one.value) / (other.value - one.value)
        return self._corrected(one.along + share * (other.along - one.along), self._across)

    def _halved(self, one: Point, other: Point) -> Point:
        """Return the orbit of half the period between two others or just ahead, traversed twice.

        Beyond it the family has the same orbits again, started half a period later, with the
        opposite gap over half the period. Value, period and the mean of both starts are therefore
        functions of the square of this gap, and are extrapolated from four orbits by a polynomial.
        """
        if _share_left(one, other) < -1.0:
            # Rounding moves the values of the orbits nearest to the halving.
            one, other = other, one
        whole = 1.0 / (1.0 - _share_left(one, other))
        near = [self._between(one, other, whole * (1.0 - share)) for share in _NEARING]
        gaps = [point.orbit.part_gaps[2] for point in near]
        squares = np.array([gap @ gap for gap in gaps])
        means = [
            point.along + 0.5 * np.append(gap[: len(self._units) - 2], [0.0, 0.0])
            for point, gap in zip(near, gaps, strict=True)
        ]
        along = np.polyfit(squares / squares.max(), means, len(near) - 1)[-1]
        *state, period, value = (along / self._units).tolist()
        if not self._low <= value <= self._high:
            raise NoOrbit("the period halves beyond the range")
        system, energy = self._system_of(value), self._energy_of(value)
        half = newton(system, np.array(state), 0.5 * period, energy)
        return self._point(value, over_period(half, 2.0 * half.period))

    def _passed(self, points: list[Point], halved: set[int]) -> list[Special]:
        """Return the points at which multipliers pass -1 or 1, including folds (1).

        `halved` are the indices of orbits traversed twice, whose multipliers are at 1.
        """
        found: list[Special] = []
        for kind, at in (("doubling", -1.0), ("exchange", 1.0)):
            # The sign of multipliers that stay at this number is random.
            distances = [_distance(point.orbit, at) for point in points]
            staying = halved if at == 1.0 else set()
            known = [
                n for n, one in enumerate(distances) if abs(one) > PARTED**2 and n not in staying
            ]
            for n, m in pairwise(known):
                if distances[n] * distances[m] < 0.0:
                    one = self._change(kind, points, n, m, partial(_distance, at=at))
                    turns = _turn(points[n], one.point, points[m]) and kind == "exchange"
                    # At an orbit that is nearly a fold, both sides may seem to change.
                    again = turns and found and found[-1].after == n - 1
                    if not (again and _turn(found[-1].point, points[n], one.point)):
                        found.append(replace(one, kind="fold") if turns else one)
        return found

    def _turning(self, n: int, before: Point, here: Point, after: Point) -> Special:
        """Return the fold within three orbits, of which the middle one is number n.

        A multiplier reaches 1 there without passing it: the orbit is its own time reversal or
        mirror image, and the family continues with the reversals or images of its orbits. Near the
        fold Newton's method needs a good start, from a polynomial through the orbits.
        """
        chord = (after.along - before.along) / _apart(after, before)
        known, fault = [before, after, here], _NOT_ONE
        try:
            while len(known) < _TRIED and not _comes_to_one(known[-1].orbit):
                near = known[-4:]
                places = np.array([chord @ (one.along - here.along) for one in near])
                along = np.polyfit(places, [one.along for one in near], len(near) - 1)
                place = min(np.roots(np.polyder(along[:, -1])).real, key=abs)
                guess = np.array([np.polyval(one, place) for one in along.T])
                known.append(self._corrected(guess, chord))
        except NoOrbit as error:
            fault = str(error)
        found = min(known, key=lambda one: abs(_distance(one.orbit, 1.0)))
        if _comes_to_one(found.orbit):
            fault = ""
        is_beyond = chord @ (found.along - here.along) >= 0.0
        return Special("fold", found, n if is_beyond else n - 1, fault)

    def _with_approaches(
        self, points: list[Point], special: list[Special]
    ) -> tuple[list[Point], list[Special]]:
        """Add unstable points near doublings, where multipliers split as a square root."""
        found, moved = points[:1], []
        for n, (one, other) in enumerate(pairwise(points)):
            here = [change for change in special if change.after == n]
            alone = here[0] if len(here) == 1 and here[0].kind == "doubling" else None
            if alone is not None:
                found += self._nearer(alone.point, one)[::-1]
            moved += [replace(change, after=len(found) - 1) for change in here]
            if alone is not None:
                found += self._nearer(alone.point, other)
            found.append(other)
        return found, moved

    def _nearer(self, change: Point, unstable: Point) -> list[Point]:
        """Return orbits between a change of stability and an unstable point beside it, if any."""
        shares = () if unstable.orbit.stable else _APPROACH
        found = []
        with suppress(NoOrbit):
            for share in shares:
                found.append(self._between(change, unstable, share))
        return found

    def _with_dips(self, points: list[Point], at: float) -> list[Point]:
        """Add points where multipliers pass a number and return between two points."""
        found = points[:1]
        for before, here, after in zip(points, points[1:], points[2:], strict=False):
            sides = [_distance(one.orbit, at) for one in (before, here, after)]
            least = min(map(abs, sides))
            # A more distant multiplier cannot reach the number in one step.
            near = PARTED**2 < least == abs(sides[1]) < 1.0 and min(sides) * max(sides) > 0.0
            found += self._dip(before, here, after, at) if near else [here]
        return [*found, points[-1]] if len(points) > 1 else found

    def _dip(self, before: Point, here: Point, after: Point, at: float) -> list[Point]:
        """Return the middle of three points and, if found, one beyond the number beside it."""
        sign = np.sign(_distance(here.orbit, at))
        known = {0.0: here}

        def tested(share: float) -> float:
            known[share] = self._between(here, after if share > 0.0 else before, abs(share))
            return float(sign * _distance(known[share].orbit, at))

        # If a trial fails, the other side is out of reach.
        with suppress(NoOrbit):
            minimize_scalar(
                tested, bounds=(-1.0, 1.0), method="bounded", options={"maxiter": _DIPS}
            )
        share = min(known, key=lambda one: sign * _distance(known[one].orbit, at))
        found = known[share]
        passed = sign * _distance(found.orbit, at) < 0.0 and self._is_on(here, found)
        return [known[one] for one in sorted({0.0, share})] if passed else [here]

    def _is_on(self, here: Point, near: Point) -> bool:
        """Return whether an orbit near another one is on its branch, not on one that crosses it."""
        side = near.along - here.along
        try:
            one, other = self._tangent(here, side), self._tangent(near, side)
        except NoOrbit:
            return False
        return self._excess(here, near, one, other) <= 2.0

    def _out_of_the_circle(self, points: list[Point]) -> list[Special]:
        """Return the points at which a complex pair of multipliers leaves the unit circle."""
        found = []
        for n, (one, other) in enumerate(pairwise(points)):
            inner, outer = sorted((one.orbit, other.orbit), key=lambda orbit: orbit.outside)
            last = outer.outside - 1
            real = outer.multipliers[last].imag == 0.0
            if outer.outside < inner.outside + 2 or real or outer.residual > _CLOSED_WELL:
                continue
            found.append(self._change("torus", points, n, n + 1, partial(_beyond, last)))
        return found

    def _between(self, one: Point, other: Point, share: float) -> Point:
        """Return the orbit at a fraction of the way from one point to another."""
        chord = other.along - one.along
        return self._corrected(one.along + share * chord, chord / np.linalg.norm(chord))

    def _change(
        self, kind: str, points: list[Point], n: int, m: int, test: Callable[[Orbit], float]
    ) -> Special:
        """Return the point at which `test` passes zero between two orbits (Brent's method)."""
        one, other, fault = points[n], points[m], ""
        known = {0.0: one, 1.0: other}

        def tested(share: float) -> float:
            if share not in known:
                known[share] = self._between(one, other, share)
            return test(known[share].orbit)

        size = float(np.linalg.norm(one.along)) / _apart(one, other)
        try:
            brentq(tested, 0.0, 1.0, xtol=1e-12 * size)
        except NoOrbit as error:
            fault = str(error)
        nearest = min(known.values(), key=lambda point: abs(test(point.orbit)))
        if not fault and abs(test(nearest.orbit)) > PARTED:
            fault = _JUMP
        return Special(kind, nearest, m - 1, fault)

    def _ending(self, here: Point, tangent: Floats, size: float, cause: str) -> str:
        """Return why a branch cannot be followed beyond a point, from the next motions."""
        scale = float(SYSTEM.time_scale(here.orbit.system))
        by_normal = here.orbit.system.law == "normal-impulse"
        slow = GRAZING * size_of(here.orbit.system, here.orbit.state) / scale
        for step in (1.0e-6, 1.0e-5, 1.0e-4, 1.0e-3):
            ahead = (here.along + step * size * tangent) / self._units
            try:
                shot = shoot(
                    started(self._system_of(float(ahead[-1])), ahead[:-2]), float(ahead[-2])
                )
            except NoOrbit as error:
                return str(error)
            if shot.jumps != self._jumps:
                now, before = (
                    [[word for word in one if word[-1] not in "<>"] for one in jumps]
                    for jumps in (shot.jumps, self._jumps)
                )
                if now == before:
                    return "seam"
                weakest = min(shot.approach, here.orbit.shot.approach)
                return "grazing" if weakest < slow else "coincidence"
            words = (shot.word, here.orbit.shot.word)
            one, other = (by_body(word, len(self._jumps)) for word in words)
            if by_normal and one != other:
                return "junction"
        if here.orbit.shot.approach < _NEARLY_GRAZING * slow:
            return "grazing"
        # Over a period rounding grows by the greatest multiplier.
        grown = EPSILON * abs(here.orbit.multipliers[0])
        return "rounding" if grown > 0.1 * NEARLY_CLOSED else cause


def _share_left(one: Point, other: Point) -> float:
    """Return the ratio of two gaps over half the period; negative if one vanishes in between."""
    orbits = one.orbit, other.orbit
    if any(2 not in orbit.part_gaps for orbit in orbits):
        return 1.0
    bodies = len(one.orbit.system.bodies)
    gap, left = (orbit.part_gaps[2].reshape(-1, 2 * bodies) for orbit in orbits)
    # Gaps of half a round change their sign where the other way round becomes the shorter. The
    # correction is exactly 0 elsewhere.
    left = left + (gap_of(one.orbit.system, gap, left) - (left - gap))
    return float(np.vdot(gap, left) / np.vdot(gap, gap))


def _nearly_halved(here: Point) -> bool:
    """Return whether an orbit nearly repeats after half of its period."""
    orbit = here.orbit
    gap = float(np.linalg.norm(orbit.part_gaps.get(2, np.inf)))
    return gap < _BESIDE_HALVING * size_of(orbit.system, orbit.state)


def _turn(before: Point, here: Point, after: Point) -> bool:
    """Return whether the family turns back at a point between two others."""
    return (here.value - before.value) * (after.value - here.value) < 0.0


def _beyond(place: int, orbit: Orbit) -> float:
    # The last term allows for rounding.
    return float(abs(orbit.multipliers[place])) - 1.0 - ROUNDING


def _apart(one: Point, other: Point) -> float:
    return float(np.linalg.norm(one.along - other.along))


def _comes_to_one(orbit: Orbit) -> bool:
    """Return whether a multiplier is at 1 up to rounding.

    Near 1 the start has an error of residual/distance, and so does the distance.
    """
    return _distance(orbit, 1.0) ** 2 <= max(PARTED**4, orbit.residual)


def _distance(orbit: Orbit, at: float) -> float:
    """Return the product of all multipliers' differences from a number; it changes sign there."""
    matrix = orbit.reduced
    return float(np.linalg.det(matrix - at * np.eye(len(matrix))))
