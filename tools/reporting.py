"""A pytest plugin that writes what was collected and how it ended: ledger marks and outcomes, as JSON."""

import json
from pathlib import Path

import pytest

_marks: list[dict[str, object]] = []
_outcomes: dict[str, str] = {}


def pytest_addoption(parser: pytest.Parser) -> None:
    """Where to write the report."""
    parser.addoption("--report-to", type=Path, required=True)


def pytest_collection_finish(session: pytest.Session) -> None:
    """Keep every ledger mark of every collected test."""
    for item in session.items:
        for mark in item.iter_markers("ledger"):
            named = {name: str(mark.kwargs.get(name, "")) for name in ("symbol", "planted")}
            _marks.append({"test": item.nodeid, "rows": list(mark.args), **named})


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """A test's outcome is its call's, or that of the phase that went wrong."""
    tells = report.when == "call" or report.outcome != "passed"
    if tells and _outcomes.get(report.nodeid) != "failed":
        _outcomes[report.nodeid] = report.outcome


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Write the report."""
    path: Path = session.config.getoption("--report-to")
    path.write_text(json.dumps({"marks": _marks, "outcomes": _outcomes}))
