"""A base in quarantine: nobody gets it, and only a named person on measured rest or a reported end frees it."""

import pytest

from app.i18n.reasons.rendering import sentence
from harness.contracts.commands import AcquireLease, QuarantineLease, StopMission
from harness.contracts.decisions import Accepted, Refused
from harness.contracts.errors import UnknownName
from harness.contracts.ids import InvocationId, ResourceId, RobotId, lease_stream
from harness.gate.commit import CommandEnvelope
from harness.runtime import Start
from tests.builders.connections import only, staged
from tests.builders.missions_run import OPERATOR
from tests.builders.walking import BASE, base, starts, walking
from tests.fakes.supervised import Deaf, Runaway
from tests.saying import raises_saying


@pytest.mark.ledger("R85", "R90", symbol="harness.gate.leases:_acquire")
def test_nobody_gets_a_base_in_quarantine_until_a_named_person_frees_it_on_static_evidence() -> None:
    with staged(wrap=only("navigate", Deaf)) as stage:
        mission_id = walking(stage)
        stage.runtime.submit(mission_id, StopMission(actor=OPERATOR, reason="enough"))
        stage.run(mission_id)
        refused = stage.run(stage.begin("circuit"))
        assert refused.mission.status == "awaiting_human"
        assert "quarantined" in sentence(refused.mission.reason)
        assert starts(refused) == []
        freed = stage.supervisor.free(BASE, actor=OPERATOR, reason="I stand beside it")
        assert isinstance(freed, Accepted), freed
        assert base(stage.harness).status == "free"
        assert stage.robot.status().armed is False
        for provider in stage.robot.providers():
            for start in stage.harness.starts(mission_id):
                provider.stop(f"{start.provider_id}:{start.request_id}")
        stage.harness.clock.wait_until(stage.harness.clock.now().mission_s + 2.0)
        assert starts(stage.run(stage.begin("circuit"))), "the base can be had again"


@pytest.mark.ledger("R86", symbol="harness.supervisor.supervisor:Supervisor.free")
def test_freeing_a_lease_is_refused_while_the_body_moves_and_never_stops_or_starts_anything() -> None:
    with staged(wrap=only("navigate", Runaway)) as stage:
        mission_id = walking(stage)
        stage.harness.clock.wait_until(stage.harness.clock.now().mission_s + 0.1)
        held = stage.supervisor.free(BASE, actor=OPERATOR, reason="too early")
        assert isinstance(held, Refused) and held.rule == "not_quarantined"
        stage.runtime.submit(mission_id, StopMission(actor=OPERATOR, reason="enough"))
        stage.until(mission_id, lambda _: base(stage.harness).status == "quarantined")
        for handle in [start.request_id for start in stage.harness.starts(mission_id)]:
            stage.robot.providers()[0].resume(f"route-follower:{handle}")
        stage.harness.clock.wait_until(stage.harness.clock.now().mission_s + 0.8)
        moving = stage.supervisor.free(BASE, actor=OPERATOR, reason="it looks fine")
        assert isinstance(moving, Refused) and moving.rule == "not_static"
        assert len(stage.harness.starts(mission_id)) == 1
        assert base(stage.harness).status == "quarantined"


@pytest.mark.ledger("R86", symbol="harness.supervisor.supervisor:Supervisor.free")
def test_a_resource_that_nobody_had_and_a_robot_that_is_not_there_cannot_be_freed() -> None:
    with staged() as stage:
        with raises_saying(UnknownName, match="never leased"):
            stage.supervisor.free(ResourceId("arm"), actor=OPERATOR, reason="why not")
        elsewhere = Start(actor=OPERATOR, robot_id=RobotId("vbot-9"), template="circuit")
        assert isinstance(stage.runtime.start(elsewhere), Accepted)
        elsewhere_base = ResourceId("vbot-9/mobile_base")
        mission_id, lost = stage.runtime.missions()[0].mission_id, InvocationId("inv_lost")
        held = AcquireLease(resource=elsewhere_base, mission_id=mission_id, invocation_id=lost, token=1, expires_s=9e9)
        for command in (held, QuarantineLease(invocation_id=lost, reason="lost")):
            stage.runtime.commit([CommandEnvelope(lease_stream(elsewhere_base), command, None)])
        refused = stage.supervisor.free(elsewhere_base, actor=OPERATOR, reason="not mine")
        assert isinstance(refused, Refused) and refused.rule == "no_robot"


@pytest.mark.ledger("R84", symbol="harness.supervisor.leases:expired")
def test_a_supervisor_that_slept_past_the_expiry_quarantines_and_frees_only_after_the_end_was_reported() -> None:
    with staged() as stage:
        mission_id = walking(stage)
        held = base(stage.harness)
        stage.harness.clock.wait_until(held.expires_s + 1.0)
        stage.supervisor.step(mission_id)
        assert base(stage.harness).status == "quarantined"
        assert "expired" in sentence(base(stage.harness).reason)
        ran = stage.run(mission_id)
        assert ran.mission.status in ("succeeded", "awaiting_human")
        assert len(starts(ran)) == len(set(starts(ran)))
        assert base(stage.harness).token > held.token
