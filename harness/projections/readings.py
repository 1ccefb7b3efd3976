"""Tells a reading, and the clause that a condition belongs to, as reasons: code and facts, in no language. Pure."""

from typing import assert_never

from harness.contracts.readings import LONGEST_WAIT_S, PROFILE, Act, Clause, Default, PictureSubject, Reading, UnreadWhy
from harness.contracts.reasons import Explanation, Reason, because
from harness.contracts.tasks import TaskContract


def reading_in_words(reading: Reading) -> Reason:
    """Everything that will be done or avoided, in order, with what the mission profile adds."""
    clauses = tuple(clause_in_words(clause) for clause in reading.clauses)
    defaults = tuple(default_in_words(name) for name in reading.defaults)
    return because("reading", clauses=(*clauses, *defaults))


def clause_in_words(clause: Clause) -> Reason:
    """One clause: its act, what it is about, how often, or that it is not to be done."""
    about = clause.object.name if clause.object else ""
    act = _act_on(clause.act, about) if about else _act(clause.act)
    if clause.act == "report" and clause.object is None:
        act = because("clause_report_aloud")
    if isinstance(clause.seconds, int):
        act = because("clause_for_seconds", clause=act, seconds=clause.seconds)
    if isinstance(clause.subject, PictureSubject):
        name = clause.subject.name
        sign, thing = (
            because("clause_of_sign", clause=act, name=name),
            because("clause_of_thing", clause=act, name=name),
        )
        act = sign if clause.subject.kind == "text" else thing
    if clause.negated:
        return because("clause_not", clause=act)
    return because("clause_times", clause=act, count=clause.count) if clause.count > 1 else act


def default_in_words(default: Default) -> Reason:
    """What the mission profile adds without being asked."""
    return because("default_return" if default == "return" else "default_report")


def unread_in_words(why: UnreadWhy) -> Reason:
    """Why words of a goal were not read, or cannot be done."""
    match why:
        case "condition":
            return because("unread_condition")
        case "time":
            return because("unread_time")
        case "alternative":
            return because("unread_alternative")
        case "ambiguous":
            return because("unread_ambiguous")
        case "quoted":
            return because("unread_quoted")
        case "control_character":
            return because("unread_control_character")
        case "count":
            return because("unread_count")
        case "negation":
            return because("unread_negation")
        case "no_object":
            return because("unread_no_object")
        case "no_template":
            return because("unread_no_template")
        case "order":
            return because("unread_order")
        case "statement":
            return because("unread_statement")
        case "unknown_words":
            return because("unread_unknown_words")
        case "wait_too_long":
            return because("unread_wait_too_long", limit_min=LONGEST_WAIT_S // 60)
        case "wait_unstated":
            return because("unread_wait_unstated")
        case _:
            assert_never(why)


def _act(act: Act) -> Reason:
    match act:
        case "go":
            return because("clause_go")
        case "return":
            return because("clause_return")
        case "inspect":
            return because("clause_inspect")
        case "photograph":
            return because("clause_photograph")
        case "describe":
            return because("clause_describe")
        case "walk_route":
            return because("clause_walk_route")
        case "explore":
            return because("clause_explore")
        case "report":
            return because("clause_report")
        case "deliver":
            return because("clause_deliver")
        case "wait":
            return because("clause_wait")
        case _:
            assert_never(act)


def _act_on(act: Act, about: str) -> Reason:
    match act:
        case "go":
            return because("clause_go_to", object=about)
        case "return":
            return because("clause_return_to", object=about)
        case "inspect":
            return because("clause_inspect_it", object=about)
        case "photograph":
            return because("clause_photograph_it", object=about)
        case "describe":
            return because("clause_describe_it", object=about)
        case "walk_route":
            return because("clause_walk_it", object=about)
        case "explore":
            return because("clause_explore_it", object=about)
        case "wait":
            return because("clause_wait_at", object=about)
        case "deliver":
            return because("clause_deliver_to", object=about)
        case "report":
            return _act(act)
        case _:
            assert_never(act)


def goal_in_words(contract: TaskContract) -> Explanation:
    """What the mission is for: its reading; the goal's own text in a contract that has none."""
    return reading_in_words(contract.reading) if isinstance(contract.reading, Reading) else contract.goal.text


def cited_in_words(contract: TaskContract, cited: object) -> Reason | None:
    """The clause, or the default of the mission profile, that a condition cites; None for one that cites nothing."""
    reading = contract.reading
    if not isinstance(reading, Reading) or not isinstance(cited, str):
        return None
    if cited.startswith(f"{PROFILE}."):
        return default_in_words("return" if cited.endswith(".return") else "report")
    index = int(cited) - 1 if cited.isdecimal() else -1
    return clause_in_words(reading.clauses[index]) if 0 <= index < len(reading.clauses) else None
