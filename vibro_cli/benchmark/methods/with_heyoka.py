"""heyoka's Taylor integrator with terminal events.

One integrator is built for each combination of arcs that the bodies are on. Impacts are applied in
the event's callback, so that heyoka continues by itself until a body changes its arc; `fast_math`
lets it reorder sums. Both make it faster than its defaults and cost no accuracy here. The default
form is measured, too.

Its batches solve the same two bodies from several starts, in the lanes of SIMD registers. Impacts
that lanes make while they wait for others are counted, too.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from vibro_cli.benchmark.methods.runner import (
    Course,
    Event,
    Lost,
    Method,
    Motion,
    Runner,
    Setting,
    tolerances,
)
from vibro_cli.benchmark.scenes import Scene

_FAR = 1.0e9


def _equations(
    hy: Any, motion: Motion, pieces: tuple[int, ...]
) -> tuple[list[Any], list[tuple[Event, Any]]]:
    """Return the equations of motion of bodies on pieces, and their events as expressions."""
    names = [name for ball in range(len(pieces)) for name in (f"a{ball}", f"v{ball}")]
    variables = hy.make_vars(*names)
    angles, rates = list(variables[::2]), list(variables[1::2])
    equations = []
    for ball, piece in enumerate(pieces):
        equations.append((angles[ball], rates[ball]))
        equations.append((rates[ball], -motion.w2[ball][piece] * hy.sin(angles[ball])))
    events = motion.events(pieces, hy.sin, hy.cos)
    return equations, [(event, function(0.0, variables)) for event, function in events]


class _HeyokaRunner(Runner):
    """A scene for heyoka; `fast` applies impacts in callbacks and turns `fast_math` on."""

    def __init__(self, motion: Motion, tolerance: float, fast: bool) -> None:
        self._motion, self._tolerance, self._fast = motion, tolerance, fast
        self._integrators: dict[tuple[int, ...], tuple[Any, Any]] = {}
        self.ready(0)

    def ready(self, impacts: int) -> None:
        """Return to the start; keep the integrators built so far."""
        self._wanted = impacts
        self._times: list[float] = []
        self._crossings = 0
        self._crossed: list[tuple[tuple[int, ...], list[float]]] = []
        self._enter(self._motion.pieces, 0.0, list(self._motion.start))

    def _enter(self, pieces: tuple[int, ...], t: float, y: list[float]) -> None:
        """Continue with the integrator of these pieces."""
        if pieces not in self._integrators:
            self._integrators[pieces] = self._build(pieces)
        self._pieces = pieces
        self._integrator, self._state = self._integrators[pieces]
        self._integrator.reset_cooldowns()
        self._integrator.time = t
        self._state[:] = y

    def go(self) -> None:
        """Integrate until enough impacts have happened; the callbacks handle the events."""
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
        y = self._state.tolist()
        return self._motion.course(self._times, self._crossings, self._pieces, y)

    def _build(self, pieces: tuple[int, ...]) -> tuple[Any, Any]:
        import heyoka as hy

        equations, found = _equations(hy, self._motion, pieces)
        events = [
            hy.t_event(
                expression,
                callback=self._crossing(event.ball, event.side)
                if event.side
                else self._impact(event.pair, pieces),
                direction=hy.event_direction.negative,
            )
            for event, expression in found
        ]
        integrator = hy.taylor_adaptive(
            equations, [0.0] * len(equations), tol=self._tolerance, t_events=events,
            fast_math=self._fast,
        )  # fmt: skip
        return integrator, integrator.state

    def _impact(self, pair: int, pieces: tuple[int, ...]) -> Any:
        a, b = self._motion.pairs[pair]
        rate_a, rate_b = 2 * a + 1, 2 * b + 1
        on_one = pieces[a] == pieces[b]
        constant = self._motion.jump_on_one_arc(pair, pieces[a]) if on_one else None

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
    """Return heyoka with fast options and with its defaults."""

    def prepare(fast: bool, scene: Scene, setting: Setting) -> Runner:
        return _HeyokaRunner(Motion(scene.system), setting.value, fast)

    settings = tolerances(1e-16, 1e-12, 1e-9, 1e-6)
    return [
        Method("heyoka", settings, partial(prepare, True), 1000),
        Method("heyoka, defaults", settings, partial(prepare, False), 1000),
    ]


NAME = "heyoka, batch"
TOLERANCES = (1e-16, 1e-9)
_EACH = 60
"""Impacts of each lane, as many as of each run of our own batches."""
_FEWEST = 10
"""Least number of impacts of each lane, for comparison with the reference."""


class Lanes:
    """Two bodies on one arc that they never leave, from one start per lane."""

    def __init__(self, motion: Motion, tolerance: float) -> None:
        import heyoka as hy

        self.count: int = hy.recommended_simd_size()
        self._motion = motion
        self._law = motion.jump_on_one_arc(0, 0)
        equations, [(_, gap)] = _equations(hy, motion, (0, 0))
        event = hy.t_event_batch(
            gap,
            callback=self._impact(),
            direction=hy.event_direction.negative,
        )
        self._integrator = hy.taylor_adaptive_batch(
            equations, [[0.0] * self.count] * 4, tol=tolerance, t_events=[event], fast_math=True
        )
        self._state: Any = self._integrator.state
        self.first_times: list[float] = []

    def go(self, starts: Any, impacts: int) -> int:
        """Run from states (four rows, a column for each lane); return the number of impacts."""
        self._wanted = impacts
        self._impacts = [0] * self.count
        self._done = 0
        self.first_times = []
        self._integrator.reset_cooldowns()
        self._integrator.set_time(0.0)
        self._state[:] = starts
        self._integrator.propagate_until(np.full(self.count, _FAR))
        if self._done < self.count:
            raise Lost(f"heyoka ended after {min(self._impacts)} impacts")
        return sum(self._impacts)

    def _impact(self) -> Any:
        """Return the callback for an impact: a function, since heyoka would copy an object."""

        def impact(integrator: Any, direction: int, lane: int) -> bool:
            state = self._state
            p, q, alpha, beta = self._law
            closing: float = p * state.item(1, lane) - q * state.item(3, lane)
            if closing > 0.0:
                state[1, lane] -= alpha * closing
                state[3, lane] += beta * closing
                self._impacts[lane] += 1
                if self._impacts[lane] == self._wanted:
                    self._done += 1
                if lane == 0:
                    self.first_times.append(integrator.time.item(0))
            return self._done < self.count

        return impact


class _HeyokaBatchRunner(Runner):
    """A scene in all lanes, repeated from the same start."""

    def __init__(self, motion: Motion, tolerance: float) -> None:
        self._motion = motion
        self._lanes = Lanes(motion, tolerance)

    def ready(self, impacts: int) -> None:
        """Prepare the starts, and each lane's share of the impacts."""
        # The lanes share the impacts, except the first few, which one lane must make alone.
        self._runs = max(1, impacts // (_EACH * self._lanes.count))
        self._each = max(round(impacts / (self._runs * self._lanes.count)), min(impacts, _FEWEST))
        self._starts = np.tile(np.array(self._motion.start)[:, None], self._lanes.count)

    def go(self) -> None:
        self._impacts = sum(self._lanes.go(self._starts, self._each) for _ in range(self._runs))

    def course(self) -> Course:
        """Return the times of the first lane."""
        return Course(list(self._lanes.first_times), self._impacts, 0)


def batches() -> list[Method]:
    """Return heyoka's batches, for two bodies that stay on one arc."""

    def possible(scene: Scene) -> bool:
        trace = scene.system.trace
        alone = len(scene.system.bodies) == 2 and len(trace.pieces) == 1 and not trace.closed
        return alone and scene.most is None

    def prepare(scene: Scene, setting: Setting) -> Runner:
        return _HeyokaBatchRunner(Motion(scene.system), setting.value)

    return [Method(NAME, tolerances(*TOLERANCES), prepare, 8000, possible)]
