"""Pydantic's errors in the words of the scene format.

A message names the key as it stands in the file: the tags that pydantic adds to the path of a
union's branch are taken out, and what else a key could have been comes from the JSON Schema.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import TYPE_CHECKING, Any

from pydantic import ValidationError

from harness.errors import nearest
from harness.scene.document import value_at
from harness.scene.findings import Finding, KeyPath, quoted
from harness.scene.model import Case

if TYPE_CHECKING:
    from pydantic_core import ErrorDetails

Schema = Mapping[str, Any]

MOST_DETAILS = 1000
UNKNOWN_KEY = "unknown key"
UNKNOWN_TYPE = "unknown type"
MISSING = "missing"
OF_KEYS = (UNKNOWN_KEY, MISSING)
WRONG_TYPE = {
    "float_type": "a number",
    "int_type": "an integer",
    "int_from_float": "an integer",
    "string_type": "a text",
    "bool_type": "true or false",
    "tuple_type": "an array",
    "dict_type": "a table",
    "model_type": "a table",
    "model_attributes_type": "a table",
    "finite_number": "a finite number",
}
BOUNDS = {
    "greater_than": ("gt", ">"),
    "greater_than_equal": ("ge", "≥"),
    "less_than": ("lt", "<"),
    "less_than_equal": ("le", "≤"),
}


def validate(document: dict[str, object]) -> tuple[Case | None, list[Finding]]:
    """The case that a document describes, or all that is wrong with it.

    Where the type of a shape, material or the like is misspelt, its values are judged as those
    of the type that was probably meant; its keys are not.
    """
    found: list[Finding] = []
    guessed_tables: set[KeyPath] = set()
    while True:
        try:
            case = Case.model_validate(document)
        except ValidationError as error:
            reported = {finding.path for finding in found}
            new = [
                finding
                for finding in _findings_of(error, document)
                if finding.path not in reported
                and (finding.message not in OF_KEYS or finding.path[:-1] not in guessed_tables)
            ]
            found += new
            guesses = {f.path: f.suggestion for f in new if f.message == UNKNOWN_TYPE}
            guessed_tables |= {path[:-1] for path in guesses}
            guessed = _with_guesses(document, (), guesses)
            if guessed == document:
                return None, found
            assert isinstance(guessed, dict)
            document = guessed
        else:
            return (None, found) if found else (case, [])


def _with_guesses(node: object, path: KeyPath, guesses: dict[KeyPath, str | None]) -> object:
    """The same data with some values replaced."""
    if isinstance(node, dict):
        return {k: _with_guesses(value, (*path, k), guesses) for k, value in node.items()}
    if isinstance(node, tuple):
        return tuple(_with_guesses(value, (*path, k), guesses) for k, value in enumerate(node))
    return guesses.get(path) or node


def _findings_of(error: ValidationError, document: dict[str, object]) -> list[Finding]:
    """One finding per error of `Case`, without repetitions and without what follows from others."""
    details = [d for d in error.errors(include_url=False) if not _is_consequence(d)]
    details = details[:MOST_DETAILS]
    findings = list(dict.fromkeys(_finding(detail, document) for detail in details))
    # A key that is misspelt is not missing on top.
    misspelt = {(*f.path[:-1], f.suggestion) for f in findings if f.message == UNKNOWN_KEY}
    return [f for f in findings if f.message != MISSING or f.path not in misspelt]


def _is_consequence(detail: ErrorDetails) -> bool:
    """Whether an array is called too short only because elements in it are wrong."""
    least = detail.get("ctx", {}).get("min_length")
    return detail["type"] == "too_short" and least is not None and len(detail["input"]) >= least


def _finding(detail: ErrorDetails, document: dict[str, object]) -> Finding:
    kind, context = detail["type"], detail.get("ctx", {})
    path, schema = _located(detail["loc"], document)
    value = quoted(detail["input"])
    if kind == "extra_forbidden":
        return _unknown_key(path, schema)
    if kind == "missing":
        if isinstance(path[-1], int):  # an array with too few elements
            path, schema = _located(detail["loc"][:-1], document)
            return _wrong_length(path, detail["input"], schema)
        return Finding(path, MISSING, None, expectation(_child(schema, path[-1])))
    if kind == "union_tag_not_found":
        return Finding((*path, "type"), MISSING, None, _alternatives(_tags(schema)))
    if kind == "union_tag_invalid":
        return _unknown_word((*path, "type"), context["tag"], _tags(schema))
    if kind == "literal_error":
        return _unknown_word(path, detail["input"], _words(schema, str(context["expected"])))
    if kind in ("too_short", "too_long"):
        return _wrong_length(path, detail["input"], schema)
    if kind in BOUNDS:
        key, sign = BOUNDS[kind]
        return Finding(path, "out of range", value, f"{sign} {context[key]:g}")
    if kind in WRONG_TYPE:
        return Finding(path, "wrong type", value, expectation(schema) or WRONG_TYPE[kind])
    if kind == "string_pattern_mismatch":
        return Finding(path, "not a valid text", value, expectation(schema))
    if kind in ("string_too_short", "string_too_long"):
        bound = context.get("min_length", context.get("max_length"))
        side = "at least" if "min_length" in context else "at most"
        return Finding(path, "text of the wrong length", value, f"{side} {bound} characters")
    return Finding(path, detail["msg"], value)


def _unknown_key(path: KeyPath, schema: Schema) -> Finding:
    known = sorted(schema.get("properties", {}))
    key = str(path[-1])
    return Finding(path, UNKNOWN_KEY, None, _alternatives(known) or None, nearest(key, known))


def _unknown_word(path: KeyPath, value: object, known: list[str]) -> Finding:
    return Finding(
        path,
        f"unknown {path[-1]}" if isinstance(path[-1], str) else "unknown word",
        quoted(value),
        _alternatives(known),
        nearest(value, known) if isinstance(value, str) else None,
    )


def _wrong_length(path: KeyPath, value: object, schema: Schema) -> Finding:
    count = len(value) if isinstance(value, tuple | str) else 0
    return Finding(path, f"{count} elements", quoted(value), expectation(schema))


# --- the schema beside the data -------------------------------------------------------------------


@cache
def _case_schema() -> Schema:
    return Case.model_json_schema()


def _resolved(schema: Schema) -> Schema:
    while "$ref" in schema:
        schema = _case_schema()["$defs"][schema["$ref"].rsplit("/", 1)[-1]]
    # An optional value, `X | None`, is meant as X.
    choices = [s for s in schema.get("anyOf", ()) if s.get("type") != "null"]
    return _resolved(choices[0]) if len(choices) == 1 else schema


def _tags(schema: Schema) -> list[str]:
    return sorted(schema.get("discriminator", {}).get("mapping", {}))


def _child(schema: Schema, part: str | int) -> Schema:
    """Schema of a member; `part` is a key, an index, or the tag of a union's branch."""
    if part in _tags(schema):
        return _resolved({"$ref": schema["discriminator"]["mapping"][part]})
    if isinstance(part, int):
        prefix = schema.get("prefixItems", ())
        items = prefix[part] if part < len(prefix) else schema.get("items", {})
        return _resolved(items) if isinstance(items, dict) else {}
    known = schema.get("properties", {}).get(part)
    if known is None:
        known = schema.get("additionalProperties") or next(
            iter(schema.get("patternProperties", {}).values()), {}
        )
    return _resolved(known) if isinstance(known, dict) else {}


def _located(loc: tuple[str | int, ...], document: dict[str, object]) -> tuple[KeyPath, Schema]:
    """The key path of the file for pydantic's `loc`, and the schema of what is there.

    For a key that is missing or unknown the schema is the one of the table around it.
    """
    path: list[str | int] = []
    schema: Schema = _resolved(_case_schema())
    around = schema
    for part in loc:
        if part == "[key]":
            continue
        around, tags = schema, _tags(schema)
        schema = _child(schema, part)
        if part not in tags:
            path.append(part)
    absent = value_at(document, tuple(path)) is None
    unknown = bool(path) and isinstance(path[-1], str) and not schema
    return tuple(path), around if absent or unknown else schema


# --- what was expected ----------------------------------------------------------------------------


def expectation(schema: Schema) -> str | None:
    """What a schema accepts, in a few words; None where there is nothing short to say."""
    schema = _resolved(schema)
    if "const" in schema:
        return quoted(schema["const"])
    if "enum" in schema:
        return _alternatives([str(word) for word in schema["enum"]])
    match schema.get("type"):
        case "number" | "integer" as kind:
            bounds = _bounds(schema)
            noun = "an integer" if kind == "integer" else "a number"
            return f"{noun} {' and '.join(bounds)}" if bounds else noun
        case "string":
            return str(schema.get("description", "a text"))
        case "boolean":
            return "true or false"
        case "array":
            return _array_expectation(schema)
        case "object":
            return "a table"
    tags = _tags(schema)
    return f"a table of type {_alternatives(tags)}" if tags else None


def _array_expectation(schema: Schema) -> str:
    prefix = schema.get("prefixItems")
    if prefix:
        kinds = {_resolved(item).get("type") for item in prefix}
        noun = {frozenset({"number"}): "numbers", frozenset({"integer"}): "integers"}
        return f"an array of {len(prefix)} {noun.get(frozenset(map(str, kinds)), 'elements')}"
    least = schema.get("minItems")
    most = schema.get("maxItems")
    if least and most:
        return f"an array of {least} to {most} elements"
    return f"an array of at least {least}" if least else "an array"


def _bounds(schema: Schema) -> list[str]:
    signs = {"exclusiveMinimum": ">", "minimum": "≥", "exclusiveMaximum": "<", "maximum": "≤"}
    return [f"{sign} {schema[key]:g}" for key, sign in signs.items() if key in schema]


def _words(schema: Schema, expected: str) -> list[str]:
    words = schema.get("enum", [schema["const"]] if "const" in schema else [])
    return [str(word) for word in words] or [expected]


def _alternatives(words: list[str]) -> str:
    if len(words) <= 1:
        return "".join(words)
    return ", ".join(words[:-1]) + " or " + words[-1]
