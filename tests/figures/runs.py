"""Runs made by hand: states on level curves of energy, jumps between them."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tests.analysis.traces import BALL, hump, line, system, valley
from vibro_cli.analysis.levels import Landscape
from vibro_cli.figures.source import SPEEDS
from vibro_cli.mechanics.system import TraceSystem
from vibro_cli.mechanics.trace import ArcShape

Array = NDArray[np.float64]
HALF_PERIOD = 1.0


@dataclass(eq=False)
class HandMade:
    """The recorded run of one body; what it strikes is outside the picture."""

    system: TraceSystem
    rows: list[dict[str, Any]] = field(default_factory=list)
    struck: list[dict[str, Any]] = field(default_factory=list)
    sampled: list[int] = field(default_factory=list)
    """Flights of which a curve was asked for."""

    @property
    def collisions(self) -> dict[str, Any]:
        names = ("n", "t", "ball_a", "ball_b", "admissible", "substituted", *SPEEDS)
        sides = ("arc", "angle", "s")
        states = ("rate", "speed")
        table: dict[str, Any] = {
            name: np.array([row[name] for row in self.struck]) for name in names
        }
        for side in "ab":
            for name in sides:
                table[f"{name}_{side}"] = np.array([row[name] for row in self.struck])
            for name in states:
                for when in ("pre", "post"):
                    values = [row[f"{name}_{when}"] for row in self.struck]
                    table[f"{name}_{side}_{when}"] = np.array(values, dtype=np.float64)
        return table

    def flights(self) -> dict[str, Any]:
        return {name: np.array([row[name] for row in self.rows]) for name in self.rows[0]}

    def look_at(self, rows: Any) -> None:
        """Every flight is at hand."""

    def flight_curve(
        self, index: Any, count: Any, lasts: float = math.inf
    ) -> tuple[Array, Array, Array]:
        if np.ndim(index):
            each = zip(index.tolist(), count.tolist(), strict=True)
            curves = [self.flight_curve(row, number, lasts) for row, number in each]
            time, position, rate = map(np.concatenate, zip(*curves, strict=True))
            return time, position, rate
        self.sampled.append(index)
        row = self.rows[index]
        share = np.linspace(0.0, min(1.0, lasts / (row["t_end"] - row["t_start"])), count)
        return (
            row["t_start"] + share * (row["t_end"] - row["t_start"]),
            row["angle_start"] + share * (row["angle_end"] - row["angle_start"]),
            row["rate_start"] + share * (row["rate_end"] - row["rate_start"]),
        )

    def fly(
        self, arc: int, start: tuple[float, float], end: tuple[float, float], **more: Any
    ) -> None:
        """Add a flight on an arc (from 1), from (position, rate) to (position, rate)."""
        time = self.rows[-1]["t_end"] if self.rows else 0.0
        row = {
            "ball": 1,
            "arc": arc,
            "t_start": time,
            "t_end": time + HALF_PERIOD,
            "angle_start": start[0],
            "rate_start": start[1],
            "angle_end": end[0],
            "rate_end": end[1],
            "contact": False,
            "cause_start": "collision",
            "cause_end": "collision",
        }
        self.rows.append(row | more)

    def strike(self, arc: int, position: float, before: float, after: float, **more: Any) -> None:
        """Add an impact, at the end of the last flight."""
        piece = self.system.trace.pieces[arc - 1]
        null = piece.is_line  # the table has no angles on a line
        row = {
            "n": len(self.struck) + 1,
            "t": self.rows[-1]["t_end"],
            "ball_a": 1,
            "ball_b": 2,
            "arc": arc,
            "angle": math.nan if null else position,
            "s": piece.arc_length(position),
            "rate_pre": math.nan if null else before,
            "rate_post": math.nan if null else after,
            "speed_pre": before * self._scale(arc),
            "speed_post": after * self._scale(arc),
            "approach_speed": 1.0,
            "separation_speed": 1.0,
            "admissible": True,
            "substituted": False,
        }
        self.struck.append(row | more)

    def _scale(self, arc: int) -> float:
        return Landscape.of(self.system, 1).path_scale(self.system.trace.pieces[arc - 1])


def bounces(run: HandMade, arc: int, start: float, impacts: int, spread: float = 0.3) -> HandMade:
    """Let a body swing from rest at an angle, struck at changing angles, always thrown back."""
    hills = Landscape.of(run.system, 1)
    piece = run.system.trace.pieces[arc - 1]
    position, rate = start, 0.0
    for number in range(impacts):
        struck_at = spread * math.sin(2.0 * number)
        energy = float(hills.energy(piece, position, rate))
        arriving = float(hills.rate(piece, struck_at, energy))
        run.fly(arc, (position, rate), (struck_at, arriving))
        position, rate = struck_at, -(1.0 - 0.3 / impacts) * arriving
        run.strike(arc, struck_at, arriving, rate)
    run.fly(arc, (position, rate), (position, -rate), cause_end="end")
    return run


def made(start: float, *shapes: ArcShape, closed: bool = False) -> HandMade:
    """An empty run of one ball on a trace, from its slopes in degrees."""
    return HandMade(system(start, *shapes, closed=closed, body=BALL))


def on_circle(impacts: int, start: float = -2.5, spread: float = 0.3) -> HandMade:
    return bounces(made(-180, valley(1.0, 180), closed=True), 1, start, impacts, spread)


def on_three_arcs(impacts: int = 3) -> HandMade:
    """From rest high in arc 1 over the hump to arc 3, and there from impact to impact."""
    run = made(-120, valley(1.0, 50), hump(0.5, -50), valley(1.0, 120))
    hills = Landscape.of(run.system, 1)
    first, crest, last = run.system.trace.pieces
    energy = float(hills.energy(first, -1.6, 0.0))
    ends = [
        float(hills.rate(piece, angle, energy))
        for piece, angle in (
            (first, first.angle_end),
            (crest, crest.angle_start),
            (crest, crest.angle_end),
            (last, last.angle_start),
        )
    ]
    run.fly(1, (-1.6, 0.0), (first.angle_end, ends[0]), cause_start="start", cause_end="crossing")
    run.fly(2, (crest.angle_start, ends[1]), (crest.angle_end, ends[2]), cause_start="crossing")
    position, rate = last.angle_start, ends[3]
    for number in range(impacts):
        struck_at = 0.2 * number
        here = float(hills.energy(last, position, rate))
        arriving = float(hills.rate(last, struck_at, here))
        run.fly(3, (position, rate), (struck_at, arriving))
        position, rate = struck_at, 0.6 * arriving
        run.strike(3, struck_at, arriving, rate)
    return run


def on_line_between_valleys() -> HandMade:
    run = made(-90, valley(1.0, 0), line(1.5), valley(1.0, 90))
    hills = Landscape.of(run.system, 1)
    first = run.system.trace.pieces[0]
    rate = float(hills.rate(first, 0.0, float(hills.energy(first, -1.0, 0.0))))
    speed = rate * 0.9
    run.fly(1, (-1.0, 0.0), (0.0, rate), cause_start="start", cause_end="crossing")
    run.fly(2, (0.0, speed), (1.0, speed), cause_start="crossing", t_end=2.0 + 1.0 / speed)
    run.strike(2, 1.0, speed, -0.5 * speed)
    time = run.rows[-1]["t_end"]
    run.fly(2, (1.0, -0.5 * speed), (0.0, -0.5 * speed), t_end=time + 2.0 / speed)
    return run


def on_many_arcs() -> HandMade:
    shapes = [valley(1.0, 50)]
    for _ in range(4):
        shapes += [hump(0.5, -50), valley(1.0, 50)]
    return bounces(made(-80, *shapes), 3, -0.5, 2)


def at_rest() -> HandMade:
    run = made(-90, valley(1.0, 90))
    run.fly(1, (0.0, 0.0), (0.0, 0.0), cause_start="start", cause_end="end")
    return run
