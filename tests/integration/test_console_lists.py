"""The lists follow the log: nothing missing, nothing left over, the same bytes when they are made again from zero."""

import re
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest
from sqlalchemy import create_engine

from app.background.lists import FOLD, Lists
from harness.adapters.stores.memory_index import EMPTY
from harness.adapters.stores.read_models import SqlReadModels
from harness.contracts.actors import Actor
from harness.contracts.commands import StopMission
from harness.contracts.events import PacketRetained
from harness.contracts.ids import Digest
from harness.contracts.memory import FollowPosition
from harness.contracts.read_models import LISTINGS, ListQuery
from harness.projections.mission import Mission
from tests.builders.consoles import Stand, console_stand

TABLES = [f"list_{listing}" for listing in LISTINGS] + ["tally", "mark"]


@pytest.fixture(scope="module")
def stand() -> Iterator[Stand]:
    with console_stand() as made:
        yield made


@pytest.fixture(scope="module")
def missions(stand: Stand) -> tuple[Mission, Mission]:
    """One that succeeded, one that waits for a person."""
    return stand.run(), stand.handed_off()[0]


def contents(path: Path) -> list[list[tuple[object, ...]]]:
    """Every row of every table of a file of lists, tallies that count nothing left out."""
    engine = create_engine(f"sqlite:///{path}")
    with closing(engine.connect()) as reader:
        found = [sorted(map(tuple, reader.exec_driver_sql(f"SELECT * FROM {table}").all())) for table in TABLES]
    engine.dispose()
    found[3] = [row for row in found[3] if row[3]]
    return found


def lists(stand: Stand) -> Lists:
    made: Lists = stand.app.state.console.lists
    return made


def test_what_was_committed_is_in_the_next_answer(stand: Stand, missions: tuple[Mission, Mission]) -> None:
    begun = stand.created()
    first = lists(stand).missions(ListQuery(listing="mission")).items[0]
    assert (first.mission_id, first.ended_s) == (begun, None)
    assert begun in {one.mission_id for one in lists(stand).open_missions()}
    stop = StopMission(actor=Actor(name="ada", role="operator"), reason="not needed")
    stand.harness.runtime.submit(begun, stop)
    stand.harness.supervisor.run(begun)
    assert begun not in {one.mission_id for one in lists(stand).open_missions()}
    ended = next(one for one in lists(stand).missions(ListQuery(listing="mission")).items if one.mission_id == begun)
    assert ended.ended_s is not None


def test_the_list_says_of_every_mission_what_its_fold_says(stand: Stand, missions: tuple[Mission, Mission]) -> None:
    folded = {
        one.mission_id: (one.status, one.spent_total, one.k, one.handoff_id or "")
        for one in stand.harness.runtime.missions()
    }
    listed = {
        one.mission_id: (one.status, one.spent, one.k, one.handoff_id)
        for one in lists(stand).missions(ListQuery(listing="mission", limit=500)).items
    }
    assert listed == folded


def test_every_piece_of_every_packet_is_listed_once_with_what_was_made_of_it(
    stand: Stand, missions: tuple[Mission, Mission]
) -> None:
    mission = missions[0]
    history = stand.app.state.console.histories.of(mission.mission_id)
    packets = [one.event.packet for one in history if isinstance(one.event, PacketRetained)]
    pieces = sum(len(p.before) + len(p.after) + len(p.estimates) + len(p.receipts) for p in packets)
    query = ListQuery(listing="evidence", facets={"mission": mission.mission_id}, limit=500)
    rows = lists(stand).evidence(query).items
    assert len(rows) == pieces > 40
    assert {(one.verdict, one.decision) for one in rows} == {("satisfied", "accepted")}
    blobs = {one.blob for one in rows if one.kind == "image"}
    assert blobs == {ref.blob for packet in packets for ref in (*packet.before, *packet.after) if ref.kind == "image"}


def test_a_refused_packet_is_listed_with_the_rule(stand: Stand) -> None:
    mission = stand.run(faults="stale-pose")
    query = ListQuery(listing="evidence", facets={"mission": mission.mission_id, "decision": "refused"}, limit=500)
    rows = lists(stand).evidence(query).items
    assert rows
    assert {one.verdict for one in rows} == {"stale"}
    assert all(one.rule for one in rows)


def test_a_question_is_said_in_the_same_words_on_the_overview_and_in_the_list(stand: Stand) -> None:
    mission, handoff_id = stand.handed_off()
    opened = stand.harness.runtime.handoff(handoff_id).opened
    assert opened is not None and mission.contract is not None
    operator, stage = stand.operator(), mission.contract.node(opened.node_id).subgoal
    said = f'href="/handoffs/{handoff_id}">vbot-1 cannot finish “{stage}” and asks you</a>'
    for page in ("/", "/handoffs", f"/handoffs?q={stage.split()[-1]}"):
        assert said in operator.get(page).text, page


def test_an_open_question_leaves_the_list_of_open_ones_when_it_is_over(stand: Stand) -> None:
    mission, handoff_id = stand.handed_off()
    assert handoff_id in {one.handoff_id for one in lists(stand).open_handoffs()}
    stop = StopMission(actor=Actor(name="ada", role="operator"), reason="not needed")
    stand.harness.runtime.submit(mission.mission_id, stop)
    stand.harness.supervisor.run(mission.mission_id)
    expected = {one.handoff_id for one in stand.harness.runtime.handoffs() if one.status == "open"}
    assert {one.handoff_id for one in lists(stand).open_handoffs()} == expected


def test_lists_made_from_zero_are_equal_byte_for_byte_to_lists_that_followed(
    stand: Stand, missions: tuple[Mission, Mission], tmp_path: Path
) -> None:
    runtime = stand.harness.runtime
    with closing(SqlReadModels(f"sqlite:///{tmp_path / 'followed.db'}")) as models:
        follower = Lists(runtime, models)
        mission_id = stand.created()
        for _ in range(40):
            follower.catch_up()
            wake_s = stand.harness.supervisor.step(mission_id)
            if wake_s is None:
                break
            stand.harness.clock.wait_until(wake_s)
        follower.catch_up()
    with closing(SqlReadModels(f"sqlite:///{tmp_path / 'zero.db'}")) as models:
        Lists(runtime, models).catch_up()
    assert contents(tmp_path / "followed.db") == contents(tmp_path / "zero.db")


@pytest.mark.parametrize("fold", ["lists-0", ""])
def test_lists_of_another_fold_or_another_log_are_made_anew(
    stand: Stand, missions: tuple[Mission, Mission], tmp_path: Path, fold: str
) -> None:
    with closing(SqlReadModels(f"sqlite:///{tmp_path / 'lists.db'}")) as models:
        foreign = FollowPosition(fold=fold or FOLD, position=3, digest=Digest("ab" * 32))
        models.add([], after=EMPTY, upto=foreign)
        follower = Lists(stand.harness.runtime, models)
        assert follower.catch_up().position == stand.harness.runtime.head().position
        found = {one.mission_id for one in follower.missions(ListQuery(listing="mission", limit=500)).items}
    assert found == {one.mission_id for one in stand.harness.runtime.missions()}


def test_search_filters_order_and_place_stand_in_the_address(stand: Stand, missions: tuple[Mission, Mission]) -> None:
    operator, (done, waiting) = stand.operator(), missions
    assert done.mission_id in operator.get("/missions?q=storage&status=succeeded&robot=vbot-1").text
    assert done.mission_id not in operator.get("/missions?status=waiting").text
    assert waiting.mission_id in operator.get("/missions?status=waiting").text
    kept = operator.get("/missions?q=storage&order=oldest&template=warehouse-inspection").text
    assert 'value="storage"' in kept
    assert 'value="oldest" selected' in kept
    assert "/missions/list?q=storage&amp;template=warehouse-inspection&amp;order=oldest" in kept


def test_the_next_page_begins_where_the_last_one_ended(stand: Stand, missions: tuple[Mission, Mission]) -> None:
    operator, seen, path = stand.operator(), [], "/evidence?order=oldest"
    while path:
        text = operator.get(path).text
        seen += re.findall(r'<td class="mono nowrap">.*?(pkt_\w+)', text, re.DOTALL)
        following = re.search(r'rel="next"\s+href="([^"]+)"', text)
        path = following.group(1).replace("&amp;", "&") if following else ""
    total = next(one.count for one in lists(stand).tallies("evidence") if not one.facet)
    assert len(seen) == total > 60


def test_how_many_answer_is_the_same_from_the_page_as_from_a_search(
    stand: Stand, missions: tuple[Mission, Mission]
) -> None:
    kept, total = lists(stand), next(one.count for one in lists(stand).tallies("evidence") if not one.facet)
    few = ListQuery(listing="evidence", facets={"kind": "image"}, limit=500)
    shown, cut = kept.evidence(few), kept.evidence(ListQuery(listing="evidence", limit=3))
    assert kept.found(few, shown) == kept.count(few) == len(shown.items) < total
    assert cut.following is not None
    assert kept.found(ListQuery(listing="evidence", limit=3), cut) == total
    assert kept.found(cut.following, kept.evidence(cut.following)) == total


@pytest.mark.parametrize("query", ["order=best", "after=x", "after=1~x", "status=odd"])
def test_an_address_that_no_list_gave_is_answered_with_what_to_do(stand: Stand, query: str) -> None:
    answer = stand.operator().get(f"/missions?{query}")
    assert answer.status_code in (404, 422)
    assert "What to do" in answer.text


def test_a_blob_has_a_page_that_reads_it_now_and_names_who_refers_to_it(
    stand: Stand, missions: tuple[Mission, Mission]
) -> None:
    operator = stand.operator()
    query = ListQuery(listing="evidence", facets={"kind": "image", "mission": missions[0].mission_id})
    image = lists(stand).evidence(query).items[0]
    text = operator.get(f"/evidence/{image.blob}/about").text
    assert "read and hashed while this page was made" in text
    assert image.packet_id in text
    assert operator.get(f"/evidence/{'0' * 64}/about").status_code == 404
