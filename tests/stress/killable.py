"""A run in a process of its own, to be killed: ``killable.py OUT CACHE LOG [CASE…]``.

Two students, one that is remembered from run to run and one that is not, append a line to LOG as
each of their images is finished: who, what, and when by the machine's monotonic clock. Prints the
summary's verdicts at the end.
"""

# ruff: noqa: T201

from __future__ import annotations

import hashlib
import json
import os
import sys
import time
from pathlib import Path

from harness.cache.cache import open_cache
from harness.renderers.base import Image, RenderSettings
from harness.run import run
from harness.scene.resolved import ResolvedScene
from tests.fakes import FakeRenderer
from tests.fakes.student import CAPABILITIES, student
from tests.harness.tiny import prepared


class Logged(FakeRenderer):
    """A student that says in a file what it has rendered."""

    def __init__(self, name: str, log: Path) -> None:
        right = student()
        super().__init__(
            name, lambda scene: right.render(scene, RenderSettings()).pixels,
            capabilities=CAPABILITIES,
        )  # fmt: skip
        self._log = os.open(log, os.O_WRONLY | os.O_APPEND | os.O_CREAT)

    def render(self, scene: ResolvedScene, settings: RenderSettings) -> Image:
        image = super().render(scene, settings)
        what = hashlib.sha256(scene.model_dump_json().encode()).hexdigest()[:16]
        os.write(self._log, f"{self.name} {what} {time.monotonic()}\n".encode())
        return image


class Remembered(Logged):
    def fingerprint(self) -> str:
        return "1"


def main(out: str, cache: str, log: str, *cases: str) -> None:
    renderers = [Remembered("kept", Path(log)), Logged("passing", Path(log))]
    helper = Remembered("helper", Path(log))
    summary = run(prepared(*cases), renderers, helper, Path(out), cache=open_cache(cache))
    verdicts = {case.id: [[c.id, c.status, c.value] for c in case.checks] for case in summary.cases}
    print(json.dumps(verdicts))


if __name__ == "__main__":
    main(*sys.argv[1:])
