"""regen verify: the check of a mission's dossier, offline."""

from pathlib import Path
from typing import Annotated

import typer

from app.cli import output
from app.cli.audit import RECONSTRUCTED
from app.i18n.reasons.rendering import sentence, stating
from app.views.unverified import UNVERIFIED
from harness.auditing.dossier import DossierVerdict
from harness.auditing.places import PlaceChange
from harness.contracts.dossier import JudgedGoal
from harness.contracts.erasure_events import BlobErased
from harness.contracts.spoken_goals import SpokenGoal
from harness.dossiers import verify_dossier


def verify(
    file: Annotated[Path, typer.Argument(help="A dossier.")],
    key: Annotated[str, typer.Option(help="The public key that must have signed it, in hexadecimal.")] = "",
    as_json: output.Json = False,
) -> None:
    """Check a dossier with nothing but the file: signature, digests, chain, and every decision derived again."""
    found = verify_dossier(file, key=key)
    output.show(stating(found), as_json=as_json, lines=_lines(found))
    raise typer.Exit(1 if found.differences else 0)


def _place(change: PlaceChange) -> str:
    what = "removed" if change.removed else f"changed, revision {change.revision},"
    return f"{change.place_id} was {what} meanwhile by {change.by}: {change.reason}. The mission kept it as it began."


def _erasure(erased: BlobErased) -> str:
    why = sentence(erased.reason)
    return f"The {erased.medium} {erased.digest} was erased by {erased.actor.name} before the export: {why}."


def _goal(judged: JudgedGoal) -> list[str]:
    """What was read, its source below it, and the verdict by clause with the evidence of each condition."""
    lines = [f"Goal: {sentence(judged.reading)}", f"  read from: {judged.source}"]
    for row in judged.clauses:
        lines.append(f"{row.clause}  {sentence(row.told)}: {row.verdict or 'not tested'}")
        for one in row.conditions:
            level = f", independence {one.independence} of {one.required_independence}" if one.verdict else ""
            lines.append(f"  {one.text}: {one.verdict or 'not tested'}{level}")
            lines += [f"    evidence {digest}" for digest in one.evidence]
    return lines


def _spoken(spoken: SpokenGoal) -> list[str]:
    return [
        f"Spoken: recording {spoken.recording}",
        f"  transcript {spoken.transcript} by {spoken.recogniser}, its text {spoken.checksum}",
    ]


def _lines(found: DossierVerdict) -> list[str]:
    signer = "the key you named" if found.trusted else f"{found.public_key}: compare it with the key you were told"
    return [
        f"{found.mission_id}: {found.status}; {found.events} events, {found.records} records, {found.blobs} blobs.",
        f"Signed by {signer}.",
        f"Taken when the log stood at {found.head_position}, {found.head_digest}.",
        *(_goal(found.judged) if found.judged else ()),
        *(f"Unverified: {one.text} ({UNVERIFIED[one.why]})." for one in found.unverified),
        *(_spoken(found.spoken) if found.spoken else ()),
        *(f"Evidence {digest} was already missing when it was exported." for digest in found.absent),
        *(_erasure(one) for one in found.erased),
        *([f"{found.unrepeated} verdicts cannot be derived again without it."] if found.unrepeated else []),
        *(_place(one) for one in found.places if one.during),
        *([f"{found.reconstructed} decisions derived again with {RECONSTRUCTED}."] if found.reconstructed else []),
        *(map(sentence, found.differences) if found.differences else ["Every decision derived again; no difference."]),
    ]
