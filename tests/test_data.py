"""Files that come with snellcheck are found wherever it was installed from."""

from __future__ import annotations

from pathlib import Path

import pytest

from harness import data


def test_a_checkout_has_its_scenes_beside_the_packages() -> None:
    assert (data.scenes_root() / "slab" / "offset.toml").is_file()
    assert (data.references_root() / "README.md").is_file()


def test_files_inside_the_package_win(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shipped = tmp_path / "harness" / "_data" / "scenes"
    shipped.mkdir(parents=True)
    (tmp_path / "scenes").mkdir()
    monkeypatch.setattr(data, "_PACKAGE", tmp_path / "harness")
    assert data.scenes_root() == shipped
    assert data.references_root() == tmp_path / "references"


def test_the_cache_folder_can_be_moved(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("SNELLCHECK_CACHE", raising=False)
    assert data.cache_root().name == "snellcheck"
    monkeypatch.setenv("SNELLCHECK_CACHE", str(tmp_path))
    assert data.cache_root() == tmp_path
