"""The 3D view behind the console's own door: its page, its socket, what it draws, and when it goes away."""

from collections.abc import Iterator

import pytest
from starlette.websockets import WebSocketDisconnect

from app.proxy import PROTOCOL
from app.scene import Scenes
from app.security import SCENE_POLICY
from harness.contracts.errors import UnknownName
from harness.contracts.ids import MissionId
from tests.builders.consoles import BASE, Stand, console_stand

SOCKET = BASE.replace("http://", "ws://")


@pytest.fixture(scope="module")
def stand() -> Iterator[Stand]:
    with console_stand() as made:
        yield made


@pytest.fixture(scope="module")
def mission_id(stand: Stand) -> MissionId:
    """A mission that was interrupted on its way: it has poses, sweeps and a trajectory."""
    return stand.handed_off()[0].mission_id


@pytest.fixture
def scenes(stand: Stand) -> Iterator[Scenes]:
    made = Scenes(stand.harness.runtime, limit=2)
    yield made
    made.close()


def test_the_frame_has_the_viewers_policy_and_only_our_pages_may_hold_it(stand: Stand, mission_id: MissionId) -> None:
    answer = stand.operator().get(f"/missions/{mission_id}/scene/")
    assert answer.status_code == 200
    assert answer.headers["content-security-policy"] == SCENE_POLICY
    assert answer.headers["x-frame-options"] == "SAMEORIGIN"
    assert len(answer.content) > 100_000


@pytest.mark.parametrize("query", ["websocket=ws://elsewhere.example", "playbackPath=/etc/passwd"])
def test_the_viewer_cannot_be_pointed_elsewhere(stand: Stand, mission_id: MissionId, query: str) -> None:
    assert stand.operator().get(f"/missions/{mission_id}/scene/?{query}").status_code == 400


def test_a_scene_of_an_unknown_mission_is_not_found(stand: Stand) -> None:
    assert stand.operator().get("/missions/msn_none/scene/").status_code == 404


@pytest.mark.parametrize("slash", ["", "/"])
def test_the_socket_relays_the_scene_with_and_without_a_slash(stand: Stand, mission_id: MissionId, slash: str) -> None:
    operator = stand.operator()
    address = f"{SOCKET}/missions/{mission_id}/scene{slash}"
    with operator.websocket_connect(address, subprotocols=[PROTOCOL]) as socket:
        assert socket.accepted_subprotocol == PROTOCOL
        assert len(socket.receive_bytes()) > 16


@pytest.mark.parametrize(
    ("headers", "signed_in", "told"),
    [({"Origin": "https://elsewhere.example"}, True, "cross_site"), ({"Origin": BASE}, False, "signed_out")],
)
def test_a_socket_from_another_site_or_of_a_stranger_is_refused(
    stand: Stand, mission_id: MissionId, headers: dict[str, str], signed_in: bool, told: str
) -> None:
    client = stand.operator() if signed_in else stand.stranger()
    client.headers.pop("Sec-Fetch-Site", None)
    with (
        pytest.raises(WebSocketDisconnect) as refused,
        client.websocket_connect(f"{SOCKET}/missions/{mission_id}/scene", subprotocols=[PROTOCOL], headers=headers),
    ):
        pass
    assert (refused.value.code, refused.value.reason) == (1008, told)


def test_a_viewer_of_another_version_is_refused(stand: Stand, mission_id: MissionId) -> None:
    with (
        pytest.raises(WebSocketDisconnect, check=lambda refused: refused.code == 1002),
        stand.operator().websocket_connect(f"{SOCKET}/missions/{mission_id}/scene", subprotocols=["viser-v0.0.0"]),
    ):
        pass


def test_the_scene_grows_from_measured_sweeps_and_says_what_it_shows(scenes: Scenes, mission_id: MissionId) -> None:
    assert "when somebody looks" in scenes.note(mission_id)
    scenes.port(mission_id)
    scenes.step()
    note = scenes.note(mission_id)
    points = int(note.split(" points")[0].replace(" ", ""))
    assert points > 500
    assert "lidar sweeps" in note


def test_a_mission_without_poses_says_why_its_scene_is_blank(stand: Stand, scenes: Scenes) -> None:
    blank = stand.created()
    scenes.port(blank)
    scenes.step()
    assert scenes.note(blank) == "Nothing to draw yet: no pose has been measured in this mission."


def test_only_so_many_scenes_stay_open_and_the_one_longest_unseen_goes(
    stand: Stand, scenes: Scenes, mission_id: MissionId
) -> None:
    scenes.port(mission_id)
    first, second = stand.created(), stand.created()
    scenes.port(first)
    scenes.port(mission_id)
    scenes.port(second)
    assert "when somebody looks" in scenes.note(first)
    assert "when somebody looks" not in scenes.note(mission_id)


def test_a_scene_that_nobody_watches_is_closed(stand: Stand, mission_id: MissionId) -> None:
    now_s = [0.0]
    scenes = Scenes(stand.harness.runtime, idle_s=600.0, clock=lambda: now_s[0])
    try:
        scenes.port(mission_id)
        now_s[0] = 599.0
        scenes.touch(mission_id)
        now_s[0] = 1190.0
        scenes.step()
        assert "when somebody looks" not in scenes.note(mission_id)
        now_s[0] = 1200.0
        scenes.step()
        assert "when somebody looks" in scenes.note(mission_id)
    finally:
        scenes.close()


def test_there_is_no_scene_without_a_mission(scenes: Scenes) -> None:
    with pytest.raises(UnknownName):
        scenes.port(MissionId("msn_none"))
