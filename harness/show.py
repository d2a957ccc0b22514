"""What the terminal shows: progress, the verdict table, cases and their truth."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import click
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from harness.record import Check, Summary, Verdict

if TYPE_CHECKING:
    from harness.plan import PreparedCase
    from harness.run import Progress
    from harness.scene.load import LoadedCase

STYLE = {
    Verdict.PASS: "green", Verdict.KNOWN: "yellow", Verdict.SKIP: "cyan", Verdict.FAIL: "bold red",
    Verdict.ERROR: "bold magenta",
}  # fmt: skip
SIGN = {
    Verdict.PASS: "✓", Verdict.KNOWN: "≈", Verdict.SKIP: "–", Verdict.FAIL: "✗", Verdict.ERROR: "!"
}  # fmt: skip
MOST_PROBLEMS = 20


@contextmanager
def progress(console: Console | None = None) -> Iterator[Callable[[Progress], None]]:
    """A bar over all renders; nothing in a log file, where bars are noise."""
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn
    from rich.progress import Progress as Bar

    columns = (
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(),
        TextColumn("{task.fields[message]}"),
    )  # fmt: skip
    console = console or Console(stderr=True)
    # Drawing it takes ten milliseconds, also where nobody sees it.
    with Bar(
        *columns, console=console, transient=True, auto_refresh=console.is_terminal,
        refresh_per_second=4,
    ) as bar:  # fmt: skip
        task = bar.add_task("renders", total=None, message="getting renderers ready")

        def update(state: Progress) -> None:
            bar.update(
                task, completed=state.done, total=state.total or None, message=escape(state.message)
            )

        yield update


def verdicts(summary: Summary, index: Path, console: Console | None = None) -> None:
    """The verdict table: a row per family, a column per renderer; then what is wrong, and where."""
    console = console or Console()
    names = list(summary.renderers)
    table = Table(title="Verdicts: checks passed of checks made", title_justify="left")
    table.add_column("family")
    for name in names:
        stored = " (stored)" if summary.renderers[name].status == "stored" else ""
        table.add_column(escape(name + stored), justify="right")
    by_family: dict[str, list[Check]] = {}
    for case in summary.cases:
        by_family.setdefault(case.family, []).extend(case.checks)
    for family, checks in by_family.items():
        table.add_row(
            escape(family), *(_cell([c for c in checks if c.renderer == n]) for n in names)
        )
    console.print(table)
    for name, renderer in summary.renderers.items():
        if renderer.status != "ok":
            console.print(f"[bold]{escape(name)}[/]: {escape(renderer.reason)}")
            if renderer.remedy:
                console.print(f"  mend it with: [bold]{escape(renderer.remedy)}[/]")
    for name, renderer in summary.renderers.items():
        if renderer.facts:
            console.print(f"{escape(name)}: {escape(_resolution(renderer.facts))}")
    _problems(summary, console)
    for diagnosis in summary.diagnoses:
        console.print(f"[bold]Diagnosis[/] {escape(diagnosis.sentence)}")
    _effort(summary, console)
    counts = Counter(c.status for case in summary.cases for c in case.checks)
    said = ", ".join(f"[{STYLE[v]}]{counts[v]} {v.value}[/]" for v in Verdict)
    console.print(f"{sum(counts.values())} checks in {summary.wall_s:.1f} s: {said}")
    console.print(f"Report: {escape(str(index))}", soft_wrap=True)


def _resolution(facts: dict[str, float | int | str]) -> str:
    """What preflight found the renderer able to show; all tolerances derive from it."""
    said = [f"values to {float(facts['quantum']):.2g} ({facts.get('values', 'unknown')})"]
    said.append(f"positions to {float(facts['position_resolution']):.2g} of a plane")
    digits = "double" if float(facts["epsilon"]) < 1e-12 else "single"
    said.append(f"{digits} precision, noise: {facts.get('noise', 'unknown')}")
    return ", ".join(said)


def _effort(summary: Summary, console: Console) -> None:
    """What was done anew and what was not; and that a run is not whole, where it is not."""
    effort = summary.effort
    parts = [f"{effort.rendered} results rendered", f"{effort.reused} reused"]
    if effort.retried:
        parts.append(f"{effort.retried} tried again")
    if effort.damaged:
        parts.append(f"{effort.damaged} damaged entries of the cache made again")
    cpu = effort.own_cpu_s + effort.renderers_cpu_s
    if effort.renderers_cpu_s:
        share = effort.renderers_cpu_s / cpu
        parts.append(f"{cpu:.0f} s of processor time, {share:.0%} of it in renderers")
    if effort.memory_mb:
        parts.append(f"{size(int(effort.memory_mb * 2**20))} of memory at most")
    console.print(", ".join(parts))
    if summary.interrupted:
        console.print("[bold]Interrupted:[/] the same command goes on where this run stood.")


def size(count: int) -> str:
    """Bytes for people: 1.3 GiB."""
    value = float(count)
    for unit in ("bytes", "KiB", "MiB"):
        if value < 1024:
            return f"{value:.3g} {unit}"
        value /= 1024
    return f"{value:.3g} GiB"


def _cell(checks: list[Check]) -> str:
    if not checks:
        return ""
    counts = Counter(check.status for check in checks)
    good = counts[Verdict.PASS] + counts[Verdict.KNOWN]
    worst = next(v for v in (Verdict.ERROR, Verdict.FAIL, Verdict.SKIP, Verdict.KNOWN, Verdict.PASS)
                 if counts[v])  # fmt: skip
    return f"[{STYLE[worst]}]{good}/{len(checks)} {SIGN[worst]}[/]"


def _problems(summary: Summary, console: Console) -> None:
    bad = [
        (case.id, check)
        for case in summary.cases
        for check in case.checks
        if check.status in (Verdict.FAIL, Verdict.ERROR)
        and summary.renderers[check.renderer].status == "ok"
    ]
    for case_id, check in bad[:MOST_PROBLEMS]:
        sign = f"[{STYLE[check.status]}]{SIGN[check.status]} {check.status.value}[/]"
        console.print(f"{sign} {escape(case_id)} {escape(check.id)}: {escape(check.reason)}")
    if len(bad) > MOST_PROBLEMS:
        console.print(f"… and {len(bad) - MOST_PROBLEMS} more; the report has them all")


def cases(loaded: Sequence[LoadedCase]) -> None:
    """A line per case, never folded or cut: scripts read it too."""
    width = max((len(case.id) for case in loaded), default=0)
    for case in loaded:
        click.echo(f"{case.id:<{width}}  {case.model.title}")


def case(prepared: PreparedCase) -> None:
    """The resolved scene, the checks and the truth of one case."""
    from harness.archive import scene_text
    from harness.measure.observables import Observable
    from harness.measure.truths import TRUTHS

    loaded, console = prepared.loaded, Console()
    console.print(f"[bold]{escape(loaded.id)}[/]  {escape(loaded.model.title)}")
    if loaded.model.description:
        console.print(escape(loaded.model.description.strip()))
    if loaded.model.formula:
        console.print(f"truth: {escape(loaded.model.formula)}")
    for source in loaded.model.sources:
        console.print(f"source: {escape(source)}")
    for line in _truth_lines(prepared):
        console.print(escape(line))
    for spec in loaded.model.checks:
        probe = f" by probe '{spec.probe}'" if spec.probe else ""
        console.print(f"check: {escape(spec.observable)}{escape(probe)} against {spec.against}")
        truth = TRUTHS.get(Observable(spec.observable))
        if truth is not None:
            console.print(
                f"  {escape(truth.form)} ({escape(truth.derived)}); for {escape(truth.domain)}"
            )
        for known in spec.known:
            console.print(
                f"  known of {escape(known.renderer)}: {known.at_least:g} to {known.at_most:g}, "
                f"{escape(known.cause)}"
            )
    console.print(escape(scene_text(prepared)), soft_wrap=True)


def _truth_lines(prepared: PreparedCase) -> Iterator[str]:
    """How many rays of each probe arrive, are totally reflected or miss, according to physics."""
    import numpy as np

    from harness.measure.probe_truth import probe_truth
    from harness.renderers.base import Status
    from harness.scene.resolve import expand_thin_slabs

    scene = expand_thin_slabs(prepared.scene)
    for probe in prepared.loaded.model.probes:
        truth = probe_truth(scene, probe.path, prepared.planes(probe))
        fates = Counter(Status(int(s)).name.lower() for s in truth.landings[0].status)
        theta = np.degrees(truth.theta_i[np.isfinite(truth.theta_i)])
        span = f"{theta.min():.2f} to {theta.max():.2f}°" if theta.size else "none"
        counts = ", ".join(f"{count} {fate}" for fate, count in fates.items())
        yield f"probe '{probe.name}', path {probe.path}: incidence {span}; rays: {counts}"
