"""diffrax with a terminal event, the whole run one compiled loop over impacts.

Bodies on one arc only: with the arc of a body its equation and the events would change.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from vibro_cli.benchmark.methods.motion import Motion
from vibro_cli.benchmark.methods.runner import Course, Lost, Method, Runner, Setting, course_of
from vibro_cli.benchmark.scenes import Scene

_FAR = 1.0e3
_TOLERANCES = (1e-7, 1e-10, 1e-13)
_MOST_STEPS = 100_000


def _flight(motion: Motion, tolerance: float) -> Any:
    """Return the function from the start of a flight to the start of the next one."""
    import diffrax
    import jax.numpy as jnp
    import optimistix

    count = len(motion.bodies)
    w2 = jnp.array([motion.w2[ball][0] for ball in range(count)])
    left = np.array([a for a, _ in motion.pairs])
    right = np.array([b for _, b in motion.pairs])
    least = jnp.array(
        [motion.contact_angle(a, b, 0) - (2.0 * np.pi if b < a else 0.0) for a, b in motion.pairs]
    )
    touching = [0.0] * (2 * count)
    jumps = []
    for pair, (a, b) in enumerate(motion.pairs):
        touching[2 * a], touching[2 * b] = 0.0, float(least[pair])
        jumps.append(motion.jump(pair, (0,) * count, touching))
    p, q, alpha, beta = (jnp.array(column) for column in zip(*jumps, strict=True))

    def gap(pair: int) -> Any:
        # One event for each pair. Of several in one step diffrax need not take the first; the least
        # gap as the only event would hide all others behind the pair that has just met.
        return lambda t, y, args, **_: y[0][right[pair]] - y[0][left[pair]] - least[pair]

    term = diffrax.ODETerm(lambda t, y, args: (y[1], -w2 * jnp.sin(y[0])))
    event = diffrax.Event(
        [gap(pair) for pair in range(len(motion.pairs))],
        optimistix.Newton(tolerance, tolerance, optimistix.rms_norm),
        False,
    )
    control = diffrax.PIDController(rtol=tolerance, atol=tolerance)

    def flight(t: Any, y: Any) -> tuple[Any, Any]:
        found = diffrax.diffeqsolve(
            term, diffrax.Tsit5(), t, t + _FAR, None, y, stepsize_controller=control, event=event,
            max_steps=_MOST_STEPS, throw=False,
        )  # fmt: skip
        angles, rates = found.ys[0][-1], found.ys[1][-1]
        hit = jnp.argmax(jnp.stack(found.event_mask))
        a, b = jnp.array(left)[hit], jnp.array(right)[hit]
        closing = jnp.maximum(p[hit] * rates[a] - q[hit] * rates[b], 0.0)
        rates = rates.at[a].add(-alpha[hit] * closing).at[b].add(beta[hit] * closing)
        return found.ts[-1], (angles, rates)

    return flight


class DiffraxRunner(Runner):
    """A scene for diffrax.

    Parameters
    ----------
    motion
        What moves, on one arc.
    tolerance
        Relative and absolute tolerance of steps and of the event.
    """

    def __init__(self, motion: Motion, tolerance: float) -> None:
        import jax

        jax.config.update("jax_enable_x64", True)
        self._motion = motion
        flight = _flight(motion, tolerance)

        def run(count: Any, angles: Any, rates: Any) -> Any:
            def step(number: Any, carried: Any) -> Any:
                t, y, times = carried
                t, y = flight(t, y)
                return t, y, times.at[number].set(t)

            times = jax.numpy.zeros(1024)
            start = (jax.numpy.array(0.0), (angles, rates), times)
            return jax.lax.fori_loop(0, count, step, start)

        self._run = jax.jit(run)
        self._start = [jax.numpy.array(motion.start[first::2]) for first in (0, 1)]
        self._result: Any = None

    def ready(self, impacts: int) -> None:
        """Choose the number of impacts."""
        self._wanted = impacts

    def go(self) -> None:
        """Run, to the end of the computation."""
        import jax

        self._result = jax.block_until_ready(self._run(self._wanted, *self._start))

    def course(self) -> Course:
        """Return times, counts and drift of energy; raises Lost if an impact was missed."""
        _, (angles, rates), times = self._result
        if not np.all(np.isfinite(angles)):
            raise Lost("diffrax ended without an event")
        y = [float(value) for pair in zip(angles, rates, strict=True) for value in pair]
        chosen = [float(value) for value in times[: self._wanted]]
        return course_of(self._motion, chosen, 0, self._motion.pieces, y)


def methods() -> list[Method]:
    """Return diffrax with Tsit5."""
    settings = tuple(Setting(f"{tolerance:g}", tolerance) for tolerance in _TOLERANCES)

    def prepare(scene: Scene, setting: Setting) -> Runner:
        assert setting.value is not None
        return DiffraxRunner(Motion(scene.system), setting.value)

    def suits(scene: Scene) -> bool:
        return len(scene.system.trace.pieces) == 1

    return [Method("diffrax Tsit5", settings, suits, prepare, 60)]
