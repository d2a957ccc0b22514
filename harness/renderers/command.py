"""Any executable as a renderer: it is given scene.json and writes an image."""

from __future__ import annotations

import hashlib
import os
import re
import shlex
import shutil
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from harness.cores import core_count
from harness.errors import InputError, RendererError, RendererFailed, RendererMissing, nearest
from harness.fingerprint import code_digest, combined, file_digest
from harness.imagefile import Encoding
from harness.renderers.base import Capability, Health, Image, RenderSettings
from harness.renderers.confinement import PRIVATE_ALONE, Confinement
from harness.renderers.delivery import delivered, described
from harness.renderers.needs import require
from harness.renderers.process import run_limited, tail
from harness.renderers.proof import proof_scene, prove
from harness.scene.resolved import ResolvedScene
from harness.temporary import temporary_folder

ImageFormat = Literal["exr", "pfm", "npy", "png", "ppm"]

# What a renderer is taken to claim that does not say. RAYS and MAIN_WAY need the persistent
# protocol; the others are rare, and wrongly assumed they would spoil measurements rather than fail
# them.
USUAL_CLAIMS = frozenset(Capability) - {
    Capability.RAYS,
    Capability.MAIN_WAY,
    Capability.DOUBLE,
    Capability.DOUBLE_DATA,
    Capability.LOBE_SWITCH,
    Capability.THIN_SLAB,
    Capability.HALF_SPACE,
    Capability.PLANE,
    Capability.PRIORITY,
    Capability.ENVIRONMENT,
    Capability.SAMPLING,
    Capability.RADIANCE_N2,
}

_PLACEHOLDER = re.compile(r"\{(\w+)\}")
_PLACEHOLDERS = ("scene", "output", "width", "height", "samples", "seed", "threads", "python")


@dataclass(frozen=True)
class Template:
    """A command line with placeholders, split as a shell would split it; there is no shell."""

    words: tuple[str, ...]

    @classmethod
    def parse(
        cls,
        text: str,
        *,
        known: tuple[str, ...] = _PLACEHOLDERS,
        needs: tuple[str, ...] = ("scene", "output"),
    ) -> Template:
        """Raises InputError where `text` is no command line or its placeholders are not right."""
        try:
            words = tuple(shlex.split(text))
        except ValueError as error:
            message = f"not a command line: {error}"
            raise InputError.of(message, key="command", value=text) from error
        if not words:
            raise InputError.of("an empty command", key="command")
        used = {name for word in words for name in _PLACEHOLDER.findall(word)}
        for name in sorted(used - set(known)):
            raise InputError.of(
                "unknown placeholder in the command",
                key="command",
                value=f"{{{name}}}",
                expected="one of " + ", ".join(f"{{{one}}}" for one in known),
                suggestion=nearest(name, known),
            )
        for name in needs:
            if name not in used:
                message = f"the command does not say where {{{name}}} goes"
                expected = "something like mytracer {scene} {output}"
                raise InputError.of(message, key="command", value=text, expected=expected)
        return cls(words)

    def fill(self, values: Mapping[str, object]) -> list[str]:
        """The arguments, each placeholder replaced within its own word."""
        every = {"python": sys.executable, **values}
        return [_PLACEHOLDER.sub(lambda found: str(every[found[1]]), w) for w in self.words]

    def constants(self) -> list[str]:
        """The arguments that are the same for all images."""
        per_image = set(_PLACEHOLDERS) - {"python"}
        fixed = [w for w in self.words if not per_image & set(_PLACEHOLDER.findall(w))]
        return Template(tuple(fixed)).fill({})

    def program(self) -> str:
        """What does the work: the script, where the command runs one by an interpreter."""
        first, *others = self.constants() or self.words
        interpreted = re.fullmatch(r"(python|node|ruby|perl|julia|bash|sh)[\d.]*", Path(first).name)
        scripts = [word for word in others if not word.startswith("-")]
        return scripts[0] if interpreted and scripts else first


class CommandRenderer:
    """Runs `template` in `folder` for every image, with files in a private temporary folder.

    `encoding` is what integer values in an image mean, where the file itself does not say.
    Without a declared `version` it is the hash of the files that the command names, so that a
    changed program is another version. `depends` are globs of all files that decide its images;
    only where they are given are images kept from run to run. `confinement` says what it may touch
    beside that temporary folder.
    """

    # A small renderer uses one core.
    concurrency = core_count()

    def __init__(
        self,
        name: str,
        template: Template,
        folder: Path,
        *,
        image_format: ImageFormat = "exr",
        encoding: Encoding | None = None,
        capabilities: frozenset[Capability] = USUAL_CLAIMS,
        version: str = "",
        depends: tuple[str, ...] = (),
        confinement: Confinement = PRIVATE_ALONE,
    ) -> None:
        self._depends = depends
        self._confinement = confinement
        self._name = name
        self._template = template
        self._folder = folder
        self._image_format = image_format
        self._encoding = encoding
        self._capabilities = capabilities
        self._version = version

    @property
    def name(self) -> str:
        return self._name

    @property
    def capabilities(self) -> frozenset[Capability]:
        return self._capabilities

    def version(self) -> str:
        """Raises RendererMissing where the executable cannot be found."""
        found = program_version(self._template.constants(), self._folder)
        return self._version or found

    def fingerprint(self) -> str | None:
        """The content of the program and of all that it `depends` on, as far as that was told."""
        return command_fingerprint(self._template.constants(), self._folder, self._depends)

    def render(self, scene: ResolvedScene, settings: RenderSettings) -> Image:
        """Raises RendererMissing, RendererUnsupported or RendererFailed."""
        require(scene, self.name, self.capabilities)
        with (
            self._confinement.explained(),
            temporary_folder() as private,
        ):
            output = Path(private) / f"image.{self._image_format}"
            scene_file = self.emit(scene, Path(private))
            values = {
                "scene": scene_file,
                "output": output,
                "width": scene.film.width,
                "height": scene.film.height,
                "samples": settings.samples,
                "seed": settings.seed,
                "threads": settings.threads,
            }
            done = run_limited(
                self._template.fill(values),
                cwd=self._folder,
                timeout_s=settings.timeout_s,
                memory_mb=settings.memory_mb,
                private=Path(private),
                confinement=self._confinement,
                env={**os.environ, "TMPDIR": private},
            )
            log = tail(done.stderr.strip() or done.stdout)
            if done.returncode != 0:
                raise RendererFailed(f"ended with exit code {done.returncode}", log=log)
            pixels, info = delivered(output, scene.film, log=log, encoding=self._encoding)
        shown = values | {"scene": scene_file.name, "output": output.name}
        return Image(
            pixels,
            seconds=done.wall_s,
            log="\n".join(filter(None, (log, described(info)))),
            command=shlex.join(self._template.fill(shown)),
        )

    def health(self) -> Health:
        """Probes with a tiny render. Never raises."""
        version = ""
        try:
            version = self.version()
            prove(self.render(proof_scene(self.capabilities), RenderSettings(timeout_s=30)))
        except RendererError as error:
            detail = " ".join([str(error), *error.log.splitlines()[-1:]])
            return Health(self.name, usable=False, version=version, detail=detail)
        except OSError as error:
            return Health(self.name, usable=False, version=version, detail=str(error))
        return Health(self.name, usable=True, version=version, path=str(self._folder))

    def emit(self, scene: ResolvedScene, folder: Path) -> Path:
        """Writes scene.json, which is all that the program is given."""
        folder.mkdir(parents=True, exist_ok=True)
        path = folder / "scene.json"
        path.write_text(scene.model_dump_json(), encoding="utf-8")
        return path


def command_fingerprint(words: list[str], folder: Path, depends: Sequence[str]) -> str | None:
    """The content of what a command runs and of the files in `folder` that `depends` selects.

    None where nothing was said of what the command depends on, or where it does not exist.
    """
    if not depends:
        return None
    try:
        program = program_version(words, folder)
    except RendererMissing:
        return None
    files = sorted({path for glob in depends for path in folder.glob(glob) if path.is_file()})
    contents = [f"{path.relative_to(folder)} {file_digest(path)}" for path in files]
    return combined(code_digest(__name__), program, *words, *contents)


def program_version(words: list[str], folder: Path) -> str:
    """The hash of the executable and of all files among its arguments.

    Raises RendererMissing where the executable cannot be found from `folder`.
    """
    program = words[0]
    found = folder / program if os.sep in program else Path(shutil.which(program) or "")
    if not found.is_file():
        raise RendererMissing(f"cannot find the program {program!r}")
    digest = hashlib.sha256()
    for path in [found, *(folder / word for word in words[1:] if word)]:
        if path.is_file():
            digest.update(hashlib.sha256(path.read_bytes()).digest())
    return f"sha256:{digest.hexdigest()[:12]}"
