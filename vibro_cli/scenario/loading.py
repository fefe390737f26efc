"""Read scenarios from files, texts or plain data, and report all their faults.

Values can be overridden, as on the command line: `balls[1].angle=-60 deg`.
"""

from __future__ import annotations

import datetime
import re
import sys
import tomllib
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, TypeVar, cast

from pydantic import ValidationError

from vibro_cli.scenario import fields, forms
from vibro_cli.scenario.base import AnyScenario, model_of, plain
from vibro_cli.scenario.forms import MOST_BYTES, Source, check_toml, line_and_column
from vibro_cli.scenario.models import Scenario
from vibro_cli.scenario.problems import (
    A_PATH,
    Fault,
    FormError,
    KeyPath,
    Place,
    Problem,
    ScenarioError,
    in_order,
    parsed_path,
    path_text,
    shortened,
    shown,
)

# TOML needs a digit on both sides of a decimal point; overrides may omit one.
_BARE_POINT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+\.)([eE][-+]?[0-9]+)?", re.ASCII)

Override = tuple[KeyPath, Any]
"""Path and new value."""


def parse(text: str) -> Override:
    """Return the override given by a text `path=value`.

    The value is in TOML (`0.8`, `"0.4 m"`, `[1, 0.9]`, `{wall = 0.8}`); any other text is taken
    literally (`hedrih`, `-60 deg`), and an empty one and `null` as None. Raises `Fault` if there is
    no `=`, or no path before it.
    """
    path, equals, value = text.partition("=")
    if not equals:
        raise Fault((), shown(text), "path=value, such as balls[1].angle=-1.2")
    value = value.strip()
    return path_of(path), None if value in ("", "null") else parse_value(value)


def path_of(text: str) -> KeyPath:
    """Return the parts of a path, counted from 0; raises `Fault` if the text is not a path."""
    try:
        return parsed_path(text)
    except ValueError:
        raise Fault((), shown(text), A_PATH) from None


def parse_value(text: str) -> Any:
    """Return the value of a text: a TOML value, a number such as .5 or 2., or the text itself."""
    try:
        check_toml(f"value = {text}")
        table = tomllib.loads(f"value = {text}")
    except (FormError, ValueError, RecursionError):
        return float(text) if _BARE_POINT.fullmatch(text) else text
    value = table["value"]
    dated = isinstance(value, (datetime.date, datetime.time))
    return text if len(table) > 1 or dated else value


def apply(
    data: dict[str, Any], path: KeyPath, value: Any, given: Collection[KeyPath] = ()
) -> dict[str, Any]:
    """Return a copy of a scenario's data with one value changed.

    Missing tables are created. Of keys that exclude one another (`density` and `mass`) the new one
    replaces the other, unless that was also `given` by an override. Raises `Fault` if a scenario
    has no such path, or the path has an index beyond the end of a list.
    """
    changed = dict(data)  # what the path does not lead through stays shared
    root = model_of(data)
    if path[:2] == ("collision", "k") and len(path) == 3 and "collision" in data:
        # A single k becomes a list, so that the k of one pair can be changed.
        changed["collision"] = root.prepared(data)["collision"]
    place: Any = changed
    for depth in range(len(path) - 1):
        entered = copy(_entered(place, path, depth, root))
        place[path[depth]] = entered
        place = entered
    _check_step(place, path, root)
    for group in root.alternatives if isinstance(place, dict) else ():
        for other in group if path[-1] in group else ():
            if (*path[:-1], other) not in given:
                place.pop(other, None)
    place[path[-1]] = value
    return changed


def _entered(place: Any, path: KeyPath, depth: int, root: type[AnyScenario]) -> Any:
    """Return the table or list at one step of a path, created if it is a missing table."""
    part, here = path[depth], path[: depth + 1]
    _check_step(place, here, root)
    following = path[depth + 1]
    if isinstance(part, int):
        return place[part]
    if isinstance(following, int):
        _check_list(place.get(part), here)
    elif isinstance(place.get(part), list):
        count = len(place[part])
        expected = f"a number from 1 to {count} after it: {path_text(here)}[1].{following}"
        raise Fault(here, path_text(here), expected)
    elif not isinstance(place.get(part), dict):
        if fields.model_at(here, root) is None:
            raise Fault(here, f"{path_text(here)} as a table", "a single value")
        place[part] = {}
    return place[part]


def _check_step(place: Any, path: KeyPath, root: type[AnyScenario]) -> None:
    """Check that the last part of a path is a key of its table or an index of its list."""
    part = path[-1]
    if isinstance(part, int):
        _check_list(place, path[:-1])
        if part >= len(place):
            found = f"{path_text(path)} of {len(place)}"
            raise Fault(path, found, f"a number from 1 to {len(place)}")
    elif not isinstance(place, dict) or part not in fields.known_keys(path[:-1], root):
        raise fields.unknown_key(path, root)


def _check_list(value: Any, path: KeyPath) -> None:
    if not isinstance(value, list) or not value:
        found = f"{path_text(path)} as a list" if value is None else shown(value)
        raise Fault(path, found, f"a value of {path_text(path)} as a whole")


FORMS = {".toml": "toml", ".json": "json", ".yaml": "yaml", ".yml": "yaml"}
"""Format of a file, by suffix."""

Changed = TypeVar("Changed", bound=AnyScenario)

_STANDARD_INPUT = "<stdin>"


@dataclass(frozen=True)
class Document:
    """Data that were read, and their source."""

    data: dict[str, Any]
    source: Source = field(default_factory=Source)
    name: str = "scenario"
    """Default name of the scenario."""


def load_any(source: str | Path, overrides: Sequence[str] = ()) -> AnyScenario:
    """Read a scenario of any system from a TOML, JSON or YAML file, distinguished by its suffix.

    The source "-" is standard input, whose format is recognised by its content. Overrides are texts
    such as "balls[1].angle=-60 deg". Raises `ScenarioError` with all faults of the scenario, and
    `OSError` if the file cannot be read.
    """
    return any_scenario_of(load_document(source), overrides)


def load_stored(source: str | Path, overrides: Sequence[str] = ()) -> AnyScenario:
    """Read the scenario stored with a run; otherwise as :func:`load_any`.

    It has all defaults, so it may exceed the size limit of scenario files.
    """
    text = _decoded(Path(source).read_bytes(), str(source))
    return any_scenario_of(_parsed(text, "json", str(source)), overrides)


def scenario_of(document: Document | Mapping[str, Any], overrides: Sequence[str] = ()) -> Scenario:
    """Return the scenario of a trace; otherwise as :func:`any_scenario_of`.

    Raises `ScenarioError` also for another system.
    """
    scenario, model = any_scenario_of(document, overrides), Scenario
    if isinstance(scenario, model):
        return scenario
    found = shown(scenario.system)
    expected = '"trace": what was asked for is not there for other systems'
    raise ScenarioError([Problem.at(scenario.place("system"), "system", found, expected)])


def any_scenario_of(
    document: Document | Mapping[str, Any], overrides: Sequence[str] = ()
) -> AnyScenario:
    """Return the scenario of a document or of plain data, after overrides.

    Raises `ScenarioError` with all faults of the scenario and the overrides.
    """
    if not isinstance(document, Document):
        document = Document(plain(dict(document)))
    if is_grid(document.data):
        place = document.source.place(("axes",), on_key=True)
        found = "a grid (axes over a scenario)"
        raise ScenarioError([Problem.at(place, "", found, "a scenario; vibro grid solves a grid")])
    data, paths, problems = overridden(document.data, overrides)
    source = replace(document.source, overrides=(*document.source.overrides, *paths))
    return _validated(data, source, document.name, problems)


def replaced(scenario: Changed, changes: Mapping[str, Any]) -> Changed:
    """Return a scenario with changed values, given by path; raises as :func:`any_scenario_of`."""
    source = scenario._source

    def given(path: str, value: Any) -> Override:
        return path_of(str(path)), plain(value)

    made = [
        (f"replace {shortened(f'{path}={value!r}')}", partial(given, path, value))
        for path, value in changes.items()
    ]
    data, paths, problems = _changed(scenario.given(), made)
    source = replace(source, overrides=(*source.overrides, *paths))
    return cast("Changed", _validated(data, source, scenario.name, problems))


def _validated(
    data: dict[str, Any], source: Source, name: str, problems: list[Problem]
) -> AnyScenario:
    """Return the scenario of data after overrides, or raise the problems of both."""
    source.data = data = {"name": name, **data}
    root = model_of(data)
    try:
        scenario = root.model_validate(data)
    except ValidationError as error:
        problems += located(fields.faults(error, root), source)
    if problems:
        raise ScenarioError(problems)
    scenario._source = source
    return scenario


def is_grid(data: Mapping[str, Any]) -> bool:
    """Return whether data describe a grid, not a scenario."""
    return "axes" in data and ("base" in data or "scenario" in data)


def overridden(
    data: dict[str, Any], overrides: Sequence[str]
) -> tuple[dict[str, Any], list[tuple[KeyPath, str]], list[Problem]]:
    """Return data after overrides, the paths and texts of the overrides, and their problems."""
    return _changed(
        data, [(f"--set {shortened(text)}", partial(parse, text)) for text in overrides]
    )


def _changed(
    data: dict[str, Any], overrides: Iterable[tuple[str, Callable[[], Override]]]
) -> tuple[dict[str, Any], list[tuple[KeyPath, str]], list[Problem]]:
    """Do the same for overrides given as pairs of label (for errors) and function."""
    changed = dict(data)
    done: list[tuple[KeyPath, str]] = []
    problems: list[Problem] = []
    for called, made in overrides:
        try:
            path, value = made()
            after = apply(changed, path, value, [before for before, _ in done])
            if value is None:
                raise Fault(path, "no value", "a value (keys are changed here, not removed)")
        except Fault as error:
            problems.append(_problem(error, Place(called)))
        else:
            changed = after
            done.append((path, called))
    return changed, done, problems


def located(faults: Iterable[Fault], source: Source) -> list[Problem]:
    """Return faults as problems with their places, in the order of the file."""
    problems = [_problem(fault, source.place(fault.loc, fault.on_key)) for fault in faults]
    return in_order(problems)


def _problem(fault: Fault, place: Place) -> Problem:
    return Problem.at(place, path_text(fault.loc), fault.found, fault.expected)


def load_document(source: str | Path) -> Document:
    """Read the data of a file in TOML, JSON or YAML, or of standard input ("-").

    Raises `ScenarioError` if the text has broken syntax or exceeds the limits, `OSError` if the
    file cannot be read.
    """
    if str(source) == "-":
        if sys.stdin is None:
            raise _error(_STANDARD_INPUT, "standard input closed", "a scenario")
        text = _bounded(sys.stdin.buffer.read(MOST_BYTES + 1), _STANDARD_INPUT)
        return parse_document(text, form_of(text), _STANDARD_INPUT)
    path = Path(source)
    if path.is_dir():
        raise _error(str(path), "a folder", "a scenario file (.toml, .json, .yaml or .yml)")
    form = FORMS.get(path.suffix.lower())
    if form is None:
        found = f"the suffix {shown(path.suffix)}" if path.suffix else "no suffix"
        expected = "a file named .toml, .json, .yaml or .yml"
        raise _error(str(source), found, expected + _of_the_gallery(str(source)))
    try:
        with path.open("rb") as stream:
            content = stream.read(MOST_BYTES + 1)
    except ValueError:  # a null character in the name
        raise _error(shown(str(source)), "a name with a null character", "a file") from None
    return parse_document(_bounded(content, str(source)), form, str(source), _stem(path))


def _of_the_gallery(name: str) -> str:
    """Return a hint if a text names a scenario or grid of the gallery, or an empty string."""
    from vibro_cli.scenario import gallery

    known = {*gallery.names(), *gallery.grid_names()}
    return f" (vibro new {name} writes the {name} of the gallery)" if name in known else ""


def _stem(path: Path) -> str:
    name = "".join(char if char.isprintable() else "_" for char in path.stem).replace("\\", "_")
    return name.strip()[:100].strip() or "scenario"


def _error(file: str, found: str, expected: str, place: Place | None = None) -> ScenarioError:
    return ScenarioError([Problem.at(place or Place(file), "", found, expected)])


def _check_size(size: int, unit: str, file: str) -> None:
    if size > MOST_BYTES:
        most = f"{MOST_BYTES:,} {unit}"
        raise _error(file, f"more than {most}", f"at most {most}")


def _bounded(content: bytes, file: str) -> str:
    """Return the text of a file that a user gives, after checking its size."""
    _check_size(len(content), "bytes", file)
    return _decoded(content, file)


def _decoded(content: bytes, file: str) -> str:
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        text = error.object  # the content, without a byte order mark
        before = text[: error.start].decode("utf-8")
        place = Place(file, *line_and_column(before, len(before)))
        found = f"the byte 0x{text[error.start]:02x}"
        raise _error(file, found, "a text in UTF-8", place) from None


def form_of(text: str) -> str:
    """Return the format of a text, guessed from its first line that is not a comment or blank."""
    for line in text.splitlines():
        line = line.strip()
        if not line or line.startswith("#"):
            continue
        if line.startswith("{"):
            return "json"
        if line.startswith("["):
            return "toml"
        is_yaml = re.match(r"(---|%|- |[^=\"']*:(\s|$)|\"[^\"]*\"\s*:|'[^']*'\s*:)", line)
        return "yaml" if is_yaml else "toml"
    return "toml"


def parse_document(text: str, form: str, file: str, name: str = "scenario") -> Document:
    """Return the data of a text in "toml", "json" or "yaml"; errors call it `file`.

    `name` is the default name of the scenario. Raises `ScenarioError` if the text has broken syntax
    or exceeds the limits, `ValueError` for an unknown format.
    """
    if form not in FORMS.values():
        raise ValueError(f'form: found "{form}", expected toml, json or yaml')
    _check_size(len(text), "characters", file)
    return _parsed(text, form, file, name)


def _parsed(text: str, form: str, file: str, name: str = "scenario") -> Document:
    """Return the data of a text of any length."""
    try:
        data = forms.read(text, form)
    except FormError as error:
        place = Place(file, *line_and_column(text, error.offset))
        problem = Problem.at(place, path_text(error.loc), error.found, error.expected)
        raise ScenarioError([problem]) from None
    except Exception as error:  # other errors of a parser (RecursionError, KeyError, ...)
        found = f"a text that cannot be read ({type(error).__name__})"
        raise _error(file, found, f"valid {form.upper()}") from error
    if not isinstance(data, dict):
        raise _error(file, shown(data), "a table with the keys of a scenario", Place(file, 1, 1))
    if isinstance(data.get("$schema"), str):  # for editors only
        del data["$schema"]
    return Document(data, Source(file, form, text), name)
