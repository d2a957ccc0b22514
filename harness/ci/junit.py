"""JUnit XML, which Jenkins, GitLab, CircleCI and pytest's readers understand.

A case is a suite and a check is a test. FAIL becomes a failure, ERROR an error, SKIP is skipped;
with a baseline the states of checks decide.
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET

from harness.baseline.run_folder import RunFolder
from harness.ci.findings import Finding, findings, lost
from harness.record import CaseRecord, Check, Verdict
from harness.report.links import clean

# What XML 1.0 cannot hold, not even escaped.
FORBIDDEN = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def junit(run: RunFolder) -> str:
    """The run as one XML document."""
    root = ET.Element("testsuites", name="snellcheck", time=f"{run.summary.wall_s:.3f}")
    red = {(f.case, f.check.id): f for f in findings(run)}
    for case in run.summary.cases:
        record, _ = run.records[case.id]
        suite = ET.SubElement(root, "testsuite", name=_plain(case.id), timestamp=record.started)
        seconds = {ran.name: ran.render_s / max(1, _count(record, ran.name)) for ran in record.runs}
        for check in case.checks:
            test = _test(suite, case.id, check.id, seconds.get(check.renderer, 0.0))
            test.set("file", _plain(record.scene_path or record.scene_file))
            _outcome(test, check, red.get((case.id, check.id)))
        _count_up(suite)
    gone = list(lost(run.summary))
    if gone:
        suite = ET.SubElement(root, "testsuite", name="baseline")
        for case_id, name, reason in gone:
            _failure(_test(suite, case_id, name, 0.0), "failure", reason, reason)
        _count_up(suite)
    _count_up(root)
    ET.indent(root)
    return ET.tostring(root, encoding="unicode", xml_declaration=True) + "\n"


def _test(suite: ET.Element, case: str, name: str, seconds: float) -> ET.Element:
    attributes = {"classname": _plain(case), "name": _plain(name), "time": f"{seconds:.3f}"}
    return ET.SubElement(suite, "testcase", attributes)


def _outcome(test: ET.Element, check: Check, finding: Finding | None) -> None:
    if finding is not None:
        kind = "error" if check.status is Verdict.ERROR else "failure"
        _failure(test, kind, finding.headline, finding.text)
    elif check.status is Verdict.SKIP:
        ET.SubElement(test, "skipped", message=_plain(check.reason))
    elif check.reason:
        ET.SubElement(test, "system-out").text = _plain(f"{check.status.value}: {check.reason}")


def _failure(test: ET.Element, kind: str, message: str, text: str) -> None:
    ET.SubElement(test, kind, message=_plain(message), type=kind).text = _plain(text)


def _count(record: CaseRecord, renderer: str) -> int:
    return sum(check.renderer == renderer for check in record.checks)


def _count_up(suite: ET.Element) -> None:
    suite.set("tests", str(len(suite.findall(".//testcase"))))
    for name, tag in (("failures", "failure"), ("errors", "error"), ("skipped", "skipped")):
        suite.set(name, str(len(suite.findall(f".//{tag}"))))


def _plain(text: str) -> str:
    return FORBIDDEN.sub("\ufffd", clean(text))
