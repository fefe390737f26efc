"""Conclusions of a benchmark, as sentences generated from its numbers."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby

from vibro_cli.benchmark.measurement import (
    BATCH,
    COMMAND,
    COMMAND_PART,
    COMPILED,
    EVENT_LOOP,
    GRID,
    GRID_PART,
    INTERPRETED,
    KEPT,
    KERNEL,
    SERIES,
    WITH,
    Row,
)
from vibro_cli.benchmark.methods.with_series import PAPERS_ORDER
from vibro_cli.benchmark.scenes import BY_NAME

_OURS = (COMPILED, KEPT, BATCH, INTERPRETED)
_HEYOKA = ("heyoka", "heyoka, defaults")
_FLAT = 0.2
_LEAST = 3
"""Least number of sizes whose times may be called flat."""


def conclude(rows: Sequence[Row]) -> list[str]:
    """Return the conclusions, each of one or a few sentences."""
    precise = [row for row in rows if row.part == "precision"]
    return [
        *_of_scenes(precise), *_against_heyoka(precise), *_of_lost(precise), *_of_series(precise),
        *_of_growth(rows), *_of_grid(rows), *_of_kept(rows), *_of_memory(rows), *_of_skips(rows),
        *_of_commands(rows),
    ]  # fmt: skip


def _find(rows: Sequence[Row], scene: str, method: str) -> Row | None:
    found = next((row for row in rows if (row.scene, row.method) == (scene, method)), None)
    return found if found and found.per_impact else None


def _of_scenes(rows: Sequence[Row]) -> Iterator[str]:
    """Yield our time and error on each scene, with the most exact and the fastest other method."""
    for scene in dict.fromkeys(row.scene for row in rows):
        ours = _find(rows, scene, COMPILED)
        if ours is None or ours.per_impact is None or ours.error is None:
            continue
        batch = _find(rows, scene, BATCH)
        many = f" ({_time(batch.per_impact)} in a batch)" if batch and batch.per_impact else ""
        text = (
            f"{BY_NAME[scene].title.capitalize()}: the compiled solver takes "
            f"{_time(ours.per_impact)} for an impact{many}, with a relative error of "
            f"{ours.error:.1e} in the times of the first {ours.compared}"
        )
        yield text + _fastest_other(rows, scene, ours)


def _fastest_other(rows: Sequence[Row], scene: str, ours: Row) -> str:
    others = [
        row for row in rows
        if row.scene == scene and row.method not in _OURS and row.per_impact and row.status == "ok"
    ]  # fmt: skip
    if not others or ours.per_impact is None:
        return "."
    fast = min(others, key=lambda row: row.per_impact or 0.0)
    exact = min(others, key=lambda row: row.error if row.error is not None else 1.0)
    slower, faster = (_ratio((row.per_impact or 0.0) / ours.per_impact) for row in (exact, fast))
    return (
        f"; the most exact of the others, {exact.method} ({exact.setting}), errs by "
        f"{exact.error:.1e} and takes {slower} times as long; the fastest of them, "
        f"{fast.method} ({fast.setting}), errs by {fast.error:.1e} and takes {faster} times as "
        "long."
    )


def _against_heyoka(rows: Sequence[Row]) -> Iterator[str]:
    for method in _HEYOKA:
        ratios = []
        for row in rows:
            ours = _find(rows, row.scene, COMPILED)
            if row.method != method or row.setting not in ("1e-16", "1e-09"):
                continue
            if row.per_impact and ours is not None and ours.per_impact:
                ratio = row.per_impact / ours.per_impact
                ratios.append(f"{row.scene} {ratio:.1f} at {row.setting}")
        if ratios:
            how = (
                "impacts in callbacks, fast_math"
                if method == "heyoka"
                else "a call for each impact"
            )
            yield f"Time of heyoka ({how}) over ours: {', '.join(ratios)}."


def _of_lost(rows: Sequence[Row]) -> Iterator[str]:
    lost = [row for row in rows if row.status != "ok"]
    for scene, group in groupby(lost, key=lambda row: row.scene):
        names = ", ".join(f"{row.method} {row.setting}" for row in group)
        yield f"Lost on {BY_NAME[scene].title} (other impacts than the motion's, or none): {names}."


def _of_series(rows: Sequence[Row]) -> Iterator[str]:
    """Yield the error of the papers' series on each scene, and the gain from higher orders."""
    for scene in dict.fromkeys(row.scene for row in rows if row.method == SERIES):
        own = [row for row in rows if row.scene == scene and row.method == SERIES]
        good = [row for row in own if row.error is not None]
        first = next(row for row in own if row.setting == f"order {PAPERS_ORDER}")
        text = f"The papers' series on {BY_NAME[scene].title}: at their order {PAPERS_ORDER} "
        text += (
            f"it errs by {first.error:.2g}" if first.error is not None else "it loses the motion"
        )
        text += "".join(
            f", at {row.setting} by {row.error:.2g}" for row in good if row is not first
        )
        if first in good and len(good) > 1 and first.error and good[-1].error:
            orders = float(good[-1].setting.split()[-1]) / PAPERS_ORDER
            text += (
                f": {orders:.0f} times the order gains a factor of "
                f"{first.error / good[-1].error:.1f}"
            )
        yield (
            f"{text}. At a turning point qu = 1: there the expansion of the root diverges, and the "
            "integrated series converges no faster than one over the root of the order."
        )


def _of_growth(rows: Sequence[Row]) -> Iterator[str]:
    names = {"bodies": "bodies", "arcs": "arcs of which 3 are reached", "scenarios": "scenarios"}
    for part, name in names.items():
        own = [row for row in rows if row.part == part and row.per_impact]
        if part == "scenarios":
            own = [row for row in own if (row.size or 0) >= 1000]
        if len(own) < 2:
            continue
        times = [row.per_impact or 0.0 for row in own]
        middle = 0.5 * (max(times) + min(times))
        swing = (max(times) - middle) / middle
        few = len(times) < _LEAST  # two times may agree by chance
        flat = f"flat within ±{100.0 * swing:.0f} %" if swing <= _FLAT and not few else (
            f"from {_time(times[0])} to {_time(times[-1])}, a factor of {times[-1] / times[0]:.1f}"
        )  # fmt: skip
        yield f"Time for an impact from {own[0].size} to {own[-1].size:,} {name}: {flat}."
    cores = [row for row in rows if row.part == "cores" and row.seconds]
    for row in cores[1:]:
        gain = (cores[0].seconds or 0.0) / (row.seconds or 1.0)
        yield f"{row.size} threads solve a batch {gain:.2f} times as fast as one."


def _of_grid(rows: Sequence[Row]) -> Iterator[str]:
    """Yield the times of one grid on all cores, with our batches and other methods."""
    own = [row for row in rows if row.part == "grid" and row.per_impact]
    ours = next((row for row in own if row.method == BATCH), None)
    if ours is None or not ours.per_impact:
        return
    text = (
        f"{ours.size:,} scenarios on all cores, summaries only: {_time(ours.per_impact)} for an "
        "impact"
    )
    for row in own:
        if row is not ours:
            ratio = (row.per_impact or 0.0) / ours.per_impact
            text += f"; {row.method} ({row.setting}) takes {_ratio(ratio)} times as long"
    yield f"{text}."


def _of_kept(rows: Sequence[Row]) -> Iterator[str]:
    """Yield the rate of whole grids, written to disk, as a share of the rate of their kernels."""
    own = [row for row in rows if row.part == GRID_PART and row.per_impact]
    for setting, group in groupby(own, key=lambda row: row.setting):
        pair = {row.method: row for row in group}
        if len(pair) == 2:
            alone, whole = pair[KERNEL], pair[GRID]
            share = (alone.per_impact or 0.0) / (whole.per_impact or 1.0)
            yield (
                f"A grid of {whole.size:,} scenarios on {BY_NAME[whole.scene].title}, {setting}: "
                f"{_time(whole.per_impact or 0.0)} for an impact from end to end, "
                f"{100.0 * share:.0f} % of the rate of its kernel alone."
            )


def _of_memory(rows: Sequence[Row]) -> Iterator[str]:
    own = [row for row in rows if row.part == "memory" and row.memory and row.status == "ok"]
    if own:
        listed = ", ".join(f"{(row.memory or 0) / 2**20:.0f} MiB for {row.size:,}" for row in own)
        yield f"Peak memory of vibro grid with every impact kept: {listed} scenarios."


def _of_skips(rows: Sequence[Row]) -> Iterator[str]:
    own = [row for row in rows if row.part == "skips" and row.seconds]
    for skip, group in groupby(own, key=lambda row: row.method):
        pair = {row.setting == WITH: row for row in group}
        if len(pair) == 2:
            ratio = (pair[False].seconds or 0.0) / (pair[True].seconds or 1.0)
            yield (
                f"Without skipping {skip}, on {BY_NAME[pair[True].scene].title}, a run takes "
                f"{ratio:.2f} times as long."
            )


def _of_commands(rows: Sequence[Row]) -> Iterator[str]:
    """Yield the cost of an impact in `vibro run`, compared with the event loop alone."""
    own = [row for row in rows if row.part == COMMAND_PART and row.seconds]
    for scene, group in groupby(own, key=lambda row: row.scene):
        both = list(group)
        command = [row for row in both if row.method == COMMAND]
        alone = [row for row in both if row.method == EVENT_LOOP]
        if len(command) < 2 or len(command) != len(alone):
            continue
        more = command[-1].impacts - command[0].impacts
        cost, bare = (
            ((each[-1].seconds or 0.0) - (each[0].seconds or 0.0)) / more
            for each in (command, alone)
        )
        memory = max((row.memory or 0) for row in command) / 2**20
        each = (
            f"{_time(cost)} for each of the next {more:,}, {_ratio(cost / bare)} times the "
            f"{_time(bare)} of the event loop alone"
            if cost > 0.0 and bare > 0.0
            else f"no longer for the next {more:,} that could be measured"
        )
        yield (
            f"vibro run, {scene}: {command[0].seconds:.2f} s for {command[0].impacts:,} impacts, "
            f"and {each}; at most {memory:.0f} MiB."
        )


def _ratio(value: float) -> str:
    """Return a ratio as text, with no more digits than timings justify."""
    return f"{value:.1f}" if value < 100.0 else f"{float(f'{value:.2g}'):,.0f}"


def _time(seconds: float) -> str:
    return f"{seconds * 1e6:.3g} µs"
