"""What a renderer may not touch is refused by the system, and all else goes on working."""

from __future__ import annotations

import contextlib
import json
import os
import socket
import sys
import threading
from dataclasses import replace
from pathlib import Path

import pytest

from harness.errors import InputError, RendererFailed
from harness.renderers import confinement, landlock, seccomp
from harness.renderers.base import Capability, Renderer, RenderSettings
from harness.renderers.command import CommandRenderer, Template
from harness.renderers.command_file import renderer_from_file
from harness.renderers.confinement import Confinement
from harness.renderers.persistent import Program, WorkerRenderer
from harness.renderers.povray import PovRayRenderer
from harness.renderers.process import Finished, run_limited
from harness.renderers.proof import proof_scene
from harness.scene.resolved import ResolvedScene
from harness.translate.povray import PovScene, translate
from tests.fakes import MISBEHAVE
from tests.harness.povray_measure import needs_povray

SCENE = proof_scene(frozenset())
has_landlock = pytest.mark.skipif(not landlock.version(), reason="this kernel has no Landlock")
has_seccomp = pytest.mark.skipif(not seccomp.available(), reason="no filters of system calls")
has_scopes = pytest.mark.skipif(
    landlock.version() < landlock.SINCE_SCOPES, reason="this kernel's Landlock knows no signals"
)


def python(code: str, private: Path, confined: Confinement | None = None) -> Finished:
    """Runs `code`, confined to `private` beside what `confined` opens."""
    return run_limited(
        [sys.executable, "-c", code], cwd=private, timeout_s=30, memory_mb=512, private=private,
        confinement=confined or Confinement(),
    )  # fmt: skip


@pytest.fixture
def private(tmp_path: Path) -> Path:
    """A private folder beside a file that is not to be touched."""
    (tmp_path / "canary").write_text("alive")
    folder = tmp_path / "private"
    folder.mkdir()
    return folder


# --- files ----------------------------------------------------------------------------------------

HARM = {
    "write": "open('../canary', 'w')",
    "append": "open('../canary', 'a')",
    "truncate": "import os; os.truncate('../canary', 0)",
    "remove": "import os; os.remove('../canary')",
    "replace": "import os; open('mine', 'w').close(); os.replace('mine', '../canary')",
    "move away": "import os; os.rename('../canary', 'canary')",
    "make": "open('../new', 'w')",
    "make a folder": "import os; os.mkdir('../new')",
    "link": "import os; os.symlink('/', '../new')",
    "by a link": "import os; os.symlink('..', 'up'); open('up/canary', 'w')",
    "by a child": "import subprocess as s, sys; sys.exit(s.call(['sh', '-c', 'echo > ../canary']))",
}


@has_landlock
@pytest.mark.parametrize("harm", HARM)
def test_nothing_outside_can_be_written(harm: str, private: Path) -> None:
    done = python(HARM[harm], private)
    assert done.returncode != 0
    assert "Permission denied" in done.stderr + done.stdout or "cross-device" in done.stderr
    assert (private.parent / "canary").read_text() == "alive"
    assert sorted(p.name for p in private.parent.iterdir()) == ["canary", "private"]


@pytest.mark.parametrize("harm", HARM)
def test_without_confinement_all_of_it_works(harm: str, private: Path) -> None:
    """Or the test above would pass with code that does nothing."""
    done = run_limited(
        [sys.executable, "-c", HARM[harm]], cwd=private, timeout_s=30, memory_mb=512,
        private=private,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr


def test_the_private_folder_is_a_renderers_own(private: Path) -> None:
    code = (
        "import os, tempfile, multiprocessing as m\n"
        "os.makedirs('a/b'); open('a/b/c', 'w').write('1'); os.rename('a/b/c', 'd')\n"
        "os.symlink('d', 'e'); os.truncate('d', 0); os.remove('e'); os.rmdir('a/b')\n"
        "open('/dev/null', 'w').write('x'); m.Lock()\n"
        "print(open('../canary').read())\n"
    )
    assert python(code, private).stdout == "alive\n"


@has_landlock
def test_more_can_be_opened(private: Path, tmp_path: Path) -> None:
    opened = Confinement(writable=(tmp_path / "cache", tmp_path / "canary"))
    code = "open('../cache/a', 'w'); open('../canary', 'w'); open('../new', 'w')"
    assert "Permission denied: '../new'" in python(code, private, opened).stderr
    assert (tmp_path / "cache" / "a").exists()  # the folder was made
    assert (tmp_path / "canary").read_text() == ""


@has_landlock
def test_reading_can_be_confined(private: Path) -> None:
    system = Confinement(readable=(Path("/usr"), Path("/lib"), Path("/lib64"), Path("/etc")))
    for command, allowed in ((["cat", "../canary"], False), (["ls", "/usr"], True)):
        done = run_limited(
            command, cwd=private, timeout_s=30, memory_mb=512, private=private, confinement=system
        )
        assert (done.returncode == 0) is allowed, done.stderr
        assert "alive" not in done.stdout


# --- network, signals -----------------------------------------------------------------------------

NETWORK = "import socket; socket.socket(socket.{family}, socket.{kind}).bind(('{host}', 0))"


@has_seccomp
@pytest.mark.parametrize("kind", ["SOCK_STREAM", "SOCK_DGRAM"])
@pytest.mark.parametrize(("family", "host"), [("AF_INET", "127.0.0.1"), ("AF_INET6", "::")])
def test_no_network(family: str, host: str, kind: str, private: Path) -> None:
    code = NETWORK.format(family=family, host=host, kind=kind)
    assert "Permission denied" in python(code, private).stderr


def test_network_where_it_is_asked_for(private: Path) -> None:
    with socket.socket() as listening:
        listening.bind(("127.0.0.1", 0))
        listening.listen()
        code = (
            f"import socket; socket.create_connection(('127.0.0.1', {listening.getsockname()[1]}))"
        )
        assert python(code, private, Confinement(network=True)).returncode == 0
        if confinement.active():
            assert python(code, private).returncode != 0


def test_processes_of_a_renderer_talk_to_each_other(private: Path) -> None:
    code = (
        "import socket\n"
        "a = socket.socket(socket.AF_UNIX); a.bind('here'); a.listen()\n"
        "b = socket.socket(socket.AF_UNIX); b.connect('here')\n"
        "socket.socketpair(); print('well')\n"
    )
    assert python(code, private).stdout == "well\n"


@pytest.mark.skipif(sys.platform != "linux", reason="abstract sockets are Linux's")
@has_scopes
def test_nobody_outside_is_reached_by_a_socket_without_a_file(private: Path) -> None:
    """One with a file can be, which docs/decisions/0018-confined-by-the-kernel.md tells."""
    address = f"\0snellcheck-{os.getpid()}"
    code = f"import socket; socket.socket(socket.AF_UNIX).connect({address!r}); print('connected')"
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind(address)
        listening.listen()
        done = python(code, private)
    assert "connected" not in done.stdout
    assert "PermissionError" in done.stderr


@has_scopes
def test_signals_reach_nobody_outside(private: Path) -> None:
    code = f"import os, signal; os.kill({os.getpid()}, signal.SIGCONT)"
    assert "PermissionError" in python(code, private).stderr
    own = "import os, subprocess as s; c = s.Popen(['sleep', '60']); c.kill(); print(c.wait())"
    assert python(own, private).stdout == "-9\n"


@has_seccomp
def test_the_filter_says_no_to_what_it_should() -> None:
    """Interpreted here, as the kernel does: also for machines other than this one."""
    allow, denied, absent = 0x7FFF0000, 0x00050000 | 13, 0x00050000 | 38
    for name, machine in seccomp._MACHINES.items():
        other = next(m for n, m in seccomp._MACHINES.items() if n != name)
        for audit, number, argument, expected in (
            (machine.audit, machine.socket, 1, allow),
            (machine.audit, machine.socket, 2, denied),
            (machine.audit, machine.socket, 10, denied),
            (machine.audit, 0, 2, allow),
            (machine.audit, 425, 0, absent),
            (machine.audit, 0x40000000 | machine.socket, 2, absent),
            (machine.compatible, machine.compatible_sockets[0], 2, denied),
            (machine.compatible, 102, 1, denied),
            (machine.compatible, 3, 0, allow),
            (other.audit, 0, 0, absent),
        ):
            assert interpreted(machine, audit, number, argument) == expected


def interpreted(machine: seccomp._Machine, audit: int, number: int, argument: int) -> int:
    data = {0: number, 4: audit, 16: argument}
    program, at, held = seccomp.program(machine), 0, 0
    while True:
        operation, true, false, operand = program[at]
        at += 1
        if operation == 0x20:
            held = data[operand]
        elif operation == 0x06:
            return operand
        else:
            holds = held == operand if operation == 0x15 else held >= operand
            at += true if holds else false


# --- ourselves ------------------------------------------------------------------------------------


@has_landlock
def test_the_harness_stays_free(private: Path) -> None:
    """Threads that start something at once, too."""
    threads = [threading.Thread(target=python, args=("", private)) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    (private.parent / "canary").write_text("well")
    socket.socket().close()
    os.kill(os.getpid(), 0)
    assert (private.parent / "canary").read_text() == "well"


@has_landlock
def test_it_can_be_switched_off_and_says_so(private: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert confinement.described().startswith("files by Landlock")
    monkeypatch.setenv(confinement.SWITCH, "off")
    assert confinement.described() == "none, since SNELLCHECK_CONFINEMENT is off"
    assert python(HARM["write"], private).returncode == 0


@pytest.mark.parametrize(
    ("landlocked", "filtered", "said"),
    [
        (0, False, "none: "),
        (0, True, "files free: no Landlock here, network by seccomp"),
        (3, False, "files by Landlock 3, network free: no seccomp here"),
        (4, False, "files by Landlock 4, TCP by Landlock, no seccomp here"),
    ],
)
def test_a_system_that_has_less_is_told_and_still_renders(
    landlocked: int, filtered: bool, said: str, private: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(confinement, "_holds", lambda: (landlocked, filtered))
    assert confinement.described().startswith(said)
    monkeypatch.setattr(landlock, "restrict", lambda *_, **__: None)
    assert python("print('well')", private).stdout == "well\n"


@has_landlock
def test_a_system_that_refuses_to_confine_ends_the_renderer_not_the_confinement(
    private: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise OSError(7, "Argument list too long")

    monkeypatch.setattr(landlock, "restrict", refuse)
    with pytest.raises(RendererFailed, match="cannot be confined: Argument list too long"):
        python("", private)


# --- renderers ------------------------------------------------------------------------------------


def one_shot(mode: str, **more: object) -> Renderer:
    template = Template((sys.executable, str(MISBEHAVE), mode, "{scene}", "{output}"))
    return CommandRenderer("odd", template, Path.cwd(), image_format="npy", **more)  # type: ignore[arg-type]


def persistent(mode: str) -> Renderer:
    program = Program((sys.executable, str(MISBEHAVE), "--persistent", mode))
    return WorkerRenderer("odd", program, capabilities=frozenset(Capability))


@pytest.mark.parametrize("way", [one_shot, persistent])
@pytest.mark.parametrize(
    "mode",
    [
        pytest.param("write-outside", marks=has_landlock),
        pytest.param("connect", marks=has_seccomp),
        pytest.param("signal-parent", marks=has_scopes),
    ],
)
def test_a_refusal_is_an_error_that_says_what_may_have_been_refused(
    way, mode: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MISBEHAVE_OUTSIDE", str(tmp_path / "escaped"))
    renderer = way(mode)
    with contextlib.closing(renderer) if hasattr(renderer, "close") else contextlib.nullcontext():
        with pytest.raises(RendererFailed, match="writes to its private folder alone and") as error:
            renderer.render(SCENE, RenderSettings())
        assert "PermissionError" in error.value.log
        assert not (tmp_path / "escaped").exists()
        monkeypatch.setenv(confinement.SWITCH, "off")
        assert renderer.render(SCENE, RenderSettings()).pixels[0, 0, 0] == 0.25


def test_other_failures_are_not_put_down_to_it() -> None:
    with pytest.raises(RendererFailed) as caught:
        one_shot("crash").render(SCENE, RenderSettings())
    assert str(caught.value) == "ended with exit code 3"


@has_landlock
def test_a_renderer_file_opens_paths_and_the_network(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MISBEHAVE_OUTSIDE", str(tmp_path / "logs" / "escaped"))
    (tmp_path / "logs").mkdir()
    for mode, key in (("write-outside", 'writable = ["logs"]'), ("connect", "network = true")):
        command = json.dumps(f"{{python}} '{MISBEHAVE}' {mode} {{scene}} {{output}}")
        text = f'[renderer]\nname = "odd"\nformat = "npy"\ncommand = {command}\n'
        (tmp_path / "r.toml").write_text(text)
        with pytest.raises(RendererFailed, match="note that it writes to its private"):
            renderer_from_file(tmp_path / "r.toml").render(SCENE, RenderSettings())
        (tmp_path / "r.toml").write_text(text + key)
        renderer_from_file(tmp_path / "r.toml").render(SCENE, RenderSettings())
    assert (tmp_path / "logs" / "escaped").read_text() == "out"


def test_a_writable_path_that_is_not_there_is_told(tmp_path: Path) -> None:
    text = '[renderer]\nname = "odd"\ncommand = "m {scene} {output}"\nwritable = ["lgos"]\n'
    (tmp_path / "r.toml").write_text(text)
    with pytest.raises(InputError, match=r"r\.toml:4: renderer\.writable: is not there; got lgos"):
        renderer_from_file(tmp_path / "r.toml")


@pytest.fixture
def trusting(monkeypatch: pytest.MonkeyPatch) -> None:
    """POV-Ray without rules of its own, so that what is refused is refused by the system."""
    rules = "[File I/O Security]\nnone\n[Shellout Security]\nforbidden\n[Permitted Paths]\n"
    monkeypatch.setattr("harness.renderers.povray.CONFIGURATION", rules)


SDL = {
    "make": '#fopen F "{outside}/new" write\n#write (F, "out")\n#fclose F\n',
    "append": '#fopen F "{outside}/canary" append\n#write (F, "out")\n#fclose F\n',
    "include": '#include "{outside}/canary"\n',
    "read": '#fopen F "{outside}/canary" read\n#read (F, A)\n#warning A\n',
}


@pytest.mark.povray
@needs_povray
@has_landlock
@pytest.mark.usefixtures("trusting")
@pytest.mark.parametrize("harm", SDL)
def test_hostile_sdl_is_refused_by_the_system(
    harm: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    canary = '"alive"' if harm == "read" else '#warning "alive"\n'
    (tmp_path / "canary").write_text(canary)

    def evil(scene: ResolvedScene) -> PovScene:
        made, sdl = translate(scene), SDL[harm].replace("{outside}", str(tmp_path))
        return replace(made, sdl=made.sdl.replace("camera {", sdl + "camera {", 1))

    def harmed(log: str) -> bool:
        files = {path.name: path.read_text() for path in tmp_path.iterdir()}
        return "alive" in log or files != {"canary": canary}

    monkeypatch.setattr(PovRayRenderer, "translate", staticmethod(evil))
    with pytest.raises(RendererFailed, match=r"Cannot (open user|find) file") as caught:
        PovRayRenderer().render(SCENE, RenderSettings())
    assert not harmed(str(caught.value) + caught.value.log)
    monkeypatch.setenv(confinement.SWITCH, "off")  # so it was not POV-Ray that refused
    assert harmed(PovRayRenderer().render(SCENE, RenderSettings()).log)
