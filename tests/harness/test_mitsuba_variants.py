"""Finding a libLLVM that works: by its file, and by a render that may end the process."""

from __future__ import annotations

import importlib.metadata
import os
import subprocess
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

from harness.errors import RendererMissing
from harness.renderers import mitsuba_variants as variants
from harness.renderers.mitsuba_variants import Library

ABORT = (
    "LLVM ERROR: Cannot select: 0x55944bd39f50: f32 = fminimum 0x55944bd3afc8, 0x55944bcd2a70\n"
    "In function: drjit_4ec1c9\n"
)
NO_ATOMIC = (
    "ImportError: libatomic.so.1: cannot open shared object file: No such file or directory\n"
)
HALF_IMPORTED = "NameError: name '_drjit_ext' is not defined\n"
VERSION = importlib.metadata.version


@pytest.fixture(autouse=True)
def fresh(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """No memory of earlier probes, and no Mitsuba needed: its version is made up."""
    monkeypatch.setenv("SNELLCHECK_CACHE", str(tmp_path / "cache"))
    monkeypatch.delenv(variants.LIBRARY, raising=False)
    monkeypatch.setattr(importlib.metadata, "version", lambda name: "3.9.1")
    variants.choose.cache_clear()
    yield
    variants.choose.cache_clear()


Answer = Callable[[str, str], tuple[int, str, str]]


@pytest.fixture
def children(monkeypatch: pytest.MonkeyPatch) -> Callable[[Answer], list[tuple[str, str]]]:
    """Makes every child process answer as told, and lists the (variant, library) they tried."""

    def install(answer: Answer) -> list[tuple[str, str]]:
        tried = []

        def run(argv: list[str], **options: Any) -> subprocess.CompletedProcess[str]:
            if argv[0] == "apt-cache":
                return subprocess.CompletedProcess(argv, 0, "libllvm16 - x\nlibllvm19 - x\n", "")
            variant, library = argv[-1], options["env"].get(variants.LIBRARY, "")
            tried.append((variant, library))
            return subprocess.CompletedProcess(argv, *answer(variant, library))

        monkeypatch.setattr(subprocess, "run", run)
        return tried

    return install


def works(*_: str) -> tuple[int, str, str]:
    return 0, "some log\nmean 0.5\n", ""


def installed(folder: Path, *names: str) -> list[Library]:
    libraries = []
    for name in names:
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
        libraries.append(Library(path, variants.version_in(path)))
    return libraries


# --- libraries ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("path", "major"),
    [
        ("/usr/lib/x86_64-linux-gnu/libLLVM.so.19.1", 19),
        ("/usr/lib/x86_64-linux-gnu/libLLVM-17.so.1", 17),
        ("/usr/lib/x86_64-linux-gnu/libLLVM-14.0.6.so.1", 14),
        ("/usr/lib/llvm-18/lib/libLLVM.so.1", 18),
        ("/usr/lib64/llvm20/lib64/libLLVM.so", 20),
        ("/opt/homebrew/opt/llvm@19/lib/libLLVM.dylib", 19),
        ("/opt/homebrew/Cellar/llvm/21.1.3/lib/libLLVM.dylib", 21),
        ("/opt/homebrew/opt/llvm/lib/libLLVM.dylib", None),
    ],
)
def test_a_path_tells_its_version(path: str, major: int | None) -> None:
    assert variants.version_in(Path(path)) == major


def test_newest_first_and_each_once(tmp_path: Path) -> None:
    installed(tmp_path, "libLLVM-15.so.1", "libLLVM-17.so.1", "libLLVM.so.19.1", "libLLVM-9.so")
    (tmp_path / "libLLVM-19.so").symlink_to("libLLVM.so.19.1")
    found = variants.libraries([f"{tmp_path}/libLLVM*.so*"], {})
    assert [(lib.path.name, lib.major) for lib in found] == [
        ("libLLVM.so.19.1", 19),
        ("libLLVM-17.so.1", 17),
    ]


def test_homebrews_link_tells_no_version_but_its_target_does(tmp_path: Path) -> None:
    (real,) = installed(tmp_path, "Cellar/llvm/21.1.3/lib/libLLVM.dylib")
    (tmp_path / "opt").mkdir()
    (tmp_path / "opt" / "llvm").symlink_to(real.path.parent.parent)
    found = variants.libraries([f"{tmp_path}/opt/llvm*/lib/libLLVM*.dylib"], {})
    assert found == [Library(real.path, 21)]


def test_the_users_own_choice_comes_first(tmp_path: Path) -> None:
    installed(tmp_path, "libLLVM.so.19.1")
    environment = {variants.LIBRARY: "/somewhere/libLLVM-17.so"}
    found = variants.libraries([f"{tmp_path}/libLLVM*.so*"], environment)
    assert str(found[0].path) == "/somewhere/libLLVM-17.so"
    assert len(found) == 2


# --- probes ---------------------------------------------------------------------------------------


def test_what_worked_is_remembered_until_something_changes(
    tmp_path: Path, children: Callable[[Answer], list[tuple[str, str]]]
) -> None:
    tried = children(works)
    (library,) = installed(tmp_path, "libLLVM.so.19.1")
    assert variants.probe(variants.FAST, library).usable
    assert variants.probe(variants.FAST, library).usable
    assert tried == [(variants.FAST, str(library.path))]
    assert variants.probe(variants.SLOW).usable
    assert len(tried) == 2
    os.utime(library.path, (1, 1))
    assert variants.probe(variants.FAST, library).usable
    assert len(tried) == 3


@pytest.mark.parametrize(
    ("answer", "detail"),
    [
        ((-6, "", ABORT), "ended by signal 6: LLVM ERROR: Cannot select"),
        ((1, "", f"Traceback\n{NO_ATOMIC}"), "libatomic.so.1"),
        ((0, "mean nan\n", ""), "rendered nan where 0.5 is right"),
        ((0, "mean 0.4\n", ""), "rendered 0.4 where 0.5 is right"),
        ((0, "", ""), "said nothing"),
    ],
)
def test_what_failed_says_why_and_is_tried_again(
    children: Callable[[Answer], list[tuple[str, str]]], answer: tuple[int, str, str], detail: str
) -> None:
    tried = children(lambda *_: answer)
    for _ in range(2):
        found = variants.probe(variants.SLOW)
        assert not found.usable
        assert detail in found.detail
    assert len(tried) == 2


def test_a_probe_that_hangs_is_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    def run(argv: list[str], **options: Any) -> None:
        raise subprocess.TimeoutExpired(argv, options["timeout"])

    monkeypatch.setattr(subprocess, "run", run)
    assert variants.probe(variants.SLOW).detail == "hung for 60 s"


@pytest.mark.parametrize("content", ["", "nonsense", '{"a": 1}', "[1, 2]", "null"])
def test_a_damaged_memory_is_an_empty_one(
    tmp_path: Path, children: Callable[[Answer], list[tuple[str, str]]], content: str
) -> None:
    tried = children(works)
    (tmp_path / "cache").mkdir()
    (tmp_path / "cache" / "mitsuba-variants.json").write_text(content)
    assert variants.probe(variants.SLOW).usable
    assert len(tried) == 1


# --- the choice -----------------------------------------------------------------------------------


def test_the_newest_library_that_works_is_chosen(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    children: Callable[[Answer], list[tuple[str, str]]],
) -> None:
    found = installed(tmp_path, "libLLVM.so.22.1", "libLLVM.so.19.1", "libLLVM-17.so.1")
    monkeypatch.setattr(variants, "libraries", lambda: found)
    tried = children(lambda _, library: (-6, "", ABORT) if "22" in library else works())
    assert variants.choose() == variants.Choice(variants.FAST, found[1])
    assert variants.child_environment() == {
        variants.VARIANT: variants.FAST,
        variants.LIBRARY: str(found[1].path),
    }
    assert [Path(library).name for _, library in tried] == ["libLLVM.so.22.1", "libLLVM.so.19.1"]


def test_without_a_library_the_slow_variant_says_so(
    monkeypatch: pytest.MonkeyPatch, children: Callable[[Answer], list[tuple[str, str]]]
) -> None:
    monkeypatch.setattr(variants, "libraries", list)
    monkeypatch.setattr(variants.platform, "system", lambda: "Linux")
    children(works)
    choice = variants.choose()
    assert choice.variant == variants.SLOW
    assert "no libLLVM of version 17 or later" in choice.note
    assert choice.remedy == "sudo apt-get install libllvm19"
    assert variants.child_environment() == {variants.VARIANT: variants.SLOW}


@pytest.mark.parametrize("log", [NO_ATOMIC, HALF_IMPORTED])
def test_a_missing_libatomic_is_named(
    monkeypatch: pytest.MonkeyPatch, children: Callable[[Answer], list[tuple[str, str]]], log: str
) -> None:
    monkeypatch.setattr(variants, "libraries", list)
    children(lambda *_: (1, "", log))
    with pytest.raises(RendererMissing, match="sudo apt-get install libatomic1"):
        variants.choose()


def test_a_missing_mitsuba_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> str:
        raise importlib.metadata.PackageNotFoundError(name)

    monkeypatch.setattr(importlib.metadata, "version", missing)
    with pytest.raises(RendererMissing, match=r"pip install 'snellcheck\[mitsuba\]'"):
        variants.choose()


def test_remedies_fit_the_system() -> None:
    assert variants.llvm_remedy("Darwin") == "brew install llvm"


@pytest.mark.mitsuba
@pytest.mark.skipif(find_spec("mitsuba") is None, reason=f"needs Mitsuba: {variants.INSTALL}")
def test_a_real_probe_renders(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.metadata, "version", VERSION)
    assert variants.probe(variants.SLOW).usable
