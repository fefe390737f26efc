"""The program called in this process, and a simulation made by hand where the real one is slow."""

import json
import signal
import sys
import types
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

import vibro_cli.api
from tests.fake_run import FakeRun
from tests.two_balls import SCENARIO
from vibro_cli.commands.app import run_command_line


@dataclass(frozen=True)
class Outcome:
    """The result of a call of the program: its exit code and both its outputs."""

    code: int
    out: bytes
    err: str

    @property
    def text(self) -> str:
        return self.out.decode()

    @property
    def lines(self) -> list[Any]:
        """Standard output as JSON lines."""
        return [json.loads(line) for line in self.text.splitlines()]


Vibro = Callable[..., Outcome]


@pytest.fixture
def vibro(
    capfdbinary: pytest.CaptureFixture[bytes],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> Iterator[Vibro]:
    """Call the program with arguments, in an empty folder."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(warnings, "showwarning", warnings.showwarning)
    handler = signal.getsignal(signal.SIGTERM)

    def call(*arguments: object) -> Outcome:
        code = run_command_line([str(argument) for argument in arguments])
        sys.stdout.flush()
        captured = capfdbinary.readouterr()
        return Outcome(code, captured.out, captured.err.decode())

    yield call
    signal.signal(signal.SIGTERM, handler)


@pytest.fixture
def scenario(tmp_path: Path) -> Path:
    """A small valid scenario."""
    path = tmp_path / "small.toml"
    path.write_text(SCENARIO)
    return path


class ByHand:
    """A replacement for the simulation: it returns `run`, or does what `act` does."""

    def __init__(self) -> None:
        self.run = FakeRun()
        self.act: Callable[[], None] = lambda: None
        self.calls: list[tuple[str, str]] = []

    def simulate_streamed(
        self, scenario: Any, sink: Callable[[str, Any], None], engine: str, *more: Any, **asked: Any
    ) -> FakeRun:
        self.calls.append((scenario.name, engine))
        self.act()
        return self.run.told_to(sink)


@pytest.fixture
def by_hand(monkeypatch: pytest.MonkeyPatch) -> ByHand:
    """Replace the real simulation by one made by hand."""
    stand_in = ByHand()
    module: Any = types.ModuleType("vibro_cli.api")
    module.__dict__.update(vars(vibro_cli.api))
    module.simulate_streamed = stand_in.simulate_streamed
    monkeypatch.setitem(sys.modules, "vibro_cli.api", module)
    return stand_in
