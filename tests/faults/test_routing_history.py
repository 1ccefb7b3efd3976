"""Verified failures of a provider at a place reach routing: the other one is chosen there, and a person can see why."""

import html
import re
from collections.abc import Iterator

import pytest

from app.background.mission_history import Histories
from app.background.signals import SignalBroker
from app.cli.missions import RoutingRecords
from app.i18n.reasons.rendering import sentence
from app.main import create_app
from app.scene.servers import Scenes
from app.settings import ConsoleSettings
from app.views.contexts import ranked
from harness.contracts.ids import MissionId, NodeId, ProviderId
from harness.contracts.proposals import RoutingExplanation
from harness.contracts.reasons import Reason
from tests.builders.accounts import quick_accounts
from tests.builders.connections import Stage, staged
from tests.builders.consoles import Stand

FOLLOWER, CAREFUL = ProviderId("route-follower"), ProviderId("careful-local-planner")
FAULT = "follower-gives-up:persistent"


class Walked:
    """Circuits one after the other, whose cheap navigator gives up on every leg, until another one is chosen first."""

    def __init__(self, stage: Stage) -> None:
        self.stage = stage
        self.missions: list[MissionId] = []
        while not self.missions or self.first().chosen == FOLLOWER:
            assert len(self.missions) < 6, "history does not reach routing"
            self.missions.append(stage.begin("circuit", FAULT))
            assert stage.run(self.missions[-1]).mission.status == "succeeded"

    def first(self) -> RoutingExplanation:
        """The first decision about the newest mission's circuit."""
        records = RoutingRecords(self.stage.runtime)
        entries = Histories(self.stage.runtime).of(self.missions[-1])
        choices = ranked(entries, node_id="circuit", candidates=records.candidates, explain=records.explained)
        assert choices[0].why is not None
        return choices[0].why


@pytest.fixture(scope="module")
def walked() -> Iterator[Walked]:
    with staged() as stage:
        yield Walked(stage)


def test_after_at_most_five_verified_failures_at_a_place_the_other_provider_is_chosen(walked: Walked) -> None:
    walks = [walked.stage.runtime.mission(mission_id).of(NodeId("circuit")) for mission_id in walked.missions]
    failed = [
        verdict
        for walk in walks
        for packet, verdict in zip(walk.packets, walk.verdicts, strict=True)
        if packet.identity.provider_id == FOLLOWER and verdict.verdict == "violated"
    ]
    assert 1 <= len(failed) <= 5
    assert walked.first().chosen == CAREFUL
    newest = walked.stage.runtime.mission(walked.missions[-1])
    assert newest.of(NodeId("circuit")).attempt == 1 and newest.spent_total == 0


def test_the_reason_is_the_history_at_this_place(walked: Walked) -> None:
    why = walked.first()
    assert isinstance(why.reason, Reason) and why.reason.code == "routing_decided_by_history"
    past = {one.provider_id: one for one in why.history}
    assert (past[FOLLOWER].failed, past[FOLLOWER].place) == (past[FOLLOWER].judged, "anchor_a")
    assert past[FOLLOWER].penalty > past[CAREFUL].penalty
    assert f"{past[FOLLOWER].failed} of {past[FOLLOWER].judged} verified executions" in sentence(why.reason)
    for one in why.candidates:
        if one.score is not None:
            assert one.score == pytest.approx(sum(one.terms.values()))


@pytest.mark.ledger("R63", entry="page", symbol="harness.routing.explanation:explained")
def test_a_person_sees_on_the_page_why_a_provider_was_chosen_term_by_term(walked: Walked) -> None:
    settings = ConsoleSettings(port=8000)
    stage = walked.stage
    app = create_app(
        stage.runtime, settings, SignalBroker(), Scenes(stage.runtime), accounts=quick_accounts(settings),
        answer=stage.supervisor.answer,
    )  # fmt: skip
    client = Stand(stage.harness, app).operator()
    text = html.unescape(client.get(f"/missions/{walked.missions[-1]}/contexts?node=circuit").text)
    shown = re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", text))
    why = walked.first()
    assert sentence(why.reason) in shown
    for one in why.history:
        if one.judged:
            assert f"{one.provider_id} at anchor_a: {one.judged} verified executions, {one.failed} failed" in shown
    for name in ("success", "risk", "uncertainty", "latency", "cost", "history"):
        assert f"{name} " in shown
