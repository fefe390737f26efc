"""What of the papers is shown by which command, as Markdown: `vibro help papers`."""

Row = tuple[str, str, str, str]
"""Reference, what it says, the command that shows it, and where it then stands."""

RUN_CIRCLE = "vibro run scenarios/one_circle.toml --figures scene,velocities,energy"
RUN_ARCS = "vibro run scenarios/three_arcs.toml --figures velocities"
RUN_TWO = (
    "vibro run scenarios/one_circle.toml --set balls[1].rate=2.5 --set stop.collisions=2 "
    "--figures portrait,plan -o outputs/circle_two"
)
RUN_LIMITERS = (
    "vibro run scenarios/one_circle.toml --set trace.closed=false "
    """--set 'trace.start_slope="-60 deg"' --set 'trace.arcs[1].end_slope="60 deg"' """
    "--set ends.left.wall=0.8 --set ends.right.wall=0.8 --set balls[1].body=particle "
    "--set balls[2].body=particle --set balls[1].rate=3.2 --set stop.collisions=6 "
    "--figures scene,portrait -o outputs/limiters"
)
RUN_LINE = "vibro run scenarios/horizontal_line_2_3.toml --figures contact_points,velocities"
RUN_WALL = "vibro run scenarios/table/elliptic_wall.toml --figures plan,velocities"
RUN_SKEW = (
    "vibro run scenarios/table/skew_impact.toml --set balls[1].y=0.08 "
    "--figures contact_points,velocities,plan -o outputs/skew"
)
RUN_SPRINGS = "vibro run scenarios/springs/common_origin.toml --figures scene,portrait"
RUN_DISKS = "vibro run scenarios/disk_on_arcs.toml --figures scene,energy_portrait"
_SERIES = "report, section “Exact times and the papers' series”"
_TABLE_1 = "report, section “Translation and rolling”"

A: tuple[Row, ...] = (
    ("A abstract, §1", "two balls or disks on a trace of three arcs, successive central impacts",
     "vibro run scenarios/three_arcs.toml --set stop.collisions=8 --figures energy_portrait "
     "-o outputs/eight", "the impacts, 1, 2, …: `collisions`"),
    ("A fig. 1a", "kinematic plan of velocities of two balls on a curved line",
     RUN_ARCS, "`velocities`: C, P, T, v, ω, tangent"),
    ("A fig. 1b", "portraits of both balls on a circle with the jumps of their representative "
     "points", "vibro run scenarios/one_circle.toml --set balls[1].rate=2.5 --set "
     "stop.collisions=3 --set collision.k=1 --figures portrait -o outputs/circle_three",
     "`portrait_1`, `portrait_2`: N₀ is the square, N before an impact "
     "open, after it full, with the number of the impact"),
    ("A fig. 2a", "model: a ball on three arcs", "vibro run scenarios/three_arcs.toml --set "
     "balls[2].arc=2 --set balls[2].angle=0.3 --set stop.time=1 --figures scene -o outputs/model",
     "`scene`: O, R, C, P, φ, ψ (R₂ is A's R₀)"),
    ("A fig. 2b–d, (5)", "compositions of portraits for different radii",
     "vibro portrait scenarios/three_arcs.toml --vary trace.arcs[2].radius=0.3:6:4",
     "`portrait_1_2`, `family`"),
    ("A abstract, §4, end", "jumps of velocity and energy on the curves of constant energy",
     "vibro run scenarios/three_arcs.toml --set stop.collisions=8 --figures energy_portrait "
     "-o outputs/eight",
     "`energy_portrait_1`, `energy_portrait_2`"),
    ("A (1)–(3)", "moments of momentum kept, k on ω, outgoing ω",
     "vibro show outputs/three_arcs/collisions.parquet --columns "
     "n,omega_a_pre,omega_b_pre,omega_a_post,omega_b_post", "`omega_[ab]_pre`, `omega_[ab]_post`"),
    ("A (4), (6)", "κ, β, λ₁, λ₂", "vibro check scenarios/one_circle.toml",
     "κ, J_P, ω², modulus, periods, β, λ₁ = R/r₁, λ₂ = r₂/r₁"),
    ("A (7)–(9)", "time as an elliptic integral, and its series of order 2",
     "vibro report outputs/circle_three", _SERIES),
    ("A §4", "n successive impacts; variation of parameters",
     "vibro grid scenarios/grids/three_arcs_grid.toml", "`summary.parquet`, all impacts"),
    ("A conclusions", "skew impact of balls on two straight traces that cross",
     RUN_SKEW, "`velocities`"),
    ("A conclusions", "the same on parallel traces: contact where they are less than 2√(r₁r₂) "
     "apart, here 0.098 m", "vibro run scenarios/table/skew_impact.toml --set balls[1].y=0.0975 "
     "--set balls[2].velocity_y=0 -o outputs/parallel", "an impact; none with 0.099"),
)  # fmt: skip
B: tuple[Row, ...] = (
    ("B fig. 1, (1)–(5), fig. A1a", "central impact of two bodies in translation",
     "vibro run scenarios/translation.toml --figures velocities", "`velocities`; −1/3 and 5/3 m/s"),
    ("B (6)", "impulse in N s",
     "vibro show outputs/translation/collisions.parquet --columns impulse", "`impulse`: 8/3 N s"),
    ("B I.2, 1*, 2*, 3*; (9)–(12)", "plastic, elastic, arbitrary; losses, Carnot's theorem",
     "vibro run scenarios/translation.toml --set collision.k=0 -o outputs/plastic",
     "`energy_loss`"),
    ("B I.2, second *", "equal and opposite speeds: that they stay so holds for equal masses only",
     "vibro show outputs/translation/collisions.parquet --columns speed_a_post,speed_b_post",
     "−1/3 and 5/3 m/s"),
    ("B fig. 2", "possible contact points of equal balls",
     "vibro run scenarios/horizontal_line_1_2.toml --set balls[2].radius=0.2 --set "
     "balls[2].omega=-1 --figures contact_points -o outputs/equal", "`contact_points`"),
    ("B figs 3a–d, 4", "the same of balls of different radii: T₀ above the centre of the smaller, "
     "below that of the larger", RUN_LINE, "`contact_points`"),
    ("B fig. 5, fig. A1b", "component velocities at T₀, arrival and outgoing; rolling bodies",
     RUN_LINE, "`velocities`"),
    ("B (7), (8), (18), (19)", "kinetic energies before and after",
     "vibro show outputs/horizontal_line_2_3/collisions.parquet --columns "
     "kinetic_energy_a_pre,kinetic_energy_a_post",
     "`kinetic_energy_[ab]_pre`, `_post`"),
    ("B (13)–(17), (20)–(23)", "law, ω⁺, moment of impulse, loss, generalised Carnot's theorem",
     "vibro show outputs/horizontal_line_2_3/collisions.parquet --columns "
     "omega_a_post,omega_b_post,impulse_moment,energy_loss", "`impulse_moment`, `energy_loss`"),
    ("B II.2, first and second *", "k = 0: equal ω after it; k = 1",
     "vibro report outputs/horizontal_line_2_3", _TABLE_1 + ", its last two rows"),
    ("B II.2, third *", "J₁ω₁ + J₂ω₂ = 0 gives ω⁺ = −kω",
     "vibro run scenarios/horizontal_line_2_3.toml --set balls[1].omega=32 --set "
     "balls[2].omega=-243 --set collision.k=0.9 -o outputs/opposite", "−28.8 and 218.7 rad/s"),
    ("B example a*", "ratios 1/33, 32/33", "vibro run scenarios/horizontal_line_1_2.toml",
     "`omega_[ab]_post`: 31/33, 64/33 rad/s"),
    ("B example b*", "ratios 1/244, 243/244", "vibro run scenarios/horizontal_line_1_3.toml",
     "`omega_[ab]_post`"),
    ("B example c*", "ratios 32/275, 243/275", RUN_LINE, "`omega_[ab]_post`"),
    ("B examples", "masses and J_P of balls", "vibro check scenarios/horizontal_line_1_2.toml",
     "m = (4/3)πρr³, J_P = (28/15)πρr⁵"),
    ("B table 1", "analogy of translation and rolling, for every impact",
     "vibro report outputs/horizontal_line_2_3", _TABLE_1),
    ("B fig. 6", "model: two balls in a circle", RUN_CIRCLE,
     "`scene`: φ, R, C, P; `velocities`: T, tangent, ω"),
    ("B fig. 7", "plan of angular velocities and component velocities on a circle",
     RUN_CIRCLE, "`velocities`"),
    ("B (24)–(28), (37)–(40), (48)–(51)", "J_P, κ, β, λ₁, λ₂, ω_i², modulus k_i",
     "vibro check scenarios/one_circle.toml", "as A (6)"),
    ("B (29)–(36), (41)–(47), (52)–(57), (62)–(69), (71), (72), (75)–(82), (85)–(90)",
     "motion between impacts, n-th intervals, branches",
     "vibro show outputs/one_circle/collisions.parquet --columns "
     "n,dt,angle_a,angle_b,rate_a_pre,rate_b_pre,rate_a_post,rate_b_post",
     "`dt`, `angle_[ab]`, `rate_[ab]_pre`, `_post`"),
    ("B (58)–(61), (73), (74), (83), (84)", "truncated series beside the exact time",
     "vibro report outputs/one_circle", _SERIES),
    ("B III.3.2", "directions after an impact", "vibro show outputs/one_circle/collisions.parquet "
     "--columns n,speed_a_post,speed_b_post", "signs of `speed_[ab]_post`"),
    ("B III.3.5", "closed and open trajectories, separatrix; jumps between them",
     "vibro run scenarios/one_circle.toml --set balls[1].rate=5 --set collision.k=1 --set "
     "stop.collisions=12 --figures energy_portrait -o outputs/progressive",
     "`energy_portrait_2`; `regime_[ab]_pre`, `_post`"),
    ("B III.3.5", "the same as a table", "vibro report outputs/progressive",
     "report, section “Jumps between oscillation and progression”"),
    ("B fig. 8", "portraits with the first two collisions", RUN_TWO,
     "`portrait_2` (upper), `portrait_1` (lower)"),
    ("B fig. 9", "configurations at the first two impacts", RUN_TWO, "`plan`"),
    ("B III.3.6", "energy jumps of both balls", RUN_CIRCLE, "`energy`"),
    ("B appendix", "m v̇ = F, J_P ω̇ = M: motion under gravity on inclined lines",
     "vibro run scenarios/line_between_valleys.toml --figures scene,portrait",
     "`scene`, `portrait_1`"),
    ("B references 28, 29 (cited)", "two particles on a circle between impact limiters, here "
     "without their Coulomb friction", RUN_LIMITERS,
     "`scene`, `portrait_2`; the walls: table of events"),
)  # fmt: skip
C: tuple[Row, ...] = (
    ("C fig. 1", "path of a ball inside an elliptic wall, angular velocities before and after",
     RUN_WALL, "`plan`, `velocities`; `bounces`: `omega_pre`, `omega_post`"),
    ("C fig. 2a", "possible contact points at a wall",
     "vibro run scenarios/table/elliptic_wall.toml --set balls[1].x=-0.8 "
     "--figures contact_points -o outputs/wall_points", "`contact_points`"),
    ("C fig. 2b, c", "skew impact on a convex wall with tangent, normal and angles",
     "vibro run scenarios/table/convex_wall.toml --figures plan,velocities",
     "`plan`, `velocities`; `arrival_angle`, `outgoing_angle`"),
    ("C introduction", "mathematical billiards of a point, foci, Poncelet",
     "vibro portrait scenarios/table/elliptic_wall.toml --set balls[1].body=particle "
     "--set balls[1].radius=0", "`portrait_1`"),
    ("C introduction", "billiards of Coriolis, several balls",
     "vibro run scenarios/table/billiards.toml --figures plan", "`plan`"),
    ("C abstract", "a finite number of bodies",
     "vibro run scenarios/five_balls.toml --figures space_time", "`space_time`"),
    ("C abstract", "bodies of different forms: ball, disk, hoop, hollow ball, i_C²/r²",
     "vibro check scenarios/particle_on_arcs.toml --set balls[1].body=hoop", "κ, J_P"),
    ("C introduction", "experimental k, from measured instants of impacts",
     "vibro fit scenarios/three_arcs.toml outputs/eight/collisions.parquet "
     "--free collision.k --set collision.k=0.88", "k = 0.9"),
    ("C fig. 3a–d", "possible contact points of two balls that meet skew",
     RUN_SKEW,
     "`contact_points`"),
    ("C fig. 4, §1", "paths, common tangent, normal, angles; central or skew",
     RUN_SKEW,
     "`velocities`, `plan`; `arrival_angle_[ab]`, `outgoing_angle_[ab]`, `central`"),
    ("C (1)–(3)", "the law on ω in a skew impact",
     "vibro show outputs/skew/collisions.parquet --columns "
     "normal_speed_a_pre,normal_speed_a_post,omega_a_pre,omega_a_post,central",
     "`normal_speed_[ab]_pre`, `_post`, `omega_[ab]_pre`, `_post`"),
    ("C (4)", "ω₀; periods on the springs", "vibro check scenarios/springs/common_origin.toml",
     "ω₀, periods"),
    ("C (5), b*", "phase trajectory; three singular points, their trigger",
     "vibro portrait scenarios/springs/two_disks.toml",
     "`portrait_1`, `portrait_2`: 0, ∓√(l² − b²)"),
    ("C a*1, a*2", "one singular point: spring unstressed (l = b) or stressed (l < b)",
     "vibro portrait scenarios/springs/two_disks.toml --set balls[1].spring.length=1 "
     "--set balls[2].spring.length=1.2 -o outputs/stress", "column “spring”; `portrait_1`"),
    ("C part 3, a*, b*", "l ≤ b or l > b: one singular point or three",
     "vibro portrait scenarios/springs/two_disks.toml --vary balls[1].spring.length=0.5:2:4 "
     "-o outputs/springs_family", "`family`"),
    ("C fig. 5a", "disks, springs and feet, first collision; common origin, r₂ < r₁, contact at "
     "2√(r₁r₂)", RUN_SPRINGS,
     "`scene`; `x_a`, `x_b` (C's disk 2 is the left one here)"),
    ("C fig. 5b", "portraits with energies and the first jumps",
     RUN_SPRINGS, "`portrait_1`, `portrait_2`"),
    ("C (6), (7)", "time, arrival ω",
     "vibro show outputs/common_origin/collisions.parquet --columns t,omega_a_pre,omega_b_pre",
     "`t`, `omega_[ab]_pre`"),
)  # fmt: skip
D: tuple[Row, ...] = (
    ("D fig. 1a, (1), (2)", "a particle on a series of arcs",
     "vibro run scenarios/lone_particle.toml --figures scene,energy_portrait", "`scene`"),
    ("D fig. 1b, (3), (4)", "a ball or disk on the same arcs", RUN_DISKS, "`scene`"),
    ("D fig. 1c–e", "compositions of portraits for different radii",
     "vibro portrait scenarios/ball_on_arcs.toml --vary trace.arcs[2].radius=0.3:6:4", "`family`"),
    ("D analogy", "particle, disk and ball on one trace",
     "vibro portrait scenarios/particle_on_arcs.toml --compare balls[1].body=particle,disk,ball",
     "`comparison`"),
    ("D analysis", "trigger, saddle, homoclinic figure eight and its condition "
     "(R − r)(1 − cos θ) ≥ (R + R₀)(1 − cos J), θ at the ends of the trace, J at the junctions",
     "vibro portrait scenarios/lone_particle.toml", "`portrait_1`: “barriers”, the differences"),
    ("D title", "a series of n arcs", "vibro portrait scenarios/turning_five_arcs.toml",
     "`portrait_1_2`"),
    ("D methodology", "jumps from one trajectory to another in the figure eight", RUN_DISKS,
     "`energy_portrait_1`; `eight_[ab]_pre`, `_post`"),
    ("D methodology", "the same as a table", "vibro report outputs/disk_on_arcs",
     "report, section “Jumps across the figure eight”"),
    ("D perspectives", "the trace turns; triggers multiply where a valley lies on the axis",
     "vibro portrait scenarios/turning_valley.toml --vary trace.turning.rate=2.5:4.5:5",
     "`family`"),
    ("D perspectives", "vibro-impacts on it",
     "vibro run scenarios/turning_valley.toml --figures energy_portrait", "`energy_portrait_1`"),
)  # fmt: skip

SYMBOLS: tuple[tuple[str, str, str], ...] = (
    ("bodies 1, 2", "`a` and `b` of a row, the left and the right one; `ball_a`, `ball_b`", ""),
    ("t₀: arrival, impact", "`_pre`; on a table `arrival_`", ""),
    ("t₀ + τ: outgoing", "`_post`; on a table `outgoing_`", ""),
    ("φ_i in valleys, φ₂ on the hump", "`angle_a`, `angle_b`: φ, ψ", "rad"),
    ("φ̇_i", "`rate_a_pre`, …", "rad/s"),
    ("ω_P", "`omega_a_pre`, … (about the contact point P)", "rad/s"),
    ("v_C", "`speed_a_pre`, …", "m/s"),
    ("representative points N", "marks of `portrait`, `energy_portrait`", ""),
    ("T₀, T₁₂, T₁₃; α", "`contact_points`; `arrival_angle`", "rad"),
    ("J_P = κ m r², κ = 1 + i_C²/r²", "J_P, κ of `vibro check`", "kg m², –"),
    ("k, coefficient of restitution", "`collision.k`", "–"),
    ("ω_i² = 2g/κ(R − r)", "`omega_squared` of `vibro check --json`", "1/s²"),
    ("k_i, modulus", "`modulus` of `vibro check --json`", "–"),
    ("β, λ₁, λ₂", "`beta`, `lambda_1`, `lambda_2` of `vibro check --json`", "rad, –"),
    ("E_k(t₀), E_k(t₀ + τ)", "`kinetic_energy_a_pre`, …", "J"),
    ("E_i = const", "`energy_a_pre`, …", "J"),
    ("ΔE_k", "`energy_loss`", "J"),
    ("K = ∫F dt", "`impulse`", "N s"),
    ("L, moment of impulse", "`impulse_moment`", "N m s"),
    ("oscillatory, progressive", "`regime_a_pre`, …; on a table always progressive: no force", ""),
    ("homoclinic “eight”", "`eight_a_pre`, …; orange in `energy_portrait`", ""),
    ("x_i, c, l₀, b₀ (C)", "`displacement_a`, `spring.stiffness`, `.length`, `.height`",
     "m, N/m, m, m"),
    ("time between impacts", "`dt`", "s"),
)  # fmt: skip

_NOT_SOLVED = """Not solved, and refused: two balls on two curvilinear traces, parallel or crossing
(conclusions of A and B). Their line of centres leaves the planes of both traces, and the papers'
law, which acts on the angular velocities alone, has nothing to say of that direction; with unequal
radii it would be inadmissible as a rule. A scenario has one trace; straight ones, parallel or
crossing, are a table (`vibro help table-system`). Mentioned by the papers only, and not solved:
deformable balls, bearings, dampers, and Coulomb friction beside impact limiters.
"""


_BEFORE = """\
The commands read the gallery from the folder `scenarios/` (`vibro new --all` writes it); some look
at results of those above."""


def papers() -> str:
    """Every figure and equation of the papers with the command that shows it; the symbols."""
    from vibro_cli.commands.help import table

    parts = [_BEFORE]
    for name, rows in (("A", A), ("B", B), ("C", C), ("D", D)):
        cells = [(where, what, f"`{run}`", shown) for where, what, run, shown in rows]
        parts += [f"Paper {name}:", table(("where", "what", "command", "shown by"), cells)]
    symbols = table(("the papers", "here", "unit"), SYMBOLS)
    return "\n\n".join([*parts, "Symbols:", symbols, _NOT_SOLVED])


def commands() -> list[str]:
    """Every command of the page, each once, in its order."""
    rows = [*A, *B, *C, *D]
    return list(dict.fromkeys(command for _, _, command, _ in rows))
