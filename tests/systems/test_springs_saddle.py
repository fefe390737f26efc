"""Bodies that pass the saddle of their spring slowly, or turn beside it, against 40 digits."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
import pytest
from mpmath import mp

from tests.systems.springs_cases import Document, disk, solve, spring, springs

STARTS = [
    *((0.0, speed) for speed in (0.03, 1e-3, 1e-5, 1e-7, 1e-12, 1e-50, 1e-100, 1e-160, 1e-200)),
    *((place, 0.0) for place in (1e-3, 1e-6, 1e-10, 1e-14, 1e-100, 1e-200)),
]
"""Displacement (m) and speed (m/s) at the saddle or beside it."""
CASES = [
    *((5.0, 1.0, *start) for start in STARTS),
    *((length, height, *start) for length, height in ((2.0, 1.0), (1.5, 1.0), (5.0, 1e-6))
      for start in ((0.0, 0.03), (0.0, 1e-7), (0.0, 1e-200), (1e-10, 0.0))),
    *((5.0, 1.0, 0.0, speed) for speed in (0.05, 0.1, 0.15, 0.2, 0.24, 0.27, 1.0, 5.0)),
    *((5.0, 1.0, place, 0.0) for place in (0.013, 0.037, 0.06, 0.25, 1.3)),
    *((length, 1.0, 0.0, share * (length - 1.0))
      for length in (1.05, 1.5) for share in (0.05, 0.065, 0.6, 1.4)),
    *((1.05, 1.0, place, 0.0) for place in (0.005, 0.0078, 0.06)),
    *((5.0, height, 0.0, speed) for height in (1e-15, 1e-30) for speed in (0.27, 6.0)),
]  # fmt: skip
"""Length and height of the spring (m) and the start."""
SHORT = [
    (5.0, 1.0, 0.0, 1e-7), (5.0, 1.0, 1e-10, 0.0), (1.5, 1.0, 0.0, 1e-200),
    (1.05, 1.0, 0.0, 0.065 * (1.05 - 1.0)), (1.05, 1.0, 0.0078, 0.0), (5.0, 1e-15, 0.0, 6.0),
]  # fmt: skip
"""Those that are not among the long tests."""


class Passage(NamedTuple):
    time: Any
    place: Any
    speed: Any


def integral(pace: Callable[[Any], Any], cuts: Sequence[Any]) -> Any:
    """Integrate by Gauss-Legendre, which has to tell an error far below what is allowed."""
    value, error = mp.quad(pace, cuts, method="gauss-legendre", maxdegree=6, error=True)
    assert error <= 1e-20 * value
    return value


class Swing:
    """Motion from the saddle or beside it, by v^2 = v0^2 + w^2 (s - s0)(2 l - s - s0), C (7)."""

    def __init__(self, length: float, height: float, place: float, speed: float) -> None:
        self.l, self.b, self.x0, self.v0 = map(mp.mpf, (length, height, place, speed))

    def speed(self, x: Any, gained: Any) -> Any:
        """Return the speed at a displacement, given x^2 - x0^2, which would lose digits near x0."""
        s, s0 = mp.hypot(self.b, x), mp.hypot(self.b, self.x0)
        return mp.sqrt(self.v0**2 + 4 * gained / (s + s0) * (2 * self.l - s - s0))

    def time_to(self, x: Any) -> Any:
        """Return the time from the start: on x0 cosh u or v0/q sinh u, u is nearly q t there."""
        q = 2 * mp.sqrt((self.l - self.b) / self.b)
        if self.x0:
            scale, of, rate, end = self.x0, mp.cosh, mp.sinh, mp.acosh(x / self.x0)
        else:
            scale, of, rate, end = self.v0 / q, mp.sinh, mp.cosh, mp.asinh(x * q / self.v0)
        cuts = mp.linspace(0, end, int(end / 3) + 2)

        def pace(u: Any) -> Any:
            return scale * rate(u) / self.speed(scale * of(u), (scale * mp.sinh(u)) ** 2)

        return integral(pace, cuts)

    def passages_of_centres(self, count: int) -> list[Passage]:
        centre = mp.sqrt(self.l**2 - self.b**2)
        out, most = self.time_to(centre), self.speed(centre, centre**2 - self.x0**2)

        # From the centre outwards the stretch is most/w sin a.
        def pace(a: Any) -> Any:
            s = self.l + most / 2 * mp.sin(a)
            return s / (2 * mp.sqrt(s**2 - self.b**2))

        back = 2 * integral(pace, [0, mp.pi / 4, mp.pi / 2])
        found, side, time = [], 1, out
        for number in range(count):
            found.append(Passage(time, side * centre, side * (most if number % 2 == 0 else -most)))
            time += back if number % 2 == 0 else 2 * out
            if number % 2 == 1 and not self.x0:
                side = -side
        return found


def _check(found: dict[str, Any], exact: list[Passage], body: int = 0, bodies: int = 1) -> None:
    """Compare with states of a body: times may be off by 2e-15 of themselves."""
    for number, one in enumerate(exact):
        row = number * bodies + body
        off = float(one.time) - one.time
        allowed = 2e-15 * one.time * abs(one.speed)
        assert abs(float(found["displacement"][row]) - one.place - one.speed * off) <= allowed
        assert abs(float(found["speed"][row]) - one.speed) <= 1e-15 * (5.0 + abs(one.speed))


@pytest.mark.parametrize(
    ("length", "height", "place", "speed"),
    [pytest.param(*case, marks=() if case in SHORT else pytest.mark.long) for case in CASES],
)
def test_swings_over_and_beside_the_saddle(
    length: float, height: float, place: float, speed: float
) -> None:
    """Four swings: a body without neighbours was 0.4 m off after the first from 1e-7 m/s."""
    with mp.workdps(40):
        exact = Swing(length, height, place, speed).passages_of_centres(8)
        times = [float(one.time) for one in exact]
        body = disk(place, speed, spring(6.0, length, height, 0.0))
        run = solve(springs([body], time=times[-1]))
        _check(run.sample(times), exact)


def _pair_beside(body: Document) -> list[Document]:
    """Two bodies far from a first one that collide with each other now and then."""
    return [body, *(disk(1e3 + x, 0.0, spring(6.0, 0.5, 1.0, 1e3 + x)) for x in (0.0, 0.9))]


@pytest.mark.parametrize("k", [1.0, 0.9])
def test_impacts_of_others_change_nothing_of_it(k: float) -> None:
    with mp.workdps(40):
        exact = Swing(5.0, 1.0, 0.0, 1e-60).passages_of_centres(6)
        times = [float(one.time) for one in exact]
        balls = _pair_beside(disk(0.0, 1e-60, spring(6.0, 5.0, 1.0, 0.0)))
        balls[2]["speed"] = -1.0
        run = solve(springs(balls, k, time=times[-1]))
        assert len(run.collisions["t"]) > 20
        _check(run.sample(times), exact, 0, 3)


@pytest.mark.parametrize(
    "speed", [1e-7, *(pytest.param(v, marks=pytest.mark.long) for v in (1e-2, 1e-5, 1e-30, 1e-200))]
)
@pytest.mark.parametrize("engine", ["compiled", "python"])
def test_an_impact_on_its_mirror_image_turns_it_back_over_its_saddle(
    speed: float, engine: str
) -> None:
    """At k = 1 each body goes back as it came, and passes its saddle as fast as at the start."""
    with mp.workdps(40):
        swing = Swing(5.0, 1.0, 0.0, speed)
        met = mp.mpf(3.4) - mp.mpf(0.4)  # from the foot; the disks have radii of 0.4 m
        first = swing.time_to(met)
        exact = [
            Passage(one.time + 2 * first, -one.place, -one.speed)
            for one in swing.passages_of_centres(2)
        ]
        times = [float(one.time) for one in exact]
        balls = [
            disk(-3.4, speed, spring(6.0, 5.0, 1.0, -3.4)),
            disk(3.4, -speed, spring(6.0, 5.0, 1.0, 3.4)),
        ]
        run = solve(springs(balls, 1.0, time=times[-1]), engine)
        assert len(run.collisions["t"]) == 1
        assert abs(float(run.collisions["t"][0]) - first) <= 1e-15 * first
        found = run.sample(times)
        _check(found, exact, 0, 2)
        assert found["displacement"][0::2].tolist() == (-found["displacement"][1::2]).tolist()


def test_a_loss_takes_it_below_its_saddle() -> None:
    """By its mirror image with k = 1 - 1e-4: it turns where C (7) says, beside the saddle."""
    k, speed = 1.0 - 1e-4, 1e-8
    balls = [
        disk(-3.4, speed, spring(6.0, 5.0, 1.0, -3.4)),
        disk(3.4, -speed, spring(6.0, 5.0, 1.0, 3.4)),
    ]
    with mp.workdps(40):
        met = mp.mpf(3.4) - mp.mpf(0.4)
        fast = Swing(5.0, 1.0, 0.0, speed).speed(met, met**2)
        level = mp.mpf(speed) ** 2 - (1 - mp.mpf(k) ** 2) * fast**2  # v^2 at the saddle
        # (s - b)(2 l - s - b) = -level/w^2 where it turns
        s = 5 - mp.sqrt(16 + level / 4)
        turn = float(mp.sqrt(s**2 - 1))
        run = solve(springs(balls, k, time=12.0))
        assert len(run.collisions["t"]) >= 2
        between = np.linspace(run.collisions["t"][0], run.collisions["t"][1], 20001)
        nearest = np.min(run.sample(between)["displacement"][::2])
        assert nearest == pytest.approx(turn, rel=1e-7)
