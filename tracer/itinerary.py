"""One ray to look at: what it met, leg by leg, in words and degrees."""

from __future__ import annotations

import math

import numpy as np

from tracer.path import CUT, HIT, MISS, NO_LEG, TIR, Paths
from tracer.scene import Scene

ENDS = {
    HIT: "landed",
    MISS: "left the scene, or landed early",
    TIR: "is totally reflected where it was to pass",
    CUT: "was not followed further",
}


def itinerary(scene: Scene, paths: Paths, ray: int = 0) -> str:
    """The way of one ray of `paths`, which were followed with `vertices`: a line per leg.

    Where it begins, through what it goes, how far, and at the end of the leg the angles to the
    normal before and behind the interface and the part that is reflected.
    """
    lines = []
    for k, solid in enumerate(paths.solid[ray].tolist()):
        if solid == NO_LEG:
            break
        start, end = paths.vertices[ray, k : k + 2]
        where = "ambient" if solid < 0 else scene.solids[solid].name
        place = ", ".join(f"{x:.6g}" for x in start)
        length = float(np.linalg.norm(end - start))
        legs = [f"({place})", where, f"{length:.6g}" if math.isfinite(length) else "∞"]
        cosines = paths.cos_theta_i[ray, k], paths.cos_theta_t[ray, k]
        angles = [math.degrees(math.acos(min(1.0, c))) if c == c else None for c in cosines]
        if angles[0] is not None:
            beyond = "total" if angles[1] is None else f"{angles[1]:.6g}°"
            legs.append(f"{angles[0]:.6g}° → {beyond}, R = {paths.reflectance[ray, k]:.6g}")
        lines.append("  ".join(legs))
    status = ENDS[int(paths.status[ray])]
    weight, length = float(paths.weight[ray]), float(paths.optical_length[ray])
    return "\n".join([*lines, f"{status}; weight {weight:.6g}, optical length {length:.6g}"])
