"""What a lane does around a job: between a finished image and its place in the cache, nothing."""

from __future__ import annotations

import queue
from pathlib import Path
from typing import Any

import pytest

from harness.cache.cache import Cache, open_cache
from harness.plan import Job
from harness.renderers.base import Image, RenderSettings
from harness.renderers.process_tree import Running
from harness.renderers.proof import proof_scene
from harness.running import memo
from harness.running.lanes import Calibrated, Done, Event, Lane, Surroundings
from harness.scene.resolved import ResolvedScene
from tests.fakes import FakeRenderer


def test_a_finished_image_is_kept_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A kill takes what is not kept: keys and packers are there before the image is."""
    order: list[str] = []

    class Told(FakeRenderer):
        def render(self, scene: ResolvedScene, settings: RenderSettings) -> Image:
            order.append("rendered")
            return super().render(scene, settings)

    def told(word: str, place: Any, name: str) -> None:
        real = getattr(place, name)

        def instead(*given: Any) -> Any:
            order.append(word)
            return real(*given)

        monkeypatch.setattr(place, name, instead)

    told("key", memo, "job_key")
    told("packers", memo, "load_packers")
    told("kept", Cache, "put")
    cache, events = open_cache(str(tmp_path)), queue.SimpleQueue[Event]()
    settings, scene = RenderSettings(), proof_scene(frozenset())
    renderer = Told()
    lane = Lane(renderer, settings, Surroundings(events, None, cache, Running()))
    lane.start()
    assert isinstance(events.get(timeout=60), Calibrated)
    order.clear()
    lane.submit(0, [Job(renderer.name, "image", scene, settings)])
    done = events.get(timeout=60)
    assert isinstance(done, Done)
    assert isinstance(done.result, Image), done.result
    lane.close()
    assert order == ["key", "packers", "rendered", "kept"]
