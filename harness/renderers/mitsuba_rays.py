"""Single rays along given paths, through Mitsuba's public scene and BSDF API.

Imported only in the process that hosts Mitsuba, after an LLVM variant was chosen.
"""

from __future__ import annotations

from dataclasses import make_dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from harness.renderers.base import RayPaths, Rays, Status
from harness.renderers.mitsuba_lobes import (
    INTERFACE,
    OFFSET,
    landing,
    onward,
    reflected,
)
from harness.renderers.mitsuba_world import World
from harness.scene import resolved as rs


def trace(live: Any, scene: rs.ResolvedScene, rays: Rays, path: str) -> RayPaths:
    """Follows each ray along `path`, in the lengths of the (scaled) scene.

    HIT is a ray that lands on a surface after its last letter, MISS also one that lands before.
    """
    world = World(live, scene)
    tables = world.tables
    reflects = mi.Bool(np.array([*(letter == "R" for letter in path), False]))
    letters = dr.opaque(mi.UInt32, min(len(path), scene.transport.max_depth - 1))
    complete = dr.opaque(mi.Bool, len(path) < scene.transport.max_depth)
    n = len(rays.origins)

    def step(k: Any, ray: Any, active: Any) -> tuple[Any, ...]:
        si, bsdf, number = world.meet(ray.origin, ray.direction, active)
        hit = active & si.is_valid()
        interface = hit & (tables.kind(number, hit) == INTERFACE)
        length = mi.Float64(si.t) + dr.select(k == 0, 0.0, OFFSET)
        ray.optical_length += dr.select(hit, length * mi.Float64(tables.ior(ray.medium)), 0.0)
        ray.point = dr.select(hit, landing(ray, si), ray.point)

        last = hit & (k >= letters)
        landed = last & ~interface & complete
        ray.surface = dr.select(landed, mi.Int32(tables.index(number, hit)), -1)
        going = hit & ~last
        back = dr.gather(mi.Bool, reflects, k, going)
        lobe = dr.select(back, reflected(si, bsdf, going), onward(si, bsdf, ray.direction, going))
        go = going & ((lobe.energy > 0) | (interface & back))
        ray.status = dr.select(
            last,
            dr.select(landed, int(Status.HIT), int(Status.CUT)),
            dr.select(interface, int(Status.TIR), int(Status.MISS)),
        )

        point = dr.fma(si.t, ray.direction, ray.origin)
        medium = tables.medium_beyond(number, si, lobe.direction, ray.medium, go)
        ray.origin = dr.select(go, dr.fma(OFFSET, lobe.direction, point), ray.origin)
        ray.direction = dr.select(go, lobe.direction, ray.direction)
        ray.medium = dr.select(go, medium, ray.medium)
        ray.weight *= dr.select(go & interface, lobe.energy, 1.0)
        return k + 1, ray, go

    origin = mi.Point3f(mi.Point3d(rays.origins.T))
    direction = mi.Vector3f(mi.Vector3d(rays.directions.T))
    dr.eval(origin, direction)  # or else the kernel would depend on where numpy's arrays are
    start = _ray_type()(
        origin=origin,
        direction=direction,
        point=mi.Point3d(0),
        weight=mi.Float(1),
        optical_length=mi.Float64(0),
        medium=dr.opaque(mi.UInt32, scene.camera.medium),
        surface=mi.Int32(-1),
        status=mi.Int32(int(Status.CUT)),
    )
    state = (dr.zeros(mi.UInt32, n), start, dr.full(mi.Bool, True, n))
    _, ray, _ = dr.while_loop(state, lambda *s: s[-1], step, label="trace")
    dr.eval(ray)  # all at once, in one kernel
    status = np.array(ray.status).astype(np.int8)
    point = np.where((status == Status.HIT)[:, None], np.array(ray.point).T, np.nan)
    return RayPaths(
        status=status,
        surface=np.array(ray.surface),
        point=point,
        direction=np.array(ray.direction).T.astype(np.float64),
        weight=np.array(ray.weight).astype(np.float64),
        optical_length=np.array(ray.optical_length),
    )


def _ray_type() -> Any:
    """A ray on its way along a given path."""
    fields = {
        "origin": mi.Point3f,
        "direction": mi.Vector3f,
        "point": mi.Point3d,
        "weight": mi.Float,
        "optical_length": mi.Float64,
        "medium": mi.UInt32,
        "surface": mi.Int32,
        "status": mi.Int32,
    }
    return make_dataclass("Ray", fields.items())
