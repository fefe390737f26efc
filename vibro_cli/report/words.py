"""Texts of reports: end causes, numbers, validity, links."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np

from vibro_cli.mechanics.system import DRY_FRICTION
from vibro_cli.scenario.fields import Model, field_at, unit_at
from vibro_cli.scenario.problems import parsed_path
from vibro_cli.systems.columns import Column, end_in_words
from vibro_cli.systems.contract import System

_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_STATES = {"invalid": "the scenario is not possible", "failed": "the run failed"}
REFERENCES = {
    "A": "K. R. (Stevanović) Hedrih: Vibro-impact dynamics of two rolling balls along curvilinear "
    "trace. Procedia Engineering 199 (2017) 663–668. "
    "https://doi.org/10.1016/j.proeng.2017.09.120 (A)",
    "B": "K. R. (Stevanović) Hedrih: Central collision of two rolling balls: theory and examples. "
    "Advances in Theoretical and Applied Mechanics 10 (2017) 33–79. "
    "https://doi.org/10.12988/atam.2017.765 (B)",
    "C": "K. R. (Stevanović) Hedrih: From geometry, kinematics and dynamics of billiards to the "
    "extended theory of skew collision between two rolling bodies and methodology of "
    "vibro-impact dynamics (C)",
    "D": "K. R. (Stevanović) Hedrih: Non-linear dynamics of a heavy mass particle and rolling ball "
    "along curvilinear trace of series of circle arcs: phase trajectory portraits, some analogies "
    "and vibro-impacts (D)",
}


def ending(cause: str, time: float | None = None) -> str:
    """Return an end cause and its time (s), or the status of a run without one, as a sentence."""
    words = _STATES.get(cause) or end_in_words(cause, time)
    return f"{words[:1].upper()}{words[1:]}."


def named(table: str, key: str, root: Model) -> tuple[str, str]:
    """Return the title of a key in a table of the scenario (default: the key), and its unit.

    `table` is empty for a key outside tables; `root` is the model of the scenario.
    """
    path = parsed_path(f"{table}.{key}" if table else key)
    field = None if isinstance(path[-1], int) else field_at(path, root)
    return (field and field.title) or key, unit_at(path, root)


def method_of(kind: System, scenario: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the description of how a scenario is solved, and the references."""
    return (kind.method(scenario), *(REFERENCES[letter] for letter in kind.papers))


def number(value: float | None, unit: str = "", digits: int = 6) -> str:
    """Return a number with its unit, with a true minus sign and powers of ten.

    The degree sign follows without a space, unlike all other units.
    """
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return "–"
    if isinstance(value, bool | str):
        return {True: "yes", False: "no"}.get(value, str(value))
    text = f"{value + 0.0:.{digits}g}" if isinstance(value, float) else str(value)  # no −0
    mantissa, mark, power = text.partition("e")
    if mark:
        raised = str(int(power)).translate(_RAISED)
        text = f"10{raised}" if mantissa == "1" else f"{mantissa}·10{raised}"
    return f"{text.replace('-', '−')}{'' if unit == '°' else ' '}{unit}".rstrip()


def validity(
    summary: Mapping[str, Any], rolls: bool, refused: int, warnings: Sequence[str]
) -> list[str]:
    """Return sentences on whether the computed motion is physically possible.

    `rolls` is whether any body rolls; if none does, friction is not mentioned.
    """
    said, off = [], summary.get("end_cause") == "lift_off"
    force, friction = summary.get("min_normal_force"), summary.get("max_friction_demand")
    if force is not None and force < 0.0:
        said.append(
            f"The trace has to hold bodies back: the normal force falls to "
            f"{number(force, 'N')}. On a one-sided trace they would lift off."
        )
    elif force is not None:
        then = " until a body leaves the trace" if off else ": no body lifts off"
        said.append(f"The normal force is at least {number(force, 'N')}{then}.")
    if friction is not None:
        more = ", more than dry surfaces have" if friction > DRY_FRICTION else ""
        needed = number(friction, digits=4)
        said.append(f"Rolling needs a coefficient of friction of {needed}{more}.")
    elif rolls and force is not None and force <= 0.0:
        said.append("Where the normal force vanishes, no coefficient of friction permits rolling.")
    if refused:
        which = "Inadmissible or prevented impacts" if off else "Inadmissible impacts"
        said.append(f"{which}: {refused}.")
    elif summary.get("collisions"):
        said.append("Every impact is admissible: the bodies separate after it.")
    return [*said, *(f"Note: {warning}." for warning in warnings)]


def cell(table: Mapping[str, Any], column: Column, row: int) -> tuple[str, str]:
    """Return a value as a sort key and as displayed text."""
    value = table[column.name][row]
    if value is None or value is np.ma.masked or (isinstance(value, float) and math.isnan(value)):
        return "", "–"
    if isinstance(value, str):
        return value, value.replace("_", " ")
    return repr(float(value)), number(value.item(), digits=7)


def link(target: Path, beside: Path) -> str:
    """Return the relative link to `target` from a page in the folder `beside`."""
    path = os.path.relpath(target.resolve(), beside.resolve()).replace(os.sep, "/")
    return quote(os.fsencode(path))


def versions(manifest: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return the versions of the program and libraries that made the results."""
    program = manifest["program"]
    environment = manifest.get("environment", {})
    return [(program["name"], program["version"]), *environment.items()]


def flat(value: Any, path: str = "") -> dict[str, Any]:
    """Flatten plain values to a dictionary by key path: `balls[1].radius`."""
    if isinstance(value, dict):
        inner = ((f"{path}.{key}" if path else key, each) for key, each in value.items())
    elif isinstance(value, list | tuple):
        inner = ((f"{path}[{place}]", each) for place, each in enumerate(value, 1))
    else:
        return {path: value}
    return {key: leaf for name, each in inner for key, leaf in flat(each, name).items()}
