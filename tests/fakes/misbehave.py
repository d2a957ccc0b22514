"""A renderer that does wrong on purpose. Stand-alone: ``misbehave.py MODE scene.json output.npy``.

With ``--persistent`` before MODE it speaks the worker protocol and misbehaves at `render`.
"""

# ruff: noqa: T201 - what it prints is a renderer's output

from __future__ import annotations

import json
import os
import pickle
import signal
import socket
import struct
import sys
import time
from collections.abc import Callable
from pathlib import Path

GREY = 0.25


def npy(values: list[float], shape: tuple[int, ...], kind: str = "<f4") -> bytes:
    header = f"{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}"
    header += " " * (-(len(header) + 11) % 64) + "\n"
    body = struct.pack(f"<{len(values)}f", *values)
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header.encode() + body


def image(width: int, height: int, value: float = GREY) -> bytes:
    return npy([value] * (width * height * 3), (height, width, 3))


def good(output: Path, width: int, height: int) -> None:
    output.write_bytes(image(width, height))


def crash(output: Path, width: int, height: int) -> None:
    print("loading the scene", file=sys.stderr)
    print("something is very wrong", file=sys.stderr)
    sys.exit(3)


def abort(output: Path, width: int, height: int) -> None:
    print("LLVM ERROR: Cannot select: fminimum", file=sys.stderr, flush=True)
    os.abort()


def hang(output: Path, width: int, height: int) -> None:
    print("thinking", file=sys.stderr, flush=True)
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    while True:
        time.sleep(60)


def leak(output: Path, width: int, height: int) -> None:
    hoard = []
    while True:
        hoard.append(bytearray(b"x") * (8 << 20))
        time.sleep(0.01)


def leak_in_child(output: Path, width: int, height: int) -> None:
    if os.fork() == 0:
        os.setsid()  # it even leaves the session
        leak(output, width, height)
    hang(output, width, height)


def fork(output: Path, width: int, height: int) -> None:
    """Answers, but leaves children behind, each hard to find in its own way."""
    good(output, width, height)
    left = []
    for way in ("holds the pipes", "leaves the session", "leaves the group and its environment"):
        child = os.fork()
        if child == 0:
            if way == "leaves the session":
                os.setsid()
            if way == "leaves the group and its environment":
                os.setpgid(0, 0)
                sleep = "import time; time.sleep(600)"
                os.execve(sys.executable, [sys.executable, "-S", "-c", sleep], {})
            hang(output, width, height)
        left.append(child)
    (output.parent / "left.json").write_text(json.dumps(left))


def fork_bomb(output: Path, width: int, height: int) -> None:
    for _ in range(2000):
        if os.fork() == 0:
            time.sleep(600)
        time.sleep(0.001)


def many_files(output: Path, width: int, height: int) -> None:
    """Each of them small enough."""
    for k in range(100_000):
        with (output.parent / f"{k}.tmp").open("wb") as file:
            os.posix_fallocate(file.fileno(), 0, 8 << 20)


def flood(output: Path, width: int, height: int) -> None:
    while True:
        os.write(1, b"All work and no play makes a dull renderer. " * 1000 + b"\n")


def flood_file(output: Path, width: int, height: int) -> None:
    signal.signal(signal.SIGXFSZ, signal.SIG_DFL)  # as in a program in C
    with output.open("wb") as file:
        while True:
            file.write(bytes(1 << 20))


def write_outside(output: Path, width: int, height: int) -> None:
    Path(os.environ["MISBEHAVE_OUTSIDE"]).write_text("out")
    good(output, width, height)


def connect(output: Path, width: int, height: int) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as to_anywhere:
        to_anywhere.sendto(b"a secret", ("127.0.0.1", 9))
    good(output, width, height)


def signal_parent(output: Path, width: int, height: int) -> None:
    os.kill(os.getppid(), signal.SIGCONT)  # which does no harm; SIGKILL would
    good(output, width, height)


def truncated(output: Path, width: int, height: int) -> None:
    output.write_bytes(image(width, height)[:-100])


def huge(output: Path, width: int, height: int) -> None:
    output.write_bytes(npy([], (1_000_000, 1_000_000, 3)))


def wrong_size(output: Path, width: int, height: int) -> None:
    output.write_bytes(image(width + 1, height))


def nan(output: Path, width: int, height: int) -> None:
    values = [GREY] * (width * height * 3)
    values[4] = float("nan")
    output.write_bytes(npy(values, (height, width, 3)))


def wrong_type(output: Path, width: int, height: int) -> None:
    """A pickle inside an .npy file, which would run `touch` if anything unpickled it."""
    trap = pickle.dumps(_Trap(str(output.parent / "unpickled")))
    output.write_bytes(npy([], (1,), "|O") + trap)


def text(output: Path, width: int, height: int) -> None:
    output.write_text("an image, honestly")


def pipe(output: Path, width: int, height: int) -> None:
    """Whoever opens it waits for a writer, for ever."""
    os.mkfifo(output)


def link(output: Path, width: int, height: int) -> None:
    """Leads to a file that was never an image of the renderer's."""
    output.symlink_to(__file__)


def none(output: Path, width: int, height: int) -> None:
    print("done")


class _Trap:
    def __init__(self, path: str) -> None:
        self.path = path

    def __reduce__(self) -> tuple[Callable[[str], object], tuple[str]]:
        return os.mkdir, (self.path,)


MODES: dict[str, Callable[[Path, int, int], None]] = {
    f.__name__.replace("_", "-"): f
    for f in (
        good,
        crash,
        abort,
        hang,
        leak,
        leak_in_child,
        fork,
        fork_bomb,
        many_files,
        flood,
        flood_file,
        write_outside,
        connect,
        signal_parent,
        truncated,
        huge,
        wrong_size,
        nan,
        wrong_type,
        text,
        pipe,
        link,
        none,
    )
}


def serve(mode: str) -> None:
    for line in sys.stdin:
        request = json.loads(line)
        reply = {"id": request["id"], "ok": True}
        if request["op"] == "hello":
            reply |= {"protocol": 1, "name": "misbehave", "version": "1", "capabilities": []}
        elif request["op"] == "render" and mode == "refuse":
            reply |= {"ok": False, "error": "unsupported", "message": "no prisms", "log": "hm"}
        elif request["op"] == "render" and mode == "babble":
            print("Rendering, 10%")
        elif request["op"] == "render" and mode == "other-id":
            reply["id"] += 1
        elif request["op"] == "render":
            film = json.loads(Path(request["scene"]).read_text())["film"]
            MODES[mode](Path(request["output"]), film["width"], film["height"])
        print(json.dumps(reply), flush=True)


def main(arguments: list[str]) -> None:
    if arguments[0] == "--persistent":
        serve(arguments[1])
    else:
        mode, scene, output = arguments
        film = json.loads(Path(scene).read_text())["film"]
        MODES[mode](Path(output), film["width"], film["height"])


if __name__ == "__main__":
    main(sys.argv[1:])
