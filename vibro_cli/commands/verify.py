"""`vibro verify`: are the files of a folder as they were written?"""

from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from vibro_cli.commands.boundary import DONE, FAILED, MISUSED, say
from vibro_cli.commands.options import Task
from vibro_cli.commands.streams import json_text


def verify(
    folders: Annotated[
        list[Path],
        typer.Argument(metavar="DIR", help="Folders of results.", show_default=False),
    ],
    as_json: Annotated[
        bool, typer.Option("--json", help="Print what was found as JSON, a line for each folder.")
    ] = False,
) -> Task:
    """Check folders of results against their checksums. Exit code 1: missing or damaged."""
    return partial(_verify, folders, as_json)


def _verify(folders: list[Path], as_json: bool) -> int:
    from vibro_cli.commands.words import count, size
    from vibro_cli.grids.dataset import NoManifest
    from vibro_cli.grids.dataset import verify as check

    sound, ours = True, True
    for folder in folders:
        try:
            verdict = check(folder)
        except NoManifest as error:
            ours = False
            say(f"vibro: {error}" if folder.exists() else f"{folder}: no such folder", "error")
            continue
        sound = sound and verdict.sound
        if as_json:
            print(json_text({"folder": str(folder), "sound": verdict.sound, **asdict(verdict)}))
        for finding in verdict.findings:
            text = f"{folder / finding.file}: {finding.state}: {finding.detail}"
            say(text, "error", file=finding.file, state=finding.state)
        if verdict.missing_chunks:
            chunks = count(verdict.missing_chunks, "chunk", "chunks")
            say(f"{folder}: {chunks} not finished; vibro grid goes on with them", "error")
        state = "as written" if verdict.sound else "not sound"
        files = count(verdict.files, "file", "files")
        say(f"{folder}: {state} ({verdict.kind}, {files}, {size(verdict.bytes)})")
    if not ours:
        return MISUSED
    return DONE if sound else FAILED
