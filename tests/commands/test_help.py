"""Help and the reference on the terminal: lines that fit, with all the text of the Markdown."""

import json
import re
from pathlib import Path

import pytest

from tests.commands.conftest import Vibro
from vibro_cli.commands.app import COMMANDS
from vibro_cli.commands.help import TOPICS, as_terminal_text, rows_of
from vibro_cli.mechanics.system import LAWS
from vibro_cli.scenario.fields import json_schema
from vibro_cli.scenario.quantities import UNITS, to_si


def words(text: str) -> list[str]:
    return re.findall(r"\w+", text)


@pytest.mark.parametrize("command", [None, *COMMANDS])
def test_help_fits_a_terminal_and_cuts_nothing_off(vibro: Vibro, command: str | None) -> None:
    text = vibro(*([] if command is None else [command]), "--help").text
    assert max(map(len, text.splitlines())) <= 80
    assert not re.search(r"[\w,;:]\.\.\.$", text, re.MULTILINE)


@pytest.mark.parametrize("topic", TOPICS)
def test_a_topic_fits_a_terminal_and_has_every_word_of_its_markdown(
    vibro: Vibro, topic: str
) -> None:
    text = vibro("help", topic).text
    # Commands are not wrapped, so that they can be copied.
    lines = [line for line in text.splitlines() if not line.startswith("    vibro ")]
    assert max(map(len, lines)) <= 80
    assert not re.search(r"^\||\|$|`", text, re.MULTILINE)
    markdown = vibro("help", topic, "--markdown").text
    dropped = re.sub(r"^(\|[|-]+|```.*)$", "", markdown, flags=re.MULTILINE)
    missing = set(words(dropped)) - set(words(text))
    missing -= {"null", "unit", "default"}  # heads of columns in which nothing stands
    if topic == "papers":  # no room for columns: each row an entry, and no head
        missing -= set(words("| where | what | command | shown by | the papers | here |"))
    assert not missing
    (line,) = vibro("help", topic, "--json").lines
    assert line == {"topic": topic, "text": text}


def test_the_topics_are_listed(vibro: Vibro) -> None:
    lines = vibro("help").text.splitlines()
    assert [line.split()[2] for line in lines] == [*TOPICS, "COMMAND"]
    assert max(len(line) for line in lines if not line.startswith("    vibro ")) <= 80


def test_every_law_and_no_other_is_explained(vibro: Vibro) -> None:
    assert list(LAWS) == sorted(json_schema()["$defs"]["Collision"]["properties"]["law"]["enum"])
    text = vibro("help", "laws").text
    assert all(f"\n{law} " in text for law in LAWS)


def test_every_unit_is_named_and_the_examples_are_understood(vibro: Vibro) -> None:
    text = vibro("help", "units").text
    assert set(UNITS) <= set(re.findall(r"[^\s,.]+", text))
    assert {to_si(one, "acceleration") for one in ("9.81 m s^-2", "9.81 m/s^2")} == {9.81}
    for power in ("s^-2", "s**-2", "s⁻²"):
        assert power in text
        assert to_si(f"1 m {power}", "acceleration") == 1.0


@pytest.mark.parametrize("width", [30, 80, 100])
def test_tables_are_broken_between_words(width: int) -> None:
    rows = [("a", "float64", "few words"), ("a_long_name", "int64", "many words " * 20)]
    table = "| name | type | meaning |\n|---|---|---|\n"
    table += "".join(f"| `{a}` | {b} | {c} |\n" for a, b, c in rows)
    text = as_terminal_text(f"Before.\n\n{table}\nAfter `it`.\n", width)
    assert max(map(len, text.splitlines())) <= width
    assert words(text) == words("Before. " + "name type meaning " * (width > 30) + "".join(
        f"{a} {b} {c} " for a, b, c in rows) + "After it.")  # fmt: skip


def test_a_command_of_the_papers_stands_on_a_line_of_its_own(vibro: Vibro) -> None:
    lines = vibro("help", "papers").text.splitlines()
    for _, _, command, _ in rows_of("A"):
        assert f"    {command}" in lines


def test_a_topic_as_json_may_be_markdown(vibro: Vibro) -> None:
    text = json.loads(vibro("help", "laws", "--json", "--markdown").text)["text"]
    assert text == vibro("help", "laws", "--markdown").text


def test_the_example_of_a_grid_file_is_one(vibro: Vibro) -> None:
    (example,) = re.findall(
        r"```toml\n(.*?)```", vibro("help", "grid-file", "--markdown").text, re.DOTALL
    )
    assert vibro("new", "three_arcs").code == 0
    Path("sweep.toml").write_text(example)
    assert "valid grid of 183 points" in vibro("check", "sweep.toml").text
    assert example in vibro("help", "grid-file").text
