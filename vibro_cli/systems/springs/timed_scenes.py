"""Scenes of bodies on springs for `vibro bench`."""

from __future__ import annotations

from vibro_cli.systems.contract import Document, TimedScene

# Motion is solved by series: an impact takes as long as many impacts of other systems.
_SHARE = 100


def _disk(position: float, speed: float, mass: float, **spring: float) -> Document:
    held = {"length": 5.0, **spring}
    start = {"position": position, "speed": speed}
    return {"body": "disk", "radius": 0.4, "mass": mass, **start, "spring": held}


def _springs(*disks: Document) -> Document:
    stop = {"collisions": 1}
    return {"system": "springs", "collision": {"k": 1.0}, "stop": stop, "balls": list(disks)}


TIMED_SCENES = {
    "springs": TimedScene(
        _springs(
            _disk(-4.0, 8.5, 1.0, stiffness=6.0, height=1.0, foot=0.0),
            _disk(7.0, -2.0, 2.0, stiffness=9.0, height=1.5, foot=3.0),
        ),
        parts=("systems", "command"),
        share=_SHARE,
    ),
    "springs, 200 disks": TimedScene(
        _springs(
            *(
                _disk(
                    3.0 * n, 8.5 if n % 2 else -7.0, 1.0 + n % 3,
                    stiffness=6.0 + n % 5, height=1.0, foot=3.0 * n,
                )
                for n in range(200)
            )
        ),
        parts=("command",),
        share=_SHARE,
    ),
}  # fmt: skip
