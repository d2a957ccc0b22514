"""A tiny scene that shows whether a renderer works at all."""

from __future__ import annotations

from harness.errors import RendererFailed
from harness.renderers.base import Capability, Image
from harness.scene import resolved


def proof_scene(capabilities: frozenset[Capability]) -> resolved.ResolvedScene:
    """8 x 8 pixels of a plane of radiance (0.25, 0.5, 0.75), a glass ball before it if claimed."""
    film = resolved.Film(width=8, height=8)
    camera = resolved.Perspective(
        origin=(0, 0, 6), right=(1, 0, 0), up=(0, 1, 0), forward=(0, 0, -1), tan_half_fov_x=0.25
    )
    frame = resolved.Frame(origin=(0, 0, -3), x=(1, 0, 0), y=(0, 1, 0), z=(0, 0, 1))
    glow = resolved.Emissive(pattern=resolved.Constant(radiance=(0.25, 0.5, 0.75)))
    plane = resolved.Rectangle(frame=frame, size=(16, 16))
    sphere = resolved.Sphere(center=(0, 0, 0), radius=1)
    ball = resolved.Solid(name="ball", shape=sphere, medium=1, exterior=0)
    return resolved.ResolvedScene(
        film=film,
        camera=camera,
        media=(resolved.Medium(name="air", ior=1.0), resolved.Medium(name="glass", ior=1.5)),
        solids=(ball,) if {Capability.SPHERE, Capability.FRESNEL} <= capabilities else (),
        surfaces=(resolved.Surface(name="plane", shape=plane, material=glow),),
        transport=resolved.Transport(max_depth=8, min_weight=1e-3),
    )


def prove(image: Image) -> None:
    """Raises RendererFailed unless `image` can be one of the proof scene.

    The corner pixels miss the ball and see the plane, within two steps of 8 bits; the middle of
    the image is lit. How well a renderer refracts is not the question here.
    """
    corner, middle = image.pixels[0, 0], image.pixels[4, 4]
    if not (abs(corner - (0.25, 0.5, 0.75)) < 0.02).all() or not (middle > 0.1).all():
        seen = f"corner {corner.tolist()}, middle {middle.tolist()}"
        raise RendererFailed(f"a test image came out wrong: {seen}", log=image.log)
