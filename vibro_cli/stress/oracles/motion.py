"""Motion of bodies that are free or in lasting contact, as Taylor series in fixed point.

A number is an integer multiple of ``2^-BITS``. Each body has the place ``(x, y)`` of its centre,
the tangent ``(c, s)`` of its path, a speed ``v`` and a coordinate ``q`` on its piece. With the
path's curvature ``kappa_c`` and the force along the path

``x' = v c,  y' = v s,  c' = -kappa_c v s,  s' = kappa_c v c,``
``kappa v' = -g s + Omega^2 (x - x_0) c + (contact forces)/m.``

Bodies in contact keep their distance: ``n (A_b - A_a) + |V_b - V_a|^2/d = 0``, n from a to b, which
determines the forces, order by order. Lines, arcs and pairs on two pieces share one formula;
neither elliptic functions nor periods nor the energy are used.

The first zero of a polynomial on (0, 1] is found by bisection: an interval of midpoint m and half
width h has none if ``p(m) > |p'(m)| h + B h^2/2``, with B a bound of ``|p''|`` from the
coefficients; else it is halved.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from operator import mul
from typing import Any, NamedTuple

from vibro_cli.stress.oracles.scene import Path, Real, Scene, mp

BITS = 168
ORDER = 44
# Bound of the last terms of a series.
LEFT_OUT = 2.0**-156
# First guess of a step (s), and the greatest growth from one step to the next.
FIRST_STEP = 0.05
GROWTH = 3.0
# Least ratio by which a series is shortened; shortening more would lose digits.
SHORTER = 0.2

Whole = int
Series = list[int]


def whole(value: Real) -> Whole:
    """Convert a number to a multiple of ``2^-BITS``."""
    return int(mp.nint(mp.ldexp(value, BITS)))


def real(value: Whole) -> Real:
    """Convert a multiple of ``2^-BITS`` to a number."""
    return mp.ldexp(mp.mpf(value), -BITS)


def product(a: Series, b: Series, k: int) -> Whole:
    """Return coefficient k of the product of two series."""
    total: int = sum(map(mul, a[: k + 1], b[k::-1]))
    return total >> BITS


def square(a: Series, k: int) -> Whole:
    """Return coefficient k of the square of a series."""
    half = (k + 1) // 2
    total: int = 2 * sum(map(mul, a[:half], a[k : k - half : -1]))
    return (total if k % 2 else total + a[half] ** 2) >> BITS


def scaled(a: Whole, b: Whole) -> Whole:
    """Return the product of two numbers."""
    return (a * b) >> BITS


class State(NamedTuple):
    """Place and speed of a body."""

    piece: int
    place: Real  # phi, psi or a distance
    speed: Real


class Course:
    """Series of one body over a step ``h`` (s), in powers of the share of the step."""

    def __init__(self, scene: Scene, path: Path, state: State, h: Whole) -> None:
        start = (*path.centre(state.place), *path.tangent(state.place), state.speed, state.place)
        self.x, self.y, self.c, self.s, self.v, self.q = ([whole(number)] for number in start)
        self.along: Series = []  # V_x
        self.across: Series = []  # V_y
        self.rate: Series = []  # v', not in shares
        self._h = h
        self._curvature_h = scaled(h, whole(path.curvature))
        self._per_length_h = scaled(h, whole(path.per_length))
        self._pull = whole(scene.gravity / path.body.kappa)
        self._turning = whole(scene.turning_square / path.body.kappa)
        self._axis = whole(scene.axis)
        self._force = path.body.force and path.body.force(h)

    def series(self) -> tuple[Series, ...]:
        """Return all series."""
        integrated = (self.x, self.y, self.c, self.s, self.v, self.q)
        return (*integrated, self.along, self.across, self.rate)

    def force_free(self, k: int, still: bool) -> None:
        """Append coefficient k of the velocity, and of ``v'`` without contact forces."""
        if self._curvature_h:
            self.along.append(product(self.v, self.c, k))
            self.across.append(product(self.v, self.s, k))
        else:  # the direction of a line is constant
            self.along.append(scaled(self.v[k], self.c[0]))
            self.across.append(scaled(self.v[k], self.s[0]))
        rate = -scaled(self._pull, self.s[k])
        if self._turning:
            arm = self.x[: k + 1]
            arm[0] -= self._axis
            rate += scaled(self._turning, product(arm, self.c, k))
        if self._force:
            rate += self._force.append(k, self.x, self.v)
        self.rate.append(0 if still else rate)

    def advance(self, k: int) -> None:
        """Append coefficient k + 1 of all integrated series."""
        along, across = self.along[k], self.across[k]
        self.x.append(scaled(along, self._h) // (k + 1))
        self.y.append(scaled(across, self._h) // (k + 1))
        self.c.append(-scaled(across, self._curvature_h) // (k + 1))
        self.s.append(scaled(along, self._curvature_h) // (k + 1))
        self.q.append(scaled(self.v[k], self._per_length_h) // (k + 1))
        self.v.append(scaled(self.rate[k], self._h) // (k + 1))


def squared_distance(one: Course, other: Course) -> Series:
    """Return the series of the squared distance of two centres."""
    sides = [
        [after - before for before, after in zip(*axis, strict=True)]
        for axis in ((one.x, other.x), (one.y, other.y))
    ]
    return [sum(square(side, k) for side in sides) for k in range(len(one.x))]


class Group:
    """Bodies that move together: one free body, or several in contact.

    ``constraints`` are the pairs that keep their distance: left body, right body (both counted
    within the group) and distance (m). If it is ``still``, a wall holds all its bodies.
    """

    def __init__(
        self,
        scene: Scene,
        balls: Sequence[int],
        states: Sequence[State],
        constraints: Sequence[tuple[int, int, Real]],
        still: bool = False,
    ) -> None:
        self.scene, self.balls, self.constraints, self.still = scene, balls, constraints, still
        self.states = states
        self.paths = [Path(scene, n, s.piece) for n, s in zip(balls, states, strict=True)]
        self.forces: list[Series] = []
        self.courses: list[Course] = []

    def expand(self, step: Real, order: int) -> None:
        """Compute the series for a step (s)."""
        h = whole(step)
        self.forces = [[] for _ in self.constraints]
        self.courses = [
            Course(self.scene, path, state, h)
            for path, state in zip(self.paths, self.states, strict=True)
        ]
        contacts = [] if self.still else [_Contact(self, *one) for one in self.constraints]
        inverse: list[list[Whole]] = []
        for k in range(order):
            for course in self.courses:
                course.force_free(k, self.still)
            if contacts:
                balances = [one.extend(k) for one in contacts]
                inverse = inverse or self._inverse(contacts)
                self._add_forces(contacts, inverse, balances, k)
            for course in self.courses:
                course.advance(k)

    def _inverse(self, contacts: list[_Contact]) -> list[list[Whole]]:
        """Return the inverse of the matrix from forces to accelerations of the distances."""
        normals = [
            {one.a: -real(one.along[0][0]), one.b: real(one.along[1][0])} for one in contacts
        ]
        mobility = [1 / (path.body.kappa * path.body.mass) for path in self.paths]
        size = len(contacts)
        matrix = mp.matrix(size, size)
        for row, mine in enumerate(normals):
            for column, other in enumerate(normals):
                matrix[row, column] = mp.fsum(
                    mine[n] * other[n] * mobility[n] for n in mine if n in other
                )
        solution = matrix**-1
        return [[whole(solution[row, column]) for column in range(size)] for row in range(size)]

    def _add_forces(
        self, contacts: list[_Contact], inverse: list[list[Whole]], balances: list[Whole], k: int
    ) -> None:
        """Append coefficient k of the contact forces, and add their part of ``v'``.

        The known parts of order k are added first, with the forces' coefficient k set to zero.
        """
        for one, force in zip(contacts, self.forces, strict=True):
            force.append(0)
            for side, sign in ((0, -1), (1, 1)):
                share = scaled(product(force, one.along[side], k), one.mobility[side])
                one.courses[side].rate[k] += sign * share
        for number, one in enumerate(contacts):
            a, b = one.courses
            balances[number] += product(b.rate, one.along[1], k) - product(a.rate, one.along[0], k)
        for row, (one, force) in enumerate(zip(contacts, self.forces, strict=True)):
            force[k] = -sum(scaled(inverse[row][n], balances[n]) for n in range(len(contacts)))
            for side, sign in ((0, -1), (1, 1)):
                share = scaled(scaled(force[k], one.along[side][0]), one.mobility[side])
                one.courses[side].rate[k] += sign * share

    def _series(self) -> list[Series]:
        """Return all series of all bodies."""
        return [one for course in self.courses for one in course.series()]

    def tail(self) -> float:
        """Return the size of the last terms."""
        last = max(abs(value) for one in self._series() for value in one[-3:])
        return float(last) / 2.0**BITS

    def shorten(self, ratio: Real) -> None:
        """Rescale the series to a share of the step."""
        power, factor = 1 << BITS, whole(ratio)
        powers = []
        for _ in self.courses[0].x:
            powers.append(power)
            power = scaled(power, factor)
        for one in (*self._series(), *self.forces):
            for k, value in enumerate(one):
                one[k] = scaled(value, powers[k])

    def at(self, u: Whole) -> list[State]:
        """Return the states at a share of the step."""
        return [
            State(old.piece, real(value_of(course.q, u)), real(value_of(course.v, u)))
            for old, course in zip(self.states, self.courses, strict=True)
        ]


def value_of(series: Series, u: Whole) -> Whole:
    """Return the value of a series at a share of the step."""
    total = 0
    for coefficient in reversed(series):
        total = ((total * u) >> BITS) + coefficient
    return total


class _Contact:
    """Series of one pair in contact."""

    def __init__(self, group: Group, a: int, b: int, distance: Real) -> None:
        self.a, self.b = a, b
        self.courses = (group.courses[a], group.courses[b])
        self.inverse_distance = whole(1 / distance)
        self.curvature = [whole(group.paths[n].curvature) for n in (a, b)]
        bodies = [group.paths[n].body for n in (a, b)]
        self.mobility = [whole(1 / (body.kappa * body.mass)) for body in bodies]
        self.normal: tuple[Series, Series] = ([], [])
        self.along: tuple[Series, Series] = ([], [])  # n t of a and of b
        self.square: tuple[Series, Series] = ([], [])  # v^2
        self.inward: tuple[Series, Series] = ([], [])  # n N, N the normal of the path
        self.relative: tuple[Series, Series] = ([], [])  # V_b - V_a

    def extend(self, k: int) -> Whole:
        """Append coefficient k of all known series; return that of what the forces balance."""
        a, b = self.courses
        for axis, (one, other) in enumerate(((a.x, b.x), (a.y, b.y))):
            self.normal[axis].append(scaled(other[k] - one[k], self.inverse_distance))
        self.relative[0].append(b.along[k] - a.along[k])
        self.relative[1].append(b.across[k] - a.across[k])
        balance = sum(square(one, k) for one in self.relative)
        balance = scaled(balance, self.inverse_distance)
        nx, ny = self.normal
        for side, (course, sign) in enumerate(((a, -1), (b, 1))):
            self.along[side].append(product(nx, course.c, k) + product(ny, course.s, k))
            self.inward[side].append(product(ny, course.c, k) - product(nx, course.s, k))
            self.square[side].append(square(course.v, k))
            turned = product(self.square[side], self.inward[side], k)
            balance += sign * scaled(self.curvature[side], turned)
        return balance


def expand_all(groups: Sequence[Group], guess: Real, order: int = ORDER) -> Real:
    """Expand groups over the longest step, up to a guess (s), that all series allow; return it.

    If the given order does not suffice, the full order is used.
    """
    for group in groups:
        group.expand(guess, order)
    tail = max(group.tail() for group in groups)
    if tail > LEFT_OUT and order < ORDER:
        return expand_all(groups, guess)
    ratio: Any = mp.one
    if tail > LEFT_OUT:
        ratio = mp.mpf((LEFT_OUT / tail) ** (1.0 / (ORDER - 2)))
        if ratio < SHORTER:
            return expand_all(groups, guess * ratio)
        for group in groups:
            group.shorten(ratio)
    return guess * ratio


def order_for(step: float, longest: float) -> int:
    """Return the order that a step (s) needs, given the longest step of the full order."""
    if step >= longest:
        return ORDER
    # Ratio of successive terms of the full order at the longest step.
    fall = LEFT_OUT ** (1.0 / ORDER)
    return min(max(math.ceil(math.log(LEFT_OUT) / math.log(fall * step / longest)) + 3, 8), ORDER)


# Leading terms smaller than this share of the greatest term (in bits) count as zero.
ROUNDING_BITS = 104
FINEST = 150  # halvings
SLOPPY = 1.0 + 1.0e-9  # allowance for rounding of bounds computed in doubles


class Undecided(ArithmeticError):
    """Raised if the outcome depends on digits beyond the working precision."""


def without_leading_zeros(series: Series) -> Series:
    """Return the polynomial divided by its leading power of the variable.

    It is empty if all terms are within rounding.
    """
    least = max(abs(value) for value in series) * 2.0**-ROUNDING_BITS
    for k, value in enumerate(series):
        if abs(value) > max(least, 2.0 ** (BITS - 140)):
            return series[k:]
    return []


def first_zero(series: Series, end: Whole) -> Whole | None:
    """Return the first zero up to ``end`` of a polynomial that is positive at 0, or None.

    Raises `Undecided` if it is not positive at 0.
    """
    if series[0] <= 0:
        raise Undecided("a distance is not positive at the start of a step")
    slope = [k * value for k, value in enumerate(series)][1:]
    second = SLOPPY * float(sum(k * abs(value) for k, value in enumerate(slope)))
    stack = [(0, end)]
    negative = None  # a place where it is negative
    while stack:
        low, high = stack.pop()
        middle, half = (low + high) >> 1, float(high - low) / 2.0 ** (BITS + 1)
        value, rate = value_of(series, middle), value_of(slope, middle)
        if float(value) > SLOPPY * (abs(float(rate)) * half + 0.5 * second * half * half):
            continue
        if high - low < 1 << (BITS - FINEST):
            return middle
        if value > 0:
            stack += [(middle, high), (low, middle)]
            continue
        if abs(float(rate)) > second * half and value_of(series, low) > 0:
            return _polished(series, slope, low, middle)
        negative, stack = middle, [(low, middle)]  # the right half no longer matters
    if negative is not None:
        return negative
    return None if value_of(series, end) > 0 else end


def _polished(series: Series, slope: Series, low: Whole, high: Whole) -> Whole:
    """Return the zero between a positive and a negative value, by bracketed Newton steps."""
    u = high
    for _ in range(4 * BITS):
        value = value_of(series, u)
        if value > 0:
            low = u
        else:
            high = u
        rate = value_of(slope, u)
        following = u - ((value << BITS) // rate) if rate else low
        if not low < following < high:
            following = (low + high) >> 1
        if abs(following - u) <= 1 or high - low <= 1:
            return following
        u = following
    return u
