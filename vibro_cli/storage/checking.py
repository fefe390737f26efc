"""Files held to what the manifest of their folder says of them: there, size, SHA-256."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Finding:
    """One file that is not as it was written."""

    file: str
    state: str
    """missing, damaged or unknown."""
    detail: str

    def __str__(self) -> str:
        what = "missing" if self.state == "missing" else f"not as it was written ({self.detail})"
        return f"{self.file} is {what}"


def check_files(folder: Path, described: Mapping[str, Mapping[str, Any]]) -> Iterator[Finding]:
    """Every file that is missing or not as it was written.

    `described` has what the manifest says of each: its `bytes` and its `sha256`. Raises `OSError`
    when a file cannot be read.
    """
    for name, wanted in described.items():
        finding = _check(folder, name, wanted)
        if finding is not None:
            yield finding


def _check(folder: Path, name: str, described: Mapping[str, Any]) -> Finding | None:
    path = folder / name
    try:
        size = path.stat().st_size
    except FileNotFoundError:
        return Finding(name, "missing", "not there")
    if size != described["bytes"]:
        return Finding(name, "damaged", f"{size} bytes, expected {described['bytes']}")
    with open(path, "rb") as file:
        found = hashlib.file_digest(file, "sha256").hexdigest()
    if found != described["sha256"]:
        detail = f"SHA-256 {found[:12]}…, expected {described['sha256'][:12]}…"
        return Finding(name, "damaged", detail)
    return None
