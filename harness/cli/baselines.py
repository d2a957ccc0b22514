"""What the terminal shows of baselines, and which of them the commands mean."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import click
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from harness.cli.options import BASELINES
from harness.record import BaselineState, Summary

if TYPE_CHECKING:
    from harness.baseline.approve import Plan
    from harness.baseline.run_folder import RunFolder
    from harness.baseline.source import Baselines
    from harness.baseline.stand_in import StandIns
    from harness.baseline.trend import Deviations

MOST_LINES = 40
STYLE = {
    BaselineState.SAME: "green", BaselineState.DRIFTED: "yellow",
    BaselineState.IMPROVED: "green", BaselineState.NEW: "cyan",
    BaselineState.RENDERER_CHANGED: "yellow", BaselineState.REGRESSED: "bold red",
    BaselineState.MISSING: "bold red", BaselineState.STALE: "bold red",
}  # fmt: skip


def default_baseline() -> str:
    """The folder of this repository; where it has none, the one that came with snellcheck."""
    from harness.data import references_root

    return str(BASELINES if BASELINES.is_dir() else references_root())


def stand_ins(store: str, quality: str) -> StandIns:
    """What stands in for missing renderers: looked for here first, then in what came along.

    Large pictures are looked for in `store`, a folder or a URL.
    """
    from harness.baseline.source import open_baselines
    from harness.baseline.stand_in import StandIns
    from harness.baseline.store import store_at
    from harness.data import references_root

    def sources() -> list[Baselines]:
        folders = dict.fromkeys(f.resolve() for f in (BASELINES, references_root()) if f.is_dir())
        return [open_baselines(str(folder), store_at(store)) for folder in folders]

    return StandIns(sources, quality)


def past_runs(run: RunFolder) -> list[Deviations]:
    """The runs into the folder of `run` before it, oldest first, as the history has them.

    None where there is no history, or where it cannot be read, which is told: it is a convenience.
    """
    from harness.errors import InputError
    from harness.history.store import History, history_file

    history = History(history_file())
    try:
        return history.before(run.summary, run.folder) if history.file.is_file() else []
    except InputError as error:
        click.secho(f"warning: {error}; slow slides are not looked for", fg="yellow", err=True)
        return []


def show_states(summary: Summary, console: Console | None = None) -> None:
    """Counts by state, then every check that is not as approved, the worst first."""
    from harness.baseline.compare import WORST_FIRST
    from harness.baseline.trend import SHORTEST

    console = console or Console()
    found = summary.baseline
    assert found is not None
    lines = [
        (lost.state, f"{lost.case} {lost.check or lost.renderer}".rstrip(), lost.reason)
        for lost in found.lost
    ]
    lines += [
        (check.baseline.state, f"{case.id} {check.id}", check.baseline.reason)
        for case in summary.cases
        for check in case.checks
        if check.baseline is not None and check.baseline.state is not BaselineState.SAME
    ]
    new = [line for line in lines if line[0] is BaselineState.NEW]
    lines = [line for line in lines if line[0] is not BaselineState.NEW]
    lines.sort(key=lambda line: WORST_FIRST.index(line[0]))
    for state, name, reason in lines[:MOST_LINES]:
        console.print(
            f"[{STYLE[state]}]{state.value}[/] {escape(name)}: {escape(reason)}", soft_wrap=True
        )
    if len(lines) > MOST_LINES:
        console.print(f"… and {len(lines) - MOST_LINES} more; the report has them all")
    for trend in found.trends:
        console.print(
            f"[yellow]drifting[/] {escape(trend.case)} {escape(trend.check)}: "
            f"{escape(trend.reason)} (p = {trend.p_value:.1g})",
            soft_wrap=True,
        )
    if found.runs < SHORTEST:
        console.print(
            f"Slow slides can be seen once there are {SHORTEST} runs; there are {found.runs}"
        )
    if new:
        console.print(f"{len(new)} checks were never approved; `snellcheck approve` does that")
    said = ", ".join(
        f"[{STYLE[state]}]{found.counts[state.value]} {state.value}[/]"
        for state in WORST_FIRST
        if state.value in found.counts
    )
    console.print(
        f"Against {escape(found.source)}: {said or 'nothing to compare with'}", soft_wrap=True
    )


def show_plans(plans: Sequence[Plan], console: Console | None = None) -> None:
    """What approving would change, check by check."""
    console = console or Console()
    needed = [plan for plan in plans if plan.needed]
    table = Table("case", "renderer", "check", "state", "approved", "now", title_justify="left")
    for plan in needed:
        if plan.kept is None:
            count = sum(1 for change in plan.changes if change.state is not BaselineState.MISSING)
            table.add_row(
                escape(plan.record.id), escape(plan.run.name), f"all {count}", "new", "nothing", ""
            )
            continue
        for change in plan.changes:
            state = f"[{STYLE[change.state]}]{change.state.value}[/]"
            table.add_row(
                escape(plan.record.id), escape(plan.run.name), escape(change.check), state,
                escape(change.before), escape(change.after),
            )  # fmt: skip
    if needed:
        console.print(table)
    same = len(plans) - len(needed)
    if same:
        console.print(f"{same} results are as they were approved; nothing changes for them")
