"""Figures about detection: `make detection` writes docs/detection.md and the data that reports
show, harness/report/detection.json.

    python -m tests.mutants.detection [PROCESSES] [--new]

With --new, only wrong renderers that the data do not have yet are measured, and join them.

Every wrong renderer through the whole of snellcheck, right ones of all classes and the reference
renderers beside them, the smallest faults that are seen, and what rules of other projects see.
"""

from __future__ import annotations

import json
import os
import platform
import sys
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from harness import __version__
from harness.errors import RendererError
from harness.expected import Float
from harness.plan import prepare
from harness.record import Summary, Verdict
from harness.renderers import registry
from harness.renderers.base import RenderSettings
from harness.report.detection import FILE, SCHEMA, said
from harness.scene.load import find
from tests.mutants.limits import CLASSES, QUESTIONS, Limit, limit
from tests.mutants.mutants import CLEAN, CONTROLS, MUTANTS, UNLISTED, Mutant, outside_renderer
from tests.mutants.rivals import RIVALS
from tests.mutants.trial import RED, Trial, cases, run_alone, trial

ROOT = Path(__file__).parents[2]
DOCUMENT, DATA = ROOT / "docs" / "detection.md", ROOT / "harness" / "report" / FILE
PICTURES = Path(__file__).parent / "pictures"
REFERENCES = ("tracer", "povray", "mitsuba-exact")


@dataclass(frozen=True)
class Alarm:
    """What was red of a renderer that is right."""

    name: str
    checks: int
    red: tuple[str, ...]
    absent: str = ""


def _said(text: str) -> None:
    sys.stderr.write(f"{text}\n")
    sys.stderr.flush()


# --- the parts ------------------------------------------------------------------------------------


def try_one(mutant: Mutant) -> Trial:
    """A wrong renderer with float images, by all cases."""
    with tempfile.TemporaryDirectory() as folder:
        found = trial(mutant, cases(), Path(folder))
    verdict = "right" if found.right else "NOT RIGHT" if found.caught else "MISSED"
    _said(f"{mutant.name}: {verdict}: {found.sentence[:160]}")
    return found


def alarms() -> Iterator[Alarm]:
    """Right renderers: of all classes, those that only look wrong, and the reference renderers."""
    chosen = cases()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for kind, options in {"float64, float images": {}, **CLASSES}.items():
            renderer = outside_renderer(CLEAN, folder, **options)  # type: ignore[arg-type]
            yield _alarm(f"the right renderer: {kind}", run_alone(renderer, chosen, folder / "out"))
        for control in CONTROLS:
            summary = run_alone(outside_renderer(control, folder), chosen, folder / "out")
            yield _alarm(control.fault, summary)
        for known in REFERENCES:
            yield _alarm(known, run_alone(registry.create(known), chosen, folder / "out"))


def _alarm(name: str, summary: Summary) -> Alarm:
    checks = [(case.id, check) for case in summary.cases for check in case.checks]
    red = tuple(f"{case} {check.observable}" for case, check in checks if check.status in RED)
    made = sum(check.status in (Verdict.PASS, *RED) for _, check in checks)
    (renderer,) = summary.renderers.values()
    _said(f"{name}: {len(red)} of {made} red")
    return Alarm(name, made, red, renderer.reason)


def picture(mutant: Mutant) -> Float | None:
    """The mutant's picture of everything at once; None where it is not to be had."""
    scene = prepare(find((), PICTURES)[0]).scene
    with tempfile.TemporaryDirectory() as folder:
        renderer = outside_renderer(mutant, Path(folder))
        try:
            return np.asarray(renderer.render(scene, RenderSettings()).pixels, np.float64)
        except RendererError:
            return None
        finally:
            renderer.close()  # type: ignore[attr-defined]


def seen_by_rivals(right: Float, mutant: Mutant) -> dict[str, bool | None]:
    """By rule, whether it sees the mutant; an image that cannot be read is seen by all."""
    wrong = picture(mutant)
    return {name: True if wrong is None else rule(wrong, right) for name, rule in RIVALS.items()}


# --- the document ---------------------------------------------------------------------------------


def measure(workers: int) -> dict[str, Any]:
    """Everything, as data."""
    wrong = (*MUTANTS, *UNLISTED)
    right = picture(CLEAN)
    assert right is not None
    with ProcessPoolExecutor(workers) as pool:
        tried = pool.map(try_one, wrong)
        rivals = pool.map(partial(seen_by_rivals, right), wrong)
        limits = [pool.submit(limit, question, kind) for question in QUESTIONS for kind in CLASSES]
        quiet = list(alarms())
        return {
            "schema": SCHEMA,
            "snellcheck_version": __version__,
            "machine": f"{platform.system()} {platform.machine()}",
            "checks": sum(len(case.loaded.model.checks) for case in cases()),
            "mutants": [_trial_data(t) for t in tried],
            "alarms": [
                {"name": a.name, "checks": a.checks, "red": list(a.red), "absent": a.absent}
                for a in quiet
            ],
            "limits": [_limit_data(found.result()) for found in limits],
            "rivals": dict(zip((m.name for m in wrong), rivals, strict=True)),
        }


def join(known: dict[str, Any], workers: int) -> dict[str, Any]:
    """The data with what is new, without what is gone. Raises ValueError where scenes differ."""
    if known["checks"] != (now := sum(len(case.loaded.model.checks) for case in cases())):
        raise ValueError(
            f"the scenes have {now} checks and had {known['checks']}: measure all anew"
        )
    have = {m["name"]: m for m in known["mutants"]}
    wrong = (*MUTANTS, *UNLISTED)
    new = [m for m in wrong if m.name not in have]
    right = picture(CLEAN)
    assert right is not None
    with ProcessPoolExecutor(workers) as pool:
        have |= {t.mutant.name: _trial_data(t) for t in pool.map(try_one, new)}
        rivals = known["rivals"] | dict(
            zip([m.name for m in new], pool.map(partial(seen_by_rivals, right), new), strict=True)
        )
    return known | {
        "mutants": [have[m.name] for m in wrong],
        "rivals": {m.name: rivals[m.name] for m in wrong},
    }


def _trial_data(t: Trial) -> dict[str, Any]:
    return {
        "name": t.mutant.name, "fault": t.mutant.fault, "amount": t.mutant.amount,
        "source": t.mutant.source, "wanted": list(t.mutant.causes), "caught": t.caught,
        "red": len(t.red), "cause": t.cause, "right": t.right, "sentence": t.sentence,
        "value": t.value, "uncertainty": t.uncertainty,
    }  # fmt: skip


def _limit_data(found: Limit) -> dict[str, Any]:
    question = found.question
    return {
        "what": question.what, "case": question.case, "unit": question.unit, "class": found.kind,
        "amount": found.amount,
    }  # fmt: skip


# Held by test_trials.py.
RIM_LINES = [
    "## What rays alone do not see",
    "",
    "At the rim of a ball what is reflected goes on to the backdrop behind it, so two codes share",
    "a pixel, and its ray is not measured but counted as mixed. `far-root` of 0.1, which goes",
    "wrong where the cosine of incidence is below 0.1, touches no other ray: the probes of",
    "`tests/mutants/scenes` pass it. Where pictures are compared, as in `ball-checkerboard`, the",
    "rim shows it, by a thousand times the tolerance.",
    "",
]


def document(data: dict[str, Any]) -> str:
    """docs/detection.md."""
    mutants, rules = data["mutants"], list(RIVALS)
    caught = sum(m["caught"] for m in mutants)
    right = sum(m["right"] for m in mutants)
    lines = [
        "# What is seen, and what is said of it",
        "",
        "Generated by `make detection`; the same as data is in",
        "[detection.json](../harness/report/detection.json), and every report shows it.",
        f"Measured with snellcheck {data['snellcheck_version']} on {data['machine']}.",
        "",
        "Each wrong renderer is a correct one with one rule exchanged (`tests/mutants/`), run in a",
        f"process of its own through the worker protocol, and held against {data['checks']} checks",
        "of scenes that were made to tell faults apart (`tests/mutants/scenes/`).",
        "",
        f"- **{caught} of {len(mutants)}** wrong renderers turn red.",
        f"- For **{right} of {len(mutants)}** ({right / len(mutants):.0%}) the first diagnosis is "
        "right: it names the fault, or says that none of the known causes fits where that is so.",
        *_finest_index(data),
        f"- **{sum(len(a['red']) for a in data['alarms'])}** false alarms on right renderers.",
        "",
        "## Wrong renderers",
        "",
        "The last columns tell whether other projects' rules see the fault in a picture of a ball,",
        "a coloured box, a ball of triangles and a prism before a checkerboard, compared with the",
        "same renderer without the fault (`tests/mutants/rivals.py` states the rules).",
        "",
        "| fault | size | known from | checks red | diagnosis | right | "
        + " | ".join(rules)
        + " |",
        "|--|--|--|--|--|--|" + "--|" * len(rules),
    ]
    for m in mutants:
        seen = data["rivals"][m["name"]]
        cells = [
            m["fault"], f"{m['amount']:g}", m["source"], str(m["red"] or "none"),
            _cell(m["sentence"]), "yes" if m["right"] else "**no**",
            *("?" if seen[r] is None else "seen" if seen[r] else "–" for r in rules),
        ]  # fmt: skip
        lines.append("| " + " | ".join(cells) + " |")
    counts = ", ".join(_seen_by(rule, data["rivals"].values()) for rule in rules)
    lines += ["", f"Seen of {len(mutants)}: snellcheck {caught}, {counts}.", ""]
    lines += _limit_lines(data) + RIM_LINES + _alarm_lines(data)
    return "\n".join(lines) + "\n"


def _seen_by(rule: str, answers: Iterable[Mapping[str, bool | None]]) -> str:
    """How many faults a rule sees; nothing of the kind where it could not be asked about all."""
    seen = [answer[rule] for answer in answers]
    return f"{rule} ?" if None in seen else f"{rule} {sum(map(bool, seen))}"


def _cell(text: str) -> str:
    return said(text).replace("|", "\\|")


def _finest_index(data: dict[str, Any]) -> list[str]:
    found = [limit for limit in data["limits"] if limit["what"] == "index"]
    least = {
        kind: min(limit["amount"] for limit in found if limit["class"] == kind) for kind in CLASSES
    }
    told = ", ".join(f"{amount:.1e} with {kind}" for kind, amount in least.items())
    return [f"- The smallest error of an index that is seen, by a probe, is {told}."]


def _limit_lines(data: dict[str, Any]) -> list[str]:
    kinds = list(CLASSES)
    rows: dict[tuple[str, str, str], dict[str, float]] = {}
    for found in data["limits"]:
        key = (found["what"], found["case"], found["unit"])
        rows.setdefault(key, {})[found["class"]] = found["amount"]
    lines = [
        "## The smallest faults that are seen",
        "",
        "By bisection over powers of two; half of each was not seen. `float32` keeps and computes",
        "everything in single precision, `16 bits` and `8 bits` are what its files hold.",
        "",
        "| fault | case | unit | " + " | ".join(kinds) + " |",
        "|--|--|--|" + "--|" * len(kinds),
    ]
    lines += [
        f"| {what} | `{case}` | {unit} | " + " | ".join(f"{row[k]:.1e}" for k in kinds) + " |"
        for (what, case, unit), row in rows.items()
    ]
    return [*lines, ""]


def _alarm_lines(data: dict[str, Any]) -> list[str]:
    lines = ["## Right renderers", "", "| renderer | checks | red |", "|--|--|--|"]
    for alarm in data["alarms"]:
        red = "; ".join(alarm["red"]) or ("none" if alarm["checks"] else f"– ({alarm['absent']})")
        lines.append(f"| {alarm['name']} | {alarm['checks']} | {red} |")
    return lines


def main() -> None:
    counts = [int(a) for a in sys.argv[1:] if a.isdigit()]
    workers = counts[0] if counts else os.cpu_count() or 1
    if "--new" in sys.argv:
        data = join(json.loads(DATA.read_text(encoding="utf-8")), workers)
    else:
        data = measure(workers)
    DATA.write_text(json.dumps(data, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    DOCUMENT.write_text(document(data), encoding="utf-8")
    _said(f"wrote {DOCUMENT.relative_to(ROOT)} and {DATA.relative_to(ROOT)}")


if __name__ == "__main__":
    main()
