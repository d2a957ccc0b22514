"""Where a line enters and leaves a solid, in closed form and in numpy.

The truth's own geometry: written apart from the tracer's, so that a mistake in one is not a mistake
in both.
"""

from __future__ import annotations

import numpy as np

from harness.expected import Float
from harness.scene.resolved import Cone, Convex, Cylinder, Lens, Mesh, Solid, Sphere
from harness.truth.intervals import Chord, planes_chord
from harness.truth.lens_chord import cone_chord, lens_chords


def _sphere_chord(sphere: Sphere, o: Float, d: Float) -> Chord:
    oc = o - np.array(sphere.center)
    b = np.einsum("ij,ij->i", oc, d)
    closest = oc - b[:, None] * d
    # r^2 - |closest|^2 loses nothing to |oc|^2, unlike the textbook b^2 - c.
    h2 = sphere.radius**2 - np.einsum("ij,ij->i", closest, closest)
    h = np.sqrt(np.maximum(h2, 0))
    t_in, t_out = np.where(h2 > 0, -b - h, np.inf), np.where(h2 > 0, -b + h, -np.inf)
    finite = np.where(h2 > 0, h, 0.0)[:, None]
    n_in = (closest - finite * d) / sphere.radius
    n_out = (closest + finite * d) / sphere.radius
    return Chord(t_in, t_out, n_in, n_out)


def _cylinder_chord(cylinder: Cylinder, o: Float, d: Float) -> Chord:
    frame = cylinder.frame
    axes = np.array([frame.x, frame.y, frame.z])
    lo, ld = (o - np.array(frame.origin)) @ axes.T, d @ axes.T
    a = ld[:, 0] ** 2 + ld[:, 1] ** 2
    b = lo[:, 0] * ld[:, 0] + lo[:, 1] * ld[:, 1]
    cross = lo[:, 0] * ld[:, 1] - lo[:, 1] * ld[:, 0]
    h2 = a * cylinder.radius**2 - cross**2
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        h = np.sqrt(np.maximum(h2, 0))
        side_in, side_out = (-b - h) / a, (-b + h) / a
    inside = lo[:, 0] ** 2 + lo[:, 1] ** 2 < cylinder.radius**2
    parallel = a == 0
    side_in = np.where(
        parallel, np.where(inside, -np.inf, np.inf), np.where(h2 > 0, side_in, np.inf)
    )
    side_out = np.where(parallel, np.inf, np.where(h2 > 0, side_out, -np.inf))
    half = cylinder.height / 2
    caps = planes_chord(
        np.array([[*frame.z, half + np.dot(frame.z, frame.origin)],
                  [*(-np.array(frame.z)), half - np.dot(frame.z, frame.origin)]]), o, d
    )  # fmt: skip

    def side_normal(t: Float) -> Float:
        local = lo + np.where(np.isfinite(t), t, 0.0)[:, None] * ld
        local[:, 2] = 0
        return np.asarray(local / cylinder.radius @ axes)

    through_cap_in, through_cap_out = caps.t_in > side_in, caps.t_out < side_out
    return Chord(
        np.maximum(caps.t_in, side_in),
        np.minimum(caps.t_out, side_out),
        np.where(through_cap_in[:, None], caps.n_in, side_normal(side_in)),
        np.where(through_cap_out[:, None], caps.n_out, side_normal(side_out)),
    )


def _mesh_planes(mesh: Mesh) -> Float:
    """The planes of a convex flat-shaded mesh. Raises ValueError where it is not convex."""
    if mesh.normals is not None:
        raise ValueError("a smoothly shaded mesh has no closed form")
    vertices, triangles = np.array(mesh.vertices), np.array(mesh.triangles)
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    n = np.cross(b - a, c - a)
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    planes = np.column_stack([n, np.einsum("ij,ij->i", n, a)])
    size = np.ptp(vertices, axis=0).max()
    for rows in np.array_split(planes, max(1, len(planes) // 1024)):
        highest = (rows[:, :3] @ vertices.T).max(axis=1)
        if (highest - rows[:, 3]).max() > 1e-12 * size:
            raise ValueError("the mesh is not convex")
    return planes


class Body:
    """A solid of the scene with its chord function prepared once."""

    def __init__(self, solid: Solid) -> None:
        self.solid = solid
        shape = solid.shape
        self._planes = (
            np.array(shape.planes)
            if isinstance(shape, Convex)
            else _mesh_planes(shape)
            if isinstance(shape, Mesh)
            else None
        )

    def chords(self, o: Float, d: Float) -> list[Chord]:
        """The intervals in which lines are in the solid: one where it is convex.

        Raises ValueError where the shape has no closed form.
        """
        shape = self.solid.shape
        if self._planes is not None:
            return [planes_chord(self._planes, o, d)]
        match shape:
            case Sphere():
                return [_sphere_chord(shape, o, d)]
            case Cylinder():
                return [_cylinder_chord(shape, o, d)]
            case Cone():
                return [cone_chord(shape, o, d)]
            case Lens():
                return lens_chords(shape, o, d)
        raise ValueError(f"a {shape.type} has no closed form")
