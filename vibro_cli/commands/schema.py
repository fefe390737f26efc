"""`vibro schema`: the form of scenarios as JSON Schema, and the description of the tables."""

from functools import partial
from typing import Annotated, Literal

import typer

from vibro_cli.commands.boundary import DONE
from vibro_cli.commands.options import Task
from vibro_cli.commands.streams import json_text

Subject = Literal["scenario", "tables"]
System = Literal["trace", "table", "springs"]


def schema(
    subject: Annotated[Subject, typer.Argument(help="What to describe.")] = "scenario",
    system: Annotated[System, typer.Option(help="Of which system's scenarios.")] = "trace",
    markdown: Annotated[
        bool, typer.Option("--markdown", help="Print the tables for reading, not as JSON.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON, as without it.")] = False,
) -> Task:
    """Describe the form of scenarios, or the tables."""
    if system != "trace" and subject != "scenario":
        raise typer.BadParameter("--system is of scenarios; expected `schema scenario`")
    if markdown and as_json:
        raise typer.BadParameter("expected one of --markdown and --json")
    if markdown and subject != "tables":
        raise typer.BadParameter("--markdown describes the tables; expected `schema tables`")
    return partial(_print_schema, subject, system, markdown)


def _print_schema(subject: Subject, system: System, markdown: bool) -> int:
    if subject == "scenario":
        from vibro_cli.scenario.json_schema import json_schema

        print(json_text(json_schema(system), indent=2))
        return DONE
    from vibro_cli.storage.schema import as_json, as_markdown

    if markdown:
        print(as_markdown(), end="")
    else:
        print(json_text(as_json(), indent=2))
    return DONE
