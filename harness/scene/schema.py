"""JSON Schemas: of scene files, for editors, and of scene.json, for renderers of others."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from harness.scene.axes import MOST_COMBINATIONS, NAME, RANGE_KEYS, WORD
from harness.scene.expand import PROSE
from harness.scene.model import Case
from harness.scene.resolved import ResolvedScene

Schema = dict[str, Any]

DIALECT = "https://json-schema.org/draft/2020-12/schema"
EXPRESSION: Schema = {
    "type": "string",
    "pattern": "^=",
    "description": 'an expression over parameters and axes, such as "=thickness / 2"',
}
# What an expression may stand for: texts other than prose may come from an axis of words.
REPLACEABLE = frozenset({"number", "integer", "string"})
# Keywords whose values are schemas again.
SCHEMAS = frozenset({"items", "prefixItems", "additionalProperties", "anyOf", "oneOf", "allOf"})


def case_schema() -> Schema:
    """Of a scene file, with its axes, parameters and expressions still in it."""
    written = Case.model_json_schema()
    definitions = {
        name: _with_expressions(definition) for name, definition in written["$defs"].items()
    }
    body = _with_expressions({key: value for key, value in written.items() if key != "$defs"})
    body["properties"] = {**body["properties"], "parameters": _parameters(), "axes": _axes()}
    return {
        "$schema": DIALECT,
        **body,
        "title": "snellcheck scene file",
        "description": "Geometry, media, camera, and what to check; see docs/scene-format.md.",
        "$defs": {**definitions, "expression": EXPRESSION},
    }


def scene_schema() -> Schema:
    """Of scene.json."""
    written = ResolvedScene.model_json_schema(mode="serialization")
    return {"$schema": DIALECT, **written, "title": "snellcheck resolved scene (scene.json)"}


def _with_expressions(node: Any) -> Any:
    """The same schema, where every number or word may also be an expression."""
    if isinstance(node, list):
        return [_with_expressions(item) for item in node]
    if not isinstance(node, Mapping):
        return node
    changed = {name: _part(name, value) for name, value in node.items()}
    if node.get("type") not in REPLACEABLE or "const" in node:
        return changed
    kept = {name: changed.pop(name) for name in ("title", "default") if name in changed}
    return {**kept, "anyOf": [changed, {"$ref": "#/$defs/expression"}]}


def _part(keyword: str, value: Any) -> Any:
    if keyword == "properties":
        return {
            name: schema if name in PROSE else _with_expressions(schema)
            for name, schema in value.items()
        }
    if keyword == "patternProperties":
        return {name: _with_expressions(schema) for name, schema in value.items()}
    if keyword in SCHEMAS:
        return _with_expressions(value)
    return value


def _parameters() -> Schema:
    return {
        "type": "object",
        "description": "Named numbers; a later one may use axes and earlier ones.",
        "propertyNames": {"pattern": f"^{NAME.pattern}$"},
        "additionalProperties": {"anyOf": [{"type": "number"}, {"$ref": "#/$defs/expression"}]},
    }


def _axes() -> Schema:
    number = {"anyOf": [{"type": "number"}, {"$ref": "#/$defs/expression"}]}
    word = {"type": "string", "pattern": f"^{WORD.pattern}$"}
    values = {
        "type": "array",
        "minItems": 1,
        "maxItems": MOST_COMBINATIONS,
        "items": {"anyOf": [*number["anyOf"], word]},
    }
    steps = {
        "type": "object",
        "additionalProperties": False,
        "properties": dict.fromkeys(RANGE_KEYS, number),
        "required": ["start", "stop"],
        "oneOf": [{"required": ["count"]}, {"required": ["step"]}],
    }
    return {
        "type": "object",
        "description": "Values to sweep: every combination is one permutation of the case.",
        "propertyNames": {"pattern": f"^{NAME.pattern}$"},
        "additionalProperties": {"anyOf": [values, steps]},
    }
