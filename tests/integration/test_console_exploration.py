"""/missions/{id}/exploration: what was considered, gained and paid, what was chosen and why, and what came of it."""

import html
import re
from collections.abc import Iterator

import pytest
from fastapi.testclient import TestClient

from app.background.signals import SignalBroker
from app.i18n.reasons.rendering import sentence
from app.main import create_app
from app.scene.servers import Scenes
from app.settings import ConsoleSettings
from app.views.exploration import ChoiceRecords, choices_region
from harness.baseline.load import shipped_workspace
from harness.contracts.exploration import FREE, GridMap, TargetProposal, TargetQuestion
from harness.contracts.reasons import Reason
from harness.contracts.values import decode
from harness.exploration.grid import area_m2
from harness.exploration.targets import Proposer, nearest_edge
from harness.planning.templates import by_name
from harness.projections.exploration import decisions, updates
from harness.projections.mission import Mission
from rsi_reviews.candidate_queries import selected
from rsi_reviews.deciders import DECIDERS
from tests.builders.accounts import quick_accounts
from tests.builders.connections import Stage, staged
from tests.builders.consoles import Stand, console_stand

RUN = re.compile(r"M(-?[\d.]+) (-?[\d.]+)h([\d.]+)v([\d.]+)h-[\d.]+z")


def stray(question: TargetQuestion, picture: bytes) -> TargetProposal | None:
    """The edge that shows most, save once: then a door that is on no map."""
    tried = {one.node_id for one in question.feedback}
    return TargetProposal((400.0, 0.0), "the red door") if len(tried) == 1 else nearest_edge(question, picture)


def set_solid(text: str) -> str:
    """The same page however its markup is laid out: one space for many, none beside a tag's bounds."""
    return re.sub(r"(?<=>) | (?=</)", "", re.sub(r"\s+", " ", text))


class Explored:
    """An exploration behind a console, and somebody who reads about it."""

    def __init__(self, stage: Stage, *faults: str) -> None:
        self.stage, self.mission_id = stage, stage.begin(by_name("exploration", shipped_workspace().missions), *faults)
        app = create_app(
            stage.runtime,
            ConsoleSettings(port=8000),
            SignalBroker(),
            Scenes(stage.runtime),
            accounts=quick_accounts(ConsoleSettings(port=8000)),
            answer=stage.supervisor.answer,
        )
        self.client: TestClient = Stand(stage.harness, app).operator()

    @property
    def mission(self) -> Mission:
        return self.stage.runtime.mission(self.mission_id)

    def page(self, leg: str = "", part: str = "exploration") -> str:
        answer = self.client.get(f"/missions/{self.mission_id}/{part}", params={"leg": leg} if leg else {})
        assert answer.status_code == 200
        return set_solid(html.unescape(answer.text))

    def question(self, number: int) -> TargetQuestion:
        return decode(self.stage.runtime.record(decisions(self.mission)[number].question).body, TargetQuestion)


@pytest.fixture(scope="module")
def explored() -> Iterator[Explored]:
    """The way to the first target is closed for good; the second is proposed where no map is."""
    with staged(proposer=Proposer("vision-model", stray), deciders=DECIDERS, select=selected) as stage:
        made = Explored(stage, "blocked-passage:persistent")
        stage.run(made.mission_id)
        assert made.mission.status == "succeeded", made.mission.reason
        yield made


def row_of(text: str, start: str) -> str:
    return text[text.index(start) :].split("</tr>")[0]


@pytest.mark.ledger("R224", symbol="app.views.exploration:_detail")
def test_every_choice_links_what_it_was_made_from_what_was_considered_and_what_came_of_it(explored: Explored) -> None:
    for number, decision in enumerate(decisions(explored.mission)):
        text, question = explored.page(decision.leg), explored.question(number)
        assert text.count('<circle class="edge"') == len(question.frontiers) > 0
        for place, edge in enumerate(question.frontiers, start=1):
            row = row_of(text, f"<td>{place}{' <b>chosen</b>' if edge.approach_m == decision.target_m else '</td>'}")
            assert f"<td>{edge.length_m:.1f} m</td><td>{edge.way_m:.1f} m</td>" in row
        assert isinstance(decision.reason, Reason)
        assert sentence(decision.reason) in text
        assert decision.question in text and decision.answer in text
        for blob in (f"{decision.image}/about", decision.map_before, decision.map_after):
            assert f'href="/evidence/{blob}"' in text
            assert explored.client.get(f"/evidence/{blob}").status_code == 200
        (position,) = set(re.findall(rf"/missions/{explored.mission_id}\?at=(\d+)", text))
        assert explored.client.get(f"/missions/{explored.mission_id}?at={position}").status_code == 200
        (event,) = (one for one in explored.stage.runtime.events(explored.mission_id) if one.position == int(position))
        assert event.kind == "GraphRevised" and decision.leg.encode() in event.body
        came = text[text.index("came-title") :]
        assert f"node=leg-{number + 1}#evidence" in came and f"node=look-{number + 1}#evidence" in came
        assert "holds no record of them" not in text
    region = choices_region(explored.mission, (), ChoiceRecords(), leg="leg-1")
    assert region.shown is not None
    assert (region.shown.recorded, region.shown.floor, region.shown.edges) == (False, None, ())
    why = decisions(explored.mission)[0].reason
    assert isinstance(why, Reason)
    assert region.shown.reason == sentence(why)


def test_a_refused_proposal_stands_beside_what_the_harness_took_instead(explored: Explored) -> None:
    text = explored.page("leg-2")
    assert "vision-model was not followed." in text
    assert "outside map: (400.00, 0.00) lies outside the map site-1." in text
    assert "Proposed: (400.0, 0.0): the red door" in text
    assert '<path class="refused"' in text
    assert "refused; the harness took its own" in row_of(text, ">2. (")
    assert "was not followed" not in explored.page("leg-3")


def test_what_became_of_a_target_is_declared_measured_and_accepted_or_given_up(explored: Explored) -> None:
    text = explored.page()
    first, second = decisions(explored.mission)[:2]
    assert "given up: no progress." in row_of(text, ">1. (")
    reached = row_of(text, ">2. (")
    distance = explored.mission.of(second.leg).verdicts[-1].results[0].measured["distance_m"]
    assert f"distance {distance:.3f} m" in reached
    accepted = re.findall(r'<a\s+data-tone="good"\s+href="(/missions/[^"]+/events/\d+)"\s*>\s*k \d+\s*</a>', reached)
    assert explored.client.get(accepted[0]).status_code == 200
    assert f"({first.target_m[0]:.1f}, {first.target_m[1]:.1f}) was given up: no progress." in explored.page("leg-2")


def test_the_floor_is_drawn_as_measured_before_and_what_the_way_showed_anew_apart(explored: Explored) -> None:
    shown = dict(updates(explored.mission))
    for decision in decisions(explored.mission):
        text = explored.page(decision.leg)
        before = decode(explored.stage.runtime.blob(decision.map_before), GridMap)
        drawn = {
            name: sum(
                float(w) * float(h) for _, _, w, h in RUN.findall(re.findall(rf'class="{name}" d="([^"]*)"', text)[0])
            )
            for name in ("free", "gained")
        }
        assert drawn["free"] == pytest.approx(area_m2(before, kind=FREE), abs=0.01)
        assert drawn["gained"] == pytest.approx(shown[decision.leg].opened_m2, abs=0.01)
        assert f"{shown[decision.leg].opened_m2:.1f} m² became known as free" in text


def test_the_region_follows_the_newest_choice_or_keeps_the_one_that_was_asked_for(explored: Explored) -> None:
    address = f'hx-get="/missions/{explored.mission_id}/choices'
    newest, asked = explored.page(part="choices"), explored.page("leg-1", part="choices")
    assert f'{address}"' in newest and f'{address}?leg=leg-1"' in asked
    assert "<html" not in newest
    assert "Why target 1" in asked and "Why target 1" not in newest
    assert explored.client.get(f"/missions/{explored.mission_id}/exploration?leg=leg-99").status_code == 404
    mission = explored.client.get(f"/missions/{explored.mission_id}").text
    assert f'href="/missions/{explored.mission_id}/exploration"' in mission


def test_programs_are_given_the_same_choices(explored: Explored) -> None:
    found = explored.client.get(f"/api/v1/missions/{explored.mission_id}/exploration").json()
    made = decisions(explored.mission)
    assert [one["decision"]["leg"] for one in found] == [one.leg for one in made]
    assert [len(one["question"]["frontiers"]) for one in found] == [
        len(explored.question(number).frontiers) for number in range(len(made))
    ]
    assert found[1]["answer"]["said"]["reason"] == "the red door"


def test_a_target_under_way_claims_nothing_yet() -> None:
    with staged(deciders=DECIDERS, select=selected) as stage:
        made = Explored(stage)
        stage.until(made.mission_id, lambda mission: mission.contract is not None and bool(decisions(mission)))
        text = made.page()
        assert "not mapped yet" in text and "The way there is in no map yet." in text
        assert "nothing yet" in row_of(text, ">1. (") and "not yet" in row_of(text, ">1. (")


def test_a_mission_that_explores_nothing_says_so() -> None:
    with console_stand() as stand:
        mission, operator = stand.run("circuit"), stand.operator()
        assert "has chosen no target" in sentence(operator.get(f"/missions/{mission.mission_id}/exploration").text)
        assert "/exploration" not in sentence(operator.get(f"/missions/{mission.mission_id}").text)
        assert operator.get(f"/api/v1/missions/{mission.mission_id}/exploration").json() == []
        assert operator.get("/missions/msn_unknown/exploration").status_code == 404
