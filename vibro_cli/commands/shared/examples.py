"""Examples of every command, as its help gives them; a test runs each as it stands.

They make one session, in this order and in one folder.
"""

EXAMPLES: dict[str, tuple[str, ...]] = {
    "new": (
        "vibro new --list",
        "vibro new three_arcs",
        "vibro new --all",
        "vibro new three_arcs_grid",
        "vibro new falling_balls",
    ),
    "check": (
        "vibro check three_arcs.toml",
        "vibro check three_arcs_grid.toml --json",
    ),
    "run": (
        "vibro run three_arcs.toml",
        "vibro run three_arcs.toml --set collision.k=1 -o outputs/elastic",
        'vibro run three_arcs.toml --set "stop.time=5 s" --format csv > impacts.csv',
        "vibro run --continue outputs/three_arcs --set stop.time=120",
    ),
    "show": (
        "vibro show outputs/three_arcs/summary.parquet",
        "vibro show outputs/three_arcs/collisions.parquet --rows -5 --columns n,t",
    ),
    "report": (
        "vibro report outputs/three_arcs",
        "vibro report outputs/three_arcs --animate film.html --span 0:5",
    ),
    "portrait": (
        "vibro portrait three_arcs.toml",
        "vibro portrait three_arcs.toml --vary balls[1].radius=0.05:0.3:6",
    ),
    "orbit": (
        "vibro orbit falling_balls.toml --impacts 1",
        "vibro orbit falling_balls.toml --impacts 1 --vary balls[2].mass=0.8:2.5",
    ),
    "fit": ("vibro fit three_arcs.toml impacts.csv --free collision.k",),
    "grid": (
        "vibro grid three_arcs_grid.toml --dry-run",
        "vibro grid three_arcs_grid.toml",
        "vibro grid three_arcs_grid.toml --shard 1/2 -o outputs/sharded",
    ),
    "section": (
        "vibro section outputs/three_arcs --column s_a --column speed_a_pre",
        "vibro section outputs/three_arcs_grid --column angle_a --transient 1",
    ),
    "basins": ("vibro basins outputs/three_arcs_grid",),
    "verify": ("vibro verify outputs/three_arcs outputs/three_arcs_grid",),
    "schema": (
        "vibro schema grid > grid.schema.json",
        "vibro schema tables --markdown",
    ),
    "stress": ("vibro stress --only elliptic",),
    "bench": ("vibro bench --references times --scene five_balls",),
    "help": (
        "vibro help laws",
        "vibro help units",
        "vibro help grid",
    ),
}


def epilog(command: str) -> str:
    """What the help of a command ends with; its lines stay as they are (`\\b`)."""
    return "\b\nExamples:\n" + "\n".join(f"  {line}" for line in EXAMPLES[command])
