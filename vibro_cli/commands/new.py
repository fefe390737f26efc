"""`vibro new`: a commented scenario to start from."""

import sys
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from vibro_cli.commands.boundary import DONE, CommandError, say
from vibro_cli.commands.completing import gallery_names
from vibro_cli.commands.options import Task
from vibro_cli.commands.streams import json_text


def new(
    name: Annotated[
        str | None,
        typer.Argument(
            help="Scenario of the gallery.", show_default=False, autocompletion=gallery_names
        ),
    ] = None,
    listing: Annotated[bool, typer.Option("--list", help="Print the gallery's names.")] = False,
    output: Annotated[
        str | None,
        typer.Option(
            "--output", "-o", metavar="FILE", help="File [default: NAME.toml]; - prints it."
        ),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace an existing file.")] = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the names, or the file written, as JSON.")
    ] = False,
) -> Task:
    """Write a commented scenario to start from."""
    if listing:
        return partial(_print_names, as_json)
    if name is None:
        raise typer.BadParameter("expected the NAME of a scenario, or --list")
    return partial(_write_scenario, name, output, force, as_json)


def _print_names(as_json: bool) -> int:
    """Print each name with the title of its scenario, which is its first comment."""
    from vibro_cli.scenario.gallery import names, text

    titles = {name: text(name).partition("\n")[0].lstrip("# ") for name in names()}
    width = max(map(len, titles))
    for name, title in titles.items():
        if as_json:
            print(json_text({"name": name, "title": title}))
        else:
            print(f"{name:{width}}  {title}")
    return DONE


def _write_scenario(name: str, output: str | None, force: bool, as_json: bool) -> int:
    """Write a scenario of the gallery to a file or to standard output."""
    from vibro_cli.scenario import ScenarioError
    from vibro_cli.scenario.gallery import text
    from vibro_cli.storage.files import write_file

    try:
        content = text(name)
    except ScenarioError as error:
        raise CommandError(str(error)) from error
    if output == "-":
        sys.stdout.write(content)
        return DONE
    path = Path(f"{name}.toml" if output is None else output)
    if path.exists() and not force:
        raise CommandError(f"vibro: {path} exists; --force replaces it")
    write_file(path, content.encode())
    if as_json:
        print(json_text({"file": str(path)}))
    say(f"{path} written; solve it with: vibro run {path}")
    return DONE
