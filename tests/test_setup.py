"""`make setup` on machines of all kinds, played by stand-ins for the programs that it calls."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent

# What any POSIX system has.
ORDINARY = (
    *("awk", "cat", "chmod", "cksum", "cp", "dirname", "env", "grep", "ls", "mkdir", "mktemp"),
    *("rm", "sed", "sh", "sort", "tail", "tr", "uname"),
)

# Answers as Python does, but makes environments that hold only stand-ins.
PYTHON = f"""
case "$1 $2" in
"-m venv")
    mkdir -p .venv/bin
    cp "$0" .venv/bin/python
    printf '#!/bin/sh\\necho "uv $*" >>"$CALLS"\\n' >.venv/bin/uv
    printf '#!/bin/sh\\necho snellcheck 0.1.0\\n' >.venv/bin/snellcheck
    chmod +x .venv/bin/* ;;
"-m pip") ;;
*) exec {sys.executable} "$@" ;;
esac
"""

FOUND_BY_APT = """
echo 'libllvm9 - old'
echo 'libllvm19 - runtime library'
echo 'libllvm16 - aborts'
echo 'libllvm17t64 - runtime library'
"""


class Machine:
    """A checkout and a machine around it, of which only the programs in `bin` are to be found."""

    def __init__(self, folder: Path) -> None:
        self.root = folder / "checkout"
        self.bin = folder / "bin"
        self.calls = folder / "calls"
        for part in ("scripts", "requirements"):
            shutil.copytree(ROOT / part, self.root / part)
        shutil.copy(ROOT / "pyproject.toml", self.root)
        self.bin.mkdir()
        for name in ORDINARY:
            found = shutil.which(name)
            assert found, f"this test needs {name}"
            (self.bin / name).symlink_to(found)
        # Debian, a user without sudo, nothing installed
        self.has("python3", PYTHON)
        self.has("id", "echo 1000")
        self.has("ldconfig", "echo '\tlibc.so.6 (libc6,x86-64) => /lib/libc.so.6'")
        self.has("apt-get", "")
        self.has("apt-cache", FOUND_BY_APT)

    def has(self, name: str, script: str) -> None:
        """Puts a program there that notes how it was called and runs `script`."""
        program = self.bin / name
        program.write_text(f'#!/bin/sh\necho "{name} $*" >>"$CALLS"\n{script}\n')
        program.chmod(0o755)

    def has_everything(self) -> None:
        self.has("povray", "")
        libraries = r"\tlibLLVM.so.19.1 (x)\n\tlibatomic.so.1 (libc6,x86-64) => /lib/a"
        self.has("ldconfig", f"printf '{libraries}\\n'")

    def setup(self, **environment: str) -> str:
        """Runs it to a good end; what it printed."""
        done = self.try_setup(**environment)
        assert done.returncode == 0, done.stdout
        return done.stdout

    def try_setup(self, **environment: str) -> subprocess.CompletedProcess[str]:
        self.calls.write_text("")
        return subprocess.run(
            [self.root / "scripts" / "setup"],
            env={"PATH": str(self.bin), "CALLS": str(self.calls), **environment},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            check=False,
        )

    def called(self, start: str) -> list[str]:
        return [call for call in self.calls.read_text().splitlines() if call.startswith(start)]


@pytest.fixture
def machine(tmp_path: Path) -> Machine:
    if not sys.platform.startswith("linux"):
        pytest.skip("plays Debian machines; run it on Linux")
    return Machine(tmp_path)


def test_without_the_right_to_install_it_says_how_and_goes_on(machine: Machine) -> None:
    out = machine.setup()
    assert "sudo apt-get update && sudo apt-get install povray libatomic1 libllvm19\n" in out
    assert not machine.called("apt-get")
    assert machine.called("uv pip sync")
    assert "ready: .venv/bin/snellcheck" in out


def test_as_root_it_says_what_it_installs_before_it_does(machine: Machine) -> None:
    machine.has("id", "echo 0")
    out = machine.setup()
    assert "installing with apt: povray libatomic1 libllvm19\n" in out
    installed = [call.split()[-1] for call in machine.called("apt-get") if " install " in call]
    assert installed == ["povray", "libatomic1", "libllvm19"]


def test_sudo_serves_where_it_asks_no_password(machine: Machine) -> None:
    machine.has("sudo", '[ "$1" != -n ] || shift; exec "$@"')
    machine.has("true", "")
    machine.setup()
    assert any("install" in call and "povray" in call for call in machine.called("sudo"))


def test_sudo_that_asks_for_a_password_is_left_alone(machine: Machine) -> None:
    machine.has("sudo", "exit 1")
    assert "sudo apt-get install povray" in machine.setup()
    assert machine.called("sudo") == ["sudo -n true"]


def test_system_packages_can_be_declined(machine: Machine) -> None:
    machine.has("id", "echo 0")
    out = machine.setup(SYSTEM_PACKAGES="no")
    assert "povray libatomic1 libllvm19" in out
    assert not machine.called("apt-get")


def test_one_package_that_fails_does_not_keep_the_rest_out(machine: Machine) -> None:
    machine.has("id", "echo 0")
    machine.has("apt-get", 'case "$*" in *povray) echo no such package; exit 100 ;; esac')
    out = machine.setup()
    assert "no such package" in out
    assert "povray was not installed" in out
    assert any(call.endswith("libllvm19") for call in machine.called("apt-get"))
    assert "ready" in out


@pytest.mark.parametrize(
    ("line", "serves"),
    [
        ("libLLVM.so.19.1 (libc6,x86-64) => /lib/libLLVM.so.19.1", True),
        ("libLLVM-17.so.1 (libc6,x86-64) => /lib/libLLVM-17.so.1", True),
        ("libLLVM-16.so.1 (libc6,x86-64) => /lib/libLLVM-16.so.1", False),
        ("libLLVM-9.so.1 (libc6,x86-64) => /lib/libLLVM-9.so.1", False),
    ],
)
def test_a_libllvm_serves_from_17_on(machine: Machine, line: str, serves: bool) -> None:
    machine.has("ldconfig", f"printf '\\t%s\\n' '{line}'")
    assert ("libllvm19" not in machine.setup()) is serves


def test_a_libllvm_that_aborts_is_not_installed_where_there_is_no_better(machine: Machine) -> None:
    machine.has("apt-cache", "echo 'libllvm16 - aborts'")
    assert "libllvm16" not in machine.setup()


def test_a_second_run_does_and_says_nothing(machine: Machine) -> None:
    machine.has_everything()
    assert "ready" in machine.setup()
    assert machine.setup() == ""
    assert not machine.called("uv")


@pytest.mark.parametrize("changed", ["pyproject.toml", "requirements/dev.txt", "scripts/setup"])
def test_what_decides_the_environment_makes_it_install_again(
    machine: Machine, changed: str
) -> None:
    machine.has_everything()
    machine.setup()
    with (machine.root / changed).open("a") as file:
        file.write("# changed\n")
    machine.setup()
    assert machine.called("uv pip sync")


def test_an_interrupted_installation_is_done_again(machine: Machine) -> None:
    machine.has_everything()
    machine.setup()
    (machine.root / ".venv" / ".setup-done").unlink()
    machine.setup()
    assert machine.called("uv pip sync")


def test_a_moved_checkout_is_installed_again(machine: Machine) -> None:
    """Its scripts and the editable installation hold absolute paths."""
    machine.has_everything()
    machine.setup()
    machine.root = machine.root.rename(machine.root.parent / "elsewhere")
    machine.setup()
    assert machine.called("uv pip sync")


def test_a_python_that_is_too_old_is_refused_in_one_message(machine: Machine) -> None:
    machine.has("python3", "exit 1")
    done = machine.try_setup()
    assert done.returncode == 1
    assert "needs Python 3.11 to 3.14" in done.stdout
    assert "make setup PYTHON=" in done.stdout


def test_a_python_can_be_named(machine: Machine) -> None:
    machine.has_everything()
    (machine.bin / "python3").rename(machine.bin / "python3.99")
    assert "needs Python" in machine.try_setup().stdout
    assert "ready" in machine.setup(PYTHON="python3.99")
