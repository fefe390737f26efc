"""Self-contained HTML pages: they load nothing, and their content policy forbids it.

Figures are embedded as SVG, or as PNG if they have too many points. A film is such a page, too: it
holds the states at every frame and draws them itself.
"""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Mapping
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
"""Generator named in the page's metadata, by template."""
_DPI = 192.0
"""Resolution of figures with too many points for SVG: twice that of a standard screen."""
_FILM_DPI = 100.0
_TYPES = {"png": "png", "svg": "svg+xml"}


def pictured(wide: Drawn, narrow: Drawn, of: str) -> dict[str, Any]:
    """Return a figure drawn for wide and for narrow screens as values for the page.

    `of` names its subject. The figures are cleared: with references in circles they would be freed
    late, and each may hold a million points.
    """
    found = shown(wide.title, wide.caption, f"{wide.title}, {of}", wide.figure, narrow.figure)
    wide.figure.clear()
    narrow.figure.clear()
    return found


def shown(title: str, caption: str, name: str, wide: Figure, narrow: Figure) -> dict[str, Any]:
    """Return a figure as values for the page; `name` and caption are its alternative text."""
    return {
        "title": title,
        "caption": caption,
        "alternative": f"{name}. {caption}",
        "wide": _image(wide),
        "narrow": _image(narrow),
        # With little to show it fills one column: stretched, its letters would be twice as large.
        "half": wide.get_size_inches()[0] < 1.5 * narrow.get_size_inches()[0],
    }


def _image(figure: Figure) -> dict[str, str]:
    """Return the data URL of a figure and its size (CSS pixels)."""
    form = "png" if has_rasters(figure) else "svg"
    width, height = figure.get_size_inches() * 96.0
    return {
        "source": _address(figure, form, _DPI),
        "width": f"{width:.0f}",
        "height": f"{height:.0f}",
    }


def _address(figure: Figure, form: str, dpi: float) -> str:
    content = base64.b64encode(render(figure, form, dpi)).decode()
    return f"data:image/{_TYPES[form]};base64,{content}"


def rendered(name: str, values: Mapping[str, Any]) -> bytes:
    """Render a template with its style and script, and a content policy that allows only these."""
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
    ours = {"policy": policy, "style": style, "script": script}  # not escaped by the template
    values = {**values, **ours, "generator": GENERATORS[name], "version": __version__}
    pieces = environment.get_template(f"{name}.html").generate(values)
    # Encoded one by one, as the whole text would take two bytes per letter, or four.
    return b"".join(piece.encode(errors="replace") for piece in pieces)  # names may not be UTF-8


def is_report(content: bytes, name: str = "report") -> bool:
    """Return whether the bytes are a page that this program made from the template `name`."""
    return f'<meta name="generator" content="{GENERATORS[name]}">'.encode() in content[:2000]


def _asset(name: str) -> str:
    return (files("vibro_cli.report") / "templates" / name).read_text(encoding="utf-8")


def _hash(text: str) -> str:
    """Return the source expression that allows exactly this text in a content policy."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


def film_html(frames: Frames, rate: int, name: str) -> bytes:
    """Return the film of a run called `name` as the bytes of a self-contained HTML file.

    `rate` is the number of frames per second.
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
    """Return numbers for JSON, with None for NaN."""
    return [None if np.isnan(value) else value for value in values.tolist()]
