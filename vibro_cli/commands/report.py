"""`vibro report`: a page that explains one run or a grid, or compares several runs."""

import gc
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from vibro_cli import __version__
from vibro_cli.commands.shared.error_handling import DONE, CommandError
from vibro_cli.commands.shared.filming import FilmWishes, check_film, write_film
from vibro_cli.commands.shared.options import Task
from vibro_cli.commands.shared.terminal import json_text, say

if TYPE_CHECKING:
    from vibro_cli.figures.runs.kinds import Drawn
    from vibro_cli.storage.stored import StoredGrid, StoredRun

    Runs = list[StoredRun]
    Subject = Runs | StoredGrid


@dataclass(frozen=True)
class _Wishes:
    """What was asked of `vibro report`."""

    folders: Sequence[Path]
    output: str | None
    pdf: Path | None
    figures: Path | None
    width: str
    maps: Sequence[str]
    film: FilmWishes | None
    as_json: bool


def report(
    folders: Annotated[
        list[Path],
        typer.Argument(
            metavar="DIR",
            help="Folders that `vibro run` wrote, or one of a grid.",
            show_default=False,
        ),
    ],
    output: Annotated[
        str | None,
        typer.Option(
            "--output",
            "-o",
            metavar="FILE",
            help="The page [default: DIR-report.html, of several report.html beside the first]; "
            "- prints it.",
        ),
    ] = None,
    pdf: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Also the figures as one PDF, a page each."),
    ] = None,
    figures: Annotated[
        Path | None,
        typer.Option(metavar="FOLDER", help="Also each figure as PNG, PDF and SVG."),
    ] = None,
    width: Annotated[
        Literal["single", "double"],
        typer.Option(help="Width of --pdf and --figures: one column (85 mm) or two (170 mm)."),
    ] = "double",
    maps: Annotated[
        list[str],
        typer.Option(
            "--map",
            metavar="COLUMN",
            help="For a grid: also a map of this column of the summary over two axes; repeatable.",
            show_default=False,
        ),
    ] = [],  # noqa: B006 (typer copies it)
    animate: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Also the motion of the run as a film, exact at every frame's time: "
            ".mp4 (needs ffmpeg), .gif or .html.",
        ),
    ] = None,
    span: Annotated[
        str | None,
        typer.Option(
            metavar="FROM:TO",
            help="Times shown by --animate, in s [default: the first 30 s of film].",
        ),
    ] = None,
    pace: Annotated[
        float,
        typer.Option(min=1e-6, help="Seconds of motion in a second of the film (--animate)."),
    ] = 1.0,
    fps: Annotated[
        int,
        typer.Option(
            min=1,
            max=100,
            help="Frames per second of the film (--animate); of a GIF 1, 2, 4, 5, 10, 20, 25, 50 "
            "or 100.",
        ),
    ] = 25,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print what was written as one JSON object.")
    ] = False,
) -> Task:
    """Write an HTML page of a run, of runs compared, or of a grid. It needs no other file."""
    film = None if animate is None else FilmWishes(animate, span, pace, fps)
    if film is not None and len(folders) > 1:
        raise typer.BadParameter("--animate: found several runs, expected one")
    if as_json and output == "-":
        raise typer.BadParameter("--json and a printed page both need standard output")
    return partial(_report, _Wishes(folders, output, pdf, figures, width, maps, film, as_json))


def _target(wishes: _Wishes) -> Path:
    """Where the page goes."""
    if wishes.output is not None:
        return Path(wishes.output)
    first = Path(wishes.folders[0]).resolve()
    if len(wishes.folders) > 1:
        return first.with_name("report.html")
    return first.with_name(f"{first.name}-report.html")


def _report(wishes: _Wishes) -> int:
    from vibro_cli.report.page import is_report
    from vibro_cli.storage.files import write_file

    _check(wishes)
    target = _target(wishes)
    printed = wishes.output == "-"
    if not printed and target.exists() and not is_report(target.read_bytes()):
        raise CommandError(f"vibro: {target} exists and is no vibro report; it is left as it is")
    subject = _subject(wishes)
    _check_maps(subject, wishes.maps)
    # Figures are collected again and again, and what is there by now stays.
    gc.freeze()
    gc.set_threshold(50_000, 4, 2)
    content = _page(subject, Path.cwd() if printed else target.parent, wishes.maps)
    if printed:
        sys.stdout.buffer.write(content)
        sys.stdout.buffer.flush()
    else:
        write_file(target, content)
        say(f"report in {target}")
    if wishes.pdf is not None:
        _write_pdf(subject, wishes.pdf, wishes)
    if wishes.figures is not None:
        _write_figures(subject, wishes.figures, wishes)
    if wishes.film is not None:
        assert isinstance(subject, list)
        (run,) = subject
        write_film(run, wishes.film)
    if wishes.as_json:
        film = None if wishes.film is None else wishes.film.target
        written = {"page": target, "pdf": wishes.pdf, "figures": wishes.figures, "film": film}
        print(json_text({kind: path and str(path) for kind, path in written.items()}))
    return DONE


def _subject(wishes: _Wishes) -> "Subject":
    """What is reported: runs, or one grid; raises `CommandError` where that is not possible."""
    from vibro_cli.storage.stored import NotAGrid, is_grid, open_grid

    grids = [folder for folder in wishes.folders if is_grid(folder)]
    if not grids:
        return _runs(wishes)
    if len(wishes.folders) > 1:
        raise CommandError(f"vibro: {grids[0]} holds a grid, which is reported alone")
    if wishes.film is not None:
        raise CommandError(f"vibro: {grids[0]} holds a grid; --animate takes a run")
    try:
        return open_grid(grids[0])
    except NotAGrid as error:
        raise CommandError(f"vibro: {error}") from error


def _runs(wishes: _Wishes) -> "Runs":
    """The runs of the folders, all of one system; raises `CommandError` where that is not so."""
    found = [_opened(folder) for folder in wishes.folders]
    systems = [run.scenario.system for run in found]
    for folder, system in zip(wishes.folders, systems, strict=True):
        if system != systems[0]:
            first = f"{wishes.folders[0]} of {systems[0]}"
            raise CommandError(f"vibro: {folder} is of {system} and {first}; expected one system")
    if wishes.film is not None:
        check_film(found[0], wishes.film)
    return found


def _check_maps(subject: "Subject", maps: Sequence[str]) -> None:
    """Raise `CommandError` unless every map asked for is of a column of the grid's summary."""
    from vibro_cli.figures.grids.kinds import mapped_columns
    from vibro_cli.scenario.problems import listing, suggestion

    if maps and isinstance(subject, list):
        raise CommandError("vibro: --map takes a grid, not runs")
    for name in maps:
        assert not isinstance(subject, list)
        known = mapped_columns(subject)
        if name not in known:
            expected = listing(known) + suggestion(name, known)
            raise CommandError(f"vibro: --map: found {name}, expected one of {expected}")


def _page(subject: "Subject", beside: Path, maps: Sequence[str]) -> bytes:
    from vibro_cli.report.page import grid_html, report_html

    if isinstance(subject, list):
        return report_html(subject, beside, __version__)
    return grid_html(subject, beside, __version__, maps)


def _opened(folder: Path) -> "StoredRun":
    """The run of a folder; raises `CommandError` when there is none."""
    from vibro_cli.storage.folders import NotContinuable
    from vibro_cli.storage.stored import open_run

    try:
        return open_run(folder)
    except NotContinuable as error:
        raise CommandError(f"vibro: {error}") from error


def _check(wishes: _Wishes) -> None:
    """Raise `CommandError` before anything is drawn if some file could not take its place."""
    from vibro_cli.storage.files import FolderRefused, check_replaceable

    pdf = wishes.pdf
    if pdf is not None and pdf.exists() and pdf.read_bytes()[:5] != b"%PDF-":
        raise CommandError(f"vibro: {pdf} exists and is no PDF; it is left as it is")
    try:
        if wishes.figures is not None:
            check_replaceable(wishes.figures, "figures")
    except FolderRefused as error:
        raise CommandError(f"vibro: {error}") from error


def _drawn(subject: "Subject", width: str, maps: Sequence[str]) -> "Iterator[tuple[str, Drawn]]":
    """Every figure of what is reported, with the stem of its files."""
    from vibro_cli.figures.grids.kinds import draw_grid
    from vibro_cli.figures.runs.kinds import draw_all

    if not isinstance(subject, list):
        yield from ((drawn.name, drawn) for drawn in draw_grid(subject, width, maps))
        return
    for place, run in enumerate(subject, 1):
        name = run.scenario.name if run.folder is None else run.folder.name
        prefix = f"{place}_{name}_" if len(subject) > 1 else ""
        each = draw_all(run.whole or run, None, width)
        yield from ((f"{prefix}{drawn.name}", drawn) for drawn in each)


def _write_pdf(subject: "Subject", target: Path, wishes: _Wishes) -> None:
    """Write all figures into one PDF."""
    from vibro_cli.figures.style import render_pages
    from vibro_cli.storage.files import write_file

    drawn = _drawn(subject, wishes.width, wishes.maps)
    write_file(target, render_pages(one.figure for _, one in drawn))
    say(f"figures in {target}")


def _write_figures(subject: "Subject", target: Path, wishes: _Wishes) -> None:
    """Write every figure into a folder, in all forms."""
    from vibro_cli.figures.style import FORMATS, render
    from vibro_cli.storage.folders import write_results

    files = {
        f"{stem}.{form}": render(drawn.figure, form)
        for stem, drawn in _drawn(subject, wishes.width, wishes.maps)
        for form in FORMATS
    }
    write_results("figures", target, files)
    say(f"figures in {target}")
