"""Pictures too large for git, in a folder or at a URL: they come back whole or not at all."""

from __future__ import annotations

import hashlib
from pathlib import Path

import fsspec
import pytest

from harness import record
from harness.baseline.document import StoredImage, parse_baseline
from harness.baseline.store import Store
from harness.errors import InputError, RendererMissing
from harness.record import Verdict
from tests.baseline.test_commands import approved, baselines, work
from tests.harness.test_cli import REGISTERED, Invoke, invoke
from tests.harness.test_run import Absent
from tests.harness.tiny import SCENES, checks_of

__all__ = ["approved", "invoke", "work"]  # fixtures

DATA = b"a picture, honestly"
DIGEST = hashlib.sha256(DATA).hexdigest()


@pytest.fixture(params=["folder", "file://", "memory://"])
def url(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    """A place for a store, as --store has it."""
    place = str(tmp_path / "store")
    return {
        "folder": place, "file://": f"file://{place}", "memory://": f"memory://{tmp_path.name}"
    }[request.param]  # fmt: skip


def files(url: str) -> dict[str, bytes]:
    """What lies in a store, by name."""
    system, root = fsspec.core.url_to_fs(url)
    return {name.removeprefix(root): system.cat_file(name) for name in system.find(root)}


def overwrite(url: str, data: bytes) -> None:
    """Puts `data` in place of the only content of a store."""
    system, root = fsspec.core.url_to_fs(url)
    (name,) = system.find(root)
    system.pipe_file(name, data)


def test_content_lies_under_its_hash_and_comes_back(url: str) -> None:
    store = Store(url)
    for _ in range(2):
        store.put(DIGEST, DATA)
    assert store.get(DIGEST) == DATA
    assert files(url) == {f"/sha256/{DIGEST[:2]}/{DIGEST}.png": DATA}


@pytest.mark.parametrize("damage", [DATA[:-1], b"", DATA + b"x", b"A" + DATA[1:]])
def test_other_content_is_refused_until_it_is_put_again(damage: bytes, url: str) -> None:
    store = Store(url)
    store.put(DIGEST, DATA)
    overwrite(url, damage)
    with pytest.raises(InputError, match="not of its hash"):
        store.get(DIGEST)
    store.put(DIGEST, DATA)
    assert store.get(DIGEST) == DATA


def test_what_is_not_there_is_told(url: str) -> None:
    with pytest.raises(InputError, match=r"cannot be (read|reached)"):
        Store(url).get(DIGEST)


@pytest.mark.parametrize("digest", ["", "../" * 21 + "x", "A" * 64])
def test_only_hashes_are_names(digest: str, url: str) -> None:
    for work_with in (Store(url).get, lambda name: Store(url).put(name, DATA)):
        with pytest.raises(InputError, match="not a SHA-256"):
            work_with(digest)
    assert files(url) == {}


def test_a_scheme_that_nobody_knows_is_told() -> None:
    with pytest.raises(InputError, match="--store: cannot be reached: ValueError: Protocol not"):
        Store("nowhere://bucket").get(DIGEST)


# --- through the command line ---------------------------------------------------------------------


@pytest.fixture
def stored(url: str, work: Invoke, monkeypatch: pytest.MonkeyPatch) -> StoredImage:
    """The ball's picture, too large for git now, approved into a store; the student is gone."""
    monkeypatch.setattr("harness.baseline.pictures.LARGEST_IN_GIT", 100)
    for file in baselines():
        if "ball" in file.name:
            file.unlink()
            file.with_suffix(".png").unlink()
    options = ("-r", "student", "--run", "out", "--reason", "large", "--by", "me", "--store", url)
    assert work("approve", "ball", *options).exit_code == 0
    monkeypatch.setitem(REGISTERED, "student", lambda: Absent(RendererMissing("gone"), "student"))
    (file,) = (file for file in baselines() if "ball" in file.name)
    (image,) = parse_baseline(file.read_bytes(), file).baseline.images
    assert not file.with_suffix(".png").exists()
    return image


def judged(work: Invoke, *options: str) -> list[record.Check]:
    """All checks of a run of the ball, in which the stored picture may stand in for the student."""
    renderers = ("-r", "student", "-r", "tracer")
    work("run", "ball", *renderers, "--scenes", SCENES, "--out", "out", *options)
    return checks_of(record.read_summary(Path("out") / "summary.json"))


def pairs(checks: list[record.Check]) -> list[record.Check]:
    return [check for check in checks if {check.renderer, check.against} == {"student", "tracer"}]


def test_a_large_picture_stands_in_from_its_store(
    stored: StoredImage, url: str, work: Invoke
) -> None:
    assert (stored.store, stored.file) == (url, "")
    ((name, data),) = files(url).items()
    assert name.endswith(f"/{stored.sha256}.png")
    assert hashlib.sha256(data).hexdigest() == stored.sha256
    assert {check.status for check in pairs(judged(work, "--store", url))} == {Verdict.PASS}


@pytest.mark.usefixtures("stored")
def test_a_damaged_picture_in_a_store_is_refused(url: str, work: Invoke) -> None:
    ((_, data),) = files(url).items()
    overwrite(url, data[:-20] + b"x" + data[-19:])
    checks = judged(work, "--store", url)
    assert pairs(checks) == []
    assert skipped(checks, "not of its hash")


@pytest.mark.usefixtures("stored")
def test_a_store_is_looked_into_only_where_the_user_names_it(
    url: str, work: Invoke, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A baseline may be anybody's, and its URL lead anywhere: here to the very picture."""
    checks = judged(work)
    assert pairs(checks) == []
    assert skipped(checks, "SNELLCHECK_STORE")
    checks = judged(work, "--store", str(tmp_path / "empty"))
    assert pairs(checks) == []
    assert skipped(checks, "cannot be read")
    monkeypatch.setenv("SNELLCHECK_STORE", url)
    assert {check.status for check in pairs(judged(work))} == {Verdict.PASS}


def skipped(checks: list[record.Check], why: str) -> bool:
    return any(check.status is Verdict.SKIP and why in check.reason for check in checks)
