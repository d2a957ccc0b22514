"""The HTML report: pages made from records alone. Nothing here renders a scene or judges a check.

`write_report` is all that the rest of the harness needs, beside `harness.report.pictures`, which
the runner calls while it still has the pixels.
"""

from __future__ import annotations

from harness.report.build import write_report

__all__ = ["write_report"]
