"""Output on the terminal: standard streams, messages, numbers as text, progress lines."""

from __future__ import annotations

import codecs
import contextlib
import io
import json
import math
import os
import sys
import textwrap
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, TextIO, TypeVar

from vibro_cli.errors import counted, in_command, printable

_Result = TypeVar("_Result")

LEVELS = ("detail", "info", "warning", "error")
"""Levels of messages: details are printed only with -v, errors even with -q."""

_settings: dict[str, Any] = {"as_json": False, "least": "info"}


def configure_messages(as_json: bool | None = None, least: str | None = None) -> None:
    """Set the format of messages, text or JSON lines, and the lowest level to print."""
    if as_json is not None:
        _settings["as_json"] = as_json
    if least is not None:
        _settings["least"] = least


def is_printed(level: str, as_text: bool = False) -> bool:
    """Return whether messages of a level are printed; with `as_text`, only if not as JSON."""
    said = LEVELS.index(level) >= LEVELS.index(_settings["least"])
    return said and not (as_text and _settings["as_json"])


def say(text: str | Sequence[str], level: str = "info", **details: Any) -> None:
    """Print a message to standard error: lines of text, or one JSON object with the details."""
    if not is_printed(level):
        return
    lines = [text] if isinstance(text, str) else text
    if _settings["as_json"]:
        entry = {"level": level, "message": "\n".join(lines), **details}
        lines = [json_text(entry, sys.stderr)]
    try:
        print("\n".join(map(printable, lines)), file=sys.stderr, flush=True)
    except OSError:  # closed or full: only the exit code can still report it
        silence(sys.stderr)


def json_encoder(stream: TextIO | None = None, indent: int | None = None) -> json.JSONEncoder:
    """Return an encoder for a stream (default: standard output), to ASCII unless it is UTF-8.

    It raises `ValueError` for numbers that are not finite.
    """
    encoding = getattr(stream or sys.stdout, "encoding", None) or "ascii"
    plain = codecs.lookup(encoding).name != "utf-8"
    return json.JSONEncoder(indent=indent, ensure_ascii=plain, allow_nan=False)


def json_text(value: Any, stream: TextIO | None = None, indent: int | None = None) -> str:
    """Return JSON for a stream, as `json_encoder`."""
    return json_encoder(stream, indent).encode(value)


def print_found(found: Any, lines: Iterable[str], as_json: bool) -> None:
    """Print results as JSON, or as lines of text unless --quiet was given."""
    if as_json or is_printed("info"):
        print(json_text(found) if as_json else "\n".join(lines), flush=True)


def prepare_streams() -> None:
    """Keep files from taking the place of closed streams; escape letters outside the encoding.

    Writing to a closed standard output fails; a closed standard error discards everything. With
    ``PYTHONUNBUFFERED`` standard output is buffered by the line, since Python drops what one call
    of the system leaves unwritten, as on a full disk.
    """
    for number, access in enumerate((os.O_RDONLY, os.O_RDONLY, os.O_WRONLY)):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, access)  # gets the lowest free descriptor, which is this one
    if sys.stdout is None:
        sys.stdout = open(1, "w", encoding="utf-8", closefd=False)  # noqa: SIM115 (to the end)
    if sys.stderr is None:
        sys.stderr = open(2, "w", encoding="utf-8", closefd=False)  # noqa: SIM115
    if isinstance(getattr(sys.stdout, "buffer", None), io.RawIOBase):
        sys.stdout = open(1, "w", 1, sys.stdout.encoding, closefd=False)  # noqa: SIM115
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")


def drain_standard_output() -> None:
    """Flush standard output, so that Python has nothing left to write or report at exit."""
    try:
        sys.stdout.flush()
    except (OSError, ValueError):
        silence(sys.stdout)


def silence(stream: TextIO) -> None:
    """Redirect a stream that accepts no more output to the null device."""
    with contextlib.suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)


COLUMNS = 80
"""Width of messages: that of the narrowest usual terminal."""

_COPIED = ("files", "next")
INADMISSIBLE_HINT = (
    "repeat the command with --set collision.inadmissible=normal-impulse --force to have such "
    "impacts follow the normal-impulse law"
)


def quantity(value: float | None, unit: str = "", digits: int = 6) -> str:
    """Return a number with its unit, to up to six digits, or "none": 100 s, not 1e+02 s."""
    if value is None:
        return "none"
    return f"{float(f'{value:.{digits}g}'):.6g} {unit}".rstrip()


def size(number: float) -> str:
    """Return a number of bytes as text: `3.2 MB`."""
    for unit in ("B", "kB", "MB", "GB"):
        if number < 999.5:  # which three digits round to 1000
            return f"{number:.3g} {unit}"
        number /= 1000.0
    return f"{number:.3g} TB"


def duration(seconds: float) -> str:
    """Return a duration as text: `45 s`, `2 min 10 s`, `3 h 5 min`."""
    whole = round(seconds)
    if whole < 60:
        return f"{seconds:.2g} s" if seconds < 10 else f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60} s"
    return f"{whole // 3600} h {whole % 3600 // 60} min"


def lines_of(title: str, items: Mapping[str, str]) -> list[str]:
    """Return a title and labelled items below it, wrapped to 80 columns.

    Texts to be copied, such as the folder and the next command, are never broken.
    """
    lines = wrapped(title, "", " " * 4)
    for label, text in items.items():
        first = f"  {label:10} "
        lines += [first + text] if label in _COPIED else wrapped(text, first, " " * len(first))
    return lines


def wrapped(text: str, first: str = "", others: str = "", width: int = COLUMNS) -> list[str]:
    """Wrap a text to a width, which includes the prefixes of the first line and of the others."""
    return textwrap.wrap(
        text,
        width,
        initial_indent=first,
        subsequent_indent=others,
        break_long_words=False,
        break_on_hyphens=False,
    )


def without(lacking: Mapping[str, Any]) -> str:
    """Return in words what a signal left out of a run, by its manifest; empty for nothing."""
    words = ["without figures"] if "undrawn" in lacking else []
    if "unsampled_from" in lacking:
        words.append(f"without samples of its motion from t = {lacking['unsampled_from']:.6g} s")
    return " and ".join(words)


def report_command(folder: Path) -> str:
    """Return the `vibro report` command for a folder, quoted for the shell."""
    return f"vibro report {in_command(folder)}"


def summary_text(
    name: str,
    record: Mapping[str, Any],
    folder: Path | None,
    one_sided: bool = False,
    not_made: int = 0,
    exponent_error: float = math.nan,
) -> str:
    """Return the summary of a run in a few lines; `record` has the columns of the summary table.

    `not_made` is the number of impacts at its end whose law was not applied; at an inadmissible
    end there is at least one. `exponent_error` is the standard error of the greatest exponent
    (1/s), if it is known.
    """
    items = {}
    if record["status"] == "ok":
        items = {
            "impacts": _impacts(record, not_made),
            "energy": _energy(record),
            "accuracy": _accuracy(record),
        }
        if "min_normal_force" in record:
            items["validity"] = _validity(record, one_sided)
        if "lyapunov_1" in record:
            items["exponents"] = _exponents(record, exponent_error)
    if folder is not None:
        items |= {"files": printable(str(folder)), "next": report_command(folder)}
    if record["end_cause"] == "inadmissible":
        items["hint"] = INADMISSIBLE_HINT
    return "\n".join(lines_of(f"{name}: {_ending(record)}", items))


def _ending(record: Mapping[str, Any]) -> str:
    from vibro_cli.systems.columns import end_in_words

    if record["status"] != "ok":
        return f"{record['status']}: {record['reason']}"
    cause = end_in_words(record["end_cause"], record["end_time"])
    return f"ended at t = {quantity(record['end_time'], 's')}: {cause}"


_ALSO_COUNTED = {
    "bounces": ("impact on the wall", "impacts on the wall"),
    "crossings": ("crossing", "crossings"),
    "contacts": ("lasting contact", "lasting contacts"),
}
"""Columns of a summary that count events other than impacts, with their nouns."""


def _impacts(record: Mapping[str, Any], not_made: int) -> str:
    impacts = f"{record['collisions']:,}"
    if record["collisions"]:
        first, last = record["first_collision_time"], record["last_collision_time"]
        until = f" to {quantity(last, 's')}" if last != first else ""
        impacts += f", {'from' if until else 'at'} t = {quantity(first, 's')}{until}"
    last_ones = "one" if not_made < 2 else str(not_made)
    if record["end_cause"] == "inadmissible":
        impacts += f", the last {last_ones} inadmissible and not carried out"
    elif not_made:
        impacts += f", the last {last_ones} prevented"
    parts = [
        counted(record[name], *words) for name, words in _ALSO_COUNTED.items() if name in record
    ]
    quiet = record.get("quiet_from")
    ending = "" if quiet is None else f"; none possible after t = {quantity(quiet, 's')}"
    return f"{'; '.join(filter(None, (impacts, ', '.join(parts))))}{ending}"


def _energy(record: Mapping[str, Any]) -> str:
    start, end = record["energy_start"], record["energy_end"]
    text = f"{quantity(start, 'J')} at the start, {quantity(end, 'J')} at the end"
    if record["energy_drift"] is not None:
        text += f"; relative drift {quantity(record['energy_drift'], digits=2)}"
    return text


def _accuracy(record: Mapping[str, Any]) -> str:
    if record["max_gap"] is None:
        return "no impact to measure a gap at"
    return f"largest gap left at an impact {quantity(record['max_gap'], 'm', digits=2)}"


def _exponents(record: Mapping[str, Any], error: float) -> str:
    from vibro_cli.systems.tangents import ROUNDING

    rates = [value for name, value in record.items() if name.startswith("lyapunov_")]
    if rates[0] is None:
        contact = "; lasting contact across two pieces has no tangent map"
        return f"unknown{contact if record['contacts'] else ''}"
    lost = rates.count(None)
    deviation = f" ± {quantity(error, digits=2)}" if math.isfinite(error) else ""
    text = f"the greatest {quantity(rates[0], digits=4)}{deviation} 1/s"
    if lost:
        text += f"; {counted(lost, 'direction')} lost in lasting contact"
    else:
        text += f", the sum {quantity(sum(rates), '1/s', digits=2)}"
    known = -math.log(ROUNDING)
    if rates[0] * record["end_time"] <= known:
        return text
    return f"{text}; after some {quantity(known / rates[0], 's', digits=2)} no digit is accurate"


def _validity(record: Mapping[str, Any], one_sided: bool) -> str:
    from vibro_cli.mechanics.system import DRY_FRICTION

    force, friction = record["min_normal_force"], record["max_friction_demand"]
    if force < 0:
        pulled = "warning: the trace has to hold the bodies back, with a normal force down to "
        lost = "" if one_sided else "; a one-sided trace would lose them"
        return f"{pulled}{quantity(force, 'N')}{lost}"
    least = f"normal force at least {quantity(force, 'N')}"
    if friction is not None:
        needed = f"rolling needs a coefficient of friction of {quantity(friction, digits=4)}"
        if friction > DRY_FRICTION:
            return f"warning: {needed}, more than dry surfaces have; {least}"
        return f"{least}; {needed}"
    # No demand although the force is positive everywhere: nothing rolls, so nothing to report.
    return least if force > 0 else f"{least}; rolling is not possible everywhere"


_EVERY = 0.5


class _Line:
    """A progress line, redrawn at intervals and removed at the end."""

    def __init__(self) -> None:
        self._begin = time.monotonic()
        self._redrawn = self._begin
        able = sys.stderr.isatty() and os.environ.get("TERM") != "dumb"  # to remove what it shows
        self._shown = able and is_printed("info", as_text=True)
        self._drawn = False

    def end(self) -> None:
        """Remove the line, if it was drawn."""
        if self._drawn:
            self._write("")

    def _redraw(self, line: Callable[[float], str]) -> None:
        """Draw the line for the time since the beginning (s), if it is due."""
        now = time.monotonic()
        if self._shown and now - self._redrawn > _EVERY:
            self._redrawn = now
            self._write(line(now - self._begin))

    def _write(self, text: str) -> None:
        self._drawn = True
        try:
            print(f"\r\033[K{text[:COLUMNS]}", end="", file=sys.stderr, flush=True)
        except OSError:  # the terminal is gone
            return


class Progress(_Line):
    """Progress of a grid: points done of all points, impacts per second and time left."""

    def __init__(self, points: int) -> None:
        super().__init__()
        self._points = points
        self._done = 0
        self._impacts = 0
        self._lock = threading.Lock()

    def add(self, points: int, impacts: int) -> None:
        """Add solved points and impacts (from any thread); redraw the line if it is due."""
        with self._lock:
            self._done += points
            self._impacts += impacts
            self._redraw(self._line)

    def _line(self, elapsed: float) -> str:
        left = elapsed * (self._points - self._done) / self._done
        share = self._done / self._points
        return (
            f"{share:6.1%}  {self._done:,} of {self._points:,} points  "
            f"{self._impacts / elapsed:,.0f} impacts/s  {duration(left)} left"
        )


class _Work(_Line):
    """Names what is being drawn or measured, once that has taken `_EVERY` seconds."""

    def __init__(self, verb: str) -> None:
        super().__init__()
        self._verb, self._what = verb, ""
        self._begun = threading.Timer(_EVERY, lambda: self._write(self._what))
        self._begun.daemon = True
        if self._shown:
            self._begun.start()

    def update(self, what: str) -> None:
        """Show what is done next."""
        self._what = f"{self._verb}: {printable(what)}"
        if self._drawn:
            self._write(self._what)

    def end(self) -> None:
        """Remove the line, if it was drawn."""
        self._begun.cancel()
        if self._shown:
            self._begun.join()
        super().end()


@contextlib.contextmanager
def progress_shown(verb: str = "drawing") -> Iterator[None]:
    """Show what the block is drawing (figures, frames of a film) or measuring."""
    from vibro_cli.progress import WORK

    line = _Work(verb)
    try:
        with WORK.to(line.update):
            yield
    finally:
        line.end()


def each_with_progress(verb: str, results: Iterable[_Result]) -> Iterator[_Result]:
    """Yield results as they come; show what is being done while each is awaited."""
    coming = iter(results)
    while True:
        with progress_shown(verb):
            try:
                found = next(coming)
            except StopIteration:
                return
        yield found


class RunProgress(_Line):
    """Progress of a run: simulated time (s), impacts, their rate and time left to the next stop."""

    def __init__(self, name: str, stop_time: float | None, stop_impacts: int | None) -> None:
        super().__init__()
        self._name = printable(name)[:20]
        self._stops = stop_time, stop_impacts
        self._first: tuple[float, int] | None = None

    def update(self, simulated: float, impacts: int) -> None:
        """Record the progress of the run; redraw the line if it is due."""
        if self._first is None:  # not 0 where a run is continued
            self._first = simulated, impacts
        self._redraw(partial(self._line, simulated, impacts))

    def _line(self, simulated: float, impacts: int, elapsed: float) -> str:
        assert self._first is not None
        rate = (impacts - self._first[1]) / elapsed
        share = self._share(simulated, impacts)
        left = f"  {duration(elapsed * (1.0 - share) / share)} left" if share > 0.0 else ""
        return (
            f"{self._name}: t = {simulated:.6g} s  {impacts:,} impacts  {rate:,.0f} impacts/s{left}"
        )

    def _share(self, simulated: float, impacts: int) -> float:
        """Return the completed fraction of the way to the nearer stop, 0 if it is unknown."""
        assert self._first is not None
        shares = [
            (now - first) / (stop - first)
            for now, first, stop in zip((simulated, impacts), self._first, self._stops, strict=True)
            if stop is not None and stop > first
        ]
        return max(shares, default=0.0)
