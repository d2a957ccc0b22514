"""The command line as people and scripts use it: exit codes, files, and messages for mistakes."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import click
import pytest
from click.testing import CliRunner, Result

from harness import __version__, cli
from harness.errors import InputError, RendererFailed, RendererMissing, nearest
from harness.renderers import registry
from harness.renderers.base import Renderer
from harness.scene.resolved import ResolvedScene
from tests.fakes import FakeRenderer
from tests.fakes.student import CAPABILITIES, student
from tests.harness.test_run import Absent
from tests.harness.tiny import SCENES

Invoke = Callable[..., Result]

INVERTED = ("mu = ior_i / ior_t", "mu = ior_t / ior_i")
REGISTERED: dict[str, Callable[[], Renderer]] = {
    "tracer": lambda: student(name="tracer"),
    "student": student,
    "inverted": lambda: student(INVERTED, name="inverted"),
    "mirrored": lambda: student(name="mirrored", shows=lambda pixels: pixels[:, ::-1]),
    "crashing": lambda: FakeRenderer(
        "crashing", error=RendererFailed("it crashed", log="boom"), capabilities=CAPABILITIES
    ),
    "absent": lambda: Absent(RendererMissing("absent is not here: apt-get install absent")),
}


@pytest.fixture
def invoke(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Invoke:
    """The command line in an empty folder, with fakes registered as renderers."""

    def create(name: str, option: str = "--renderer", besides: tuple[str, ...] = ()) -> Renderer:
        if name not in REGISTERED:
            raise InputError.of(
                "unknown renderer", key=option, value=name,
                suggestion=nearest(name, [*REGISTERED, *besides]),
            )  # fmt: skip
        return REGISTERED[name]()

    monkeypatch.setattr(registry, "create", create)
    monkeypatch.setattr(registry, "available", lambda: {"tracer": REGISTERED["tracer"]})
    monkeypatch.chdir(tmp_path)

    def run(*arguments: str | Path) -> Result:
        result = CliRunner().invoke(cli.main, [str(argument) for argument in arguments])
        # Whatever happens ends as an exit code; anything else would be a traceback.
        assert result.exception is None or isinstance(result.exception, SystemExit), result
        assert "Traceback" not in result.output
        return result

    return run


def summary(folder: Path) -> dict[str, object]:
    return dict(json.loads((folder / "summary.json").read_text()))


def scenes_with(folder: Path, **replacements: str) -> Path:
    """A folder with one tiny scene in which texts are replaced."""
    text = (SCENES / "snell" / "sweep.toml").read_text()
    for old, new in replacements.items():
        assert old in text
        text = text.replace(old, new)
    (folder / "scenes" / "snell").mkdir(parents=True)
    (folder / "scenes" / "snell" / "sweep.toml").write_text(text)
    return folder / "scenes"


@pytest.mark.parametrize("name", cli.main.list_commands(click.Context(cli.main)))
def test_each_file_is_a_command_of_its_name(name: str, invoke: Invoke) -> None:
    assert cli.main.commands == {}, "a command belongs in a file of its own"
    result = invoke(name, "--help")
    assert result.exit_code == 0
    assert result.output.startswith(f"Usage: main {name} ")


def test_an_unknown_command_is_bad_usage(invoke: Invoke) -> None:
    result = invoke("rum")
    assert result.exit_code == 2
    assert "No such command 'rum'" in result.output


# --- run: exit codes ------------------------------------------------------------------------------


def test_a_green_run(invoke: Invoke, tmp_path: Path) -> None:
    result = invoke("run", "-r", "student", "--scenes", SCENES, "--out", "out")
    assert result.exit_code == 0
    assert "0 fail" in result.output
    out = tmp_path / "out"
    assert summary(out)["exit_code"] == 0
    assert (out / "index.html").is_file()
    assert str(Path("out") / "index.html") in result.output.replace("\n", "")
    assert len(list((out / "records").glob("*.json"))) == 7


def test_the_default_renderers_are_those_registered_and_the_default_place_is_reports(
    invoke: Invoke, tmp_path: Path
) -> None:
    assert invoke("run", "snell", "--scenes", SCENES).exit_code == 0
    assert set(summary(tmp_path / "reports" / "latest")["renderers"]) == {"tracer"}  # type: ignore[call-overload]


@pytest.mark.parametrize(
    ("names", "code"),
    [
        (["inverted"], 1),
        (["inverted", "student"], 1),
        (["inverted", "absent", "crashing"], 1),
        (["absent"], 3),
        (["crashing"], 3),
        (["mirrored"], 3),
        (["student", "absent"], 3),
        (["student", "crashing"], 3),
        (["student", "tracer"], 0),
    ],
)
def test_exit_codes_of_runs(names: list[str], code: int, invoke: Invoke, tmp_path: Path) -> None:
    options = [part for name in names for part in ("-r", name)]
    result = invoke("run", "snell", "slab", *options, "--scenes", SCENES, "--out", "out")
    assert result.exit_code == code
    assert summary(tmp_path / "out")["exit_code"] == code
    assert (tmp_path / "out" / "index.html").is_file()


def test_what_is_missing_is_named_with_the_command_that_installs_it(invoke: Invoke) -> None:
    result = invoke("run", "snell", "-r", "absent", "-r", "student", "--scenes", SCENES)
    assert "mend it with: apt-get install absent" in result.output
    assert "not installed" in result.output


def test_what_failed_is_named_with_its_reason(invoke: Invoke) -> None:
    result = invoke("run", "snell", "-r", "inverted", "-r", "mirrored", "--scenes", SCENES)
    flat = " ".join(result.output.split())
    assert "snell-sweep internal_angle(inside)/inverted/truth" in flat
    assert "image is mirrored in x" in flat


def test_a_renderer_of_ones_own(invoke: Invoke, tmp_path: Path) -> None:
    """Through the command-line interface that an outside executable has."""
    source = Path(__file__).parents[2] / "docs" / "bring-your-own-renderer" / "student.py"
    shutil.copy(source, tmp_path / "mine.py")
    result = invoke(
        "run", "snell", "-r", "tracer", "--scenes", SCENES, "--out", "out",
        "--renderer-command", "{python} mine.py {scene} {output.npy}",
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    renderers = summary(tmp_path / "out")["renderers"]
    assert set(renderers) == {"tracer", "mine"}  # type: ignore[call-overload]


@pytest.mark.skipif(sys.platform != "linux", reason="names of files are text there")
def test_names_of_files_need_not_be_text(
    invoke: Invoke, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A folder from times before UTF-8, or any at all in a locale without it."""
    out = os.fsdecode(b"caf\xe9")
    monkeypatch.setattr(sys, "argv", ["snellcheck", "run", "--out", out])
    result = invoke("run", "slab", "-r", "student", "--scenes", SCENES, "--out", out)
    assert result.exit_code == 0, result.output
    assert "caf\ufffd" in str(summary(tmp_path / out)["command"])
    reason = ("--reason", "measured", "--by", "me")
    assert invoke("approve", "*", "--run", out, *reason).exit_code == 0
    assert invoke("check", "--run", out).exit_code == 0


def test_jobs_and_seed_are_taken(invoke: Invoke, tmp_path: Path) -> None:
    result = invoke(
        "run", "snell", "-r", "student", "--scenes", SCENES, "--out", "out", "--jobs", "1",
        "--seed", "7", "--quality", "draft",
    )  # fmt: skip
    assert result.exit_code == 0
    (written,) = (tmp_path / "out" / "records").iterdir()
    settings = json.loads(written.read_text())["runs"][0]["settings"]
    assert (settings["threads"], settings["seed"], settings["samples"]) == (1, 7, 16)


# --- mistakes: exit code 2 and a message that helps -----------------------------------------------

MISTAKES: dict[str, tuple[list[str], str]] = {
    "unknown renderer": (["run", "-r", "studnet"], "did you mean student?"),
    "unknown case": (["run", "snel-sweep"], "did you mean snell-sweep?"),
    "unknown permutation": (
        ["run", "slab-offset[thickness=2]"], "did you mean slab-offset[thickness=1]?"
    ),
    "unknown option": (["run", "--rendrer", "x"], "No such option"),
    "unknown command": (["rnu"], "No such command 'rnu'"),
    "unknown quality": (["run", "--quality", "best"], "'draft', 'normal', 'high'"),
    "no scenes": (["run", "--scenes", "nowhere"], "nowhere"),
    "no cores": (["run", "--jobs", "0"], "--jobs"),
    "an empty command": (["run", "--renderer-command", ""], "an empty command"),
    "a command without output": (["run", "--renderer-command", "x {scene}"], "{output}"),
    "a missing config": (["run", "--renderer-config", "no.toml"], "no.toml"),
    "one renderer twice": (["run", "-r", "student", "-r", "student"], "student"),
    "show an unknown case": (["show", "snel-sweep"], "did you mean snell-sweep?"),
    "translate to nothing": (["translate", "snell-sweep", "--to", "povary"], "--to: "),
    "translate to almost json": (["translate", "snell-sweep", "--to", "jsn"], "mean json?"),
    "translate without a target": (["translate", "snell-sweep"], "--to"),
    "report on nothing": (["report", "nowhere"], "nowhere"),
    "list an unknown case": (["list", "blal"], "did you mean ball?"),
    "an unknown schema": (["schema", "--of", "world"], "'case', 'scene'"),
}  # fmt: skip


@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistakes(mistake: str, invoke: Invoke) -> None:
    arguments, said = MISTAKES[mistake]
    command = arguments[0]
    if command in ("run", "show", "translate", "list") and "--scenes" not in arguments:
        arguments = [*arguments, "--scenes", str(SCENES)]
    if command == "run" and "-r" not in arguments and "--renderer-command" not in arguments:
        arguments = [*arguments, "-r", "student"]
    result = invoke(*arguments)
    assert result.exit_code == 2, result.output
    assert said in result.output


def test_a_mistake_in_a_scene_is_named_by_file_line_and_key(invoke: Invoke, tmp_path: Path) -> None:
    scenes = scenes_with(tmp_path, **{"ior = 1.5": "ior = -1.5", "width = 16": "wdith = 16"})
    result = invoke("run", "-r", "student", "--scenes", scenes)
    assert result.exit_code == 2
    lines = [line for line in result.output.splitlines() if line]
    assert len(lines) == 2
    for said in ("sweep.toml:8: film.wdith", "did you mean width?"):
        assert said in result.output
    assert "media.glass.ior" in result.output
    assert "-1.5" in result.output
    assert not (tmp_path / "reports").exists()


@pytest.mark.parametrize("out", ["taken", "taken/below"])
def test_a_place_that_cannot_be_written_to_is_a_message(
    out: str, invoke: Invoke, tmp_path: Path
) -> None:
    (tmp_path / "taken").write_text("a file")
    result = invoke("run", "snell", "-r", "student", "--scenes", SCENES, "--out", out)
    assert result.exit_code == 2
    assert "taken" in result.output


def test_a_broken_summary_is_a_message(invoke: Invoke, tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "summary.json").write_text('{"schema": "snellcheck-summary/9"}')
    result = invoke("report", "out")
    assert result.exit_code == 2
    assert "summary.json" in result.output


# --- the other commands ---------------------------------------------------------------------------


def test_list_has_a_line_per_case(invoke: Invoke) -> None:
    lines = invoke("list", "--scenes", SCENES).output.splitlines()
    assert len(lines) == 7
    assert lines[2].split()[0] == "slab-offset[thickness=0.25]"


def test_list_as_json(invoke: Invoke) -> None:
    rows = json.loads(invoke("list", "slab", "--json", "--scenes", SCENES).output)
    assert [row["id"] for row in rows] == [
        "slab-offset[thickness=0.25]", "slab-offset[thickness=1]"
    ]  # fmt: skip
    assert rows[0]["parameters"] == {"thickness": 0.25}
    assert rows[0]["family"] == "slab"
    assert rows[0]["checks"] == ["slab_offset", "exit_direction", "exit_point"]
    assert Path(rows[0]["file"]).is_file()


def test_the_built_in_suite_loads(invoke: Invoke) -> None:
    rows = json.loads(invoke("list", "--json").output)
    families = {row["family"] for row in rows}
    assert {"snell", "slab", "thin-face", "tir", "prism", "fresnel", "absorption"} <= families
    assert {"ball", "polygon", "translucence", "package"} <= families


def test_show_tells_scene_truth_and_checks(invoke: Invoke) -> None:
    result = invoke("show", "snell-sweep", "--scenes", SCENES)
    assert result.exit_code == 0
    assert "theta_t = asin(sin(theta_i) / n)" in result.output
    assert "source: E. Hecht" in result.output
    assert "probe 'inside', path T: incidence" in result.output
    assert "rays: 32 hit" in result.output
    assert "check: internal_angle by probe 'inside' against truth" in result.output
    scene = result.output[result.output.index("{") :]
    assert ResolvedScene.model_validate_json(scene).film.width == 16


def test_translate_to_json_is_the_scene_that_renderers_get(invoke: Invoke, tmp_path: Path) -> None:
    result = invoke("translate", "slab", "--to", "json", "--scenes", SCENES)
    assert result.exit_code == 0
    paths = [tmp_path / line for line in result.output.splitlines()]
    assert len(paths) == 2
    scenes = [ResolvedScene.model_validate_json(path.read_bytes()) for path in paths]
    assert {len(scene.solids) for scene in scenes} == {1}
    assert all(path.is_relative_to(tmp_path / "translated") for path in paths)


def test_translate_to_a_renderer_writes_what_it_is_given(invoke: Invoke, tmp_path: Path) -> None:
    result = invoke(
        "translate", "thin-face", "--to", "student", "--out", "there", "--scenes", SCENES
    )
    path = tmp_path / result.output.strip()
    assert path.is_relative_to(tmp_path / "there")
    # The student knows no thin faces: it gets the slab that the face stands for.
    scene = ResolvedScene.model_validate_json(path.read_bytes())
    assert [solid.shape.type for solid in scene.solids] == ["convex"]


def test_report_rebuilds_the_page_from_records(invoke: Invoke, tmp_path: Path) -> None:
    invoke("run", "snell", "-r", "student", "--scenes", SCENES, "--out", "out")
    index = tmp_path / "out" / "index.html"
    index.unlink()
    result = invoke("report", "out")
    assert result.exit_code == 0
    assert index.is_file()
    assert "snell-sweep" in index.read_text()


@pytest.mark.parametrize(("of", "title"), [("case", "checks"), ("scene", "transport")])
def test_schemas_are_json(of: str, title: str, invoke: Invoke) -> None:
    schema = json.loads(invoke("schema", "--of", of).output)
    assert title in schema["properties"]
    assert json.loads(invoke("schema").output) == json.loads(
        invoke("schema", "--of", "case").output
    )  # fmt: skip


def test_version_and_help(invoke: Invoke) -> None:
    assert invoke("--version").output == f"snellcheck, version {__version__}\n"
    for arguments in ([], ["run"], ["list"], ["show"], ["translate"], ["report"], ["schema"]):
        result = invoke(*arguments, "--help")
        assert result.exit_code == 0
        assert result.output.startswith("Usage:")
    assert "Exit codes: 0 all passed, 1 a check failed" in " ".join(
        invoke("--help").output.split()
    )  # fmt: skip


# --- for real -------------------------------------------------------------------------------------


@pytest.mark.povray
@pytest.mark.skipif(
    shutil.which("povray") is None, reason="needs POV-Ray: sudo apt-get install povray"
)
def test_what_is_translated_for_povray_runs_in_its_own_command_line(tmp_path: Path) -> None:
    result = CliRunner().invoke(
        cli.main,
        ["translate", "ball", "--to", "povray", "--scenes", str(SCENES), "--out", str(tmp_path)],
    )
    assert result.exit_code == 0, result.output
    folder = Path(result.output.strip()).parent
    done = subprocess.run(
        ["povray", "scene.ini"], cwd=folder, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert list(folder.glob("*.ppm"))


@pytest.mark.mitsuba
def test_what_is_translated_for_mitsuba_is_a_scene_file(tmp_path: Path) -> None:
    pytest.importorskip("mitsuba", reason="needs Mitsuba: pip install 'snellcheck[mitsuba]'")
    result = CliRunner().invoke(
        cli.main,
        ["translate", "ball", "--to", "mitsuba", "--scenes", str(SCENES), "--out", str(tmp_path)],
    )
    assert result.exit_code == 0, result.output
    text = Path(result.output.strip()).read_text()
    assert text.lstrip().startswith("<")
    assert "<scene" in text


@pytest.mark.slow
def test_the_command_itself_with_the_tracer_that_comes_along(tmp_path: Path) -> None:
    """A process of its own, as scripts start it."""
    command = [sys.executable, "-c", "from harness.cli import main; main()"]
    done = subprocess.run(
        [*command, "run", "snell", "-r", "tracer", "--scenes", str(SCENES), "--out", str(tmp_path)],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert summary(tmp_path)["counts"] == {"pass": 1, "fail": 0, "skip": 0, "error": 0, "known": 0}
