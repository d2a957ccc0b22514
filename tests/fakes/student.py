"""The documented stand-alone renderer inside this process, whole or with faults on purpose.

It knows nothing of the harness or of the tracer, so that it can be a witness in tests of both.
"""

from __future__ import annotations

import importlib.abc
import importlib.util
from collections.abc import Callable
from functools import cache
from pathlib import Path
from types import ModuleType

import numpy as np

from harness.measure.images import box_downsample
from harness.renderers.base import Capability
from harness.scene.resolved import Film, ResolvedScene
from tests.fakes import FakeRenderer

SOURCE = Path(__file__).parents[2] / "docs" / "bring-your-own-renderer" / "student.py"
CAPABILITIES = frozenset(
    {
        Capability.IMAGE,
        Capability.PIXEL_CENTRES,
        Capability.DOUBLE,
        Capability.DOUBLE_DATA,
        Capability.LOBE_SWITCH,
        Capability.SPHERE,
        Capability.CONVEX,
        Capability.PICTURE,
        Capability.ABSORPTION,
        Capability.FRESNEL,
        Capability.NESTED,
        Capability.CAMERA_INSIDE,
    }
)

# What to replace in the source, and by what.
Fault = tuple[str, str]


def with_faults(text: str, *faults: Fault) -> str:
    """`text` with each fault made. What to replace must be there once, or the test tests nothing.

    Raises AssertionError where it is not.
    """
    for old, new in faults:
        found = text.count(old)
        assert found == 1, f"{old!r} occurs {found} times"
        assert old != new
        text = text.replace(old, new)
    return text


class _Text(importlib.abc.InspectLoader):
    def __init__(self, text: str) -> None:
        self._text = text

    def get_source(self, fullname: str) -> str:
        return self._text


@cache
def module(*faults: Fault) -> ModuleType:
    """student.py as a module of its own, with `faults`."""
    loader = _Text(with_faults(SOURCE.read_text(encoding="utf-8"), *faults))
    spec = importlib.util.spec_from_loader("student", loader)
    assert spec is not None
    made = importlib.util.module_from_spec(spec)
    loader.exec_module(made)
    return made


def student(
    *faults: Fault,
    name: str = "student",
    sees: Callable[[ResolvedScene], ResolvedScene] = lambda scene: scene,
    shows: Callable[[np.ndarray], np.ndarray] = lambda pixels: pixels,
    capabilities: frozenset[Capability] = CAPABILITIES,
) -> FakeRenderer:
    """A renderer with `faults` that takes each scene for what `sees` makes of it.

    `shows` is what becomes of the float64 pixels before they are delivered as float32.
    """

    def picture(scene: ResolvedScene) -> np.ndarray:
        return shows(module(*faults).render(sees(scene).model_dump(mode="json")))

    return FakeRenderer(name, picture, capabilities=capabilities)


def averaging(
    *faults: Fault,
    name: str = "averaging",
    sees: Callable[[ResolvedScene], ResolvedScene] = lambda scene: scene,
    capabilities: frozenset[Capability] = CAPABILITIES,
    side: int = 4,
) -> FakeRenderer:
    """A student whose every pixel is the mean of `side` x `side` rays: anti-aliasing, always on."""

    def picture(scene: ResolvedScene) -> np.ndarray:
        film = Film(width=scene.film.width * side, height=scene.film.height * side)
        fine = sees(scene).model_copy(update={"film": film})
        pixels = module(*faults).render(fine.model_dump(mode="json"))
        return box_downsample(pixels, side)

    return FakeRenderer(name, picture, capabilities=capabilities)
