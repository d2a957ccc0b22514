"""What users write of renderers of their own: a command line, or snellcheck-renderer.toml."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated, Any, get_args

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from harness.errors import InputError, nearest
from harness.imagefile import Encoding
from harness.renderers.base import Capability, Renderer
from harness.renderers.command import (
    USUAL_CLAIMS,
    CommandRenderer,
    ImageFormat,
    Template,
    command_fingerprint,
)
from harness.renderers.confinement import Confinement
from harness.renderers.persistent import Program, WorkerRenderer
from harness.scene.document import parse_document, read_source
from harness.scene.findings import Finding, input_error, quoted

FORMATS = get_args(ImageFormat)


class RendererTable(BaseModel):
    """The [renderer] table.

    With `persistent` the program stays alive and speaks the worker protocol; otherwise it is run
    once for each image. Either way it is run in the folder of the file, from which `writable` paths
    count, too: what it may write to beside the folder of its image.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]{0,63}$")]
    command: str
    format: ImageFormat = "exr"
    encoding: Encoding | None = None
    capabilities: list[Annotated[Capability, Field(strict=False)]] | None = None
    persistent: bool = False
    version: str = ""
    depends: list[str] = []
    writable: list[str] = []
    network: bool = False


def renderer_from_file(path: Path) -> Renderer:
    """The renderer that `path` describes. Raises InputError with all that is wrong with it."""
    document = parse_document(read_source(path), path)
    findings = [_unknown((key,), ["renderer"]) for key in document if key != "renderer"]
    if "renderer" not in document:
        findings = findings or [Finding(("renderer",), "missing", None, "a table [renderer]")]
        raise input_error(findings, path)
    try:
        table = RendererTable.model_validate(document["renderer"])
    except ValidationError as error:
        findings += map(_finding, error.errors())
    if findings:
        raise input_error(findings, path)
    try:
        return _renderer(table, path.resolve().parent)
    except InputError as error:
        found = error.problems[0]
        more = (found.value, found.expected, found.suggestion)
        finding = Finding(("renderer", found.key), found.message, *more)
        raise input_error([finding], path) from error


def renderer_from_command(text: str, folder: Path) -> Renderer:
    """The renderer of a command line like ``mytracer {scene} {output}``, run in `folder`.

    ``{output.png}`` in place of ``{output}`` asks for that format; without it, it is EXR. The
    renderer is named after the program. Raises InputError.
    """
    formats = {found[1] for found in re.finditer(r"\{output\.(\w+)\}", text)} or {"exr"}
    if len(formats) > 1 or not formats <= set(FORMATS):
        value = ", ".join(sorted(formats))
        expected = "one of " + ", ".join(FORMATS)
        raise InputError.of("unknown image format", key="command", value=value, expected=expected)
    template = Template.parse(re.sub(r"\{output\.\w+\}", "{output}", text))
    image_format = next(one for one in FORMATS if one in formats)
    name = re.sub(r"[^A-Za-z0-9_.-]+", "-", Path(template.program()).stem)
    return CommandRenderer(name, template, folder, image_format=image_format)


def _renderer(table: RendererTable, folder: Path) -> Renderer:
    claims = None if table.capabilities is None else frozenset(table.capabilities)
    confinement = Confinement(_paths(table.writable, folder), network=table.network)
    if not table.persistent:
        return CommandRenderer(
            table.name,
            Template.parse(table.command),
            folder,
            image_format=table.format,
            encoding=table.encoding,
            capabilities=USUAL_CLAIMS if claims is None else claims,
            version=table.version,
            depends=tuple(table.depends),
            confinement=confinement,
        )
    template = Template.parse(table.command, needs=(), known=("python",))
    argv = tuple(template.fill({}))
    program = Program(argv, folder, table.format, table.encoding, confinement=confinement)
    return WorkerRenderer(
        table.name, program, capabilities=claims,
        fingerprint=lambda: command_fingerprint(list(program.argv), folder, table.depends),
    )  # fmt: skip


def _paths(texts: list[str], folder: Path) -> tuple[Path, ...]:
    """The files and folders named, seen from `folder`. Raises InputError where one is not there."""
    paths = [folder / Path(text).expanduser() for text in texts]
    for text, path in zip(texts, paths, strict=True):
        if not path.exists():
            expected = f"a file or folder, seen from {folder}"
            raise InputError.of("is not there", key="writable", value=text, expected=expected)
    return tuple(paths)


def _finding(details: Any) -> Finding:
    """What pydantic found, in our words."""
    path, kind, value = ("renderer", *details["loc"]), details["type"], quoted(details["input"])
    if kind == "extra_forbidden":
        return _unknown(path, list(RendererTable.model_fields))
    if kind == "missing":
        return Finding(path, "missing")
    if kind == "enum":
        return _unknown_word(path, details["input"], [str(c) for c in Capability])
    if kind == "literal_error":
        words = FORMATS if path[-1] == "format" else get_args(Encoding)
        return _unknown_word(path, details["input"], list(words))
    return Finding(path, details["msg"], value)


def _unknown(path: tuple[str | int, ...], known: list[str]) -> Finding:
    expected = "one of " + ", ".join(known)
    return Finding(path, "unknown key", None, expected, nearest(str(path[-1]), known))


def _unknown_word(path: tuple[str | int, ...], value: object, known: list[str]) -> Finding:
    suggestion = nearest(value, known) if isinstance(value, str) else None
    expected = "one of " + ", ".join(known)
    return Finding(path, "unknown word", quoted(value), expected, suggestion)
