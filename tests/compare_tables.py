"""Write the tables of every scenario at hand, or compare them with those written before.

``python -m tests.compare_tables write BEFORE`` before a change; after it ``write AFTER`` and
``compare BEFORE AFTER``: every file of a table must have the same bytes. Where it has not, the
columns that differ are named. The scenarios are the gallery, the hard cases and the reference
files, each as it stands and again with everything that can be asked for: turning points, friction
and sampled motion. A last word is a part of the names of those to be written or compared.

Other compilers and processors are compared likewise: ``VIBRO_LIBRARY`` names their library, which
``python -m tests.compare_tables build DIR LEVEL`` makes with ``$CXX`` (x86-64-v2, x86-64-v3,
x86-64-v4, native, or generic for a compiler of another machine).
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory

import pyarrow as pa
import pyarrow.parquet as pq

from vibro_cli.commands.app import run_command_line
from vibro_cli.systems import NAMES

HERE = Path(__file__).parent
FOLDERS = (
    HERE.parent / "scenarios",
    *(HERE.parent / "scenarios" / name for name in NAMES[1:]),
    HERE / "hard_cases",
    HERE / "systems" / "hard_cases",
    HERE / "scenes",
)
STEP = ["--set", "output.step=0.05"]
EVENTS = ["--set", "output.turning_points=true", "--set", "output.friction=0.3"]
STOP = ["--set", "stop.time=20", "--set", "stop.collisions=1000"]
TABLES = ("collisions", "events", "bounces", "motion", "summary")


def scenarios(work: Path) -> Iterator[tuple[str, list[str]]]:
    """Yield a name for each run, and the arguments that make it."""
    (work / "reference").mkdir()
    for path in (HERE / "reference").glob("*.json"):
        scenario = json.loads(path.read_text())["scenario"]
        (work / "reference" / path.name).write_text(json.dumps(scenario))
    for folder in (*FOLDERS, work / "reference"):
        for path in sorted([*folder.glob("*.toml"), *folder.glob("*.json")]):
            home = HERE.parent if folder.is_relative_to(HERE.parent) else work
            name = "_".join([*folder.relative_to(home).parts, path.stem])
            text = path.read_text()
            stop = [] if "[stop]" in text or '"stop"' in text else STOP
            yield name, [str(path), *stop]
            yield f"{name}_more", [str(path), *stop, *STEP, *([] if "system =" in text else EVENTS)]


def write(target: Path, only: str = "") -> None:
    with TemporaryDirectory() as work:
        for name, arguments in scenarios(Path(work)):
            if only in name:
                given = ["run", *arguments, "--no-figures", "-q", "-o", str(target / name)]
                code = run_command_line(given)
                if code:
                    print(f"{name}: exit code {code}")


def build_for(folder: Path, level: str) -> None:
    """Build the library for a processor."""
    from vibro_cli.compile.build import build
    from vibro_cli.programs import programs

    build(programs(), folder, levels=(level,))


def compare(before: Path, after: Path, only: str = "") -> int:
    """Print the differences; return how many tables differ."""
    different = 0
    names = {folder.name for root in (before, after) for folder in root.iterdir()}
    for name, table in product(sorted(name for name in names if only in name), TABLES):
        one, other = (root / name / f"{table}.parquet" for root in (before, after))
        if one.exists() != other.exists():
            print(f"{name}: {table}.parquet is there only once")
            different += 1
        elif one.exists() and one.read_bytes() != other.read_bytes():
            print(f"{name}: {table}: {difference(one, other)}")
            different += 1
    return different


def difference(one: Path, other: Path) -> str:
    first, second = pq.read_table(one), pq.read_table(other)
    if first.num_rows != second.num_rows:
        return f"{first.num_rows} rows before, {second.num_rows} after"
    if first.column_names != second.column_names:
        return f"columns {sorted(set(first.column_names) ^ set(second.column_names))}"
    odd = [name for name in first.column_names if not same(first[name], second[name])]
    return f"columns {odd}" if odd else "the same values in other bytes"


def same(one: pa.ChunkedArray, other: pa.ChunkedArray) -> bool:
    return bool(one.combine_chunks().equals(other.combine_chunks()))


if __name__ == "__main__":
    task, given, *rest = sys.argv[1:]
    if task == "write":
        write(Path(given), *rest)
    elif task == "build":
        build_for(Path(given), *rest)
    else:
        number = compare(Path(given), Path(rest[0]), *rest[1:])
        print(f"{number} tables differ")
        sys.exit(number > 0)
