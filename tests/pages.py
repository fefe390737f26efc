"""README.md and the pages of docs/, and the blocks of code in them."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
README = ROOT / "README.md"
DOCS = ROOT / "docs"


def pages() -> list[Path]:
    """Return README.md and every page of the site."""
    return [README, *sorted(DOCS.rglob("*.md"))]


def every_block(page: Path) -> list[tuple[str, str, str]]:
    """Return the fenced blocks of a page in order: the text before, the language, the block."""
    found = re.findall(r"(.*?)^```(\S*)[^\n]*\n(.*?)^```", text_of(page), re.MULTILINE | re.DOTALL)
    return [(before, language, block) for before, language, block in found]


def text_of(page: Path) -> str:
    return page.read_text(encoding="utf-8")


def blocks(page: Path, language: str) -> list[str]:
    """Return the fenced blocks of `language` on a page, in order."""
    return re.findall(rf"^```{language}\n(.*?)^```", text_of(page), re.MULTILINE | re.DOTALL)
