"""The application: its commands, and how a command line becomes an exit code."""

import os
from functools import partial
from typing import Annotated, Any

import typer

from vibro_cli import __version__
from vibro_cli.commands.bench import bench
from vibro_cli.commands.boundary import perform
from vibro_cli.commands.check import check
from vibro_cli.commands.grid import grid
from vibro_cli.commands.help import help_command
from vibro_cli.commands.new import new
from vibro_cli.commands.options import with_common_options
from vibro_cli.commands.portrait import portrait
from vibro_cli.commands.report import report
from vibro_cli.commands.run import run
from vibro_cli.commands.schema import schema
from vibro_cli.commands.show import show
from vibro_cli.commands.stress import stress
from vibro_cli.commands.usage import usage_error
from vibro_cli.commands.verify import verify
from vibro_cli.commands.warm import warm

app = typer.Typer(
    name="vibro",
    help="Vibro-impact dynamics of bodies rolling along curvilinear traces, solved exactly.",
    epilog="Exit codes: 0 done, 1 failed, 2 wrong usage or invalid scenario, 3 not strict "
    "(--strict), 129, 130 and 143 interrupted. More: vibro help",
    context_settings={"help_option_names": ["-h", "--help"]},
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)
for command in (
    run, grid, portrait, report, check, show, verify, schema, new, stress, bench, warm,
):  # fmt: skip
    app.command(command.__name__)(with_common_options(command))
app.command("help")(with_common_options(help_command))


def _print_version(asked: bool) -> None:
    if asked:
        print(f"vibro {__version__}")
        raise typer.Exit


@app.callback()
def main(
    version: Annotated[
        bool,
        typer.Option(
            "--version", "-V", help="Print the version.", callback=_print_version, is_eager=True
        ),
    ] = False,
) -> None:
    """Options of the program itself."""


def _parse_and_run(arguments: list[str]) -> int:
    """Read the command line, then do what it says; the commands only say what is to be done."""
    try:
        task: Any = app(arguments, prog_name="vibro", standalone_mode=False)
    except typer.TyperException as error:
        raise usage_error(error) from error
    except typer.Abort as error:
        raise KeyboardInterrupt from error
    return int(task()) if callable(task) else int(task or 0)


def run_command_line(arguments: list[str]) -> int:
    """Run the program with these arguments and return its exit code."""
    return perform(partial(_parse_and_run, arguments or ["--help"]), _log_format(arguments))


def _log_format(arguments: list[str]) -> str:
    """The form of words, known before the rest of the command line is understood."""
    chosen = os.environ.get("VIBRO_LOG_FORMAT", "text")
    for option, value in zip(arguments, [*arguments[1:], ""], strict=False):
        if option == "--log-format":
            chosen = value
        elif option.startswith("--log-format="):
            chosen = option.partition("=")[2]
    return chosen
