"""Pure: the goal verdict as a table by clause (D44), with the reading and the text it was read from."""

from collections.abc import Iterator
from dataclasses import dataclass

from harness.contracts.dossier import JudgedClause, JudgedCondition, JudgedGoal
from harness.contracts.effects import Condition
from harness.contracts.readings import PROFILE, Reading
from harness.contracts.reasons import Explanation
from harness.contracts.verdicts import ConditionResult, Verdict, strictest
from harness.projections.mission import Mission
from harness.projections.readings import cited_in_words, reading_in_words


@dataclass(frozen=True)
class TestedCondition:
    """A completion condition with its result; None before the goal was tested."""

    condition: Condition
    result: ConditionResult | None


@dataclass(frozen=True)
class TestedClause:
    """A clause by its number, or a default of the mission profile, with the conditions it is judged by."""

    cited: str
    told: Explanation
    tests: tuple[TestedCondition, ...]

    @property
    def verdict(self) -> Verdict | None:
        """The strictest of its conditions; None before the goal was tested."""
        results = tuple(one.result.verdict for one in self.tests if one.result)
        return strictest(results) if results else None


def tested_clauses(mission: Mission) -> Iterator[TestedClause]:
    """Each clause with its conditions, then each default; nothing for a mission without a reading."""
    contract = mission.contract
    if contract is None or not isinstance(contract.reading, Reading):
        return
    found = {one.condition_id: one for one in mission.goal_verdict.results} if mission.goal_verdict else {}
    numbers = (str(number) for number, _ in enumerate(contract.reading.clauses, start=1))
    for cited in (*numbers, *(f"{PROFILE}.{name}" for name in contract.reading.defaults)):
        conditions = (one for one in contract.completion_conditions if one.clause == cited)
        tests = tuple(TestedCondition(one, found.get(one.condition_id)) for one in conditions)
        yield TestedClause(cited, cited_in_words(contract, cited) or "", tests)


def judged_goal(mission: Mission) -> JudgedGoal | None:
    """The same table as a dossier states it; None for a mission without a reading."""
    reading = mission.contract.reading if mission.contract else None
    if not isinstance(reading, Reading):
        return None
    clauses = (
        JudgedClause(
            clause=one.cited,
            told=one.told,
            verdict=one.verdict,
            conditions=tuple(_judged(test) for test in one.tests),
        )
        for one in tested_clauses(mission)
    )
    return JudgedGoal(
        reading=reading_in_words(reading),
        source=mission.goal,
        digest=reading.digest,
        verdict=mission.goal_verdict.verdict if mission.goal_verdict else None,
        clauses=tuple(clauses),
    )


def _judged(test: TestedCondition) -> JudgedCondition:
    condition, result = test.condition, test.result
    if result is None:
        return JudgedCondition(condition_id=condition.condition_id, text=condition.text)
    return JudgedCondition(
        condition_id=condition.condition_id,
        text=condition.text,
        verdict=result.verdict,
        independence=result.independence,
        required_independence=result.required_independence,
        evidence=result.evidence,
    )
