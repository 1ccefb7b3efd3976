"""symbolic played: every sample of the sound was consumed, in mission time. No proof that a person heard it."""

from harness.contracts.effects import AnyEffect, Symbolic
from harness.contracts.protocol import Receipt
from harness.verification.finding import RECEIPTS, Finding, Undecidable, ambiguous
from harness.verification.media import wav_samples
from harness.verification.reading import Evidence

TOLERANCE_S = 0.1


def played(effect: AnyEffect, evidence: Evidence) -> Finding:
    """Samples consumed = samples of the WAV, and no faster than they sound. `evidence` = the WAV."""
    if not isinstance(effect, Symbolic):
        raise Undecidable("played is a symbolic effect")
    receipt = next((one for one in reversed(evidence.receipts) if one.kind == "playback"), None)
    if receipt is None or receipt.blob is None:
        return ambiguous("no playback receipt names a sound")
    samples, rate_hz = wav_samples(evidence.bytes_of(receipt.blob))
    if samples == 0 or rate_hz == 0:
        raise Undecidable("the sound has no samples")
    lasted_s, sounds_s = receipt.at_s - evidence.execution.dispatched_s, samples / rate_hz
    problems = _problems(receipt, effect, samples=samples)
    if lasted_s < sounds_s - TOLERANCE_S:
        problems.append(f"{sounds_s:.2f} s of sound were over after {lasted_s:.2f} s")
    if receipt.at_s > evidence.speaks_at_s:
        problems.append("the playback ended after its receipt was collected")
    return Finding(
        verdict="violated" if problems else "satisfied",
        reason="; ".join(problems) or f"all {samples} samples were consumed in {lasted_s:.1f} s of mission time",
        measured={"samples": receipt.values.get("samples", 0.0), "duration_s": lasted_s},
        bounds={"samples": float(samples), "duration_s": sounds_s},
        sources=(RECEIPTS,),
        evidence=(receipt.blob,),
    )


def _problems(receipt: Receipt, effect: Symbolic, *, samples: int) -> list[str]:
    consumed = receipt.values.get("samples")
    problems = [] if consumed == samples else [f"{consumed or 0:.0f} of {samples} samples were consumed"]
    wanted = effect.arguments.get("sound", receipt.blob)
    return problems if wanted == receipt.blob else [*problems, "another sound was played"]
