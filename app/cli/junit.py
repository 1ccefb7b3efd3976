"""Writes the verdicts of one mission as JUnit XML: what a build server shows as tests. Pure."""

from collections.abc import Iterator, Sequence
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from app.i18n.reasons.rendering import sentence
from harness.contracts.effects import Condition
from harness.contracts.verdicts import ConditionResult
from harness.projections.mission import Mission

GOAL = "goal"


def junit(mission: Mission) -> bytes:
    """One suite for each stage and one for the goal, one case for each condition.

    Only `satisfied` is a pass. Any other verdict is a failure of that type, and a condition that was never judged is
    skipped: no verdict never reads as success.
    """
    root = Element("testsuites", name=f"{mission.mission_id} {mission.template}")
    contract = mission.contract
    for node in contract.nodes if contract else ():
        verdicts = mission.of(node.node_id).verdicts
        _suite(root, mission, node.node_id, node.success_conditions, verdicts[-1].results if verdicts else ())
    if contract:
        judged = mission.goal_verdict
        _suite(root, mission, GOAL, contract.completion_conditions, judged.results if judged else ())
    for total in ("tests", "failures", "skipped"):
        root.set(total, str(sum(int(suite.get(total, "0")) for suite in root)))
    indent(root)
    return b'<?xml version="1.0" encoding="utf-8"?>\n' + tostring(root, encoding="unicode").encode() + b"\n"


def _suite(
    root: Element, mission: Mission, name: str, conditions: Sequence[Condition], results: Sequence[ConditionResult]
) -> None:
    suite = SubElement(root, "testsuite", name=name, tests=str(len(conditions)), errors="0")
    properties = SubElement(suite, "properties")
    for key, value in (("mission", mission.mission_id), ("status", mission.status), ("rules", str(mission.rules))):
        SubElement(properties, "property", name=key, value=value)
    found = {one.condition_id: one for one in results}
    failures = skipped = 0
    for condition in conditions:
        case = SubElement(suite, "testcase", classname=f"{mission.template}.{name}", name=_legal(condition.text))
        result = found.get(condition.condition_id)
        if result is None:
            skipped += 1
            SubElement(case, "skipped", message="never judged")
        elif result.verdict != "satisfied":
            failures += 1
            SubElement(case, "failure", type=result.verdict, message=_legal(sentence(result.reason)))
        if result is not None:
            SubElement(case, "system-out").text = _legal("\n".join(_evidence(result)))
    suite.set("failures", str(failures))
    suite.set("skipped", str(skipped))


def _evidence(result: ConditionResult) -> Iterator[str]:
    yield sentence(result.reason)
    for name, value in sorted(result.measured.items()):
        bound = f" (bound {result.bounds[name]:g})" if name in result.bounds else ""
        yield f"{name} {value:g}{bound}"
    yield f"independence {result.independence}, required {result.required_independence}"
    yield f"sources {', '.join(result.sources) or 'none'}"
    yield from (f"evidence {one}" for one in result.evidence)


def _legal(text: str) -> str:
    """Without the characters that XML 1.0 does not have."""
    return "".join(one for one in text if one in "\t\n" or (ord(one) >= 0x20 and not ord(one) & 0xFFFF >= 0xFFFE))
