"""CyRK's pysolve_ivp with terminal events, equations and events compiled by numba."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from vibro_cli.benchmark.methods.motion import Motion, State
from vibro_cli.benchmark.methods.runner import Event, LegRunner, Lost, Method, Runner, Setting
from vibro_cli.benchmark.scenes import Scene

_FAR = 1.0e3
_TOLERANCES = (1e-7, 1e-10, 1e-13)


def _compiled(motion: Motion, pieces: tuple[int, ...]) -> tuple[Any, list[Any], list[Event]]:
    from numba import njit

    bodies = len(pieces)
    w2: Any = np.array([motion.w2[ball][piece] for ball, piece in enumerate(pieces)])

    @njit
    def change(dy: Any, t: float, y: Any) -> None:
        for ball in range(bodies):
            dy[2 * ball] = y[2 * ball + 1]
            dy[2 * ball + 1] = -w2[ball] * np.sin(y[2 * ball])

    functions, events = [], []
    for pair in range(len(motion.pairs)):
        functions.append(_gap(motion, pair, pieces))
        events.append(Event(pair))
    for ball, side in motion.junctions(pieces):
        arc = motion.arcs[pieces[ball]]
        functions.append(_room(2 * ball, float(side), arc.high if side > 0 else arc.low))
        events.append(Event(-1, ball, side))
    # A plain function around each: it carries the attributes CyRK looks for.
    wrapped = [_terminal(function) for function in functions]
    return change, wrapped, events


def _gap(motion: Motion, pair: int, pieces: tuple[int, ...]) -> Any:
    from numba import njit

    a, b = motion.pairs[pair]
    i, j = 2 * a, 2 * b
    if pieces[a] == pieces[b]:
        least = motion.contact_angle(a, b, pieces[a]) - (2.0 * np.pi if b < a else 0.0)
        return njit(lambda t, y: y[j] - y[i] - least)
    one, two = motion.arcs[pieces[a]], motion.arcs[pieces[b]]
    rho_a, rho_b = motion.radius[a][pieces[a]], motion.radius[b][pieces[b]]
    x, up_a, up_b = two.x - one.x, one.sign * rho_a, two.sign * rho_b
    height = two.y - one.y
    touch = (motion.bodies[a].radius + motion.bodies[b].radius) ** 2
    return njit(
        lambda t, y: (
            (x + rho_b * np.sin(y[j]) - rho_a * np.sin(y[i])) ** 2
            + (height - up_b * np.cos(y[j]) + up_a * np.cos(y[i])) ** 2
            - touch
        )
    )


def _room(place: int, side: float, end: float) -> Any:
    from numba import njit

    return njit(lambda t, y: side * (end - y[place]))


def _terminal(function: Callable[..., float]) -> Any:
    def event(t: float, y: Any) -> float:
        return function(t, y)

    marked: Any = event
    marked.terminal, marked.direction = True, -1
    return marked


def _prepare(scene: Scene, setting: Setting) -> Runner:
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


def methods() -> list[Method]:
    """Return CyRK's DOP853."""
    settings = tuple(Setting(f"{tolerance:g}", tolerance) for tolerance in _TOLERANCES)
    return [Method("CyRK DOP853", settings, lambda scene: True, _prepare, 40)]
