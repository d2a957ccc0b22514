"""Cameras of the resolved scene, a part of `harness.scene.resolved`."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from harness.scene.frozen import Frozen, Vec3


class Perspective(Frozen):
    """Pinhole. The ray through pixel (i, j) of a W x H film, row 0 at the top, has direction

    forward + (2 (i + .5) / W - 1) k right + (1 - 2 (j + .5) / H) k (H / W) up

    with k = `tan_half_fov_x`; right, up, forward are orthonormal, right = forward x up.
    `medium` is what the camera stands in.
    """

    type: Literal["perspective"] = "perspective"
    origin: Vec3
    right: Vec3
    up: Vec3
    forward: Vec3
    tan_half_fov_x: float
    medium: int = 0


class Orthographic(Frozen):
    """Parallel rays along `forward` from the plane through `origin`, `width` units across.

    The ray through pixel (i, j) starts at
    origin + (2 (i + .5) / W - 1) w/2 right + (1 - 2 (j + .5) / H) (H / W) w/2 up.
    """

    type: Literal["orthographic"] = "orthographic"
    origin: Vec3
    right: Vec3
    up: Vec3
    forward: Vec3
    width: float
    medium: int = 0


class ThinLens(Frozen):
    """A pinhole's rays, from all over a lens of radius `aperture` around `origin`.

    The ray that leaves `origin` in direction d, d . forward = 1, goes on from every point of the
    lens, in the plane of right and up, to origin + focus d. A pixel is the mean over the lens.
    """

    type: Literal["thin_lens"] = "thin_lens"
    origin: Vec3
    right: Vec3
    up: Vec3
    forward: Vec3
    tan_half_fov_x: float
    aperture: float
    focus: float
    lens_samples: int
    medium: int = 0


Camera = Annotated[Perspective | Orthographic | ThinLens, Field(discriminator="type")]
