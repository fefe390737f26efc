"""`vibro report`: a page that explains one run, or compares several."""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vibro_cli import __version__
from vibro_cli.commands.boundary import DONE, CommandError, say
from vibro_cli.commands.options import Task

if TYPE_CHECKING:
    from vibro_cli.storage.stored import StoredRun


@dataclass(frozen=True)
class _Wishes:
    """What was asked of `vibro report`."""

    folders: Sequence[Path]
    output: str | None
    pdf: Path | None


def report(
    folders: Annotated[
        list[Path],
        typer.Argument(metavar="DIR", help="Folders that `vibro run` wrote.", show_default=False),
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
) -> Task:
    """Write a self-contained HTML page of a run, or of several runs compared."""
    return partial(_report, _Wishes(folders, output, pdf))


def _target(wishes: _Wishes) -> Path:
    """Where the page goes."""
    if wishes.output is not None:
        return Path(wishes.output)
    first = Path(wishes.folders[0]).resolve()
    if len(wishes.folders) > 1:
        return first.with_name("report.html")
    return first.with_name(f"{first.name}-report.html")


def _report(wishes: _Wishes) -> int:
    from vibro_cli.report.page import is_report, report_html
    from vibro_cli.storage.files import write_file

    target = _target(wishes)
    printed = wishes.output == "-"
    if not printed and target.exists() and not is_report(target.read_bytes()):
        raise CommandError(f"vibro: {target} exists and is no vibro report; it is left as it is")
    runs = [_opened(folder) for folder in wishes.folders]
    beside = Path.cwd() if printed else target.parent
    content = report_html(runs, beside, __version__)
    if printed:
        sys.stdout.buffer.write(content)
        sys.stdout.buffer.flush()
    else:
        write_file(target, content)
        say(f"report in {target}")
    if wishes.pdf is not None:
        _write_pdf(runs, wishes.pdf)
    return DONE


def _opened(folder: Path) -> "StoredRun":
    """The run of a folder; raises `CommandError` when there is none."""
    from vibro_cli.storage.runs import NotContinuable
    from vibro_cli.storage.stored import open_run

    try:
        return open_run(folder)
    except NotContinuable as error:
        raise CommandError(f"vibro: {error}") from error


def _write_pdf(runs: "Sequence[StoredRun]", target: Path) -> None:
    """Write all figures of all runs into one PDF."""
    from vibro_cli.figures.kinds import KINDS, PORTRAIT, draw_all
    from vibro_cli.figures.output import render_pages
    from vibro_cli.storage.files import write_file

    if target.exists() and not target.read_bytes()[:5] == b"%PDF-":
        raise CommandError(f"vibro: {target} exists and is no PDF; it is left as it is")
    figures = [drawn.figure for run in runs for drawn in draw_all(run, [PORTRAIT, *KINDS])]
    write_file(target, render_pages(figures))
    say(f"figures in {target}")
