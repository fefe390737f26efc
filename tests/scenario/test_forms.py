"""TOML, JSON and YAML: the same scenario in each, and what none of them may do."""

from __future__ import annotations

import io
import json
import tomllib
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ruamel.yaml import YAML

from tests.effort import processor_time
from tests.scenario import cases
from tests.scenario.texts import parse_any, parse_scenario
from vibro_cli.scenario import ScenarioError, load_any
from vibro_cli.scenario.forms import line_and_column, places, plain_scalar
from vibro_cli.scenario.gallery import names, text
from vibro_cli.scenario.loading import form_of

FORMS = ("toml", "json", "yaml")


def as_yaml(data: Any) -> str:
    stream = io.StringIO()
    YAML(typ="safe", pure=True).dump(data, stream)
    return stream.getvalue()


@pytest.mark.parametrize("name", names())
def test_the_forms_read_alike(name: str) -> None:
    data = tomllib.loads(text(name))
    scenario = parse_any(text(name), "toml")
    assert parse_any(json.dumps(data), "json") == scenario
    assert parse_any(as_yaml(data), "yaml") == scenario


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("number", ["1e-3", "1E-3", "0.001", "1e3", "1", "-0.0"])
def test_numbers_are_numbers_in_every_form(form: str, number: str) -> None:
    source, old, new = json.dumps(cases.data()), '"angle": -0.6', f'"angle": -0.6, "rate": {number}'
    if form == "toml":
        source, old, new = text("three_arcs"), "angle = 0.4", f"angle = 0.4\nrate = {number}"
    assert old in source  # JSON is YAML too
    scenario = parse_scenario(source.replace(old, new), form)
    assert scenario.balls[1].rate == float(number)


@pytest.mark.parametrize(
    ("scalar", "value"),
    [
        ("1e-3", 0.001),
        ("1e3", 1000.0),
        (".5", 0.5),
        ("+12", 12),
        ("0x1F", 31),
        ("0o17", 15),
        ("017", 17),
        ("1:30", "1:30"),
        ("off", "off"),
        ("yes", "yes"),
        ("True", True),
        ("~", None),
        ("-.inf", float("-inf")),
        ("2024-01-01", "2024-01-01"),
        ("-60 deg", "-60 deg"),
    ],
)
def test_scalars_are_those_of_yaml_1_2(scalar: str, value: Any) -> None:
    read = plain_scalar(scalar)
    assert read == value
    assert type(read) is type(value)


def test_aliases_stand_for_their_values() -> None:
    source = as_yaml(cases.data()) + "output: {step: 0.1}\n"
    source = source.replace("stop: {time: 60.0}", "stop: {time: &end 60.0}")
    source = source.replace("step: 0.1", "step: *end")
    scenario = parse_scenario(source, "yaml")
    assert scenario.output.step == 60.0


@pytest.mark.parametrize(
    ("source", "place"),
    [
        ("gravity: *g", "1:10: gravity: found the alias *g"),
        ("gravity: 9.81\ntrace: &t\n  arcs: *t\n", "3:9: trace.arcs: found the alias *t"),
    ],
)
def test_an_alias_of_nothing_or_of_what_holds_it_is_told_with_its_place(
    source: str, place: str
) -> None:
    with pytest.raises(ScenarioError) as caught:
        parse_scenario(source, "yaml")
    expected = f"{place}, expected an alias of an earlier, finished value"
    assert str(caught.value).endswith(expected)


@pytest.mark.parametrize(
    ("source", "form"),
    [
        ('{"gravity": 9.81}', "json"),
        ("# note\n\n[trace]\n", "toml"),
        ("gravity = 9.81", "toml"),
        ('"gravity" = 9.81', "toml"),
        ("name = 'a: b'", "toml"),
        ("gravity: 9.81", "yaml"),
        ('"gravity": 9.81', "yaml"),
        ("---\ngravity: 9.81", "yaml"),
        ("trace:", "yaml"),
        ("", "toml"),
    ],
)
def test_the_form_is_told_by_the_content(source: str, form: str) -> None:
    assert form_of(source) == form


class _Input:
    def __init__(self, content: bytes) -> None:
        self.buffer = io.BytesIO(content)


@pytest.mark.parametrize("form", FORMS)
def test_standard_input(form: str, monkeypatch: pytest.MonkeyPatch) -> None:
    data = tomllib.loads(text("three_arcs"))
    sources = {"toml": text("three_arcs"), "json": json.dumps(data), "yaml": as_yaml(data)}
    monkeypatch.setattr("sys.stdin", _Input(sources[form].encode()))
    scenario = load_any("-", ["name=from-input"])
    assert scenario == parse_scenario(text("three_arcs"), overrides=["name=from-input"])


def test_a_text_that_is_too_long_is_told_and_not_cut(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The last of a million bytes may be read, from a file and from standard input."""
    content = text("three_arcs").encode().ljust(1_000_000, b"#")
    for more in (b"", b"#", b"#" * 1000):
        (tmp_path / "long.toml").write_bytes(content + more)
        monkeypatch.setattr("sys.stdin", _Input(content + more))
        for source in (tmp_path / "long.toml", "-"):
            if not more:
                assert load_any(source).given()["gravity"] == 9.81
                continue
            with pytest.raises(ScenarioError, match="expected at most 1,000,000 bytes"):
                load_any(source)


def test_the_name_is_the_files_stem(tmp_path: Path) -> None:
    path = tmp_path / "my arcs.v2.TOML"
    path.write_bytes(b"\xef\xbb\xbf" + text("three_arcs").replace("\n", "\r\n").encode())
    assert load_any(path).name == "my arcs.v2"


def test_a_missing_file_is_an_os_error(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        load_any(tmp_path / "none.toml")


@pytest.mark.parametrize("name", ["folder.toml", "folder"])
def test_a_folder_is_told_from_a_file(tmp_path: Path, name: str) -> None:
    (tmp_path / name).mkdir()
    with pytest.raises(ScenarioError, match="found a folder, expected a scenario file"):
        load_any(tmp_path / name)


@pytest.mark.parametrize("name", ["scenario", "scenario.txt", "scenario.py", "a\0b.toml"])
def test_a_name_of_no_form(name: str) -> None:
    with pytest.raises(ScenarioError, match="expected a file"):
        load_any(name)


def test_an_unknown_form_is_the_callers_mistake() -> None:
    with pytest.raises(ValueError, match="toml, json or yaml"):
        parse_scenario("", "ini")


HOSTILE = {
    "dotted key": (".".join("a" * 20000) + " = 1", "toml"),
    "quoted dotted key": (".".join(['"a"'] * 20000) + " = 1", "toml"),
    "dotted header": ("[" + ".".join("a" * 20000) + "]", "toml"),
    "brackets in TOML": ("a = " + "[" * 100_000, "toml"),
    "brackets in JSON": ("[" * 100_000, "json"),
    "tables in JSON": ('{"a":' * 100_000, "json"),
    "brackets in YAML": ("[" * 100_000, "yaml"),
    "lists in YAML": ("- " * 100_000, "yaml"),
    "indented YAML": ("".join(" " * i + "a:\n" for i in range(1000)), "yaml"),
    "digits in TOML": ("gravity = " + "9" * 100_000, "toml"),
    "digits in JSON": ('{"gravity": ' + "9" * 100_000 + "}", "json"),
    "digits in YAML": ("gravity: " + "9" * 100_000, "yaml"),
    "too large": ("# " + "x" * 1_000_000, "toml"),
    "many keys": ("\n".join(f"k{i} = 1" for i in range(20000)), "toml"),
    "quotes": ('"' * 900_000, "toml"),
    "open strings in TOML": ('"\\' * 400_000, "toml"),
    "open strings in JSON": ('"\\' * 400_000, "json"),
    "open texts after backslashes": ('\\"""\n' * 180_000, "toml"),
    "open text": ('gravity = """' + "a\n" * 400_000, "toml"),
    "anchors": ("\n".join(f"a{i}: &x{i} 1" for i in range(20000)), "yaml"),
    "alias of itself": ("a: &a [*a]", "yaml"),
    "no alias": ("a: *b", "yaml"),
    "second document": ("---\n" * 1000, "yaml"),
    "key that is a list": ("? [a]\n: 1\n", "yaml"),
    "control character": ("a: \x07", "yaml"),
    "merge": ("a: &a {x: 1}\nb: {<<: *a}", "yaml"),
    "lone surrogate": ('{"name": "\\ud800", "\\ud800": 1}', "json"),
    "huge integer": ("gravity = 0x" + "f" * 390, "toml"),
    "nothing in JSON": ("", "json"),
    "nothing in YAML": ("", "yaml"),
}


LONGER = {"anchors"}


@pytest.mark.parametrize(
    "case",
    [
        pytest.param(case, marks=[pytest.mark.long] if case in LONGER else [])
        for case in sorted(HOSTILE)
    ],
)
def test_hostile_texts_end_soon_and_in_one_kind_of_error(case: str) -> None:
    source, form = HOSTILE[case]
    usual = processor_time(lambda: parse_scenario(text("three_arcs"), "toml"), times=5)

    def read() -> None:
        with pytest.raises(ScenarioError) as caught:
            parse_scenario(source, form)
        str(caught.value).encode("utf-8")

    assert processor_time(read, times=1) < 10_000 * usual


def test_places_in_json_are_found_past_blanks_anywhere() -> None:
    source = ' \n{ "gravity" :\t9.81 ,\n "balls"\n : [ { "mass" : -1.0 } ] }\n'
    with pytest.raises(ScenarioError) as caught:
        parse_scenario(source, "json")
    (mass,) = (one for one in caught.value.problems if one.path == "balls[1].mass")
    assert (mass.line, mass.column) == (4, 17)
    assert source.splitlines()[3][16:].startswith("-1.0")


def test_a_text_with_more_than_100_000_keys_is_refused_at_the_first_of_them() -> None:
    source = "\n".join(f"{i:x}=1" for i in range(100_001))
    with pytest.raises(ScenarioError) as caught:
        parse_scenario(source, "toml")
    (problem,) = caught.value.problems
    assert (problem.line, problem.found) == (100_001, "more than 100000 keys")


def test_places_of_many_problems_are_found_in_one_pass_over_the_text() -> None:
    """As by counting lines from the start for each, in less than a tenth of the time."""
    text = "k = 1\n" * 100_000 + "k = 1"
    offsets = range(0, len(text), 101)

    def counted() -> list[tuple[int, int]]:
        return [(text.count("\n", 0, at) + 1, at - text.rfind("\n", 0, at)) for at in offsets]

    def found() -> list[tuple[int, int]]:
        return [line_and_column(text, at) for at in offsets]

    assert found() == counted()
    assert processor_time(found, times=3) < 0.1 * processor_time(counted, times=1)


@settings(max_examples=300, deadline=None)
@given(st.text(alphabet="ab:=[]{}\"'#,.-&*!|>%?\n \t019e\\", max_size=60), st.sampled_from(FORMS))
def test_any_text_is_a_scenario_or_a_scenario_error(source: str, form: str) -> None:
    with pytest.raises(ScenarioError):
        parse_scenario(source, form)


@settings(max_examples=150, deadline=None)
@given(st.data())
def test_damaged_scenarios_are_scenarios_or_scenario_errors(draw: st.DataObject) -> None:
    form = draw.draw(st.sampled_from(FORMS))
    data = tomllib.loads(text("three_arcs"))
    source = {"toml": text("three_arcs"), "json": json.dumps(data), "yaml": as_yaml(data)}[form]
    start = draw.draw(st.integers(0, len(source)))
    end = draw.draw(st.integers(start, min(start + 20, len(source))))
    piece = draw.draw(st.text(alphabet="ab:=[]{}\"'#,.-\n 01e", max_size=5))
    damaged = source[:start] + piece + source[end:]
    lines = [1]
    try:
        scenario = parse_scenario(damaged, form)
        lines.append(scenario.place("balls[1].radius").line or 0)
    except ScenarioError as error:
        lines = [problem.line or 0 for problem in error.problems]
    assert lines
    assert all(1 <= line <= damaged.count("\n") + 1 for line in lines)


@pytest.mark.parametrize("name", names())
def test_toml_places_lead_to_every_value(name: str) -> None:
    source = text(name)
    _check_places(places(source, "toml"), tomllib.loads(source), source)


def _check_places(node: Any, value: Any, source: str) -> None:
    items = list(value.items() if isinstance(value, dict) else enumerate(value))
    assert list(node.children) == [key for key, _ in items]
    for key, item in items:
        child = node.children[key]
        if isinstance(key, str):
            assert source.startswith(key, child.key_offset)
        if isinstance(item, (dict, list)):
            _check_places(child, item, source)
        else:
            end = min(i for c in ",}]#\n" if (i := source.find(c, child.offset)) >= 0)
            assert tomllib.loads(f"v = {source[child.offset : end]}")["v"] == item


def test_toml_places_know_every_way_to_write_a_key() -> None:
    source = (
        'a."b c".d = 1 # x = 2\n'
        "[ t . u ]\nv = '''\n[no]\n# '''\nw = {x.y = [1, [2, 3]], z = \"}\"}\n"
        '[[t.rows]]\n"q\\u0041" = 1979-05-27 07:32:00\n[t.rows.sub]\nk = """a\\"""" \n[[t.rows]]\n'
    )
    tree = places(source, "toml")
    offsets = {
        ("a", "b c", "d"): source.index("1 #"),
        ("t", "u", "v"): source.index("'''"),
        ("t", "u", "w", "x", "y", 1, 0): source.index("2, 3"),
        ("t", "u", "w", "z"): source.index('"}"'),
        ("t", "rows", 0, "qA"): source.index("1979"),
        ("t", "rows", 0, "sub", "k"): source.index('"""a'),
        ("t", "rows", 1): source.rindex("[[t.rows]]"),
        ("t", "rows", 1, "missing"): source.rindex("[[t.rows]]"),
    }
    for path, offset in offsets.items():
        assert tree.offset_of(path) == offset
