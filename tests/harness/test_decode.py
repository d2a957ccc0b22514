"""Position codes there and back: within the stated uncertainty or not at all.

A renderer is modelled by what it does to a code: every channel is multiplied by the weight of the
path and comes back off by at most one quantum, in whichever direction hurts most.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from harness.expected import Float
from harness.probe.decode import Decoded, Reason, decode, finest_cells, lit_threshold
from harness.probe.scenes import AMPLITUDE, AXES, code_scene, light_scene
from harness.scene import resolved as rs
from tests.catalogue import EPS
from tests.harness.scenes import face, scene, slab

COORDINATES = st.floats(0, 1)
CELLS = st.integers(1, 4096)
WEIGHTS = st.floats(0.05, 1)
# In quanta. A millionth short of one, because adding it to a pixel rounds: at a quantum of 1e-9
# that is 2e-7 of it.
ERRORS = st.tuples(*[st.sampled_from([-1 + 1e-6, -0.5, 0.0, 0.5, 1 - 1e-6])] * 3)


def code(c: Float | float, cells: int, weight: float = 1.0) -> Float:
    """What a plane shows at `c`: (..., 3)."""
    c = np.asarray(c, float)
    fine = cells * c - np.floor(cells * c)
    return weight * AMPLITUDE * np.stack([c, fine, np.ones_like(c)], axis=-1)


def decoded(pixels: Float, cells: int, quantum: float) -> Decoded:
    return decode(pixels, cells, AMPLITUDE, quantum)  # type: ignore[arg-type]


def error(found: Decoded, c: float) -> float:
    """A fine code of 1 in one cell is 0 in the next: the same place."""
    return abs(float(found.coordinate[0]) - c)


# --- one path in a pixel --------------------------------------------------------------------------


@given(COORDINATES, CELLS, WEIGHTS, st.floats(1e-9, 1e-2), ERRORS)
def test_a_code_with_errors_decodes_within_its_uncertainty_or_says_why_not(
    c: float, cells: int, weight: float, quantum: float, off: tuple[float, float, float]
) -> None:
    pixel = code(c, cells, weight) + quantum * np.array(off)
    found = decoded(pixel[None], cells, quantum)
    reason = Reason(int(found.reason[0]))
    assert reason in (Reason.OK, Reason.FAINT, Reason.DARK)  # one path is never taken for two
    if reason is Reason.OK:
        assert error(found, c) <= found.uncertainty[0] + 8 * EPS
        assert found.level[0] == pytest.approx(weight, abs=quantum / AMPLITUDE + 8 * EPS)
    else:
        assert np.isnan(found.coordinate[0])
        assert np.isnan(found.uncertainty[0])


def rounded(pixel: Float, kind: str) -> Float:
    match kind:
        case "8 bit":
            return np.round(pixel * 255) / 255
        case "16 bit":
            return np.round(pixel * 65535) / 65535
        case "half":
            return pixel.astype(np.float16).astype(float)
        case _:
            return pixel.astype(np.float32).astype(float)


# Half a step of the values just below 1, which are the coarsest.
QUANTUM = {"8 bit": 0.5 / 255, "16 bit": 0.5 / 65535, "half": 2.0**-12, "float32": 2.0**-25}


@pytest.mark.parametrize("kind", QUANTUM)
@given(c=COORDINATES, weight=st.floats(0.3, 1))
def test_all_that_images_are_stored_in_decode(kind: str, c: float, weight: float) -> None:
    """With as many cells as the quantum allows, every pixel of weight 0.3 decodes."""
    quantum = QUANTUM[kind]
    cells = finest_cells(quantum, 0.3 * AMPLITUDE, 1 << 20)
    found = decoded(rounded(code(c, cells, weight), kind)[None], cells, quantum)
    assert found.reason[0] == Reason.OK
    assert error(found, c) <= found.uncertainty[0] + 8 * EPS


@pytest.mark.parametrize(
    ("kind", "resolution"), [("8 bit", 1e-2), ("16 bit", 2e-7), ("half", 4e-5), ("float32", 1e-12)]
)
def test_the_finest_codes_resolve_what_images_allow(kind: str, resolution: float) -> None:
    """The error is quantum x 2 / (level x cells), and cells are level / (8 quantum): 16 q^2 / l^2.

    A single coarse code of one cell would give 2 q / l.
    """
    quantum = QUANTUM[kind]
    cells = finest_cells(quantum, 0.3 * AMPLITUDE, 1 << 30)
    c = np.linspace(0, 1, 4001)
    found = decoded(rounded(code(c, cells), kind), cells, quantum)
    assert (found.reason == Reason.OK).all()
    assert np.abs(found.coordinate - c).max() <= resolution


@pytest.mark.parametrize("quantum", [2.0**-25, 0.5 / 65535])
@pytest.mark.parametrize("side", [-1, 0, 1])
def test_at_the_border_of_two_cells_either_tells_the_same_place(side: int, quantum: float) -> None:
    cells = 100
    borders = np.arange(1, cells) / cells
    c = borders + side * quantum / cells / 10
    for off in (-quantum, 0, quantum):
        pixels = code(c, cells)
        pixels[:, 1] += off
        found = decoded(pixels, cells, quantum)
        assert (found.reason == Reason.OK).all()
        assert (np.abs(found.coordinate - c) <= found.uncertainty + 8 * EPS).all()


def test_a_fine_code_that_wrapped_alone_is_not_believed() -> None:
    """Where an interpolating renderer smears the jump of the fine code, no place is made up."""
    cells = 100
    pixel = code(0.5, cells)
    pixel[1] = AMPLITUDE / 2  # halfway between 1 and 0
    assert decoded(pixel[None], cells, 1e-7).reason[0] == Reason.MIXED


# --- several paths in a pixel ---------------------------------------------------------------------


@given(COORDINATES, COORDINATES, CELLS, st.floats(0.001, 0.5), st.floats(1e-9, 1e-4))
def test_two_paths_in_a_pixel_are_seen(
    a: float, b: float, cells: int, share: float, quantum: float
) -> None:
    """Coarse and fine code disagree by the weighted mean of the cells' numbers.

    It shows unless that happens to be near a whole number, or light is too faint to tell.
    """
    pixel = (1 - share) * code(a, cells) + share * code(b, cells)
    mean = (1 - share) * np.floor(a * cells) + share * np.floor(b * cells)
    slack = quantum * (cells * 2 + 2) / (AMPLITUDE - quantum)
    assume(slack < 0.25)
    assume(abs(mean - round(mean)) > slack + 64 * EPS * cells)
    assert decoded(pixel[None], cells, quantum).reason[0] == Reason.MIXED


def test_a_ghost_of_a_thousandth_is_seen() -> None:
    """The second internal reflection of a slab has 0.16% of the light."""
    cells, quantum = 4096, 2.0**-25
    clean, ghost = code(0.3, cells), code(0.36, cells)
    assert decoded(clean[None], cells, quantum).reason[0] == Reason.OK
    assert decoded((clean + 0.0016 * ghost)[None], cells, quantum).reason[0] == Reason.MIXED


def test_light_that_no_code_plane_sent_is_seen() -> None:
    for pixel in ([0.2, 0.5, 0.2], [0.2, -0.1, 0.2], [0.3, 0.1, 0.2]):
        assert decoded(np.array([pixel]), 1000, 1e-7).reason[0] == Reason.MIXED


# --- no path in a pixel ---------------------------------------------------------------------------


def test_dark_faint_and_broken_pixels_hold_no_place() -> None:
    quantum, cells = 1e-4, 100
    pixels = np.array(
        [
            [0.0, 0.0, 0.0],
            [0.0, 0.0, lit_threshold(quantum) * 0.99],
            code(0.4, cells, 0.01),
            [np.nan, 0.1, 0.2],
            [0.1, np.inf, 0.2],
            [0.1, 0.1, -np.inf],
            [0.1, 0.1, -0.3],
        ]
    )
    found = decoded(pixels, cells, quantum)
    assert found.reason.tolist() == [
        Reason.DARK,
        Reason.DARK,
        Reason.FAINT,
        Reason.NOT_FINITE,
        Reason.NOT_FINITE,
        Reason.NOT_FINITE,
        Reason.DARK,
    ]
    assert np.isnan(found.coordinate).all()
    assert np.isnan(found.uncertainty).all()


def test_images_are_flattened_row_by_row() -> None:
    c = np.linspace(0.1, 0.9, 12).reshape(3, 4)
    found = decoded(code(c, 64), 64, 1e-9)
    assert np.abs(found.coordinate - c.ravel()).max() <= 1e-9


@given(st.floats(1e-9, 0.1), st.floats(0.01, 1), st.integers(1, 10000))
def test_no_more_cells_than_wanted_nor_fewer_than_one(
    quantum: float, weakest: float, wanted: int
) -> None:
    cells = finest_cells(quantum, weakest, wanted)
    assert 1 <= cells <= wanted
    assert finest_cells(0.0, weakest, wanted) == wanted


# --- the scenes that show codes -------------------------------------------------------------------


def crowded() -> rs.ResolvedScene:
    """A slab, a light, and surfaces of all kinds."""
    materials: dict[str, rs.Material] = {
        "lamp": rs.Emissive(pattern=rs.Constant(radiance=(1, 1, 1))),
        "wall": rs.Diffuse(reflectance=(1, 1, 1)),
        "veil": rs.Translucent(color=(1, 1, 1), filter=0.5, transmit=0.5),
        "mirror": rs.Mirror(reflectance=(1, 1, 1)),
        "thin": rs.ThinSlab(medium=1, exterior=0, thickness=0.1),
    }
    surfaces = tuple(
        rs.Surface(name=name, shape=face(-k - 5.0), material=material)
        for k, (name, material) in enumerate(materials.items())
    )
    light = rs.PointLight(position=(0, 9, 0), intensity=(1, 1, 1))
    return scene((slab(0, -1), 1, 0)).model_copy(
        update={"surfaces": surfaces, "lights": (light,), "background": (1.0, 1.0, 1.0)}
    )


@pytest.mark.parametrize(
    ("path", "reflection", "transmission"),
    [("", False, True), ("TT", False, True), ("R", True, False), ("TRT", True, True)],
)
def test_a_probe_admits_one_path(path: str, reflection: bool, transmission: bool) -> None:
    probe = code_scene(crowded(), face(-3.0), "v", 77, path)
    assert [s.name for s in probe.surfaces] == ["mirror", "thin", "probe-plane"]
    assert probe.background == (0, 0, 0)
    assert probe.lights == ()
    assert probe.transport.max_depth == len(path) + 1
    assert probe.transport.min_weight == 0
    assert probe.transport.reflection is reflection
    assert probe.transport.transmission is transmission
    material = probe.surfaces[-1].material
    assert isinstance(material, rs.Emissive)
    assert material.pattern == rs.PositionCode(axis="v", cells=77, amplitude=AMPLITUDE)
    assert probe.solids == crowded().solids


def test_a_light_probe_weighs_both_lobes() -> None:
    probe = light_scene(crowded(), face(-3.0), "R")
    assert (probe.transport.reflection, probe.transport.transmission) == (True, True)
    assert probe.transport.max_depth == 2
    material = probe.surfaces[-1].material
    assert isinstance(material, rs.Emissive)
    assert material.pattern == rs.Constant(radiance=(1, 1, 1))


def test_codes_leave_room_above_for_rounding() -> None:
    assert AXES == ("u", "v")
    brightest = code(np.nextafter(1, 0), 4096).max()
    assert brightest < 1 - 2.0**-12
