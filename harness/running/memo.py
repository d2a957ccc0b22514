"""What is known already of one renderer's work, so that nothing is done twice.

A renderer that tells its fingerprint is remembered in the cache, from run to run. One that cannot
is remembered under its version in the run's own folder, until the run is done: so that a run that
was killed can go on, and the next one sees what has changed since.
"""

from __future__ import annotations

from dataclasses import dataclass

from harness.cache.cache import Cache
from harness.fingerprint import code_digest, combined
from harness.judging.results import Contender, Result
from harness.plan import Job
from harness.renderers.base import Renderer, RenderSettings
from harness.running.parcel import (
    Parcel,
    job_key,
    load_packers,
    pack_contender,
    pack_result,
    unpack_contender,
    unpack_result,
)


@dataclass(frozen=True)
class Known:
    """A result from earlier, and the seconds of wall time that it took then."""

    result: Result
    seconds: float


@dataclass(frozen=True)
class Memo:
    """The work of `renderer` that is known under `fingerprint`; `lasting` beyond this run."""

    renderer: str
    fingerprint: str
    cache: Cache | None
    lasting: bool

    def calibration(self, settings: RenderSettings) -> Contender | None:
        """The renderer as it was calibrated before."""
        entry = self.cache and self.cache.get(self._calibration_key(settings))
        return unpack_contender(entry.meta) if entry else None

    def keep_calibration(self, settings: RenderSettings, contender: Contender) -> None:
        """Only a success is worth keeping: what is broken may have been mended by the next run."""
        if self.cache is not None and contender.absent is None:
            self.cache.put(self._calibration_key(settings), pack_contender(contender), {})

    def key(self, job: Job) -> str:
        """What the job's result is known by.

        Found before the job is done, since what is finished must be kept at once: whatever else
        is done first is time in which a kill loses it.
        """
        return job_key(job, self.fingerprint)

    def result(self, key: str) -> Known | None:
        """What the job of `key` delivered before. Where there is nothing, gets ready to `keep`."""
        if self.cache is None:
            return None
        entry = self.cache.get(key)
        if entry is None:
            load_packers()
            return None
        return Known(unpack_result(Parcel(entry.meta, entry.blocks)), entry.meta["wall_s"])

    def keep(self, key: str, result: Result, seconds: float) -> None:
        """Keeps a result, but no error: it costs little to meet again, and may not happen again."""
        if self.cache is None or isinstance(result, Exception):
            return
        parcel = pack_result(result)
        self.cache.put(key, {**parcel.meta, "wall_s": seconds}, parcel.blocks)

    def _calibration_key(self, settings: RenderSettings) -> str:
        told = (str(settings.samples), str(settings.seed), code_digest("harness.preflight"))
        return combined("calibration", self.renderer, self.fingerprint, *told)


def memo_of(renderer: Renderer, lasting: Cache | None, passing: Cache) -> Memo:
    """The memo of `renderer` in the `lasting` cache, or in the `passing` one of its run.

    Never raises: whatever is wrong with the renderer shows when it is calibrated.
    """
    tell = getattr(renderer, "fingerprint", None)
    try:
        if tell is not None and (fingerprint := tell()):
            return Memo(renderer.name, fingerprint, lasting or passing, lasting is not None)
        return Memo(renderer.name, f"version {renderer.version()}", passing, lasting=False)
    except (Exception, SystemExit):  # a third party's code can raise anything
        return Memo(renderer.name, "", None, lasting=False)
