"""The library is made when the package is installed, before its dependencies are there."""

from __future__ import annotations

import re
import resource
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from vibro_cli.compile import build, native
from vibro_cli.errors import NoLibrary

ROOT = Path(__file__).parents[2]

WITHOUT_DEPENDENCIES = """
import importlib.abc, sys

class Blocked(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        top = name.partition(".")[0]
        if top not in sys.stdlib_module_names and top != "vibro_cli":
            raise ImportError(f"{name} is not there yet")

sys.meta_path.insert(0, Blocked())
from vibro_cli.programs import programs
for program in programs():
    print(program.name, len(program.source()))
"""


def test_the_source_is_made_without_any_dependency() -> None:
    done = subprocess.run(
        [sys.executable, "-S", "-c", WITHOUT_DEPENDENCIES], cwd=ROOT, capture_output=True,
        text=True, check=False, env={"PYTHONPATH": str(ROOT)},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert [line.split()[0] for line in done.stdout.splitlines()] == [
        "trace", "rotating", "table", "springs", "judge",
    ]  # fmt: skip


def test_an_interrupted_build_is_no_failed_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """^C in a terminal reaches the compiling process too, whose traceback was printed."""
    (tmp_path / "struck.py").write_text("import os, signal\nos.kill(os.getpid(), signal.SIGINT)\n")
    monkeypatch.setattr(native, "FOLDER", tmp_path / "package" / "compile" / "library")
    monkeypatch.setattr(native, "_MODULE", "struck")
    with pytest.raises(KeyboardInterrupt):
        native._make("have changed")


def test_the_compiler_is_the_one_named_else_the_systems_else_the_wheel(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("CXX", "ccache g++")
    assert build.compiler() == ["ccache", "g++"]
    monkeypatch.delenv("CXX")
    monkeypatch.setattr("shutil.which", lambda name: name == "clang++" or None)
    assert build.compiler() == ["clang++"]
    monkeypatch.setattr("shutil.which", lambda name: None)
    monkeypatch.setattr(build, "find_spec", lambda name: name == "ziglang" or None)
    assert build.compiler() == [sys.executable, "-m", "ziglang", "c++"]
    monkeypatch.setattr(build, "find_spec", lambda name: None)
    with pytest.raises(build.BuildError, match=r"no C\+\+ compiler found"):
        build.compiler()


def test_a_compiler_that_fails_is_told_and_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CXX", "false")
    (tmp_path / "making-by_a_killed_process").mkdir()
    with pytest.raises(build.BuildError, match=r"false .*: exit 1"):
        build.build([], tmp_path)
    assert not list(tmp_path.iterdir())


def test_a_record_that_is_cut_short_counts_as_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As by a power failure: the library is built again."""

    def make(why: str) -> None:
        raise NoLibrary(why)

    (tmp_path / native.RECORD).write_text('{"libraries": [')
    monkeypatch.setattr(native, "FOLDER", tmp_path)
    monkeypatch.setattr(native, "_make", make)
    with pytest.raises(NoLibrary, match="are not built yet"):
        native._path()


def test_why_the_library_cannot_be_written_is_told_line_by_line(tmp_path: Path) -> None:
    copied(tmp_path)
    scenario = str(ROOT / "scenarios" / "one_circle.toml")
    command = [sys.executable, "-m", "vibro_cli", "run", scenario, "--format", "csv", "-q"]
    done = subprocess.run(
        command, cwd=tmp_path, capture_output=True, text=True,
        env={"PYTHONPATH": str(tmp_path), "PYTHONDONTWRITEBYTECODE": "1"}, check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (100, 100)),
    )  # fmt: skip
    assert done.returncode == 1
    assert done.stderr.splitlines()[1] == (
        "vibro: the kernels cannot be compiled by python -m vibro_cli.programs:"
    )
    (why,) = done.stderr.splitlines()[2:]
    assert why.startswith("vibro: [Errno 27] File too large: ")


def copied(folder: Path) -> None:
    """Copy the package without its library and most programs, with byte code written whole."""
    without = shutil.ignore_patterns("library", "*.pyc.*")
    shutil.copytree(ROOT / "vibro_cli", folder / "vibro_cli", ignore=without)
    path = folder / "vibro_cli" / "programs.py"  # to be built with a single small kernel
    few = 'return [Program("angles", (fill_angles,))]'
    text, changed = re.subn(r"return \[\n.*?\n    \]", few, path.read_text(), flags=re.DOTALL)
    assert changed == 1
    path.write_text(text)


COMPILER = """#!/bin/sh
while [ "$1" != -o ]; do shift; done
echo "$2" >> "$0.made"
sleep 0.3
: > "$2"
"""


def begun(folder: Path, text: str, compiler: str) -> subprocess.Popen[str]:
    """A process that runs a text with the package in a folder, and a compiler, a shell's script."""
    if not (folder / "vibro_cli").exists():
        copied(folder)
    path = folder / "compiler"
    path.write_text(compiler)
    path.chmod(0o755)
    return subprocess.Popen(
        [sys.executable, "-c", f"from vibro_cli.compile import native\n{text}"],
        cwd=folder, env={"PYTHONPATH": str(folder), "CXX": str(path)}, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip


def test_processes_that_wait_for_a_build_use_it(tmp_path: Path) -> None:
    processes = [begun(tmp_path, "print(native._path().name)", COMPILER) for _ in range(3)]
    assert {process.communicate()[0] for process in processes} == {"kernels-native.so\n"}
    made = (tmp_path / "compiler.made").read_text().split()
    assert made.count("kernels-native.so") == 1


def test_the_package_itself_is_built_in_a_folder_with_another_one_of_its_name(
    tmp_path: Path,
) -> None:
    """As in another checkout, whose library was brought up to date instead."""
    other = tmp_path / "other" / "vibro_cli"
    other.mkdir(parents=True)
    for name in ("__init__.py", "programs.py"):
        (other / name).touch()
    text = f"import os; os.chdir({str(other.parent)!r}); print(native._path().name)"
    found, told = begun(tmp_path, text, COMPILER).communicate()
    assert found == "kernels-native.so\n", told


def test_a_source_that_changes_during_a_build_counts_as_changed(tmp_path: Path) -> None:
    changes = f"{COMPILER}echo >> {tmp_path}/vibro_cli/kernels/world.py\n"
    text = "print(native._path().name, native.reason_to_build(native.FOLDER))"
    found, _ = begun(tmp_path, text, changes).communicate()
    assert found == "kernels-native.so have changed\n"


WAITING = """
from vibro_cli.compile import build
lock = build._work_folder

def waits(folder):
    (native.PACKAGE / "compile" / "kernel.py").open("a").write("\\n")
    return lock(folder)

build._work_folder = waits
build.build([])
print(native.reason_to_build(native.FOLDER))
"""


def test_a_source_that_changes_while_a_build_waits_counts_as_changed(tmp_path: Path) -> None:
    """The process that waits has imported the source as it was before."""
    assert begun(tmp_path, WAITING, COMPILER).communicate()[0] == "have changed\n"
