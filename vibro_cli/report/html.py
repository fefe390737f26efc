"""Pages as one HTML file each: nothing is loaded from elsewhere, and nothing can be.

Figures are SVG, or PNG where that is too much, in addresses that hold their data. A film is one
such page too: the states at every frame, drawn by the page itself.
"""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Callable, Iterator, Mapping
from importlib.resources import files
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from matplotlib.figure import Figure

from vibro_cli import __version__
from vibro_cli.figures.chart import body_look
from vibro_cli.figures.film import SIZE, TRAIL, FilmFrame, Frames, clock_digits
from vibro_cli.figures.kinds import Drawn
from vibro_cli.figures.source import Array
from vibro_cli.figures.style import has_rasters, render
from vibro_cli.report.words import number

GENERATORS = {
    "report": "vibro report", "grid": "vibro report", "benchmark": "vibro bench",
    "film": "vibro film",
}  # fmt: skip
"""What a page says that it is from, by its template."""
_DPI = 192.0
"""Resolution of figures with too many points for SVG: two pixels for each of a plain screen."""
_FILM_DPI = 100.0
_TYPES = {"png": "png", "svg": "svg+xml"}


def pictured(draw: Callable[[str], Iterator[Drawn]], of: str) -> list[dict[str, Any]]:
    """Return figures as the page has them, with their words, wide and for narrow screens.

    `draw` draws them in a width, `of` says whose they are.
    """
    return [
        shown(wide.title, wide.caption, f"{wide.title}, {of}", wide.figure, narrow.figure)
        for wide, narrow in zip(draw("double"), draw("single"), strict=True)
    ]


def shown(title: str, caption: str, name: str, wide: Figure, narrow: Figure) -> dict[str, Any]:
    """Return a figure as the page has it; `name` and caption are read to those who see none."""
    return {
        "title": title,
        "caption": caption,
        "alternative": f"{name}. {caption}",
        "wide": _image(wide),
        "narrow": _image(narrow),
    }


def _image(figure: Figure) -> dict[str, str]:
    """Return a figure as the address of an image with its size (CSS pixels)."""
    form = "png" if has_rasters(figure) else "svg"
    width, height = figure.get_size_inches() * 96.0
    return {
        "source": _address(figure, form, _DPI),
        "width": f"{width:.0f}",
        "height": f"{height:.0f}",
    }


def _address(figure: Figure, form: str, dpi: float) -> str:
    """Return an address that holds a figure as its data."""
    content = base64.b64encode(render(figure, form, dpi)).decode()
    return f"data:image/{_TYPES[form]};base64,{content}"


def rendered(name: str, values: Mapping[str, Any]) -> bytes:
    """Return the page of a template with its style and its script, and a policy for these alone."""
    environment = Environment(
        loader=PackageLoader("vibro_cli.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    assets = "film" if name == "film" else "report"
    style, script = (_asset(f"{assets}.{kind}") for kind in ("css", "js"))
    policy = (
        "default-src 'none'; img-src data:; base-uri 'none'; form-action 'none'; "
        f"style-src {_hash(style)}; script-src {_hash(script)}"
    )
    ours = {"policy": policy, "style": style, "script": script}  # the template takes them as is
    values = {**values, **ours, "generator": GENERATORS[name], "version": __version__}
    text = environment.get_template(f"{name}.html").render(values)
    return text.encode(errors="replace")  # of names of files in other letters than UTF-8


def is_report(content: bytes, name: str = "report") -> bool:
    """Return whether the bytes are those of a report of ours, or of a page of another template."""
    return f'<meta name="generator" content="{GENERATORS[name]}">'.encode() in content[:2000]


def _asset(name: str) -> str:
    return (files("vibro_cli.report") / "templates" / name).read_text(encoding="utf-8")


def _hash(text: str) -> str:
    """Return the source expression that lets just this text through the content policy."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


def film_html(frames: Frames, rate: int, name: str) -> bytes:
    """Return the film of a run called `name` as the bytes of an HTML file that needs no other.

    `rate` is the number of frames in a second.
    """
    frame = FilmFrame(frames, _FILM_DPI)
    ground = frames.ground
    values = {
        "title": name,
        "ground": _address(frame.figure, "svg", _FILM_DPI),
        "size": [round(side * _FILM_DPI) for side in SIZE],
        "last": len(frames.time) - 1,
        "bodies": len(ground.radii),
        "plan": ground.words,
        "plane": None if ground.panel is None else ground.panel.words,
        "span": [number(float(time), "s") for time in frames.time[[0, -1]]],
        "data": {
            "rate": rate,
            "time": frames.time.tolist(),
            "digits": clock_digits(frames.time),
            "plan": frame.place(frame.plan),
            "plane": frame.place(frame.plane),
            "past": TRAIL,
            "span": frames.span,
            "bodies": [_actor(frames, frame, body) for body in range(len(ground.radii))],
        },
    }
    return rendered("film", values)


def _actor(frames: Frames, frame: FilmFrame, body: int) -> dict[str, Any]:
    way, links = frames.trails[body], frames.ground.links
    look = body_look(body + 1)
    dashes = look["linestyle"]
    return {
        "radius": frame.drawn_radii[body],
        "colour": look["color"],
        "dashes": "none" if dashes == "solid" else " ".join(map(str, dashes[1])),
        "x": frames.x[:, body].tolist(),
        "y": frames.y[:, body].tolist(),
        "turn": None if frames.turn is None else frames.turn[:, body].tolist(),
        "across": frames.across[:, body].tolist(),
        "up": frames.up[:, body].tolist(),
        "point": frame.plane is not frame.plan,
        "foot": links[body].foot if links else None,
        "coil": links[body].coil.tolist() if links else [],
        "trail": [_plain(way.time), _plain(way.across), _plain(way.up)],
    }


def _plain(values: Array) -> list[float | None]:
    """Return numbers for JSON, null where there is none."""
    return [None if np.isnan(value) else value for value in values.tolist()]
