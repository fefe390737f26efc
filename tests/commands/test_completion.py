"""What the shell offers after the beginning of a name."""

from pathlib import Path

import pytest

from vibro_cli.commands.shared.options import scenario_files, table_files


def test_files_of_the_kind_that_is_wanted_and_folders_are_offered(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "more").mkdir()
    for name in ("main.toml", "more.YAML", "moved.txt", "more/t.parquet", "more/.hidden.json"):
        (tmp_path / name).touch()
    (tmp_path / ".mine.toml").touch()
    assert scenario_files("") == ["main.toml", "more/", "more.YAML"]
    assert scenario_files("mo") == ["more/", "more.YAML"]
    assert scenario_files(".") == [".mine.toml"]
    assert scenario_files("more/") == []
    assert scenario_files("more/.h") == ["more/.hidden.json"]
    assert table_files("more/t") == ["more/t.parquet"]
    assert scenario_files(str(tmp_path / "ma")) == [str(tmp_path / "main.toml")]
    assert scenario_files("none/") == []
