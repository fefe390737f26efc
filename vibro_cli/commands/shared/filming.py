"""Films of a run: MP4, GIF or a page, by the suffix of the file."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from vibro_cli import __version__
from vibro_cli.commands.shared.error_handling import CommandError
from vibro_cli.commands.shared.terminal import say

if TYPE_CHECKING:
    from vibro_cli.figures.film import Frames
    from vibro_cli.storage.stored import StoredRun

SECONDS = 30.0
"""Length of a film (s) where no span is asked for."""
MOST_FRAMES = 20000
FORMS = (".mp4", ".gif", ".html")
_HUNDREDTHS = 100
"""A GIF has the time of each frame in hundredths of a second."""


@dataclass(frozen=True)
class FilmWishes:
    """What was asked of a film; raises `typer.BadParameter` where that is not possible."""

    target: Path
    span: str | None
    pace: float
    rate: int

    def __post_init__(self) -> None:
        """Tell a wrong usage before anything is read."""
        if self.form not in FORMS:
            raise typer.BadParameter(
                f"--animate: found {self.target.name!r}, expected a file {', '.join(FORMS)}"
            )
        if self.form == ".gif" and _HUNDREDTHS % self.rate:
            raise typer.BadParameter(
                f"--fps: found {self.rate}, expected a divisor of 100 for a GIF, as 10, 20, 25, 50"
            )
        try:
            self.bounds(float("inf"))
        except ValueError as error:
            raise typer.BadParameter(str(error)) from error

    @property
    def form(self) -> str:
        """The suffix of the file."""
        return self.target.suffix.lower()

    def bounds(self, end: float) -> tuple[float, float]:
        """First and last time (s) shown of a run that ends at `end` (s); raises `ValueError`."""
        if self.span is None:
            return 0.0, min(end, SECONDS * self.pace)
        low, _, high = self.span.partition(":")
        try:
            start, stop = float(low or 0.0), min(float(high), end)
        except ValueError:
            start = stop = -1.0
        if not 0.0 <= start < stop:
            raise ValueError(
                f"--span: found {self.span!r}, expected FROM:TO in s, 0 ≤ FROM < TO, "
                "FROM before the end of the run"
            )
        return start, stop


def check_film(run: "StoredRun", wishes: FilmWishes) -> None:
    """Raise `CommandError` before anything is drawn if the film cannot be or take its place."""
    from vibro_cli.report.film_page import GENERATOR
    from vibro_cli.report.page import is_report

    start, stop = _bounds(run, wishes)
    number = (stop - start) / wishes.pace * wishes.rate
    if number > MOST_FRAMES:
        raise CommandError(
            f"vibro: a film of {number:.0f} frames, expected at most {MOST_FRAMES}; "
            "a shorter --span, a greater --pace or a smaller --fps has fewer"
        )
    target = wishes.target
    if not target.exists():
        return
    head = target.read_bytes()[:2000]
    ours = {
        ".mp4": head[4:8] == b"ftyp",
        ".gif": head.startswith(b"GIF8"),
        ".html": is_report(head, GENERATOR),
    }
    if not ours[wishes.form]:
        raise CommandError(f"vibro: {target} exists and is no film; it is left as it is")


def _bounds(run: "StoredRun", wishes: FilmWishes) -> tuple[float, float]:
    try:
        return wishes.bounds(float(run.summary["end_time"]))
    except ValueError as error:
        raise CommandError(f"vibro: {error}") from error


def write_film(run: "StoredRun", wishes: FilmWishes) -> None:
    """Write the film of a run, whole or not at all."""
    from vibro_cli.figures.film import frame_times
    from vibro_cli.storage.files import write_file

    start, stop = _bounds(run, wishes)
    shown = run.kind.film(run, frame_times(start, stop, wishes.pace, wishes.rate))
    write_file(wishes.target, _content(run.scenario.name, shown, wishes))
    end = float(run.summary["end_time"])
    say(f"film of {start:g} s to {stop:g} s (the run ends at {end:g} s) in {wishes.target}")


def _content(name: str, shown: "Frames", wishes: FilmWishes) -> bytes:
    from vibro_cli.figures.film import NoFilm, movie
    from vibro_cli.report.film_page import film_html

    if wishes.form == ".html":
        return film_html(shown, wishes.rate, name, __version__)
    try:
        return movie(shown, wishes.rate, wishes.form[1:])
    except NoFilm as error:
        raise CommandError(f"vibro: {error}") from error
