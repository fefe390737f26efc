"""`vibro new` and `vibro schema`: commented scenarios and grids to start from; their JSON Schema.

Editors use the schema. `vibro schema tables` describes the tables of results.
"""

import json
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, TypeAlias

import typer

from vibro_cli.commands.shared.error_handling import DONE, CommandError, check_no_folder
from vibro_cli.commands.shared.options import gallery_names, json_option, output_option
from vibro_cli.commands.shared.terminal import json_text, say, wrapped
from vibro_cli.errors import in_command, printable
from vibro_cli.systems import NAMES

if TYPE_CHECKING:
    System: TypeAlias = str
else:
    System = Literal[NAMES]


@dataclass(frozen=True, kw_only=True)
class NewCommand:
    """Write a commented scenario or grid to start from."""

    name: Annotated[
        str | None,
        typer.Argument(
            help="Scenario or grid of the gallery.",
            show_default=False,
            autocompletion=gallery_names,
        ),
    ] = None
    listing: Annotated[bool, typer.Option("--list", help="List the gallery.")] = False
    whole: Annotated[bool, typer.Option("--all", help="Write the whole gallery to a folder.")] = (
        False
    )
    output: Annotated[
        str | None,
        output_option(
            metavar="PATH",
            help="File to write [default: NAME.toml], - prints it; with --all the folder "
            "[default: scenarios].",
        ),
    ] = None
    force: Annotated[bool, typer.Option("--force", help="Replace an existing file.")] = False
    as_json: Annotated[
        bool, json_option(help="Print the names, or the files written, as JSON.")
    ] = False

    def __post_init__(self) -> None:
        asked = (self.name is not None) + self.listing + self.whole
        if asked != 1 or (self.whole and self.output == "-"):
            raise typer.BadParameter("expected the NAME of a scenario, or --list, or --all")
        if self.listing and (self.output is not None or self.force):
            raise typer.BadParameter(
                "--list writes no file; it cannot be combined with -o or --force"
            )
        if self.as_json and self.output == "-":
            raise typer.BadParameter("--json and a printed scenario both need standard output")

    def __call__(self) -> int:
        """Print the names in the gallery, or write one of its files or all of them."""
        if self.listing:
            return _print_names(self.as_json)
        if self.name is None:
            return _write_all(Path(self.output or "scenarios"), self.force, self.as_json)
        return _write(self.name, self.output, self.force, self.as_json)


def _print_names(as_json: bool) -> int:
    """Print each name with the title of its scenario or grid."""
    from vibro_cli.scenario.gallery import grid_names, names, title

    listed = [*names(), *grid_names()]
    width = max(map(len, listed))
    for name in listed:
        if as_json:
            print(json_text({"name": name, "title": title(name)}))
        else:
            print("\n".join(wrapped(title(name), f"{name:{width}}  ", " " * (width + 2))))
    return DONE


def _write(name: str, output: str | None, force: bool, as_json: bool) -> int:
    """Write a scenario or grid of the gallery to a file or to standard output.

    The scenario of a grid is written beside it, unless that file exists.
    """
    from vibro_cli.scenario.gallery import base_of, grid_names, text
    from vibro_cli.scenario.problems import ScenarioError
    from vibro_cli.storage.files import make_folder

    try:
        content = text(name)
    except ScenarioError as error:
        raise CommandError(
            f"{error} (to choose your own name: vibro new TEMPLATE -o FILE)"
        ) from error
    if output == "-":
        sys.stdout.write(content)
        return DONE
    path = Path(f"{name}.toml" if output is None else output)
    check_no_folder(path)
    if path.suffix.lower() != ".toml":
        raise CommandError(f"vibro: --output: found {output!r}, expected a .toml file")
    if path.exists() and not force:
        raise CommandError(f"vibro: {path} exists; --force replaces it")
    make_folder(path.parent)
    files = [path]
    is_grid = name in grid_names()
    if is_grid:
        base = base_of(name)
        beside = path.with_name(f"{base}.toml")
        if not beside.exists():
            _write_with_schema(beside, base, text(base))
            files.append(beside)
    _write_with_schema(path, name, content)
    if as_json:
        print(json_text({"file": str(path), "files": [str(one) for one in files]}))
    names = " and ".join(printable(str(one)) for one in files)
    command = "grid" if is_grid else "run"
    say(f"{names} written; solve it with: vibro {command} {in_command(path)}")
    return DONE


def _write_all(folder: Path, force: bool, as_json: bool) -> int:
    """Write the whole gallery, with a subfolder for each system and one for the grids."""
    from vibro_cli.scenario.gallery import whole as whole_gallery
    from vibro_cli.storage.files import make_folder

    files = {folder / path: content for path, content in whole_gallery().items()}
    there = [path for path in files if path.exists()]
    if there and not force:
        raise CommandError(f"vibro: {printable(str(there[0]))} exists; --force replaces it")
    for path, content in files.items():
        make_folder(path.parent)
        _write_with_schema(path, path.stem, content)
    if as_json:
        print(json_text({"folder": str(folder), "files": [str(path) for path in files]}))
    say(f"{len(files)} scenarios and grids written to {printable(str(folder))}")
    return DONE


def _write_with_schema(path: Path, name: str, content: str) -> None:
    """Write the scenario or grid `name` of the gallery, and its JSON Schema beside it.

    The first line of the file names the schema for editors. The schema is written first: after an
    interruption a scenario that exists would be refused.
    """
    from vibro_cli.grids.document import grid_schema
    from vibro_cli.scenario.fields import json_schema
    from vibro_cli.scenario.gallery import base_of, grid_names, system_of
    from vibro_cli.storage.files import check_regular, first_bytes, write_file

    check_regular(path)
    is_grid = name in grid_names()
    system = system_of(base_of(name) if is_grid else name)
    schema = grid_schema(system) if is_grid else json_schema(system)
    beside = path.with_name(f"vibro-{'grid-' if is_grid else ''}{system}.schema.json")
    if not beside.exists() or f'"$id": "{schema["$id"]}"'.encode() in first_bytes(beside, 2000):
        write_file(beside, (json.dumps(schema, indent=2, ensure_ascii=False) + "\n").encode())
    write_file(path, f"#:schema ./{beside.name}\n{content}".encode())


Subject = Literal["scenario", "grid", "tables"]


@dataclass(frozen=True, kw_only=True)
class SchemaCommand:
    """Describe scenarios or grids as JSON Schema, or the tables."""

    subject: Annotated[Subject, typer.Argument(help="What to describe.")] = "scenario"
    system: Annotated[System, typer.Option(help="System of the scenarios or grids.")] = NAMES[0]
    markdown: Annotated[
        bool, typer.Option("--markdown", help="Print the tables as Markdown instead of JSON.")
    ] = False
    as_json: Annotated[bool, json_option(help="Print JSON (the default).")] = False

    def __post_init__(self) -> None:
        if self.system != NAMES[0] and self.subject == "tables":
            raise typer.BadParameter("--system applies to scenarios and grids only")
        if self.markdown and self.as_json:
            raise typer.BadParameter("expected one of --markdown and --json")
        if self.markdown and self.subject != "tables":
            raise typer.BadParameter("--markdown applies to `schema tables` only")

    def __call__(self) -> int:
        """Print the schema, or the tables."""
        from vibro_cli.commands.help import tables
        from vibro_cli.grids.document import grid_schema
        from vibro_cli.scenario.fields import json_schema

        if self.markdown:
            print(tables(), end="")
        elif self.subject == "tables":
            print(json_text(_tables(), indent=2))
        else:
            schema = json_schema if self.subject == "scenario" else grid_schema
            print(json_text(schema(self.system), indent=2))
        return DONE


def _tables() -> dict[str, object]:
    """Return the description of all tables as plain values (`vibro schema tables`)."""
    from vibro_cli.systems import system_named

    return {
        table.schema_id: {
            "row": table.row,
            "columns": [
                {
                    key: getattr(column, key)
                    for key in ("name", "type", "unit", "nullable", "description")
                }
                for column in table.columns
            ],
        }
        for table in system_named("trace").tables()
    }
