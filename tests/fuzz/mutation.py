"""Scenarios broken at random but reproducibly: the seeds, and the mutations."""

import json
import random
from functools import cache
from pathlib import Path
from typing import Any

from vibro_cli.scenario import load_any

TESTS = Path(__file__).parents[1]
FORMS = ("toml", "json", "yaml")
CHANGES_AT_ONCE = (1, 1, 1, 2, 3, 5, 8)
# Values at which parsers, numbers and units are known to fail.
WORDS = (
    "1e-3", "1e309", "-0.0", "nan", "inf", "1_0", "0x10", "010", "9" * 400, "null", "true", "yes",
    "~", "{}", "[]", "[", "]", "{", "}", "=", ":", ",", "\n", "\t", "\r\n", "\x00", "\ufeff", "'''",
    '"""', '"', "'", "#", "&a ", "*a", "<<: *a", "!!python/object ", "---\n", "...", "|\n", ">-\n",
    "%YAML 1.1\n", "\\u0000", "\\ud800", "é", "π", "60 deg", "7.8 g/cm^3", "1 furlong",
    "[[balls]]\n", "[trace]\n", "a.b.c = 1\n", "1979-05-27", "[" * 40, "{a=" * 40, "- " * 40,
    "gravity", "angle", "touching", "previous", "wall", "through_arc", "system", "table", "springs",
    "ellipse", "vertices", "stiffness", "9.81", "-1.2", "1e308",
    "4.9e-324",
)  # fmt: skip


@cache
def seeds(form: str) -> tuple[str, ...]:
    """Return the corpus of a form: the gallery, and every bad scenario that is a file."""
    suffixes = {"yaml": (".yaml", ".yml")}.get(form, (f".{form}",))
    folders = (TESTS / "bad_scenarios", TESTS / "impossible_scenarios")
    paths = [path for folder in folders for path in sorted(folder.iterdir())]
    texts = [_text(path) for path in paths if path.suffix in suffixes]
    gallery = TESTS.parent / "scenarios"
    for path in sorted([*gallery.glob("*.toml"), *gallery.glob("*/*.toml")]):
        if path.parent.name == "grids":
            continue
        resolved = load_any(path).resolved()
        texts.append(
            {"toml": _text(path), "json": json.dumps(resolved, indent=1), "yaml": _yaml(resolved)}[
                form
            ]
        )
    return tuple(text for text in texts if len(text) < 20_000)


def _text(path: Path) -> str:
    return path.read_bytes().decode(errors="replace")


def _yaml(value: Any, indent: int = 0) -> str:
    """Plain data in YAML's block form."""
    pad = " " * indent
    if isinstance(value, dict) and value:
        return "".join(f"{pad}{key}:{_below(item, indent)}" for key, item in value.items())
    if isinstance(value, list) and value:
        return "".join(f"{pad}-{_below(item, indent)}" for item in value)
    return f"{pad}{json.dumps(value)}\n"


def _below(item: Any, indent: int) -> str:
    if isinstance(item, (dict, list)) and item:
        return "\n" + _yaml(item, indent + 2)
    return " " + json.dumps(item) + "\n"


def mutated(form: str, number: int) -> str:
    """The text of a form with this number."""
    chance = random.Random(f"{form} {number}")
    text = chance.choice(seeds(form))
    for _ in range(chance.choice(CHANGES_AT_ONCE)):
        text = chance.choice(CHANGES)(chance, text, form)
    return text


def _span(chance: random.Random, text: str) -> tuple[int, int]:
    start = chance.randint(0, len(text))
    return start, min(len(text), start + chance.choice((1, 1, 2, 5, 20, 100)))


def _insert(chance: random.Random, text: str, form: str) -> str:
    place = chance.randint(0, len(text))
    return text[:place] + chance.choice(WORDS) + text[place:]


def _replace(chance: random.Random, text: str, form: str) -> str:
    start, end = _span(chance, text)
    return text[:start] + chance.choice(WORDS) + text[end:]


def _delete(chance: random.Random, text: str, form: str) -> str:
    start, end = _span(chance, text)
    return text[:start] + text[end:]


def _repeat(chance: random.Random, text: str, form: str) -> str:
    start, end = _span(chance, text)
    return text[:end] + text[start:end] * chance.choice((1, 2, 10, 100)) + text[end:]


def _letter(chance: random.Random, text: str, form: str) -> str:
    place = chance.randint(0, len(text))
    letter = chr(chance.choice((chance.randint(0, 127), chance.randint(128, 0xD7FF))))
    return text[:place] + letter + text[place + 1 :]


def _splice(chance: random.Random, text: str, form: str) -> str:
    other = chance.choice(seeds(form))
    return text[: chance.randint(0, len(text))] + other[chance.randint(0, len(other)) :]


def _digits(chance: random.Random, text: str, form: str) -> str:
    """Replace a number by another, so that the text often stays valid."""
    places = [place for place, letter in enumerate(text) if letter.isdigit()]
    if not places:
        return text
    place = chance.choice(places)
    return text[:place] + chance.choice(("0", "1", "9", "-1", "1e3", "0.5")) + text[place + 1 :]


CHANGES = (_insert, _replace, _delete, _repeat, _letter, _splice, _digits, _digits)
