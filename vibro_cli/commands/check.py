"""`vibro check` and `vibro verify`: validate scenarios and grids; check the files of results."""

from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from vibro_cli.commands.shared.error_handling import DONE, FAILED, MISUSED, CommandError
from vibro_cli.commands.shared.options import (
    FailFast,
    Overrides,
    json_option,
    scenario_argument,
)
from vibro_cli.commands.shared.terminal import json_text, print_found, say, size, without
from vibro_cli.errors import counted

if TYPE_CHECKING:
    from vibro_cli.grids.document import Grid
    from vibro_cli.scenario.base import AnyScenario


@dataclass(frozen=True, kw_only=True)
class CheckCommand:
    """Validate scenarios or grids and show how they are interpreted."""

    scenarios: Annotated[list[str], scenario_argument()]
    overrides: Overrides
    as_json: Annotated[
        bool, json_option(help="Print a JSON object for each file, one per line.")
    ] = False
    fail_fast: FailFast = False

    def __call__(self) -> int:
        """Print how each scenario was understood, or its problems, in the order given."""
        from vibro_cli.commands.shared.loading import check_standard_input, load_scenario_or_grid

        check_standard_input(self.scenarios)
        code = DONE
        for source in self.scenarios:
            try:
                found, lines = _understood(load_scenario_or_grid(source, self.overrides))
            except CommandError as error:
                if self.as_json:
                    refusal = {"source": source, "valid": False, "problems": error.problems}
                    print(json_text(refusal))
                if self.fail_fast or len(self.scenarios) == 1:
                    raise
                say(error.lines, "error", problems=error.problems)
                code = MISUSED
                continue
            print_found(found, lines, self.as_json)
        return code


def _understood(
    read: "tuple[AnyScenario, Any] | Grid",
) -> tuple[dict[str, Any], Iterable[str]]:
    """Return the interpretation of a scenario or grid, as plain values and as lines of text."""
    if not isinstance(read, tuple):
        found = understood_grid(read)
        return found, lines_of_grid(found)
    from vibro_cli.systems import system_named

    scenario, system = read
    kind = system_named(scenario.system)
    found = kind.understood(scenario, system)
    return found, kind.understood_lines(found)


def understood_grid(grid: "Grid") -> dict[str, Any]:
    """Return the interpretation of a grid as plain values; validate its first and last points."""
    from vibro_cli.grids.document import NO_END, may_lack_an_end
    from vibro_cli.scenario.problems import path_text

    axes = [
        {
            "paths": [path_text(path) for path in axis.paths],
            "unit": axis.kinds[0].unit,
            "values": len(axis) or None,
            **_ends(axis),
        }
        for axis in grid.design.axes
    ]
    return {
        "name": grid.name,
        "valid": True,
        "grid": grid.resolved(),
        "points": grid.design.points,
        "axes": axes,
        "first_point": _point(grid, 0),
        "last_point": _point(grid, grid.design.points - 1),
        "hint": NO_END if may_lack_an_end(grid) else None,
    }


def _ends(axis: Any) -> dict[str, Any]:
    """Return the first and last values of an axis, or the ends of the interval it is drawn from."""
    from vibro_cli.scenario.base import plain

    if axis.interval is not None:
        return {"from": axis.interval[0], "to": axis.interval[1]}
    first, last = (axis.at(index)[0] for index in (0, -1))
    return {"from": plain(first), "to": plain(last)}


def _point(grid: "Grid", index: int) -> str | None:
    """Return why a point is not a valid scenario, or None if it is valid."""
    import numpy as np

    from vibro_cli.assemble import build_any
    from vibro_cli.grids.document import document_at, reason_of
    from vibro_cli.scenario.loading import any_scenario_of
    from vibro_cli.scenario.problems import ScenarioError

    values = {path: column[0] for path, column in grid.design.columns(np.array([index])).items()}
    try:
        build_any(any_scenario_of(document_at(grid.base, values)))
    except ScenarioError as error:
        return reason_of(error)
    return None


def lines_of_grid(found: dict[str, Any]) -> Iterator[str]:
    """Yield the interpretation of a grid as lines of text."""
    grid = found["grid"]
    yield f"{found['name']}: valid grid of {counted(found['points'], 'point')}"
    yield f"  mode {grid['mode']}"
    for axis in found["axes"]:
        values = "random" if axis["values"] is None else counted(axis["values"], "value")
        ends = " to ".join(_shown(axis[key]) for key in ("from", "to"))
        yield f"  axis {', '.join(axis['paths'])}: {values}, {ends} {axis['unit']}".rstrip()
    kept = grid["keep"]
    columns = "all columns" if kept["columns"] is None else ", ".join(kept["columns"])
    yield "  kept: " + (
        f"summaries and every impact ({columns})" if kept["collisions"] else "summaries"
    )
    for which in ("first", "last"):
        if found[f"{which}_point"] is not None:
            yield f"  warning: the {which} point is invalid: {found[f'{which}_point']}"
    if found["hint"] is not None:
        yield f"  hint: {found['hint']}"


def _shown(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)


@dataclass(frozen=True, kw_only=True)
class VerifyCommand:
    """Check folders of results against their checksums. Exit code 1: some file is not intact."""

    folders: Annotated[
        list[Path],
        typer.Argument(metavar="DIR", help="Folders of results.", show_default=False),
    ]
    as_json: Annotated[
        bool, json_option(help="Print a JSON object for each folder, one per line.")
    ] = False

    def __call__(self) -> int:
        """Print which files are missing or damaged in each folder."""
        from vibro_cli.grids.dataset import NoManifest, verify

        sound, ours = True, True
        for folder in self.folders:
            try:
                verdict = verify(folder)
            except NoManifest as error:
                ours = False
                why = str(error)
                if self.as_json:
                    print(json_text({"folder": str(folder), "sound": False, "reason": why}))
                say(f"vibro: {why}" if folder.exists() else why, "error")
                continue
            sound = sound and verdict.sound
            if self.as_json:
                print(json_text({"folder": str(folder), "sound": verdict.sound, **asdict(verdict)}))
            for finding in verdict.findings:
                text = f"{folder / finding.file}: {finding.state}: {finding.detail}"
                say(text, "error", file=finding.file, state=finding.state)
            if verdict.missing_chunks:
                chunks = counted(verdict.missing_chunks, "chunk")
                say(f"{folder}: {chunks} not finished; vibro grid continues with them", "error")
            state = "intact" if verdict.sound else "not intact"
            files = counted(verdict.files, "file")
            say(f"{folder}: {state} ({verdict.kind}, {files}, {size(verdict.bytes)})")
            if verdict.lacking:
                left = f"{without(verdict.lacking)}; vibro run --continue completes it"
                say(f"{folder}: ended by a signal, {left}", "warning")
        if not ours:
            return MISUSED
        return DONE if sound else FAILED
