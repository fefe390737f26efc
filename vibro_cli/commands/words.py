"""Numbers and causes in words, for people at a terminal."""

import shlex
import textwrap
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from vibro_cli.commands.streams import printable

COLUMNS = 80
"""Width of what is said, which the narrowest usual terminal has."""

_COPIED = ("files", "next")
_INADMISSIBLE = (
    "--set collision.inadmissible=normal-impulse goes on, with Newton's law for such impacts"
)

END_CAUSES = {
    "time": "the time asked for was reached",
    "collisions": "the number of impacts asked for was reached",
    "no_more_collisions": "no further impact is possible",
    "inadmissible": "after the impact law two bodies would go through one another",
    "end_of_trace": "a body came to an end of the trace",
    "lift_off": "a body left the trace",
    "rest": "all bodies are at rest",
    "bounces": "the number of impacts on the wall asked for was reached",
    "wall_contact": "a ball comes to roll along the wall, which is not solved",
    "accumulation": "impacts follow one another without end in finite time, which is not solved",
}


def quantity(value: float | None, unit: str = "", digits: int = 6) -> str:
    """A number with its unit to some digits, or "none"."""
    if value is None:
        return "none"
    return f"{value:.{digits}g} {unit}".rstrip()


def count(number: int, one: str, several: str) -> str:
    """A number of things: `1 impact`, `3 impacts`, `24,000 impacts`."""
    return f"{number:,} {one if number == 1 else several}"


def size(number: float) -> str:
    """A number of bytes: `3.2 MB`."""
    for unit in ("B", "kB", "MB", "GB"):
        if number < 1000.0:
            return f"{number:.3g} {unit}"
        number /= 1000.0
    return f"{number:.3g} TB"


def duration(seconds: float) -> str:
    """A time in the units people use: `45 s`, `2 min 10 s`, `3 h 5 min`."""
    whole = round(seconds)
    if whole < 60:
        return f"{seconds:.2g} s" if seconds < 10 else f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60} s"
    return f"{whole // 3600} h {whole % 3600 // 60} min"


def lines_of(title: str, items: Mapping[str, str]) -> str:
    """A title and what there is to say below it, each item by its label, in lines of 80 columns.

    What is to be copied, the name of a folder and the next command, is never broken.
    """
    lines = wrapped(title, "", " " * 4)
    for label, text in items.items():
        first = f"  {label:10} "
        lines += [first + text] if label in _COPIED else wrapped(text, first, " " * len(first))
    return "\n".join(lines)


def wrapped(text: str, first: str, others: str) -> list[str]:
    """A text in lines of 80 columns, what the first and the others begin with included."""
    return textwrap.wrap(
        text,
        COLUMNS,
        initial_indent=first,
        subsequent_indent=others,
        break_long_words=False,
        break_on_hyphens=False,
    )


def report_command(folder: Path) -> str:
    """The command that comes after one that has filled a folder, to be typed as it stands."""
    return f"vibro report {shlex.quote(printable(str(folder)))}"


def summary_text(
    name: str, record: Mapping[str, Any], folder: Path | None, one_sided: bool = False
) -> str:
    """The summary of a run in a few lines; `record` has the columns of the summary table."""
    items = {}
    if record["status"] == "ok":
        items = {
            "impacts": _impacts(record),
            "energy": _energy(record),
            "accuracy": _accuracy(record),
        }
        if "min_normal_force" in record:
            items["validity"] = _validity(record, one_sided)
        if "lyapunov_1" in record:
            items["exponents"] = _exponents(record)
    if folder is not None:
        items |= {"files": printable(str(folder)), "next": report_command(folder)}
    if record["end_cause"] == "inadmissible":
        items["hint"] = _INADMISSIBLE
    return lines_of(f"{name}: {_ending(record)}", items)


def _ending(record: Mapping[str, Any]) -> str:
    if record["status"] != "ok":
        return f"{record['status']}: {record['reason']}"
    cause = END_CAUSES.get(record["end_cause"], record["end_cause"])
    return f"ended at t = {quantity(record['end_time'], 's')}: {cause}"


def _impacts(record: Mapping[str, Any]) -> str:
    impacts = f"{record['collisions']:,}"
    if record["collisions"]:
        first, last = record["first_collision_time"], record["last_collision_time"]
        until = f" to {quantity(last, 's')}" if last != first else ""
        impacts += f", {'from' if until else 'at'} t = {quantity(first, 's')}{until}"
    if "bounces" in record:
        return f"{impacts}; {count(record['bounces'], 'impact', 'impacts')} on the wall"
    contacts = count(record["contacts"], "lasting contact", "lasting contacts")
    quiet = record.get("quiet_from")
    ending = "" if quiet is None else f"; none possible after t = {quantity(quiet, 's')}"
    if "crossings" in record:
        contacts = f"{count(record['crossings'], 'crossing', 'crossings')}, {contacts}"
    return f"{impacts}; {contacts}{ending}"


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


def _exponents(record: Mapping[str, Any]) -> str:
    rates = [value for name, value in record.items() if name.startswith("lyapunov_")]
    if rates[0] is None:
        contact = "; lasting contact across two pieces has no tangent map"
        return f"unknown{contact if record['contacts'] else ''}"
    lost = rates.count(None)
    text = f"the greatest {quantity(rates[0], '1/s', digits=4)}"
    if lost:
        return f"{text}; {count(lost, 'direction', 'directions')} lost in lasting contact"
    return f"{text}, the sum {quantity(sum(rates), '1/s', digits=2)}"


def _validity(record: Mapping[str, Any], one_sided: bool) -> str:
    force, friction = record["min_normal_force"], record["max_friction_demand"]
    if force < 0:
        pulled = "warning: the trace has to hold the bodies back, with a normal force down to "
        lost = "" if one_sided else "; a one-sided trace would lose them"
        return f"{pulled}{quantity(force, 'N')}{lost}"
    least = f"normal force at least {quantity(force, 'N')}"
    if friction is not None:
        needed = quantity(friction, digits=4)
        return f"{least}; rolling needs a coefficient of friction of {needed}"
    # With a force everywhere some friction suffices: there is none to tell of where nothing rolls.
    return least if force > 0 else f"{least}; rolling is not possible everywhere"
