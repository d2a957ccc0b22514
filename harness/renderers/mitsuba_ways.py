"""The main ways of single rays, leg by leg, through Mitsuba's public scene and BSDF API.

Imported only in the process that hosts Mitsuba, after an LLVM variant was chosen.
"""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from harness.renderers.base import RayPaths, Rays, Status
from harness.renderers.mitsuba_lobes import INTERFACE, OFFSET, Lobe, onward, reflected
from harness.renderers.mitsuba_world import World
from harness.scene import resolved as rs

MOST_LEGS = 32


def follow(live: Any, scene: rs.ResolvedScene, rays: Rays) -> RayPaths:
    """Each ray through whatever transmits and back from whatever does not, until it lands.

    In the lengths of the (scaled) scene. A kernel per leg, since all that happens is asked for; it
    is the same one for all legs.
    """
    world, n = World(live, scene), len(rays.origins)
    origin, direction = mi.Point3f(mi.Point3d(rays.origins.T)), mi.Vector3f(rays.directions.T)
    medium = dr.full(mi.UInt32, scene.camera.medium, n)
    active, weight = dr.full(mi.Bool, True, n), dr.full(mi.Float, 1, n)
    optical = dr.zeros(mi.Float64, n)
    status, surface = np.full(n, Status.CUT, np.int8), np.full(n, -1, np.int32)
    vertices, meetings = [np.array(rays.origins)], [np.full((n, 3), np.nan)]
    legs = min(scene.transport.max_depth, MOST_LEGS)
    for leg in range(1, legs + 1):
        dr.make_opaque(origin, direction, medium, active, weight, optical)  # one kernel for all
        si, bsdf, number = world.meet(origin, direction, active)
        hit = active & si.is_valid()
        interface = hit & (world.tables.kind(number, hit) == INTERFACE)
        through, back = onward(si, bsdf, direction, hit), reflected(si, bsdf, hit)
        passes = hit & (through.energy > 0)
        opaque = hit & ~interface & ~passes & ~(back.energy > 0)
        lobe = dr.select(passes, through, back)
        told = _told(si, direction, lobe, interface, passes & interface, through.energy)
        point = dr.fma(mi.Float64(si.t), mi.Vector3d(direction), mi.Point3d(origin))
        index = mi.Int32(world.tables.index(number, hit))

        go = hit & ~opaque & (leg < legs)
        length = mi.Float64(si.t) + (OFFSET if leg > 1 else 0.0)
        optical += dr.select(hit, length * mi.Float64(world.tables.ior(medium)), 0.0)
        weight *= dr.select(go & interface, lobe.energy, 1.0)
        onwards = dr.fma(OFFSET, lobe.direction, dr.fma(si.t, direction, origin))
        beyond = world.tables.medium_beyond(number, si, lobe.direction, medium, go)
        origin = dr.select(go, onwards, origin)
        direction = dr.select(go, lobe.direction, direction)
        medium = dr.select(go, beyond, medium)
        dr.eval(origin, direction, medium, weight, optical, hit, opaque, go, point, index, told)

        met, landed, goes = np.array(hit), np.array(opaque), np.array(go)
        status[np.array(active) & ~met] = Status.MISS
        status[landed] = Status.HIT
        surface[landed] = np.array(index)[landed]
        vertices.append(np.where(met[:, None], np.array(point).T, np.nan))
        meetings.append(np.where(goes[:, None], np.array(told).T, np.nan))
        active = go
        if not goes.any():
            break
    ways = np.stack(vertices, axis=1)
    ends = ways[np.arange(n), np.isfinite(ways[..., 0]).sum(axis=1) - 1]
    return RayPaths(
        status=status,
        surface=surface,
        point=np.where((status == Status.HIT)[:, None], ends, np.nan),
        direction=np.array(direction).T.astype(np.float64),
        weight=np.array(weight).astype(np.float64),
        optical_length=np.array(optical),
        vertices=ways,
        meetings=np.stack(meetings, axis=1).astype(np.float64),
    )


def _told(si: Any, direction: Any, lobe: Lobe, interface: Any, refracts: Any, energy: Any) -> Any:
    """cos_theta_i, cos_theta_t and R where a ray meets something, as `RayPaths.meetings` has them.

    `energy` is that of the transmitted lobe.
    """
    n = si.sh_frame.n
    return mi.Vector3f(
        dr.abs(dr.dot(direction, n)),
        dr.select(refracts, dr.abs(dr.dot(lobe.direction, n)), dr.nan),
        dr.select(interface, 1 - energy, dr.nan),
    )
