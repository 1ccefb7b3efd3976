"""symbolic transcript: the request on record is the goal, byte by byte (R204)."""

from harness.contracts.effects import AnyEffect, Symbolic
from harness.contracts.ids import sha256
from harness.contracts.reasons import because
from harness.contracts.tasks import Goal
from harness.verification.finding import RECEIPTS, Finding, Undecidable, ambiguous
from harness.verification.reading import Evidence, read


def transcript(effect: AnyEffect, evidence: Evidence) -> Finding:
    """The transcript's bytes have the checksum of the condition and of the goal. `evidence` = the transcript."""
    if not isinstance(effect, Symbolic):
        raise Undecidable(because("effect_not_testable", predicate="transcript"))
    receipt = next((one for one in reversed(evidence.receipts) if one.kind == "transcript"), None)
    if receipt is None or receipt.blob is None:
        return ambiguous(because("no_transcript_receipt"))
    record = evidence.context.one("goal")
    if record is None:
        return ambiguous(because("goal_not_in_context"))
    goal = read(record, Goal)
    found = sha256(evidence.bytes_of(receipt.blob))
    same = found == goal.digest == effect.arguments.get("digest", goal.digest)
    return Finding(
        verdict="satisfied" if same else "violated",
        reason=because("transcript_of_goal" if same else "transcript_not_of_goal", checksum=found[:12]),
        measured={"bytes": float(len(evidence.bytes_of(receipt.blob)))},
        sources=(RECEIPTS,),
        evidence=(receipt.blob,),
    )
