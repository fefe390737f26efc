"""heyoka's batches: the same two bodies from several starts, in the lanes of SIMD registers.

As for single runs, impacts are carried out in the event's callback, so that heyoka goes on
by itself until every lane has had its impacts; `fast_math` is on. Impacts that lanes have while
they wait for others count as its own.
"""

from __future__ import annotations

from typing import Any

from vibro_cli.benchmark.methods.motion import Motion
from vibro_cli.benchmark.methods.runner import Course, Lost, Method, Runner, Setting
from vibro_cli.benchmark.methods.with_heyoka import gap
from vibro_cli.benchmark.scenes import Scene

NAME = "heyoka, batch"
TOLERANCES = (1e-16, 1e-9)
_FAR = 1.0e9
_EACH = 60
"""Impacts of each lane, as of each run of our own batches."""
_FEWEST = 10
"""Impacts of each lane at least, for comparison with the reference."""


class Lanes:
    """Two bodies on one arc that they never leave, as often as there are lanes.

    Parameters
    ----------
    motion
        What moves.
    tolerance
        Of the integrator.
    """

    def __init__(self, motion: Motion, tolerance: float) -> None:
        import heyoka as hy

        self.count: int = hy.recommended_simd_size()
        self._motion = motion
        self._law = motion.jump(0, (0, 0), [0.0, 0.0, motion.contact_angle(0, 1, 0), 0.0])
        variables = hy.make_vars("a0", "v0", "a1", "v1")
        angles, rates = list(variables[::2]), list(variables[1::2])
        equations = []
        for ball in range(2):
            equations.append((angles[ball], rates[ball]))
            equations.append((rates[ball], -motion.w2[ball][0] * hy.sin(angles[ball])))
        event = hy.t_event_batch(
            gap(hy, motion, 0, (0, 0), angles),
            callback=self._impact(),
            direction=hy.event_direction.negative,
        )
        self._integrator = hy.taylor_adaptive_batch(
            equations, [[0.0] * self.count] * 4, tol=tolerance, t_events=[event], fast_math=True
        )
        self._state: Any = self._integrator.state
        self.first_times: list[float] = []

    def go(self, starts: Any, impacts: int) -> int:
        """Run from states (four rows, a column for each lane); return all impacts there were."""
        import numpy as np

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
        """What is done at an impact; a function, since heyoka would copy an object with its own."""

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


class HeyokaBatchRunner(Runner):
    """A scene in all lanes, again and again from the same start.

    Parameters
    ----------
    motion
        What moves.
    tolerance
        Of the integrator.
    """

    def __init__(self, motion: Motion, tolerance: float) -> None:
        self._motion = motion
        self._lanes = Lanes(motion, tolerance)

    def ready(self, impacts: int) -> None:
        """Lay out the starts, each lane with its part of the impacts."""
        import numpy as np

        # All lanes together have the impacts, but for a few at the start, where one must have all.
        self._runs = max(1, impacts // (_EACH * self._lanes.count))
        self._each = max(round(impacts / (self._runs * self._lanes.count)), min(impacts, _FEWEST))
        self._starts = np.tile(np.array(self._motion.start)[:, None], self._lanes.count)

    def go(self) -> None:
        """Run."""
        self._impacts = sum(self._lanes.go(self._starts, self._each) for _ in range(self._runs))

    def course(self) -> Course:
        """Return the times of the first lane."""
        return Course(list(self._lanes.first_times), self._impacts, 0)


def methods() -> list[Method]:
    """Return heyoka's batches, for two bodies on one arc that they do not leave."""

    def possible(scene: Scene) -> bool:
        trace = scene.system.trace
        alone = len(scene.system.bodies) == 2 and len(trace.pieces) == 1 and not trace.closed
        return alone and scene.most is None

    def prepare(scene: Scene, setting: Setting) -> Runner:
        assert setting.value is not None
        return HeyokaBatchRunner(Motion(scene.system), setting.value)

    settings = tuple(Setting(f"{tolerance:g}", tolerance) for tolerance in TOLERANCES)
    return [Method(NAME, settings, possible, prepare, 8000)]
