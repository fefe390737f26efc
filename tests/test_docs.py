"""The pages for developers name only files and names that exist."""

import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from html import unescape
from itertools import pairwise
from pathlib import Path

import pytest

from tests.pages import pages

ROOT = Path(__file__).parents[1]
PAGES = [*sorted((ROOT / "docs").rglob("*.md")), ROOT / "CONTRIBUTING.md"]
# Where a path may start: the root of the checkout, or the package.
BASES = (ROOT, ROOT / "vibro_cli")
SUFFIXES = "py|hpp|md|toml|json|cff"
PATH = re.compile(rf"(?:[\w.-]+/)+(?:[\w.-]+\.(?:{SUFFIXES}))?|[\w-]+\.(?:{SUFFIXES})")
# Written by the program, or by the user.
NOT_IN_THE_TREE = {
    "checkpoint.json",
    "fit.json",
    "grid.json",
    "basins.json",
    "bowl.toml",
    "manifest.json",
    "scenario.json",
    "summary.json",
}


def paths_named(text: str) -> Iterator[str]:
    """Yield the texts in backticks that are paths."""
    for word in re.findall(r"`([^`\n]+)`", text):
        if PATH.fullmatch(word) and word not in NOT_IN_THE_TREE:
            yield word


def exists(path: str) -> bool:
    """Whether the tree has a path, or a file of a given name."""
    if "/" in path:
        return any((base / path).exists() for base in BASES)
    return (ROOT / path).exists() or any((ROOT / "vibro_cli").rglob(path))


def anchors(page: Path) -> set[str]:
    """Return the headings of a page as link anchors."""
    heads = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", head.lower()).replace(" ", "-") for head in heads}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_path_exists(page: Path) -> None:
    named = list(paths_named(page.read_text(encoding="utf-8")))
    assert [path for path in named if not exists(path)] == []


FOR_DEVELOPERS = ("architecture", "how-to-add", "kernels", "numerics", "stream")
NAMES_IN_A_FILE = re.compile(r"((?:`\w+`(?:, | and ))*`\w+`) (?:of|in) `([\w./-]+\.py)`")


@pytest.mark.parametrize("name", FOR_DEVELOPERS)
def test_every_name_is_in_the_file_that_it_is_said_to_be_in(name: str) -> None:
    page = " ".join((ROOT / "docs" / f"{name}.md").read_text(encoding="utf-8").split())
    for names, path in NAMES_IN_A_FILE.findall(page):
        beside = [*ROOT.glob(path), *(ROOT / "vibro_cli").rglob(path)]
        source = "".join(file.read_text(encoding="utf-8") for file in beside)
        for word in re.findall(r"\w+", names):
            assert re.search(rf"\b{word}\b", source), f"{word} of {path}"


@pytest.mark.parametrize("name", FOR_DEVELOPERS)
def test_every_field_and_function_of_something_is_one(name: str) -> None:
    """For example `settings.capacity`: it is used in that form, or a module has it."""
    page = (ROOT / "docs" / f"{name}.md").read_text(encoding="utf-8")
    source = "".join(
        file.read_text(encoding="utf-8") for file in (ROOT / "vibro_cli").rglob("*.py")
    )
    for what, field in re.findall(r"`([a-z]\w*)\.(\w+)`", page):
        if field not in (*SUFFIXES.split("|"), "reference_speed"):  # the example of a new key
            assert re.search(rf"\.{field}\b|^(def )?{field}\b", source, re.M), f"{what}.{field}"


@pytest.mark.parametrize("page", [*PAGES, ROOT / "README.md"], ids=lambda page: page.name)
def test_every_link_leads_somewhere(page: Path) -> None:
    for link in re.findall(r"\]\(([^)\s]+)\)", page.read_text(encoding="utf-8")):
        if link.startswith("https://"):
            continue
        name, _, anchor = link.partition("#")
        target = (page.parent / name).resolve() if name else page
        assert target.is_file(), link
        assert not anchor or anchor in anchors(target), link


def test_a_path_that_is_not_there_is_found() -> None:
    text = "`vibro_cli/kernels/` `vibro_cli/kernels/no_such.py` `python -m x` `no_such.py` `a/b`"
    named = list(paths_named(text))
    assert named == ["vibro_cli/kernels/", "vibro_cli/kernels/no_such.py", "no_such.py"]
    assert [exists(path) for path in named] == [True, False, False]


def test_every_page_can_be_reached() -> None:
    """From README, or from the contents of the site (where Sphinx holds it to all of them)."""
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    linked = set(re.findall(r"\]\(([^)#\s]+)[^)]*\)", readme))
    index = (ROOT / "docs/index.md").read_text(encoding="utf-8")
    linked |= {f"docs/{name}.md" for name in re.findall(r"^([\w/-]+)$", index, re.MULTILINE)}
    assert {str(page.relative_to(ROOT)) for page in PAGES} <= linked | {"docs/index.md"}


@pytest.mark.long
def test_the_site_shows_every_option_as_it_is_typed(tmp_path: Path) -> None:
    """No dash for its two hyphens, and no typographers' quotation marks, which no shell knows."""
    for library in ("sphinx", "myst_nb", "furo"):
        pytest.importorskip(library)
    page = (ROOT / "docs/reference-commands.md").read_text(encoding="utf-8")
    (tmp_path / "pages").mkdir()
    (tmp_path / "pages/index.md").write_text(page, encoding="utf-8")
    build = [sys.executable, "-m", "sphinx", "-q", "-c", str(ROOT / "docs")]
    subprocess.run([*build, "pages", "site"], cwd=tmp_path, check=True, capture_output=True)
    _, _, site = (tmp_path / "site/index.html").read_text(encoding="utf-8").partition("<article")
    shown = unescape(re.sub(r"<[^>]*>", "", site.partition("</article>")[0]))
    page = re.sub(r"<!--.*?-->", "", page)
    written = re.findall(r"--[a-z][a-z-]*", page)
    assert len(written) > 100
    assert re.findall(r"--[a-z][a-z-]*", shown) == written
    quoted = re.findall(r"'[a-z]+\[\d\][^']*'", page)
    assert len(quoted) > 5
    assert re.findall(r"'[a-z]+\[\d\][^']*'", shown) == quoted


def runs_written(text: str) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Yield the folders into which a page writes runs, each with all that defines its run."""
    for command in re.findall(r"vibro run ([^`|<>\n]*)", text):
        words = shlex.split(command)
        if {"--json", "--format", "-"} & set(words) or "$" in command:
            continue
        pairs = list(pairwise(words))
        sources = [word for word in words if word.endswith(".toml")]
        changes = [value for name, value in pairs if name == "--set"]
        named = [value for name, value in pairs if name in ("-o", "--continue")]
        named += [f"outputs/{Path(source).stem}" for source in sources]
        if named:
            yield named[0], (*sources, *changes)
    for folder in re.findall(r"""run\.save\("([^"]*)\"""", text):
        yield folder, ("saved",)


def test_no_page_has_a_run_written_over_one_of_another_page() -> None:
    """A reader who follows all pages meets no refusal: each folder has one scenario."""
    found: dict[str, dict[tuple[tuple[str, ...], ...], str]] = {}
    for page in pages():
        own: dict[str, list[tuple[str, ...]]] = {}
        for folder, what in runs_written(page.read_text(encoding="utf-8")):
            if what not in own.setdefault(folder, []):
                own[folder].append(what)
        for folder, kinds in own.items():
            found.setdefault(folder, {})[tuple(kinds)] = page.name
    assert len(found) > 20
    assert [(folder, pages) for folder, pages in found.items() if len(pages) > 1] == []


@pytest.mark.parametrize(
    "page", [*pages(), *sorted((ROOT / "scenarios").rglob("*.toml"))], ids=lambda page: page.name
)
def test_paths_with_brackets_are_quoted(page: Path) -> None:
    """zsh, the shell of macOS, takes `balls[1].rate=2.5` for a pattern that matches no file."""
    options = r"--(?:set|vary|free|compare|column)[ =]([^\s`]+)"
    words = re.findall(options, page.read_text(encoding="utf-8"))
    assert [word for word in words if "[" in word and word[0] not in "'\""] == []
