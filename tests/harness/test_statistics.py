"""How often a sampled check cries wolf, how often it sleeps, and what it says where it cannot tell.

All rates are held against binomial bounds that a right procedure oversteps once in 10,000 tests.
"""

from __future__ import annotations

import re

import numpy as np
import pytest
from scipy.stats import binom

from harness.expected import Float, fresnel
from harness.measure.comparison import Unmeasurable
from harness.measure.images import Pixels
from harness.measure.light_observables import sampled_path_weight
from harness.measure.statistics import (
    BIN,
    FALSE_ALARM,
    MARGIN,
    POWER,
    SUITE_CHECKS,
    SUITE_LEVEL,
    UNSURE,
    Moments,
    Noise,
    binned,
    compare_regions,
    per_test,
    samples_needed,
    skewness,
)
from harness.renderers.base import Status
from harness.renderers.persistent import WorkerRenderer
from harness.scene.resolved import Film
from harness.truth.camera import primary_rays
from harness.truth.paths import ClosedForm
from tests.harness import rates

RARE = 1e-4


def at_most(trials: int, chance: float) -> int:
    """So many of `trials` come out, but once in 10,000 times, where each has `chance`."""
    return int(binom.ppf(1 - RARE, trials, chance))


# --- a short suite of a renderer that samples -----------------------------------------------------


def curve(ior: float) -> Float:
    """What one face transmits at 2,048 angles up to 85 degrees, in three channels."""
    cos = np.cos(np.radians(np.linspace(0, 85, 2048)))
    return np.repeat((1 - fresnel(cos, np.ones_like(cos), np.full_like(cos, ior)))[:, None], 3, 1)


def board() -> Float:
    """A picture (48, 48, 3) of soft light with a dark quarter."""
    y, x = np.mgrid[0:48, 0:48] / 48
    level = np.where((x < 0.5) & (y < 0.5), 0.003, 0.2 + 0.5 * x * y)
    return np.repeat(level[..., None], 3, axis=2)


def sampled(true: Float, samples: int, noise: np.random.Generator, bias: float = 0.0) -> Float:
    """What a renderer shows that chooses each path with the chance of its weight."""
    chance = np.clip(true + bias, 0, 1)
    return np.asarray(noise.binomial(samples, chance) / samples)


def region_alarm(noise: np.random.Generator, level: float, samples: int = 256) -> bool:
    true = board()
    two = [sampled(true, samples // 2, noise).astype(np.float32) for _ in range(2)]
    exact = Moments(true, np.zeros_like(true), 1.0, np.zeros_like(true))
    found = compare_regions(Moments.of_two(*two), exact, level, 1.0, samples)
    return found.gap > found.limit


def short_suite(seed: int, level: float) -> int:
    """The number of alarms of six checks of light and two of pictures, each at `level`."""
    noise, alarms = np.random.default_rng(seed), 0
    many = samples_needed()
    for ior in (1.1, 1.333, 1.5, 1.7847, 2.0, 2.417):
        true = curve(ior)
        found = binned(sampled(true, many, noise), true, np.arange(len(true)), Noise(many, level))
        alarms += not found.within
    return alarms + sum(region_alarm(noise, level) for _ in range(2))


def test_a_suite_raises_false_alarms_no_more_often_than_stated() -> None:
    """200 reruns with fresh seeds, at a level that lets alarms be counted: 5% for the suite."""
    level = per_test(0.05, 8)
    alarmed = sum(short_suite(seed, level) > 0 for seed in range(200))
    assert alarmed <= at_most(200, 0.05)
    # Nor is it much more careful than that: limits that are idle see nothing.
    assert alarmed >= 1


def test_at_the_level_of_real_suites_there_is_no_alarm() -> None:
    """At 1e-5 a check, 800 checks raise one with a chance of 0.8%, and two hardly ever."""
    assert sum(short_suite(1000 + seed, FALSE_ALARM) for seed in range(100)) <= at_most(
        800, FALSE_ALARM
    )


def test_the_levels_of_checks_add_up_to_that_of_the_suite() -> None:
    assert pytest.approx(SUITE_LEVEL) == 1 - (1 - FALSE_ALARM) ** SUITE_CHECKS
    assert per_test(0.05, 1) == pytest.approx(0.05)
    assert 1 - (1 - per_test(0.05, 37)) ** 37 == pytest.approx(0.05)


@pytest.mark.mitsuba
def test_mitsuba_is_accused_no_more_often_than_stated(stock: WorkerRenderer) -> None:
    """50 reruns with fresh seeds, at 5% for the suite; docs/rates.md has 200 of them."""
    alarmed = sum(found > 0 for (found,) in rates.rounds(stock, 50, (0.05,)))
    assert alarmed <= at_most(50, 0.05)


def test_light_that_changes_within_a_pixel_is_no_alarm() -> None:
    """A renderer that samples areas: near total reflection the centre's light is not the mean."""
    noise, many, alarms = np.random.default_rng(3), samples_needed(), 0
    questions = [q for q in rates.short_suite() if q.scene.camera.medium]
    for question in questions:
        film = question.scene.film
        finer = Film(width=16 * film.width, height=16 * film.height)
        rays = primary_rays(question.scene.model_copy(update={"film": finer}))
        paths = ClosedForm(question.truth.scene).follow(rays, question.truth.path)
        # By a path of T alone light is 0 where reflection is total.
        weight = np.where(paths.status == Status.HIT, paths.weight, 0.0)
        mean = weight.reshape(film.height, 16, film.width, 16).mean(axis=(1, 3))
        for _ in range(50):
            pixels = noise.binomial(many, np.repeat(mean[..., None], 3, axis=2)) / many
            judged = sampled_path_weight(
                question.truth, pixels.astype(np.float32), Noise(many, 0.05), n2=False
            )
            alarms += not judged.within
    assert alarms <= at_most(50 * len(questions), 0.05)


# --- power and equivalence ------------------------------------------------------------------------


def outcome(bias: float, samples: int, seed: int) -> str:
    noise, true = np.random.default_rng(seed), np.full((4 * BIN, 3), 0.5)
    value = sampled(true, samples, noise, bias)
    try:
        found = binned(value, true, np.arange(len(true)), Noise(samples))
    except Unmeasurable as error:
        return str(error)
    return "pass" if found.within else "fail"


def test_with_the_samples_that_it_asks_for_a_right_renderer_passes() -> None:
    passed = sum(outcome(0.0, samples_needed(), seed) == "pass" for seed in range(200))
    assert 200 - passed <= at_most(200, 1 - POWER)


def test_a_renderer_that_is_a_margin_off_hardly_ever_passes() -> None:
    """However few samples it is given: then it is an error, not a pass."""
    for samples in (16, 64, samples_needed(), 4 * samples_needed()):
        passed = sum(outcome(MARGIN, samples, seed) == "pass" for seed in range(100))
        assert passed <= at_most(100, UNSURE)


def test_a_renderer_that_is_two_margins_off_fails() -> None:
    many = samples_needed(margin=MARGIN / 2)
    assert all(outcome(2 * MARGIN, many, seed) == "fail" for seed in range(50))


def test_without_power_it_says_how_many_samples_it_needs() -> None:
    said = outcome(0.0, 16, 1)
    wanted = re.search(r"has 16 per pixel and needs (\d+)", said)
    assert wanted is not None, said
    # Measured variance instead of its bound, and the means that there are instead of the most.
    assert samples_needed() / 2 < int(wanted[1]) < 2 * samples_needed()
    assert outcome(0.0, 2 * int(wanted[1]), 1) == "pass"


def test_fewer_samples_do_for_more_pixels_and_wider_margins() -> None:
    assert samples_needed(4 * BIN) <= samples_needed() / 4 + 1
    assert samples_needed(margin=2 * MARGIN) <= samples_needed() / 4 + 1


# --- regions --------------------------------------------------------------------------------------


def compared(change: Pixels | Float, samples: int = 1024) -> tuple[bool, int, int, int]:
    noise, true = np.random.default_rng(5), board()
    shown = np.clip(true + change, 0, 1)
    two = [sampled(shown, samples // 2, noise).astype(np.float32) for _ in range(2)]
    exact = Moments(true, np.zeros_like(true), 1.0, np.zeros_like(true))
    found = compare_regions(Moments.of_two(*two), exact, FALSE_ALARM, 1.0, samples)
    return found.gap > found.limit, found.side, found.x, found.y


def test_a_faint_patch_is_found_by_its_region_and_named() -> None:
    """An error of a fifth of the pixels' own noise, over 16 x 16 pixels."""
    change = np.zeros((48, 48, 3))
    change[16:32, 32:48] = 0.02
    alarm, side, x, y = compared(change, 4096)
    assert alarm
    assert (side, x, y) == (16, 32, 16)


def test_a_single_wrong_pixel_is_found_in_the_dark() -> None:
    change = np.zeros((48, 48, 3))
    change[5, 7] = 0.9
    alarm, side, x, y = compared(change)
    assert alarm
    assert x <= 7 < x + side
    assert y <= 5 < y + side


def test_two_noisy_pictures_of_the_same_agree() -> None:
    noise, true = np.random.default_rng(9), board()
    a, b = (
        Moments.of_two(*(sampled(true, 512, noise).astype(np.float32) for _ in range(2)))
        for _ in range(2)
    )
    found = compare_regions(a, b, FALSE_ALARM, 1.0, 1024)
    assert found.gap <= found.limit


def test_too_few_samples_for_a_picture_are_no_pass() -> None:
    with pytest.raises(Unmeasurable, match="too few samples"):
        compared(np.zeros((48, 48, 3)), 4)


def test_skewness_is_what_a_rare_path_has() -> None:
    """Cornish and Fisher's first term, for a path chosen with chance p: skewness (1 - 2p) / s."""
    p, n, z = 1e-3, 10_000, 5.0
    s = np.sqrt(p * (1 - p))
    exact = (z**2 - 1) / 6 * (1 - 2 * p) / s / np.sqrt(n) * s / np.sqrt(n)
    assert exact <= skewness(z, n) <= 1.01 * exact
