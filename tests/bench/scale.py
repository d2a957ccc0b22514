"""What a cluster costs and gains: ``make scale`` measures it here and writes docs/scale.md.

One worker process against two, over Dask, on this machine. Rounds take turns, so that whatever
else the machine does slows both.
"""

from __future__ import annotations

import concurrent.futures
import json
import os
import platform
import sys
from collections.abc import Callable
from pathlib import Path

from harness import record
from harness.documents import write_text
from harness.plan import Job
from harness.renderers.base import RenderSettings
from harness.renderers.tracer import TracerEngine
from harness.running.cluster import connected
from harness.running.parcel import pack_job, pack_result
from harness.running.remote import Origin, RemoteRenderer
from harness.scene.resolved import Film, ResolvedScene
from tests.bench.measuring import ROOT, median, scene_of, seconds

ROUNDS = 5
# A picture that is as quick to make as any for its size, and one that takes some work, with four
# samples in each pixel.
BUSY_JOBS, BUSY_SIZE = 24, 768
DEAR_JOBS, DEAR_SIZE, DEAR_SAMPLES = 24, 512, 2
SMALL_JOBS, SMALL_SIZE = 300, 4
SETTINGS = RenderSettings(threads=1)
MILLION = 1_000_000
CORE_HOUR, GB_MONTH = 0.05, 0.025  # $, of the order of what clouds ask
PAGE = ROOT / "docs" / "scale.md"

TEXT = """\
# A million cases

Made by `make scale`; do not edit. Measured with snellcheck {version} on {cores} cores, Python
{python}, {system}, over Dask on this one machine.

## Measured

| | |
|--|--|
| one job of a glass ball, {size} x {size} pixels, computed directly | {direct:.3f} s |
| {jobs} such jobs on 1 worker | {one:.2f} s |
| {jobs} such jobs on 2 workers | {two:.2f} s |
| **2 workers against 1: so many times as fast** | **{gain:.2f}** |
| one job of the package, {dear_size} x {dear_size} with 4 samples each, directly | {dear:.3f} s |
| {dear_jobs} such jobs on 1 worker | {dear_one:.2f} s |
| {dear_jobs} such jobs on 2 workers | {dear_two:.2f} s |
| **2 workers against 1: so many times as fast** | **{dear_gain:.2f}** |
| a job that computes nothing, there and back, client and scheduler included | {overhead:.1f} ms |
| a scene on its way there | {there:.1f} kB |
| its image on the way back, {size} x {size} x 3 floats | {back:.0f} kB |
| the record of a case, with its verdicts and derivations | {record:.0f} kB |

The two workers share {cores} cores with the scheduler and the client, which unpacks images: on
machines of their own they have these cores for themselves. It costs most where an image has many
pixels for the work that it took, as that of a ball alone. In the run that records are taken from, a
result took a renderer {average:.2f} s of processor time on average.

## What follows for 10⁶ cases

A case of the suite is about {per_case:.0f} jobs, most of them small. A job's parcel costs
{overhead:.1f} ms of the client, so one client would be {client_h:.0f} hours at the parcels of 10⁶
cases. It feeds about {fed:.0f} workers whose jobs take {average:.2f} s each, or {fed_dear:.0f} with
jobs like the package's, before it is what everybody waits for.

Beyond that, cut the suite: `--shard i/n` gives each of n clients its own cases, balanced by
recorded times, and `snellcheck merge` puts the parts together and refuses what is missing, double
or of another version. With 100 shards a client has 10⁴ cases and {shard_h:.1f} hours of parcels,
while its workers render.

With jobs of that average 10⁶ cases are {core_h:.0f} core-hours of rendering, {compute:.0f} $ at
{core_hour} $ a core-hour. Were every image as large as the ball's, {images_tb:.0f} TB of them would
be on their way to clients, or {shard_gb:.0f} GB to each of 100. Keeping the records is
{keeping:.0f} $ a month at {gb_month} $ a GB. Both prices are assumptions: put yours in their place.

Records of 10⁶ cases are {records_gb:.0f} GB without pictures; a shard's are {shard_mb:.0f} MB. A
report's index grows by some kilobytes for each case, so a report is best made for a shard, and
`summary.json` for everything. Results go to disk as they come, and a run that ended early goes on
where it was.
"""


def all_done(renderer: RemoteRenderer, scene: ResolvedScene, jobs: int) -> None:
    with concurrent.futures.ThreadPoolExecutor(renderer.concurrency) as pool:
        waiting = [pool.submit(renderer.render, scene, SETTINGS) for _ in range(jobs)]
        for one in waiting:
            one.result()


def in_turns(works: list[Callable[[], object]]) -> list[float]:
    """Median seconds of each, over rounds in which each has its turn."""
    for work in works:
        work()  # workers start, and load what was compiled
    rounds = [[seconds(work) for work in works] for _ in range(ROUNDS)]
    return [median(list(times)) for times in zip(*rounds, strict=True)]


def main(run: Path) -> None:
    """`run` is the folder of a run, for the sizes of records and the number of jobs of a case."""
    busy = scene_of("ball/checkerboard.toml", BUSY_SIZE)
    small = scene_of("ball/checkerboard.toml", SMALL_SIZE)
    film = Film(width=DEAR_SIZE, height=DEAR_SIZE, samples=DEAR_SAMPLES)
    dear = scene_of("package/complete.toml", DEAR_SIZE).model_copy(update={"film": film})
    engine = TracerEngine()
    tracer = Origin("registered", "tracer")
    with connected("local:1") as first, connected("local:2") as second:
        alone, both = first.renderer("tracer", tracer), second.renderer("tracer", tracer)
        one, two, dear_one, dear_two, dear_direct, direct, carried, computed = in_turns([
            lambda: all_done(alone, busy, BUSY_JOBS),
            lambda: all_done(both, busy, BUSY_JOBS),
            lambda: all_done(alone, dear, DEAR_JOBS),
            lambda: all_done(both, dear, DEAR_JOBS),
            lambda: engine.render(dear, SETTINGS),
            lambda: engine.render(busy, SETTINGS),
            lambda: all_done(alone, small, SMALL_JOBS),
            lambda: [engine.render(small, SETTINGS) for _ in range(SMALL_JOBS)],
        ])  # fmt: skip
    parcel = pack_job(Job("tracer", "", busy, SETTINGS))
    files = sorted((run / "records").glob("*.json"))
    summary = record.read_summary(run / "summary.json")
    overhead_s = (carried - computed) / SMALL_JOBS
    record_kb = sum(file.stat().st_size for file in files) / len(files) / 1e3
    per_case = (summary.effort.rendered + summary.effort.reused) / len(files)
    back_kb = sum(map(len, pack_result(engine.render(busy, SETTINGS)).blocks.values())) / 1e3
    average = summary.effort.renderers_cpu_s / max(1, summary.effort.rendered)
    core_h = MILLION * per_case * average / 3600
    images_tb = MILLION * per_case * back_kb / 1e9
    text = TEXT.format(
        version=summary.snellcheck_version, cores=os.cpu_count(),
        python=platform.python_version(), system=platform.system(),
        jobs=BUSY_JOBS, size=BUSY_SIZE, direct=direct, one=one, two=two,
        gain=one / two, average=average, dear_size=DEAR_SIZE, dear_jobs=DEAR_JOBS, dear=dear_direct,
        dear_one=dear_one, dear_two=dear_two, dear_gain=dear_one / dear_two,
        overhead=overhead_s * 1e3,
        there=(len(json.dumps(parcel.meta)) + sum(map(len, parcel.blocks.values()))) / 1e3,
        back=back_kb, core_h=core_h, compute=core_h * CORE_HOUR, core_hour=CORE_HOUR,
        images_tb=images_tb, shard_gb=images_tb * 10,
        keeping=MILLION * record_kb / 1e6 * GB_MONTH, gb_month=GB_MONTH,
        record=record_kb, per_case=per_case,
        client_h=MILLION * per_case * overhead_s / 3600,
        fed=average / overhead_s, fed_dear=dear_direct / overhead_s,
        shard_h=MILLION * per_case * overhead_s / 3600 / 100,
        records_gb=MILLION * record_kb / 1e6, shard_mb=MILLION / 100 * record_kb / 1e3,
    )  # fmt: skip
    write_text(PAGE, text)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
