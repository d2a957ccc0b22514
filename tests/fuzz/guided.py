"""Fuzzing that is guided by coverage: files are changed towards code that none has reached before.

``make guided KIND=baseline SECONDS=60`` where atheris has a wheel, which is Linux on x86-64. What
was found of interest is kept in reports/guided and gone on from; what is a fault is left there,
too, and ends it with a traceback. The campaign of `tests.fuzz.campaign` runs anywhere and repeats
itself; this one finds what nobody thought of.
"""

from __future__ import annotations

import sys

import atheris

with atheris.instrument_imports(include=["harness", "tomllib", "trimesh"]):
    from tests.fuzz.campaign import HANG_S, MOST_MB, Outcome, judged
    from tests.fuzz.targets import ROOT, kinds, prepare_folder

LARGEST = 8192  # bytes of a file


class Fault(Exception):
    """What must not be."""


def main(name: str, seconds: str) -> None:
    """Fuzzes the kind of file `name`. Raises SystemExit where there is no such kind."""
    found = {kind.name: kind for kind in kinds()}
    if name not in found:
        raise SystemExit(f"no kind of file {name!r}; expected one of {', '.join(found)}")
    kind = found[name]
    folder = ROOT / "reports" / "guided" / "".join(c if c.isalnum() else "-" for c in name)
    corpus = folder / "corpus"
    corpus.mkdir(parents=True, exist_ok=True)
    for index, seed in enumerate(kind.seeds):
        (corpus / f"seed-{index}").write_bytes(seed)
    prepare_folder(kind, folder)
    path, outcome = folder / kind.file, Outcome(name)

    def read(data: bytes) -> None:
        path.write_bytes(data)
        if wrong := judged(kind, path, outcome):
            raise Fault(wrong)

    limits = (f"-timeout={HANG_S:.0f}", f"-rss_limit_mb={2 * MOST_MB}", f"-max_len={LARGEST}")
    place = f"-artifact_prefix={folder}/"
    atheris.Setup([sys.argv[0], str(corpus), f"-max_total_time={seconds}", place, *limits], read)
    atheris.Fuzz()


if __name__ == "__main__":
    main(*sys.argv[1:])
