"""Mesh files that hold several solids, each face tagged with the one that it belongs to.

OBJ tags faces by the last ``o`` and the last ``g`` before them, which has one name or several; PLY
by a property ``solid`` of its faces, a whole number from 0.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from harness.errors import nearest
from harness.scene.findings import Finding, SceneInvalid, quoted
from harness.scene.mesh import LISTED

Tags = list[frozenset[str]]  # of each face
PART = ("part",)
TAG = "solid"  # a PLY face's property


def named_tags(tags: Tags) -> list[str]:
    """All names, in the order of the faces."""
    return list(dict.fromkeys(name for names in tags for name in sorted(names)))


def faces_of(part: str, tags: Tags, places: Sequence[str] = ()) -> NDArray[np.bool_]:
    """Which faces belong to `part`; `places` say where in its file each face is.

    Raises SceneInvalid where there is no such part, and where a face belongs to none.
    """
    untagged = [k for k, names in enumerate(tags) if not names]
    if untagged:
        first = ", ".join(f"{k}{places[k] if places else ''}" for k in untagged[:LISTED])
        more = f", and {len(untagged) - LISTED} more" if len(untagged) > LISTED else ""
        noun = "face belongs" if len(untagged) == 1 else "faces belong"
        raise SceneInvalid(
            Finding(
                PART,
                f"{len(untagged)} {noun} to no solid: {first}{more}",
                None,
                f"all faces of the file below an `o` or `g`, or with a property `{TAG}` from 0",
            )
        )
    names = named_tags(tags)
    if part not in names:
        listed = ", ".join(names) or "a file that has parts"
        raise SceneInvalid(
            Finding(PART, "no such part", quoted(part), listed, nearest(part, names))
        )
    return np.array([part in tag for tag in tags])


# --- OBJ ------------------------------------------------------------------------------------------


def obj_tags(text: str) -> tuple[Tags, list[str]]:
    """The tags of the faces of an OBJ file, and where each of them is."""
    tags, places = [], []
    object_, groups = frozenset[str](), frozenset[str]()
    for number, line in enumerate(text.splitlines(), 1):
        key, _, rest = line.strip().partition(" ")
        if key == "o":
            object_ = frozenset(filter(None, [rest.strip()]))
        elif key == "g":
            groups = frozenset(rest.split())
        elif key == "f":
            tags.append(object_ | groups)
            places.append(f" (line {number})")
    return tags, places


def obj_part(text: str, part: str) -> str:
    """The same file without the faces of other parts. Its vertices keep their numbers."""
    own = iter(faces_of(part, *obj_tags(text)))
    return "\n".join(
        line for line in text.splitlines() if line.strip().partition(" ")[0] != "f" or next(own)
    )


# --- PLY ------------------------------------------------------------------------------------------


def ply_tags(solid: NDArray[np.int64]) -> Tags:
    return [frozenset([str(k)] if k >= 0 else []) for k in solid.reshape(-1).tolist()]
