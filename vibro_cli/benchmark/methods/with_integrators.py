"""Integrators with terminal events: SciPy's solve_ivp, CyRK's pysolve_ivp, and diffrax."""

from __future__ import annotations

from functools import cache, partial
from typing import Any

import numpy as np

from vibro_cli.benchmark.methods.runner import (
    Course,
    Event,
    EventFunction,
    LegRunner,
    Lost,
    Method,
    Motion,
    Runner,
    Setting,
    State,
    tolerances,
)
from vibro_cli.benchmark.scenes import Scene

_FAR = 1.0e3
"""Requested time span of a leg (s); an event comes long before its end."""
_COMPILED_TOLERANCES = tolerances(1e-7, 1e-10, 1e-13)
_TOLERANCES = {
    "RK45": (1e-4, 1e-7, 1e-10),
    "DOP853": (1e-4, 1e-7, 1e-10, 1e-13),
    "LSODA": (1e-4, 1e-7, 1e-10),
    "Radau": (1e-4, 1e-7),
}
"""Tolerances that each reaches in reasonable time: Radau at 1e-13 takes a second per impact."""


def _terminal(function: EventFunction) -> Any:
    """Wrap an event function in one that has the attributes the libraries look for."""

    def event(t: float, y: Any) -> Any:
        return function(t, y)

    marked: Any = event
    marked.terminal, marked.direction = True, -1.0
    return marked


def _prepare_scipy(kind: str, scene: Scene, setting: Setting) -> Runner:
    from scipy.integrate import solve_ivp

    motion = Motion(scene.system)
    tolerance = setting.value

    @cache
    def ready(pieces: tuple[int, ...]) -> tuple[Any, list[Event], list[Any]]:
        w2 = np.array([motion.w2[ball][piece] for ball, piece in enumerate(pieces)])
        rates: Any = np.empty(2 * len(pieces))

        def change(t: float, y: Any) -> Any:
            rates[::2] = y[1::2]
            rates[1::2] = -w2 * np.sin(y[::2])
            return rates.copy()

        events, functions = zip(*motion.events(pieces), strict=True)
        return change, list(events), [_terminal(function) for function in functions]

    def leg(pieces: tuple[int, ...], t: float, y: State) -> tuple[float, Any, Event]:
        change, events, functions = ready(pieces)
        found = solve_ivp(
            change, (t, t + 10.0 * _FAR), y, method=kind, rtol=tolerance, atol=tolerance,
            events=functions,
        )  # fmt: skip
        if found.status != 1:
            raise Lost(f"no event until t = {found.t[-1]:.6g} s")
        which = next(number for number, times in enumerate(found.t_events) if len(times))
        return float(found.t[-1]), found.y[:, -1].tolist(), events[which]

    return LegRunner(motion, leg)


def scipy() -> list[Method]:
    """Return SciPy's methods, which most users would try first."""
    return [
        Method(f"SciPy {kind}", tolerances(*values), partial(_prepare_scipy, kind), 12)
        for kind, values in _TOLERANCES.items()
    ]


def _compiled(motion: Motion, pieces: tuple[int, ...]) -> tuple[Any, list[Any], list[Event]]:
    from numba import njit

    bodies = len(pieces)
    w2: Any = np.array([motion.w2[ball][piece] for ball, piece in enumerate(pieces)])

    @njit
    def change(dy: Any, t: float, y: Any) -> None:
        for ball in range(bodies):
            dy[2 * ball] = y[2 * ball + 1]
            dy[2 * ball + 1] = -w2[ball] * np.sin(y[2 * ball])

    events, functions = zip(*motion.events(pieces), strict=True)
    return change, [_terminal(njit(function)) for function in functions], list(events)


def _prepare_cyrk(scene: Scene, setting: Setting) -> Runner:
    from CyRK import pysolve_ivp

    motion = Motion(scene.system)
    tolerance = setting.value
    ready = cache(lambda pieces: _compiled(motion, pieces))

    def leg(pieces: tuple[int, ...], t: float, y: State) -> tuple[float, Any, Event]:
        change, functions, events = ready(pieces)
        found = pysolve_ivp(
            change, (t, t + _FAR), np.array(y), method="DOP853", events=tuple(functions),
            rtol=tolerance, atol=tolerance, pass_dy_as_arg=True,
        )  # fmt: skip
        if not found.event_terminated:
            raise Lost(f"no event until t = {found.t[-1]:.6g} s")
        which = found.event_terminate_index
        times, states = found.t_events[which], found.y_events[which]
        return float(times[-1]), states[:, -1].tolist(), events[which]

    return LegRunner(motion, leg)


def cyrk() -> list[Method]:
    """Return CyRK's DOP853 with equations and events compiled by numba."""
    return [Method("CyRK DOP853", _COMPILED_TOLERANCES, _prepare_cyrk, 40)]


_MOST_STEPS = 100_000


def _flight(motion: Motion, tolerance: float) -> Any:
    """Return the function from the start of a flight to the start of the next one."""
    import diffrax
    import jax.numpy as jnp
    import optimistix

    pairs = range(len(motion.pairs))
    w2 = jnp.array([motion.w2[ball][0] for ball in range(len(motion.bodies))])
    left, right = (np.array(bodies) for bodies in zip(*motion.pairs, strict=True))
    least = jnp.array([motion.least_angle(pair, 0) for pair in pairs])
    jumps = [motion.jump_on_one_arc(pair, 0) for pair in pairs]
    p, q, alpha, beta = (jnp.array(column) for column in zip(*jumps, strict=True))

    def gap(pair: int) -> Any:
        # One event for each pair. If several occur in one step, diffrax need not take the first.
        # The least gap as the only event would be hidden by the pair that has just met.
        return lambda t, y, args, **_: y[0][right[pair]] - y[0][left[pair]] - least[pair]

    term = diffrax.ODETerm(lambda t, y, args: (y[1], -w2 * jnp.sin(y[0])))
    event = diffrax.Event(
        [gap(pair) for pair in pairs],
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


class _DiffraxRunner(Runner):
    """A scene on one arc for diffrax; the tolerance is that of the steps and of the event."""

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
        self._wanted = impacts

    def go(self) -> None:
        """Run and wait for the end of the computation."""
        import jax

        self._result = jax.block_until_ready(self._run(self._wanted, *self._start))

    def course(self) -> Course:
        """Return times, counts and energy drift; raise Lost if a flight ended without an event."""
        _, (angles, rates), times = self._result
        if not np.all(np.isfinite(angles)):
            raise Lost("diffrax ended without an event")
        y = [float(value) for pair in zip(angles, rates, strict=True) for value in pair]
        chosen = [float(value) for value in times[: self._wanted]]
        return self._motion.course(chosen, 0, self._motion.pieces, y)


def diffrax() -> list[Method]:
    """Return diffrax with Tsit5, whose whole run is one compiled loop over impacts.

    It is used for bodies on one arc only: on another arc, equations and events would change.
    """

    def prepare(scene: Scene, setting: Setting) -> Runner:
        return _DiffraxRunner(Motion(scene.system), setting.value)

    def suits(scene: Scene) -> bool:
        return len(scene.system.trace.pieces) == 1

    return [Method("diffrax Tsit5", _COMPILED_TOLERANCES, prepare, 60, suits)]
