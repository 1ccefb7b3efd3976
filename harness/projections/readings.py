"""Tells a reading, and the clause that a condition belongs to, as reasons: code and facts, in no language. Pure."""

from harness.contracts.readings import PROFILE, Clause, Reading
from harness.contracts.reasons import Explanation, Reason, because
from harness.contracts.tasks import TaskContract


def reading_in_words(reading: Reading) -> Reason:
    """Everything that will be done or avoided, in order, with what the mission profile adds."""
    clauses = tuple(clause_in_words(clause) for clause in reading.clauses)
    defaults = tuple(because(f"default_{name}") for name in reading.defaults)
    return because("reading", clauses=(*clauses, *defaults))


def clause_in_words(clause: Clause) -> Reason:
    """One clause: its act, what it is about, how often, or that it is not to be done."""
    about = clause.object.name if clause.object else ""
    told = because(f"clause_{clause.act}_of", object=about) if about else because(f"clause_{clause.act}")
    if clause.negated:
        return because("clause_not", clause=told)
    return because("clause_times", clause=told, count=clause.count) if clause.count > 1 else told


def goal_in_words(contract: TaskContract) -> Explanation:
    """What the mission is for: its reading; the goal's own text in a contract that has none."""
    return reading_in_words(contract.reading) if isinstance(contract.reading, Reading) else contract.goal.text


def cited_in_words(contract: TaskContract, cited: object) -> Reason | None:
    """The clause, or the default of the mission profile, that a condition cites; None for one that cites nothing."""
    reading = contract.reading
    if not isinstance(reading, Reading) or not isinstance(cited, str):
        return None
    if cited.startswith(f"{PROFILE}."):
        return because(f"default_{cited.partition('.')[2]}")
    index = int(cited) - 1 if cited.isdecimal() else -1
    return clause_in_words(reading.clauses[index]) if 0 <= index < len(reading.clauses) else None
