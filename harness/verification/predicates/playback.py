"""symbolic played: every sample of the sound was consumed, in mission time. Does not prove that a person heard it."""

from harness.contracts.effects import AnyEffect, Symbolic
from harness.contracts.protocol import Receipt
from harness.contracts.reasons import Reason, because, several
from harness.verification.finding import RECEIPTS, Finding, Undecidable, ambiguous
from harness.verification.media import wav_samples
from harness.verification.reading import Evidence

TOLERANCE_S = 0.1


def played(effect: AnyEffect, evidence: Evidence) -> Finding:
    """Samples consumed = samples of the WAV, and no faster than they sound. `evidence` = the WAV."""
    if not isinstance(effect, Symbolic):
        raise Undecidable(because("effect_not_testable", predicate="played"))
    receipt = next((one for one in reversed(evidence.receipts) if one.kind == "playback"), None)
    if receipt is None or receipt.blob is None:
        return ambiguous(because("no_playback_receipt"))
    samples, rate_hz = wav_samples(evidence.bytes_of(receipt.blob))
    if samples == 0 or rate_hz == 0:
        raise Undecidable(because("sound_without_samples"))
    lasted_s, sounds_s = receipt.at_s - evidence.execution.dispatched_s, samples / rate_hz
    problems = _problems(receipt, effect, samples=samples)
    if lasted_s < sounds_s - TOLERANCE_S:
        problems.append(because("sound_over_too_soon", sounds_s=sounds_s, lasted_s=lasted_s))
    if receipt.at_s > evidence.speaks_at_s:
        problems.append(because("playback_after_receipt"))
    return Finding(
        verdict="violated" if problems else "satisfied",
        reason=several(problems) or because("sound_played", samples=samples, lasted_s=lasted_s),
        measured={"samples": receipt.values.get("samples", 0.0), "duration_s": lasted_s},
        bounds={"samples": float(samples), "duration_s": sounds_s},
        sources=(RECEIPTS,),
        evidence=(receipt.blob,),
    )


def _problems(receipt: Receipt, effect: Symbolic, *, samples: int) -> list[Reason]:
    consumed = receipt.values.get("samples")
    problems = [] if consumed == samples else [because("samples_not_consumed", consumed=consumed or 0, samples=samples)]
    expected = effect.arguments.get("sound", receipt.blob)
    return problems if expected == receipt.blob else [*problems, because("another_sound_played")]
