"""Scenes that mean harm are refused or harmless, and touch nothing outside their folder."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from harness.baseline.document import parse_baseline
from harness.baseline.run_folder import inside
from harness.errors import InputError
from tests.baseline.documents import baseline, check, stored_image
from tests.fuzz.campaign import HANG_S, MOST_MB
from tests.fuzz.hostile import PICTURE_SCENE, bombs, names, scenes
from tests.fuzz.targets import MESH_SCENE, ROOT
from tests.harness.tiny import SCENES
from tests.stress import figures

# Runs a command line with every file that Python opens written to a log.
WATCHED = """
import os, sys
log = os.open(sys.argv[1], os.O_WRONLY | os.O_CREAT | os.O_APPEND)
def watch(event, args):
    if event == "open" and isinstance(args[0], (str, bytes)):
        writes = bool(args[2] and args[2] & (os.O_WRONLY | os.O_RDWR | os.O_CREAT))
        os.write(log, f"{'w' if writes else 'r'} {os.path.abspath(os.fsdecode(args[0]))}\\n"
                 .encode("utf-8", "replace"))
    elif event in ("os.remove", "os.rename", "os.mkdir", "os.rmdir", "os.symlink", "os.chmod"):
        for path in args:
            if isinstance(path, (str, bytes)):
                line = f"w {os.path.abspath(os.fsdecode(path))}\\n"
                os.write(log, line.encode("utf-8", "replace"))
sys.addaudithook(watch)
from harness.cli import main
main(sys.argv[2:])
"""
# Reads scene files one after the other, and says what that cost.
MEASURED = """
import json, resource, sys, time
from pathlib import Path
from harness.baseline.document import parse_baseline
from harness.baseline.run_folder import inside
from harness.errors import InputError
from tests.baseline.documents import baseline, check, stored_image
from tests.fuzz.campaign import Outcome, attempt
from tests.fuzz.targets import Kind, read_scene
for name in sys.argv[1:]:
    outcome, start = Outcome(name), time.process_time()
    wrong = attempt(Kind("hostile", name, (), read_scene), Path(name), outcome)
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(json.dumps([wrong, outcome.refused, time.process_time() - start, most]), flush=True)
"""
# Not refused, because they are valid and small after all.
HARMLESS = {"material.obj", "numbers.obj", "lying.png", "at-the-limit.png"}


def costs(files: dict[str, bytes], folder: Path) -> dict[str, tuple[str, int, float, float]]:
    """By name: what was wrong, whether it was refused, seconds, and megabytes so far."""
    paths = []
    for name, data in files.items():
        paths.append(folder / f"{name}.toml")
        paths[-1].write_bytes(data)
    command = [sys.executable, "-c", MEASURED, *map(str, paths)]
    done = subprocess.run(
        command, cwd=ROOT, capture_output=True, text=True, check=False, timeout=600
    )
    assert done.returncode == 0, done.stdout[-200:] + done.stderr[-2000:]
    return dict(zip(files, map(json.loads, done.stdout.splitlines()), strict=True))


@pytest.mark.slow
@pytest.mark.parametrize("what", ["bombs", "scenes"])
def test_what_asks_for_too_much_is_refused_at_little_cost(what: str, tmp_path: Path) -> None:
    files = scenes()
    if what == "bombs":
        files = {}
        for name, data in bombs().items():
            (tmp_path / name).write_bytes(data)
            scene = PICTURE_SCENE if name.endswith(".png") else MESH_SCENE
            files[name] = scene.replace(b"FILE", name.encode())
    found = costs(files, tmp_path)
    for name, (wrong, refused, seconds, megabytes) in found.items():
        assert not wrong, f"{name}: {wrong}"
        assert refused or name in HARMLESS, name
        assert seconds < HANG_S, name
        assert megabytes < MOST_MB, name
    slowest, most = (max(cost[k] for cost in found.values()) for k in (2, 3))
    said = f"refused or harmless; at most {slowest:.1f} s and {most:.0f} MB"
    figures.note("Hostile files", f"{what} that ask for very much", len(found), said)


@pytest.fixture
def guarded(tmp_path: Path) -> Path:
    """A working folder beside a canary that nothing may touch."""
    work = tmp_path / "work"
    for folder in ("scenes/evil", "home", "tmp"):
        (work / folder).mkdir(parents=True)
    (tmp_path / "canary").write_text("alive")
    return work


def watched(work: Path, *arguments: str) -> tuple[subprocess.CompletedProcess[str], set[Path]]:
    """A command line in the folder, and the files that it wrote, made, moved or removed."""
    log = work.parent / "log"
    log.unlink(missing_ok=True)
    environment = os.environ | {
        "HOME": str(work / "home"), "TMPDIR": str(work / "tmp"), "PYTHONPATH": str(ROOT),
        "SNELLCHECK_CACHE": str(work / "cache"), "XDG_CACHE_HOME": str(work / "cache"),
        "SNELLCHECK_HISTORY": str(work / "history.sqlite"),
    }  # fmt: skip
    done = subprocess.run(
        [sys.executable, "-c", WATCHED, str(log), *arguments], cwd=work, env=environment,
        capture_output=True, text=True, check=False, timeout=600,
    )  # fmt: skip
    assert "Traceback" not in done.stdout + done.stderr, done.stderr[-2000:]
    lines = log.read_text(encoding="utf-8").splitlines()
    assert f"r {work.parent / 'canary'}" not in lines
    written = {Path(line[2:]) for line in lines if line.startswith("w ")}
    return done, written - {log, Path(os.devnull)}


def outside(written: set[Path], work: Path) -> set[Path]:
    """What lies outside the folder, but for Python's own caches of compiled code."""
    return {
        path
        for path in written
        if not path.resolve().is_relative_to(work.resolve())
        and "__pycache__" not in path.parts
        and not path.is_relative_to("/dev")
        and not path.is_relative_to("/proc")
    }


def evil_scene(name: str) -> str:
    """The tiny sweep with a name that is code elsewhere, in every place that takes a text."""
    text = (SCENES / "snell" / "sweep.toml").read_text(encoding="utf-8")
    quoted = json.dumps(name)
    lines = []
    for line in text.splitlines():
        key = line.partition("=")[0].strip()
        lines.append(f"{key} = {quoted}" if key in ("title", "description", "lecture") else line)
    return "\n".join(lines).replace("sources = [", f"sources = [{quoted}, ", 1) + "\n"


@pytest.mark.slow
def test_names_that_are_code_elsewhere_stay_names(guarded: Path) -> None:
    """Through the whole of a run, its report, and what CI systems are given."""
    canary = guarded.parent / "canary"
    for key, name in list(names(canary).items())[::3]:
        file = guarded / "scenes" / "evil" / f"{key}.toml"
        file.write_text(evil_scene(name), encoding="utf-8")
    done, written = watched(
        guarded, "run", "--scenes", "scenes", "-r", "tracer", "--quality", "draft", "--out", "out"
    )
    assert done.returncode in (0, 2), done.stderr[-2000:]
    assert outside(written, guarded) == set()
    for target in ("junit", "markdown", "github"):
        told, written = watched(guarded, "export", target, "--run", "out")
        assert told.returncode == 0, told.stderr
        assert outside(written, guarded) == set()
    page = (guarded / "out" / "index.html").read_text(encoding="utf-8")
    assert "<script>alert(1)" not in page
    assert canary.read_text() == "alive"
    assert {path.name for path in guarded.parent.iterdir()} <= {"work", "canary", "log"}


@pytest.mark.parametrize(
    "name",
    [
        "../../../canary",
        "{canary}",
        "..\\..\\canary",
        "link.obj",
        "scenes/../../canary",
        "pipe.obj",
    ],
)
def test_meshes_do_not_lead_out_of_their_folder(name: str, guarded: Path) -> None:
    canary = guarded.parent / "canary"
    folder = guarded / "scenes" / "evil"
    (folder / "link.obj").symlink_to(canary)
    os.mkfifo(folder / "pipe.obj")
    file = json.dumps(name.replace("{canary}", str(canary)))
    scene = MESH_SCENE.decode().replace('"FILE"', file)
    (folder / "mesh.toml").write_text(scene, encoding="utf-8")
    done, written = watched(guarded, "show", "--scenes", "scenes", "evil-mesh")
    assert done.returncode == 2
    assert "mesh.toml:" in done.stderr
    assert outside(written, guarded) == set()


@pytest.mark.parametrize("name", ["../../canary", "/etc/passwd", "a\x00b", "a\nb", ".x", "x" * 300])
def test_a_baseline_that_names_other_files_is_refused(name: str) -> None:
    image = stored_image().model_copy(update={"file": name})
    text = baseline([check()], images=[image]).model_dump_json(by_alias=True)
    with pytest.raises(InputError, match="not the name of a file"):
        parse_baseline(text.encode(), Path("b.json"))


def test_a_run_that_names_other_files_is_not_followed(tmp_path: Path) -> None:
    for name in ("../x.exr", "/etc/passwd", "a/../../x"):
        with pytest.raises(InputError, match="leads out"):
            inside(tmp_path, name)
