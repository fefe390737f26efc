"""Careless or hostile input: the program reports it and does nothing else."""

import datetime
import io
import json
import os
import subprocess
import sys
from pathlib import Path

import pyarrow as pa
import pytest
from pyarrow import parquet

from tests.commands.conftest import Vibro
from tests.commands.processes import GRID
from tests.two_balls import SCENARIO

BOMB = "a: &a [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{key}: &{key} [{','.join([f'*{before}'] * 9)}]\n"
    for before, key in zip("abcdefgh", "bcdefghi", strict=True)
)
CONTENTS: dict[str, tuple[bytes, str]] = {
    "empty.toml": (b"", 'gravity: found nothing, expected the key "gravity"'),
    "empty.json": (b"", "1:1: found broken JSON"),
    "empty.yaml": (b"", "1:1: found null, expected a table"),
    "binary.toml": (bytes(range(256)), "2:118: found the byte 0x80, expected a text in UTF-8"),
    "binary.json": (b"\x89PNG\r\n\x1a\n\0\0", "1:1: found the byte 0x89, expected a text in UTF-8"),
    "latin.toml": ('name = "café"'.encode("latin-1"), "1:12: found the byte 0xe9"),
    "utf16.toml": (SCENARIO.encode("utf-16"), "1:1: found the byte 0xff"),
    "large.toml": (b"#" * 1_000_001, "found more than 1,000,000 bytes"),
    "deep.toml": (b"a = " + b"[" * 100_000, "found more than 16 levels"),
    "deep.json": (b"[" * 100_000, "found more than 16 levels"),
    "deep.yaml": (b"[" * 100_000, "found more than 16 levels"),
    "bomb.yaml": (BOMB.encode(), "found more than"),
    "huge.toml": (b"gravity = " + b"9" * 399, "gravity: found 9999"),
    "infinite.toml": (b"gravity = 1e400", "gravity: found inf, expected a finite number"),
    "run.yaml": (b'!!python/object/apply:os.system ["touch pwned"]', "found the tag"),
}


@pytest.mark.parametrize("name", CONTENTS)
def test_a_file_that_is_no_scenario(vibro: Vibro, tmp_path: Path, name: str) -> None:
    content, message = CONTENTS[name]
    (tmp_path / name).write_bytes(content)
    outcome = vibro("check", name)
    assert (outcome.code, outcome.out) == (2, b"")
    assert all(line.startswith(f"{name}:") for line in outcome.err.splitlines())
    assert message in outcome.err
    assert os.listdir(tmp_path) == [name]


@pytest.mark.parametrize("ends", ["\n", "\r\n"])
@pytest.mark.parametrize("mark", [b"", b"\xef\xbb\xbf"])
def test_line_ends_and_byte_order_marks_do_not_matter(
    vibro: Vibro, tmp_path: Path, ends: str, mark: bytes
) -> None:
    (tmp_path / "a.toml").write_bytes(mark + SCENARIO.replace("\n", ends).encode())
    assert vibro("check", "a.toml", "-q").code == 0


def test_a_file_that_is_not_there_or_a_folder_is_one_line(vibro: Vibro, tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    (tmp_path / "loop.toml").symlink_to("loop.toml")
    words = "found a folder, expected a scenario file (.toml, .json, .yaml or .yml)"
    assert vibro("check", "folder").err == f"folder: {words}\n"
    assert vibro("check", "").err == f".: {words}\n"
    for command in ("check", "grid"):
        words = "none.toml: cannot be read: No such file or directory\n"
        assert vibro(command, "none.toml").err == words
    assert vibro("check", "loop.toml").err.startswith("loop.toml: cannot be read: Too many levels")


def test_names_of_files_cannot_command_the_terminal(vibro: Vibro, tmp_path: Path) -> None:
    name = "evil\x1b[31m\n\u202e"
    (tmp_path / f"{name}.toml").write_text("x")
    (tmp_path / "good.toml").write_text(SCENARIO)
    for arguments in (
        ("check", f"{name}.toml"),
        ("check", f"{name}.json"),
        ("show", name),
        ("run", "good.toml", "--no-figures", "-o", name),
        ("run", "good.toml", "--set", f"name={name}"),
    ):
        outcome = vibro(*arguments)
        assert "\x1b" not in outcome.err + outcome.text
        assert "\u202e" not in outcome.err + outcome.text


@pytest.mark.parametrize(
    "command",
    [
        "check NAME.toml",
        "check NAME.json",
        "check bad/NAME.toml bad/other.toml",
        "check invalid/NAME.toml",
        "run good.toml invalid/NAME.toml --no-figures",
        "run good.toml --no-figures -o NAME",
        "run good.toml --no-figures -o good/NAME --set collision.k=0.5",
        "run good.toml --no-figures -o good.toml/NAME",
        "run --continue NAME",
        "show NAME",
        "show good/NAME/collisions.parquet --columns nothing",
        "verify NAME good/NAME",
        "report NAME",
        "report good/NAME -o good.toml --pdf NAME.pdf",
        "section good/NAME --column nothing",
        "basins NAME",
        "grid NAME.toml",
        "grid grid.toml -o grids/NAME",
        "grid grid.toml -o grids/NAME --set stop.collisions=2",
        "grid grid.toml -o good/NAME --merge",
        "new three_arcs -o NAME.toml",
        "new --all -o NAME",
        "portrait good.toml --no-figures -o NAME",
    ],
)
def test_a_line_break_in_a_name_breaks_no_line(vibro: Vibro, tmp_path: Path, command: str) -> None:
    """The messages about a file called `a\\nb` are those about a file called `a b`."""
    (tmp_path / "good.toml").write_text(SCENARIO)
    (tmp_path / "grid.toml").write_text(GRID.replace("small", "good"))
    said = []
    for name in ("a b", "a\nb"):
        for folder, content in (("bad", "x"), ("invalid", SCENARIO.replace("k = ", "kk = "))):
            (tmp_path / folder).mkdir(exist_ok=True)
            (tmp_path / folder / f"{name}.toml").write_text(content)
        vibro("run", "good.toml", "--no-figures", "-o", f"good/{name}")
        if "--set stop" in command:
            vibro("grid", "grid.toml", "-o", f"grids/{name}")
        outcome = vibro(*(part.replace("NAME", name) for part in command.split()))
        assert outcome.err
        said.append((outcome.code, outcome.err.replace("a b", "a�b")))
    assert said[0] == said[1]


@pytest.fixture
def odd(tmp_path: Path) -> Path:
    """Write a parquet table that is not one of the program's."""
    columns = {
        "number": [1.0, float("nan")],
        "when": [datetime.datetime(2020, 1, 1)] * 2,
        "bytes": [b"\xff\x1b[31m", None],
        "words\x1b[31m": ["red\x1b[31m\n", "\u202e"],
        "list": [[1, 2], []],
    }
    parquet.write_table(pa.table(columns), tmp_path / "odd.parquet")
    return tmp_path / "odd.parquet"


def test_any_table_can_be_shown(vibro: Vibro, odd: Path) -> None:
    outcome = vibro("show", odd)
    assert (outcome.code, outcome.err) == (0, "rows 1 to 2 of 2\n")
    assert "2020-01-01" in outcome.text
    assert "\x1b" not in outcome.text
    assert len(outcome.text.splitlines()) == 4
    assert vibro("show", odd, "--rows", "0").err == "no rows of 2\n"


@pytest.mark.parametrize("options", [["--json"], ["--format", "jsonl"], ["--format", "csv"]])
def test_what_a_form_cannot_hold_is_said(vibro: Vibro, odd: Path, options: list[str]) -> None:
    outcome = vibro("show", odd, *options)
    assert outcome.code == 2
    assert "odd.parquet: cannot be shown as " in outcome.err
    assert outcome.err.endswith(" (choose columns with --columns)\n")
    fit = "number" if "csv" in options else "list"
    assert vibro("show", odd, *options, "--columns", fit).code == 0


@pytest.mark.parametrize("replaced", ["name", "word"])
def test_a_table_whose_names_or_words_are_not_in_utf8_is_one_line(
    vibro: Vibro, tmp_path: Path, scenario: Path, replaced: str
) -> None:
    table = pa.table({"t": ["wordZ", "b"], "collision.k": [0.5, 0.6], "nameZ": [1, 2]})
    file, changed = io.BytesIO(), f"{replaced}Z".encode()
    parquet.write_table(table, file, compression="none", store_schema=False)
    path = tmp_path / "foreign.parquet"
    path.write_bytes(file.getvalue().replace(changed, changed[:-1] + b"\xff"))
    grid = tmp_path / "grid.toml"
    grid.write_text(f'base = "{scenario}"\n[[axes]]\ntable = "foreign.parquet"\n')
    commands = [["show", path], ["fit", scenario, path, "--free", "collision.k"], ["grid", grid]]
    for command in commands:
        outcome = vibro(*command)
        assert (outcome.code, outcome.text) == (2, "")
        assert "foreign.parquet" in outcome.err
        assert "UTF" in outcome.err.upper()
        assert outcome.err.count("\n") == 1


@pytest.mark.parametrize("fault", ["memory", "threads"])
def test_a_table_for_which_memory_or_threads_run_out_is_not_called_damaged(
    vibro: Vibro, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, scenario: Path, fault: str
) -> None:
    def opened(*_: object, **__: object) -> None:
        if fault == "memory":
            raise pa.ArrowMemoryError("malloc of size 64 failed")
        raise pa.ArrowException("Unknown error: Failed to launch worker thread: unavailable")

    path, grid = tmp_path / "table.parquet", tmp_path / "grid.toml"
    parquet.write_table(pa.table({"t": [1.0], "collision.k": [0.5]}), path)
    grid.write_text(f'base = "{scenario}"\n[[axes]]\ntable = "table.parquet"\n')
    commands = [["show", path], ["fit", scenario, path, "--free", "collision.k"], ["grid", grid]]
    monkeypatch.setattr(parquet, "ParquetFile", opened)
    for command in commands:
        outcome = vibro(*command)
        words = "out of memory" if fault == "memory" else "no thread can be started"
        assert (outcome.code, outcome.text) == (1, "")
        assert outcome.err.startswith(f"vibro: {words}")


def shell(command: str, folder: Path, **changes: str) -> subprocess.CompletedProcess[str]:
    """Run a line of the shell, in which $V is the program."""
    environment = {
        **os.environ,
        "V": f"{sys.executable} -m vibro_cli",
        "PYTHONPATH": str(Path(__file__).parents[2]),
        **changes,
    }
    return subprocess.run(
        ["bash", "-c", command], cwd=folder, env=environment, capture_output=True, text=True,
        check=False, timeout=300,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("command", "code", "words"),
    [
        ("$V check - <&-", 2, "<stdin>: found standard input closed, expected a scenario\n"),
        ("$V check small.toml -q >&-", 0, ""),
        ("$V check small.toml >&-", 1, "vibro: standard output is closed\n"),
        ("$V run small.toml --format csv -q <&- >&-", 1, "vibro: standard output is closed\n"),
        ("$V check none.toml 2>&-", 2, ""),
        ("$V run small.toml --no-figures -q <&- >&- 2>&-", 0, ""),
    ],
)
def test_closed_streams(
    scenario: Path, tmp_path: Path, command: str, code: int, words: str
) -> None:
    outcome = shell(command, tmp_path)
    assert (outcome.returncode, outcome.stdout, outcome.stderr) == (code, "", words)


@pytest.mark.parametrize("command", ["run", pytest.param("portrait", marks=pytest.mark.long)])
def test_a_shell_whose_folder_is_replaced_learns_how_to_enter_it(
    scenario: Path, tmp_path: Path, command: str
) -> None:
    enter = 'enter it again: cd "$PWD"\n'
    write = f"mkdir results && cd results && $V {command} ../small.toml -o ."
    left = shell(f"{write} --no-figures; ls; $V report .", tmp_path)
    said = f"vibro: the working directory is a new folder; {enter}"
    assert said in left.stderr
    assert left.stderr.endswith(f"vibro: the working directory was removed or replaced; {enter}")
    (tmp_path / "results").rename(tmp_path / "earlier")
    entered = shell(f'{write} --no-figures -q && cd "$PWD" && $V verify .', tmp_path)
    assert (entered.returncode, entered.stderr[:9]) == (0, ".: intact")
    outside = shell(f"$V {command} small.toml -o results --no-figures", tmp_path)
    assert said not in outside.stderr


def test_what_is_written_where_the_working_directory_is_gone(tmp_path: Path) -> None:
    outcome = shell("mkdir here; cd here; rmdir ../here; $V new --all", tmp_path)
    gone = 'the working directory was removed or replaced; enter it again: cd "$PWD"'
    assert (outcome.returncode, outcome.stderr) == (1, f"vibro: scenarios: {gone}\n")


def test_no_file_takes_the_place_of_a_closed_stream(scenario: Path, tmp_path: Path) -> None:
    """A library that prints to number 2 must not print into a table."""
    program = (
        "import os, sys; from vibro_cli.commands.shared.terminal import prepare_streams; "
        "prepare_streams(); file = open('data', 'w'); assert file.fileno() > 2; "
        "os.write(2, b'a word of a library')"
    )
    outcome = shell(f'{sys.executable} -c "{program}" <&- >&- 2>&-', tmp_path)
    assert outcome.returncode == 0
    assert (tmp_path / "data").read_text() == ""


@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "utf-8"])
def test_json_is_json_in_every_encoding(scenario: Path, tmp_path: Path, encoding: str) -> None:
    outcome = shell(
        '$V check small.toml --json --set "name=café κ 🎱"', tmp_path, PYTHONIOENCODING=encoding
    )
    assert json.loads(outcome.stdout)["name"] == "café κ 🎱"
    assert ("κ" in outcome.stdout) == (encoding == "utf-8")
