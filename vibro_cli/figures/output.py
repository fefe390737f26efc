"""Figures as files: PNG, PDF and SVG, the same bytes for the same figure."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from vibro_cli.figures.style import journal
from vibro_cli.storage.files import write_file

FORMATS = ("png", "pdf", "svg")
_COMPRESSION = 3
"""Of PNG: higher levels take twice the time for a twentieth of the bytes."""

# What would differ from one writing to the next (or from one machine to another) is left out.
_METADATA: dict[str, dict[str, str | None]] = {
    "png": {"Software": None},
    "pdf": {"CreationDate": None, "Creator": "vibro", "Producer": None},
    "svg": {"Date": None, "Creator": "vibro"},
}


def render(figure: Figure, form: str, dpi: float = 300.0) -> bytes:
    """Return a figure as the bytes of a file of one of `FORMATS`; `dpi` is that of PNG and rasters.

    Raises ValueError for another format.
    """
    if form not in FORMATS:
        raise ValueError(f"unknown figure format {form!r}, expected one of {', '.join(FORMATS)}")
    options: dict[str, Any] = {"format": form, "dpi": dpi, "metadata": _METADATA[form]}
    if form == "png":
        options["pil_kwargs"] = {"compress_level": _COMPRESSION}
    buffer = BytesIO()
    with journal():
        figure.savefig(buffer, **options)
    return buffer.getvalue()


def has_rasters(figure: Figure) -> bool:
    """Return whether some of a figure is drawn as a raster in vector files, being too much."""
    return bool(figure.findobj(lambda artist: bool(artist.get_rasterized())))


def save(figure: Figure, stem: Path, formats: Sequence[str] = ("png", "pdf")) -> tuple[Path, ...]:
    """Write a figure as `stem.png`, `stem.pdf`, …, each file whole, and return the paths.

    Raises ValueError for an unknown format and OSError when a file cannot be written.
    """
    contents = {form: render(figure, form) for form in formats}
    paths = []
    for form, content in contents.items():
        path = stem.with_name(f"{stem.name}.{form}")
        write_file(path, content)
        paths.append(path)
    return tuple(paths)


def render_pages(figures: Iterable[Figure]) -> bytes:
    """Return figures as one PDF file, a page each."""
    from matplotlib.backends.backend_pdf import PdfPages

    buffer = BytesIO()
    metadata = {"CreationDate": None, "Creator": "vibro", "Producer": None}
    with journal(), PdfPages(buffer, metadata=metadata) as pages:
        for figure in figures:
            pages.savefig(figure)
    return buffer.getvalue()
