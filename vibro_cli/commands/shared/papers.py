"""What of the papers is shown by which command, as Markdown: `vibro help papers`."""

from typing import TYPE_CHECKING

from vibro_cli.commands.shared.terminal import markdown_table

if TYPE_CHECKING:
    from vibro_cli.systems.contract import PaperRow, System

LETTERS = "ABCD"
"""Of the papers."""
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
    parts = [_BEFORE]
    for letter in LETTERS:
        cells = [(where, what, f"`{run}`", shown) for where, what, run, shown in rows_of(letter)]
        parts += [
            f"Paper {letter}:",
            markdown_table(("where", "what", "command", "shown by"), cells),
        ]
    own = [symbol for kind in _systems() for symbol in kind.shown_of_papers.symbols]
    symbols = markdown_table(("the papers", "here", "unit"), (*SYMBOLS, *own))
    return "\n\n".join([*parts, "Symbols:", symbols, _NOT_SOLVED])


def rows_of(letter: str) -> "list[PaperRow]":
    """What of a paper is shown, system by system."""
    return [row for kind in _systems() for row in kind.shown_of_papers.rows.get(letter, ())]


def _systems() -> "list[System]":
    from vibro_cli.systems import NAMES, system_named

    return [system_named(name) for name in NAMES]


def commands() -> list[str]:
    """Every command of the page, each once, in its order."""
    rows = [row for letter in LETTERS for row in rows_of(letter)]
    return list(dict.fromkeys(command for _, _, command, _ in rows))
