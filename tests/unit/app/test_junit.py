"""JUnit XML of a mission's verdicts: only a satisfied condition passes, and one that was never judged is skipped."""

from collections.abc import Iterator
from xml.etree.ElementTree import fromstring

import pytest
from msgspec.structs import replace

from app.cli.junit import junit
from harness.contracts.reasons import recorded
from harness.projections.mission import Mission
from tests.builders.missions_run import ran


@pytest.fixture(scope="module")
def mission() -> Iterator[Mission]:
    with ran("circuit") as found:
        yield found.mission


def test_a_mission_that_met_its_goal_has_no_failure_and_what_was_not_judged_is_skipped(mission: Mission) -> None:
    root = fromstring(junit(mission))
    assert (root.get("failures"), root.get("skipped")) == ("0", "0") and int(root.get("tests", "0")) > 3
    (cases,) = [one for one in root if one.get("name") == "circuit"]
    assert "independence" in (cases[1].findtext("system-out") or "")
    unjudged = fromstring(junit(replace(mission, goal_verdict=None)))
    assert int(unjudged.get("skipped", "0")) == len(mission.contract.completion_conditions)  # type: ignore[union-attr]


def test_every_other_verdict_is_a_failure_with_its_type_and_legal_characters(mission: Mission) -> None:
    assert mission.goal_verdict is not None
    first, *rest = mission.goal_verdict.results
    for verdict in ("violated", "ambiguous", "stale", "unsafe"):
        worse = replace(first, verdict=verdict, reason=recorded("a \x00 sign & <more>"))
        told = replace(mission, goal_verdict=replace(mission.goal_verdict, results=(worse, *rest)))
        root = fromstring(junit(told))
        (failure,) = root.findall(".//failure")
        assert (failure.get("type"), failure.get("message")) == (verdict, "a  sign & <more>")
        assert root.get("failures") == "1"
