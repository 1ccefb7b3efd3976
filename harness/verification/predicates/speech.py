"""symbolic heard: what was recorded in the room tells the accepted finding and names the place (D47).

Words that contradict the finding refute it; a report that was only synthesised was not heard.
"""

from itertools import pairwise

from harness.contracts.effects import AnyEffect, Symbolic
from harness.contracts.evidence import CommittedFact
from harness.contracts.measurements import Recognition
from harness.contracts.reasons import Reason, because, several
from harness.contracts.rules import CAPTURES, RulesVersion
from harness.verification.finding import Finding, Undecidable, ambiguous
from harness.verification.reading import Evidence
from harness.verification.spoken_report import (
    LEAST_END_SHARE,
    LEAST_SHARE,
    RecognisedReport,
    Words,
    accepted_report,
    judged,
    missing,
    newest_report,
    place_of,
    understood,
    unnamed,
    why_not_recorded,
)

CLEAR, OBSTRUCTED = ("clear", "free"), ("obstructed", "blocked")


def heard(effect: AnyEffect, evidence: Evidence) -> Finding:
    """The recognised words name `arguments.place`, then tell what the node `arguments.analysis` found, and no contrary;
    most of what was to be said was understood, to its end, and every part that it had to call unverified.

    Of a goal, `arguments.report` names the stage that spoke. `evidence` = the recording, then its recognition.
    """
    if not isinstance(effect, Symbolic) or not {"analysis", "place"} <= effect.arguments.keys():
        raise Undecidable(because("effect_not_testable", predicate="heard"))
    rules = evidence.policy.rules
    analysis = evidence.newest_fact(("passage_checked",), node_id=effect.arguments["analysis"])
    if "report" in effect.arguments:
        fact = evidence.fact("heard", node_id=effect.arguments["report"])
        return _judged(accepted_report(evidence, fact), analysis, effect, rules=rules)
    report = newest_report(evidence)
    if report.from_s is None:
        return _not_played(report.recognition, analysis, effect, evidence)
    return _judged(report, analysis, effect, rules=rules)


def _judged(report: RecognisedReport, analysis: CommittedFact, effect: Symbolic, *, rules: RulesVersion) -> Finding:
    place, blocked = effect.arguments["place"], bool(analysis.measured["blocked"])
    found = report.recognition
    early = report.from_s is not None and report.from_s < analysis.at_s
    wrong = _contradicting(found.heard, place=place, blocked=blocked)
    wrong += [because("report_heard_before_analysis")] if early else []
    doubts = _lacking(found, place=place, blocked=blocked)
    doubts += unnamed(found) if rules >= CAPTURES else []
    return judged(report, wrong, doubts)


def _not_played(found: Recognition, analysis: CommittedFact, effect: Symbolic, evidence: Evidence) -> Finding:
    """The sound of the receipt was checked; nothing shows that anybody could hear it."""
    why = why_not_recorded(found, evidence)
    if why.code != "no_room_recording":
        return ambiguous(why)
    blocked = bool(analysis.measured["blocked"])
    wrong = _contradicting(found.heard, place=effect.arguments["place"], blocked=blocked)
    if wrong:
        return Finding(verdict="violated", reason=several(wrong) or because("nothing_tested"), sources=("recogniser",))
    return ambiguous(why)


def _contradicting(words: Words, *, place: str, blocked: bool) -> list[Reason]:
    """What was heard that says the contrary, or says it of another place."""
    pairs = list(pairwise(words))
    denied = {state for word, state in pairs if word == "not"}
    states = {state for word, state in pairs if word == "is"} | {
        state for (word, state) in pairs if state in (*CLEAR, *OBSTRUCTED) and word != "not"
    }
    clear = states & set(CLEAR) or denied & set(OBSTRUCTED) or {"nothing", "stands"} <= set(words)
    obstructed = states & set(OBSTRUCTED) or denied & set(CLEAR) or _stands(words)
    contrary = clear if blocked else obstructed
    problems = [because("contrary_heard", heard=" ".join(words))] if contrary else []
    before = _before(words)
    if before is not None and place_of(_plain(place), before) is None:
        problems.append(because("another_place_heard", place=place))
    return problems


def _lacking(found: Recognition, *, place: str, blocked: bool) -> list[Reason]:
    """What had to be heard, and was not."""
    required = OBSTRUCTED if blocked else CLEAR
    unknown = [word for word in _plain(place) if any(word in name.split() for name in found.unknown)]
    if unknown:
        return [because("unknown_words", words=tuple(unknown))]
    if not found.heard:
        return [because("recording_silent")]
    problems = []
    if _before(found.heard) is None or not any(("is", state) in pairwise(found.heard) for state in required):
        problems.append(because("finding_not_heard", heard=" ".join(found.heard)))
    share, end_share = understood(found)
    if share < LEAST_SHARE or end_share < LEAST_END_SHARE:
        problems.append(missing(found))
    return problems


def _before(words: Words) -> Words | None:
    """What was heard before the passage is spoken of; None if it never is."""
    return words[: words.index("passage")] if "passage" in words else None


def _stands(words: Words) -> bool:
    """Whether something is said to stand there: a thing, or several, that nothing denies."""
    return any(
        word in ("thing", "things", "something") and (index == 0 or words[index - 1] not in ("no", "nothing"))
        for index, word in enumerate(words)
    )


def _plain(name: str) -> tuple[str, ...]:
    return tuple("".join(letter if letter.isalnum() else " " for letter in name.lower()).split())
