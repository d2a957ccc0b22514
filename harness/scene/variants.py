"""A case in another form: other shapes of the same solids, or the whole scene turned.

It is made from the scene file's own model, before anything is resolved, so that a turned box goes
through the same code as a box that was written turned.
"""

from __future__ import annotations

from typing import Any, TypeVar

from harness.scene import model
from harness.scene.shapes import turn_of
from harness.scene.vectors import Matrix, rotated

Shape = TypeVar("Shape", bound="model.Strict")
# Where a shape stands, by whichever of these keys it has.
PLACES = ("center", "apex", "vertex", "translate")


def varied(case: model.Case, variant: model.Variant) -> model.Case:
    """`case` with the variant's shapes, turned; its scale is not applied."""
    shapes = {s.name: variant.shapes.get(s.name, s.shape) for s in case.solids}
    solids = tuple(s.model_copy(update={"shape": shapes[s.name]}) for s in case.solids)
    case = case.model_copy(update={"solids": solids})
    if not variant.rotate:
        return case
    matrix = turn_of(variant)
    camera, more = case.camera, variant.rotate
    place = {key: rotated(matrix, getattr(camera, key)) for key in ("origin", "target", "up")}
    return case.model_copy(
        update={
            "camera": camera.model_copy(update=place),
            "solids": tuple(_with_shape(s, matrix, more) for s in case.solids),
            "surfaces": tuple(_with_shape(s, matrix, more) for s in case.surfaces),
            "lights": tuple(_turned_light(light, matrix) for light in case.lights),
            "probes": tuple(
                probe.model_copy(
                    update={"planes": tuple(_turned(p, matrix, more) for p in probe.planes)}
                )
                for probe in case.probes
            ),
        }
    )


def _turned_light(light: model.Light, matrix: Matrix) -> model.Light:
    if isinstance(light, model.DirectionalLight):
        return light.model_copy(update={"direction": rotated(matrix, light.direction)})
    return light.model_copy(update={"position": rotated(matrix, light.position)})


def _with_shape(owner: Any, matrix: Matrix, more: tuple[model.Rotation, ...]) -> Any:
    return owner.model_copy(update={"shape": _turned(owner.shape, matrix, more)})


def _turned(shape: Shape, matrix: Matrix, more: tuple[model.Rotation, ...]) -> Shape:
    """A shape turns about its own place, and its place about the origin."""
    if isinstance(shape, model.AsMesh):
        return shape.model_copy(update={"of": _turned(shape.of, matrix, more)})
    update: dict[str, object] = {
        key: rotated(matrix, getattr(shape, key)) for key in PLACES if hasattr(shape, key)
    }
    update["rotate"] = (*getattr(shape, "rotate", ()), *more)
    return shape.model_copy(update=update)
