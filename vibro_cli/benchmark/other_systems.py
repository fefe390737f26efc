"""Speed and drift of energy of systems other than a trace at rest, compiled, on one thread."""

from __future__ import annotations

from typing import Any

from vibro_cli.assemble import build_any
from vibro_cli.benchmark.measurement import Plan, Row, by_turns, warmed
from vibro_cli.scenario.loading import any_scenario_of
from vibro_cli.systems import system_named
from vibro_cli.systems.driver import Driver
from vibro_cli.systems.wanted import Limits

Document = dict[str, Any]
PART = "systems"


def _table(wall: Document, *balls: Document) -> Document:
    return {
        "system": "table", "wall": {"k": 1.0, **wall}, "balls": list(balls),
        "collision": {"k": 1.0}, "stop": {"bounces": 1},
    }  # fmt: skip


def _ball(x: float, y: float, radius: float = 0.1) -> Document:
    motion = {"x": x, "y": y, "velocity_x": 0.9 - x, "velocity_y": 0.7 + y}
    body: Document = {"body": "particle"} if radius == 0.0 else {}
    return {"radius": radius, "mass": 1.0, **motion, **body}


def _disk(position: float, speed: float, mass: float, **spring: float) -> Document:
    held = {"length": 5.0, **spring}
    start = {"position": position, "speed": speed}
    return {"body": "disk", "radius": 0.4, "mass": mass, **start, "spring": held}


def _circle(**trace: Any) -> Document:
    arc = {"shape": "valley", "radius": 1.0, "end_slope": "90 deg"}
    ball = {"radius": 0.1, "density": 7800.0, "arc": 1}
    return {
        "gravity": 9.81, "trace": {"start_slope": "-90 deg", "arcs": [arc], **trace},
        "balls": [{**ball, "angle": "-60 deg"}, {**ball, "angle": "50 deg"}],
        "collision": {"k": 1.0}, "stop": {"collisions": 1},
    }  # fmt: skip


_ELLIPSE: Document = {"shape": "ellipse", "semi_axis_x": 2.0, "semi_axis_y": 1.2}
_BOX: Document = {"shape": "rectangle", "width": 3.0, "depth": 2.0}
SCENES: dict[str, Document] = {
    "wall: ellipse, r = 0": _table(_ELLIPSE, _ball(0.3, 0.1, 0.0)),
    "wall: ellipse, r = 0.1": _table(_ELLIPSE, _ball(0.3, 0.1)),
    "wall: circle": _table({"shape": "circle", "radius": 1.5}, _ball(0.3, 0.1)),
    "wall: rectangle": _table(_BOX, _ball(0.3, 0.1)),
    "30 balls in a box": _table(
        _BOX, *(_ball(0.4 * (n % 6) - 1.0, 0.35 * (n // 6) - 0.7) for n in range(30))
    ),
    "circle at rest": _circle(),
    "circle turning about its axis": _circle(turning={"through_arc": 1, "rate": 2.5}),
    "springs": {
        "system": "springs", "collision": {"k": 1.0}, "stop": {"collisions": 1},
        "balls": [
            _disk(-4.0, 8.5, 1.0, stiffness=6.0, height=1.0, foot=0.0),
            _disk(7.0, -2.0, 2.0, stiffness=9.0, height=1.5, foot=3.0),
        ],
    },
}  # fmt: skip


WHOLE: dict[str, Document] = {
    **{name: SCENES[name] for name in ("30 balls in a box", "springs")},
    "200 balls in a box": _table(
        {"shape": "rectangle", "width": 12.0, "depth": 8.0},
        *(_ball(0.55 * (n % 20) - 5.3, 0.7 * (n // 20) - 3.2) for n in range(200)),
    ),
    "springs, 200 disks": {
        "system": "springs", "collision": {"k": 1.0}, "stop": {"collisions": 1},
        "balls": [
            _disk(
                3.0 * n, 8.5 if n % 2 else -7.0, 1.0 + n % 3,
                stiffness=6.0 + n % 5, height=1.0, foot=3.0 * n,
            )
            for n in range(200)
        ],
    },
}  # fmt: skip
"""Scenes measured as whole commands, with many bodies too."""

SLOW = ("springs", "springs, 200 disks")
"""Scenes that are solved step by step, of which fewer impacts are enough."""


class _Task:
    """Runs of one scene, so many impacts and bounces each."""

    def __init__(self, document: Document, impacts: int) -> None:
        scenario = any_scenario_of(document)
        self._kind, self._system = system_named(scenario.system), build_any(scenario)
        lone = len(self._system.bodies) == 1
        self._limits = Limits(bounces=impacts) if lone else Limits(collisions=impacts)

    def ready(self) -> None:
        """Make the records of a run."""
        kind = self._kind
        world, overrides = kind.world(self._system, self._limits), kind.overrides(self._system)
        if hasattr(world.settings[0], "keep"):
            world.settings[0].keep = 0
        self._driver = Driver(kind.loop, world, "compiled", None, overrides)

    def go(self) -> None:
        """Run."""
        self._driver.run()


def measure(plan: Plan) -> list[Row]:
    """Measure every scene by turns; an impact is one of two bodies, of a lone ball a bounce."""
    long = 5_000 if plan.form == "quick" else 200_000
    rows, tasks = [], []
    for name, document in SCENES.items():
        impacts = long // 100 if name in SLOW else long
        task = _Task(document, impacts)
        rows.append(Row(PART, name, "vibro", impacts=impacts))
        tasks.append((task.ready, task.go))
    for row, times in zip(rows, by_turns(warmed(tasks), plan), strict=True):
        row.take_times(times)
    return rows
