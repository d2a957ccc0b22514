"""Jobs and results as JSON and blocks of bytes: for the cache, and for machines far away.

No pickles: a parcel can be read by any version that knows its layout, and opening one runs nothing.
Arrays lose nothing; they are packed by bytes of equal weight (byte shuffle) and zstd, which takes
images of position codes to a tenth.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from harness.errors import (
    ImageNotFinite,
    RendererError,
    RendererFailed,
    RendererMissing,
    RendererUnsupported,
)
from harness.judging.results import Contender, Result
from harness.plan import Job
from harness.preflight import Preflight
from harness.record import Verdict
from harness.renderers.base import Capability, Image, RayPaths, RenderSettings
from harness.scene.resolved import ResolvedScene

LAYOUT = 2  # of parcels; part of every key
_LEVEL = 3  # of zstd; higher ones take longer than a render for a few percent
_ERRORS: dict[str, type[RendererError]] = {
    "failed": RendererFailed,
    "missing": RendererMissing,
    "unsupported": RendererUnsupported,
}
_IMAGE: tuple[str, ...] = ("pixels", "variance", "closest")
_PATHS: tuple[str, ...] = (
    "status",
    "surface",
    "point",
    "direction",
    "weight",
    "optical_length",
    "vertices",
    "meetings",
)


@dataclass(frozen=True)
class Parcel:
    """`meta` is JSON; `blocks` are bytes by name."""

    meta: Mapping[str, Any]
    blocks: Mapping[str, bytes]


def job_key(job: Job, fingerprint: str) -> str:
    """The hash of all that determines a job's result.

    Not the number of threads and not the limits of time and memory: they decide whether there is
    a result, and failures are not kept.
    """
    settings = {"samples": job.settings.samples, "seed": job.settings.seed}
    header = json.dumps([LAYOUT, job.renderer, fingerprint, settings, job.path])
    digest = hashlib.sha256(header.encode())
    digest.update(job.scene.model_dump_json().encode())
    return digest.hexdigest()


def pack_result(result: Result) -> Parcel:
    """The parcel of an image, of ray paths, or of the error that stands in their place."""
    if isinstance(result, ImageNotFinite):
        where = {"pixels": list(result.pixels), "width": result.width}
        image = {} if result.image is None else {"image": result.image}
        return _with_arrays({"kind": "not finite", "log": result.log, **where}, image)
    if isinstance(result, RendererError):
        kind = next(name for name, error in _ERRORS.items() if isinstance(result, error))
        return Parcel({"kind": kind, "message": str(result), "log": result.log}, {})
    if isinstance(result, Image):
        meta: dict[str, Any] = {
            "kind": "image", "seconds": result.seconds, "log": result.log,
            "command": result.command, "cut": result.cut,
        }  # fmt: skip
        names = _IMAGE
    else:
        meta, names = {"kind": "paths"}, _PATHS
    arrays = {name: getattr(result, name) for name in names if getattr(result, name) is not None}
    return _with_arrays(meta, arrays)


def _with_arrays(meta: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> Parcel:
    shapes = {name: [array.dtype.str, *array.shape] for name, array in arrays.items()}
    return Parcel(
        {**meta, "arrays": shapes}, {name: _packed(array) for name, array in arrays.items()}
    )


def unpack_result(parcel: Parcel) -> Result:
    """The result that `pack_result` was given, bit for bit."""
    meta = parcel.meta
    if meta["kind"] in _ERRORS:
        return _ERRORS[meta["kind"]](meta["message"], log=meta["log"])
    arrays: dict[str, Any] = {
        name: _unpacked(parcel.blocks[name], kind, shape)
        for name, (kind, *shape) in meta["arrays"].items()
    }
    if meta["kind"] == "not finite":
        return ImageNotFinite(meta["pixels"], width=meta["width"], log=meta["log"], **arrays)
    if meta["kind"] == "image":
        return Image(
            **arrays, seconds=meta["seconds"], log=meta["log"], command=meta["command"],
            cut=meta["cut"],
        )  # fmt: skip
    return RayPaths(**arrays)


def pack_job(job: Job) -> Parcel:
    """The parcel of a job: its scene travels with it, meshes and pictures included."""
    meta = {
        "renderer": job.renderer, "role": job.role, "path": job.path,
        "settings": dataclasses.asdict(job.settings),
    }  # fmt: skip
    return Parcel(meta, {"scene": _compressed(job.scene.model_dump_json().encode())})


def unpack_job(parcel: Parcel) -> Job:
    """The job that `pack_job` was given."""
    meta = parcel.meta
    scene = ResolvedScene.model_validate_json(_decompressed(parcel.blocks["scene"]))
    settings = RenderSettings(**meta["settings"])
    return Job(meta["renderer"], meta["role"], scene, settings, meta["path"])


def pack_contender(contender: Contender) -> dict[str, Any]:
    """A renderer's calibration as JSON."""
    found = contender.preflight
    return {
        "name": contender.name,
        "version": contender.version,
        "capabilities": sorted(contender.capabilities),
        "preflight": None if found is None else dataclasses.asdict(found),
        "absent": contender.absent,
        "reason": contender.reason,
    }


def unpack_contender(meta: Mapping[str, Any]) -> Contender:
    """The calibration that `pack_contender` was given."""
    found = meta["preflight"]
    return Contender(
        name=meta["name"],
        version=meta["version"],
        capabilities=frozenset(Capability(name) for name in meta["capabilities"]),
        preflight=None if found is None else _preflight(found),
        absent=None if meta["absent"] is None else Verdict(meta["absent"]),
        reason=meta["reason"],
    )


def _preflight(found: Mapping[str, Any]) -> Preflight:
    return Preflight(**{**found, "findings": tuple(found["findings"])})


def load_packers() -> None:
    """Loads what packs arrays, a quarter of a second that the first result need not wait for."""
    _compressed(b"")


def _packed(array: NDArray[Any]) -> bytes:
    flat = np.ascontiguousarray(array).reshape(-1)
    return _compressed(flat.view(np.uint8).reshape(-1, array.itemsize).T.tobytes())


def _unpacked(block: bytes, kind: str, shape: list[int]) -> NDArray[Any]:
    dtype = np.dtype(kind)
    planes = np.frombuffer(_decompressed(block), np.uint8).reshape(dtype.itemsize, -1)
    together = np.empty((planes.shape[1], dtype.itemsize), np.uint8)
    for i, plane in enumerate(planes):  # five times as quick as a copy of the transpose
        together[:, i] = plane
    return together.reshape(-1).view(dtype).reshape(shape)


def _compressed(data: bytes) -> bytes:
    import imagecodecs

    return bytes(imagecodecs.zstd_encode(data, level=_LEVEL))


def _decompressed(data: bytes) -> bytes:
    import imagecodecs

    return bytes(imagecodecs.zstd_decode(data))
