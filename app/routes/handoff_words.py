"""From what a person typed to what is asked of the desk. Has no page of its own."""

from collections.abc import Mapping

from app.messages import N_
from app.views.handoff_shown import action_of
from harness.contracts.actors import Actor
from harness.contracts.errors import ContractInvalid
from harness.contracts.handoff_commands import (
    AttestCondition,
    ChooseAction,
    ClaimHandoff,
    CloseHandoff,
    DecideHandoff,
    HandBack,
    OnMyWay,
    ReleaseHandoff,
    TakeOver,
)
from harness.contracts.ids import ConditionId, Digest, HandoffId

Typed = Mapping[str, str]
LONGEST = 200


def decision_of(handoff_id: HandoffId, actor: Actor, typed: Typed) -> DecideHandoff:
    """The person's answer, bound to what their page showed; raises ContractInvalid for a form that is not ours."""
    decision = _field(typed, "decision")
    if decision not in ("approve", "reject"):
        raise _not_ours("decision")
    return DecideHandoff(
        handoff_id=handoff_id,
        decision="approve" if decision == "approve" else "reject",
        actor=actor,
        reason=typed.get("reason", "").strip(),
        key=_field(typed, "key"),
        cycle=_cycle(typed),
        subject=Digest(_field(typed, "subject")),
        evidence=Digest(_field(typed, "evidence")),
        shown=Digest(_field(typed, "shown")) if typed.get("shown") else None,
        claim=typed.get("claim", ""),
    )


def claim_of(handoff_id: HandoffId, actor: Actor, typed: Typed) -> ClaimHandoff:
    return ClaimHandoff(handoff_id=handoff_id, actor=actor, claim=_field(typed, "claim"))


def release_of(handoff_id: HandoffId, actor: Actor, typed: Typed) -> ReleaseHandoff:
    return ReleaseHandoff(handoff_id=handoff_id, actor=actor, claim=_field(typed, "claim"))


def on_my_way_of(handoff_id: HandoffId, actor: Actor, typed: Typed) -> OnMyWay:
    """A reason is welcome, not needed."""
    return OnMyWay(
        handoff_id=handoff_id, actor=actor, reason=typed.get("reason", "").strip()[:LONGEST] or N_("on my way")
    )


def choice_of(handoff_id: HandoffId, actor: Actor, typed: Typed) -> ChooseAction:
    """Raises ContractInvalid for an action that no ladder has."""
    return ChooseAction(
        handoff_id=handoff_id,
        actor=actor,
        action=action_of(_field(typed, "action")),
        cycle=_cycle(typed),
        claim=typed.get("claim", ""),
    )


def attestation_of(handoff_id: HandoffId, actor: Actor, typed: Typed) -> AttestCondition:
    return AttestCondition(
        handoff_id=handoff_id,
        condition_id=ConditionId(_field(typed, "condition_id")),
        actor=actor,
        statement=typed.get("reason", "").strip(),
        key=_field(typed, "key"),
        cycle=_cycle(typed),
        claim=typed.get("claim", ""),
    )


def take_over_of(handoff_id: HandoffId, actor: Actor, typed: Typed) -> TakeOver:
    return TakeOver(
        handoff_id=handoff_id,
        actor=actor,
        claim=_field(typed, "claim"),
        device=_field(typed, "device"),
        key=_field(typed, "key"),
        reason=typed.get("reason", "").strip(),
    )


def hand_back_of(handoff_id: HandoffId, actor: Actor, typed: Typed) -> HandBack:
    return HandBack(
        handoff_id=handoff_id,
        actor=actor,
        claim=_field(typed, "claim"),
        key=_field(typed, "key"),
        reason=typed.get("reason", "").strip(),
    )


def closing_of(handoff_id: HandoffId, actor: Actor, typed: Typed) -> CloseHandoff:
    return CloseHandoff(
        handoff_id=handoff_id,
        actor=actor,
        claim=_field(typed, "claim"),
        key=_field(typed, "key"),
        reason=typed.get("reason", "").strip(),
    )


def _field(typed: Typed, name: str) -> str:
    value = typed.get(name, "").strip()
    if not value or len(value) > LONGEST:
        raise _not_ours(name)
    return value


def _cycle(typed: Typed) -> int:
    text = _field(typed, "cycle")
    if not text.isascii() or not text.isdigit() or len(text) > 15:
        raise _not_ours("cycle")
    return int(text)


def _not_ours(name: str) -> ContractInvalid:
    return ContractInvalid(
        N_("The answer is not bound to what was shown"),
        where=f"form field {name}",
        do=N_("open the handoff again and decide on its page"),
    )
