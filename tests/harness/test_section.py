"""The section drawing: outlines against closed forms, angles against Snell's law, sound SVG."""

from __future__ import annotations

import math
import re
from xml.etree import ElementTree

import numpy as np
import pytest

from harness.scene import resolved
from harness.section import Cut, Window, draw, outline, plane_of, ray_path, window_of
from harness.section.outline import along_face

X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
LEVEL = Cut(np.zeros(3), np.array(X), np.array(Y))
WIDE = Window(-4, -4, 4, 4)
# An outline point lies on a grid line between two ends that were halved 30 times.
EXACT = 8 / 160 / 2**29


def area(loop: np.ndarray) -> float:
    x, y = loop.T
    return abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1))) / 2


def box(half: float = 1.0) -> resolved.Convex:
    """A cube around the origin."""
    corners = [(x * half, y * half, z * half) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    planes = [(*(s * float(i == k) for i in range(3)), half) for k in range(3) for s in (-1, 1)]
    faces = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    return resolved.Convex.model_validate({"planes": planes, "vertices": corners, "faces": faces})


def scene(*solids: resolved.SolidShape, ior: float = 1.5) -> resolved.ResolvedScene:
    return resolved.ResolvedScene(
        film=resolved.Film(width=8, height=8),
        camera=resolved.Perspective(
            origin=(0, 0, 6), right=X, up=Y, forward=(0, 0, -1), tan_half_fov_x=0.3
        ),
        media=(
            resolved.Medium(name="air", ior=1.0),
            resolved.Medium(name="<glass & co>", ior=ior),
        ),
        solids=tuple(
            resolved.Solid(name=f'"{k}"', shape=shape, medium=1, exterior=0)
            for k, shape in enumerate(solids)
        ),
        transport=resolved.Transport(max_depth=10, min_weight=0),
    )


# --- outlines -------------------------------------------------------------------------------------


@pytest.mark.parametrize("height", [0.0, 0.6, -0.8])
def test_a_ball_is_cut_in_a_circle(height: float) -> None:
    ball = resolved.Sphere(center=(0.3, 0.1, height), radius=1.0)
    (loop,) = outline(ball, LEVEL, WIDE)
    radius = np.linalg.norm(loop - [0.3, 0.1], axis=1)
    assert np.abs(radius - math.sqrt(1 - height**2)).max() < 4 * EXACT


def test_a_plane_beside_a_solid_cuts_nothing() -> None:
    assert outline(resolved.Sphere(center=(0, 0, 1.5), radius=1), LEVEL, WIDE) == []
    far = Cut(np.array([0, 0, 1.5]), np.array(X), np.array(Y))
    assert outline(box(), far, WIDE) == []


def test_a_cube_is_cut_in_a_square_and_a_hexagon() -> None:
    (square,) = outline(box(), LEVEL, WIDE)
    assert area(square) == pytest.approx(4, abs=1e-12)
    # Across its diagonal a cube of side 2 shows a regular hexagon of side sqrt(2).
    x = np.array([1, -1, 0]) / math.sqrt(2)
    y = np.array([1, 1, -2]) / math.sqrt(6)
    (hexagon,) = outline(box(), Cut(np.zeros(3), x, y), WIDE)
    assert area(hexagon) == pytest.approx(3 * math.sqrt(3), abs=1e-12)


def test_corners_of_contoured_solids_are_sharp() -> None:
    """Along its axis a cylinder is a rectangle, though it is found on a grid of cells of 0.026."""
    frame = resolved.Frame(origin=(0, 0, 0), x=Z, y=X, z=Y)
    cylinder = resolved.Cylinder(frame=frame, radius=1.0, height=3.0)
    (loop,) = outline(cylinder, LEVEL, WIDE)
    for corner in ((1, 1.5), (1, -1.5), (-1, 1.5), (-1, -1.5)):
        assert np.linalg.norm(loop - corner, axis=1).min() < 1e-6
    assert area(loop) == pytest.approx(6, abs=1e-6)


def test_a_mesh_is_cut_triangle_by_triangle() -> None:
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=3)
    mesh = resolved.Mesh(vertices=ball.vertices.tolist(), triangles=ball.faces.tolist())
    (loop,) = outline(mesh, Cut(np.array([0, 0, 0.01]), np.array(X), np.array(Y)), WIDE)
    section = ball.section(plane_origin=[0, 0, 0.01], plane_normal=[0, 0, 1])
    theirs = section.vertices[section.entities[0].points][:-1, :2]
    assert len(loop) == len(theirs)
    assert area(loop) == pytest.approx(area(theirs), rel=1e-9)


def test_solids_that_leave_the_window_are_closed_beyond_it() -> None:
    ball = resolved.Sphere(center=(0, 0, 0), radius=100)
    (loop,) = outline(ball, LEVEL, Window(98, -4, 106, 4))
    inside = (loop[:, 0] > 98) & (np.abs(loop[:, 1]) < 4)
    assert inside.any()
    assert np.abs(np.linalg.norm(loop[inside], axis=1) - 100).max() < 4 * EXACT


def test_faces_are_segments() -> None:
    frame = resolved.Frame(origin=(0, 0.5, 0), x=X, y=Z, z=Y)
    ends = along_face(resolved.Rectangle(frame=frame, size=(2, 6)), LEVEL)
    assert ends is not None
    assert sorted(ends[:, 0]) == pytest.approx([-1, 1])
    assert ends[:, 1] == pytest.approx([0.5, 0.5])
    shifted = Cut(np.array([0, 0, 0.6]), np.array(X), np.array(Y))
    ends = along_face(resolved.Disk(frame=frame, radius=1.0), shifted)
    assert ends is not None
    assert sorted(ends[:, 0]) == pytest.approx([-0.8, 0.8])
    assert along_face(resolved.Disk(frame=frame, radius=0.5), shifted) is None
    assert along_face(resolved.Rectangle(frame=frame, size=(2, 1)), shifted) is None


# --- rays -----------------------------------------------------------------------------------------

BALL = resolved.Sphere(center=(0, 0, 0), radius=1.0)
# A ray at height 0.6 through a ball of index 1.5: sin i = 0.6, sin r = 0.4, chord 2 cos r.
SIN_R = 0.4
ENTRY = np.array([0.0, 0.6, 0.8])
TURN = math.asin(0.6) - math.asin(SIN_R)
INSIDE = np.array([0.0, -math.sin(TURN), -math.cos(TURN)])
EXIT = ENTRY + 2 * math.sqrt(1 - SIN_R**2) * INSIDE
BEYOND = EXIT + 2 * np.array([0.0, -math.sin(2 * TURN), -math.cos(2 * TURN)])
THROUGH = [tuple(v) for v in np.array([[0, 0.6, 5], ENTRY, EXIT, BEYOND])]


def test_angles_are_those_of_snells_law() -> None:
    path = ray_path(scene(BALL), [*THROUGH, (math.nan,) * 3])
    i, r = math.degrees(math.asin(0.6)), math.degrees(math.asin(SIN_R))
    # The normal is a central difference over 1e-5 of the ray's 9 units.
    assert np.array(path.angles) == pytest.approx(np.array([(i, r), (r, i)]), abs=1e-4)
    assert path.weights == [1, 1, 1]


def test_angles_show_a_wrong_ray_as_it_is() -> None:
    """Straight on through glass: the angles are those of the surface, not of the law."""
    straight = [(0, 0.6, 5), (0, 0.6, 0.8), (0, 0.6, -0.8), (0, 0.6, -3)]
    path = ray_path(scene(BALL), straight)
    i = math.degrees(math.asin(0.6))
    assert np.array(path.angles) == pytest.approx(np.full((2, 2), i), abs=1e-4)


def test_rays_without_meaning_are_refused() -> None:
    with pytest.raises(ValueError, match="two vertices"):
        ray_path(scene(BALL), [(0, 0, 0), (math.nan,) * 3])
    with pytest.raises(ValueError, match="no surface"):
        ray_path(scene(), THROUGH)
    with pytest.raises(ValueError, match="3 legs, but 1 weights"):
        ray_path(scene(BALL), THROUGH, [1.0])


# --- the drawing ----------------------------------------------------------------------------------


def elements(svg: str, name: str, kind: str = "") -> list[ElementTree.Element]:
    found = ElementTree.fromstring(svg).iter(f"{{http://www.w3.org/2000/svg}}{name}")
    return [e for e in found if not kind or e.get("class") == kind]


def test_the_drawing_shows_solids_rays_and_angles() -> None:
    world = scene(BALL)
    svg = draw(world, [ray_path(world, THROUGH, [1.0, 0.96, 0.92])], title="a <ball>")
    assert len(elements(svg, "path", "solid")) == 1
    assert len(elements(svg, "line", "ray")) == 3
    texts = {"".join(text.itertext()) for text in elements(svg, "text")}
    assert {"θi 36.87°", "θt 23.58°", "θi 23.58°", "θt 36.87°", "<glass & co> n = 1.5"} <= texts
    assert elements(svg, "title")[0].text == "a <ball>"


def test_the_drawn_arc_spans_the_angle() -> None:
    """From a point on the ray to one on the normal, as seen from the interface."""
    world = scene(BALL)
    svg = draw(world, [ray_path(world, THROUGH)])
    i = math.radians(36.8698976)
    spans = []
    for arc in elements(svg, "path", "angle"):
        x0, y0, r, x1, y1 = map(float, re.fullmatch(
            r"M(\S+) (\S+) A(\S+) \S+ 0 0 [01] (\S+) (\S+)", arc.get("d") or "").groups())  # type: ignore[union-attr]  # fmt: skip
        spans.append(2 * math.asin(math.hypot(x1 - x0, y1 - y0) / 2 / r))
    r = math.asin(SIN_R)
    assert spans == pytest.approx([i, r, r, i], abs=1e-3)  # coordinates have two decimals


def test_rays_may_have_the_colours_of_their_wavelengths() -> None:
    world = scene(BALL)
    paths = [ray_path(world, THROUGH, weights) for weights in ([1.0, 0.9, 0.8], [1.0, 0.2, 0.1])]
    svg = draw(world, paths, colours=("red", "rgb(0 0 255)"))
    lines = elements(svg, "line", "ray")  # the weaker first, under the other
    assert [line.get("stroke") for line in lines] == ["rgb(0 0 255)"] * 3 + ["red"] * 3
    with pytest.raises(ValueError, match="zip"):
        draw(world, paths, colours=("red",))


def test_weaker_rays_are_fainter() -> None:
    world = scene(BALL)
    svg = draw(world, [ray_path(world, THROUGH, [1.0, 0.25, 0.01])])
    opacity = [float(line.get("stroke-opacity") or 0) for line in elements(svg, "line", "ray")]
    assert opacity == sorted(opacity, reverse=True)
    assert len(set(opacity)) == 3


def test_denser_media_are_darker() -> None:
    def tint(ior: float) -> float:
        world = scene(BALL, ior=ior)
        (solid,) = elements(draw(world, [ray_path(world, THROUGH)]), "path", "solid")
        return float(solid.get("fill-opacity") or 0)

    assert tint(1.333) < tint(1.5) < tint(2.417)


def test_only_a_drawing_that_stands_alone_brings_a_style() -> None:
    world = scene(BALL)
    path = ray_path(world, THROUGH)
    assert "prefers-color-scheme" in draw(world, [path])
    assert "<style" not in draw(world, [path], standalone=False)


def test_the_plane_holds_the_ray_and_the_window_its_bends() -> None:
    world = scene(BALL)
    path = ray_path(world, THROUGH)
    cut = plane_of([path])
    assert np.abs((np.array(path.vertices) - cut.origin) @ cut.n).max() < 1e-9
    first, last = cut.project(np.array(path.vertices))[[0, -1]]
    assert first[0] < last[0]  # rays run to the right
    window = window_of(world, [path], cut)
    low, high = (window.x0, window.y0), (window.x1, window.y1)
    for loop in outline(BALL, cut, window):
        assert (loop > low).all()
        assert (loop < high).all()


def test_straight_rays_have_a_plane_too() -> None:
    world = scene(box())
    for end in ((0, 0, -5), (0, -5, 0), (3, 1, -2)):
        path = ray_path(world, [tuple(-np.array(end)), end])
        ElementTree.fromstring(draw(world, [path]))


def test_a_drawing_without_rays_needs_a_plane() -> None:
    with pytest.raises(ValueError, match="needs a plane"):
        draw(scene(BALL), [])
    assert elements(draw(scene(BALL), [], cut=LEVEL, window=WIDE), "path", "solid")
