"""Every ladder of D24 climbed by a whole mission in virtual time: which rungs, what they cost, and how it ends."""

import pytest
from msgspec.structs import replace

from app.i18n.reasons.rendering import sentence
from harness.contracts.commands import AcquireLease, ReleaseLease
from harness.contracts.configuration import SPENDING
from harness.contracts.contexts import Blobs, Context
from harness.contracts.decisions import Accepted
from harness.contracts.errors import ProviderFailed, ProviderUnreachable
from harness.contracts.events import DispatchIntended, FailureClassified, HandoffRequested, RecoveryAuthorised
from harness.contracts.ids import InvocationId, MissionId, NodeId, RequestId, ResourceId, lease_stream
from harness.contracts.ports import Provider
from harness.contracts.protocol import InvocationReport, StartRequest
from harness.contracts.verdicts import NodeVerdict
from harness.gate.commit import CommandEnvelope
from harness.provider_protocol.delegation import DelegatingProvider
from harness.verification.verdict import verify
from tests.builders.connections import Failing, Stage, only, staged
from tests.builders.missions_run import Ran

BASE = ResourceId("vbot-1/mobile_base")
OTHER = InvocationId("inv_other")


class Endless(DelegatingProvider):
    """Goes on for ever, unless it is stopped."""

    stopping = False

    def report(self, handle: str) -> InvocationReport:
        said = self.inner.report(handle)
        return replace(said, status="cancelled" if self.stopping else "running")

    def stop(self, handle: str) -> InvocationReport:
        self.stopping = True
        said = self.inner.stop(handle)
        return replace(said, status="cancelled")


class Deaf(Endless):
    """Goes on for ever and acknowledges no stop."""

    def report(self, handle: str) -> InvocationReport:
        said = self.inner.report(handle)
        return replace(said, status="running")

    def stop(self, handle: str) -> InvocationReport:
        return self.report(handle)


class Refusing(DelegatingProvider):
    """Takes no request."""

    def start(self, request: StartRequest) -> InvocationReport:
        raise ProviderFailed("the motor controller does not answer")


class Silent(DelegatingProvider):
    """Cannot be reached for the first `silent` reports after `after` good ones."""

    def __init__(self, inner: Provider, *, silent: int, after: int = 4) -> None:
        super().__init__(inner)
        self.silent, self.after = silent, after

    def _spoken(self) -> None:
        if self.after > 0:
            self.after -= 1
        elif self.silent > 0:
            self.silent -= 1
            raise ProviderUnreachable("no answer")

    def report(self, handle: str) -> InvocationReport:
        self._spoken()
        return self.inner.report(handle)

    def find(self, request: RequestId) -> InvocationReport | None:
        self._spoken()
        return self.inner.find(request)


class Stranger(DelegatingProvider):
    """Its first execution ends in another provider's name."""

    first = ""

    def report(self, handle: str) -> InvocationReport:
        self.first = self.first or handle
        said = self.inner.report(handle)
        if said.status != "succeeded" or handle != self.first:
            return said
        return replace(said, identity=replace(said.identity, provider_id="somebody-else"))


class Crossed(DelegatingProvider):
    """Answers of somebody else's request arrive on its connection a few times."""

    left = 3

    def report(self, handle: str) -> InvocationReport:
        said = self.inner.report(handle)
        if not self.left:
            return said
        self.left -= 1
        other = replace(said.identity, request_id=RequestId("ab" * 32), node_id=NodeId("elsewhere"))
        return replace(said, identity=other, status="succeeded")


def rungs(ran: Ran) -> list[str]:
    return [event.action for event in ran.events if isinstance(event, RecoveryAuthorised)]


def classes(ran: Ran) -> list[str]:
    return [event.failure for event in ran.events if isinstance(event, FailureClassified)]


def asked(ran: Ran) -> bool:
    return ran.mission.status == "awaiting_human" and any(isinstance(e, HandoffRequested) for e in ran.events)


def sound(ran: Ran) -> None:
    """What holds on every ladder: nothing false, nothing twice, and each spend counted in both totals."""
    assert ran.false_completions() == []
    assert ran.duplicate_starts() == 0
    left = ran.mission.contract.recovery_total if ran.mission.contract else 0
    for event in ran.events:
        if isinstance(event, RecoveryAuthorised):
            assert event.cost == (1 if event.action in SPENDING else 0)
            left -= event.cost
            assert event.left_mission == left
    assert ran.mission.spent_total == sum(e.cost for e in ran.events if isinstance(e, RecoveryAuthorised))


@pytest.mark.ledger("R122", "R124", symbol="harness.recovery.classify:classify")
def test_what_was_not_found_is_looked_at_again_and_then_a_person_is_asked() -> None:
    with staged(wrap=only("analyse_passage", lambda one: Failing(one, word="nothing_found"))) as stage:
        ran = stage.run(stage.begin("warehouse-inspection"))
        sound(ran)
        assert classes(ran)[0] == "target_not_found"
        assert rungs(ran)[0] == "re_perceive"
        assert asked(ran)


@pytest.mark.ledger("R126", symbol="harness.supervisor.recovery:Recovery._stop")
def test_an_unsafe_action_is_stopped_safely_and_a_person_is_asked() -> None:
    with staged(wrap=only("navigate", lambda one: Failing(one, word="collision"))) as stage:
        ran = stage.run(stage.begin("circuit"))
        sound(ran)
        assert set(classes(ran)) == {"unsafe_action"}
        assert rungs(ran) == ["safe_stop"]
        assert asked(ran) and ran.mission.spent_total == 0


def test_a_timeout_stops_the_provider_and_another_one_takes_over() -> None:
    with staged(wrap=lambda one: Endless(one) if one.card.provider_id == "route-follower" else one) as stage:
        ran = stage.run(stage.begin("circuit"))
        sound(ran)
        assert classes(ran)[0] == "timeout"
        assert rungs(ran) == ["stop", "switch_skill"]
        assert ran.mission.status == "succeeded"


@pytest.mark.ledger("R64", symbol="harness.recovery.ladder:recover")
def test_a_provider_that_refuses_is_replaced_by_another_with_the_same_effect() -> None:
    with staged(wrap=lambda one: Refusing(one) if one.card.provider_id == "route-follower" else one) as stage:
        ran = stage.run(stage.begin("circuit"))
        sound(ran)
        assert classes(ran) == ["provider_unavailable"]
        assert rungs(ran) == ["switch_skill"]
        assert ran.mission.status == "succeeded"
        effects = [e.parameters["target"] for e in ran.events if isinstance(e, DispatchIntended) and e.moves]
        assert len(effects) == 2 and len(set(effects)) == 1


def hold(stage: Stage) -> None:
    """Somebody else takes the mobile base for a long time."""
    taken = AcquireLease(
        resource=BASE,
        mission_id=MissionId("msn_other"),
        invocation_id=OTHER,
        token=stage.runtime.lease(BASE).token + 1,
        expires_s=stage.harness.clock.now().mission_s + 10_000.0,
    )
    assert isinstance(stage.runtime.commit([CommandEnvelope(lease_stream(BASE), taken, None)]), Accepted)


@pytest.mark.ledger("R85", symbol="harness.supervisor.dispatch:Dispatcher.taken")
def test_a_resource_that_is_held_is_waited_for_at_no_cost() -> None:
    with staged() as stage:
        hold(stage)
        mission_id = stage.begin("circuit")
        stage.until(mission_id, lambda mission: bool(mission.of(NodeId("circuit")).wait_until_s))
        began_s = stage.harness.clock.now().mission_s
        stage.until(mission_id, lambda _: stage.harness.clock.now().mission_s > began_s + 8.0)
        assert stage.runtime.mission(mission_id).invocation is None
        stage.runtime.commit(
            [CommandEnvelope(lease_stream(BASE), ReleaseLease(invocation_id=OTHER, reason="done"), None)]
        )
        ran = stage.run(mission_id)
        sound(ran)
        assert classes(ran) == ["resource_conflict"] and rungs(ran) == ["wait"]
        assert ran.mission.status == "succeeded" and ran.mission.spent_total == 0


@pytest.mark.ledger("R63", symbol="harness.gate.leases:_acquire")
def test_a_resource_that_stays_held_ends_with_a_person_and_without_a_start() -> None:
    with staged() as stage:
        hold(stage)
        ran = stage.run(stage.begin("circuit"))
        sound(ran)
        assert set(classes(ran)) == {"resource_conflict"}
        assert rungs(ran) == ["wait"]
        assert asked(ran)
        assert not any(start.moves for start in ran.harness.starts(ran.mission.mission_id))


class Late:
    """A verifier that answers only from its `from_call`-th call on."""

    def __init__(self, from_call: int, *, node_id: str) -> None:
        self.left, self.node_id = from_call, node_id

    def __call__(self, context: Context, blobs: Blobs) -> NodeVerdict:
        if context.node_id == self.node_id and self.left > 0:
            self.left -= 1
            raise TimeoutError("no answer within 5 s")
        return verify(context, blobs)


@pytest.mark.ledger("R45", symbol="harness.verification.verdict:judged")
@pytest.mark.parametrize(("template", "node_id"), [("circuit", "circuit"), ("warehouse-inspection", "delivery")])
def test_a_verifier_that_was_late_is_asked_again_without_a_second_execution(template: str, node_id: str) -> None:
    with staged(verifier=Late(1, node_id=node_id)) as stage:
        ran = stage.run(stage.begin(template))
        sound(ran)
        assert ran.verdicts(node_id) == ["ambiguous", "satisfied"]
        assert "no answer within 5 s" in sentence(ran.mission.of(NodeId(node_id)).verdicts[0].reason)
        assert classes(ran) == ["verifier_unavailable"] and rungs(ran) == ["verify_again"]
        assert ran.mission.status == "succeeded" and ran.mission.spent_total == 0
        again = [e for e in ran.events if isinstance(e, DispatchIntended) and e.node_id == node_id]
        assert [one.verify_only for one in again] == [False, True]
        assert [one.moves for one in again][1] is False


def test_a_verifier_that_stays_away_leads_to_a_person_and_never_to_a_fact() -> None:
    with staged(verifier=Late(1_000, node_id="circuit")) as stage:
        ran = stage.run(stage.begin("circuit"))
        sound(ran)
        assert rungs(ran) == ["verify_again"] and asked(ran)
        assert all(fact.node_id != "circuit" for fact in ran.mission.facts)


def test_a_provider_that_was_silent_is_found_again_by_its_request() -> None:
    with staged(wrap=only("navigate", lambda one: Silent(one, silent=46))) as stage:
        ran = stage.run(stage.begin("circuit"))
        assert ran.duplicate_starts() == 0 and ran.false_completions() == []
        assert classes(ran)[0] == "outcome_unknown" and rungs(ran)[0] == "reattach"


def test_a_provider_that_stays_silent_leads_to_a_person_with_the_outcome_unknown() -> None:
    with staged(wrap=only("navigate", lambda one: Silent(one, silent=100_000))) as stage:
        ran = stage.run(stage.begin("circuit"))
        sound(ran)
        assert set(classes(ran)) == {"outcome_unknown"}
        assert rungs(ran) == ["reattach"] and asked(ran)
        assert ran.mission.invocation is not None and ran.mission.invocation.status == "outcome_unknown"
        assert stage.runtime.lease(BASE).status == "quarantined"
        assert len([start for start in stage.harness.starts(ran.mission.mission_id) if start.moves]) == 1


def test_a_stop_that_is_not_acknowledged_is_made_safe_and_a_person_is_asked() -> None:
    with staged(wrap=only("navigate", Deaf)) as stage:
        ran = stage.run(stage.begin("circuit"))
        sound(ran)
        assert classes(ran) == ["timeout", "cancel_unacknowledged", "cancel_unacknowledged"]
        assert rungs(ran) == ["stop", "safe_stop"] and asked(ran)
        assert stage.runtime.lease(BASE).status == "quarantined"


@pytest.mark.ledger("R34", symbol="harness.gate.rules:wrong_identity")
def test_a_result_in_another_name_is_rejected_and_the_place_is_looked_at_again() -> None:
    with staged(wrap=only("navigate", Stranger)) as stage:
        ran = stage.run(stage.begin("circuit"))
        sound(ran)
        assert classes(ran)[0] == "commit_rejected" and rungs(ran)[0] == "re_perceive"
        assert ran.mission.of(NodeId("circuit")).rejections[0] == "wrong_identity"


def test_answers_about_somebody_elses_request_are_none_and_the_mission_goes_on() -> None:
    with staged(wrap=only("navigate", Crossed)) as stage:
        ran = stage.run(stage.begin("circuit"))
        sound(ran)
        assert ran.mission.status == "succeeded"
        assert classes(ran) == []
