"""Any executable renders, and one that does not is one clear error."""

from __future__ import annotations

import json
import shlex
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from harness.errors import InputError, RendererFailed, RendererMissing, RendererUnsupported
from harness.renderers.base import Capability, Renderer, RenderSettings
from harness.renderers.command import USUAL_CLAIMS, CommandRenderer, Template
from harness.renderers.command_file import renderer_from_command, renderer_from_file
from harness.renderers.confinement import Confinement
from harness.renderers.persistent import WorkerRenderer
from harness.renderers.proof import proof_scene
from tests.fakes import MISBEHAVE

SCENE = proof_scene(frozenset())
PYTHON = shlex.quote(sys.executable)


def misbehave(mode: str) -> CommandRenderer:
    template = Template.parse(f"{PYTHON} {shlex.quote(str(MISBEHAVE))} {mode} {{scene}} {{output}}")
    return CommandRenderer("fake", template, Path.cwd(), image_format="npy")


# --- command lines --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "empty command"),
        ("mine 'unclosed", "not a command line: No closing quotation"),
        ("mine {scene}", "does not say where {output} goes"),
        ("mine {output}", "does not say where {scene} goes"),
        ("mine {scene} {outptu}", "got {outptu}; expected one of {scene}"),
        ("mine {scene} {outptu}", "did you mean output?"),
    ],
)
def test_bad_command_lines(text: str, message: str) -> None:
    with pytest.raises(InputError) as caught:
        Template.parse(text)
    assert message in str(caught.value)


def test_placeholders_are_filled_word_by_word() -> None:
    template = Template.parse("'my tracer' -i={scene} -o {output} -w{width} '{}' {python}")
    values = {"scene": "a b; $(c)", "output": "{scene}", "width": 7}
    words = ["my tracer", "-i=a b; $(c)", "-o", "{scene}", "-w7", "{}", sys.executable]
    assert template.fill(values) == words


@pytest.mark.parametrize(
    ("text", "name", "image"),
    [
        ("./my-tracer {scene} {output}", "my-tracer", "image.exr"),
        ("/opt/t/Trace.bin --in {scene} --out={output.pfm}", "Trace", "image.pfm"),
        ("python3.11 -u tools/student.py {scene} {output.png}", "student", "image.png"),
        ("{python} student.py {scene} {output.npy}", "student", "image.npy"),
        ("'a b' {scene} {output}", "a-b", "image.exr"),
    ],
)
def test_name_and_format_of_a_command(text: str, name: str, image: str, tmp_path: Path) -> None:
    renderer = renderer_from_command(text, tmp_path)
    assert renderer.name == name
    assert isinstance(renderer, CommandRenderer)
    assert f"image.{renderer._image_format}" == image


@pytest.mark.parametrize("text", ["a {scene} {output.tiff}", "a {scene} {output.png} {output.exr}"])
def test_unknown_format_of_a_command(text: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="unknown image format"):
        renderer_from_command(text, tmp_path)


# --- rendering ------------------------------------------------------------------------------------


def test_a_good_command() -> None:
    renderer = misbehave("good")
    assert isinstance(renderer, Renderer)
    image = renderer.render(SCENE, RenderSettings())
    assert np.array_equal(image.pixels, np.full((8, 8, 3), 0.25, np.float32))
    assert image.seconds > 0
    assert image.command.endswith("misbehave.py good scene.json image.npy")


RECORDER = """
import json, os, sys
from pathlib import Path
output = Path(sys.argv[2])
seen = {"argv": sys.argv[1:], "cwd": os.getcwd(), "tmp": os.environ["TMPDIR"],
        "scene": json.loads(Path(sys.argv[1]).read_text())["format"]}
Path("seen.json").write_text(json.dumps(seen))
size = [int(x) for x in sys.argv[3:5]]
output.write_bytes(b"P6 %d %d 255\\n" % tuple(size) + bytes([188]) * (3 * size[0] * size[1]))
print("wrote it")
"""


def test_what_a_command_is_given(tmp_path: Path) -> None:
    (tmp_path / "rec.py").write_text(RECORDER)
    template = Template.parse(
        "{python} rec.py {scene} {output} {width} {height} {samples} {seed} {threads}"
    )
    opened = Confinement(writable=(tmp_path,))
    renderer = CommandRenderer(
        "rec", template, tmp_path, image_format="ppm", confinement=opened
    )  # fmt: skip
    image = renderer.render(SCENE, RenderSettings(samples=3, seed=5, threads=1))
    seen = json.loads((tmp_path / "seen.json").read_text())
    assert seen["argv"][2:] == ["8", "8", "3", "5", "1"]
    assert seen["cwd"] == str(tmp_path)
    assert seen["scene"] == "snellcheck-scene"
    private = Path(seen["tmp"])
    assert Path(seen["argv"][0]).parent == Path(seen["argv"][1]).parent == private
    assert not private.exists()
    assert image.log == "wrote it\nthe image came as PPM of 8 bits, srgb (assumed)"
    # IEC 61966-2-1
    assert image.pixels[0, 0, 0] == np.float32(((188 / 255 + 0.055) / 1.055) ** 2.4)


@pytest.mark.parametrize(
    ("mode", "message", "log"),
    [
        ("crash", "ended with exit code 3", "something is very wrong"),
        ("abort", "ended by signal SIGABRT", "LLVM ERROR"),
        ("truncated", "wrote an unusable image: the image is truncated", ""),
        ("huge", "wrong image size; got 1000000 x 1000000; expected 8 x 8", ""),
        ("wrong-size", "wrong image size; got 9 x 8; expected 8 x 8", ""),
        ("wrong-type", "wrong type of values; got object", ""),
        ("text", "not an image", ""),
        ("pipe", "wrote something else than a file as its image", ""),
        ("link", "wrote something else than a file as its image", ""),
        ("nan", "wrote NaN or infinity in 1 pixels", ""),
        ("none", "wrote no image", "done"),
        ("leak", "more than 200 MB of memory", ""),
    ],
)
def test_misbehaviour(mode: str, message: str, log: str) -> None:
    settings = RenderSettings(memory_mb=200, timeout_s=20)
    with pytest.raises(RendererFailed) as caught:
        misbehave(mode).render(SCENE, settings)
    assert message in str(caught.value)
    assert log in caught.value.log
    assert "snellcheck-" not in str(caught.value)  # no temporary names
    assert misbehave("good").render(SCENE, settings).pixels[0, 0, 0] == 0.25


def test_a_hang_ends_in_time() -> None:
    started = time.monotonic()
    with pytest.raises(RendererFailed, match="not done after 1 s"):
        misbehave("hang").render(SCENE, RenderSettings(timeout_s=1))
    assert time.monotonic() - started < 3


def test_unsupported_and_missing(tmp_path: Path) -> None:
    template = Template.parse("snellcheck-no-such {scene} {output}")
    renderer = CommandRenderer("fake", template, tmp_path, capabilities=frozenset())
    with pytest.raises(RendererUnsupported, match="does not claim"):
        renderer.render(proof_scene(USUAL_CLAIMS), RenderSettings())
    with pytest.raises(RendererMissing):
        renderer.render(SCENE, RenderSettings())
    with pytest.raises(RendererMissing):
        renderer.version()
    health = renderer.health()
    assert not health.usable
    assert "snellcheck-no-such" in health.detail


def test_version_follows_the_program(tmp_path: Path) -> None:
    script = tmp_path / "mine.py"
    script.write_text("print(1)")
    renderer = renderer_from_command("{python} mine.py {scene} {output}", tmp_path)
    first = renderer.version()
    assert first.startswith("sha256:")
    assert renderer.version() == first
    script.write_text("print(2)")
    assert renderer.version() != first


# --- snellcheck-renderer.toml ---------------------------------------------------------------------


def write(folder: Path, text: str) -> Path:
    path = folder / "snellcheck-renderer.toml"
    path.write_text(text)
    return path


def test_a_full_file(tmp_path: Path) -> None:
    path = write(
        tmp_path,
        """
[renderer]
name = "mine"
command = "{python} mine.py {scene} {output}"
format = "png"
encoding = "linear"
capabilities = ["image", "sphere", "lobe-switch"]
version = "7"
""",
    )
    (tmp_path / "mine.py").write_text("")
    renderer = renderer_from_file(path)
    assert renderer.name == "mine"
    assert renderer.capabilities == {"image", "sphere", "lobe-switch"}
    assert renderer.version() == "7"


def test_a_short_file_claims_the_usual(tmp_path: Path) -> None:
    path = write(tmp_path, '[renderer]\nname = "mine"\ncommand = "a {scene} {output}"\n')
    capabilities = renderer_from_file(path).capabilities
    assert capabilities == USUAL_CLAIMS
    assert Capability.SPHERE in capabilities
    assert Capability.RAYS not in capabilities


def test_a_persistent_renderer(tmp_path: Path) -> None:
    path = write(
        tmp_path,
        f"""
[renderer]
name = "mine"
command = '{{python}} {MISBEHAVE} --persistent good'
format = "npy"
persistent = true
capabilities = ["sphere", "fresnel"]
""",
    )
    renderer = renderer_from_file(path)
    assert isinstance(renderer, WorkerRenderer)
    assert renderer.render(proof_scene(USUAL_CLAIMS), RenderSettings()).pixels[0, 0, 0] == 0.25
    renderer.close()


GOOD = 'name = "a"\ncommand = "a {scene} {output}"\n'


@pytest.mark.parametrize(
    ("text", "messages"),
    [
        ("[renderer\n", ["toml:1: not valid TOML"]),
        ("[rendrer]\n" + GOOD, ["toml:1: rendrer: unknown key", "did you mean renderer?"]),
        ("", ["renderer: missing; expected a table [renderer]"]),
        ("renderer = 1", ["toml:1: renderer"]),
        ("[renderer]\n", ["renderer.name: missing", "renderer.command: missing"]),
        (
            f"[renderer]\n{GOOD}fromat = 'exr'\n",
            ["toml:4: renderer.fromat: unknown key", "format?"],
        ),
        (
            f"[renderer]\n{GOOD}format = 'tif'\n",
            ['toml:4: renderer.format: unknown word; got "tif"'],
        ),
        (f"[renderer]\n{GOOD}encoding = 'RGB'\n", ["toml:4: renderer.encoding", "linear, srgb"]),
        (
            f"[renderer]\n{GOOD}capabilities = ['mesh',\n 'sphear']\n",
            ["toml:5: renderer.capabilities[1]: unknown word", "did you mean sphere?"],
        ),
        (f"[renderer]\n{GOOD}persistent = 'yes'\n", ["toml:4: renderer.persistent"]),
        (
            f"[renderer]\n{GOOD}persistent = true\n",
            ["toml:3: renderer.command: unknown placeholder"],
        ),
        (
            "[renderer]\nname = 'a'\ncommand = 'a {scene}'\n",
            ["toml:3: renderer.command: the command"],
        ),
        ("[renderer]\nname = '../a'\ncommand = 'a'\n", ["toml:2: renderer.name"]),
    ],
)
def test_bad_files(text: str, messages: list[str], tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught:
        renderer_from_file(write(tmp_path, text))
    for message in messages:
        assert message in str(caught.value)


def test_no_file(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="No such file"):
        renderer_from_file(tmp_path / "none.toml")
