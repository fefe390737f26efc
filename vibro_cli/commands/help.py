"""`vibro help`: the reference on the terminal.

Each topic is generated once, as Markdown. `vibro help TOPIC` prints it, and docs/ contains it
between markers; a test keeps the two equal.
"""

import re
import shutil
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import groupby
from typing import TYPE_CHECKING, Annotated, Any

import typer

from vibro_cli.commands.shared.error_handling import DONE, EXIT_CODES, CommandError, suggestion
from vibro_cli.commands.shared.options import COMMON, json_option
from vibro_cli.commands.shared.terminal import COLUMNS, json_text, wrapped
from vibro_cli.systems import NAMES as SYSTEMS

if TYPE_CHECKING:
    from vibro_cli.systems.contract import PaperRow, System

ENVIRONMENT = {
    "VIBRO_ENGINE": "`--engine` of every command that has it",
    "VIBRO_FIGURES": "`--figures` of `vibro run`; `0`: same as `--no-figures`",
    "VIBRO_STRICT": "`1`: same as `--strict`",
    "VIBRO_WORKERS": "`--workers` of `vibro grid`",
    "VIBRO_DASK": "`--dask` of `vibro grid`",
    "VIBRO_LOG_FORMAT": "`--log-format` of every command",
    "NO_COLOR": "no effect: the output is never coloured",
}


def commands(program: Any) -> str:
    """Return all commands and their options; `program` is the context of the main command."""
    every = program.command.commands
    rows = [
        (f"`{' '.join(['vibro', name, *_arguments(command)])}`", _cell(command.help))
        for name, command in every.items()
    ]
    parts = [markdown_table(("command", "what it does"), rows)]
    common = [option for option in _options(every["help"]) if option.name in COMMON]
    tables = {"Every command": common}
    for name, command in every.items():
        own = [option for option in _options(command) if option.name not in COMMON]
        tables |= {f"`vibro {name}`": own} if own else {}
    for title, options in tables.items():
        rows = [(_names(option, program), _meaning(option)) for option in options]
        parts += [f"{title}:", markdown_table(("option", "meaning"), rows)]
    return "\n\n".join(parts) + "\n"


def _arguments(command: Any) -> Iterator[str]:
    for parameter in command.params:
        if parameter.param_type_name == "argument":
            name = parameter.metavar or parameter.name.upper()
            yield f"{name}…" if parameter.nargs == -1 else name


def _options(command: Any) -> Iterator[Any]:
    for parameter in command.params:
        if parameter.param_type_name == "option" and not parameter.hidden:
            yield parameter


def _names(option: Any, program: Any) -> str:
    """Return the names of an option with the placeholder of its value."""
    names = ", ".join(f"`{name}`" for name in (*option.opts, *option.secondary_opts))
    if option.is_flag:
        return names
    takes = option.metavar or option.display_type(program).strip("<>")
    return f"{names} `{_cell(takes)}`"


def _meaning(option: Any) -> str:
    variable = f" [`{option.envvar}`]" if isinstance(option.envvar, str) else ""
    return _cell(option.help) + variable


def _cell(text: str | None) -> str:
    """Return a text as a table cell; quote words in angle brackets, which would be HTML."""
    line = " ".join((text or "").split()).replace("|", "\\|")
    return re.sub(r"[\w/]*<\w+>", lambda found: f"`{found[0]}`", line)


def scenario(system: str = "trace", below: str = "") -> str:
    """Return the keys of a system's scenarios, all or below a path, from their JSON Schema."""
    from vibro_cli.scenario.fields import json_schema

    return _table_of_keys(json_schema(system), below)


def _table_of_keys(schema: dict[str, Any], below: str = "") -> str:
    """Return the keys of a JSON Schema, all or below a path, with default and meaning."""
    from vibro_cli.scenario.fields import keys_of

    rows = [
        (f"`{path}`", "required" if needed else _default(node), _cell(node.get("description")))
        for path, node, needed in keys_of(schema)
        if path.startswith(below) and not path.endswith("[i]")
    ]
    return markdown_table(("key", "default", "meaning"), rows) + "\n"


def _default(node: dict[str, Any]) -> str:
    default = node.get("default")
    if default is None or isinstance(default, dict):
        return ""
    return f"`{str(default).lower() if isinstance(default, bool) else default}`"


def tables(system: str = "trace") -> str:
    """Return the tables of a system and their columns."""
    from vibro_cli.systems import system_named

    parts = []
    for table in system_named(system).tables():
        rows = [
            (f"`{c.name}`", c.type, c.unit, "yes" if c.nullable else "", c.description)
            for c in table.columns
        ]
        parts.append(f"`{table.file}.parquet`: each row is {table.row}.")
        parts.append(markdown_table(("column", "type", "unit", "null", "meaning"), rows))
    return "\n\n".join(parts) + "\n"


def of_system(system: str) -> str:
    """Return the keys of a system's scenarios and the columns of its tables."""
    return f"{scenario(system)}\n{tables(system)}"


_GRID = """A grid file (TOML, JSON or YAML) names a scenario, or has one inline, and the axes that
change it. Any scalar of the scenario, number or word, may be on an axis; numbers may have units.

```toml
base = "three_arcs.toml"   # relative to the folder of this file

[[axes]]                   # in a product, the last axis changes fastest
path = "balls[1].angle"
linspace = ["-80 deg", "-50 deg", 61]

[[axes]]
path = "collision.k"
values = [1.0, 0.9, 0.8]

[keep]
collisions = true          # every impact too, not only summaries
```

"""


def grid_file() -> str:
    """Return the description of grid files and their keys, without those of inline scenarios."""
    from vibro_cli.grids.document import grid_schema

    schema = grid_schema()
    schema["properties"]["scenario"] = {
        "description": schema["properties"]["scenario"]["description"]
    }
    return _GRID + _table_of_keys(schema)


def laws() -> str:
    """Return the impact laws and the treatment of inadmissible impacts."""
    from vibro_cli.mechanics.system import LAWS

    rows = [(f"`{name}`", law.statement) for name, law in LAWS.items()]
    return f"""Two neighbours collide when their centres are r_a + r_b apart and approach each
other. `collision.law` is one of these, `collision.k` the coefficient of restitution from 0 to 1;
⁻ is before the impact, ⁺ after it, ω the angular velocity of rolling, v the speed of the centre,
κ = 1 + J_C/(m r²).

{markdown_table(("law", "what it says"), rows)}

Under all laws but `normal-impulse`, bodies of unequal radii, or of equal radii on two pieces of the
trace, may still be approaching each other after the impact: they would pass through one another.
Every impact is checked for this. Such an impact is inadmissible: the run ends there
(`collision.inadmissible = "stop"`, the default), or `normal-impulse` is used for that impact, which
is marked (`collision.inadmissible = "normal-impulse"`).
"""


def units() -> str:
    """Return the units in which numbers may be given."""
    from vibro_cli.scenario.quantities import DIMENSIONS, SI, UNITS

    rows = []
    for quantity, dimension in DIMENSIONS.items():
        own = [name for name, unit in UNITS.items() if unit.dimension == dimension]
        names = " ".join(f"`{name}`" for name in own if name != SI[quantity])
        rows.append((quantity, f"`{SI[quantity]}`", names))
    dimensions = set(DIMENSIONS.values())
    others = [name for name, unit in UNITS.items() if unit.dimension not in dimensions]
    return f"""A number without a unit is in SI units, an angle in radians. A number with a
dimension may also be given as text with its unit, such as `"60 deg"`, `"7.8 g/cm^3"` or `"30 rpm"`;
it is converted exactly and rounded once. On the command line it needs no quotation marks of its
own: `--set "balls[1].angle=-60 deg"`.

{markdown_table(("quantity", "SI", "also"), rows)}

Units are combined by a space, `*` or `/`, which divides by the next unit only, with powers such as
`s^-2`, `s**-2` or `s⁻²`: `9.81 m s^-2` and `9.81 m/s^2` are the same. In combinations these
are also accepted: {", ".join(f"`{name}`" for name in others)}.
"""


def exit_codes() -> str:
    """Return the meanings of the exit codes."""
    rows = [(str(code), text) for code, text in EXIT_CODES.items()]
    return markdown_table(("exit code", "meaning"), rows) + "\n"


def environment() -> str:
    """Return the environment variables that the program reads."""
    rows = [(f"`{name}`", text) for name, text in ENVIRONMENT.items()]
    return markdown_table(("variable", "meaning"), rows) + "\n"


def figures() -> str:
    """Return the kinds of figures: of the runs of each system, and of grids."""
    from vibro_cli.figures.kinds import GRID_KINDS

    kinds: dict[str, tuple[str, list[str]]] = {}
    for system in _systems():
        for key, kind in system.figures.items():
            title = re.sub(r" body$", " each body", kind.title)
            kinds.setdefault(key, (title, []))[1].append(system.name)
    of_runs = [(f"`{key}`", title, ", ".join(of)) for key, (title, of) in kinds.items()]
    of_grids = [(f"`{key}`", kind.title, kind.needs) for key, kind in GRID_KINDS.items()]
    run = markdown_table(("figure", "shows", "of"), of_runs)
    grid = markdown_table(("figure", "shows", "drawn if"), of_grids)
    return f"Of a run:\n\n{run}\n\nOf a grid:\n\n{grid}\n"


LETTERS = "ABCD"
"""Letters of the papers."""
SYMBOLS: tuple[tuple[str, str, str], ...] = (
    ("bodies 1, 2", "`a` and `b` of a row, the left and the right one; `ball_a`, `ball_b`", ""),
    ("t₀: arrival, impact", "`_pre`; on a table `arrival_`", ""),
    ("t₀ + τ: outgoing", "`_post`; on a table `outgoing_`", ""),
    ("φ_i in valleys, φ₂ on the hump", "`angle_a`, `angle_b`: φ, ψ", "rad"),
    ("φ̇_i", "`rate_a_pre`, …", "rad/s"),
    ("ω_P", "`omega_a_pre`, … (about the contact point P)", "rad/s"),
    ("v_C", "`speed_a_pre`, …", "m/s"),
    ("representative points N", "marks of `portrait`, `energy_portrait`", ""),
    ("T₀, T₁₂, T₁₃; α", "`contact_points`; `arrival_angle`", "rad"),
    ("J_P = κ m r², κ = 1 + i_C²/r²", "J_P, κ of `vibro check`", "kg m², –"),
    ("k, coefficient of restitution", "`collision.k`", "–"),
    ("ω_i² = 2g/κ(R − r)", "`omega_squared` of `vibro check --json`", "1/s²"),
    ("k_i, modulus", "`modulus` of `vibro check --json`", "–"),
    ("β, λ₁, λ₂", "`beta`, `lambda_1`, `lambda_2` of `vibro check --json`", "rad, –"),
    ("E_k(t₀), E_k(t₀ + τ)", "`kinetic_energy_a_pre`, …", "J"),
    ("E_i = const", "`energy_a_pre`, …", "J"),
    ("ΔE_k", "`energy_loss`", "J"),
    ("K = ∫F dt", "`impulse`", "N s"),
    ("L, moment of impulse", "`impulse_moment`", "N m s"),
    ("oscillatory, progressive", "`regime_a_pre`, …; on a table always progressive: no force", ""),
    ("homoclinic “eight”", "`eight_a_pre`, …; orange in `energy_portrait`", ""),
    ("time between impacts", "`dt`", "s"),
)  # fmt: skip

_NOT_SOLVED = """Not solved, and refused: two balls on two curvilinear traces, parallel or crossing
(conclusions of A and B). Their line of centres leaves the planes of both traces, and the papers'
law, which acts on the angular velocities alone, says nothing about that direction; with unequal
radii it would generally be inadmissible. A scenario has one trace; straight ones, parallel or
crossing, are a table (`vibro help table-system`). Mentioned in the papers only, and not solved:
deformable balls, bearings, dampers, and Coulomb friction beside impact limiters.
"""


_BEFORE = """\
The commands read the gallery from the folder `scenarios/` (`vibro new --all` writes it); some read
results of those above."""


def papers() -> str:
    """Return the figures and equations of the papers with the commands for them; the symbols."""
    parts = [_BEFORE]
    for letter in LETTERS:
        cells = [(where, what, f"`{run}`", shown) for where, what, run, shown in rows_of(letter)]
        parts += [
            f"Paper {letter}:",
            markdown_table(("where", "what", "command", "shown by"), cells),
        ]
    own = [symbol for kind in _systems() for symbol in kind.shown_of_papers.symbols]
    symbols = markdown_table(("the papers", "here", "unit"), (*SYMBOLS, *own))
    return "\n\n".join([*parts, "Symbols:", symbols, _NOT_SOLVED])


def rows_of(letter: str) -> "list[PaperRow]":
    """Return the figures and equations of a paper that are shown, system by system."""
    return [row for kind in _systems() for row in kind.shown_of_papers.rows.get(letter, ())]


def _systems() -> "list[System]":
    from vibro_cli.systems import system_named

    return [system_named(name) for name in SYSTEMS]


TOPICS: dict[str, tuple[str, Callable[[], str] | None]] = {
    "commands": ("every command and its options", None),
    "scenario": ("the keys of a scenario", scenario),
    "grid-file": ("the keys of a grid file", grid_file),
    "units": ("the units in which numbers may be given", units),
    "laws": ("the impact laws, and inadmissible impacts", laws),
    "tables": ("the columns of the tables", tables),
    "turning": ("keys of a rotating trace", partial(scenario, below="trace.turning")),
    **{
        f"{name}-system": (f'keys and tables of system = "{name}"', partial(of_system, name))
        for name in SYSTEMS[1:]
    },
    "figures": ("the kinds of figures", figures),
    "papers": ("the papers' figures and formulas, and their commands", papers),
    "exit-codes": ("what the exit codes mean", exit_codes),
    "environment": ("the environment variables that are read", environment),
}


def help_topics(incomplete: str) -> list[str]:
    """Return the topics that begin with a text, for completion in the shell."""
    return [topic for topic in TOPICS if topic.startswith(incomplete)]


@dataclass(frozen=True, kw_only=True)
class HelpCommand:
    """Print the reference on a topic or the help of a command. List the topics by default."""

    context: typer.Context
    topic: Annotated[
        str | None,
        typer.Argument(
            help="A topic, or a command.", show_default=False, autocompletion=help_topics
        ),
    ] = None
    markdown: Annotated[
        bool, typer.Option("--markdown", help="Print a topic as Markdown instead of plain text.")
    ] = False
    as_json: Annotated[bool, json_option(help="Print the topic and its text as JSON.")] = False

    def __call__(self) -> int:
        """Print the topic, the help of the command, or the list of topics."""
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
    """Return the Markdown of a topic, or the `--help` text of a command."""
    if topic is None:
        listed = [f"vibro help {name:14} {what}\n" for name, (what, _) in TOPICS.items()]
        return "".join(listed) + "vibro help COMMAND        same as vibro COMMAND --help\n"
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


_WIDEST = 100
# Minimum width of the last column of a table, the only one whose cells are wrapped.
_LEAST_TEXT = 28
_BETWEEN = 2
_CELL = re.compile(r"(?<!\\)\|")


def terminal_width() -> int:
    """Return the width of the terminal, within limits, or the default width if there is none."""
    if not sys.stdout.isatty():
        return COLUMNS
    return min(max(shutil.get_terminal_size().columns, COLUMNS // 2), _WIDEST)


def as_terminal_text(markdown: str, width: int) -> str:
    """Convert the reference's Markdown (tables, paragraphs and code) to plain text."""
    lines: list[str] = []
    within_code = False
    for kind, group in groupby(markdown.splitlines(), key=_kind):
        block = list(group)
        if kind == "fence":
            within_code = not within_code
        elif kind == "table" and not within_code:
            lines += _table([_cells(row) for row in block], width)
        elif kind == "text" and not within_code:
            lines += wrapped(_plain(" ".join(block)), width=width)
        else:
            lines += block
    return "\n".join(lines) + "\n"


def _kind(line: str) -> str:
    """Return the kind of a Markdown line: fence, table or text; "" for an empty line."""
    if line.startswith("```"):
        return "fence"
    if line.startswith("|"):
        return "table"
    return "text" if line.strip() else ""


def _plain(text: str) -> str:
    """Return a text without Markdown markup."""
    return text.replace("`", "").replace("\\|", "|")


def _cells(row: str) -> list[str]:
    return [_plain(cell.strip()) for cell in _CELL.split(row)[1:-1]]


def markdown_table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """Return a table in Markdown."""
    names = list(head)
    lines = [f"| {' | '.join(row)} |" for row in (names, *rows)]
    return "\n".join([lines[0], f"|{'---|' * len(names)}", *lines[1:]])


def _table(rows: Sequence[Sequence[str]], width: int) -> Iterator[str]:
    """Yield the lines of a table (head, rule, body), in columns if the width allows."""
    head, body = rows[0], rows[2:]
    used = [n for n, name in enumerate(head) if any(row[n] for row in body)]
    *short, last = used
    widths = [max(len(row[n]) for row in [head, *body]) for n in short]
    # Longer cells of the first column get a line of their own.
    widths[0] = min(widths[0], width // 3)
    offset = sum(widths) + _BETWEEN * len(widths)
    if width - offset < _LEAST_TEXT:
        yield from _entries(body, short, last, width)
        return
    for row in [head, *body]:
        cells = [row[n] for n in short]
        text = wrapped(row[last], width=width - offset) or [""]
        if len(cells[0]) > widths[0]:
            yield cells[0]
            cells[0] = ""
        start = "".join(c.ljust(w + _BETWEEN) for c, w in zip(cells, widths, strict=True))
        yield (start + text[0]).rstrip()
        yield from (" " * offset + line for line in text[1:])


def _entries(
    body: Sequence[Sequence[str]], short: Sequence[int], last: int, width: int
) -> Iterator[str]:
    """Yield a table that is too wide for columns: each row on one line, its text below.

    A command has its own, unbroken line, so that it can be copied.
    """
    for row in body:
        cells = [row[n] for n in short if row[n]]
        commands = [cell for cell in cells if cell.startswith("vibro ")]
        words = "  ".join(cell for cell in cells if cell not in commands)
        yield from wrapped(words, "", "    ", width)
        yield from (f"    {command}" for command in commands)
        yield from wrapped(row[last], "    ", "    ", width)
