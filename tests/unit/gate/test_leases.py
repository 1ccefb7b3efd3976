"""Who may have a resource, and when it is given back."""

import pytest

from harness.contracts.actors import Actor
from harness.contracts.commands import AcquireLease, FreeLease, LeaseCommand, QuarantineLease, ReleaseLease
from harness.contracts.decisions import Accepted, Refused
from harness.contracts.ids import InvocationId, MissionId, ResourceId
from harness.contracts.values import Moment
from harness.gate.leases import DECIDER
from harness.projections.leases import Lease

NOW = Moment(mission_s=0.0, wall_s=0.0)
ADA = Actor(name="ada", role="operator")


def acquire(holder: str, token: int) -> AcquireLease:
    return AcquireLease(
        resource=ResourceId("mobile_base"),
        mission_id=MissionId("m"),
        invocation_id=InvocationId(holder),
        token=token,
        expires_s=60.0,
    )


def after(lease: Lease, *commands: LeaseCommand) -> Lease:
    for command in commands:
        decision = DECIDER.decide(lease, command, NOW)
        assert isinstance(decision, Accepted), decision
        lease = DECIDER.fold(lease, decision.events)
    return lease


def rule(lease: Lease, command: LeaseCommand) -> str:
    decision = DECIDER.decide(lease, command, NOW)
    assert isinstance(decision, Refused), decision
    return decision.rule


@pytest.mark.ledger("R85", "R84", symbol="harness.gate.leases:_acquire")
def test_two_holders_never_have_one_resource() -> None:
    held = after(Lease(), acquire("a", 1))
    assert rule(held, acquire("b", 2)) == "lease_held"
    assert (held.invocation_id, held.expires_s) == ("a", 60.0)


def test_the_same_holder_asking_again_changes_nothing() -> None:
    held = after(Lease(), acquire("a", 1))
    assert after(held, acquire("a", 1)) == held


def test_fencing_tokens_only_rise() -> None:
    again = after(Lease(), acquire("a", 1), ReleaseLease(invocation_id=InvocationId("a"), reason="done"))
    assert rule(again, acquire("b", 1)) == "stale_token"
    assert after(again, acquire("b", 2)).token == 2


@pytest.mark.ledger("R90", symbol="harness.gate.leases:_free")
def test_a_quarantined_resource_is_freed_only_with_the_body_at_rest() -> None:
    lost = after(
        Lease(), acquire("a", 1), QuarantineLease(invocation_id=InvocationId("a"), reason="no acknowledgement")
    )
    assert rule(lost, acquire("b", 2)) == "lease_quarantined"
    assert rule(lost, ReleaseLease(invocation_id=InvocationId("a"), reason="late")) == "lease_quarantined"
    assert rule(lost, FreeLease(actor=ADA, static={}, reason="trust me")) == "not_static"
    assert rule(lost, FreeLease(actor=ADA, static={"displacement_m": 0.3}, reason="moving")) == "not_static"
    assert rule(lost, FreeLease(actor=ADA, static={"displacement_m": float("nan")}, reason="?")) == "not_static"
    freed = after(lost, FreeLease(actor=ADA, static={"displacement_m": 0.004}, reason="at rest"))
    assert after(freed, acquire("b", 2)).status == "held"
