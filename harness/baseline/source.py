"""Where baselines come from: a folder of them, a revision of git, or an earlier run."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath

from harness.baseline.document import LARGEST_BASELINE, Kept, StoredImage, parse_baseline
from harness.baseline.pictures import restore
from harness.baseline.run_folder import baselines_of_run
from harness.baseline.store import LARGEST_PICTURE, Store
from harness.errors import InputError, Problem
from harness.git import GitFailed, commit_of, git
from harness.imagefile import Pixels

FOLDER = "references"  # where baselines lie in a repository


@dataclass
class Baselines:
    """All baselines of one source by (case, renderer), and what of it could not be read.

    Large pictures come from `store` by their hash. A baseline names the store that it was approved
    into, and is not followed there: it may be anybody's, and a URL can lead anywhere.
    """

    source: str
    kept: dict[tuple[str, str], Kept] = field(default_factory=dict)
    unreadable: list[Problem] = field(default_factory=list)
    revision: str = ""
    store: Store | None = None

    def add(self, data: bytes, file: Path) -> None:
        """Takes in the baseline `data` from `file`; what is wrong with it is remembered."""
        try:
            kept = parse_baseline(data, file)
        except InputError as error:
            self.unreadable += error.problems
            return
        key = (kept.baseline.case, kept.baseline.renderer)
        if (other := self.kept.setdefault(key, kept)) is not kept:
            self.unreadable.append(Problem(f"the same case as {other.file}", file=file))

    def picture(self, kept: Kept, image: StoredImage) -> Pixels:
        """The approved picture. Raises InputError where it is not kept, missing or damaged."""
        file = kept.file.with_name(image.file) if image.file else kept.file
        if image.file:
            data = _blob(self.revision, file) if self.revision else _bytes(file)
        elif not image.store:
            raise InputError.of(f"the picture '{image.role}' was not kept", file=file)
        elif self.store is None:
            raise InputError.of(
                f"the picture '{image.role}' is in a store", file=file, value=image.store,
                expected="--store or SNELLCHECK_STORE to name the store to look in",
            )  # fmt: skip
        else:
            data = self.store.get(image.sha256)
        return restore(image, data, file)


def open_baselines(where: str, store: Store | None = None) -> Baselines:
    """The baselines that `where` names: a folder, a run's folder, or a revision of git.

    Pictures that are not beside them come from `store`, and from nowhere else. Raises InputError
    where it is none of these. Single files that cannot be read are in `unreadable`.
    """
    path = Path(where)
    if (path / "summary.json").is_file():
        found = _of_run(path)
    elif path.is_dir():
        found = _of_folder(path)
    elif path.exists():
        raise InputError.of("not a folder of baselines or of a run", file=path)
    else:
        found = _of_revision(where)
    found.store = store
    return found


def _of_folder(folder: Path) -> Baselines:
    found = Baselines(str(folder))
    for file in sorted(folder.rglob("*.json")):
        try:
            found.add(_bytes(file, LARGEST_BASELINE), file)
        except InputError as error:
            found.unreadable += error.problems
    return found


def _of_run(folder: Path) -> Baselines:
    found = Baselines(f"the run in {folder}")
    for kept in baselines_of_run(folder):
        found.kept[kept.baseline.case, kept.baseline.renderer] = kept
    return found


def _of_revision(revision: str) -> Baselines:
    try:
        name = commit_of(Path(), revision)
    except GitFailed as error:
        raise InputError.of(
            f"neither a folder nor a revision of git: {error}", key="--baseline",
            value=revision[:80],
            expected="a folder of baselines, the folder of a run, or a commit, branch or tag",
        ) from error  # fmt: skip
    found = Baselines(f"{FOLDER} at {revision} ({name[:12]})", revision=name)
    for path in _tree(name):
        if path.suffix == ".json":
            try:
                found.add(_blob(name, Path(path)), Path(path))
            except InputError as error:
                found.unreadable += error.problems
    return found


def _tree(commit: str) -> Iterator[PurePosixPath]:
    try:
        listed = git(Path(), "ls-tree", "-r", "-z", "--name-only", commit, "--", FOLDER)
    except GitFailed as error:
        message = f"{FOLDER} cannot be listed at {commit[:12]}: {error}"
        raise InputError.of(message, key="--baseline") from error
    for name in listed.split(b"\0"):
        if name:
            yield PurePosixPath(name.decode("utf-8", "replace"))


def _blob(commit: str, file: Path) -> bytes:
    try:
        data = git(Path(), "cat-file", "blob", f"{commit}:./{file.as_posix()}")
    except GitFailed as error:
        raise InputError.of(f"cannot be read at {commit[:12]}: {error}", file=file) from error
    if len(data) > LARGEST_PICTURE:
        raise InputError.of(f"larger than {LARGEST_PICTURE} bytes", file=file)
    return data


def _bytes(file: Path, most: int = LARGEST_PICTURE) -> bytes:
    try:
        with file.open("rb") as opened:
            data = opened.read(most + 1)
    except OSError as error:
        raise InputError.of(f"cannot be read: {error.strerror}", file=file) from error
    if len(data) > most:
        raise InputError.of(f"larger than {most} bytes", file=file)
    return data
