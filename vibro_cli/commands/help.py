"""`vibro help`: the reference on the terminal."""

from dataclasses import dataclass
from typing import Annotated, Any

import typer

from vibro_cli.commands.shared.error_handling import DONE, CommandError, suggestion
from vibro_cli.commands.shared.reference import TOPICS, commands
from vibro_cli.commands.shared.terminal import as_terminal_text, json_text, terminal_width


def help_topics(incomplete: str) -> list[str]:
    """Topics that begin so, for the shell."""
    return [topic for topic in TOPICS if topic.startswith(incomplete)]


@dataclass(frozen=True, kw_only=True)
class HelpCommand:
    """Print the reference of a topic, or the help of a command. Without either: the topics."""

    context: typer.Context
    topic: Annotated[
        str | None,
        typer.Argument(
            help="A topic, or a command.", show_default=False, autocompletion=help_topics
        ),
    ] = None
    markdown: Annotated[
        bool, typer.Option("--markdown", help="Print a topic as Markdown, not for the terminal.")
    ] = False
    as_json: Annotated[bool, typer.Option("--json", help="Print topic and text as JSON.")] = False

    def __call__(self) -> int:
        """Print what is asked for."""
        program = self.context.parent
        text = _text(self.topic, program)
        if self.topic in TOPICS and not self.markdown:
            text = as_terminal_text(text, terminal_width())
        if self.as_json:
            print(json_text({"topic": self.topic, "text": text}))
        else:
            print(text, end="")
        return DONE


def _text(topic: str | None, program: Any) -> str:
    """What is known of a topic, Markdown, or of a command, as `--help` prints it."""
    if topic is None:
        listed = [f"vibro help {name:14} {what}\n" for name, (what, _) in TOPICS.items()]
        return "".join(listed) + "vibro help COMMAND        as vibro COMMAND --help\n"
    if topic in TOPICS:
        text = TOPICS[topic][1]
        return commands(program) if text is None else text()
    if topic in program.command.commands:
        command = program.command.commands[topic]
        with command.make_context(topic, [], parent=program, resilient_parsing=True) as context:
            return str(command.get_help(context)) + "\n"
    known = [*TOPICS, *program.command.commands]
    raise CommandError(
        f"vibro: no help on {topic!r}{suggestion(topic, known)}, expected one of {', '.join(known)}"
    )
