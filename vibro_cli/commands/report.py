"""`vibro report`: HTML page of a run, of several runs compared, or of a grid; films of runs."""

import gc
import math
import os
import sys
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from vibro_cli.commands.shared.error_handling import DONE, CommandError, check_place
from vibro_cli.commands.shared.options import beside, json_option, output_option, repeatable
from vibro_cli.commands.shared.terminal import json_text, progress_shown, say
from vibro_cli.errors import listing

if TYPE_CHECKING:
    from vibro_cli.figures.kinds import Drawn
    from vibro_cli.storage.stored import StoredGrid, StoredRun

    Runs = list[StoredRun]
    Subject = Runs | StoredGrid


FORMS = (".mp4", ".gif", ".html")
_HEAD = 2000
"""Number of leading bytes by which an existing file is recognised."""


@dataclass(frozen=True, kw_only=True)
class ReportCommand:
    """Write an HTML page on a run, several runs or a grid. The page is self-contained."""

    folders: Annotated[
        list[Path],
        typer.Argument(
            metavar="DIR",
            help="Folders of runs, or the folder of one grid.",
            show_default=False,
        ),
    ]
    output: Annotated[
        str | None,
        output_option(
            metavar="FILE",
            help="File of the page [default: DIR-report.html; for several runs report.html "
            "beside the first]; - prints it.",
        ),
    ] = None
    pdf: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Also write the figures to one PDF, a page each."),
    ] = None
    figures: Annotated[
        Path | None,
        typer.Option(metavar="FOLDER", help="Also write each figure as PNG, PDF and SVG."),
    ] = None
    force: Annotated[
        bool, typer.Option("--force", help="Replace figures of other runs or grids in FOLDER.")
    ] = False
    width: Annotated[
        Literal["single", "double"],
        typer.Option(
            help="Width in --pdf and --figures: one journal column (85 mm) or two (170 mm)."
        ),
    ] = "double"
    maps: Annotated[
        list[str],
        repeatable(
            "--map",
            metavar="COLUMN",
            help="For a grid, also map this summary column over two axes; repeatable.",
        ),
    ]
    animate: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Also write a film of the run, exact at the time of every frame: "
            ".mp4 (needs ffmpeg), .gif or .html.",
        ),
    ] = None
    span: Annotated[
        str | None,
        typer.Option(
            metavar="FROM:TO",
            help="Part of the run shown by --animate, in s [default: the first 30 s of film].",
        ),
    ] = None
    pace: Annotated[
        float,
        typer.Option(
            min=1e-6, metavar="SECONDS", help="Seconds of motion per second of film (--animate)."
        ),
    ] = 1.0
    fps: Annotated[
        int,
        typer.Option(
            min=1,
            max=100,
            metavar="N",
            help="Frames per second of film (--animate); for a GIF 1, 2, 4, 5, 10, 20, 25, 50 or "
            "100.",
        ),
    ] = 25
    as_json: Annotated[bool, json_option(help="Print the paths written as one JSON object.")] = (
        False
    )

    def __post_init__(self) -> None:
        if self.animate is not None:
            self._check_film(self.animate)
            if len(self.folders) > 1:
                raise typer.BadParameter("--animate: found several runs, expected one")
        elif (self.span, self.pace, self.fps) != (None, type(self).pace, type(self).fps):
            raise typer.BadParameter("--span, --pace and --fps require --animate FILE")
        if self.as_json and self.output == "-":
            raise typer.BadParameter("--json and a printed page both need standard output")
        if self.width != type(self).width and self.pdf is None and self.figures is None:
            raise typer.BadParameter("--width requires --pdf FILE or --figures FOLDER")
        if self.force and self.figures is None:
            raise typer.BadParameter("--force requires --figures FOLDER")
        written = [path for path in (self.page, self.pdf, self.figures, self.animate) if path]
        places = [os.path.realpath(path) for path in written]
        for path, place in zip(written, places, strict=True):
            if places.count(place) > 1:
                raise typer.BadParameter(f"found {path} for two results, expected different files")

    def _check_film(self, target: Path) -> None:
        form = target.suffix.lower()
        if form not in FORMS:
            raise typer.BadParameter(
                f"--animate: found {target.name!r}, expected a {listing(FORMS)} file"
            )
        if not math.isfinite(self.pace):
            raise typer.BadParameter(f"--pace: found {self.pace}, expected a finite number")
        if form == ".gif" and 100 % self.fps:  # it counts in hundredths of a second
            raise typer.BadParameter(
                f"--fps: found {self.fps}, expected a divisor of 100 for a GIF, such as 20 or 25"
            )
        try:
            self.bounds(float("inf"))
        except CommandError as error:
            raise typer.BadParameter(str(error).removeprefix("vibro: ")) from error

    def bounds(self, end: float) -> tuple[float, float]:
        """Return the first and last times (s) of the film of a run that ends at `end` (s)."""
        if self.span is None:
            from vibro_cli.figures.film import SECONDS

            return 0.0, min(end, SECONDS * self.pace)
        low, _, high = self.span.partition(":")
        try:
            start, stop = float(low or 0.0), min(float(high), end)
        except ValueError:
            start = stop = -1.0
        if not 0.0 <= start < stop:
            raise CommandError(
                f"vibro: --span: found {self.span!r}, expected FROM:TO in s, 0 ≤ FROM < TO, "
                "FROM before the end of the run"
            )
        return start, stop

    @property
    def page(self) -> Path | None:
        """Path of the page, None if it is printed."""
        return None if self.output == "-" else self.target

    @property
    def target(self) -> Path:
        """Path of the page, `-` if it is printed."""
        if self.output is not None:
            return Path(self.output)
        first = Path(os.path.abspath(self.folders[0]))
        page = beside(first, "-report.html")
        return page.with_name("report.html") if len(self.folders) > 1 else page

    def __call__(self) -> int:
        """Check, draw and write; print the page, or the paths of the files written."""
        from vibro_cli.storage.files import write_file
        from vibro_cli.storage.folders import check_figures_folder

        target = self.target
        _check(self)
        subject = _subject(self)
        _check_maps(subject, self.maps)
        if self.figures is not None:
            check_figures_folder(self.figures, _shown(subject), self.force)
        # Drawing triggers many garbage collections: exempt the objects that exist by now.
        gc.freeze()
        gc.set_threshold(50_000, 4, 2)
        with progress_shown():
            content = _page(subject, target.parent if self.page else Path.cwd(), self.maps)
        if self.page is None:
            sys.stdout.buffer.write(content)
            sys.stdout.buffer.flush()
        else:
            write_file(target, content)
            say(f"report in {target}")
        if self.pdf is not None or self.figures is not None:
            _write_figures(subject, self)
        if self.animate is not None:
            assert isinstance(subject, list)
            _write_film(subject[0], self.animate, self)
        if self.as_json:
            written = {
                "page": target,
                "pdf": self.pdf,
                "figures": self.figures,
                "film": self.animate,
            }
            print(json_text({kind: path and str(path) for kind, path in written.items()}))
        return DONE


def _subject(options: ReportCommand) -> "Subject":
    """Open the runs, or the one grid, of the report; raise `CommandError` for other folders."""
    from vibro_cli.storage.stored import is_grid, open_grid

    grids = [folder for folder in options.folders if is_grid(folder)]
    if not grids:
        return _runs(options)
    if len(options.folders) > 1:
        raise CommandError(f"vibro: {grids[0]} holds a grid; a report is on runs or on one grid")
    if options.animate is not None:
        raise CommandError(f"vibro: {grids[0]} holds a grid; --animate takes a run")
    return open_grid(grids[0])


def _runs(options: ReportCommand) -> "Runs":
    """Open the runs in the folders; raise `CommandError` unless all are of one system."""
    from vibro_cli.storage.stored import open_run

    found = [open_run(folder) for folder in options.folders]
    systems = [run.scenario.system for run in found]
    for folder, system in zip(options.folders, systems, strict=True):
        if system != systems[0]:
            first = f"{options.folders[0]} one of {systems[0]}"
            text = f"vibro: {folder} holds a run of system {system}, {first}; expected one system"
            raise CommandError(text)
    if options.animate is not None:
        _check_film(found[0], options.animate, options)
    return found


def _check_maps(subject: "Subject", maps: Sequence[str]) -> None:
    """Raise `CommandError` unless every requested map is of a column of the grid's summary."""
    from vibro_cli.figures.kinds import mapped_columns
    from vibro_cli.scenario.problems import suggestion

    if maps and isinstance(subject, list):
        raise CommandError("vibro: --map takes a grid, not runs")
    for name in maps:
        assert not isinstance(subject, list)
        known = mapped_columns(subject)
        if name not in known:
            expected = listing(known) + suggestion(name, known)
            raise CommandError(f"vibro: --map: found {name!r}, expected one of {expected}")


def _page(subject: "Subject", beside: Path, maps: Sequence[str]) -> bytes:
    from vibro_cli.errors import NothingToShow
    from vibro_cli.report.content import report_html
    from vibro_cli.report.grid_content import grid_html

    if isinstance(subject, list):
        return report_html(subject, beside)
    try:
        return grid_html(subject, beside, maps)
    except NothingToShow as error:
        raise CommandError(f"vibro: --map: {error}") from error


def _check(options: ReportCommand) -> None:
    """Raise `CommandError` before anything is drawn if some file could not take its place.

    Raises `OSError` if the folder of a file does not exist.
    """
    from vibro_cli.report.html import is_report
    from vibro_cli.scenario.base import checked_page
    from vibro_cli.storage.files import first_bytes

    target, pdf = options.target, options.pdf
    try:
        checked_page("--output", target)
    except ValueError as error:
        raise CommandError(f"vibro: {error}") from error
    for path in (options.page, pdf, options.animate):
        if path is not None:
            check_place(path)
    if options.page and target.exists() and not is_report(first_bytes(target, _HEAD)):
        raise CommandError(f"vibro: {target} exists and is not a vibro report; it is left as it is")
    if pdf is not None and pdf.exists() and first_bytes(pdf, 5) != b"%PDF-":
        raise CommandError(f"vibro: {pdf} exists and is not a PDF; it is left as it is")
    if pdf is not None and pdf.suffix.lower() not in ("", ".pdf"):
        raise CommandError(f"vibro: --pdf: found {str(pdf)!r}, expected a .pdf file")


def _shown(subject: "Subject") -> Any:
    """Return what is shown, as plain data: a grid, or scenarios without what may change later."""
    from vibro_cli.systems.request import CHANGEABLE

    if not isinstance(subject, list):
        return dict(subject.definition)
    scenarios = [run.scenario.resolved() for run in subject]
    found = [{key: one[key] for key in one if key not in CHANGEABLE} for one in scenarios]
    return found if len(found) > 1 else found[0]


def _drawn(subject: "Subject", width: str, maps: Sequence[str]) -> "Iterator[tuple[str, Drawn]]":
    """Yield the figures of the report, each with the stem of its files."""
    from vibro_cli.figures.kinds import draw_all, draw_grid

    if not isinstance(subject, list):
        yield from ((drawn.name, drawn) for drawn in draw_grid(subject, width, maps))
        return
    for beginning, run in _by_beginning(subject).items():
        each = draw_all(run, None, width)
        yield from ((f"{beginning}{drawn.name}", drawn) for drawn in each)


def _by_beginning(runs: "Runs") -> "dict[str, StoredRun]":
    """Return the runs by the beginnings of the stems of their files."""
    if len(runs) == 1:
        return {"": runs[0]}
    names = (run.scenario.name if run.folder is None else run.folder.name for run in runs)
    return {f"{n}_{name}_": run for n, (name, run) in enumerate(zip(names, runs, strict=True), 1)}


def _write_figures(subject: "Subject", options: ReportCommand) -> None:
    """Write the figures to one PDF, to a folder in all formats, or both; draw each once."""
    from vibro_cli.figures.style import FORMATS, render_pages
    from vibro_cli.interface import files_of, pictures
    from vibro_cli.storage.files import write_file
    from vibro_cli.storage.folders import write_results

    files: dict[str, bytes] = {}

    def figures() -> "Iterator[Drawn]":
        for stem, one in _drawn(subject, options.width, options.maps):
            if options.figures is not None:
                files.update(pictures({stem: one.figure}, FORMATS))
            yield one

    with progress_shown():
        if options.pdf is None and isinstance(subject, list):
            files = files_of(_by_beginning(subject), None, options.width, FORMATS)
        elif options.pdf is None:
            deque(figures(), maxlen=0)
        else:
            write_file(options.pdf, render_pages(one.figure for one in figures()))
    if options.pdf is not None:
        say(f"figures in {options.pdf}")
    if options.figures is not None:
        write_results("figures", options.figures, files, of=_shown(subject))
        say(f"figures in {options.figures}")


def _check_film(run: "StoredRun", target: Path, options: ReportCommand) -> None:
    """Raise `CommandError`, before drawing, if the film cannot be made or its file replaced."""
    from vibro_cli.figures.film import NoFilm, check_encoder, frame_times
    from vibro_cli.report.html import is_report
    from vibro_cli.storage.files import first_bytes

    form = target.suffix[1:].lower()
    try:
        run.kind.check_film()
        check_encoder(form)
    except NoFilm as error:
        raise CommandError(f"vibro: {run.folder}: {error}") from error
    try:
        frame_times(*options.bounds(float(run.summary["end_time"])), options.pace, options.fps)
    except ValueError as error:
        raise CommandError(f"vibro: {error}") from error
    if not target.exists():
        return
    head = first_bytes(target, _HEAD)
    ours = {
        "mp4": head[4:8] == b"ftyp",
        "gif": head.startswith(b"GIF8"),
        "html": is_report(head, "film"),
    }
    if not ours[form]:
        raise CommandError(f"vibro: {target} exists and is not a film; it is left as it is")


def _write_film(run: "StoredRun", target: Path, options: ReportCommand) -> None:
    """Write the film of a run; an interruption leaves no partial file."""
    from vibro_cli.interface.runs import write_film

    end = float(run.summary["end_time"])
    start, stop = options.bounds(end)
    with progress_shown():
        write_film(run, run.scenario.name, target, (start, stop), options.pace, options.fps)
    say(f"film of {start:g} s to {stop:g} s (the run ends at {end:g} s) in {target}")
    if (stop - start) / options.pace * options.fps < 1.0:
        say("vibro: warning: the film has one frame; a smaller --pace gives more", "warning")
