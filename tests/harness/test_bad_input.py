"""What has no meaning is one clear error, before any renderer is started."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from click.testing import CliRunner

from harness.cli import main

SCENE = """\
format = 1
title = "bad"
family = "bad"
sources = ["none"]

[camera]
type = "perspective"
origin = [0, 0, 5]
target = [0, 0, 0]
fov_x = 30

[media.glass]
ior = 1.5

[[solids]]
name = "ball"
medium = "glass"
shape = { type = "sphere", radius = 1 }

[[checks]]
observable = "radiance"
"""
ALSO = '\n[[solids]]\nname = "also"\nmedium = "glass"\nshape = {}\n\n[[checks]]'
CORNERS = "[0, 3, 0], [1, 3, 0], [0, 4, 0], [0, 3, 1], [2, 4, 2]"
FACES = "[0, 2, 1], [0, 1, 3], [1, 2, 3], [1, 4, 2]"
OPEN = f'{{ type = "triangles", vertices = [{CORNERS}], triangles = [{FACES}] }}'
NO_AXIS = '{ type = "cylinder", center = [3, 0, 0], axis = [0, 0, 0], radius = 1, height = 1 }'
TURN = "{ axis = [0, 0, 0], angle = 1 }"
NO_TURN = f'{{ type = "box", center = [3, 0, 0], size = [1, 1, 1], rotate = [{TURN}] }}'
NOWHERE = '[[lights]]\ntype = "directional"\ndirection = [0, 0, 0]\nirradiance = [1, 1, 1]\n'


def changed(old: str, new: str) -> str:
    assert SCENE.count(old) == 1
    return SCENE.replace(old, new)


def with_solid(shape: str) -> str:
    return changed("\n[[checks]]", ALSO.replace("{}", shape))


BAD = {
    "an index of zero": (changed("ior = 1.5", "ior = 0"), "media.glass.ior: out of range; got 0"),
    "an index below zero": (changed("ior = 1.5", "ior = -1.5"), "media.glass.ior: out of range"),
    "an index that is none": (changed("ior = 1.5", "ior = nan"), "ior: wrong type; got NaN"),
    "a direction of view without length": (
        changed("target = [0, 0, 0]", "target = [0, 0, 5]"),
        "camera.target: is where the camera's origin is",
    ),
    "an axis without length": (
        with_solid(NO_AXIS),
        "solids[1].shape.axis: has no direction",
    ),
    "a turn about nothing": (
        with_solid(NO_TURN),
        "solids[1].shape.rotate[0].axis: has no direction",
    ),
    "light from nowhere": (
        SCENE + NOWHERE,
        "lights[0].direction: has no direction",
    ),
    "an open mesh": (with_solid(OPEN), "not the surface of one solid"),
    "a camera in an unsaid medium": (
        changed("origin = [0, 0, 5]", "origin = [0, 0, 0.5]"),
        'camera.origin: the camera stands in glass; got [0.0, 0.0, 0.5]; expected medium = "glass"',
    ),
    "solids that overlap with equal priority": (
        with_solid('{ type = "sphere", center = [1, 0, 0], radius = 1 }'),
        "solids[1].shape: overlaps solid ball partly",
    ),
    "a feature under 1e-9 of the scene": (
        with_solid('{ type = "sphere", center = [3, 0, 0], radius = 4e-9 }'),
        "solids[1].shape: too small for a scene of this size",
    ),
    "a size of nothing": (changed("radius = 1", "radius = 0"), "solids[0].shape.radius"),
    "a size beyond all": (changed("radius = 1", "radius = 1e300"), "solids[0].shape.radius"),
}  # fmt: skip


@pytest.fixture
def refused(tmp_path: Path) -> Callable[[str], str]:
    """What `snellcheck run` says of a scene file that it refuses."""

    def run(text: str) -> str:
        folder = tmp_path / "scenes" / "bad"
        folder.mkdir(parents=True)
        (folder / "case.toml").write_text(text)
        renderer = f"touch {tmp_path / 'started'} {{scene}} {{output}}"
        arguments = ["run", "--scenes", str(folder.parent), "--out", str(tmp_path / "out")]
        arguments += ["--renderer-command", renderer, "--no-history", "--no-cache"]
        done = CliRunner().invoke(main, arguments)
        assert done.exit_code == 2, done.output
        assert not (tmp_path / "started").exists()
        assert not (tmp_path / "out").exists()
        assert "Traceback" not in done.output
        return " ".join(done.output.split())

    return run


@pytest.mark.parametrize("name", BAD)
def test_bad_input_is_refused_before_anything_is_traced(
    refused: Callable[[str], str], name: str
) -> None:
    text, message = BAD[name]
    assert message in refused(text)
