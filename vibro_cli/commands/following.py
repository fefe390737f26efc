"""Solving a scenario: its tables are written while the solver goes on."""

import contextlib
import signal
import sys
from collections.abc import Iterator
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any

from vibro_cli.commands.boundary import CommandError, Terminated, leaving
from vibro_cli.commands.solving import Wishes, figures_of, followed

if TYPE_CHECKING:
    from vibro_cli.scenario.base import AnyScenario
    from vibro_cli.storage.runs import EarlierRun, StreamedFolder
    from vibro_cli.systems.contract import Sink
    from vibro_cli.systems.stream import Streamed

_SIGNALS = ("SIGINT", "SIGTERM", "SIGHUP")


class Interruption:
    """The first signal that asks a run to end: it ends after its last event, with its tables."""

    def __init__(self) -> None:
        self.number: int | None = None

    def __bool__(self) -> bool:
        return self.number is not None

    def note(self, number: int, frame: FrameType | None) -> None:
        """Take a signal; a second one ends the program at once."""
        if self.number is not None:
            raise _exception(number)
        self.number = number

    def passed_on(self) -> None:
        """Raise what the signal would have raised, now that the tables are written."""
        if self.number is not None:
            raise _exception(self.number)


def _exception(number: int) -> BaseException:
    return KeyboardInterrupt() if number == signal.SIGINT else Terminated(number)


@contextlib.contextmanager
def _heard(interruption: Interruption) -> Iterator[None]:
    """Have signals noted, but for those that whoever started us wants ignored (nohup)."""
    before: dict[int, Any] = {}
    try:
        for name in _SIGNALS:
            number = getattr(signal, name, None)
            if number is not None and signal.getsignal(number) != signal.SIG_IGN:
                before[number] = signal.signal(number, interruption.note)
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def stream_run(
    wishes: Wishes, scenario: "AnyScenario", earlier: "EarlierRun | None", target: Path | None
) -> "Streamed":
    """Run a scenario; its tables are in the folder, and streamed, when this returns.

    A run that is interrupted is written as far as it came; then the signal is passed on.
    """
    from vibro_cli.storage.provenance import FolderRefused
    from vibro_cli.storage.runs import streamed_folder

    interruption = Interruption()
    try:
        with contextlib.ExitStack() as open_ones:
            open_ones.enter_context(leaving(wishes.unwritten(scenario.name)))
            sinks: list[Sink] = []
            folder = None
            if target is not None:
                made = streamed_folder(scenario, target, wishes.may_replace(target))
                folder = open_ones.enter_context(made)
                sinks.append(folder.add)
            if wishes.stream is not None:
                sinks.append(open_ones.enter_context(_standard_output(wishes.stream, scenario)))
            result = _followed(wishes, scenario, earlier, sinks, interruption)
            if folder is not None:
                figures = _figures(wishes, scenario, result, folder)
                folder.finish(result, figures)
    except FolderRefused as error:
        raise CommandError(f"vibro: {error}") from error
    interruption.passed_on()
    return result


def _followed(
    wishes: Wishes,
    scenario: "AnyScenario",
    earlier: "EarlierRun | None",
    sinks: "list[Sink]",
    interruption: Interruption,
) -> "Streamed":
    """The run, told of to some sinks as it goes on."""
    from vibro_cli.api import simulate_streamed
    from vibro_cli.systems import system_named

    def add(name: str, rows: Any) -> None:
        for sink in sinks:
            sink(name, rows)

    checkpoint = None if earlier is None else earlier.checkpoint
    of_system = [table.file for table in system_named(scenario.system).tables()]
    names = of_system if len(sinks) > (wishes.stream is not None) else ["collisions"]
    # A reader of the stream may be slow, or have stopped: a signal is to end the waiting for it.
    heard = _heard(interruption) if len(names) > 1 else contextlib.nullcontext()
    with followed(wishes, scenario), heard:
        return simulate_streamed(
            scenario, add, wishes.engine, checkpoint, names=names,
            interrupted=interruption.__bool__, in_background=wishes.stream is None,
        )  # fmt: skip


@contextlib.contextmanager
def _standard_output(form: str, scenario: "AnyScenario") -> "Iterator[Sink]":
    """Standard output as a sink of the collision table."""
    from vibro_cli.storage.growing import StreamedTable
    from vibro_cli.storage.runs import origin_of
    from vibro_cli.storage.schema import table_named

    streams: list[StreamedTable] = []

    def add(name: str, rows: Any) -> None:
        if name != "collisions":
            return
        if not streams:
            table = table_named(name, list(rows), scenario.system)
            streams.append(StreamedTable(sys.stdout.buffer, form, table, origin_of(scenario)))
        streams[0].add(rows)

    yield add
    for stream in streams:
        stream.finish()


def _figures(
    wishes: Wishes, scenario: "AnyScenario", result: "Streamed", folder: "StreamedFolder"
) -> dict[str, bytes]:
    """The figures of the run, which is solved again for them."""
    from vibro_cli.storage.stored import stored_run

    names = wishes.kinds_of(scenario.system)
    if not names:
        return {}
    written, summary = folder.end_tables(), result.summary_record()
    run = stored_run(written, scenario, result.checkpoint(), {}, summary)
    return figures_of(run.whole or run, names)
