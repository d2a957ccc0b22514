"""POV-Ray as a process: what it is given, what it says, how it fails."""

from __future__ import annotations

import base64
import shutil
import subprocess
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from harness.errors import RendererFailed, RendererMissing, RendererUnsupported
from harness.renderers.base import Capability, Image, Renderer, RenderSettings
from harness.renderers.povray import INSTALL, PovRayRenderer, messages
from harness.renderers.process_tree import Running, belong_to
from harness.scene import resolved as rs
from harness.translate.povray import PovScene, options, translate
from tests.harness.povray_measure import SETTINGS, images, needs_povray, with_transport
from tests.harness.povray_scenes import camera, make_scene, rectangle

pytestmark = [pytest.mark.povray, needs_povray]

TEXELS = np.arange(36, dtype="<u2").reshape(3, 4, 3) * 1800
PICTURE = rs.Picture(width=4, height=3, pixels=base64.b64encode(TEXELS.tobytes()).decode())
SIMPLE = make_scene(
    camera((0, 0, 6), (0, 0, 0), 25),
    solids=[(rs.Sphere(center=(0, 0, 0), radius=1), 1, 0)],
    surfaces=[(rectangle((0.1, 0, -3), (16, 16)), rs.Emissive(pattern=PICTURE))],
)


def test_it_is_a_renderer() -> None:
    renderer: Renderer = PovRayRenderer()
    assert isinstance(renderer, Renderer)
    assert Capability.THIN_SLAB not in renderer.capabilities
    assert renderer.version().startswith("3.")
    health = renderer.health()
    assert health.usable, health
    assert Path(health.path).is_file()


def test_the_emitted_scene_runs_by_itself(tmp_path: Path) -> None:
    main = PovRayRenderer().emit(SIMPLE, tmp_path / "scene")
    assert main.name == "scene.pov"
    subprocess.run(["povray", "scene.ini"], cwd=main.parent, check=True, capture_output=True)
    stored = (main.parent / "image.ppm").read_bytes()[-96 * 64 * 6 :]
    pixels = np.frombuffer(stored, ">u2").reshape(-1, 3) / 65535
    assert np.abs(pixels - images(SIMPLE)[0]).max() < 1e-6


def test_threads_do_not_matter() -> None:
    one, many = (
        PovRayRenderer().render(SIMPLE, RenderSettings(threads=threads)) for threads in (1, 4)
    )
    assert (one.pixels == many.pixels).all()
    assert one.command == "povray scene.ini +WT1"
    assert one.pixels.dtype == np.float32
    assert one.pixels.shape == (64, 96, 3)
    assert 0 <= one.seconds < 60


def rewritten(monkeypatch: pytest.MonkeyPatch, old: str, new: str) -> None:
    """From now on the translator writes `new` for `old`."""

    def changed(scene: rs.ResolvedScene) -> PovScene:
        made = translate(scene)
        assert old in made.sdl
        return PovScene(
            made.sdl.replace(old, new), made.attachments, made.exposure, made.length_scale
        )

    monkeypatch.setattr(PovRayRenderer, "translate", staticmethod(changed))


def test_warnings_reach_the_log(monkeypatch: pytest.MonkeyPatch) -> None:
    rewritten(monkeypatch, "max_trace_level 20", "max_trace_level 400")
    image: Image = PovRayRenderer().render(SIMPLE, SETTINGS)
    assert " ".join(image.log.split()) == (
        "File 'scene.pov' line 7: Parse Warning: Maximum max_trace_level is 256 but 400 was "
        "specified. Going to use max_trace_level 256."
    )


def test_parse_errors_are_told_word_for_word(monkeypatch: pytest.MonkeyPatch) -> None:
    rewritten(monkeypatch, "ior 1.5", "ior 1.5 nonsense")
    with pytest.raises(RendererFailed, match="undeclared identifier 'nonsense'") as caught:
        PovRayRenderer().render(SIMPLE, SETTINGS)
    assert "Parse Error: No matching } in 'interior'" in " ".join(str(caught.value).split())
    assert caught.value.log.startswith("File 'scene.pov' line ")
    assert "Copyright" not in caught.value.log


def test_an_image_that_is_not_written_is_a_failure(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "harness.renderers.povray.options", lambda scene: options(scene) + "Output_To_File=Off\n"
    )
    with pytest.raises(RendererFailed, match="no image"):
        PovRayRenderer().render(SIMPLE, SETTINGS)


def test_eight_bits_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "harness.renderers.povray.options", lambda scene: options(scene) + "Bits_Per_Color=8\n"
    )
    with pytest.raises(RendererFailed, match="8 bits"):
        PovRayRenderer().render(SIMPLE, SETTINGS)


def test_time_is_limited() -> None:
    with pytest.raises(RendererFailed, match=r"0\.01 s"):
        PovRayRenderer().render(SIMPLE, RenderSettings(timeout_s=0.01))


def test_it_says_where_256_levels_are_not_enough() -> None:
    """Between two parallel mirrors light goes on for ever, as far as it is let."""
    mirrors = [
        (rectangle((0, 0, z), (1e4, 1e4), z=(0, 0, -z)), rs.Mirror(reflectance=(1, 1, 1)))
        for z in (-1, 1)
    ]
    scene = make_scene(camera((0, 0, 0), (0, 0.1, -1), 10), surfaces=mirrors, depth=256)
    images(scene)
    with pytest.raises(RendererUnsupported, match=r"max_depth asks for 257"):
        PovRayRenderer().render(with_transport(scene, max_depth=257), SETTINGS)


def test_missing() -> None:
    renderer = PovRayRenderer("snellcheck-no-such-program")
    for ask in (renderer.version, lambda: renderer.render(SIMPLE, SETTINGS)):
        with pytest.raises(RendererMissing, match="install povray"):
            ask()
    health = renderer.health()
    assert not health.usable
    assert health.remedy == INSTALL


def test_too_old(tmp_path: Path) -> None:
    old = tmp_path / "povray"
    old.write_text("#!/bin/sh\necho 'POV-Ray 3.6.1' >&2\n")
    old.chmod(0o755)
    with pytest.raises(RendererMissing, match=r"POV-Ray 3\.6\.1 is too old"):
        PovRayRenderer(str(old)).version()


def test_a_machine_too_busy_for_its_threads_is_asked_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It gives them two seconds; 1 of 3,000 renders did not get them where eight ran at a time."""
    monkeypatch.setattr("harness.renderers.process_tree.PAUSES_S", (0.001,))
    busy = tmp_path / "povray"
    busy.write_text(
        "#!/bin/sh\nif [ ! -e asked ]; then touch asked\n"
        "echo 'Timed out waiting for worker thread startup' >&2; exit 1; fi\n"
        f'exec {shutil.which("povray")} "$@"\n'
    )
    busy.chmod(0o755)
    running = Running()

    def attempt() -> Image:
        belong_to(running)
        return PovRayRenderer(str(busy)).render(SIMPLE, SETTINGS)

    with ThreadPoolExecutor(1) as pool:
        image = pool.submit(attempt).result()
    assert (image.pixels.reshape(-1, 3) == images(SIMPLE)[0]).all()
    assert (image.log, running.retried) == ("", 1)


def test_its_banner_is_no_message(tmp_path: Path) -> None:
    """Not even where the scene is parsed so soon that the front end never says that it is."""
    folder = PovRayRenderer().emit(SIMPLE, tmp_path / "scene").parent
    run = ["povray", "scene.ini"]
    said = subprocess.run(run, cwd=folder, check=True, capture_output=True, text=True).stderr
    lines = said.splitlines(keepends=True)
    unseen = "".join(line for line in lines if not line.startswith("==== [Parsing"))
    for text in (said, unseen, said.replace("==== [Rendering", "Odd\n==== [Rendering")):
        left = [s for s in messages(text).splitlines() if "user configuration file" not in s]
        assert left == (["Odd"] if "Odd" in text else [])


def test_settings_of_the_user_do_not_count(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    personal = tmp_path / ".povray" / "3.7" / "povray.ini"
    personal.parent.mkdir(parents=True)
    personal.write_text("Antialias=On\nAntialias_Threshold=0\nGrayscale_Output=On\n")
    before = images(SIMPLE)[0]
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("POVINI", str(personal))
    assert (images(SIMPLE)[0] == before).all()
