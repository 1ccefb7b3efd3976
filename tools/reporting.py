"""Writes what pytest collected and how it ended, as JSON: a plugin for ledger marks and outcomes."""

import json
from pathlib import Path

import pytest

_marks: list[dict[str, object]] = []
_outcomes: dict[str, str] = {}


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the option for the path of the report."""
    parser.addoption("--report-to", type=Path, required=True)


def pytest_collection_finish(session: pytest.Session) -> None:
    """Record every ledger mark of every collected test."""
    for item in session.items:
        for mark in item.iter_markers("ledger"):
            named = {name: str(mark.kwargs.get(name, "")) for name in ("symbol", "planted", "entry")}
            _marks.append({"test": item.nodeid, "rows": list(mark.args), **named})


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Record a test's outcome: its call's, or that of the phase that failed."""
    tells = report.when == "call" or report.outcome != "passed"
    if tells and _outcomes.get(report.nodeid) != "failed":
        _outcomes[report.nodeid] = report.outcome


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Write the report."""
    path: Path = session.config.getoption("--report-to")
    path.write_text(json.dumps({"marks": _marks, "outcomes": _outcomes}))
