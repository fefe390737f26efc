"""heyoka's Taylor integrator with terminal events.

One integrator for each set of arcs the bodies are on, built once. Impacts are carried out in the
event's callback, so that heyoka goes on by itself until a body changes its arc; `fast_math` lets it
reorder sums. Both make it faster than its defaults and a loop over steps do, and cost no accuracy
here; the plain form is measured too.
"""

from __future__ import annotations

import math
from typing import Any

from vibro_cli.benchmark.methods.motion import Motion
from vibro_cli.benchmark.methods.runner import Course, Lost, Method, Runner, Setting, course_of
from vibro_cli.benchmark.scenes import Scene

_TOLERANCES = (1e-16, 1e-12, 1e-9, 1e-6)
_FAR = 1.0e9


def gap(hy: Any, motion: Motion, pair: int, pieces: tuple[int, ...], angles: list[Any]) -> Any:
    """The gap of ``Motion.gap`` as an expression."""
    a, b = motion.pairs[pair]
    if pieces[a] == pieces[b]:
        turn = math.tau if b < a else 0.0
        return angles[b] - angles[a] + (turn - motion.contact_angle(a, b, pieces[a]))
    places = []
    for ball in (a, b):
        arc, rho = motion.arcs[pieces[ball]], motion.radius[ball][pieces[ball]]
        places.append(
            (arc.x + rho * hy.sin(angles[ball]), arc.y - arc.sign * rho * hy.cos(angles[ball]))
        )
    touch = motion.bodies[a].radius + motion.bodies[b].radius
    (xa, ya), (xb, yb) = places
    return (xb - xa) ** 2 + (yb - ya) ** 2 - touch**2


class HeyokaRunner(Runner):
    """A scene for heyoka.

    Parameters
    ----------
    motion
        What moves.
    tolerance
        Of the integrator.
    fast
        Whether impacts are carried out in callbacks and `fast_math` is on.
    """

    def __init__(self, motion: Motion, tolerance: float, fast: bool) -> None:
        self._motion, self._tolerance, self._fast = motion, tolerance, fast
        self._integrators: dict[tuple[int, ...], tuple[Any, Any]] = {}
        self.ready(0)

    def ready(self, impacts: int) -> None:
        """Go back to the start; the integrators built so far are kept."""
        self._wanted = impacts
        self._times: list[float] = []
        self._crossings = 0
        self._crossed: list[tuple[tuple[int, ...], list[float]]] = []
        self._enter(self._motion.pieces, 0.0, list(self._motion.start))

    def _enter(self, pieces: tuple[int, ...], t: float, y: list[float]) -> None:
        """Go on with the integrator of these pieces."""
        if pieces not in self._integrators:
            self._integrators[pieces] = self._build(pieces)
        self._pieces = pieces
        self._integrator, self._state = self._integrators[pieces]
        self._integrator.reset_cooldowns()
        self._integrator.time = t
        self._state[:] = y

    def go(self) -> None:
        """Go on until enough impacts have happened; the callbacks do what is to be done."""
        import heyoka as hy

        stopped = (hy.taylor_outcome.success, hy.taylor_outcome.err_nf_state)
        while len(self._times) < self._wanted:
            before = len(self._times), self._crossings
            outcome = self._integrator.propagate_until(self._integrator.time + _FAR)[0]
            if outcome in stopped or before == (len(self._times), self._crossings):
                raise Lost(f"heyoka ended with {outcome} at t = {self._integrator.time:.6g} s")
            for pieces, y in self._crossed:
                self._enter(pieces, self._integrator.time, y)
            self._crossed.clear()

    def course(self) -> Course:
        """Return times, counts and drift of energy."""
        y = self._state.tolist()
        return course_of(self._motion, self._times, self._crossings, self._pieces, y)

    def _build(self, pieces: tuple[int, ...]) -> tuple[Any, Any]:
        import heyoka as hy

        motion = self._motion
        names = [name for ball in range(len(pieces)) for name in (f"a{ball}", f"v{ball}")]
        variables = hy.make_vars(*names)
        angles, rates = list(variables[::2]), list(variables[1::2])
        equations = []
        for ball, piece in enumerate(pieces):
            equations.append((angles[ball], rates[ball]))
            equations.append((rates[ball], -motion.w2[ball][piece] * hy.sin(angles[ball])))
        down = hy.event_direction.negative
        events = [
            hy.t_event(
                gap(hy, motion, pair, pieces, angles),
                callback=self._impact(pair, pieces),
                direction=down,
            )
            for pair in range(len(motion.pairs))
        ]
        for ball, side in motion.junctions(pieces):
            arc = motion.arcs[pieces[ball]]
            room = arc.high - angles[ball] if side > 0 else angles[ball] - arc.low
            events.append(hy.t_event(room, callback=self._crossing(ball, side), direction=down))
        integrator = hy.taylor_adaptive(
            equations, [0.0] * len(names), tol=self._tolerance, t_events=events,
            fast_math=self._fast,
        )  # fmt: skip
        return integrator, integrator.state

    def _impact(self, pair: int, pieces: tuple[int, ...]) -> Any:
        a, b = self._motion.pairs[pair]
        rate_a, rate_b = 2 * a + 1, 2 * b + 1
        constant = None
        if pieces[a] == pieces[b]:
            y = [0.0] * (2 * len(pieces))
            y[2 * b] = self._motion.contact_angle(a, b, pieces[a])
            constant = self._motion.jump(pair, pieces, y)

        def impact(integrator: Any, direction: int) -> bool:
            state = self._state
            p, q, alpha, beta = constant or self._motion.jump(pair, pieces, state.tolist())
            closing = p * state.item(rate_a) - q * state.item(rate_b)
            if closing > 0.0:
                state[rate_a] -= alpha * closing
                state[rate_b] += beta * closing
                self._times.append(integrator.time)
            return self._fast and len(self._times) < self._wanted

        return impact

    def _crossing(self, ball: int, side: int) -> Any:
        def crossing(integrator: Any, direction: int) -> bool:
            y = self._state.tolist()
            self._crossed.append((self._motion.cross(ball, side, self._pieces, y), y))
            self._crossings += 1
            return False

        return crossing


def methods() -> list[Method]:
    """Return heyoka with fast options and as it is by default."""
    settings = tuple(Setting(f"{tolerance:g}", tolerance) for tolerance in _TOLERANCES)

    def one(name: str, fast: bool) -> Method:
        def prepare(scene: Scene, setting: Setting) -> Runner:
            assert setting.value is not None
            return HeyokaRunner(Motion(scene.system), setting.value, fast)

        return Method(name, settings, lambda scene: True, prepare, 1000)

    return [one("heyoka", True), one("heyoka, defaults", False)]
