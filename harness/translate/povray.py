"""A resolved scene as POV-Ray 3.7 scene description language (SDL), a pure function.

The text holds numbers and names that stand in this module, nothing else: no string of a scene
reaches it, so that no scene can say anything in POV-Ray's language. Numbers are printed with
`repr`, which loses nothing.

What POV-Ray does otherwise than a scene defines, and what follows from it
------------------------------------------------------------------------
* Hits nearer than 1e-4 units are dropped and images clip at 1: lengths and radiance are scaled
  (see `povray_fit`), and `PovScene.exposure` must be divided out of the pixels.
* Indices of refraction and their ratios between nested media are single precision, as are colours
  and meshes: 6e-8 relative.
* A medium's index is taken relative to media[0], since POV-Ray's atmosphere has index 1.
* `max_trace_level` ends at 256. Faces without refraction (translucent ones, and solids of the
  index of what they stand in) do not count towards it.
* The radiance of a ray is not scaled by the square of the index.
* Nested solids refract by containment, but when a ray leaves an inner solid POV-Ray takes the
  Fresnel reflectance to be 0 (ComputeRelativeIOR in trace.cpp divides the index by itself). The
  same would befall every solid behind an open translucent face, which POV-Ray deems entered and
  never left; so such a face is a pair of faces here, in and out, `PAIR_GAP` apart.
* Light of point lights passes dielectrics straight and without loss.
* transport.reflection False: dielectrics reflect nothing but total internal reflections, and the
  transmitted ray is not weakened: its weight is 1 instead of T.
* transport.transmission False: dielectrics are opaque; R keeps its Fresnel value from both sides.
"""

from __future__ import annotations

import base64
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from harness.errors import RendererUnsupported
from harness.scene import resolved as rs
from harness.scene.containment import signed_distance
from harness.translate.mitsuba_scale import scaled
from harness.translate.povray_fit import SHADOW_FLOOR, exposure, length_scale

MAX_TRACE_LEVEL = 256
# Without a floor for weights POV-Ray follows light between parallel faces for ever.
LEAST_ADC_BAILOUT = 1e-12
# POV-Ray attenuates by 2 / (1 + (r / fade_distance)^2); this makes it 2 fade_distance^2 / r^2 to
# 1e-6 even at the shadow floor.
FADE_DISTANCE = 1e-3 * SHADOW_FLOOR
PAIR_GAP = 2e-3  # scaled units: 20 hit floors, two shadow floors
# A direction that no edge of a sane mesh is parallel to; points are in a mesh where a ray along
# it meets an odd number of triangles.
INSIDE_VECTOR = (0.3713906763541037, 0.5570860145311556, 0.7427813527082074)
AXIS = {"u": "x", "v": "y"}


@dataclass(frozen=True)
class PovScene:
    """`sdl` and the files that it refers to by names of ours. Radiance = pixel / `exposure`."""

    sdl: str
    attachments: dict[str, bytes]
    exposure: float
    length_scale: float


def translate(scene: rs.ResolvedScene) -> PovScene:
    """Raises RendererUnsupported where POV-Ray has no counterpart or no room (see above)."""
    factor, bright = length_scale(scene), exposure(scene)
    writer = _Writer(scaled(scene, factor), bright)
    header = (
        "// povray scene.ini\n"
        f"// lengths are multiplied by {_number(factor)}; "
        f"radiance is the image divided by {_number(bright)}\n"
    )
    sdl = header + "\n".join(writer.blocks()) + "\n"
    return PovScene(sdl, writer.attachments, bright, factor)


def options(scene: rs.ResolvedScene) -> str:
    """The INI file beside the scene: ``povray scene.ini`` renders it to ``image.ppm``.

    Without bounding boxes solids are tested in our order, outer before inner, which is the order
    in which POV-Ray enters the media that the camera stands in; and no box in single precision
    can cut a solid. Meshes have their own hierarchy all the same.
    """
    return "\n".join(
        (
            "Input_File_Name=scene.pov",
            "Output_File_Name=image.ppm",
            "Output_File_Type=P",
            "Bits_Per_Color=16",
            "File_Gamma=1.0",
            f"Width={scene.film.width:d}",
            f"Height={scene.film.height:d}",
            "Antialias=Off",
            "Bounding=Off",
            "Display=Off",
            "Verbose=Off",
            "Debug_Console=Off",
            "Render_Console=Off",
            "Statistic_Console=Off",
            "Statistic_File=statistics.txt",
            "",
        )
    )


@dataclass
class _Writer:
    """Writes one scene, already scaled in length."""

    scene: rs.ResolvedScene
    exposure: float
    attachments: dict[str, bytes] = field(default_factory=dict)

    def blocks(self) -> Iterator[str]:
        yield self._settings()
        yield _camera(self.scene)
        yield f"background {{ {self._radiance(self.scene.background)} }}"
        if any(self.scene.media[0].absorption):
            yield _absorption(self.scene.media[0].absorption)
        for light in self.scene.lights:
            yield self._light(light)
        for solid in sorted(self.scene.solids, key=lambda s: _box_volume(s.shape), reverse=True):
            yield self._solid(solid)
        for surface in self.scene.surfaces:
            yield self._surface(surface)

    def _settings(self) -> str:
        transport = self.scene.transport
        return (
            "#version 3.7;\n"
            "global_settings {\n"
            "  assumed_gamma 1.0\n"
            f"  max_trace_level {min(transport.max_depth, MAX_TRACE_LEVEL):d}\n"
            f"  adc_bailout {_number(max(transport.min_weight, LEAST_ADC_BAILOUT))}\n"
            "}"
        )

    def _light(self, light: rs.PointLight) -> str:
        """Radiance of a diffuse face is pigment * colour * cos * 2 fade^2 / r^2, without 1/pi."""
        factor = self.exposure / (math.pi * 2 * FADE_DISTANCE**2)
        return (
            f"light_source {{ {_vector(light.position)}, {_rgb(light.intensity, factor)} "
            f"fade_distance {_number(FADE_DISTANCE)} fade_power 2 media_interaction off }}"
        )

    # --- solids ---------------------------------------------------------------------------------

    def _solid(self, solid: rs.Solid) -> str:
        media = self.scene.media
        ior = media[solid.medium].ior / media[0].ior
        # POV-Ray adds up the absorption of all solids that a ray is in, and of the atmosphere.
        inner, outer = media[solid.medium].absorption, media[solid.exterior].absorption
        more = [i - o for i, o in zip(inner, outer, strict=True)]
        absorption = f" {_absorption(more)}" if any(more) else ""
        interior = f"interior {{ ior {_number(ior)}{absorption} }}"
        return _object(solid.shape, self._dielectric(), interior, "hollow", solid=True)

    def _dielectric(self) -> str:
        transport = self.scene.transport
        pigment = "rgbt 1" if transport.transmission else "rgb 0"
        reflection = "{ 0, 1 fresnel } conserve_energy" if transport.reflection else "0"
        return f"pigment {{ {pigment} }} finish {{ ambient 0 diffuse 0 reflection {reflection} }}"

    # --- surfaces -------------------------------------------------------------------------------

    def _surface(self, surface: rs.Surface) -> str:
        shape, material = surface.shape, surface.material
        match material:
            case rs.Emissive(pattern=pattern):
                return self._opaque(shape, self._emissive(pattern, shape))
            case rs.Diffuse():
                pigment = f"pigment {{ {_rgb(material.reflectance)} }}"
                return self._opaque(shape, f"{pigment} finish {{ ambient 0 diffuse 1 }}")
            case rs.Mirror():
                finish = f"ambient 0 diffuse 0 reflection {{ {_rgb(material.reflectance)} }}"
                return self._opaque(shape, f"pigment {{ rgb 0 }} finish {{ {finish} }}")
            case rs.Translucent():
                return _translucent(shape, material)
        raise RendererUnsupported("POV-Ray has no thin face; it can be given a real slab")

    def _opaque(self, shape: rs.SurfaceShape, texture: str) -> str:
        """POV-Ray takes a camera inside a shape to be in its medium, unless it is inverted."""
        origin = np.array([self.scene.camera.origin])
        match shape:  # faces and meshes without inside_vector have no inside
            case rs.Sphere() | rs.Convex() | rs.Cylinder():
                if signed_distance(shape, origin)[0] < 0:
                    return _object(shape, texture, "hollow inverse")
        return _object(shape, texture, "hollow")

    # --- patterns -------------------------------------------------------------------------------

    def _emissive(self, pattern: rs.Pattern, shape: rs.SurfaceShape) -> str:
        """A pattern over the unit square of x and y, which the shape's matrix carries along."""
        if not isinstance(pattern, rs.Constant) and not isinstance(shape, rs.Rectangle | rs.Disk):
            raise RendererUnsupported("only open faces have the texture coordinates of a pattern")
        emission = 1.0
        match pattern:
            case rs.Constant():
                pigment = self._radiance(pattern.radiance)
            case rs.Checker():
                pigment = self._checker(pattern)
            case rs.Ramp():
                pigment = self._ramp(pattern)
            case rs.PositionCode():
                pigment = self._position_code(pattern)
            case rs.Picture():
                pigment, emission = self._picture(pattern), self.exposure
        finish = f"finish {{ ambient 0 diffuse 0 emission {_number(emission)} }}"
        return f"pigment {{ {pigment} }} {finish}"

    def _checker(self, pattern: rs.Checker) -> str:
        """Its cells are also one unit high: half a unit up, the first colour is at (0, 0)."""
        columns, lines = pattern.cells
        a, b = self._radiance(pattern.a), self._radiance(pattern.b)
        return f"checker {a}, {b} scale <1/{columns:d}, 1/{lines:d}, 1> translate -0.5*z"

    def _ramp(self, pattern: rs.Ramp) -> str:
        start, end = self._radiance(pattern.start), self._radiance(pattern.end)
        return f"gradient {AXIS[pattern.axis]} color_map {{ [0 {start}] [1 {end}] }}"

    def _position_code(self, pattern: rs.PositionCode) -> str:
        """Coarse code, fine code and constant, each in its channel. Their mean is taken: thrice.

        A gradient is the fractional part of the coordinate, in double precision.
        """
        axis, top = AXIS[pattern.axis], 3 * pattern.amplitude * self.exposure
        red, green, blue = (_rgb(v, top) for v in ((1, 0, 0), (0, 1, 0), (0, 0, 1)))
        return (
            "average pigment_map {\n"
            f"    [1 gradient {axis} color_map {{ [0 rgb 0] [1 {red}] }}]\n"
            f"    [1 gradient {axis} color_map {{ [0 rgb 0] [1 {green}] }}"
            f" scale 1/{pattern.cells:d}]\n"
            f"    [1 {blue}]\n"
            "  }"
        )

    def _picture(self, pattern: rs.Picture) -> str:
        """Texels as a 16-bit PPM, which is big-endian. POV-Ray too has its first row at v = 1."""
        name = f"picture-{len(self.attachments):d}.ppm"
        texels = np.frombuffer(base64.b64decode(pattern.pixels), "<u2")
        head = f"P6\n{pattern.width:d} {pattern.height:d}\n65535\n".encode()
        self.attachments[name] = head + texels.astype(">u2").tobytes()
        return f'image_map {{ ppm "{name}" gamma 1.0 }}'

    def _radiance(self, radiance: Sequence[float]) -> str:
        return _rgb(radiance, self.exposure)


def _translucent(shape: rs.SurfaceShape, material: rs.Translucent) -> str:
    r, g, b = (_number(c) for c in material.color)
    color = f"rgbft <{r}, {g}, {b}, {_number(material.filter)}, {_number(material.transmit)}>"
    texture = f"pigment {{ {color} }} finish {{ ambient 0 diffuse 1 }}"
    if not isinstance(shape, rs.Rectangle | rs.Disk):
        return _object(shape, texture, "interior { ior 1 }", "hollow")
    frame = shape.frame
    behind = tuple(o - PAIR_GAP * z for o, z in zip(frame.origin, frame.z, strict=True))
    back = shape.model_copy(update={"frame": frame.model_copy(update={"origin": behind})})
    clear = "pigment { rgbt 1 } finish { ambient 0 diffuse 0 }"
    faces = f"{_object(shape, texture)}\n{_object(back, clear)}"
    return f"union {{\n{faces}\n  interior {{ ior 1 }}\n  hollow\n}}"


def _camera(scene: rs.ResolvedScene) -> str:
    """The vectors alone say how the image lies, so POV-Ray's handedness plays no part."""
    camera, aspect = scene.camera, scene.film.height / scene.film.width
    if isinstance(camera, rs.Perspective):
        kind, width = "perspective", 2 * camera.tan_half_fov_x
    else:
        kind, width = "orthographic", camera.width
    return (
        f"camera {{\n  {kind}\n"
        f"  location {_vector(camera.origin)}\n"
        f"  direction {_vector(camera.forward)}\n"
        f"  right {_vector([width * c for c in camera.right])}\n"
        f"  up {_vector([width * aspect * c for c in camera.up])}\n"
        "}"
    )


def _absorption(absorption: Sequence[float]) -> str:
    """Homogeneous, so one sample of one interval is exact."""
    return f"media {{ absorption {_rgb(absorption)} method 1 intervals 1 samples 1, 1 }}"


# --- shapes ---------------------------------------------------------------------------------------


def _object(shape: rs.SurfaceShape, *modifiers: str, solid: bool = False) -> str:
    """The shape with its modifiers; of a rectangle or disk the pattern goes with its matrix."""
    body = "\n  ".join(modifiers)
    match shape:
        case rs.Sphere():
            head = f"sphere {{ {_vector(shape.center)}, {_number(shape.radius)}"
        case rs.Cylinder():
            middle, half = np.array(shape.frame.origin), shape.height / 2 * np.array(shape.frame.z)
            ends = f"{_vector(middle - half)}, {_vector(middle + half)}"
            head = f"cylinder {{ {ends}, {_number(shape.radius)}"
        case rs.Convex():
            # Planes are double precision; the vertices of a mesh2 would be single.
            planes = (f"  plane {{ {_vector(p[:3])}, {_number(p[3])} }}" for p in shape.planes)
            head = "\n".join(("intersection {", *planes))
        case rs.Mesh():
            return _mesh(shape, body, solid)
        case rs.Rectangle():
            head = "polygon { 5, <0, 0>, <1, 0>, <1, 1>, <0, 1>, <0, 0>"
            body += f"\n  {_unit_square_to(shape.frame, *shape.size)}"
        case rs.Disk():
            head = "disc { <0.5, 0.5, 0>, z, 0.5"
            body += f"\n  {_unit_square_to(shape.frame, 2 * shape.radius, 2 * shape.radius)}"
    return f"{head}\n  {body}\n}}"


def _unit_square_to(frame: rs.Frame, width: float, height: float) -> str:
    """The matrix that takes (u, v, 0) to the face; its rows are the images of x, y, z, origin."""
    x, y, z = width * np.array(frame.x), height * np.array(frame.y), np.array(frame.z)
    corner = np.array(frame.origin) - (x + y) / 2
    numbers = ", ".join(_number(c) for c in (*x, *y, *(z * max(width, height)), *corner))
    return f"matrix <{numbers}>"


def _mesh(shape: rs.Mesh, body: str, solid: bool) -> str:
    """Vertices are single precision, so they are written relative to the middle of the mesh."""
    vertices = np.array(shape.vertices)
    middle = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
    lists = [_list("vertex_vectors", vertices - middle)]
    if shape.normals is not None:
        lists.append(_list("normal_vectors", shape.normals))
    faces = ", ".join(f"<{a:d}, {b:d}, {c:d}>" for a, b, c in shape.triangles)
    lists.append(f"  face_indices {{ {len(shape.triangles):d}, {faces} }}")
    if solid:
        lists.append(f"  inside_vector {_vector(INSIDE_VECTOR)}")
    return "\n".join(("mesh2 {", *lists, f"  {body}", f"  translate {_vector(middle)}", "}"))


def _list(name: str, vectors: Sequence[Sequence[float]] | np.ndarray) -> str:
    return f"  {name} {{ {len(vectors):d}, {', '.join(_vector(v) for v in vectors)} }}"


def _box_volume(shape: rs.SolidShape) -> float:
    """Volume of the box along the axes around a solid, which is smaller for all that is in it."""
    match shape:
        case rs.Sphere():
            size = np.full(3, 2 * shape.radius)
        case rs.Cylinder():
            axis = np.array(shape.frame.z)
            across = np.sqrt(np.maximum(1 - axis**2, 0))
            size = shape.height * np.abs(axis) + 2 * shape.radius * across
        case rs.Convex() | rs.Mesh():
            size = np.ptp(np.array(shape.vertices), axis=0)
    return float(size.prod())


# --- numbers --------------------------------------------------------------------------------------


def _number(value: float) -> str:
    """The one way by which a scene's values become text. Raises ValueError unless finite."""
    number = float(value)
    if not math.isfinite(number):
        raise ValueError(f"not a finite number: {number}")
    return repr(number)


def _vector(values: Sequence[float] | np.ndarray) -> str:
    return f"<{', '.join(_number(v) for v in values)}>"


def _rgb(values: Sequence[float], factor: float = 1.0) -> str:
    return f"rgb {_vector([factor * v for v in values])}"
