"""`vibro schema`: scenarios and grids as JSON Schema, and the description of the tables."""

from functools import partial
from typing import TYPE_CHECKING, Annotated, Literal, TypeAlias

import typer

from vibro_cli.commands.boundary import DONE
from vibro_cli.commands.options import Task
from vibro_cli.commands.streams import json_text
from vibro_cli.systems import NAMES

Subject = Literal["scenario", "grid", "tables"]
if TYPE_CHECKING:
    System: TypeAlias = str
else:
    System = Literal[NAMES]


def schema(
    subject: Annotated[Subject, typer.Argument(help="What to describe.")] = "scenario",
    system: Annotated[System, typer.Option(help="Of which system's scenarios or grids.")] = NAMES[
        0
    ],
    markdown: Annotated[
        bool, typer.Option("--markdown", help="Print the tables for reading, not as JSON.")
    ] = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print JSON, which is the default.")
    ] = False,
) -> Task:
    """Describe scenarios or grids as JSON Schema, or the tables."""
    if system != NAMES[0] and subject == "tables":
        raise typer.BadParameter("--system is of scenarios and grids; expected one of these")
    if markdown and as_json:
        raise typer.BadParameter("expected one of --markdown and --json")
    if markdown and subject != "tables":
        raise typer.BadParameter("--markdown describes the tables; expected `schema tables`")
    return partial(_print_schema, subject, system, markdown)


def _print_schema(subject: Subject, system: str, markdown: bool) -> int:
    if subject == "scenario":
        from vibro_cli.scenario.json_schema import json_schema

        print(json_text(json_schema(system), indent=2))
        return DONE
    if subject == "grid":
        from vibro_cli.grids.json_schema import grid_schema

        print(json_text(grid_schema(system), indent=2))
        return DONE
    from vibro_cli.storage.schema import as_json, as_markdown

    if markdown:
        print(as_markdown(), end="")
    else:
        print(json_text(as_json(), indent=2))
    return DONE
