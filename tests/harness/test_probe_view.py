"""How probes look: what was not measured is shown as such."""

from __future__ import annotations

import numpy as np
import pytest

from harness.probe.scenes import AMPLITUDE
from harness.probe.view import CELLS, view_of_codes, view_of_rays
from harness.renderers.base import RayPaths, Status
from harness.scene.resolved import Film, Frame, Rectangle

PLANE = Rectangle(
    frame=Frame(origin=(1, 0, 0), x=(1, 0, 0), y=(0, 1, 0), z=(0, 0, 1)), size=(8.0, 8.0)
)


def rays(along: list[float], status: list[Status]) -> RayPaths:
    n = len(along)
    return RayPaths(
        status=np.array(status, np.int8),
        surface=np.zeros(n, np.int32),
        point=np.array([[a + 1.0, 0.0, 0.0] for a in along]).reshape(n, 3),
        direction=np.zeros((n, 3)),
        weight=np.ones(n),
        optical_length=np.ones(n),
    )


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_what_is_not_finite_is_shown_as_not_a_number(bad: float) -> None:
    coded = np.full((1, 2, 3), AMPLITUDE, np.float32)
    coded[0, 0, 1] = bad
    view = view_of_codes(coded)
    assert np.isnan(view[0, 0]).all()
    assert np.isfinite(view[0, 1]).all()


def test_black_is_black() -> None:
    assert (view_of_codes(np.zeros((2, 2, 3), np.float32)) == 0.0).all()


def test_rays_and_codes_look_alike() -> None:
    along = [-2.0, 0.5, 3.0, 0.0]
    coarse = np.array(along) / 8.0 + 0.5
    levels = AMPLITUDE * np.stack([coarse, np.mod(CELLS * coarse, 1.0), np.ones(4)], -1)
    coded = np.float32(levels).reshape(2, 2, 3)
    paths = rays(along, [Status.HIT] * 4)
    view = view_of_rays(paths, PLANE, Film(width=2, height=2))
    assert view is not None
    np.testing.assert_allclose(view, view_of_codes(coded), atol=1e-5)


def test_rays_that_are_not_one_per_pixel_have_no_picture() -> None:
    assert view_of_rays(rays([0.0], [Status.HIT]), PLANE, Film(width=2, height=2)) is None
