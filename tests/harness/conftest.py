"""Renderers that tests share, because each start of one costs a second."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from harness.errors import RendererMissing
from harness.renderers import mitsuba_variants as variants
from harness.renderers.persistent import WorkerRenderer


def _mitsuba(name: str, engine: str) -> Iterator[WorkerRenderer]:
    try:
        variants.choose()
    except RendererMissing as missing:
        pytest.skip(str(missing))
    target = f"harness.renderers.mitsuba:{engine}"
    renderer = WorkerRenderer(name, target, env=variants.child_environment)
    try:
        renderer.version()
    except RendererMissing as missing:  # following both lobes needs libLLVM
        pytest.skip(str(missing))
    yield renderer
    renderer.close()


@pytest.fixture(scope="session")
def exact() -> Iterator[WorkerRenderer]:
    """Mitsuba without sampling, in a worker."""
    yield from _mitsuba("mitsuba-exact", "ExactEngine")


@pytest.fixture(scope="session")
def stock() -> Iterator[WorkerRenderer]:
    """Mitsuba as its users run it, in a worker."""
    yield from _mitsuba("mitsuba", "StockEngine")
