"""Every file of tests/bad_scenarios gives the errors written beside it, with their places.

A file `name.toml` (`.json`, `.yaml`) has its errors in `name.toml.expected`, one on each line.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from vibro_cli.scenario import ScenarioError, load_any

FOLDER = Path(__file__).parents[1] / "bad_scenarios"
FILES = sorted(path for path in FOLDER.iterdir() if path.suffix != ".expected")


def test_there_are_bad_scenarios_in_every_form() -> None:
    assert len(FILES) >= 20
    assert {path.suffix for path in FILES} >= {".toml", ".json", ".yaml"}


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_bad_scenario(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(FOLDER)
    with pytest.raises(ScenarioError) as caught:
        load_any(path.name)
    expected = path.with_name(f"{path.name}.expected").read_text(encoding="utf-8")
    assert f"{caught.value}\n" == expected
