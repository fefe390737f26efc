"""The start of the program: it is quick, and loads no library that it does not need."""

import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.commands import processes
from tests.commands.conftest import Vibro
from tests.commands.processes import VIBRO
from tests.effort import ratio
from vibro_cli import __version__
from vibro_cli.commands.app import COMMANDS

SCENES = Path(__file__).parents[1] / "scenes"
GALLERY = Path(__file__).parents[2] / "scenarios"


def start(*arguments: str, options: tuple[str, ...] = ()) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, *options, "-m", "vibro_cli", *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def imported(*arguments: str) -> set[str]:
    """Return the names of the top-level packages that a start imports."""
    lines = start(*arguments, options=("-X", "importtime")).stderr.splitlines()
    modules = (line.split("|")[-1].strip() for line in lines if line.startswith("import time:"))
    return {module.split(".")[0] for module in modules}


def loaded(*commands: list[str]) -> set[str]:
    """Return the names of the modules that are loaded after some commands.

    All of them in one process, which draws every figure itself.
    """
    code = f"""if True:
        import sys
        from vibro_cli.commands.app import run_command_line
        from vibro_cli.figures import processes

        processes.available_cores = lambda: 1
        codes = [run_command_line(command) for command in {commands!r}]
        print(*sys.modules, file=sys.stderr)
        sys.exit(any(codes))"""
    outcome = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False
    )
    assert outcome.returncode == 0, outcome.stderr
    return set(outcome.stderr.splitlines()[-1].split())


@pytest.mark.parametrize("flag", ["--version", "-V"])
def test_version(flag: str) -> None:
    outcome = start(flag)
    assert (outcome.returncode, outcome.stdout) == (0, f"vibro {__version__}\n")
    assert outcome.stderr == ""


def test_help_without_docstrings_says_why_it_has_no_texts() -> None:
    """It printed the fields of each command, such as `RunCommand(*, scenarios: typing.…`."""
    outcome = start("--help", options=("-B", "-OO"))
    assert (outcome.returncode, outcome.stderr) == (0, "")
    assert "Command(" not in outcome.stdout
    for command in COMMANDS:
        assert f"  {command:9} (python -OO removes this text.)\n" in outcome.stdout


@pytest.mark.parametrize("flag", ["--version", "-V", "--help", "-h"])
def test_what_needs_no_library_ends_as_commands_do_where_nobody_reads(
    flag: str, tmp_path: Path
) -> None:
    closed = processes.into_closed_pipe(tmp_path, [flag])
    assert (closed.returncode, closed.stderr) == (0, b"")
    full = processes.onto_full_device(tmp_path, [flag])
    assert (full.returncode, full.stderr) == (1, b"vibro: No space left on device\n")


def test_a_signal_that_comes_while_a_command_is_ending_has_its_exit_code() -> None:
    """For example a second signal right after the first, from a terminal or a service that ends."""
    code = """if True:
        from vibro_cli.__main__ import main
        from vibro_cli.commands import app
        from vibro_cli.commands.shared import error_handling

        def struck(*texts: str, **more: str) -> None:
            raise error_handling.Terminated(15)

        error_handling.say = struck
        main()"""
    outcome = subprocess.run(
        [sys.executable, "-c", code, "check", "none.toml"], capture_output=True, check=False
    )
    assert (outcome.returncode, outcome.stderr) == (143, b"")


LOADING = """
class Struck:
    def find_spec(self, name, *_):
        if name == "vibro_cli.commands.app":
            type("Owner", (), {"named": self})

    def __set_name__(self, *_):
        signal.raise_signal(signal.SIGINT)

sys.meta_path.insert(0, Struck())
"""
"""Python 3.11 turns what `__set_name__` raises into a RuntimeError."""
LEAVING = "atexit.register(signal.raise_signal, signal.SIGINT)"


@pytest.mark.parametrize("moment", [LOADING, LEAVING], ids=["loading", "leaving"])
def test_control_c_before_and_after_a_command_has_no_traceback(moment: str) -> None:
    code = f"import atexit, signal, sys\n{moment}\nfrom vibro_cli.__main__ import main\nmain()"
    outcome = subprocess.run(
        [sys.executable, "-c", code, "new", "--list"], capture_output=True, check=False
    )
    assert (outcome.returncode, outcome.stderr) == (-signal.SIGINT, b"")


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_signal_that_comes_while_the_command_line_is_read_ends_it(number: int) -> None:
    """The library that parses it treats every interrupt as ^C."""
    code = f"""if True:
        import signal
        from vibro_cli.__main__ import main
        from vibro_cli.commands.shared import options

        options.configure_messages = lambda **words: signal.raise_signal({int(number)})
        main()"""
    command = [sys.executable, "-c", code, "check", "none.toml", "-q"]
    outcome = subprocess.run(command, capture_output=True, check=False)
    assert (outcome.returncode, outcome.stderr) == (-number, b"")


def test_version_takes_little_more_than_python_itself_and_no_library() -> None:
    assert ratio([*VIBRO, "--version"], [sys.executable, "-c", "pass"]) < 6
    assert "typer" not in imported("--version")


def test_help_takes_little_more_than_its_library_and_no_numpy() -> None:
    assert ratio([*VIBRO, "--help"], [sys.executable, "-c", "import typer.main"]) < 4
    found = imported("--help")
    assert "typer" in found
    assert not found & {"numpy", "scipy", "compiled", "pyarrow", "matplotlib", "ruamel"}


def test_the_package_imports_nothing_until_asked() -> None:
    code = "import sys, vibro_cli; print(sorted({m.split('.')[0] for m in sys.modules}))"
    outcome = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert not {"numpy", "pydantic", "typer"} & set(eval(outcome.stdout))


def test_a_short_run_without_figures_imports_nothing_it_does_not_use(tmp_path: Path) -> None:
    scenario = tmp_path / "one.toml"
    scenario.write_bytes((SCENES / "circle.toml").read_bytes())
    arguments = ["run", str(scenario), "--no-figures", "-q", "--set", "stop.collisions=1"]
    code = (
        "import sys; from vibro_cli.commands.app import run_command_line as run; "
        f"code = run({[*arguments, '-o', str(tmp_path / 'out')]}); "
        "print(*sys.modules, file=sys.stderr); sys.exit(code)"
    )
    command = [sys.executable, "-c", code]
    outcome = subprocess.run(command, capture_output=True, text=True, check=False)
    assert outcome.returncode == 0
    found = set(outcome.stderr.split())
    heavy = {"scipy", "matplotlib", "PIL", "pandas", "jinja2", "ruamel", "mpmath", "rich"}
    assert not heavy & {name.partition(".")[0] for name in found}
    assert "pyarrow.compute" not in found  # a tenth of the whole run
    own = {name for name in found if name.startswith("vibro_cli.")}
    layers = {name.split(".")[1] for name in own}
    assert not layers & {
        "figures",
        "report",
        "analysis",
        "grids",
        "benchmark",
        "stress",
        "programs",
    }
    assert not own & {"vibro_cli.compile.translate", "vibro_cli.compile.build"}
    commands = {name.split(".")[2] for name in own if name.startswith("vibro_cli.commands.")}
    assert commands & set(COMMANDS) == {"run"}


def test_checking_a_trace_imports_no_library_of_grids_figures_or_special_functions() -> None:
    found = imported("check", str(SCENES / "circle.toml"))
    assert not found & {"scipy", "pyarrow", "matplotlib", "ruamel"}


@pytest.mark.parametrize(
    "name",
    [
        pytest.param("one_circle", marks=pytest.mark.long),
        pytest.param("springs/two_disks", marks=pytest.mark.long),
        "table/skew_impact",
    ],
)
def test_figures_and_a_report_import_no_scipy(name: str, tmp_path: Path) -> None:
    scenario, folder = GALLERY / f"{name}.toml", str(tmp_path / "run")
    found = loaded(
        ["run", str(scenario), "--set", "stop.collisions=1", "-q", "-o", folder],
        ["report", folder, "-q", "-o", str(tmp_path / "page.html")],
    )
    assert "matplotlib" in found
    assert "scipy" not in found


def test_unknown_names_of_the_package_are_attribute_errors() -> None:
    import vibro_cli

    with pytest.raises(AttributeError, match="'vibro_cli' has no attribute 'simulat'"):
        vibro_cli.simulat  # noqa: B018
    assert {"load_scenario", "simulate"} <= set(dir(vibro_cli))


def test_help_names_every_command_and_goes_to_standard_output(vibro: Vibro) -> None:
    for arguments in ((), ("--help",), ("-h",)):
        outcome = vibro(*arguments)
        assert outcome.code == 0
        assert outcome.err == ""
        listed = outcome.text.split("Commands:")[1]
        assert re.findall(r"^  (\w+)  ", listed, re.MULTILINE) == list(COMMANDS)


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_help(vibro: Vibro, command: str) -> None:
    outcome = vibro(command, "--help")
    assert outcome.code == 0
    assert outcome.text.startswith(f"Usage: vibro {command}")
    for option in ("--json", "-q, --quiet", "-v, --verbose", "--log-format"):
        assert re.search(rf"^  {option}\b", outcome.text, re.MULTILINE)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["fly"], "No such command 'fly'"),
        (["run"], "Missing argument 'SCENARIO'"),
        (["-q", "run"], "No such option: -q (options follow a command; see vibro --help)"),
        (["--json", "run"], "No such option: --json (options follow a command; see vibro --help)"),
        (["--versoin"], "No such option: --versoin (did you mean '--version'?) (options follow"),
        (["rnu", "a.toml"], "No such command 'rnu'. Did you mean 'run'?"),
        (
            ["run", "--fromat", "csv", "a.toml"],
            "No such option: --fromat (did you mean '--format'",
        ),
        (
            ["run", "a.toml", "--engine", "compild"],
            "vibro: --engine (or VIBRO_ENGINE): found 'compild', expected one of compiled, python "
            "(did you mean 'compiled'?) (see vibro run --help)\n",
        ),
        (["schema", "figures"], "SUBJECT: found 'figures', expected one of scenario, grid, tables"),
        (["stress", "--seed", "one"], "--seed: found 'one', expected a whole number"),
        (
            ["section", "a", "-o", "a.gif"],
            "-o: found a.gif, expected a .png, .pdf or .svg file (see",
        ),
        (["section", "a", "--transient=-1"], "found '-1', expected a number of at least 0 (see"),
        (["report", "a", "--fps", "200"], "found '200', expected a number of at most 100 (see"),
        (["report", "a", "--pace", "nan"], "found 'nan', expected a number of at least 1e-06 (see"),
        (["report", "a", "--width", "single"], "--width requires --pdf FILE or --figures FOLDER"),
        (
            ["report", "a", "-o", "a.html", "--animate", "./a.html"],
            "found a.html for two results, expected different files",
        ),
        (
            ["report", "a", "-o", "-", "--pdf", "b", "--figures", "b"],
            "found b for two results, expected different files",
        ),
        (["report", "a", "--width", "{a}"], "found '{a}', expected one of single, double (see"),
        (["run", "a.toml", "-o", ""], "--output: found an empty text, expected a name"),
        (["new", "three_arcs", "-o", ""], "--output: found an empty text, expected a name"),
        (["help", "rnu"], "no help on 'rnu' (did you mean 'run'?), expected one of commands"),
        *(
            (
                ["grid", "a.toml", "--dry-run", *more],
                "it cannot be combined with --shard, --merge or",
            )
            for more in (["--shard", "1/2"], ["--merge"], ["--repair"])
        ),
        (
            ["bench", "--references", "a", "--json"],
            "--references measures nothing; it can be combined with",
        ),
        (["show", "a.parquet", "--rows", "few"], "vibro: --rows: found 'few', expected N, -N"),
    ],
)
def test_wrong_usage_is_one_line_and_exit_code_2(
    vibro: Vibro, arguments: list[str], message: str
) -> None:
    outcome = vibro(*arguments)
    assert outcome.code == 2
    assert outcome.out == b""
    assert outcome.err.startswith("vibro: ")
    assert outcome.err.count("\n") == 1
    assert message in outcome.err


def test_outputs_may_be_closed_or_poor_in_letters() -> None:
    code = f"{sys.executable} -m vibro_cli"
    closed = subprocess.run(f"{code} new --list >&-", shell=True, capture_output=True, check=False)
    assert (closed.returncode, closed.stderr) == (1, b"vibro: standard output is closed\n")
    poor = subprocess.run(
        f"PYTHONIOENCODING=ascii PYTHONUTF8=0 {code} schema tables --markdown",
        shell=True,
        capture_output=True,
        check=False,
    )
    assert (poor.returncode, poor.stderr) == (0, b"")
    assert b"\\u03c6" in poor.stdout


def test_a_system_on_which_it_cannot_run_is_told_so_at_once() -> None:
    for code, last in (
        ("from vibro_cli.__main__ import main; main()", "vibro runs on Linux and macOS; "),
        ("from vibro_cli import simulate", "ImportError: vibro runs on Linux and macOS; "),
    ):
        before = "import sys; sys.platform, sys.argv = 'win32', ['vibro', 'check', 'a.toml']\n"
        outcome = subprocess.run(
            [sys.executable, "-c", before + code], capture_output=True, text=True, check=False
        )
        assert outcome.returncode == 1
        assert outcome.stderr.splitlines()[-1].startswith(last)
        assert "on Windows it runs within WSL" in outcome.stderr
        assert ("Traceback" in outcome.stderr) == ("ImportError" in last)
