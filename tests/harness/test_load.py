"""Scene files become cases, or one message per mistake with its place and what to do."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from harness.errors import InputError, Problem
from harness.scene.findings import dotted, lines_of_keys
from harness.scene.load import case_name, find, load_cases
from harness.scene.resolve import resolve
from tests.strategies import documents, to_toml

SCENES = Path(__file__).parents[2] / "scenes"

SCENE = """\
format = 1
title = "A ball"
family = "ball"
sources = ["a book"]

[camera]
type = "perspective"
origin = [0, 0, 6]
target = [0, 0, 0]
fov_x = 30

[media.glass]
ior = 1.5

[[solids]]
name = "ball"
medium = "glass"
shape = { type = "sphere", radius = 1 }

[[surfaces]]
name = "back"
shape = { type = "rectangle", center = [0, 0, -3], size = [16, 16] }
material = { type = "emissive", pattern = { type = "constant", radiance = [1, 1, 1] } }

[[probes]]
name = "through"
path = "TT"
planes = [{ type = "rectangle", center = [0, 0, -3], size = [16, 16] }]

[[checks]]
observable = "ssim"
against = "renderers"
"""


@pytest.fixture
def scene_file(tmp_path: Path) -> Path:
    path = tmp_path / "ball" / "plain.toml"
    path.parent.mkdir()
    path.write_text(SCENE)
    return path


def problems(path: Path, text: str | bytes | None = None) -> list[Problem]:
    """What is wrong with a file; it must be something, and each problem must have a place."""
    if isinstance(text, str):
        text = text.encode()
    if text is not None:
        path.write_bytes(text)
    with pytest.raises(InputError) as caught:
        load_cases(path)
    assert all(problem.file == path for problem in caught.value.problems)
    return caught.value.problems


def problem(path: Path, text: str) -> Problem:
    (only,) = problems(path, text)
    return only


# --- what loads -----------------------------------------------------------------------------------


def test_all_scenes_of_the_suite_load() -> None:
    cases = find([], SCENES)
    assert len({case.id for case in cases}) == len(cases) >= 2


def test_axes_give_one_case_each(scene_file: Path) -> None:
    text = SCENE.replace("ior = 1.5", 'ior = "=n"') + "\n[axes]\nn = [1.5, 2]\nword = ['a', 'b']\n"
    scene_file.write_text(text + "[parameters]\nhalf = '=n / 2'\n")
    cases = load_cases(scene_file)
    assert [case.id for case in cases] == [
        "ball-plain[n=1.5,word=a]",
        "ball-plain[n=1.5,word=b]",
        "ball-plain[n=2,word=a]",
        "ball-plain[n=2,word=b]",
    ]
    assert {case.case for case in cases} == {"ball-plain"}
    assert [case.model.media["glass"].ior for case in cases] == [1.5, 1.5, 2, 2]
    assert cases[2].parameters == {"n": 2, "word": "a", "half": 1}


def test_a_word_may_name_a_medium(scene_file: Path) -> None:
    text = SCENE.replace('medium = "glass"', 'medium = "=kind"')
    scene_file.write_text(
        text + "\n[media.water]\nior = 1.333\n[axes]\nkind = ['glass', 'water']\n"
    )
    assert [c.model.solids[0].medium for c in load_cases(scene_file)] == ["glass", "water"]


@pytest.mark.parametrize(
    ("quality", "scalable", "size"),
    [
        ("draft", True, (50, 2)),
        ("normal", True, (101, 3)),
        ("high", True, (202, 6)),
        ("high", False, (101, 3)),
    ],
)
def test_quality_scales_the_film(
    scene_file: Path, quality: str, scalable: bool, size: tuple[int, int]
) -> None:
    film = f"[film]\nwidth = 101\nheight = 3\nscalable = {str(scalable).lower()}\n"
    scene_file.write_text(SCENE + film)
    (case,) = load_cases(scene_file, quality)
    assert (case.model.film.width, case.model.film.height) == size


def test_the_largest_film_doubles(scene_file: Path) -> None:
    scene_file.write_text(SCENE + "[film]\nwidth = 8192\nheight = 8192\n")
    (case,) = load_cases(scene_file, "high")
    assert resolve(case).film.width == 16384


def test_case_names_are_fit_for_files() -> None:
    assert case_name(Path("scenes/slab/offset.toml")) == "slab-offset"
    assert case_name(Path("/My scenes/été & co.toml")) == "My-scenes-t-co"


# --- what does not --------------------------------------------------------------------------------

SHAPES = (
    "box, cone, cylinder, difference, icosphere, intersection, lens, mesh, plane, polygons, prism, "
    "slab, sphere, triangles, union or wedge"
)
EDITS = {
    # name: (old, new, line, key, message, value, expected, suggestion); None matches anything
    "unknown key": (
        "fov_x = 30",
        "fov_x = 30\nfocus = 2",
        11, "camera.focus", "unknown key", None,
        "fov_x, medium, origin, target, type or up", None,
    ),
    "misspelt key": (
        "radius = 1", "radus = 1",
        18, "solids[0].shape.radus", "unknown key", None, "center, radius, rotate or type",
        "radius",
    ),
    "misspelt table": (
        "[media.glass]", "[meda.glass]",
        12, "meda", "unknown key", None, None, "media",
    ),
    "missing key": (
        "ior = 1.5", "",
        12, "media.glass.ior", "missing", None,
        "a number ≥ 0.001 and ≤ 1000, or one of glass, sellmeier, cauchy, abbe instead", None,
    ),
    "missing table": (
        '[camera]\ntype = "perspective"\norigin = [0, 0, 6]\ntarget = [0, 0, 0]\nfov_x = 30', "",
        1, "camera", "missing", None,
        "a table of type orthographic, perspective or thin_lens", None,
    ),
    "missing type": (
        'type = "sphere", ', "",
        18, "solids[0].shape.type", "missing", None,
        SHAPES, None,
    ),
    "unknown shape": (
        '"sphere"', '"shpere"',
        18, "solids[0].shape.type", "unknown type", '"shpere"',
        SHAPES, "sphere",
    ),
    "unknown material": (
        '"emissive"', '"emisive"',
        23, "surfaces[0].material.type", "unknown type", '"emisive"',
        "diffuse, emissive, mirror, phong, thin_slab or translucent", "emissive",
    ),
    "unknown pattern": (
        '"constant"', '"chequer"',
        23, "surfaces[0].material.pattern.type", "unknown type", '"chequer"',
        "checker, constant, picture or ramp", "checker",
    ),
    "unknown camera": (
        '"perspective"', '"fisheye"',
        7, "camera.type", "unknown type", '"fisheye"',
        "orthographic, perspective or thin_lens", None,
    ),
    "unknown format": (
        "format = 1", "format = 2", 1, "format", "unknown format", "2", "1", None,
    ),
    "text for a number": (
        "radius = 1", 'radius = "1"',
        18, "solids[0].shape.radius", "wrong type", '"1"', "a number > 0 and ≤ 1e+12", None,
    ),
    "truth value for a number": (
        "radius = 1", "radius = true",
        18, "solids[0].shape.radius", "wrong type", "true", None, None,
    ),
    "number out of range": (
        "radius = 1", "radius = -1",
        18, "solids[0].shape.radius", "out of range", "-1", "> 0", None,
    ),
    "not a number": (
        "radius = 1", "radius = nan",
        18, "solids[0].shape.radius", "wrong type", "NaN", None, None,
    ),
    "index of zero": (
        "ior = 1.5", "ior = 0.0",
        13, "media.glass.ior", "out of range", "0.0", "≥ 0.001", None,
    ),
    "short vector": (
        "origin = [0, 0, 6]", "origin = [0, 6]",
        8, "camera.origin", "2 elements", "[0, 6]", "an array of 3 numbers", None,
    ),
    "long vector": (
        "origin = [0, 0, 6]", "origin = [0, 0, 6, 1]",
        8, "camera.origin", "4 elements", "[0, 0, 6, 1]", "an array of 3 numbers", None,
    ),
    "not a vector": (
        "origin = [0, 0, 6]", "origin = 6",
        8, "camera.origin", "wrong type", "6", "an array of 3 numbers", None,
    ),
    "bad name": (
        'name = "ball"', 'name = "a\\"ball\\""',
        16, "solids[0].name", "not a valid text", '"a\\"ball\\""',
        "a name: a letter, then letters, digits, _ and -", None,
    ),
    "bad path": (
        'path = "TT"', 'path = "TXT"',
        27, "probes[0].path", "not a valid text", '"TXT"', "letters T and R, as in TRT", None,
    ),
    "no planes": (
        'planes = [{ type = "rectangle", center = [0, 0, -3], size = [16, 16] }]', "planes = []",
        28, "probes[0].planes", "0 elements", "[]", "an array of 1 to 2 elements", None,
    ),
    "table for an array of tables": (
        "[[checks]]", "[checks]", 30, "checks", "wrong type", None, "an array of at least 1", None,
    ),
    "unknown medium": (
        'medium = "glass"', 'medium = "glas"',
        17, "solids[0].medium", "unknown medium", '"glas"', "air, glass", "glass",
    ),
    "unknown medium of the camera": (
        "fov_x = 30", 'fov_x = 30\nmedium = "water"',
        11, "camera.medium", "unknown medium", '"water"', "air, glass", None,
    ),
    "unknown observable": (
        '"ssim"', '"sssim"', 31, "checks[0].observable", "unknown observable", '"sssim"', None,
        "ssim",
    ),
    "unknown opponent": (
        'against = "renderers"', 'against = "renderer"',
        32, "checks[0].against", "unknown renderer", '"renderer"', None, "renderers",
    ),
    "unknown probe": (
        'observable = "ssim"\nagainst = "renderers"',
        'observable = "exit_point"\nprobe = "trough"',
        32, "checks[0].probe", "unknown probe", '"trough"', "through", "through",
    ),
    "no probe": (
        'observable = "ssim"\nagainst = "renderers"', 'observable = "exit_point"',
        30, "checks[0].probe", "missing", None, "through", None,
    ),
    "probe of another kind": (
        'observable = "ssim"\nagainst = "renderers"',
        'observable = "reflectance"\nprobe = "through"',
        32, "checks[0].probe", "reflectance needs another probe", '"through"',
        'a probe with measure = "light"', None,
    ),
    "probe for a picture": (
        'against = "renderers"', 'against = "renderers"\nprobe = "through"',
        33, "checks[0].probe", "ssim is measured without a probe", None, None, None,
    ),
    "picture against truth": (
        'against = "renderers"', '',
        30, "checks[0].against", "ssim cannot be compared with it", '"truth"',
        "renderers or a renderer's name", None,
    ),
    "rays against renderers": (
        'observable = "ssim"', 'observable = "tir"\nprobe = "through"',
        33, "checks[0].against", "tir cannot be compared with it", '"renderers"', "truth", None,
    ),
    "tolerance without derivation": (
        'against = "renderers"', 'against = "renderers"\ntolerance = 0.1',
        30, "checks[0].derivation", "missing", None, "where the tolerance comes from", None,
    ),
    "unknown renderer of a known deviation": (
        'against = "renderers"',
        'against = "renderers"\n'
        'known = [{ renderer = "povrey", at_least = 0, at_most = 1, cause = "it is misspelt" }]',
        33, "checks[0].known[0].renderer", "unknown renderer", '"povrey"', None, "povray",
    ),
    "empty range of a known deviation": (
        'against = "renderers"',
        'against = "renderers"\n'
        'known = [{ renderer = "povray", at_least = 2, at_most = 1, cause = "it is reversed" }]',
        33, "checks[0].known[0].at_most", "less than at_least", "1", "≥ 2", None,
    ),
    "unknown renderer of a check": (
        'against = "renderers"', 'against = "renderers"\nrenderers = ["tracer", "mitsba"]',
        33, "checks[0].renderers[1]", "unknown renderer", '"mitsba"', None, "mitsuba",
    ),
    "unknown name in an expression": (
        "radius = 1", 'radius = "=raduis"',
        18, "solids[0].shape.radius", "unknown name raduis", '"=raduis"', None, None,
    ),
    "expression out of range": (
        "ior = 1.5", 'ior = "=sind(0)"',
        13, "media.glass.ior", "out of range", '"=sind(0)" = 0', "≥ 0.001", None,
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", EDITS)
def test_a_mistake_is_one_message(scene_file: Path, name: str) -> None:
    old, new, line, key, message, value, expected, suggestion = EDITS[name]
    assert SCENE.count(str(old)) == 1
    found = problems(scene_file, SCENE.replace(str(old), str(new)))
    one = found[0]
    assert (one.line, one.key, one.message) == (line, key, message)
    assert value in (None, one.value)
    assert expected in (None, one.expected)
    assert suggestion in (None, one.suggestion)
    assert "\n" not in str(one)
    assert "pydantic" not in str(one)
    # A missing medium is also missed where it is used; nothing else follows from a mistake.
    assert len(found) == (2 if name == "misspelt table" else 1), [str(p) for p in found]


def test_all_mistakes_are_reported_at_once_in_the_order_of_the_file(scene_file: Path) -> None:
    text = SCENE
    chosen = [
        "misspelt key", "unknown material", "index of zero", "unknown observable", "bad path",
        "unknown camera",
    ]  # fmt: skip
    for name in chosen:
        text = text.replace(str(EDITS[name][0]), str(EDITS[name][1]))
    found = problems(scene_file, text)
    assert [p.line for p in found] == sorted(p.line or 0 for p in found)
    for name in chosen:
        assert EDITS[name][3] in [p.key for p in found]


def test_a_name_used_twice_is_a_mistake(scene_file: Path) -> None:
    again = '\n[[solids]]\nname = "ball"\nmedium = "glass"\nshape = {type = "sphere", radius = 2}\n'
    one = problem(scene_file, SCENE + again)
    assert (one.line, one.key, one.message) == (35, "solids[1].name", "name used twice")


def test_where_renderers_disperse_only_a_furnace_has_a_truth(scene_file: Path) -> None:
    found = problems(scene_file, SCENE + "\n[transport]\ndispersion = true\n")
    assert [p.key for p in found] == ["surfaces", "probes"]
    assert {p.message for p in found} == {"has no truth where renderers disperse by themselves"}


def test_a_permutations_mistake_is_said_once_with_its_parameters(scene_file: Path) -> None:
    text = SCENE.replace("radius = 1", 'radius = "=1 - r"')
    one = problem(scene_file, text + "\n[axes]\nr = [0.5, 1, 1.5]\n")
    assert (one.line, one.value) == (18, '"=1 - r" = 0 (at r = 1)')


def test_further_renderers_may_be_named(scene_file: Path) -> None:
    scene_file.write_text(SCENE.replace('"renderers"', '"mytracer"'))
    (case,) = load_cases(scene_file, renderers=["mytracer"])
    assert case.model.checks[0].against == "mytracer"


@pytest.mark.parametrize(
    ("text", "line", "message"),
    [
        ("a = 1\nb = \n", 2, "not valid TOML: Invalid value in column 5"),
        ("a = 1\na = 2\n", 2, "not valid TOML: Cannot overwrite a value in column 6"),
        ('a = "x', 1, "not valid TOML: Unterminated string (at end of document)"),
        (b"a = 1\nb = '\xff'\n", 2, "not UTF-8 text"),
        ("a = " + "[" * 3000 + "]" * 3000, None, "nested too deeply"),
        ("a = " + "9" * 5000, 1, "not valid TOML: a number of thousands of digits"),
        (b"a = 1\0", 1, "not valid TOML"),
    ],
)
def test_what_is_not_toml_is_said_with_its_line(
    tmp_path: Path, text: str | bytes, line: int | None, message: str
) -> None:
    (one,) = problems(tmp_path / "x.toml", text)
    assert one.line == line
    assert message in one.message


HOSTILE = {
    "a table per letter": "solids = [" + "{}," * 200_000 + "]\n",
    "a deep header": "[" + ".".join(["a"] * 20_000) + "]\n",
    "a deep key": "a = {" + ".".join(['"b\\".c"'] * 5000) + " = 1}\n",
    "deep tables": "a = " + "{b = " * 500 + "1" + "}" * 500 + "\n",
    "a bracket per letter": "a = " + "[" * 500_000 + "\n",
    "work without end": "[axes]\nq = {start = 1, stop = 9999, step = 1}\n[[tables]]\nrows = ["
    + "['x'], " * 5000
    + "]\n",
    "a long key": "a" * 1_000_000 + " = 1\n",
    "a million dots": "a = '" + "." * 1_000_000 + "'\n",
}


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_files_are_refused(tmp_path: Path, name: str) -> None:
    found = problems(tmp_path / "x.toml", SCENE + HOSTILE[name])
    assert all(len(str(one)) < 1000 for one in found)


def test_unreadable_files_are_one_message(tmp_path: Path) -> None:
    assert "No such file" in problems(tmp_path / "none.toml")[0].message
    assert "cannot be read" in problems(tmp_path)[0].message
    (tmp_path / "big.toml").write_bytes(b"#" * (4 * 2**20 + 1))
    assert "larger than" in problems(tmp_path / "big.toml")[0].message


def test_messages_show_values_on_one_short_line(scene_file: Path) -> None:
    hostile = '"<b>\\u001b[31m\\n' + "x" * 10_000 + '"'
    one = problem(scene_file, SCENE.replace("radius = 1", f"radius = {hostile}"))
    assert one.value is not None
    assert len(one.value) <= 80
    assert str(one).isprintable()


def test_an_unknown_quality_is_a_mistake(scene_file: Path) -> None:
    with pytest.raises(InputError, match="did you mean draft"):
        load_cases(scene_file, "drft")


# --- positions ------------------------------------------------------------------------------------


def test_lines_of_all_kinds_of_keys() -> None:
    source = b"""\
a.b = 1
"quo ted".'x' = 2
[t.u]
c = [
  1, # a comment
  { d = 2, e.f = 3 },
]
[[rows]]
g = 1
[[rows]]
g = 2
[rows.sub]
h = 3
[[rows.sub.deep]]
i = 4
"""
    lines = {dotted(path): line for path, line in lines_of_keys(source).items()}
    assert lines == {
        "a": 1, "a.b": 1, '"quo ted"': 2, '"quo ted".x': 2,
        "t": 3, "t.u": 3, "t.u.c": 4, "t.u.c[0]": 5, "t.u.c[1]": 6, "t.u.c[1].d": 6,
        "t.u.c[1].e": 6, "t.u.c[1].e.f": 6,
        "rows": 8, "rows[0]": 8, "rows[0].g": 9, "rows[1]": 10, "rows[1].g": 11,
        "rows[1].sub": 12, "rows[1].sub.h": 13, "rows[1].sub.deep": 14,
        "rows[1].sub.deep[0]": 14, "rows[1].sub.deep[0].i": 15,
    }  # fmt: skip


# --- selection ------------------------------------------------------------------------------------


@pytest.fixture
def suite(tmp_path: Path) -> Path:
    def write(path: str, text: str) -> None:
        (tmp_path / path).parent.mkdir(exist_ok=True)
        (tmp_path / path).write_text(text)

    write("ball/plain.toml", SCENE)
    write("ball/sweep.toml", SCENE.replace("1.5", '"=n"') + "\n[axes]\nn = [1.5, 2]\n")
    tagged = 'family = "parallel"\ntags = ["slow", "smoke"]'
    write("slab/offset.toml", SCENE.replace('family = "ball"', tagged))
    return tmp_path


@pytest.mark.parametrize(
    ("selections", "ids"),
    [
        ([], ["ball-plain", "ball-sweep[n=1.5]", "ball-sweep[n=2]", "slab-offset"]),
        (["ball-*"], ["ball-plain", "ball-sweep[n=1.5]", "ball-sweep[n=2]"]),
        (["ball"], ["ball-plain", "ball-sweep[n=1.5]", "ball-sweep[n=2]"]),
        (["parallel", "ball-plain"], ["slab-offset", "ball-plain"]),
        (["ball-sweep"], ["ball-sweep[n=1.5]", "ball-sweep[n=2]"]),
        (["ball-sweep[n=2]"], ["ball-sweep[n=2]"]),
        (["*[n=?]"], ["ball-sweep[n=2]"]),
        (["*-plain", "ball-plain"], ["ball-plain"]),
        (["smoke"], ["slab-offset"]),
    ],
)
def test_cases_are_found(suite: Path, selections: list[str], ids: list[str]) -> None:
    assert [case.id for case in find(selections, suite)] == ids


def test_files_and_folders_are_found(suite: Path) -> None:
    paths = [str(suite / "slab" / "offset.toml"), str(suite / "ball")]
    found = [case.case for case in find(paths, suite / "nowhere")]
    assert found == ["slab-offset", "ball-plain", "ball-sweep", "ball-sweep"]


@pytest.mark.parametrize(
    ("selection", "suggestion"),
    [("bal", "ball"), ("slab-ofset", "slab-offset"), ("bal-*", "ball"), ("xyz", None),
     ("ball-sweep[n=3]", "ball-sweep[n=2]")],
)  # fmt: skip
def test_what_matches_nothing_is_a_mistake(
    suite: Path, selection: str, suggestion: str | None
) -> None:
    with pytest.raises(InputError) as caught:
        find(["ball", selection], suite)
    (one,) = caught.value.problems
    assert one.message == f"no case matches {selection!r}"
    assert one.suggestion == suggestion


def test_broken_files_matter_where_they_are_asked_for(suite: Path) -> None:
    (suite / "ball" / "broken.toml").write_text("format = 1")
    assert len(find(["slab-*", "ball-plain"], suite)) == 2
    for selections in (["ball"], ["ball-broken"], ["ball-broken[n=1]"], ["*"], [], ["nothing"]):
        with pytest.raises(InputError) as caught:
            find(selections, suite)
        assert suite / "ball" / "broken.toml" in [p.file for p in caught.value.problems]


def test_missing_files_and_empty_folders_are_mistakes(tmp_path: Path) -> None:
    for selections in ([str(tmp_path / "none.toml")], [str(tmp_path)], ["x"], []):
        with pytest.raises(InputError):
            find(selections, tmp_path)


def test_two_files_of_one_case_are_a_mistake(suite: Path) -> None:
    (suite / "more" / "slab").mkdir(parents=True)
    (suite / "more" / "slab" / "offset.toml").write_text(SCENE)
    with pytest.raises(InputError, match="is also in"):
        find([], suite)


# --- mutations of valid files ---------------------------------------------------------------------

ODD_VALUES: list[Any] = [
    True, -1, 0, 0.0, 1, 2, 10**30, 10**400, -1e300, 5e-324, float("inf"), float("nan"),
    "", "x", "=", "=1/0", "=ior", "=zz", "a\nb", "é", "../x", "/etc/passwd", "sphere", "glass",
    [], [[]], [0, 0, 0], [1, 2], [1, 2, 3, 4], ["=pi", 0, 0], [{}], {}, {"type": "box"},
    {"type": "mesh", "file": "../../x.ply"}, {"type": "=ior"}, {"start": 0, "stop": 1, "count": 3},
    {"type": "triangles", "vertices": [[0, 0, 0]] * 4, "triangles": [[0, 1, 9]] * 4},
    {"type": "picture", "file": "none.png"}, {"axis": [0, 0, 0], "angle": 3},
]  # fmt: skip


ODD = st.sampled_from(ODD_VALUES).map(copy.deepcopy)  # a value may be mutated in its turn


def places(node: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    members = node.items() if isinstance(node, dict) else enumerate(node)
    found = [path] if path else []
    for key, value in members if isinstance(node, dict | list) else ():
        found += places(value, (*path, key)) if isinstance(value, dict | list) else [(*path, key)]
    return found


@st.composite
def mutated(draw: st.DrawFn) -> dict[str, Any]:
    """A valid document in which some values were replaced, removed, renamed or repeated."""
    document = copy.deepcopy(draw(documents()))
    for _ in range(draw(st.integers(1, 3))):
        *parents, key = draw(st.sampled_from(places(document)))
        node = document
        for parent in parents:
            node = node[parent]
        action = draw(st.sampled_from(["replace", "replace", "remove", "rename", "add"]))
        if action == "remove":
            del node[key]
        elif action == "rename" and isinstance(key, str):
            node[key + draw(st.sampled_from(["x", " ", ".", "é", "\0"]))] = node.pop(key)
        elif action == "add" and isinstance(node, dict):
            node[draw(st.sampled_from(["x", "type", "axes", "rotate", "up", "medium"]))] = draw(ODD)
        else:
            node[key] = draw(ODD)
        if not places(document):
            break
    return document


def loads_or_says_why(path: Path) -> None:
    found: list[Problem] = []
    try:
        for case in load_cases(path):
            resolve(case)
    except InputError as error:
        found = error.problems or [Problem("an error without problems")]
    for one in found:
        assert one.file == path
        assert one.line is not None or "TOML" in one.message or "nested" in one.message
        assert str(one).isprintable()


@settings(
    max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(document=mutated())
def test_mutated_data_loads_or_says_why(tmp_path: Path, document: dict[str, Any]) -> None:
    path = tmp_path / "mutant.toml"
    path.write_text(to_toml(document), encoding="utf-8")
    loads_or_says_why(path)


@settings(
    max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(data=st.data(), document=documents())
def test_mutated_text_loads_or_says_why(
    tmp_path: Path, data: st.DataObject, document: dict[str, Any]
) -> None:
    text = bytearray(to_toml(document).encode())
    for _ in range(data.draw(st.integers(1, 4))):
        start = data.draw(st.integers(0, len(text)))
        stop = min(len(text), start + data.draw(st.integers(0, 8)))
        text[start:stop] = data.draw(
            st.sampled_from([b"", b"\n", b"=", b'"', b"[", b"]", b"{", b"}", b"\xff", b"\0", b"9"])
            | st.binary(max_size=4)
        )
    path = tmp_path / "mutant.toml"
    path.write_bytes(text)
    loads_or_says_why(path)


@settings(
    max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(document=documents())
def test_valid_data_loads(tmp_path: Path, document: dict[str, Any]) -> None:
    path = tmp_path / "valid.toml"
    path.write_text(to_toml(document), encoding="utf-8")
    for case in load_cases(path):
        resolve(case)
