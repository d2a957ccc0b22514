"""What both ends of the worker protocol share; docs/worker-protocol.md is its description.

Rays are one .npy file of (n, 6) float64: origin, direction. Ray paths are one .npy file of
(n, 10) float64: status, surface, point (3), direction (3), weight, optical length. So they can
be read and written in any language.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from harness.renderers.base import Capability, Float, RayPaths, Rays

PROTOCOL = 1


class Reply(BaseModel):
    """Any reply. Which fields have a meaning depends on the operation; unknown ones have none."""

    model_config = ConfigDict(frozen=True, extra="ignore")

    id: int | None
    ok: bool
    error: Literal["failed", "missing", "unsupported"] = "failed"
    message: str = ""
    log: str = ""
    seconds: Annotated[float, Field(ge=0, allow_inf_nan=False)] | None = None
    # hello, version
    protocol: int = 0
    version: str = ""
    capabilities: frozenset[Capability] = frozenset()
    operations: tuple[str, ...] = ()
    # render, trace, emit
    command: str = ""
    variance: Path | None = None
    closest: Path | None = None
    cut: Annotated[float, Field(ge=0, allow_inf_nan=False)] | None = None
    vertices: Path | None = None
    meetings: Path | None = None
    file: Path | None = None
    # health
    usable: bool = True
    path: str = ""
    detail: str = ""
    remedy: str = ""
    facts: dict[str, str] = {}


def write_rays(path: Path, rays: Rays) -> None:
    """Writes `rays` as (n, 6) float64."""
    both = np.concatenate([rays.origins, rays.directions], axis=1)
    np.save(path, np.ascontiguousarray(both, dtype="<f8"), allow_pickle=False)


def read_rays(path: Path) -> Rays:
    """Raises ValueError where the file is not (n, 6) float64."""
    both = _read(path, 6)
    return Rays(np.ascontiguousarray(both[:, :3]), np.ascontiguousarray(both[:, 3:]))


def write_paths(path: Path, paths: RayPaths) -> dict[str, Path]:
    """Writes (n, 10) float64; returns the files of vertices and meetings where there are any."""
    columns = (
        paths.status[:, None],
        paths.surface[:, None],
        paths.point,
        paths.direction,
        paths.weight[:, None],
        paths.optical_length[:, None],
    )
    np.save(path, np.concatenate(columns, axis=1).astype("<f8"), allow_pickle=False)
    files = {}
    for name, table in (("vertices", paths.vertices), ("meetings", paths.meetings)):
        if table is not None:
            files[name] = path.with_name(f"{path.stem}.{name}.npy")
            np.save(files[name], table.astype("<f8"), allow_pickle=False)
    return files


def read_paths(
    path: Path, count: int, vertices: Path | None, meetings: Path | None = None
) -> RayPaths:
    """Raises ValueError where the files do not hold `count` ray paths."""
    table = _read(path, 10)
    if len(table) != count:
        raise ValueError(f"{len(table)} ray paths for {count} rays")
    with np.errstate(invalid="ignore"):
        status, surface = table[:, 0].astype(np.int8), table[:, 1].astype(np.int32)
    if (status != table[:, 0]).any() or (surface != table[:, 1]).any():
        raise ValueError("status and surface must be whole numbers")
    return RayPaths(
        status=status,
        surface=surface,
        point=np.ascontiguousarray(table[:, 2:5]),
        direction=np.ascontiguousarray(table[:, 5:8]),
        weight=table[:, 8].copy(),
        optical_length=table[:, 9].copy(),
        vertices=None if vertices is None else _read_legs(vertices, "vertices", count),
        meetings=None if meetings is None else _read_legs(meetings, "meetings", count),
    )


def _read_legs(path: Path, name: str, count: int) -> Float:
    table = np.load(path, allow_pickle=False)
    shape = table.shape
    if table.dtype.kind != "f" or len(shape) != 3 or (shape[0], shape[2]) != (count, 3):
        raise ValueError(f"expected {name} ({count}, k, 3) float64, got {shape} {table.dtype}")
    return np.asarray(table, dtype=np.float64)


def _read(path: Path, columns: int) -> Float:
    table = np.load(path, allow_pickle=False)
    if table.ndim != 2 or table.shape[1] != columns or table.dtype.kind != "f":
        raise ValueError(f"expected (n, {columns}) float64, got {table.shape} {table.dtype}")
    return np.asarray(table, dtype=np.float64)
