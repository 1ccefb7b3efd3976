"""Lets half of sixteen responders approve a question while the others do something else with it, and checks for a
single outcome.

Every responder has its own gate and connection on one file. The rival acts are those of gates.md: an answer against a
rejection, the deadline, a stopped mission, a claim, another look, and a take-over.
"""

from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from experiments.campaigns.races import NOW_S, RESPONDERS, RaceReport, approval, opened_gates, opening, person, together
from harness.contracts.commands import (
    ExpireHandoff,
    HandoffCommand,
    OpenHandoff,
    RefreshHandoff,
    RejectHandoff,
    SupersedeHandoff,
)
from harness.contracts.decisions import Accepted
from harness.contracts.handoff_commands import TakeClaim
from harness.contracts.handoff_events import (
    HandoffApproved,
    HandoffClaimed,
    HandoffEvent,
    HandoffExpired,
    HandoffRefreshed,
    HandoffRejected,
    HandoffSuperseded,
)
from harness.contracts.ids import HandoffId, handoff_stream
from harness.contracts.values import digest
from harness.gate.commit import CommandEnvelope, Gate
from harness.projections.handoffs import Handoff

RIVALS = ("reject", "expire", "supersede", "claim", "refresh")
ENDS = HandoffApproved | HandoffRejected | HandoffExpired | HandoffSuperseded
LATE_S = 901.0


def rival_rounds(rounds: int) -> RaceReport:
    """As many rounds of every rival act, in turn."""
    offences: list[str] = []
    effective = 0
    with ExitStack() as stack:
        folder = Path(stack.enter_context(TemporaryDirectory(prefix="rivals-")))
        early = opened_gates(stack, folder)
        late = opened_gates(stack, folder, wall_s=(NOW_S + LATE_S,))
        for number in range(rounds):
            kind = RIVALS[number % len(RIVALS)]
            wrong, taken = _round(early, late if kind == "expire" else early, kind=kind, number=number)
            effective += taken
            offences += [f"rival round {number}: {sentence}" for sentence in wrong]
    return RaceReport(rounds=rounds, effective=effective, responders=RESPONDERS, offences=tuple(offences))


def _round(mine: Sequence[Gate], theirs: Sequence[Gate], *, kind: str, number: int) -> tuple[list[str], bool]:
    """What went wrong, and whether anything ended the question. Responders with an odd number approve."""
    handoff_id = HandoffId(f"hof_rival_{number}")
    stream, opened = handoff_stream(handoff_id), opening(handoff_id)
    mine[0].commit([CommandEnvelope(stream, opened, None)])

    def ask(responder: int) -> Any:
        if responder % 2:
            return mine[responder].commit([CommandEnvelope(stream, approval(opened, responder, cycle=1), None)])
        return theirs[responder].commit([CommandEnvelope(stream, _rival(kind, opened, responder), None)])

    decisions = together(ask)
    events = [event for one in decisions if isinstance(one, Accepted) for event in one.events]
    state: Handoff = mine[0].state(stream)
    return _wrong(kind, events, state), not state.answerable


def _wrong(kind: str, events: Sequence[HandoffEvent], state: Handoff) -> list[str]:
    """Sentences about violations."""
    ends = [type(event).__name__ for event in events if isinstance(event, ENDS)]
    approved = "HandoffApproved" in ends
    claims = [event.actor.name for event in events if isinstance(event, HandoffClaimed)]
    looks = sum(isinstance(event, HandoffRefreshed) for event in events)
    found = [
        (len(ends) > 1, f"{kind}: it ended {len(ends)} times: {', '.join(ends)}"),
        (approved != (state.status == "approved"), f"{kind}: {ends} were taken, it is {state.status}"),
        (kind == "claim" and bool(claims) and approved, f"{state.answer} decided what {claims} had claimed"),
        (kind == "claim" and len(set(claims)) > 1, f"{claims} had claimed it at once"),
        (kind == "refresh" and approved and looks > 0 and state.cycle > 1, "an old cycle was approved"),
    ]
    return [sentence for broken, sentence in found if broken]


def _rival(kind: str, request: OpenHandoff, responder: int) -> HandoffCommand:
    match kind:
        case "reject":
            subject = digest(request.proposal)
            return RejectHandoff(actor=person(responder), reason="no", key=f"r-{responder}", cycle=1, subject=subject)
        case "expire":
            return ExpireHandoff()
        case "supersede":
            return SupersedeHandoff(reason="the mission was stopped")
        case "claim":
            return TakeClaim(actor=person(responder), claim=f"t-{responder}")
        case _:
            return RefreshHandoff(
                k=request.k, proposal=request.proposal, snapshot=request.snapshot, evidence=request.evidence
            )
