"""SciPy's solve_ivp with terminal events: what most users would reach for."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from vibro_cli.benchmark.methods.motion import Motion, State
from vibro_cli.benchmark.methods.runner import Event, LegRunner, Lost, Method, Runner, Setting
from vibro_cli.benchmark.scenes import Scene

_FAR = 1.0e4
"""End of the span of time that is asked for (s); an event comes long before."""
_TOLERANCES = {
    "RK45": (1e-4, 1e-7, 1e-10),
    "DOP853": (1e-4, 1e-7, 1e-10, 1e-13),
    "LSODA": (1e-4, 1e-7, 1e-10),
    "Radau": (1e-4, 1e-7),
}
"""As far as each gets in reasonable time: Radau at 1e-13 takes a second for an impact."""


def events_of(motion: Motion, pieces: tuple[int, ...]) -> list[tuple[Event, Callable[..., float]]]:
    """Return event functions, positive before their event, for bodies on these pieces."""
    found: list[tuple[Event, Callable[..., float]]] = []
    for pair in range(len(motion.pairs)):
        found.append((Event(pair), lambda t, y, pair=pair: motion.gap(pair, pieces, y)))
    for ball, side in motion.junctions(pieces):
        found.append(
            (Event(-1, ball, side),
             lambda t, y, ball=ball, side=side: motion.room(ball, side, pieces[ball], y))
        )  # fmt: skip
    return found


def _prepare(kind: str, scene: Scene, setting: Setting) -> Runner:
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

        events, functions = zip(*events_of(motion, pieces), strict=True)
        for function in functions:
            function.terminal, function.direction = True, -1.0
        return change, list(events), list(functions)

    def leg(pieces: tuple[int, ...], t: float, y: State) -> tuple[float, Any, Event]:
        change, events, functions = ready(pieces)
        found = solve_ivp(
            change, (t, t + _FAR), y, method=kind, rtol=tolerance, atol=tolerance, events=functions
        )
        if found.status != 1:
            raise Lost(f"no event until t = {found.t[-1]:.6g} s")
        which = next(number for number, times in enumerate(found.t_events) if len(times))
        return float(found.t[-1]), found.y[:, -1].tolist(), events[which]

    return LegRunner(motion, leg)


def methods() -> list[Method]:
    """Return SciPy's methods."""

    def one(kind: str) -> Method:
        settings = tuple(Setting(f"{tolerance:g}", tolerance) for tolerance in _TOLERANCES[kind])
        return Method(
            f"SciPy {kind}", settings, lambda scene: True,
            lambda scene, setting: _prepare(kind, scene, setting), 12,
        )  # fmt: skip

    return [one(kind) for kind in _TOLERANCES]
