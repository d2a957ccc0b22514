"""The report's pages: what they say, that their links exist, that nothing hostile gets through."""

from __future__ import annotations

import re
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest
from hypothesis import given
from hypothesis import strategies as st

from harness import record as records
from harness import report
from harness.errors import InputError
from harness.record import (
    CaseRecord,
    Check,
    Counts,
    Curve,
    DifferenceMap,
    ImageFile,
    RendererRun,
    RendererSummary,
    Series,
    Summary,
    Table,
    Verdict,
)
from harness.report import build, write_report
from harness.report.colours import colour_classes
from harness.report.links import RunFolder, clean, page_name
from tests.harness.report_fixture import (
    MISSING,
    PRESENT,
    Draft,
    check,
    drafts,
    make_run,
    run_of,
    summary_of,
    write_run,
)

VOID = {"meta", "link", "img", "input", "br", "hr", "col", "wbr"}
POLICY = "default-src 'none'; img-src 'self'; style-src 'self'; script-src 'self'"


class Page(HTMLParser):
    """A page as a list of elements, and its text. Fails on elements that are closed wrongly."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.path = path
        self.source = path.read_text(encoding="utf-8")
        self.elements: list[tuple[str, dict[str, str]]] = []
        self.words: list[str] = []
        self.open: list[str] = []
        self.feed(self.source)
        self.close()
        assert not self.open, f"{path.name}: left open: {self.open}"

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, {key: value or "" for key, value in attrs}))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, {key: value or "" for key, value in attrs}))

    def handle_endtag(self, tag: str) -> None:
        assert self.open, f"</{tag}> closes nothing"
        assert self.open.pop() == tag, f"{self.path.name}:{self.getpos()[0]}: </{tag}>"

    def handle_data(self, data: str) -> None:
        self.words.append(data)

    @property
    def text(self) -> str:
        return re.sub(r"[ \n]+", " ", "".join(self.words))

    @property
    def ids(self) -> set[str]:
        return {attributes["id"] for _, attributes in self.elements if "id" in attributes}

    def links(self) -> Iterator[str]:
        for _, attributes in self.elements:
            yield from (attributes[key] for key in ("href", "src") if key in attributes)

    def rows(self) -> list[dict[str, str]]:
        return [a for _, a in self.elements if "data-status" in a]


def pages(root: Path) -> list[Page]:
    return [Page(path) for path in (root / "index.html", *sorted((root / "cases").glob("*.html")))]


def index_of(root: Path) -> Page:
    return Page(write_report(root))


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run with its report, for tests that only read it."""
    root = make_run(tmp_path_factory.mktemp("run"), size=24)
    assert write_report(root) == root / "index.html"
    return root


def small_run(root: Path, *cases: CaseRecord, **changes: object) -> Path:
    summary = summary_of(list(cases), exit_code=0).model_copy(update=changes)
    return write_run(root, list(cases), summary)


def passing(name: str = "slab-offset[ior=1.5]") -> CaseRecord:
    draft = Draft(name, "A slab only shifts the ray", "slab")
    draft.checks.append(check("slab_offset", "tracer", 1e-13, 0.0, 1e-12, "units"))
    draft.runs.append(run_of("tracer", Verdict.PASS))
    return draft.finished()


# --- every page -----------------------------------------------------------------------------------


def test_every_link_leads_somewhere(run: Path) -> None:
    found = pages(run)
    assert len(found) == 13
    ids = {page.path: page.ids for page in found}
    for page in found:
        for link in sorted(set(page.links())):
            parts = urlsplit(link)
            assert not parts.scheme + parts.netloc, f"{page.path.name} leaves the folder: {link}"
            target = (page.path.parent / unquote(parts.path)).resolve() if parts.path else page.path
            assert target.is_file(), f"{page.path.name}: {link}"
            assert target.is_relative_to(run)
            if parts.fragment:
                assert parts.fragment in ids[target], f"{page.path.name}: {link}"


def test_every_page_keeps_its_own_policy(run: Path) -> None:
    """What the policy forbids would be dropped silently, so nothing may rely on it."""
    for page in pages(run):
        assert page.elements[3][1]["content"].startswith(POLICY)  # before anything is loaded
        for tag, attributes in page.elements:
            assert tag != "style"
            data = attributes.get("type") == "application/json"  # which no browser runs
            assert tag != "script" or attributes.get("src") or data
            assert not [key for key in attributes if key == "style" or key.startswith("on")]


def test_every_case_has_a_page_and_every_page_a_neighbour(run: Path) -> None:
    """Following "next" from the first page leads through all of them, in the index's order."""
    index = Page(run / "index.html")
    matrix = index.source.partition('class="rows"')[2]
    order = list(dict.fromkeys(re.findall(r'href="(cases/[^#"]+)"', matrix)))
    assert len(order) == 12
    seen = []
    at: Path | None = run / unquote(order[0])
    while at:
        seen.append(at.name)
        following = [a["href"] for _, a in Page(at).elements if a.get("rel") == "next"]
        at = at.parent / unquote(following[0]) if following else None
    assert len(seen) == 12
    assert seen == list(dict.fromkeys(unquote(link).removeprefix("cases/") for link in order))


def test_building_twice_gives_the_same_bytes(run: Path) -> None:
    before = {path: path.read_bytes() for path in run.rglob("*") if path.is_file()}
    write_report(run)
    assert {path: path.read_bytes() for path in run.rglob("*") if path.is_file()} == before


# --- index ----------------------------------------------------------------------------------------


def test_banner_counts_and_names_the_worst(run: Path) -> None:
    page = Page(run / "index.html")
    checks = [c for case in records.read_summary(run / "summary.json").cases for c in case.checks]
    failing = [c for c in checks if c.status == Verdict.FAIL]
    assert f"{len(failing)} of {len(checks)} checks fail" in page.text
    # The printed table is 12.05 degrees off at 80 degrees, with a tolerance of 0.0002 degrees.
    worst = "snell-lecture[mu=0.67] mytracer internal_angle 12.05° limit ≤\u202f0.0002°"
    assert f"Worst: {worst}" in page.text


def test_failures_come_first(run: Path) -> None:
    rows = Page(run / "index.html").rows()
    # A wrong number stands before one that is missing, whichever of them is the case's verdict.
    seen = ["fail" if "fail" in row["data-cells"].split() else row["data-status"] for row in rows]
    order = ["fail", "error", "skip", "known", "pass"]
    assert seen == sorted(seen, key=order.index)
    assert {"error", "fail", "skip"} <= set(seen)


def test_matrix_has_a_cell_for_every_renderer(run: Path) -> None:
    page = Page(run / "index.html")
    for row in page.rows():
        assert len(row["data-cells"].split()) == len(PRESENT) + 1
    assert "mitsuba 3.9.1 error in 1 of " in page.text


def test_missing_renderer_is_shown_with_its_remedy(run: Path) -> None:
    text = Page(run / "index.html").text
    assert f"{MISSING} – missing" in text
    assert "Remedy sudo apt-get install libllvm19" in text


def test_provenance(run: Path) -> None:
    text = Page(run / "index.html").text
    for fact in ("2026-03-14 09:26:53 UTC", "74.2\u202fs", "normal", "a check failed"):
        assert fact in text
    assert "snellcheck run --quality normal --out reports/latest" in text


def test_colours_of_renderers_do_not_depend_on_the_company() -> None:
    alone = colour_classes(["povray"])
    among = colour_classes(["zeta", "povray", "tracer", "alpha"])
    assert alone["povray"] == among["povray"]
    assert len({among[name] for name in ("zeta", "povray", "tracer", "alpha")}) == 4


def test_colours_can_be_read_in_light_and_dark() -> None:
    """Contrast of at least 4.5, WCAG 2.2, success criterion 1.4.3."""

    def luminance(colour: str) -> float:
        channels = [int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)]
        linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels]
        return sum(w * c for w, c in zip((0.2126, 0.7152, 0.0722), linear, strict=True))

    style = (Path(report.__file__).parent / "assets" / "report.css").read_text()
    pairs = [(verdict.value, f"{verdict.value}-tint") for verdict in Verdict]
    pairs += [(front, back) for front in ("ink", "muted", "link") for back in ("page", "surface")]
    for part in style.split("@media")[:2]:
        colours = dict(re.findall(r"--([\w-]+): (#\w{6});", part))
        for front, back in pairs:
            dark, light = sorted(luminance(colours[name]) for name in (front, back))
            assert (light + 0.05) / (dark + 0.05) >= 4.5, (front, back)


# --- case page ------------------------------------------------------------------------------------


def case_page(run: Path, case_id: str) -> Page:
    return Page(run / "cases" / page_name(case_id))


def test_case_page_has_formula_source_curves_and_erratum(run: Path) -> None:
    page = case_page(run, "snell-lecture[mu=0.67]")
    tags = [tag for tag, _ in page.elements]
    assert "math" in tags
    assert "μ" in page.text
    assert "E. Hecht, Optics, 5th ed., section 4.4" in page.text
    assert "Erratum of the lecture's table" in page.text
    assert "42.067065" in page.text
    assert page.source.count('class="band"') == 1


def test_case_page_shows_value_expectation_tolerance_and_derivation(run: Path) -> None:
    text = case_page(run, "slab-offset[thickness=1.0,ior=2.417]").text
    assert "beyond tolerance" in text
    assert "2\u202f×\u202f10⁻⁶\u202funits" in text
    assert "times the condition number of the map" in text
    assert "worst_ray" in text


def test_crash_shows_the_log(run: Path) -> None:
    page = case_page(run, "package-complete")
    assert "ended by signal 6 (SIGABRT)" in page.text
    assert "Aborted (core dumped)" in page.text
    assert [a for tag, a in page.elements if tag == "details" and "open" in a]


def test_nan_is_shown_as_such(run: Path) -> None:
    page = case_page(run, "prism-deviation[apex=60]")
    assert "NaN never equals anything" in page.text
    assert "6 of 80 values not finite" in page.text
    assert 'class="lost"' in page.source


def test_differences_share_a_colour_bar_with_their_limit(run: Path) -> None:
    page = case_page(run, "ball-beach")
    assert page.source.count("<linearGradient") == 1
    assert "10⁻⁹" in page.text
    assert [a["alt"] for _, a in page.elements if "Difference of" in a.get("alt", "")] == [
        "Difference of tracer and povray",
        "Difference of tracer and mitsuba",
        "Difference of tracer and mytracer",
        "Difference of povray and mitsuba",
        "Difference of povray and mytracer",
        "Difference of mitsuba and mytracer",
    ]


def test_case_page_links_record_scene_and_linear_data(run: Path) -> None:
    links = set(case_page(run, "ball-beach").links())
    assert "../records/ball-beach.json" in links
    assert "../scenes/ball-beach/scene.json" in links
    assert "../images/ball-beach/tracer.raw" in links


def test_case_page_shows_what_renderers_were_given(run: Path) -> None:
    page = case_page(run, "ball-beach")
    links = set(page.links())
    assert "../scenes/ball-beach/povray/scene.pov" in links
    assert "../scenes/ball-beach/povray/ball.ply" in links
    assert "sphere { <0, 0, 0>, 1 } // </pre><script>" in page.text
    assert "Only its beginning" in page.text
    assert page.source.count('<details class="given">') == 1  # a mesh is no text
    (record,) = (run / "records").glob("ball-beach.json")
    for image in (i for r in records.read_case(record).runs for i in r.images):
        assert image.sha256[:16] in page.text


# --- states ---------------------------------------------------------------------------------------


def test_all_pass(tmp_path: Path) -> None:
    text = index_of(small_run(tmp_path, passing())).text
    assert "The only check passes" in text
    closest = "slab-offset[ior=1.5] tracer slab_offset 10⁻¹³\u202funits"
    assert f"Closest to its limit: {closest}" in text


def test_no_cases_do_not_pass(tmp_path: Path) -> None:
    page = index_of(small_run(tmp_path))
    assert "No checks were made" in page.text
    assert "This run has no cases" in page.text
    assert "s-error" in next(a["class"] for _, a in page.elements if "banner" in a.get("class", ""))


def test_no_renderers(tmp_path: Path) -> None:
    page = index_of(small_run(tmp_path, renderers={}))
    assert "No renderer took part" in page.text


def test_skipped_checks_are_not_a_pass(tmp_path: Path) -> None:
    draft = Draft("tir[ior=1.5]", "Total internal reflection", "tir")
    draft.checks.append(check("tir", "povray", None, None, None, "", status=Verdict.SKIP))
    page = index_of(small_run(tmp_path, draft.finished(), passing(), exit_code=3))
    assert "No check fails; 1 of 2 were skipped" in page.text
    assert "something asked for could not run" in page.text


def test_case_without_checks(tmp_path: Path) -> None:
    root = small_run(tmp_path, Draft("empty", "Nothing", "slab").finished())
    write_report(root)
    assert "No checks were made of this case" in case_page(root, "empty").text


def test_summary_that_miscounts_is_called_out(tmp_path: Path) -> None:
    page = index_of(small_run(tmp_path, passing(), counts=Counts(fail=3)))
    assert "summary.json states other counts" in page.text


def test_missing_and_broken_records_are_listed(tmp_path: Path) -> None:
    root = small_run(tmp_path, passing("one"), passing("two"), passing("three"))
    write_report(root)
    (root / "records" / "two.json").unlink()
    (root / "records" / "three.json").write_text('{"schema": "snellcheck-record/1"')
    page = index_of(root)
    assert len(page.rows()) == 3
    assert page.text.count("no readable record of this case") == 2
    assert "three.json" in page.text
    assert [path.name for path in (root / "cases").iterdir()] == ["one.html"]


def test_stray_records_are_named_but_not_shown(tmp_path: Path) -> None:
    root = small_run(tmp_path, passing("one"))
    records.write(passing("left-over"), root / "records" / "left-over.json")
    page = index_of(root)
    assert "1 record of no case in summary.json (left-over.json)" in page.text
    assert len(page.rows()) == 1


def test_stale_pages_go_and_other_files_stay(tmp_path: Path) -> None:
    root = small_run(tmp_path, passing("one"), passing("two"))
    write_report(root)
    (root / "cases" / "mine.html").write_text("<p>notes")
    write_report(small_run(tmp_path, passing("one")))
    assert sorted(path.name for path in (root / "cases").iterdir()) == ["mine.html", "one.html"]


@pytest.mark.parametrize("content", [None, "", "{}", '{"schema": "snellcheck-summary/2"}'])
def test_without_a_summary_there_is_no_report(tmp_path: Path, content: str | None) -> None:
    if content is not None:
        (tmp_path / "summary.json").write_text(content)
    with pytest.raises(InputError, match=r"summary\.json"):
        write_report(tmp_path)
    assert not (tmp_path / "index.html").exists()


def test_pictures_that_are_gone_are_said_to_be(tmp_path: Path) -> None:
    root = tmp_path
    ball = next(d for d in drafts(root, 16) if d.id == "ball-beach").finished()
    small_run(root, ball)
    for path in (root / "images" / "ball-beach").glob("povray*"):
        path.unlink()
    write_report(root)
    text = case_page(root, "ball-beach").text
    assert text.count("no picture stored") == 1
    assert text.count("no map stored") == 2


# --- hostile input --------------------------------------------------------------------------------

EVIL = "\"'><script>alert(1)</script><img src=x onerror=alert(1)>{{ 7 * 7 }}</title>"


def hostile_case(root: Path) -> CaseRecord:
    """Every text of a record is an attempt at markup, every path at leaving the folder."""
    outside = root.parent / "secret.png"
    outside.write_bytes(b"secret")
    (root / "link.png").symlink_to(outside)
    paths = ["javascript:alert(1)", "../secret.png", str(outside), "link.png", "a\x00b", "x" * 5000]
    image = ImageFile(role=EVIL, path="p", sha256=EVIL, width=1, height=1)
    return CaseRecord(
        id="../../" + EVIL,
        case=EVIL,
        family=EVIL,
        title=EVIL,
        description=EVIL,
        lecture=EVIL,
        sources=[EVIL],
        formula=EVIL,
        parameters={EVIL: EVIL},
        scene_sha256=EVIL,
        scene_file=EVIL,
        quality=EVIL,
        snellcheck_version=EVIL,
        started=EVIL,
        wall_s=float("nan"),
        status=Verdict.FAIL,
        runs=[
            RendererRun(
                name=EVIL,
                version=EVIL,
                status=Verdict.ERROR,
                reason=EVIL,
                command=EVIL,
                log_tail=f"\x1b[31m{EVIL}\x1b[0m\x07\u202e",
                settings={EVIL: EVIL},
                files={f"{EVIL}{path}": path for path in paths},
                images=[image.model_copy(update={"path": p, "picture": p}) for p in paths],
            )
        ],
        checks=[
            Check(
                id=EVIL,
                renderer=EVIL,
                against=EVIL,
                observable=EVIL,
                value=1e300,
                expected=-1e300,
                tolerance=0.0,
                unit=EVIL,
                status=Verdict.FAIL,
                reason=EVIL,
                derivation=EVIL,
                detail={EVIL: EVIL},
            )
        ],
        curves=[
            Curve(
                id=EVIL,
                title=EVIL,
                x_label=EVIL,
                y_label=EVIL,
                series=[Series(renderer=EVIL, x=[0.0, 1.0], y=[1e308, -1e308])],
                residual_label=EVIL,
                residuals=[Series(renderer=EVIL, x=[0.0], y=[float("inf")])],
                tolerance=[float("nan")],
            )
        ],
        differences=[DifferenceMap(a=EVIL, b=EVIL, path=p, limit=1.0, unit=EVIL) for p in paths],
        tables=[Table(title=EVIL, columns=[EVIL], rows=[[EVIL]], note=EVIL)],
        files={p: p for p in paths},
    )


def test_hostile_texts_are_shown_and_paths_are_not_followed(tmp_path: Path) -> None:
    root = tmp_path / "run"
    root.mkdir()
    record = hostile_case(root)
    records.write(record, root / "records" / "evil.json")
    renderer = RendererSummary(
        version=EVIL, status=EVIL, cases=1, render_s=1.0, reason=EVIL, remedy=EVIL,
        facts={EVIL: EVIL},
    )  # fmt: skip
    summary = summary_of([record]).model_copy(
        update={
            "renderers": {EVIL: renderer},
            "command": EVIL,
            "started": EVIL,
            "quality": EVIL,
            "snellcheck_version": EVIL,
        }
    )
    records.write(Summary.model_validate(summary.model_dump()), root / "summary.json")
    write_report(root)
    found = pages(root)
    assert len(found) == 2
    for page in found:
        scripts = [a for tag, a in page.elements if tag == "script"]
        assert [a["src"] for a in scripts if "src" in a] == [
            ("../" if page.path.parent.name == "cases" else "") + "assets/report.js"
        ]
        assert {a.get("type") for a in scripts if "src" not in a} <= {"application/json"}
        assert page.source.count("</script>") == len(scripts)
        assert not [a for tag, a in page.elements if tag == "img"]
        assert not [key for _, a in page.elements for key in a if key.startswith("on")]
        assert EVIL.split("{")[0] in page.text
        assert "49" not in page.text.replace("1.49", "")
        assert "secret" not in "".join(page.links())
        assert not [link for link in page.links() if urlsplit(link).scheme]
        assert "\x1b" not in page.source
        assert "\u202e" not in page.source
    assert {path.name for path in tmp_path.iterdir()} == {"run", "secret.png"}


@given(st.text(max_size=300))
def test_page_names_are_plain_and_short(case_id: str) -> None:
    name = page_name(case_id)
    assert re.fullmatch(r"[A-Za-z0-9_=,+\[\]~][A-Za-z0-9._=,+\[\]~-]*\.html", name)
    assert len(name) <= 140


@given(st.lists(st.text(alphabet="aA/._~-[é", max_size=6), unique=True, max_size=20))
def test_different_cases_have_different_pages(case_ids: list[str]) -> None:
    assert len({page_name(case_id).lower() for case_id in case_ids}) == len(case_ids)


@given(st.text())
def test_clean_text_can_be_written_and_has_no_controls(text: str) -> None:
    assert not re.search(r"[\x00-\x08\x0b-\x1f\x7f]", clean(text))
    clean(text).encode("utf-8")


def test_files_with_odd_names_can_be_linked(tmp_path: Path) -> None:
    name = "a b#c?d%e[f]&é.png"
    (tmp_path / name).write_bytes(b"")
    link = RunFolder(tmp_path).href(name)
    assert link is not None
    assert unquote(urlsplit(link).path) == name


def test_a_renderer_that_nothing_was_checked_of_has_not_passed(tmp_path: Path) -> None:
    case = passing()
    bystander = run_of("povray-stock", Verdict.PASS).model_copy(update={"images": []})
    case = case.model_copy(update={"runs": [*case.runs, bystander]})
    write_report(small_run(tmp_path, case))
    (page,) = (p for p in pages(tmp_path) if p.path.parent.name == "cases")
    scores = [a for _, a in page.elements if "data-renderer" in a]
    assert [a["data-renderer"] for a in scores] == ["tracer"]


def test_a_page_that_would_be_the_same_is_not_made_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    root = small_run(tmp_path, passing())
    write_report(root)
    (page,) = (root / "cases").glob("*.html")
    before = page.read_text(encoding="utf-8")
    made: list[str] = []
    whole = build._Report.case

    def counted(self: build._Report, record: CaseRecord, path: Path, stamp: str) -> str:
        made.append(record.id)
        return whole(self, record, path, stamp)

    monkeypatch.setattr(build._Report, "case", counted)
    small_run(tmp_path, passing(), started="2031-05-06T07:08:09+00:00")
    write_report(root)
    assert made == []
    after = page.read_text(encoding="utf-8")
    assert "2031-05-06T07:08:09+00:00" in after
    assert after != before  # it names the run that it is a page of
    small_run(tmp_path, passing().model_copy(update={"title": "Another"}))
    write_report(root)
    assert made == [passing().id]
    assert "Another" in page.read_text(encoding="utf-8")
