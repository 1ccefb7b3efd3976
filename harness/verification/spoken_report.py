"""Reads what was recognised of a report: where it was recorded, which of its words were understood, what was unnamed.

The predicates of speech share it. A recording of an earlier playback, or a copy of one, is none of this report.
"""

from collections.abc import Sequence
from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

from harness.contracts.evidence import CommittedFact
from harness.contracts.ids import Digest
from harness.contracts.measurements import PLAYED_AT, PLAYED_FOR, Recognition
from harness.contracts.reasons import Reason, because, several
from harness.verification.finding import FACTS, Finding, Undecidable
from harness.verification.reading import Evidence

Words = Sequence[str]
LEAST_SHARE, LEAST_END_SHARE = 0.75, 0.5
END_WORDS = 10
UNVERIFIED = "unverified"
"""What a report says before it names a part that nothing verified."""
LEAST_PART_SHARE = 0.6


class RecognisedReport(NamedTuple):
    """What was recognised, the digest of that, and who recorded it. `from_s`: since when, in mission time; None where
    the sound was only synthesised, and nothing recorded it in the room."""

    recognition: Recognition
    digest: Digest
    sources: tuple[str, ...]
    from_s: float | None

    @property
    def evidence(self) -> tuple[Digest, Digest]:
        """The recording, then its recognition."""
        return self.recognition.sound, self.digest


def accepted_report(evidence: Evidence, fact: CommittedFact) -> RecognisedReport:
    """The report behind an accepted fact of the stage that spoke. Raises Undecidable."""
    digest = fact.arguments["recognition"]
    return RecognisedReport(evidence.decoded(digest, Recognition), digest, (FACTS,), fact.at_s)


def newest_report(evidence: Evidence) -> RecognisedReport:
    """The newest report of a packet. Raises Undecidable for none, and for the recording of an earlier playback."""
    references = evidence.measured("recognition")
    if not references:
        raise Undecidable(because("speech_not_recognised"))
    reference = references[-1]
    found = evidence.decoded(reference.blob, Recognition)
    rooms = [one for one in evidence.measured("room_sound") if one.blob == found.sound]
    if not rooms and PLAYED_FOR in reference.values:
        raise Undecidable(because("recording_of_earlier_playback", request=str(reference.values[PLAYED_FOR])[:12]))
    if not rooms and PLAYED_AT in reference.values:
        raise Undecidable(because("recording_at_another_speed", speed=float(reference.values[PLAYED_AT])))
    if not rooms:
        return RecognisedReport(found, reference.blob, (reference.source,), None)
    evidence.bytes_of(found.sound)
    return RecognisedReport(found, reference.blob, (rooms[-1].source, reference.source), rooms[-1].from_s)


def why_not_recorded(found: Recognition, evidence: Evidence) -> Reason:
    """Why a sound that nothing recorded in the room is no report: it is of a receipt, or of nobody knows what."""
    played = [one.blob for one in evidence.receipts if one.kind == "playback"]
    return because("no_room_recording" if found.sound in played else "recognition_of_another_sound")


def judged(report: RecognisedReport, wrong: Sequence[Reason], doubts: Sequence[Reason]) -> Finding:
    """The finding on a report: refuted by what is wrong, ambiguous by doubts, with what of it was understood."""
    found = report.recognition
    share, end_share = understood(found)
    return Finding(
        verdict="violated" if wrong else "ambiguous" if doubts else "satisfied",
        reason=several(wrong or doubts) or because("report_heard", heard=" ".join(found.heard)),
        measured={"understood_share": share, "end_share": end_share, "words": float(len(found.heard))},
        bounds={"understood_share": LEAST_SHARE, "end_share": LEAST_END_SHARE},
        sources=report.sources,
        evidence=report.evidence,
    )


def unnamed(found: Recognition) -> list[Reason]:
    """The unverified parts that the report had to name and was not heard to name, as unverified."""
    matches, words = longest_match(found.asked, found.heard), found.asked
    starts = [index for index, word in enumerate(words) if word == UNVERIFIED]
    problems = []
    for start, following in pairwise([*starts, len(words) + 2]):
        end = following - 2
        part = range(start + 1, end)
        share = len(matches & set(part)) / max(1, len(part))
        if start not in matches or share < LEAST_PART_SHARE:
            problems.append(because("unverified_part_not_heard", part=" ".join(words[index] for index in part)))
    return problems


def place_of(part: Words, whole: Words) -> int | None:
    """Where the words of a part begin among others, all of them in a row; None where they do not."""
    length = len(part)
    return next((at for at in range(len(whole) - length + 1) if tuple(whole[at : at + length]) == tuple(part)), None)


def understood(found: Recognition) -> tuple[float, float]:
    """The share of the asked words that were heard in order, and the share of the last ones."""
    matches = longest_match(found.asked, found.heard)
    end = range(max(0, len(found.asked) - END_WORDS), len(found.asked))
    return len(matches) / max(1, len(found.asked)), len(matches & set(end)) / max(1, len(end))


def missing(found: Recognition) -> Reason:
    """The words that were asked and not heard."""
    matches = longest_match(found.asked, found.heard)
    return because("words_not_heard", words=tuple(w for index, w in enumerate(found.asked) if index not in matches))


@lru_cache(maxsize=8)
def longest_match(request: tuple[str, ...], words: tuple[str, ...]) -> frozenset[int]:
    """Indices of `request` in a longest common subsequence with `words`. A report is asked about several times."""
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
    return frozenset(matches)
