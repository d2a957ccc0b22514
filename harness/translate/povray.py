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

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from harness.errors import RendererUnsupported
from harness.scene import resolved as rs
from harness.scene.arrangement import grouped, meeting
from harness.scene.containment import bounds, signed_distance
from harness.translate.mitsuba_scale import scaled
from harness.translate.povray_contact import within_group
from harness.translate.povray_fit import SHADOW_FLOOR, exposure, extent, length_scale
from harness.translate.povray_shapes import number, region_text, rgb, shape_text, vector
from harness.translate.texels import levels_of

MAX_TRACE_LEVEL = 256
# Without a floor for weights POV-Ray follows light between parallel faces for ever.
LEAST_ADC_BAILOUT = 1e-12
# POV-Ray attenuates by 2 / (1 + (r / fade_distance)^2); this makes it 2 fade_distance^2 / r^2 to
# 1e-6 even at the shadow floor.
FADE_DISTANCE = 1e-3 * SHADOW_FLOOR
PAIR_GAP = 2e-3  # scaled units: 20 hit floors, two shadow floors
AXIS = {"u": "x", "v": "y"}
# Nothing, but of infinite extent. POV-Ray passes over an object whose box a ray misses in single
# precision, as one does that starts a hit floor below the object's top.
BOUNDLESS = "intersection { plane { <1, 1, 1>, -1e9 } plane { <-1, -1, -1>, -1e9 } }"


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
    writer = Writer(scaled(scene, factor), bright)
    header = (
        "// povray scene.ini\n"
        f"// lengths are multiplied by {number(factor)}; "
        f"radiance is the image divided by {number(bright)}\n"
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
class Writer:
    """Writes one scene, already scaled in length."""

    scene: rs.ResolvedScene
    exposure: float
    attachments: dict[str, bytes] = field(default_factory=dict)

    def blocks(self) -> Iterator[str]:
        yield self._settings()
        yield _camera(self.scene)
        yield self._background(self.scene.background)
        if any(self.scene.media[0].absorption):
            yield self.absorption(self.scene.media[0].absorption)
        for light in self.scene.lights:
            yield self._light(light)
        for k in sorted(range(len(self.scene.solids)), key=self._box_volume, reverse=True):
            yield self.solid(k)
        for surface in self.scene.surfaces:
            yield self._surface(surface)

    def _settings(self) -> str:
        depth, bailout = self.trace_limits()
        return (
            "#version 3.7;\n"
            "global_settings {\n"
            "  assumed_gamma 1.0\n"
            f"  max_trace_level {depth:d}\n"
            f"  adc_bailout {number(bailout)}\n"
            "}"
        )

    def trace_limits(self) -> tuple[int, float]:
        """`max_trace_level` and `adc_bailout`."""
        transport = self.scene.transport
        depth = min(transport.max_depth, MAX_TRACE_LEVEL)
        return depth, max(transport.min_weight, LEAST_ADC_BAILOUT)

    def absorption(self, per_unit: Sequence[float]) -> str:
        """Of a medium. Homogeneous, so one sample of one interval is exact."""
        return f"media {{ absorption {rgb(per_unit)} method 1 intervals 1 samples 1, 1 }}"

    def _light(self, light: rs.Light) -> str:
        """Radiance of a diffuse face is pigment * colour * cos * 2 fade^2 / r^2, without 1/pi.

        A directional light stands beyond all that is there, and does not fade.
        """
        if isinstance(light, rs.DirectionalLight):
            away = 4 * extent(self.scene)
            place = [-away * d for d in light.direction]
            return (
                f"light_source {{ {vector(place)}, "
                f"{rgb(light.irradiance, self.exposure / math.pi)} "
                f"parallel point_at <0, 0, 0> media_interaction off }}"
            )
        factor = self.exposure / (math.pi * 2 * FADE_DISTANCE**2)
        return (
            f"light_source {{ {vector(light.position)}, {rgb(light.intensity, factor)} "
            f"fade_distance {number(FADE_DISTANCE)} fade_power 2 media_interaction off }}"
        )

    # --- solids ---------------------------------------------------------------------------------

    def solid(self, k: int) -> str:
        """One that meets others as `povray_contact` says, any other as it is."""
        for members in meeting(self.scene.solids):
            if k in members:
                return self._member(k, members)
        return self.alone(k)

    def alone(self, k: int) -> str:
        solid = self.scene.solids[k]
        interior = f"interior {{ {self.interior(solid.medium, solid.exterior)} }}"
        return shape_text(solid.shape, self._dielectric(), interior, "hollow", solid=True)

    def _member(self, k: int, members: tuple[int, ...]) -> str:
        solids = self.scene.solids
        if any(isinstance(solids[i].shape, rs.Mesh) for i in members):
            raise RendererUnsupported("POV-Ray's meshes cannot be cut where they overlap a solid")
        group = grouped(solids, members)
        reach = float(np.abs([bounds(solids[i].shape) for i in members]).max())
        inner, whole = within_group(group, group.members.index(k), reach)
        clear = "interior_texture { pigment { rgbt 1 } finish { ambient 0 diffuse 0 } }"
        interior = self.interior(solids[k].medium, group.around)
        return (
            "merge {\n  intersection {\n"
            f"    {region_text(inner, self._dielectric(), clear)}\n"
            f"    {region_text(whole, self._dielectric())}\n"
            f"  }}\n  {BOUNDLESS}\n  interior {{ {interior} }}\n  hollow\n}}"
        )

    def interior(self, inside: int, outside: int) -> str:
        """What a solid of one medium within another is filled with."""
        media = self.scene.media
        ior = media[inside].ior / media[0].ior
        # POV-Ray adds up the absorption of all solids that a ray is in, and of the atmosphere.
        inner, outer = media[inside].absorption, media[outside].absorption
        more = [i - o for i, o in zip(inner, outer, strict=True)]
        absorption = f" {self.absorption(more)}" if any(more) else ""
        return f"ior {number(ior)}{absorption}"

    def _box_volume(self, k: int) -> float:
        """Of the box along the axes around a solid, which is smaller for all that is in it."""
        low, high = bounds(self.scene.solids[k].shape)
        return float((high - low).prod())

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
                pigment = f"pigment {{ {rgb(material.reflectance)} }}"
                return self._opaque(shape, f"{pigment} finish {{ ambient 0 diffuse 1 }}")
            case rs.Phong():
                finish = f"phong {number(material.specular)} phong_size {number(material.exponent)}"
                pigment = f"pigment {{ {rgb(material.reflectance)} }}"
                return self._opaque(shape, f"{pigment} finish {{ ambient 0 diffuse 1 {finish} }}")
            case rs.Mirror():
                finish = f"ambient 0 diffuse 0 reflection {{ {rgb(material.reflectance)} }}"
                return self._opaque(shape, f"pigment {{ rgb 0 }} finish {{ {finish} }}")
            case rs.Translucent():
                return _translucent(shape, material)
        raise RendererUnsupported("POV-Ray has no thin face; it can be given a real slab")

    def _opaque(self, shape: rs.SurfaceShape, texture: str) -> str:
        """POV-Ray takes a camera inside a shape to be in its medium, unless it is inverted."""
        origin = np.array([self.scene.camera.origin])
        match shape:  # faces and meshes without inside_vector have no inside
            case (
                rs.Sphere()
                | rs.Convex()
                | rs.Cylinder()
                | rs.Cone()
                | rs.Lens()
                | rs.Csg()
                | rs.Plane()
            ):
                if signed_distance(shape, origin)[0] < 0:
                    return shape_text(shape, texture, "hollow inverse")
        return shape_text(shape, texture, "hollow")

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
        finish = f"finish {{ ambient 0 diffuse 0 emission {number(emission)} }}"
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
        red, green, blue = (rgb(v, top) for v in ((1, 0, 0), (0, 1, 0), (0, 0, 1)))
        return (
            "average pigment_map {\n"
            f"    [1 gradient {axis} color_map {{ [0 rgb 0] [1 {red}] }}]\n"
            f"    [1 gradient {axis} color_map {{ [0 rgb 0] [1 {green}] }}"
            f" scale 1/{pattern.cells:d}]\n"
            f"    [1 {blue}]\n"
            "  }"
        )

    def _picture(self, pattern: rs.Picture) -> str:
        return f'image_map {{ ppm "{self._attached(levels_of(pattern))}" gamma 1.0 }}'

    def _background(self, background: rs.Rgb | rs.Panorama) -> str:
        """A panorama wraps round in u, and has its first and last row twice, not to wrap in v.

        The warp's u begins at x and grows towards z.
        """
        if not isinstance(background, rs.Panorama):
            return f"background {{ {self._radiance(background)} }}"
        levels = levels_of(background)
        name = self._attached(np.concatenate([levels[:1], levels, levels[-1:]]))
        rows = background.height
        return (
            f'sky_sphere {{ pigment {{ image_map {{ ppm "{name}" gamma 1.0 interpolate 2 }} '
            f"scale <1, {rows + 2:d}/{rows:d}, 1> translate <0.25, -1/{rows:d}, 0> "
            f"warp {{ spherical }} }} emission rgb {number(self.exposure)} }}"
        )

    def _attached(self, levels: NDArray[np.uint16]) -> str:
        """The name of a 16-bit PPM, big-endian. POV-Ray too has its first row at v = 1."""
        name = f"picture-{len(self.attachments):d}.ppm"
        height, width, _ = levels.shape
        head = f"P6\n{width:d} {height:d}\n65535\n".encode()
        self.attachments[name] = head + levels.astype(">u2").tobytes()
        return name

    def _radiance(self, radiance: Sequence[float]) -> str:
        return rgb(radiance, self.exposure)


def _translucent(shape: rs.SurfaceShape, material: rs.Translucent) -> str:
    r, g, b = (number(c) for c in material.color)
    color = f"rgbft <{r}, {g}, {b}, {number(material.filter)}, {number(material.transmit)}>"
    texture = f"pigment {{ {color} }} finish {{ ambient 0 diffuse 1 }}"
    if not isinstance(shape, rs.Rectangle | rs.Disk | rs.Plane):
        return shape_text(shape, texture, "interior { ior 1 }", "hollow")
    back = _back_of_pair(shape)
    clear = "pigment { rgbt 1 } finish { ambient 0 diffuse 0 }"
    faces = f"{shape_text(shape, texture)}\n{shape_text(back, clear)}"
    kind = "intersection" if isinstance(shape, rs.Plane) else "union"
    return f"{kind} {{\n{faces}\n  interior {{ ior 1 }}\n  hollow\n}}"


def _back_of_pair(face: rs.Rectangle | rs.Disk | rs.Plane) -> rs.SurfaceShape:
    """The same face `PAIR_GAP` further back; of half-spaces the one with which it makes a sheet."""
    if isinstance(face, rs.Plane):
        x, y, z = face.normal
        return rs.Plane(normal=(-x, -y, -z), offset=PAIR_GAP - face.offset)
    frame = face.frame
    behind = tuple(o - PAIR_GAP * z for o, z in zip(frame.origin, frame.z, strict=True))
    return face.model_copy(update={"frame": frame.model_copy(update={"origin": behind})})


def _camera(scene: rs.ResolvedScene) -> str:
    """The vectors alone say how the image lies, so POV-Ray's handedness plays no part."""
    camera, aspect = scene.camera, scene.film.height / scene.film.width
    if isinstance(camera, rs.ThinLens):
        raise RendererUnsupported("POV-Ray's lens is sampled at points of its own")
    if isinstance(camera, rs.Perspective):
        kind, width = "perspective", 2 * camera.tan_half_fov_x
    else:
        kind, width = "orthographic", camera.width
    return (
        f"camera {{\n  {kind}\n"
        f"  location {vector(camera.origin)}\n"
        f"  direction {vector(camera.forward)}\n"
        f"  right {vector([width * c for c in camera.right])}\n"
        f"  up {vector([width * aspect * c for c in camera.up])}\n"
        "}"
    )
