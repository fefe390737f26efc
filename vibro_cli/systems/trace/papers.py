"""What runs on a trace reproduce from the papers, for `vibro help papers`."""

from __future__ import annotations

from vibro_cli.systems.contract import PaperRow, ShownOfPapers

_RUN_CIRCLE = "vibro run scenarios/one_circle.toml --figures scene,velocities,energy"
_RUN_ARCS = "vibro run scenarios/three_arcs.toml --figures velocities"
_RUN_TWO = (
    "vibro run scenarios/one_circle.toml --set 'balls[1].rate=2.5' --set stop.collisions=2 "
    "--figures portrait,plan -o outputs/circle_two"
)
_RUN_LIMITERS = (
    "vibro run scenarios/one_circle.toml --set trace.closed=false "
    """--set 'trace.start_slope="-60 deg"' --set 'trace.arcs[1].end_slope="60 deg"' """
    "--set ends.left.wall=0.8 --set ends.right.wall=0.8 --set 'balls[1].body=particle' "
    "--set 'balls[2].body=particle' --set 'balls[1].rate=3.2' --set stop.collisions=6 "
    "--figures scene,portrait -o outputs/limiters"
)
_RUN_LINE = "vibro run scenarios/horizontal_line_2_3.toml --figures contact_points,velocities"
_RUN_DISKS = "vibro run scenarios/disk_on_arcs.toml --figures scene,energy_portrait"
_SERIES = "report, section “Exact times and the papers' series”"
_TABLE_1 = "report, section “Translation and rolling”"

_A: tuple[PaperRow, ...] = (
    ("A abstract, §1", "two balls or disks on a trace of three arcs, successive central impacts",
     "vibro run scenarios/three_arcs.toml --set stop.collisions=8 --figures energy_portrait "
     "-o outputs/eight", "the impacts, 1, 2, …: `collisions`"),
    ("A fig. 1a", "kinematic plan of velocities of two balls on a curved line",
     _RUN_ARCS, "`velocities`: C, P, T, v, ω, tangent"),
    ("A fig. 1b", "portraits of both balls on a circle with the jumps of their representative "
     "points", "vibro run scenarios/one_circle.toml --set 'balls[1].rate=2.5' --set "
     "stop.collisions=3 --set collision.k=1 --figures portrait -o outputs/circle_three",
     "`portrait_1`, `portrait_2`: N₀ is the square, N before an impact "
     "open, after it full, with the number of the impact"),
    ("A fig. 2a", "model: a ball on three arcs", "vibro run scenarios/three_arcs.toml --set "
     "'balls[2].arc=2' --set 'balls[2].angle=0.3' --set stop.time=1 --figures scene "
     "-o outputs/model",
     "`scene`: O, R, C, P, φ, ψ (R₂ is A's R₀)"),
    ("A fig. 2b–d, (5)", "compositions of portraits for different radii",
     "vibro portrait scenarios/three_arcs.toml --vary 'trace.arcs[2].radius=0.3:6:4'",
     "`portrait_1_2`, `family`"),
    ("A abstract, §4, end", "jumps of velocity and energy on the curves of constant energy",
     "vibro run scenarios/three_arcs.toml --set stop.collisions=8 --figures energy_portrait "
     "-o outputs/eight",
     "`energy_portrait_1`, `energy_portrait_2`"),
    ("A (1)–(3)", "moments of momentum conserved, k on ω, outgoing ω",
     "vibro show outputs/three_arcs/collisions.parquet --columns "
     "n,omega_a_pre,omega_b_pre,omega_a_post,omega_b_post", "`omega_[ab]_pre`, `omega_[ab]_post`"),
    ("A (4), (6)", "κ, β, λ₁, λ₂", "vibro check scenarios/one_circle.toml",
     "κ, J_P, ω², modulus, periods, β, λ₁ = R/r₁, λ₂ = r₂/r₁"),
    ("A (7)–(9)", "time as an elliptic integral, and its series of order 2",
     "vibro report outputs/circle_three", _SERIES),
    ("A §4", "n successive impacts; variation of parameters",
     "vibro grid scenarios/grids/three_arcs_grid.toml", "`summary.parquet`, all impacts"),
)  # fmt: skip
_B: tuple[PaperRow, ...] = (
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
     "vibro run scenarios/horizontal_line_1_2.toml --set 'balls[2].radius=0.2' --set "
     "'balls[2].omega=-1' --figures contact_points -o outputs/equal", "`contact_points`"),
    ("B figs 3a–d, 4", "the same of balls of different radii: T₀ above the centre of the smaller, "
     "below that of the larger", _RUN_LINE, "`contact_points`"),
    ("B fig. 5, fig. A1b", "component velocities at T₀, arrival and outgoing; rolling bodies",
     _RUN_LINE, "`velocities`"),
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
     "vibro run scenarios/horizontal_line_2_3.toml --set 'balls[1].omega=32' --set "
     "'balls[2].omega=-243' --set collision.k=0.9 -o outputs/opposite", "−28.8 and 218.7 rad/s"),
    ("B example a*", "ratios 1/33, 32/33", "vibro run scenarios/horizontal_line_1_2.toml",
     "`omega_[ab]_post`: 31/33, 64/33 rad/s"),
    ("B example b*", "ratios 1/244, 243/244", "vibro run scenarios/horizontal_line_1_3.toml",
     "`omega_[ab]_post`: −1/122, 121/122 rad/s"),
    ("B example c*", "ratios 32/275, 243/275", _RUN_LINE,
     "`omega_[ab]_post`: 262/275, 1362/275 rad/s"),
    ("B examples", "masses and J_P of balls", "vibro check scenarios/horizontal_line_1_2.toml",
     "m = (4/3)πρr³, J_P = (28/15)πρr⁵"),
    ("B table 1", "analogy of translation and rolling, for every impact of two bodies",
     "vibro report outputs/horizontal_line_2_3", _TABLE_1),
    ("B fig. 6", "model: two balls in a circle", _RUN_CIRCLE,
     "`scene`: φ, R, C, P; `velocities`: T, tangent, ω"),
    ("B fig. 7", "plan of angular velocities and component velocities on a circle",
     _RUN_CIRCLE, "`velocities`"),
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
     "vibro run scenarios/one_circle.toml --set 'balls[1].rate=5' --set collision.k=1 --set "
     "stop.collisions=12 --figures energy_portrait -o outputs/progressive",
     "`energy_portrait_2`; `regime_[ab]_pre`, `_post`"),
    ("B III.3.5", "the same as a table", "vibro report outputs/progressive",
     "report, section “Jumps between oscillation and progression”"),
    ("B fig. 8", "portraits with the first two collisions", _RUN_TWO,
     "`portrait_2` (upper), `portrait_1` (lower)"),
    ("B fig. 9", "configurations at the first two impacts", _RUN_TWO, "`plan`"),
    ("B III.3.6", "energy jumps of both balls", _RUN_CIRCLE, "`energy`"),
    ("B appendix", "m v̇ = F, J_P ω̇ = M: a particle and a ball under gravity on an inclined line",
     "vibro run scenarios/falling_balls.toml --set 'trace.arcs[1].length=4' --set "
     "'balls[2].body=ball' --set stop.collisions=6 --figures scene,energy_portrait -o "
     "outputs/inclined",
     "`scene`; `energy_portrait_1`, `_2`: v² falls by 2 g s sin 30°, of the ball by 5/7 of it"),
    ("B references 28, 29 (cited)", "two particles on a circle between impact limiters, here "
     "without their Coulomb friction", _RUN_LIMITERS,
     "`scene`, `portrait_1`, `portrait_2` with the walls"),
)  # fmt: skip
_D: tuple[PaperRow, ...] = (
    ("D fig. 1a, (1), (2)", "a particle on a series of arcs",
     "vibro run scenarios/lone_particle.toml --figures scene,energy_portrait", "`scene`"),
    ("D fig. 1b, (3), (4)", "a ball or disk on the same arcs", _RUN_DISKS, "`scene`"),
    ("D fig. 1c–e", "compositions of portraits for different radii",
     "vibro portrait scenarios/ball_on_arcs.toml --vary 'trace.arcs[2].radius=0.3:6:4'",
     "`family`"),
    ("D analogy", "particle, disk and ball on one trace",
     "vibro portrait scenarios/particle_on_arcs.toml --compare 'balls[1].body=particle,disk,ball'",
     "`comparison`"),
    ("D analysis", "trigger, saddle, homoclinic figure eight and its condition "
     "(R − r)(1 − cos θ) ≥ (R + R₀)(1 − cos J), θ at the ends of the trace, J at the junctions",
     "vibro portrait scenarios/lone_particle.toml", "`portrait_1`: “barriers”, the differences"),
    ("D title", "a series of n arcs", "vibro portrait scenarios/turning_five_arcs.toml",
     "`portrait_1_2`"),
    ("D methodology", "jumps from one trajectory to another in the figure eight", _RUN_DISKS,
     "`energy_portrait_1`; `eight_[ab]_pre`, `_post`"),
    ("D methodology", "the same as a table", "vibro report outputs/disk_on_arcs",
     "report, section “Jumps across the figure eight”"),
    ("D perspectives", "the trace rotates; triggers multiply where a valley lies on the axis",
     "vibro portrait scenarios/turning_valley.toml --vary trace.turning.rate=2.5:4.5:5",
     "`family`"),
    ("D perspectives", "vibro-impacts on it",
     "vibro run scenarios/turning_valley.toml --figures energy_portrait", "`energy_portrait_1`"),
)  # fmt: skip

SHOWN = ShownOfPapers({"A": _A, "B": _B, "D": _D})
