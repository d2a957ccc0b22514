"""What a run leaves behind: records, images, and the scenes that renderers were given."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import platform
from collections.abc import Callable, Iterator, Mapping
from itertools import combinations
from pathlib import Path, PurePosixPath

import numpy as np

from harness import __version__, plan, record
from harness.documents import PARTIAL
from harness.errors import ImageNotFinite, RendererError, RendererFailed, utf8
from harness.judging.judge import Judgement
from harness.judging.results import Contender, Results
from harness.measure.images import Pixels
from harness.packing import write_pack
from harness.packing_ways import PictureWays, unusable
from harness.plan import PreparedCase
from harness.probe.scenes import AXES
from harness.probe.view import view_of_codes, view_of_rays
from harness.record import CaseRecord, DifferenceMap, ImageFile, RendererRun, Table, Verdict, worst
from harness.renderers.base import Image, RayPaths, RenderSettings
from harness.scene.fingerprint import fingerprint

LOG_LINES = 40
ENDINGS = (".json", ".js", ".baseline.js")  # records and scenes, a case's pictures, approved ones
PLATFORM = f"{platform.system()} {platform.machine()}"
# The range of all difference maps, logarithmic, the same for all renderers and cases, and that of
# the page's own maps: rounding in single precision is dark, what an eye could see is bright.
LEAST_DIFFERENCE, LARGEST_DIFFERENCE = 1e-9, 1.0


def folder_name(case_id: str) -> str:
    """A file name for a case: letters, digits and ``._-`` only, and unique."""
    plain = "".join(c if c.isalnum() or c in "._-" else "_" for c in case_id)[:80]
    return f"{plain}-{hashlib.sha256(case_id.encode()).hexdigest()[:8]}"


def belongs(path: str, name: str) -> bool:
    """Whether a path relative to a run's folder is of the case whose `folder_name` is `name`.

    All that is written for a case is ``FOLDER/NAME`` with one of `ENDINGS`, or ``FOLDER/NAME/…``;
    the report's pages in ``cases/`` are made anew from that.
    """
    parts = PurePosixPath(path).parts
    if len(parts) < 2 or parts[0] in ("/", "cases") or ".." in parts:
        return False
    if len(parts) > 2:
        return parts[1] == name
    return parts[1] in {f"{name}{ending}" for ending in ENDINGS}


class Archive:
    """The folder of one run."""

    def __init__(self, root: Path) -> None:
        self.root = root

    def write_case(
        self,
        case: PreparedCase,
        contenders: list[Contender],
        results: Results,
        judgement: Judgement,
        seconds: Mapping[str, float],
        settings: RenderSettings,
        translated: Callable[[str, Path], None],
        *,
        quality: str,
        started: str,
        wall_s: float,
    ) -> CaseRecord:
        """Writes the images of a case, its scene and its record; returns the record.

        `translated(name, folder)` writes what a renderer was given into a folder, where that is
        not scene.json.
        """
        loaded, name = case.loaded, folder_name(case.loaded.id)
        self.discard(name)
        scene_json = case.scene.model_dump_json()
        record.write_text(self.root / "scenes" / f"{name}.json", scene_json)
        runs = [
            self._run(case, c, name, results, judgement, seconds, settings).model_copy(
                update={"files": self._given(c.name, name, translated)}
            )
            for c in contenders
        ]
        pack = f"data/{name}.js"
        write_pack(
            self.root / pack, loaded.id, _pictures(case, contenders, results), judgement.rays,
            *_ways(case, contenders, results),
        )  # fmt: skip
        written = CaseRecord(
            id=loaded.id,
            case=loaded.case,
            family=loaded.model.family,
            title=loaded.model.title,
            description=loaded.model.description.strip(),
            lecture=loaded.model.lecture,
            sources=list(loaded.model.sources),
            formula=loaded.model.formula,
            parameters=dict(loaded.parameters),
            scene_sha256=hashlib.sha256(scene_json.encode()).hexdigest(),
            scene_fingerprint=fingerprint(case.scene),
            scene_file=f"{loaded.file.parent.name}/{loaded.file.name}",
            scene_path=_from_here(loaded.file),
            platform=PLATFORM,
            quality=quality,
            snellcheck_version=__version__,
            started=started,
            wall_s=wall_s,
            status=worst([check.status for check in judgement.checks]),
            runs=runs,
            checks=judgement.checks,
            curves=judgement.curves,
            differences=self._differences(name, contenders, results),
            tables=[Table.model_validate(t.model_dump(mode="json")) for t in loaded.model.tables],
            files={"scene.json": f"scenes/{name}.json"},
            diagnoses=judgement.diagnoses,
            pack=pack,
        )
        record.write(written, self.root / "records" / f"{name}.json")
        return written

    def discard(self, name: str) -> None:
        """Removes what an earlier run left of a case, its record first: no record, no case."""
        (self.root / "records" / f"{name}.json").unlink(missing_ok=True)
        for path in self.files(name):
            (self.root / path).unlink(missing_ok=True)

    def sweep(self) -> None:
        """Removes files that a run was writing when it was killed."""
        found = [*self.root.glob(".*")]
        for folder in ("assets", "cases", "data", "images", "records", "scenes"):
            found += (self.root / folder).rglob(".*")
        for path in found:
            if PARTIAL.fullmatch(path.name) and path.is_file():
                path.unlink(missing_ok=True)

    def files(self, name: str) -> list[str]:
        """The paths of all that belongs to a case, its record last, relative to the folder."""
        # Asked for each case, so nothing is listed that grows with their number.
        found = []
        for folder in self.root.glob("*"):
            found += [folder / f"{name}{ending}" for ending in ENDINGS]
            found += (folder / name).rglob("*")
        paths = [path.relative_to(self.root).as_posix() for path in found if path.is_file()]
        mine = [path for path in paths if belongs(path, name)]
        return sorted(mine, key=lambda path: (path.startswith("records/"), path))

    def _run(
        self,
        case: PreparedCase,
        contender: Contender,
        name: str,
        results: Results,
        judgement: Judgement,
        seconds: Mapping[str, float],
        settings: RenderSettings,
    ) -> RendererRun:
        mine = {role: r for (who, role), r in results.by_role.items() if who == contender.name}
        # Nothing is judged on the ways of rays: without them a diagram is missing, and no more.
        errors = [
            r for role, r in mine.items() if isinstance(r, RendererError) and role != plan.WAYS
        ]
        status, reason = Verdict.PASS, contender.reason
        if contender.stored is not None:
            status = worst([c.status for c in judgement.checks if c.renderer == contender.name])
        elif contender.absent is not None:
            status = contender.absent
        elif errors:
            failed = any(isinstance(e, RendererFailed) for e in errors)
            status, reason = Verdict.ERROR if failed else Verdict.SKIP, str(errors[0])
        else:
            checks = [c.status for c in judgement.checks if c.renderer == contender.name]
            status = worst(checks) if checks else Verdict.PASS
        images = [r for r in mine.values() if isinstance(r, Image)]
        logs = [e.log for e in errors] + [i.log for i in images if i.log]
        return RendererRun(
            name=contender.name,
            version=contender.version,
            status=status,
            reason=reason,
            render_s=seconds.get(contender.name, 0.0),
            renders=len(mine),
            command=next((i.command for i in images if i.command), ""),
            log_tail="\n".join(logs[0].splitlines()[-LOG_LINES:]) if logs else "",
            settings=dataclasses.asdict(settings),
            images=self._images(case, contender.name, name, mine),
            capabilities=sorted(contender.capabilities),
            facts=contender.preflight.facts() if contender.preflight else {},
            stored=contender.stored,
        )

    def _given(
        self, renderer: str, name: str, translated: Callable[[str, Path], None]
    ) -> dict[str, str]:
        """Writes what a renderer was given; the paths of the files by their names."""
        folder = self.root / "scenes" / name / renderer
        translated(renderer, folder)
        written = sorted(path for path in folder.rglob("*") if path.is_file())
        return {
            path.relative_to(folder).as_posix(): path.relative_to(self.root).as_posix()
            for path in written
        }

    def _images(
        self, case: PreparedCase, renderer: str, name: str, mine: Mapping[str, object]
    ) -> list[ImageFile]:
        from harness import imagefile
        from harness.report.pictures import write_picture, write_thumbnail

        files = []
        for role, shown in _shown(case, mine):
            stem = f"images/{name}/{renderer}-{role}"
            imagefile.write_exr(self.root / f"{stem}.exr", shown)
            write_picture(shown, self.root / f"{stem}.webp")
            write_thumbnail(shown, self.root / f"{stem}-small.webp")
            pixels = np.ascontiguousarray(shown, np.dtype("<f4"))
            height, width = pixels.shape[:2]
            mean, mean_error = _means(pixels, mine.get(plan.SECOND_IMAGE), role)
            files.append(
                ImageFile(
                    role=role,
                    path=f"{stem}.exr",
                    picture=f"{stem}.webp",
                    thumbnail=f"{stem}-small.webp",
                    sha256=hashlib.sha256(pixels.tobytes()).hexdigest(),
                    width=width,
                    height=height,
                    mean=mean,
                    mean_error=mean_error,
                    cut=_cut(mine.get(role)),
                )
            )
        return files

    def _differences(
        self, name: str, contenders: list[Contender], results: Results
    ) -> list[DifferenceMap]:
        from harness.report.pictures import write_difference

        pictures = {}
        for contender in contenders:
            image = results.by_role.get((contender.name, plan.IMAGE))
            if isinstance(image, Image) and image.pixels.shape[:2] == (
                results.height, results.width,
            ):  # fmt: skip
                pictures[contender.name] = image.pixels
        maps = []
        low, limit = LEAST_DIFFERENCE, LARGEST_DIFFERENCE
        for a, b in combinations(pictures, 2):
            path = f"images/{name}/difference-{a}-{b}.webp"
            write_difference(pictures[a], pictures[b], limit, self.root / path, low)
            maps.append(DifferenceMap(a=a, b=b, path=path, limit=limit, unit="radiance", low=low))
        return maps


def _means(pixels: Pixels, second: object, role: str) -> tuple[list[float], list[float]]:
    """The mean of each channel, and where there is a picture of a second seed its standard error.

    The difference of the two has twice the variance of one; with N pixels of independent noise the
    mean of one has the standard error sqrt(mean square of the difference / 2 / N).
    """
    # Views of probes show as not finite what was not measured.
    if role != plan.IMAGE or not np.isfinite(pixels).all():
        return [], []
    mean = pixels.mean(axis=(0, 1), dtype=np.float64)
    if not isinstance(second, Image) or second.pixels.shape != pixels.shape:
        return mean.tolist(), []
    difference = pixels.astype(np.float64) - second.pixels
    count = difference.shape[0] * difference.shape[1]
    error = np.sqrt((difference**2).mean(axis=(0, 1)) / 2 / count)
    return mean.tolist(), error.tolist()


def _from_here(file: Path) -> str:
    """The path from the working folder where it is below that; with forward slashes."""
    path = file.absolute()
    here = Path.cwd()
    return utf8((path.relative_to(here) if path.is_relative_to(here) else path).as_posix())


def _cut(result: object) -> float | None:
    return result.cut if isinstance(result, Image) else None


def _shown(case: PreparedCase, mine: Mapping[str, object]) -> Iterator[tuple[str, Pixels]]:
    """The picture worth keeping, by role: the scene's own, or how its first probe looks.

    One that is not finite is kept as well: where it is not, is what one wants to see.
    """
    image = mine.get(plan.IMAGE)
    if isinstance(image, ImageNotFinite) and image.image is not None:
        yield plan.IMAGE, image.image
    elif isinstance(image, Image):
        yield plan.IMAGE, image.pixels
    elif case.loaded.model.probes:
        probe = case.probe(None)
        traced = mine.get(plan.trace_role(probe))
        coded = mine.get(plan.code_role(probe, 0, AXES[0]))
        lit = mine.get(plan.light_role(probe))
        if isinstance(traced, RayPaths):
            view = view_of_rays(traced, case.planes(probe)[0], case.scene.film)
            if view is not None:
                yield "probe", view
        elif isinstance(coded, Image):
            yield "probe", view_of_codes(coded.pixels)
        elif isinstance(lit, Image):
            yield "probe", lit.pixels


def _pictures(
    case: PreparedCase, contenders: list[Contender], results: Results
) -> dict[tuple[str, str], Pixels]:
    """All pictures worth keeping, by renderer and role."""
    found = {}
    for contender in contenders:
        mine = {role: r for (who, role), r in results.by_role.items() if who == contender.name}
        for role, pixels in _shown(case, mine):
            found[contender.name, role] = np.asarray(pixels, np.float32)
    return found


def _ways(
    case: PreparedCase, contenders: list[Contender], results: Results
) -> tuple[list[PictureWays], dict[str, str]]:
    """The ways of the pictures' rays, and why there are none of the other renderers."""
    found, silent = [], {}
    for contender in contenders:
        if not case.wants_ways(contender.name):
            continue
        told = results.by_role.get((contender.name, plan.WAYS))
        if isinstance(told, RayPaths):
            scene = plan.scene_of_ways(case, contender.capabilities)
            if problem := unusable(told, len(plan.way_pixels(scene.film))):
                silent[contender.name] = problem
            else:
                step, nm = plan.way_step(scene.film), plan.wavelength_of_ways(case)
                found.append(PictureWays(contender.name, scene, step, told, nm))
        elif isinstance(told, RendererError):
            silent[contender.name] = str(told)
        else:
            silent[contender.name] = contender.reason or "it does not tell where its rays go"
    return found, silent


def scene_text(case: PreparedCase) -> str:
    """scene.json, indented for people."""
    return json.dumps(json.loads(case.scene.model_dump_json()), indent=1)
