"""Hypothesis strategies for valid scenes, as TOML data and as resolved scenes."""

from __future__ import annotations

import json
import math
import re
from functools import cache
from pathlib import Path
from typing import Any

from hypothesis import strategies as st

from harness.scene import resolved
from harness.scene.expand import expand
from harness.scene.load import LoadedCase
from harness.scene.model import Case
from harness.scene.resolve import resolve

Document = dict[str, Any]


@cache
def numbers(least: float, most: float) -> st.SearchStrategy[float]:
    """A thousand numbers of few digits, as people write them, both ends among them."""
    return st.integers(0, 1000).map(lambda k: float(f"{least + (most - least) * k / 1000:.6g}"))


@cache
def points(reach: float = 10.0) -> st.SearchStrategy[list[float]]:
    return st.tuples(*[numbers(-reach, reach)] * 3).map(list)


@cache
def colors(most: float = 1.0) -> st.SearchStrategy[list[float]]:
    return st.tuples(*[numbers(0, most)] * 3).map(list)


@cache
def directions() -> st.SearchStrategy[list[float]]:
    """Vectors with a direction that no rounding can lose."""
    return points(1.0).filter(lambda v: math.hypot(*v) > 0.1)


# --- scene files ----------------------------------------------------------------------------------


@cache
def rotations() -> st.SearchStrategy[list[Document]]:
    one = st.fixed_dictionaries({"axis": directions(), "angle": numbers(-360, 360)})
    return st.lists(one, max_size=2)


@cache
def convex_shapes() -> st.SearchStrategy[Document]:
    """Boxes, slabs, prisms and wedges within 6 units of their place."""
    sizes = numbers(0.1, 3)
    place = {"center": points(2)}
    turn = {"rotate": rotations()}
    box = {"type": st.just("box"), "size": st.tuples(sizes, sizes, sizes).map(list), **place}
    slab = {
        "type": st.just("slab"),
        "normal": directions(),
        "thickness": sizes,
        "size": st.tuples(sizes, sizes).map(list),
        **place,
    }
    prism = {
        "type": st.just("prism"),
        "apex": points(2),
        "apex_angle": numbers(1, 175),
        "side": sizes,
        "length": sizes,
    }
    wedge = {
        "type": st.just("wedge"),
        "thickness": numbers(1.0, 3),
        "angle": numbers(0, 30),  # 1.5 tan 30 is less than 1
        "size": st.tuples(numbers(0.1, 3), numbers(0.1, 3)).map(list),
        **place,
    }
    kinds = (box, slab, prism, wedge)
    return st.one_of(*(st.fixed_dictionaries(keys, optional=turn) for keys in kinds))


@cache
def lenses() -> st.SearchStrategy[Document]:
    """Lenses of all kinds: no face bends by more than half a unit, and none is thinner than one."""
    radii = st.one_of(numbers(1.5, 20), numbers(-20, -1.5), st.just(math.inf))
    return st.fixed_dictionaries(
        {
            "type": st.just("lens"),
            "axis": directions(),
            "thickness": numbers(1, 3),
            "radii": st.tuples(radii, radii).map(list),
            "diameter": numbers(0.2, 2),
        },
        optional={
            "vertex": points(2),
            "conics": st.tuples(numbers(-3, 0.5), numbers(-3, 0.5)).map(list),
            "rotate": rotations(),
        },
    )


@cache
def cones() -> st.SearchStrategy[Document]:
    return st.fixed_dictionaries(
        {
            "type": st.just("cone"),
            "axis": directions(),
            "radius": numbers(1, 2),
            "height": numbers(0.1, 3),
        },
        optional={
            "top_radius": numbers(0, 1),
            "center": points(2),
            "rotate": rotations(),
        },
    )


@cache
def composed_shapes() -> st.SearchStrategy[Document]:
    """Unions, and differences that a part of the first shape surely survives."""
    parts = st.one_of(lenses(), cones(), convex_shapes())
    hole = st.fixed_dictionaries({"type": st.just("sphere"), "radius": numbers(0.1, 0.2)})
    unions = st.lists(parts, min_size=2, max_size=3).map(lambda of: {"type": "union", "of": of})
    drilled = st.tuples(st.one_of(parts, unions), hole).map(
        lambda of: {"type": "difference", "of": list(of)}
    )
    return st.one_of(unions, drilled)


@cache
def solid_shapes() -> st.SearchStrategy[Document]:
    """Shapes of every kind that needs no file, within 6 units of the origin."""
    round_ones = st.one_of(
        st.fixed_dictionaries(
            {"type": st.just("sphere"), "radius": numbers(0.1, 3)}, optional={"center": points(2)}
        ),
        st.fixed_dictionaries(
            {
                "type": st.just("cylinder"),
                "axis": directions(),
                "radius": numbers(0.1, 2),
                "height": numbers(0.1, 3),
            },
            optional={"center": points(2), "rotate": rotations()},
        ),
        st.fixed_dictionaries(
            {
                "type": st.just("icosphere"),
                "radius": numbers(0.1, 3),
                "subdivisions": st.integers(0, 2),
            },
            optional={"center": points(2), "smooth": st.booleans(), "rotate": rotations()},
        ),
    )
    polygons = convex_shapes().map(lambda shape: {"type": "polygons", "of": shape})
    kinds = (round_ones, lenses(), cones(), convex_shapes(), polygons, composed_shapes())
    return st.one_of(*kinds)


@cache
def patterns() -> st.SearchStrategy[Document]:
    cells = st.tuples(st.integers(1, 64), st.integers(1, 64)).map(list)
    return st.one_of(
        st.fixed_dictionaries({"type": st.just("constant"), "radiance": colors()}),
        st.fixed_dictionaries(
            {"type": st.just("checker"), "a": colors(), "b": colors(), "cells": cells}
        ),
        st.fixed_dictionaries(
            {"type": st.just("ramp"), "start": colors(), "end": colors()},
            optional={"axis": st.sampled_from(["u", "v"])},
        ),
    )


@cache
def materials() -> st.SearchStrategy[Document]:
    parts = st.tuples(numbers(0, 0.5), numbers(0, 0.5))
    return st.one_of(
        patterns().map(lambda pattern: {"type": "emissive", "pattern": pattern}),
        st.fixed_dictionaries({"type": st.just("diffuse"), "reflectance": colors()}),
        st.fixed_dictionaries({"type": st.just("mirror")}, optional={"reflectance": colors()}),
        st.tuples(colors(), parts).map(
            lambda t: {
                "type": "translucent",
                "color": t[0],
                "filter": t[1][0],
                "transmit": t[1][1],
            }
        ),
        st.fixed_dictionaries(
            {
                "type": st.just("thin_slab"),
                "medium": st.just("glass"),
                "thickness": numbers(0.01, 1),
            }
        ),
    )


@cache
def cameras() -> st.SearchStrategy[Document]:
    """Cameras outside of what `documents` build, looking at it."""
    place = {"origin": points(3).map(lambda p: [p[0], p[1], 20.0]), "target": points(2)}
    return st.one_of(
        st.fixed_dictionaries({"type": st.just("perspective"), "fov_x": numbers(5, 120), **place}),
        st.fixed_dictionaries({"type": st.just("orthographic"), "width": numbers(0.1, 5), **place}),
    )


@st.composite
def documents(draw: st.DrawFn) -> Document:
    """A valid scene file as TOML data: one solid, some surfaces behind it, one check."""
    surfaces = [
        {
            "name": f"surface-{k}",
            "shape": {
                "type": "rectangle",
                "center": [0.0, 0.0, -10.0 - k],
                "size": [draw(numbers(1, 20)), draw(numbers(1, 20))],
            },
            "material": draw(materials()),
        }
        for k in range(draw(st.integers(0, 3)))
    ]
    document: Document = {
        "format": 1,
        "title": draw(st.text(st.characters(exclude_categories=["Cs"]), min_size=1, max_size=20)),
        "family": "made",
        "sources": ["made up"],
        "camera": draw(cameras()),
        "media": {"glass": {"ior": draw(numbers(1.01, 3)), "absorption": draw(colors(2))}},
        "solids": [{"name": "solid", "medium": "glass", "shape": draw(solid_shapes())}],
        "surfaces": surfaces,
        "checks": [{"observable": "ssim", "against": "renderers"}],
    }
    if draw(st.booleans()):
        values = st.lists(numbers(1.01, 3), min_size=1, max_size=3, unique=True)
        document["axes"] = {"ior": draw(values)}
        document["media"]["glass"]["ior"] = "=ior"
    return document


def cases_of(document: Document) -> list[LoadedCase]:
    """The cases of valid data, as if they were loaded from a file."""
    return [
        LoadedCase(
            f"made{permutation.suffix}",
            "made",
            Path("made.toml"),
            {**permutation.axes, **permutation.parameters},
            Case.model_validate(permutation.data),
        )
        for permutation in expand(document).permutations
    ]


@cache
def resolved_scenes() -> st.SearchStrategy[resolved.ResolvedScene]:
    """Valid scenes with one solid of any shape and up to three surfaces."""
    return documents().map(lambda document: resolve(cases_of(document)[0]))


# --- TOML text ------------------------------------------------------------------------------------


def to_toml(document: Document) -> str:
    """The data as TOML text, a line per key and element."""
    lines: list[str] = []
    for key, value in document.items():
        if not _is_table(value) and not _is_tables(value):
            lines.append(f"{_key(key)} = {_inline(value)}")
    for key, value in document.items():
        if _is_table(value):
            lines += ["", f"[{_key(key)}]"]
            lines += (f"{_key(k)} = {_inline(v)}" for k, v in value.items())
        elif _is_tables(value):
            for row in value:
                lines += ["", f"[[{_key(key)}]]"]
                lines += (f"{_key(k)} = {_inline(v)}" for k, v in row.items())
    return "\n".join(lines) + "\n"


def _is_table(value: object) -> bool:
    return isinstance(value, dict)


def _is_tables(value: object) -> bool:
    return isinstance(value, list) and bool(value) and all(isinstance(v, dict) for v in value)


def _key(key: str) -> str:
    return key if re.fullmatch(r"[A-Za-z0-9_-]+", key) else _text(key)


def _text(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _inline(value: object) -> str:
    match value:
        case bool():
            return "true" if value else "false"
        case int() | float():
            return repr(value)  # "inf" is TOML, too
        case str():
            return _text(value)
        case list():
            return "[" + ", ".join(map(_inline, value)) + "]"
        case dict():
            return "{ " + ", ".join(f"{_key(k)} = {_inline(v)}" for k, v in value.items()) + " }"
    raise TypeError(type(value))
