"""symbolic recorded_request: the goal is what somebody submitted, by the harness's own record of it (D48)."""

from harness.contracts.effects import AnyEffect, Symbolic
from harness.contracts.ids import Digest, sha256
from harness.contracts.measurements import RequestRecord
from harness.contracts.reasons import because
from harness.contracts.spoken_goals import SpokenGoal, Transcription
from harness.contracts.tasks import Goal
from harness.verification.finding import Finding, Undecidable, ambiguous
from harness.verification.reading import Evidence, read


def recorded_request(effect: AnyEffect, evidence: Evidence) -> Finding:
    """The recorded text has the checksum of the condition and of the goal; an intake that took down another text
    refutes it. The person's submission is the source, named by its channel. Of a request that was spoken, the recording
    and its transcript must be there, and the transcript's text must be the goal's. `evidence` = the text, then both.
    """
    if not isinstance(effect, Symbolic):
        raise Undecidable(because("effect_not_testable", predicate="recorded_request"))
    stored, record = evidence.context.one("request"), evidence.context.one("goal")
    if stored is None or record is None:
        return ambiguous(because("no_request_record"))
    request, goal = read(stored, RequestRecord), read(record, Goal)
    taken = [one.blob for one in evidence.receipts if one.kind == "transcript" and one.blob]
    texts = {request.text, sha256(goal.text.encode()), *taken[-1:]}
    spoken = request.spoken if isinstance(request.spoken, SpokenGoal) else None
    if spoken is not None:
        texts |= _written_down(spoken, evidence)
    same = texts == {goal.digest} and effect.arguments.get("digest", goal.digest) == goal.digest
    who = {"requested_by": request.requested_by, "channel": request.channel}
    recorded = because("request_spoken", recogniser=spoken.recogniser, **who) if spoken else None
    return Finding(
        verdict="satisfied" if same else "violated",
        reason=(recorded or because("request_recorded", **who)) if same else because("request_differs_from_record"),
        measured={"characters": float(len(goal.text))},
        sources=(f"request:{request.channel}",),
        evidence=(goal.digest, *((spoken.recording, spoken.transcript) if spoken else ())),
    )


def _written_down(spoken: SpokenGoal, evidence: Evidence) -> set[Digest]:
    """The checksums of what was spoken: as recorded, and as its stored transcript says. Raises Undecidable."""
    evidence.bytes_of(spoken.recording)
    transcript = evidence.decoded(spoken.transcript, Transcription)
    other = {spoken.recording} if transcript.recording != spoken.recording else set()
    return {spoken.checksum, sha256(transcript.text.encode()), *other}
