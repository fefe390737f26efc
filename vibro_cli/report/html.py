"""Pages as one HTML file each: nothing is loaded from elsewhere, and nothing can be.

Figures are SVG, or PNG where that is too much, in addresses that hold their data.
"""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Iterator, Mapping, Sequence
from importlib.resources import files
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from matplotlib.figure import Figure

from vibro_cli.figures.kinds import Drawn, draw_all, draw_grid
from vibro_cli.figures.style import has_rasters, render
from vibro_cli.storage.stored import StoredGrid

GENERATOR = "vibro report"
_DPI = 192.0
"""Resolution of figures with too many points for SVG: two pixels for each of a plain screen."""
_TYPES = {"png": "png", "svg": "svg+xml"}


def figures_of_run(run: Any, name: str) -> Iterator[dict[str, Any]]:
    """Return every figure of a run as the page has it, with its words."""
    both = (draw_all(run, None, width) for width in ("double", "single"))
    return _shown(zip(*both, strict=True), f"run {name}")


def figures_of_grid(grid: StoredGrid, columns: Sequence[str]) -> Iterator[dict[str, Any]]:
    """Return every figure of a grid as the page has it, with its words.

    `columns` are those of the summary whose maps are drawn too.
    """
    both = (draw_grid(grid, width, columns) for width in ("double", "single"))
    return _shown(zip(*both, strict=True), f"grid {grid.name}")


def _shown(both: Iterator[tuple[Drawn, Drawn]], of: str) -> Iterator[dict[str, Any]]:
    """Return figures of two columns' width and of one's for narrow screens, with words."""
    for wide, narrow in both:
        name = f"{wide.title}, {of}"
        yield shown(wide.title, wide.caption, name, wide.figure, narrow.figure)


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
    content = base64.b64encode(render(figure, form, _DPI)).decode()
    width, height = figure.get_size_inches() * 96.0
    return {
        "source": f"data:image/{_TYPES[form]};base64,{content}",
        "width": f"{width:.0f}",
        "height": f"{height:.0f}",
    }


def rendered(name: str, values: Mapping[str, Any], assets: str = "") -> bytes:
    """Return the page of a template with its style and its script, and a policy for these alone.

    `assets` is the name of both, if not that of the template.
    """
    environment = Environment(
        loader=PackageLoader("vibro_cli.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    style, script = (_asset(f"{assets or name}.{kind}") for kind in ("css", "js"))
    policy = (
        "default-src 'none'; img-src data:; base-uri 'none'; form-action 'none'; "
        f"style-src {_hash(style)}; script-src {_hash(script)}"
    )
    ours = {"policy": policy, "style": style, "script": script}  # the template takes them as is
    return environment.get_template(f"{name}.html").render({**values, **ours}).encode()


def is_report(content: bytes, generator: str = GENERATOR) -> bool:
    """Return whether the bytes are those of a report of ours, or of another page of ours."""
    return f'<meta name="generator" content="{generator}">'.encode() in content[:2000]


def _asset(name: str) -> str:
    return (files("vibro_cli.report") / "templates" / name).read_text(encoding="utf-8")


def _hash(text: str) -> str:
    """Return the source expression that lets just this text through the content policy."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"
