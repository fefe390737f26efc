"""The system of bodies on springs along a line, and the records of its event loop."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from vibro_cli.kernels.numerics.constants import EPSILON, NEVER
from vibro_cli.kernels.springs.loop import MOST_STEPS, advance
from vibro_cli.kernels.springs.tangent import follow_bodies
from vibro_cli.kernels.springs.world import (
    BODY_ROWS,
    ROW,
    Clock,
    Settings,
    SpringBody,
    SpringPair,
    World,
)
from vibro_cli.kernels.world import END_QUIET
from vibro_cli.mechanics.system import ImpactSystem, touching_distance
from vibro_cli.systems.driver import EventLoop, body_record, law_and_stops, record_array, records_of
from vibro_cli.systems.request import NO_LIMITS, Limits


@dataclass(frozen=True)
class Spring:
    """A spring between the centre of a body and a foot above the line of centres."""

    stiffness: float
    """c (N/m)."""
    length: float
    """Natural length l (m)."""
    height: float
    """Height b of the foot above the line (m)."""
    foot: float
    """Position of the foot along the line (m)."""

    def energy(self, displacement: float) -> float:
        """Return the energy c/2 (√(b² + x²) - l)² (J), with x measured from the foot."""
        return 0.5 * self.stiffness * (math.hypot(self.height, displacement) - self.length) ** 2


@dataclass(frozen=True)
class InitialState:
    """Initial position along the line (m) and speed (m/s) of a body."""

    position: float
    speed: float


@dataclass(frozen=True)
class SpringsSystem(ImpactSystem):
    """Bodies from left to right and everything their motion depends on."""

    springs: tuple[Spring, ...]
    initial: tuple[InitialState, ...]
    restitution: tuple[float, ...]
    """k of each pair of neighbours."""

    @property
    def least_energy(self) -> float:
        """A rounding of what it takes to press all springs to no length (J).

        Where springs are unstressed, their energies are roundings of lengths, squared.
        """
        return EPSILON * sum(0.5 * one.stiffness * one.length**2 for one in self.springs)

    def keeps_energy(self, clock: Mapping[str, Any]) -> bool:
        """Return whether energy was conserved: no lasting contact, and no inelastic impact."""
        elastic = all(k == 1.0 for k in self.restitution) and self.law_keeps_energy
        return clock["contacts"] == 0 and (elastic or clock["collisions"] == 0)

    @cached_property
    def frequencies(self) -> list[float]:
        """ω₀ = √(c r²/J_P) = √(c/(κ m)) of each body, 1/s (C (4))."""
        pairs = zip(self.springs, self.bodies, strict=True)
        return [math.sqrt(spring.stiffness / body.rolling_mass) for spring, body in pairs]


def time_scale(system: SpringsSystem) -> float:
    """Return the time scale (s) of tangent maps: 1/ω₀ of the slowest body."""
    return 1.0 / min(system.frequencies)


def singular_points(spring: Spring) -> tuple[tuple[float, str], ...]:
    """Return the singular points of a body's motion (m from the foot) and their kinds.

    For l <= b there is one centre at 0; for l > b a saddle at 0 and centres at ±√(l² - b²) (C, part
    3).
    """
    if spring.length <= spring.height:
        return ((0.0, "centre"),)
    away = math.sqrt((spring.length - spring.height) * (spring.length + spring.height))
    return ((-away, "centre"), (0.0, "saddle"), (away, "centre"))


def separatrix_speed(spring: Spring, frequency: float, displacement: float) -> float:
    """Return the speed (m/s, not negative) on the separatrix through the saddle.

    v² = ω₀² ((b - l)² - (√(b² + x²) - l)²), which is 0 at the saddle. NaN beyond the separatrix.
    """
    length = math.hypot(spring.height, displacement)
    square = (length - spring.height) * (2.0 * spring.length - spring.height - length)
    return frequency * math.sqrt(square) if square >= 0.0 else math.nan


def _fastest(world: World) -> str:
    """Describe the period of the fastest spring, which limits the steps, and the stop."""
    square = float(np.max(record_array(world.springs, SpringBody)["square"]))
    stop = float(record_array(world.settings, Settings)["stop_time"][0])
    period = f"the fastest spring has the period 2 π/ω₀ = {2.0 * math.pi / math.sqrt(square):.3g} s"
    return f"{period}, stop.time is {'not given' if stop >= NEVER else f'{stop:g} s'}"


LOOP = EventLoop(
    advance=advance,
    follow=follow_bodies,
    records=records_of(World),
    logs={"impacts": "impact_rows", "states": "state_rows"},
    state=("clock", "springs", "pairs"),
    at_once="at_once",
    hurried="hurried",
    quiet_cause=(END_QUIET, f"{MOST_STEPS:,} steps"),
    quiet_details=_fastest,
    finishes=True,
)


def make_world(system: SpringsSystem, limits: Limits = NO_LIMITS) -> World:
    """Return the records of a system at the start, with empty logs."""
    count = len(system.bodies)
    settings = Settings()
    law_and_stops(settings, system, limits)
    settings.stop_time = NEVER if limits.time is None else limits.time
    return World(
        clock=[Clock()],
        settings=[settings],
        bodies=[body_record(body) for body in system.bodies],
        springs=initial_records(system)["springs"],
        pairs=[_pair(system, index) for index in range(max(count - 1, 1))],
        series=[0.0] * (BODY_ROWS * count),
        gaps=[0.0] * (ROW * max(count - 1, 1)),
        impacts=[],
        states=[],
    )


def initial_records(system: SpringsSystem) -> dict[str, Any]:
    """Return the records of the world that contain the initial state."""
    return {"springs": [_spring(system, index) for index in range(len(system.bodies))]}


def _spring(system: SpringsSystem, index: int) -> SpringBody:
    given, start = system.springs[index], system.initial[index]
    body = system.bodies[index]
    spring = SpringBody()
    spring.square = given.stiffness / body.rolling_mass
    spring.length, spring.height, spring.foot = given.length, given.height, given.foot
    spring.x, spring.v = start.position - given.foot, start.speed
    spring.root = NEVER
    return spring


def _pair(system: SpringsSystem, index: int) -> SpringPair:
    pair = SpringPair()
    if index + 1 < len(system.bodies):
        pair.touch = touching_distance(system.bodies[index], system.bodies[index + 1])
        pair.restitution = system.restitution[index]
    return pair
