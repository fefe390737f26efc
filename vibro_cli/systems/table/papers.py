"""What runs on a table reproduce from the papers, for `vibro help papers`."""

from __future__ import annotations

from vibro_cli.systems.contract import PaperRow, ShownOfPapers

_RUN_WALL = "vibro run scenarios/table/elliptic_wall.toml --figures plan,velocities"
_RUN_SKEW = (
    "vibro run scenarios/table/skew_impact.toml --set 'balls[1].y=0.08' "
    "--figures contact_points,velocities,plan -o outputs/skew"
)

_A: tuple[PaperRow, ...] = (
    ("A conclusions", "skew impact of balls on two straight traces that cross",
     _RUN_SKEW, "`velocities`"),
    ("A conclusions", "the same on parallel traces: contact where they are less than 2√(r₁r₂) "
     "apart, here 0.098 m", "vibro run scenarios/table/skew_impact.toml --set 'balls[1].y=0.0975' "
     "--set 'balls[2].velocity_y=0' -o outputs/parallel", "an impact; none with 0.099"),
)  # fmt: skip
# Includes what C says about all kinds of bodies, in the order of the paper.
_C: tuple[PaperRow, ...] = (
    ("C fig. 1", "path of a ball inside an elliptic wall, angular velocities before and after",
     _RUN_WALL, "`plan`, `velocities`; `bounces`: `omega_pre`, `omega_post`"),
    ("C fig. 2a", "possible contact points at a wall",
     "vibro run scenarios/table/elliptic_wall.toml --set 'balls[1].x=-0.8' "
     "--figures contact_points -o outputs/wall_points", "`contact_points`"),
    ("C fig. 2b, c", "skew impact on a convex wall with tangent, normal and angles",
     "vibro run scenarios/table/convex_wall.toml --figures plan,velocities",
     "`plan`, `velocities`; `arrival_angle`, `outgoing_angle`"),
    ("C introduction", "mathematical billiards of a point, foci, Poncelet",
     "vibro portrait scenarios/table/elliptic_wall.toml --set 'balls[1].body=particle' "
     "--set 'balls[1].radius=0'", "`portrait_1`"),
    ("C introduction", "billiards of Coriolis, several balls",
     "vibro run scenarios/table/billiards.toml --figures plan", "`plan`"),
    ("C abstract", "a finite number of bodies",
     "vibro run scenarios/five_balls.toml --figures space_time", "`space_time`"),
    ("C abstract", "bodies of different forms: ball, disk, hoop, hollow ball, i_C²/r²",
     "vibro check scenarios/particle_on_arcs.toml --set 'balls[1].body=hoop'", "κ, J_P"),
    ("C introduction", "experimental k, from measured impact times",
     "vibro fit scenarios/three_arcs.toml outputs/eight/collisions.parquet "
     "--free collision.k --set collision.k=0.88", "k = 0.9"),
    ("C fig. 3a–d", "possible contact points of two balls that meet skew",
     _RUN_SKEW,
     "`contact_points`"),
    ("C fig. 4, §1", "paths, common tangent, normal, angles; central or skew",
     _RUN_SKEW,
     "`velocities`, `plan`; `arrival_angle_[ab]`, `outgoing_angle_[ab]`, `central`"),
    ("C (1)–(3)", "the law on ω in a skew impact",
     "vibro show outputs/skew/collisions.parquet --columns "
     "normal_speed_a_pre,normal_speed_a_post,omega_a_pre,omega_a_post,central",
     "`normal_speed_[ab]_pre`, `_post`, `omega_[ab]_pre`, `_post`"),
)  # fmt: skip

SHOWN = ShownOfPapers({"A": _A, "C": _C})
