"""Numbers and causes in words, for people at a terminal."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from vibro_cli.commands.streams import printable

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
    """A number of things: `1 impact`, `3 impacts`."""
    return f"{number} {one if number == 1 else several}"


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


def summary_text(name: str, record: Mapping[str, Any], folder: Path | None) -> str:
    """The summary of a run in a few lines; `record` has the columns of the summary table."""
    lines = [f"{name}: {_ending(record)}"]
    if record["status"] == "ok":
        lines.append(f"  impacts    {_impacts(record)}")
        lines.append(f"  energy     {_energy(record)}")
        lines.append(f"  accuracy   {_accuracy(record)}")
        if "min_normal_force" in record:
            lines.append(f"  validity   {_validity(record)}")
    if folder is not None:
        lines.append(f"  files      {printable(str(folder))}")
    return "\n".join(lines)


def _ending(record: Mapping[str, Any]) -> str:
    if record["status"] != "ok":
        return f"{record['status']}: {record['reason']}"
    cause = END_CAUSES.get(record["end_cause"], record["end_cause"])
    return f"ended at t = {quantity(record['end_time'], 's')}: {cause}"


def _impacts(record: Mapping[str, Any]) -> str:
    impacts = str(record["collisions"])
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


def _validity(record: Mapping[str, Any]) -> str:
    force, friction = record["min_normal_force"], record["max_friction_demand"]
    if force < 0:
        return (
            f"the trace has to hold the bodies back: normal force down to {quantity(force, 'N')}; "
            "a one-sided trace would lose them"
        )
    if friction is None:
        return f"normal force at least {quantity(force, 'N')}; rolling is not possible everywhere"
    return (
        f"normal force at least {quantity(force, 'N')}; rolling needs a coefficient of friction "
        f"of {quantity(friction, digits=4)}"
    )
