"""Scenes on the table for `vibro bench`."""

from __future__ import annotations

from vibro_cli.systems.contract import Document, TimedScene


def _table(wall: Document, *balls: Document) -> Document:
    return {
        "system": "table", "wall": {"k": 1.0, **wall}, "balls": list(balls),
        "collision": {"k": 1.0}, "stop": {"bounces": 1},
    }  # fmt: skip


def _ball(x: float, y: float, radius: float = 0.1) -> Document:
    motion = {"x": x, "y": y, "velocity_x": 0.9 - x, "velocity_y": 0.7 + y}
    body: Document = {"body": "particle"} if radius == 0.0 else {}
    return {"radius": radius, "mass": 1.0, **motion, **body}


_ELLIPSE: Document = {"shape": "ellipse", "semi_axis_x": 2.0, "semi_axis_y": 1.2}
_BOX: Document = {"shape": "rectangle", "width": 3.0, "depth": 2.0}
_LARGE_BOX: Document = {"shape": "rectangle", "width": 12.0, "depth": 8.0}
TIMED_SCENES = {
    "wall: ellipse, r = 0": TimedScene(_table(_ELLIPSE, _ball(0.3, 0.1, 0.0))),
    "wall: ellipse, r = 0.1": TimedScene(_table(_ELLIPSE, _ball(0.3, 0.1))),
    "wall: circle": TimedScene(_table({"shape": "circle", "radius": 1.5}, _ball(0.3, 0.1))),
    "wall: rectangle": TimedScene(_table(_BOX, _ball(0.3, 0.1))),
    "30 balls in a box": TimedScene(
        _table(_BOX, *(_ball(0.4 * (n % 6) - 1.0, 0.35 * (n // 6) - 0.7) for n in range(30))),
        parts=("systems", "command"),
    ),
    "200 balls in a box": TimedScene(
        _table(
            _LARGE_BOX,
            *(_ball(0.55 * (n % 20) - 5.3, 0.7 * (n // 20) - 3.2) for n in range(200)),
        ),
        parts=("command",),
    ),
}
