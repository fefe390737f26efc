"""Motion of one body on one piece to 40 digits, by Taylor series of its equation of motion.

On an arc the angle f from the lowest point of the full circle obeys ``f'' = -w^2 sin f``. In
``S = sin(f/2)``, ``C = cos(f/2)``, ``P = f'/(2w)`` that is ``S' = wPC, C' = -wPS, P' = -wSC``;
their Taylor coefficients follow from one another by products of series. On a trace that turns
``P' = w(-SC + tilt (C^2 - S^2)/2 + spread SC(C^2 - S^2))``. Nothing is known here of elliptic
functions, of periods or of the energy.
"""

from __future__ import annotations

from typing import Any

from mpmath import MPContext

mp: Any = MPContext()
mp.dps = 50
Real = Any  # a number of this context
State = tuple[Real, Real, Real]

# The nearest singularity of S, C, P in complex time is at least about pi/(2w sqrt(max(m, 1))) away,
# m = S^2 + P^2; the terms left out of a step of 0.25/w are about (0.25/1.57)^60 = 1e-48.
TERMS = 60
STEP = mp.mpf("0.25")


def series(state: State) -> tuple[list[Real], list[Real], list[Real]]:
    """Taylor coefficients of S, C, P in ``w t`` from the state at 0."""
    s, c, p = ([value] for value in state)
    for k in range(1, TERMS + 1):
        products = (
            mp.fdot(zip(p, reversed(c), strict=True)),
            mp.fdot(zip(p, reversed(s), strict=True)),
            mp.fdot(zip(s, reversed(c), strict=True)),
        )
        s.append(products[0] / k)
        c.append(-products[1] / k)
        p.append(-products[2] / k)
    return s, c, p


def turning_series(
    state: State, tilt: Real, spread: Real
) -> tuple[list[Real], list[Real], list[Real]]:
    """Taylor coefficients of S, C, P in ``w t`` from the state at 0, on a trace that turns."""
    s, c, p = ([value] for value in state)
    sines: list[Real] = []  # of S C and of C^2 - S^2
    cosines: list[Real] = []
    for k in range(1, TERMS + 1):
        sines.append(mp.fdot(zip(s, reversed(c), strict=True)))
        cosines.append(
            mp.fdot(zip(c, reversed(c), strict=True)) - mp.fdot(zip(s, reversed(s), strict=True))
        )
        both = mp.fdot(zip(sines, reversed(cosines), strict=True))
        turned = mp.fdot(zip(p, reversed(c), strict=True))
        back = mp.fdot(zip(p, reversed(s), strict=True))
        s.append(turned / k)
        c.append(-back / k)
        p.append((-sines[-1] + tilt * cosines[-1] / 2 + spread * both) / k)
    return s, c, p


class ArcMotion:
    """The half-angle variables of a body on an arc as functions of time; the series are kept.

    Parameters
    ----------
    frequency
        ``w = sqrt(g/(kappa rho))``, 1/s.
    state
        ``(S, C, P)`` at time 0.
    pull
        ``(tilt, spread)`` of a trace that turns.
    """

    def __init__(
        self, frequency: Real, state: State, pull: tuple[Real, Real] | None = None
    ) -> None:
        self.frequency = frequency
        size = state[0] ** 2 + state[2] ** 2
        if pull is not None:
            # The singularities come nearer with the square root of the strongest pull.
            size += 2 * (abs(pull[0]) + abs(pull[1]))
        self._step = STEP / mp.sqrt(max(size, 1))
        self._next = series if pull is None else lambda start: turning_series(start, *pull)
        self._series = [self._next(state)]

    def at(self, t: Real) -> State:
        """``(S, C, P)`` a time t (s) after the start; slightly negative times are allowed."""
        u = self.frequency * t
        number = max(int(mp.floor(u / self._step)), 0)
        while len(self._series) <= number:
            self._series.append(self._next(self._sum(-1, self._step)))
        return self._sum(number, u - number * self._step)

    def _sum(self, number: int, u: Real) -> State:
        powers = [mp.one]
        for _ in range(TERMS):
            powers.append(powers[-1] * u)
        s, c, p = (mp.fdot(zip(column, powers, strict=True)) for column in self._series[number])
        return s, c, p
