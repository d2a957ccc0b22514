"""The published figures: of all wrong renderers that there are, and what they have to show."""

from __future__ import annotations

import json
from typing import Any

import pytest

from harness.report.detection import detection, read
from tests.mutants.detection import DATA, DOCUMENT, document
from tests.mutants.mutants import CONTROLS, MUTANTS, UNLISTED

DATA_OF_NOW: dict[str, Any] = json.loads(DATA.read_text("utf-8"))


def test_they_are_of_the_wrong_renderers_that_there_are() -> None:
    """Otherwise `make detection` is due."""
    assert [m["name"] for m in DATA_OF_NOW["mutants"]] == [m.name for m in (*MUTANTS, *UNLISTED)]
    assert {c.fault for c in CONTROLS} <= {alarm["name"] for alarm in DATA_OF_NOW["alarms"]}


def test_every_wrong_renderer_is_caught_and_nine_of_ten_are_named() -> None:
    mutants = DATA_OF_NOW["mutants"]
    assert all(m["caught"] for m in mutants)
    assert sum(m["right"] for m in mutants) >= 0.9 * len(mutants)


def test_nobody_who_is_right_is_accused() -> None:
    assert [alarm["name"] for alarm in DATA_OF_NOW["alarms"] if alarm["red"]] == []
    # And all of them were there to be accused.
    assert all(alarm["checks"] for alarm in DATA_OF_NOW["alarms"])


@pytest.mark.parametrize(
    ("kind", "most"), [("float64, 16 bits", 1e-6), ("float32, float images", 1e-5)]
)
def test_an_error_of_an_index_is_seen_that_is_so_small(kind: str, most: float) -> None:
    found = [x for x in DATA_OF_NOW["limits"] if x["what"] == "index" and x["class"] == kind]
    assert min(x["amount"] for x in found) <= most


def test_the_document_is_made_of_the_data() -> None:
    assert DOCUMENT.read_text("utf-8") == document(DATA_OF_NOW)


def test_reports_show_the_data() -> None:
    shown = detection()
    assert shown is not None
    assert shown.total == shown.caught == len(MUTANTS) + len(UNLISTED)
    assert shown.rules[0].name == "snellcheck"
    assert all(len(wrong.seen) == len(shown.rules) - 1 for wrong in shown.wrong)


def test_a_rule_that_was_not_asked_about_all_has_no_count() -> None:
    """As FLIP where it is not installed."""
    rivals: dict[str, Any] = {
        name: {**seen, "FLIP": None if name == MUTANTS[0].name else seen["FLIP"]}
        for name, seen in DATA_OF_NOW["rivals"].items()
    }
    data = {**DATA_OF_NOW, "rivals": rivals}
    assert "FLIP ?." in document(data)
    assert "FLIP ?." not in document(DATA_OF_NOW)
    assert [rule.name for rule in read(data).rules] == [
        rule.name for rule in read(DATA_OF_NOW).rules if rule.name != "FLIP"
    ]


def test_data_of_another_schema_are_not_shown() -> None:
    with pytest.raises(ValueError, match="snellcheck-detection/2"):
        read({**DATA_OF_NOW, "schema": "snellcheck-detection/2"})
