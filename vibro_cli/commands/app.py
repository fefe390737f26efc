"""The command-line application: its commands, and how it parses and runs a command line."""

import os
from collections.abc import Sequence
from functools import partial
from importlib import import_module
from typing import Annotated, Any

import typer

from vibro_cli import __version__
from vibro_cli.commands.shared.error_handling import perform, usage_error
from vibro_cli.commands.shared.options import Task, with_common_options

COMMANDS = (
    "run", "grid", "section", "basins", "orbit", "fit", "portrait", "report", "check", "show",
    "verify", "schema", "new", "stress", "bench", "help",
)  # fmt: skip
"""Each command is a class, such as `RunCommand`, in the module of its name or that in `HOMES`.

The fields of the class are the arguments and options. Its constructor rejects wrong usage before
any file is read or written. Calling an instance runs the command and returns the exit code.
"""
HOMES = {
    "fit": "orbit", "schema": "new", "section": "basins", "stress": "bench", "verify": "check",
}  # fmt: skip
"""Modules of the commands that have no module of their own name."""


EXAMPLES: dict[str, tuple[str, ...]] = {
    "new": (
        "vibro new --list",
        "vibro new three_arcs",
        "vibro new --all",
        "vibro new three_arcs_grid",
        "vibro new falling_balls",
    ),
    "check": (
        "vibro check three_arcs.toml",
        "vibro check three_arcs_grid.toml --json",
    ),
    "run": (
        "vibro run three_arcs.toml",
        "vibro run three_arcs.toml --set collision.k=1 -o outputs/elastic",
        'vibro run three_arcs.toml --set "stop.time=5 s" --format csv > impacts.csv',
        "vibro run --continue outputs/three_arcs --set stop.time=120",
    ),
    "show": (
        "vibro show outputs/three_arcs/summary.parquet",
        "vibro show outputs/three_arcs/collisions.parquet --rows -5 --columns n,t",
    ),
    "report": (
        "vibro report outputs/three_arcs",
        "vibro report outputs/three_arcs --animate film.html --span 0:5",
    ),
    "portrait": (
        "vibro portrait three_arcs.toml",
        "vibro portrait three_arcs.toml --vary 'balls[1].radius=0.05:0.3:6'",
    ),
    "orbit": (
        "vibro orbit falling_balls.toml --impacts 1",
        "vibro orbit falling_balls.toml --impacts 1 --vary 'balls[2].mass=0.8:2.5'",
    ),
    "fit": ("vibro fit three_arcs.toml impacts.csv --free collision.k",),
    "grid": (
        "vibro grid three_arcs_grid.toml --dry-run",
        "vibro grid three_arcs_grid.toml",
        "vibro grid three_arcs_grid.toml --shard 1/2 -o outputs/sharded",
    ),
    "section": (
        "vibro section outputs/three_arcs --column s_a --column speed_a_pre",
        "vibro section outputs/three_arcs_grid --column angle_a --transient 1",
    ),
    "basins": ("vibro basins outputs/three_arcs_grid",),
    "verify": ("vibro verify outputs/three_arcs outputs/three_arcs_grid",),
    "schema": (
        "vibro schema grid > grid.schema.json",
        "vibro schema tables --markdown",
    ),
    "stress": ("vibro stress --only elliptic",),
    "bench": ("vibro bench --references times --scene five_balls",),
    "help": (
        "vibro help laws",
        "vibro help units",
        "vibro help grid",
    ),
}
"""The examples run as one session, in this order and in one folder."""


_NO_TEXTS = "(python -OO removes this text.)" if __doc__ is None else None
"""Help of every command if Python has removed the docstrings, else None: the docstring."""


def epilog(command: str) -> str:
    """Return the examples that end the help of a command; `\\b` keeps their line breaks."""
    return "\b\nExamples:\n" + "\n".join(f"  {line}" for line in EXAMPLES[command])


def application(commands: Sequence[str] = COMMANDS) -> typer.Typer:
    """Return the application with the given commands; import only their modules."""
    app = typer.Typer(
        name="vibro",
        help="Vibro-impact dynamics of bodies rolling along curvilinear traces, solved exactly.",
        epilog="\b\nGetting started:\n  vibro new three_arcs\n  vibro run three_arcs.toml\n"
        "  vibro report outputs/three_arcs\n\n"
        "Exit codes: 0 done, 1 failed, 2 wrong usage or invalid scenario, 3 with --strict: a run "
        "was inadmissible or invalid, 129, 130 or 143 interrupted. More: vibro help",
        context_settings={"help_option_names": ["-h", "--help"]},
        rich_markup_mode=None,
        pretty_exceptions_enable=False,
        callback=main,
    )
    for name in commands:
        module = import_module(f"vibro_cli.commands.{HOMES.get(name, name)}")
        command = getattr(module, f"{name.title()}Command")
        app.command(name, help=_NO_TEXTS, epilog=epilog(name))(with_common_options(command))
    return app


def _print_version(asked: bool) -> None:
    if asked:
        print(f"vibro {__version__}")
        raise typer.Exit


def main(
    version: Annotated[
        bool,
        typer.Option(
            "--version", "-V", help="Print the version.", callback=_print_version, is_eager=True
        ),
    ] = False,
) -> None:
    """Options of the program itself."""


def _parse(arguments: list[str]) -> Task:
    """Parse the command line and return the task, without running it."""
    # Import only the module of this command: importing all takes a tenth of a short run.
    alone = arguments[0] in COMMANDS and arguments[0] != "help"
    app = application(arguments[:1] if alone else COMMANDS)
    try:
        task: Any = app(arguments, prog_name="vibro", standalone_mode=False)
    except typer.TyperException as error:
        command = f"vibro {arguments[0]}" if arguments[0] in COMMANDS else "vibro"
        raise usage_error(error, command) from error
    except SystemExit as end:
        if isinstance(end.__context__, BrokenPipeError):  # the reader closed the pipe of the help
            raise end.__context__ from None
        raise
    return task if callable(task) else lambda: int(task or 0)


def run_command_line(arguments: list[str]) -> int:
    """Run the program with these arguments and return its exit code."""
    return perform(partial(_parse, arguments or ["--help"]), _log_format(arguments))


def _log_format(arguments: list[str]) -> str:
    """Return the format of messages; it is needed before the command line is parsed."""
    chosen = os.environ.get("VIBRO_LOG_FORMAT", "text")
    for option, value in zip(arguments, [*arguments[1:], ""], strict=False):
        if option == "--log-format":
            chosen = value
        elif option.startswith("--log-format="):
            chosen = option.partition("=")[2]
    return chosen
