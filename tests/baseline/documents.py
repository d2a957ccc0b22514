"""Records and baselines of one case by one renderer, for tests that change one thing in them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from harness.baseline.document import Approval, Baseline, Kept, StoredImage
from harness.record import CaseRecord, Check, ImageFile, RendererRun, Verdict

CASE = "slab-offset[ior=1.5]"
SCENE = "a" * 64
TOLERANCE = 1e-6


def check(
    off: float = 0.1, status: Verdict = Verdict.PASS, observable: str = "exit_point"
) -> Check:
    """A check that is off by `off` tolerances; without numbers where it was not measured."""
    measured = status not in (Verdict.SKIP, Verdict.ERROR)
    return Check(
        id=f"{observable}(through)/fake/truth", renderer="fake", against="truth",
        observable=observable, value=off * TOLERANCE if measured else None,
        expected=0.0 if measured else None, tolerance=TOLERANCE if measured else None,
        unit="units", status=status, reason="" if status is Verdict.PASS else "because",
    )  # fmt: skip


def run(**more: Any) -> RendererRun:
    fields: dict[str, Any] = {
        "name": "fake", "version": "1.0", "status": Verdict.PASS,
        "capabilities": ["image", "pixel-centres"], "settings": {"samples": 64, "seed": 0},
    }  # fmt: skip
    return RendererRun(**fields | more)


def record(checks: list[Check], **more: Any) -> CaseRecord:
    return CaseRecord(
        id=CASE, case="slab-offset", family="slab", title="A slab", scene_sha256="b" * 64,
        scene_fingerprint=SCENE, scene_file="slab/offset.toml", quality="normal",
        snellcheck_version="0.1.0", started="2026-11-25T20:00:00+00:00", wall_s=1.0,
        status=Verdict.PASS, runs=[run(**more)], checks=checks,
    )  # fmt: skip


def approval(**more: Any) -> Approval:
    fields: dict[str, Any] = {
        "at": "2026-11-01T10:00:00+00:00", "by": "A. Person", "reason": "measured",
        "version": "1.0", "snellcheck_version": "0.1.0", "record_sha256": "c" * 64,
    }  # fmt: skip
    return Approval(**fields | more)


def baseline(checks: list[Check], **more: Any) -> Baseline:
    fields: dict[str, Any] = {
        "case": CASE, "renderer": "fake", "version": "1.0", "quality": "normal",
        "scene_file": "slab/offset.toml", "scene_fingerprint": SCENE,
        "measured": "2026-11-01T09:00:00+00:00", "capabilities": ["image", "pixel-centres"],
        "checks": checks, "approval": approval(),
    }  # fmt: skip
    return Baseline(**fields | more)


def kept(checks: list[Check], **more: Any) -> Kept:
    return Kept(baseline(checks, **more), Path("references/fake/slab.json"), "d" * 64)


def image(mean: float = 0.5, error: float = 0.0, pixels: str = "e") -> ImageFile:
    return ImageFile(
        role="image", path="images/x.exr", sha256=pixels * 64, width=4, height=3,
        mean=[mean] * 3, mean_error=[error] * 3 if error else [],
    )  # fmt: skip


def stored_image(mean: float = 0.5, error: float = 0.0, pixels: str = "f") -> StoredImage:
    return StoredImage(
        role="image", pixels_sha256=pixels * 64, width=4, height=3, scale=1.0,
        mean=[mean] * 3, mean_error=[error] * 3 if error else [],
    )  # fmt: skip
