"""The packages keep to one direction of flow, and what is slow to import stays out of the way.

    scene -> translate -> renderers -> probe, measure -> verdict -> run -> record -> report

Read from the sources, without importing them.
"""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Container, Iterator
from dataclasses import dataclass
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent

# Each layer may import itself and the layers above it in this list, none below. A dotted name is a
# module that says what a later stage looks like from outside: names and protocols, no work.
LAYERS = (
    ("errors", "git", "data", "cores", "fingerprint", "documents", "outcomes", "temporary"),
    ("record", "imagefile", "expected", "expected_systems", "measure.observables"),
    ("cache", "summary_file"),
    ("scene",),
    ("renderers.base",),
    ("truth", "section", "translate"),
    ("renderers",),
    ("probe",),
    ("measure",),
    ("diagnosis",),
    ("verdict", "preflight"),
    ("report",),
    ("plan",),
    ("judging",),
    ("baseline", "packing", "packing_solids", "packing_ways", "archive"),
    ("running", "run"),
    ("history",),
    ("doctor", "ci"),
    ("show", "cli", "pytest_plugin"),
)
LAYER = {stage: depth for depth, stages in enumerate(LAYERS) for stage in stages}

# The only places of the harness that know our own tracer: it is judged like any other renderer.
TRACER_ADAPTERS = {"harness.renderers.tracer", "harness.translate.tracer"}

# Modules that work inside a renderer's own process and may load what that needs. To everybody else
# they are as heavy as what they load.
WORKER_ONLY = TRACER_ADAPTERS | {
    "harness.renderers.mitsuba_code",
    "harness.renderers.mitsuba_image",
    "harness.renderers.mitsuba_lobes",
    "harness.renderers.mitsuba_rays",
    "harness.renderers.mitsuba_sensor",
    "harness.renderers.mitsuba_ways",
    "harness.renderers.mitsuba_world",
}

# What makes `snellcheck --help` slow, or can abort the process, is imported where it is used.
HEAVY = {
    "colour",
    "dask",
    "distributed",
    "drjit",
    "fsspec",
    "imagecodecs",
    "imageio",
    "matplotlib",
    "mitsuba",
    "netpbmfile",
    "numba",
    "OpenEXR",
    "PIL",
    "scipy",
    "skimage",
    "tracer",
    "trimesh",
}


@dataclass(frozen=True)
class Import:
    """`name` as imported, dotted; `at_load` where importing the module already imports it."""

    file: str
    line: int
    name: str
    at_load: bool

    @property
    def package(self) -> str:
        return self.name.partition(".")[0]

    @property
    def stage(self) -> str | None:
        """The stage of the harness it reaches, None where it is none."""
        return stage_of(self.name)

    def __str__(self) -> str:
        return f"{self.file}:{self.line} imports {self.name}"


def stage_of(name: str) -> str | None:
    """The stage that a dotted name belongs to: "harness.scene.load" is in "scene"."""
    package, _, rest = name.partition(".")
    if package != "harness" or not rest or rest.startswith("__"):
        return None
    first, second = (*rest.split("."), "")[:2]
    return f"{first}.{second}" if f"{first}.{second}" in LAYER else first


def module_name(file: str) -> str:
    return file.removesuffix(".py").removesuffix("/__init__").replace("/", ".")


def is_for_types_only(node: ast.AST) -> bool:
    return isinstance(node, ast.If) and ast.unparse(node.test) in (
        "TYPE_CHECKING",
        "typing.TYPE_CHECKING",
    )


def imports_in(source: str, file: str = "<source>") -> Iterator[Import]:
    """Every import of a module, those inside functions and for type checkers included."""

    def visit(node: ast.AST, at_load: bool) -> Iterator[Import]:
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield Import(file, node.lineno, alias.name, at_load)
        elif isinstance(node, ast.ImportFrom):
            for alias in node.names:  # "from harness import run" reaches harness.run
                yield Import(file, node.lineno, f"{node.module}.{alias.name}", at_load)
        lazy = is_for_types_only(node) or isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
        for child in ast.iter_child_nodes(node):
            yield from visit(child, at_load and not lazy)

    return visit(ast.parse(source, file), at_load=True)


def sources(*packages: str) -> list[str]:
    """Paths of the packages' modules, from the root, with forward slashes."""
    found = [p for package in packages for p in (ROOT / package).rglob("*.py")]
    assert found, f"no sources in {packages}"
    return sorted(p.relative_to(ROOT).as_posix() for p in found)


def imports_of(file: str) -> list[Import]:
    return list(imports_in((ROOT / file).read_text(encoding="utf-8"), file))


@pytest.mark.parametrize("file", sources("tracer"))
def test_the_tracer_knows_nothing_of_the_harness(file: str) -> None:
    assert not [str(i) for i in imports_of(file) if i.package == "harness"]


@pytest.mark.parametrize("file", sources("harness"))
def test_imports_follow_the_flow(file: str) -> None:
    stage = stage_of(module_name(file))
    if stage is None:  # harness/__init__.py
        stage = "errors"
    assert stage in LAYER, f"say in LAYERS where {stage} belongs"
    upstream = {s for s, depth in LAYER.items() if depth <= LAYER[stage]}
    assert not [str(i) for i in imports_of(file) if i.stage not in {None, *upstream}]


@pytest.mark.parametrize("package", ["harness", "tracer"])
def test_modules_do_not_import_each_other_in_circles(package: str) -> None:
    """Not even inside functions: a circle means that two modules are one."""
    modules = {module_name(file): file for file in sources(package)}
    graph = {
        module: {known for i in imports_of(file) if (known := longest_known(i.name, modules))}
        for module, file in modules.items()
    }
    tuple(TopologicalSorter(graph).static_order())  # raises CycleError, which names the circle


def longest_known(name: str, modules: Container[str]) -> str | None:
    """The module that a dotted name reaches: "harness.run.suite" reaches "harness.run"."""
    while "." in name and name not in modules:
        name = name.rpartition(".")[0]
    return name if "." in name else None


@pytest.mark.parametrize("file", sources("harness/report"))
def test_reports_know_only_records(file: str) -> None:
    allowed = {None, "report", "record", "errors", "data", "measure.observables"}
    allowed |= {"summary_file"}
    assert not [str(i) for i in imports_of(file) if i.stage not in allowed]


@pytest.mark.parametrize("file", ["expected", "truth/law", "truth/paths", "truth/chord"])
def test_truth_knows_neither_the_tracer_nor_any_renderer(file: str) -> None:
    imports = imports_of(f"harness/{file}.py")
    assert not [str(i) for i in imports if i.package == "tracer"]
    assert not [str(i) for i in imports if i.stage in ("renderers", "translate")]


def test_only_its_adapters_know_the_tracer() -> None:
    for file in (f for f in sources("harness") if module_name(f) not in TRACER_ADAPTERS):
        assert not [str(i) for i in imports_of(file) if i.package == "tracer"]


def is_heavy(found: Import) -> bool:
    return found.package in HEAVY or any(
        f"{found.name}.".startswith(f"{module}.") for module in WORKER_ONLY
    )


@pytest.mark.parametrize("file", sources("harness"))
def test_heavy_modules_are_imported_where_they_are_used(file: str) -> None:
    if module_name(file) not in WORKER_ONLY:
        assert not [str(i) for i in imports_of(file) if i.at_load and is_heavy(i)]


@pytest.mark.parametrize("file", sources("harness"))
def test_nothing_is_pickled(file: str) -> None:
    pickling = {"pickle", "cloudpickle", "dill", "shelve", "marshal"}
    assert not [str(i) for i in imports_of(file) if i.package in pickling]


def test_the_command_line_loads_nothing_heavy() -> None:
    """Not even `--help`, which imports every command, and answers before one has let go the key."""
    code = (
        "import sys, harness.cli\n"
        "harness.cli.main(['--help'], standalone_mode=False)\n"
        "print(*{m.partition('.')[0] for m in sys.modules})"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=False
    )
    assert done.returncode == 0, done.stderr
    assert not (HEAVY | {"numpy", "pydantic", "rich"}) & set(done.stdout.splitlines()[-1].split())


@pytest.mark.parametrize("file", sources("harness", "tracer"))
def test_modules_are_short_and_say_what_they_are_for(file: str) -> None:
    source = (ROOT / file).read_text(encoding="utf-8")
    assert len(source.splitlines()) <= 400
    assert Path(file).stem not in {"utils", "util", "helpers", "common", "misc", "tools"}
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.FunctionDef):
            assert node.end_lineno is not None
            length = node.end_lineno - node.lineno + 1
            assert length <= 70, f"{file}:{node.lineno}: {node.name} is {length} lines long"


# --- the reading of imports, itself ---------------------------------------------------------------


@pytest.mark.parametrize(
    ("source", "name", "at_load"),
    [
        ("import scipy.special", "scipy.special", True),
        ("from harness import run", "harness.run", True),
        ("from harness.run import run_suite", "harness.run.run_suite", True),
        ("def f():\n    import scipy", "scipy", False),
        ("async def f():\n    import scipy", "scipy", False),
        ("class C:\n    import scipy", "scipy", True),
        ("try:\n    import scipy\nexcept ImportError: ...", "scipy", True),
        ("if TYPE_CHECKING:\n    import scipy", "scipy", False),
        ("if True:\n    import scipy", "scipy", True),
    ],
)
def test_imports_are_found_wherever_they_stand(source: str, name: str, at_load: bool) -> None:
    assert [(i.name, i.at_load) for i in imports_in(source)] == [(name, at_load)]


@pytest.mark.parametrize(
    ("source", "heavy"),
    [
        ("import scipy.special", True),
        ("from harness.renderers import mitsuba_rays", True),
        ("from harness.renderers.mitsuba_rays import follow", True),
        ("from harness.renderers import mitsuba", False),
        ("import json", False),
    ],
)
def test_a_module_is_as_heavy_as_what_it_loads(source: str, heavy: bool) -> None:
    (found,) = imports_in(source)
    assert is_heavy(found) is heavy


@pytest.mark.parametrize(
    ("name", "stage"),
    [
        ("harness.renderers.registry.available", "renderers"),
        ("harness.renderers.base.Health", "renderers.base"),
        ("harness.run", "run"),
        ("harness", None),
        ("harness.__version__", None),
        ("numpy.linalg", None),
    ],
)
def test_a_stage_is_what_follows_the_package(name: str, stage: str | None) -> None:
    assert stage_of(name) == stage
