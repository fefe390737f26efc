"""A film as one HTML file: the states at every frame, drawn by the page itself."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np

from vibro_cli.figures.chart import body_look
from vibro_cli.figures.film import SIZE, TRAIL, Frames, Stage, clock_digits
from vibro_cli.figures.source import Array
from vibro_cli.figures.style import render
from vibro_cli.report.html import rendered
from vibro_cli.report.words import number

GENERATOR = "vibro film"
_DPI = 100.0


def film_html(frames: Frames, rate: int, name: str, version: str) -> bytes:
    """Return the film of a run called `name` as the bytes of an HTML file that needs no other.

    `rate` is the number of frames in a second.
    """
    stage = Stage(frames, _DPI)
    ground = frames.ground
    still = base64.b64encode(render(stage.figure, "svg", _DPI)).decode()
    values = {
        "title": name,
        "version": version,
        "generator": GENERATOR,
        "ground": f"data:image/svg+xml;base64,{still}",
        "size": [round(side * _DPI) for side in SIZE],
        "last": len(frames.time) - 1,
        "bodies": len(ground.radii),
        "plan": ground.words,
        "plane": None if ground.panel is None else ground.panel.words,
        "span": [number(float(time), "s") for time in frames.time[[0, -1]]],
        "data": {
            "rate": rate,
            "time": frames.time.tolist(),
            "digits": clock_digits(frames.time),
            "plan": stage.place(stage.plan),
            "plane": stage.place(stage.plane),
            "past": TRAIL,
            "span": frames.span,
            "bodies": [_body(frames, stage, body) for body in range(len(ground.radii))],
        },
    }
    return rendered("film", values)


def _body(frames: Frames, stage: Stage, body: int) -> dict[str, Any]:
    way, links = frames.trails[body], frames.ground.links
    look = body_look(body + 1)
    dashes = look["linestyle"]
    return {
        "radius": stage.drawn_radii[body],
        "colour": look["color"],
        "dashes": "none" if dashes == "solid" else " ".join(map(str, dashes[1])),
        "x": frames.x[:, body].tolist(),
        "y": frames.y[:, body].tolist(),
        "turn": None if frames.turn is None else frames.turn[:, body].tolist(),
        "across": frames.across[:, body].tolist(),
        "up": frames.up[:, body].tolist(),
        "point": stage.plane is not stage.plan,
        "foot": links[body].foot if links else None,
        "coil": links[body].coil.tolist() if links else [],
        "trail": [_plain(way.time), _plain(way.across), _plain(way.up)],
    }


def _plain(values: Array) -> list[float | None]:
    """Return numbers for JSON, null where there is none."""
    return [None if np.isnan(value) else value for value in values.tolist()]
