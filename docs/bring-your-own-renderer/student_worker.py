"""The student's tracer as a process that stays alive: the worker protocol in forty lines.

A request is one line of JSON on stdin, its answer one line on stdout. Nothing else may be written
to stdout; what people should read goes to stderr.
"""

import json
import sys
import time
from pathlib import Path

import student

HELLO = {
    "protocol": 1,
    "name": "student",
    "version": "1.0",
    "capabilities": [
        *("image", "pixel-centres", "double", "double-data", "lobe-switch"),
        *("sphere", "convex", "picture", "absorption", "fresnel", "nested", "camera-inside"),
    ],
    "operations": ["render"],
}


def answer(request):
    if request["op"] == "hello":
        return {"ok": True, **HELLO}
    if request["op"] == "render":
        started = time.perf_counter()
        image = student.render(json.loads(Path(request["scene"]).read_text()))
        student.write_npy(request["output"], image)
        return {"ok": True, "seconds": time.perf_counter() - started}
    return {"ok": False, "error": "unsupported", "message": f"no operation {request['op']!r}"}


for line in sys.stdin:
    asked = json.loads(line)
    try:
        reply = answer(asked)
    except Exception as error:  # the next request may fare better
        reply = {"ok": False, "error": "failed", "message": repr(error)}
    print(json.dumps({"id": asked["id"], **reply}), flush=True)
