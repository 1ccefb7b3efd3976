"""symbolic outcome_heard: what was recorded in the room tells what the accepted stages achieved, and nothing else.

Words that deny it, or tell it of another place, refute it; a report that was only synthesised was not heard.
"""

import re
from collections.abc import Mapping

from harness.contracts.effects import AnyEffect, Symbolic
from harness.contracts.measurements import Recognition
from harness.contracts.reasons import Reason, because
from harness.contracts.spoken_goals import spoken_words
from harness.verification.finding import Finding, Undecidable, ambiguous
from harness.verification.reading import Evidence
from harness.verification.spoken_report import (
    LEAST_END_SHARE,
    LEAST_SHARE,
    RecognisedReport,
    accepted_report,
    judged,
    longest_match,
    missing,
    newest_report,
    place_of,
    understood,
    unnamed,
    why_not_recorded,
)

DENIALS = frozenset({"not", "never", "no", "nothing", "nobody", "could"})
STATEMENT, STAGE, NAME = "statement", "stage_", "name_"


def outcome_heard(effect: AnyEffect, evidence: Evidence) -> Finding:
    """The recognised words are `arguments.statement`, each of its sentences and every `arguments.name_N` in it; no word
    was heard that was not to be said; and each stage `arguments.stage_N` had been accepted before.

    Of a goal, `arguments.report` names the stage that spoke. `evidence` = the recording, then its recognition.
    """
    if not isinstance(effect, Symbolic) or not spoken_words(effect.arguments.get(STATEMENT, "")):
        raise Undecidable(because("effect_not_testable", predicate="outcome_heard"))
    accepted_s = _accepted_s(effect, evidence)
    if "report" in effect.arguments:
        fact = evidence.fact("outcome_heard", node_id=effect.arguments["report"])
        return _judged(accepted_report(evidence, fact), effect, accepted_s=accepted_s)
    report = newest_report(evidence)
    if report.from_s is None:
        return ambiguous(why_not_recorded(report.recognition, evidence))
    return _judged(report, effect, accepted_s=accepted_s)


def _accepted_s(effect: Symbolic, evidence: Evidence) -> float:
    """When the last of the stages ended that the report is of. Raises Undecidable where one has no accepted fact."""
    names = [value for name, value in sorted(effect.arguments.items()) if name.startswith(STAGE)]
    if not names:
        raise Undecidable(because("effect_not_testable", predicate="outcome_heard"))
    found = {name: evidence.facts_across(name) for name in names}
    lacking = next((name for name, facts in found.items() if not facts), None)
    if lacking is not None:
        raise Undecidable(because("no_accepted_fact_of_stage", name="fact", stage=lacking))
    return max(fact.at_s for facts in found.values() for fact in facts)


def _judged(report: RecognisedReport, effect: Symbolic, *, accepted_s: float) -> Finding:
    found = report.recognition
    strange = [word for word in found.heard if word not in found.asked]
    wrong = _contradicting(found, effect.arguments, strange)
    if report.from_s is not None and report.from_s < accepted_s:
        wrong.append(because("report_heard_before_outcome"))
    doubts = _lacking(found, effect.arguments)
    doubts += [because("other_words_heard", words=tuple(strange))] if strange else []
    doubts += unnamed(found)
    return judged(report, wrong, doubts)


def _contradicting(found: Recognition, arguments: Mapping[str, str], strange: list[str]) -> list[Reason]:
    """What was heard that denies the statement, or tells it of another place."""
    problems = [because("outcome_denied", heard=" ".join(found.heard))] if DENIALS & set(strange) else []
    missed = [name for name in _names(arguments) if place_of(spoken_words(name), found.heard) is None]
    return problems + [because("another_place_heard", place=name) for name in missed if strange]


def _lacking(found: Recognition, arguments: Mapping[str, str]) -> list[Reason]:
    """What had to be heard, and was not."""
    statement = spoken_words(arguments[STATEMENT])
    begin = place_of(statement, found.asked)
    if begin is None:
        return [because("another_outcome_asked")]
    unknown = [word for word in statement if any(word in name.split() for name in found.unknown)]
    if unknown:
        return [because("unknown_words", words=tuple(unknown))]
    if not found.heard:
        return [because("recording_silent")]
    matches = longest_match(found.asked, found.heard)
    share, end_share = understood(found)
    whole = share >= LEAST_SHARE and end_share >= LEAST_END_SHARE
    for sentence in re.split(r"(?<=[.!?])\s+", arguments[STATEMENT]):
        part = range(begin, begin := begin + len(spoken_words(sentence)))
        whole = whole and len(matches & set(part)) >= LEAST_SHARE * len(part)
    for name in _names(arguments):
        whole = whole and _named_wherever_asked(spoken_words(name), found.asked, matches)
    return [] if whole else [missing(found)]


def _named_wherever_asked(name: tuple[str, ...], asked: tuple[str, ...], matches: frozenset[int]) -> bool:
    """Whether the name was heard in each place where it was to be said."""
    starts = [at for at in range(len(asked) - len(name) + 1) if asked[at : at + len(name)] == name]
    return all(matches.issuperset(range(at, at + len(name))) for at in starts)


def _names(arguments: Mapping[str, str]) -> list[str]:
    return [value for name, value in sorted(arguments.items()) if name.startswith(NAME)]
