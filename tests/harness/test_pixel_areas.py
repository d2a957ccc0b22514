"""Means of light over pixels, against the same of far more rays, evenly spaced."""

from __future__ import annotations

import numpy as np
import pytest

from harness.data import scenes_root
from harness.expected import Float
from harness.measure.pixel_areas import ROOTED, SMOOTH, Grid, pixel_areas
from harness.measure.probe_truth import ProbeTruth, probe_truth
from harness.plan import prepare
from harness.renderers.base import Status
from harness.scene.load import load_cases
from harness.truth.camera import primary_rays, rays_through
from harness.truth.paths import ClosedForm

EVENLY = 24  # rays a side
PIXELS = 400  # that are looked at


def truth_of(scene: str, probe: str) -> ProbeTruth:
    case = prepare(load_cases(scenes_root() / scene)[0])
    found = case.probe(probe)
    return probe_truth(case.scene, found.path, case.planes(found))


def light(grid: Grid) -> Float:
    level = np.nan_to_num(grid.paths.weight[:, None] * grid.landing.transmission)
    return np.where((grid.landing.status == Status.HIT)[:, None], level, 0.0)


def evenly(truth: ProbeTruth, rows: Float) -> Float:
    """(k,) means over the pixels `rows`, by the midpoint rule."""
    places = (np.arange(EVENLY) + 0.5) / EVENLY
    down, across = np.divmod(rows, truth.scene.film.width)
    inside = np.meshgrid(places, places, indexing="ij")
    y, x = (
        (corner[:, None] + i.ravel()).ravel()
        for corner, i in zip((down, across), inside, strict=True)
    )
    form = ClosedForm(truth.scene)
    paths = form.follow(rays_through(truth.scene, x, y), truth.path)
    landing = form.land(paths, truth.planes[0])
    level = np.nan_to_num(paths.weight) * (landing.status == Status.HIT)
    return level.reshape(len(rows), -1).mean(axis=1)


@pytest.mark.parametrize(
    ("scene", "probe"),
    [("fresnel/inside.toml", "transmitted"), ("fresnel/inside.toml", "reflected"),
     ("tir/limit.toml", "grazing")],
)  # fmt: skip
def test_means_are_right_where_total_reflection_begins_too(scene: str, probe: str) -> None:
    """Of light that goes out with a root, n rays a side miss some 0.1 / n^(3/2); 0.2 bounds it.

    Elsewhere the rule of three misses hardly more than the many rays that it is held against, of
    which the error is a 24 n^2-th of a second derivative that one pixel cannot make larger than 1.
    """
    truth = truth_of(scene, probe)
    areas = pixel_areas(truth)
    rooted = areas.rooted.rows
    assert 0 < len(rooted) < len(areas.whole) / 20
    rest = np.setdiff1d(np.flatnonzero(areas.whole), rooted)
    for rows, limit in (
        (rooted, 0.2 / len(ROOTED[0]) ** 1.5),
        (rest[:: max(1, len(rest) // PIXELS)], 1 / (24 * EVENLY**2)),
    ):
        assert len(rows)
        assert np.abs(areas.mean(light)[rows, 0] - evenly(truth, rows)).max() <= limit


def test_both_rules_are_rules() -> None:
    """Shares add up to 1, and places have the pixel's middle as theirs."""
    for places, shares in (SMOOTH, ROOTED):
        assert abs(shares.sum() - 1) <= 1e-15
        assert abs((places * shares).sum() - 0.5) <= 1e-15


def test_a_pixel_s_centre_is_where_its_primary_ray_goes() -> None:
    truth = truth_of("fresnel/inside.toml", "reflected")
    width = truth.scene.film.width
    rays = primary_rays(truth.scene)
    one = rays_through(truth.scene, np.array([7.5]), np.array([3.5]))
    assert np.array_equal(one.directions[0], rays.directions[3 * width + 7])
