"""symbolic heard: what was recorded in the room tells the accepted finding and names the place (D47).

Words that contradict the finding refute it; a report that was only synthesised was not heard.
"""

from collections.abc import Sequence
from itertools import pairwise

from harness.contracts.effects import AnyEffect, Symbolic
from harness.contracts.evidence import CommittedFact, EvidenceReference
from harness.contracts.ids import Digest
from harness.contracts.measurements import PLAYED_FOR, Recognition
from harness.contracts.reasons import Reason, because, several
from harness.contracts.rules import CAPTURES, RulesVersion
from harness.verification.finding import FACTS, Finding, Undecidable, ambiguous
from harness.verification.reading import Evidence

Words = Sequence[str]
CLEAR, OBSTRUCTED = ("clear", "free"), ("obstructed", "blocked")
LEAST_SHARE, LEAST_END_SHARE = 0.75, 0.5
END_WORDS = 10
UNVERIFIED = "unverified"
"""What a report says before it names a part that nothing verified."""
LEAST_PART_SHARE = 0.6


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
        spoken = evidence.fact("heard", node_id=effect.arguments["report"])
        found = evidence.decoded(spoken.arguments["recognition"], Recognition)
        early = spoken.at_s < analysis.at_s
        named = spoken.arguments["recognition"]
        return _judged(found, analysis, effect, early=early, sources=(FACTS,), digest=named, rules=rules)
    reference = _newest(evidence)
    found = evidence.decoded(reference.blob, Recognition)
    rooms = [one for one in evidence.measured("room_sound") if one.blob == found.sound]
    if not rooms and PLAYED_FOR in reference.values:
        return ambiguous(because("recording_of_earlier_playback", request=str(reference.values[PLAYED_FOR])[:12]))
    if not rooms:
        return _not_played(found, analysis, effect, evidence)
    evidence.bytes_of(found.sound)
    early = rooms[-1].from_s < analysis.at_s
    sources = (rooms[-1].source, reference.source)
    return _judged(found, analysis, effect, early=early, sources=sources, digest=reference.blob, rules=rules)


def _newest(evidence: Evidence) -> EvidenceReference:
    found = evidence.measured("recognition")
    if not found:
        raise Undecidable(because("speech_not_recognised"))
    return found[-1]


def _judged(
    found: Recognition,
    analysis: CommittedFact,
    effect: Symbolic,
    *,
    early: bool,
    sources: tuple[str, ...],
    digest: Digest,
    rules: RulesVersion,
) -> Finding:
    place, blocked = effect.arguments["place"], bool(analysis.measured["blocked"])
    transcript = " ".join(found.heard)
    wrong = _contradicting(found.heard, place=place, blocked=blocked)
    wrong += [because("report_heard_before_analysis")] if early else []
    doubts = _lacking(found, place=place, blocked=blocked)
    doubts += _unnamed(found) if rules >= CAPTURES else []
    share, end_share = _understood(found)
    return Finding(
        verdict="violated" if wrong else "ambiguous" if doubts else "satisfied",
        reason=several(wrong or doubts) or because("report_heard", heard=transcript),
        measured={"understood_share": share, "end_share": end_share, "words": float(len(found.heard))},
        bounds={"understood_share": LEAST_SHARE, "end_share": LEAST_END_SHARE},
        sources=sources,
        evidence=(found.sound, digest),
    )


def _not_played(found: Recognition, analysis: CommittedFact, effect: Symbolic, evidence: Evidence) -> Finding:
    """The sound of the receipt was checked; nothing shows that anybody could hear it."""
    played = [one.blob for one in evidence.receipts if one.kind == "playback"]
    if found.sound not in played:
        return ambiguous(because("recognition_of_another_sound"))
    blocked = bool(analysis.measured["blocked"])
    wrong = _contradicting(found.heard, place=effect.arguments["place"], blocked=blocked)
    if wrong:
        return Finding(verdict="violated", reason=several(wrong) or because("nothing_tested"), sources=("recogniser",))
    return ambiguous(because("no_room_recording"))


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
    if before is not None and not _within(_plain(place), before):
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
    share, end_share = _understood(found)
    if share < LEAST_SHARE or end_share < LEAST_END_SHARE:
        problems.append(because("words_not_heard", words=tuple(_missed(found.asked, found.heard))))
    return problems


def _unnamed(found: Recognition) -> list[Reason]:
    """The unverified parts that the report had to name and was not heard to name, as unverified."""
    matches, asked = _longest_match(found.asked, found.heard), found.asked
    starts = [index for index, word in enumerate(asked) if word == UNVERIFIED]
    problems = []
    for start, following in pairwise([*starts, len(asked) + 2]):
        end = following - 2
        part = range(start + 1, end)
        share = len(matches & set(part)) / max(1, len(part))
        if start not in matches or share < LEAST_PART_SHARE:
            problems.append(because("unverified_part_not_heard", part=" ".join(asked[index] for index in part)))
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


def _within(part: Words, whole: Words) -> bool:
    length = len(part)
    return any(tuple(whole[index : index + length]) == tuple(part) for index in range(len(whole) - length + 1))


def _understood(found: Recognition) -> tuple[float, float]:
    """The share of the asked words that were heard in order, and the share of the last ones."""
    matches = _longest_match(found.asked, found.heard)
    end = range(max(0, len(found.asked) - END_WORDS), len(found.asked))
    return len(matches) / max(1, len(found.asked)), len(matches & set(end)) / max(1, len(end))


def _missed(request: Words, words: Words) -> list[str]:
    matches = _longest_match(request, words)
    return [word for index, word in enumerate(request) if index not in matches]


def _longest_match(request: Words, words: Words) -> set[int]:
    """Indices of `asked` in a longest common subsequence with `words`."""
    table = [[0] * (len(words) + 1) for _ in range(len(request) + 1)]
    for i in range(len(request) - 1, -1, -1):
        for j in range(len(words) - 1, -1, -1):
            same = request[i] == words[j]
            table[i][j] = table[i + 1][j + 1] + 1 if same else max(table[i + 1][j], table[i][j + 1])
    matches, i, j = set(), 0, 0
    while i < len(request) and j < len(words):
        if request[i] == words[j]:
            matches.add(i)
            i, j = i + 1, j + 1
        elif table[i + 1][j] >= table[i][j + 1]:
            i += 1
        else:
            j += 1
    return matches
