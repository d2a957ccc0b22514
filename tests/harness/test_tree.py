"""The tree of all paths against closed forms of sums, and against the paths followed one by one."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from harness.renderers.base import Rays, Status
from harness.scene.order import placed
from harness.scene.resolved import Sphere
from harness.truth.paths import ClosedForm
from harness.truth.tree import branches, light_around, light_on, natural_weight
from tests.catalogue import EPS, Row, numbers, rows
from tests.harness.scenes import face, fan, parallel, prism, scene, slab

BALL = Sphere(center=(0, 0, 0), radius=1)


def without_partial(form: ClosedForm, rays: Rays, depth: int) -> set[str]:
    """The paths that a renderer shows which reflects nothing but what is totally reflected."""
    return {b.path for b in branches(form, rays, depth) if b.certain.any()}


@pytest.mark.parametrize("row", rows("slab_RT"), ids=str)
def test_nature_s_slab(row: Row) -> None:
    """The catalogue's slabs were computed per polarisation, with all internal reflections."""
    degrees, ior, alpha, thickness = numbers(row.p)
    form = ClosedForm(scene((slab(0, -thickness), 1, 0), ior=(ior,), absorption=(alpha,) * 3))
    rays = fan(np.radians([degrees]))
    behind = light_on(form, rays, face(-thickness - 1), 120, 0.0)
    before = light_on(form, rays, face(2.0), 120, 0.0)
    bound = 64 * EPS / math.cos(math.radians(degrees))
    assert abs(behind.natural[0, 0] - float(row.v[5])) <= bound
    assert abs(before.natural[0, 0] - float(row.v[4])) <= bound


@pytest.mark.parametrize("row", rows("slab_T_scalar"), ids=str)
def test_a_renderer_s_slab(row: Row) -> None:
    """Unpolarised Fresnel at each face: 0.70788 at 70 degrees, where nature has 0.72871."""
    degrees, ior = numbers(row.p)
    form = ClosedForm(scene((slab(0, -1), 1, 0), ior=(ior,)))
    light = light_on(form, fan(np.radians([degrees])), face(-2.0), 120, 0.0)
    assert abs(light.level[0, 0] - float(row.v)) <= 32 * EPS


@given(st.floats(1.05, 3), st.sampled_from(["TT", "R", "TRT", "TRRT"]))
def test_each_branch_is_the_path_followed_alone(ior: float, path: str) -> None:
    form = ClosedForm(scene((BALL, 1, 0), ior=(ior,)))
    rays = parallel(np.linspace(0.05, 0.95, 7))
    alone = form.follow(rays, path)
    for branch in branches(form, rays, len(path) + 1):
        if branch.path == path:
            assert np.abs(branch.origin - alone.origin[branch.rows]).max() <= 64 * EPS
            assert np.abs(branch.weight - alone.weight[branch.rows]).max() <= 64 * EPS
            assert (alone.status[branch.rows] == Status.HIT).all()
            return
    assert (alone.status != Status.HIT).all()


@pytest.mark.parametrize("iors", [(1.5, 1.333), (1.333, 1.5), (2.417, 1.0)])
def test_slabs_that_share_a_face(iors: tuple[float, float]) -> None:
    """Two layers by Stokes' sums: R = R_a + T_a^2 R_b / (1 - R_a R_b), T = T_a T_b / (1 - R_a R_b).

    G. G. Stokes, On the intensity of the light reflected from or transmitted through a pile of
    plates, Proc. R. Soc. 11, 545 (1862), for faces instead of plates. At normal incidence, where
    R = ((n - m) / (n + m))^2 in all polarisations.
    """
    layers = scene((slab(0, -1), 1, 0), (slab(-1, -3), 2, 0), ior=iors)
    form = ClosedForm(layers.model_copy(update={"solids": placed(layers.solids, (0, 0), 1e-9)}))
    rays = fan(np.zeros(1))
    assert without_partial(form, rays, 4) == {"", "T", "TT", "TTT"}
    behind, before = (light_on(form, rays, face(z), 40, 1e-9) for z in (-4.0, 2.0))
    transmitted, reflected = 1.0, 0.0
    for n, m in pairwise((1.0, *iors, 1.0)):
        r = ((n - m) / (n + m)) ** 2
        again = 1 - reflected * r
        reflected, transmitted = (
            reflected + transmitted**2 * r / again,
            transmitted * (1 - r) / again,
        )
    for light, all_of_it in ((behind, transmitted), (before, reflected)):
        missing = all_of_it - light.level[0, 0]
        assert -64 * EPS <= missing <= light.cut[0] + 64 * EPS
        assert light.cut[0] <= 1e-6


def test_in_a_white_furnace_nothing_is_lost() -> None:
    """A ball and a prism, at which all light that is not followed is accounted for."""
    for shape in (BALL, prism(math.radians(60))):
        form = ClosedForm(scene((shape, 1, 0)))
        light = light_around(form, parallel(np.linspace(0.05, 0.9, 9)), 60, 1e-9)
        for level in (light.level, light.natural):
            # Natural light loses as much by the cut as its weights differ from the model's.
            assert np.abs(level[:, 0] + light.cut - 1).max() <= 1e-6
        assert np.abs(light.level[:, 0] + light.cut - 1).max() <= 1e-12
        assert (light.cut >= -64 * EPS).all()


def test_a_shallower_tree_is_a_partial_sum() -> None:
    form, rays = ClosedForm(scene((slab(0, -1), 1, 0), ior=(2.417,))), fan(np.radians([50.0]))
    sums = [light_on(form, rays, face(-2.0), depth, 0.0).level[0, 0] for depth in range(2, 12)]
    # Two segments more are one pair of internal reflections more.
    steps = np.diff(sums)
    assert (steps[1::2] == 0).all()
    assert (steps[::2] > 0).all()
    terms = steps[::2]
    geometric = terms[0] * (terms[1] / terms[0]) ** np.arange(len(terms))
    # Differences of sums below 1; the ratio of the first two carries its own error along.
    assert np.abs(terms - geometric).max() <= 64 * EPS


def test_brewster_twice_polarises() -> None:
    """Behind two faces at Brewster's angle: (1 + (1 - R_s)^2) / 2, not (1 - R_s / 2)^2."""
    n = 1.5
    form = ClosedForm(scene((slab(0, -1), 1, 0), ior=(n,)))
    weight = natural_weight(form, fan(np.array([math.atan(n)])), "TT")[0]
    r_s = ((1 - n * n) / (1 + n * n)) ** 2
    assert abs(weight - (1 + (1 - r_s) ** 2) / 2) <= 32 * EPS
    assert abs(form.follow(fan(np.array([math.atan(n)])), "TT").weight[0] - (1 - r_s / 2) ** 2) <= (
        32 * EPS
    )


def test_only_total_reflections_where_partial_ones_are_off() -> None:
    form = ClosedForm(scene((prism(math.radians(90)), 1, 0)))
    rays = Rays(np.array([[-3.0, 0.0, 5.0]]), np.array([[0.0, 0.0, -1.0]]))
    with_partial = {b.path for b in branches(form, rays, 4)}
    without = without_partial(form, rays, 4)
    assert without < with_partial
    assert not any(path.startswith("R") for path in without)
