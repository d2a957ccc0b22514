"""The doctor tells what works from what does not, and always names a cure."""

from __future__ import annotations

import dataclasses
import io
import json
from pathlib import Path

import pytest
from rich.console import Console

from harness import doctor
from harness.renderers import confinement
from harness.renderers.base import Health

WELL = Health(
    "well", usable=True, version="1.2", path="/opt/well", facts={"variants": "scalar_rgb"}
)
ILL = Health("ill", usable=False, detail="aborts when it renders", remedy="apt-get install cure")


class Patient:
    """Of a renderer, only what the doctor looks at."""

    def __init__(self, health: Health) -> None:
        self._health = health

    def health(self) -> Health:
        return self._health


def diagnose(*patients: Health) -> doctor.Diagnosis:
    return doctor.diagnose({p.name: lambda p=p: Patient(p) for p in patients})


def shown(diagnosis: doctor.Diagnosis, width: int = 200) -> str:
    out = io.StringIO()
    doctor.show(diagnosis, Console(file=out, width=width))
    return out.getvalue()


@pytest.fixture(autouse=True)
def _own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SNELLCHECK_CACHE", str(tmp_path / "cache"))


def test_a_machine_is_healthy_only_where_every_renderer_is() -> None:
    assert diagnose(WELL).healthy
    assert not diagnose(WELL, ILL).healthy


def test_a_renderer_that_does_not_load_is_unusable_and_the_others_are_still_examined() -> None:
    def broken() -> Patient:
        raise ImportError("no module named left_pad")

    diagnosis = doctor.diagnose({"broken": broken, "well": lambda: Patient(WELL)})
    first, second = diagnosis.renderers
    assert not first.usable
    assert "left_pad" in first.detail
    assert first.remedy
    assert second == WELL


def test_every_cross_comes_with_its_cure() -> None:
    text = shown(diagnose(WELL, ILL))
    assert text.count("✗") == 1
    assert "To mend ill:\n  apt-get install cure" in text
    assert "variants: scalar_rgb" in text


def test_a_cure_is_never_wrapped_so_that_it_can_be_copied() -> None:
    long = dataclasses.replace(ILL, remedy="sudo apt-get install " + "package " * 20)
    assert long.remedy in shown(diagnose(long), width=40)


def test_markup_in_what_a_renderer_says_is_shown_as_it_is() -> None:
    rude = dataclasses.replace(ILL, detail="[bold]not[/] markup", remedy="mend [it]")
    text = shown(diagnose(rude))
    assert "[bold]not[/] markup" in text
    assert "mend [it]" in text


def test_json_holds_all_that_is_shown() -> None:
    document = json.loads(diagnose(WELL, ILL).to_json())
    assert document["schema"] == "snellcheck-doctor/1"
    assert document["healthy"] is False
    assert [r["name"] for r in document["renderers"]] == ["well", "ill"]
    assert document["renderers"][1]["remedy"] == ILL.remedy
    assert document["cores"] >= 1
    assert document["memory_mb"] > document["memory_available_mb"] > 0


def test_what_renderers_are_held_to_is_told_and_nothing_to_mend(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(confinement, "_holds", lambda: (0, False))
    diagnosis = diagnose(WELL)
    assert diagnosis.healthy
    found = {f["name"]: f["detail"] for f in json.loads(diagnosis.to_json())["findings"]}
    assert found["confinement"] == confinement.described()
    assert found["confinement"].startswith("none: ")


def test_a_cache_folder_that_cannot_be_made_is_found_by_writing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    in_the_way = tmp_path / "file"
    in_the_way.write_text("not a folder")
    monkeypatch.setenv("SNELLCHECK_CACHE", str(in_the_way / "cache"))
    diagnosis = diagnose(WELL)
    (cache,) = [f for f in diagnosis.findings if f.name == "cache"]
    assert not cache.ok
    assert "SNELLCHECK_CACHE" in cache.remedy
    assert not diagnosis.healthy
