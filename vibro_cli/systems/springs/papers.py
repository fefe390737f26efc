"""What runs of bodies on springs reproduce from the papers, for `vibro help papers`."""

from __future__ import annotations

from vibro_cli.systems.contract import PaperRow, ShownOfPapers

_RUN_SPRINGS = "vibro run scenarios/springs/common_origin.toml --figures scene,portrait"

_C: tuple[PaperRow, ...] = (
    ("C (4)", "ω₀; periods on the springs", "vibro check scenarios/springs/common_origin.toml",
     "ω₀, periods"),
    ("C (5), b*", "phase trajectory; three singular points, their trigger",
     "vibro portrait scenarios/springs/two_disks.toml",
     "`portrait_1`, `portrait_2`: 0, ∓√(l² − b²)"),
    ("C a*1, a*2", "one singular point: spring unstressed (l = b) or stressed (l < b)",
     "vibro portrait scenarios/springs/two_disks.toml --set 'balls[1].spring.length=1' "
     "--set 'balls[2].spring.length=1.2' -o outputs/stress", "column “spring”; `portrait_1`"),
    ("C part 3, a*, b*", "l ≤ b or l > b: one singular point or three",
     "vibro portrait scenarios/springs/two_disks.toml --vary 'balls[1].spring.length=0.5:2:4' "
     "-o outputs/springs_family", "`family`"),
    ("C fig. 5a", "disks, springs and feet, first collision; common origin, r₂ < r₁, contact at "
     "2√(r₁r₂)", _RUN_SPRINGS,
     "`scene`; `x_a`, `x_b` (C's disk 2 is the left one here)"),
    ("C fig. 5b", "portraits with energies and the first jumps",
     _RUN_SPRINGS, "`portrait_1`, `portrait_2`"),
    ("C (6), (7)", "time, arrival ω",
     "vibro show outputs/common_origin/collisions.parquet --columns t,omega_a_pre,omega_b_pre",
     "`t`, `omega_[ab]_pre`"),
)  # fmt: skip
_SYMBOLS = (
    ("x_i, c, l₀, b₀ (C)", "`displacement_a`, `spring.stiffness`, `.length`, `.height`",
     "m, N/m, m, m"),
)  # fmt: skip

SHOWN = ShownOfPapers({"C": _C}, _SYMBOLS)
