"""Long fuzzing: ``python -m tests.fuzz --form toml --count 1000000 [--first 0]``."""

import argparse
import sys

from tests.fuzz.judge import MOST_MEMORY, judge, peak_memory
from tests.fuzz.mutation import FORMS

AT_ONCE = 10_000

parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
parser.add_argument("--form", choices=FORMS, default="toml")
parser.add_argument("--count", type=int, default=10_000)
parser.add_argument("--first", type=int, default=0, help="number of the first text")
chosen = parser.parse_args()
faults: list[str] = []
for first in range(chosen.first, chosen.first + chosen.count, AT_ONCE):
    last = min(first + AT_ONCE, chosen.first + chosen.count)
    found = judge(chosen.form, range(first, last))
    faults += found.faults
    print(
        f"{chosen.form} to {last}: {found.valid} valid, {found.invalid} invalid, slowest "
        f"{found.slowest:.3f} s, {peak_memory():.0f} MB, {len(faults)} faults",
        flush=True,
    )
    for fault in found.faults:
        print(fault, flush=True)
if peak_memory() > MOST_MEMORY:
    faults.append(f"{peak_memory():.0f} MB")
sys.exit(1 if faults else 0)
