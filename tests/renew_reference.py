"""Write the program's own reference into docs/: ``python -m tests.renew_reference``."""

import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGES = sorted((ROOT / "docs").glob("*.md"))
MARKED = re.compile(r"^<!-- reference: ([\w-]+) -->\n.*?^<!-- end -->", re.MULTILINE | re.DOTALL)


def reference(found: re.Match[str]) -> str:
    """Return the text between two markers, with the markers."""
    outcome = subprocess.run(
        [sys.executable, "-m", "vibro_cli", "help", "--markdown", found[1]],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    return f"<!-- reference: {found[1]} -->\n\n{outcome.stdout}\n<!-- end -->"


if __name__ == "__main__":
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        page.write_text(MARKED.sub(reference, text), encoding="utf-8")
