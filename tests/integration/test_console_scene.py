"""The 3D view behind the console's own door: its page, its socket, what it draws, and when it goes away."""

import re
from collections.abc import Iterator

import numpy as np
import pytest
import viser
from starlette.websockets import WebSocketDisconnect

from app.scene.feed import Feed
from app.scene.point_cloud import Stand as Pose
from app.scene.point_cloud import placed
from app.scene.proxy import PROTOCOL
from app.scene.servers import Scenes
from app.scene.view import ROUGH, SceneView
from app.web.security import SCENE_POLICY
from harness.contracts.errors import UnknownName
from harness.contracts.ids import MissionId
from tests.builders.consoles import BASE, FOREIGN, Stand, console_stand

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
    answer = stand.operator().get(f"/missions/{mission_id}/scene/shared/")
    assert answer.status_code == 200
    assert answer.headers["content-security-policy"] == SCENE_POLICY
    assert answer.headers["x-frame-options"] == "SAMEORIGIN"
    assert len(answer.content) > 100_000


@pytest.mark.parametrize("query", ["websocket=ws://elsewhere.example", "playbackPath=/etc/passwd"])
def test_the_viewer_cannot_be_pointed_elsewhere(stand: Stand, mission_id: MissionId, query: str) -> None:
    assert stand.operator().get(f"/missions/{mission_id}/scene/shared/?{query}").status_code == 400


def test_a_scene_of_an_unknown_mission_is_not_found(stand: Stand) -> None:
    assert stand.operator().get("/missions/msn_none/scene/shared/").status_code == 404


@pytest.mark.parametrize("slash", ["", "/"])
def test_the_socket_relays_the_scene_with_and_without_a_slash(stand: Stand, mission_id: MissionId, slash: str) -> None:
    operator = stand.operator()
    address = f"{SOCKET}/missions/{mission_id}/scene/shared{slash}"
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
        client.websocket_connect(
            f"{SOCKET}/missions/{mission_id}/scene/shared", subprotocols=[PROTOCOL], headers=headers
        ),
    ):
        pass
    assert (refused.value.code, refused.value.reason) == (1008, told)


def test_a_viewer_of_another_version_is_refused(stand: Stand, mission_id: MissionId) -> None:
    with (
        pytest.raises(WebSocketDisconnect, check=lambda refused: refused.code == 1002),
        stand.operator().websocket_connect(
            f"{SOCKET}/missions/{mission_id}/scene/shared", subprotocols=["viser-v0.0.0"]
        ),
    ):
        pass


def test_the_scene_grows_from_measured_sweeps_and_says_what_it_shows(scenes: Scenes, mission_id: MissionId) -> None:
    assert "when somebody looks" in scenes.note(mission_id)
    scenes.socket(mission_id)
    scenes.step()
    note = scenes.note(mission_id)
    points = int(note.split(" points")[0].replace(" ", ""))
    assert points > 500
    assert "lidar sweeps" in note


def test_the_scene_has_the_sites_own_map_under_it_and_a_robot_with_legs(scenes: Scenes, mission_id: MissionId) -> None:
    scenes.socket(mission_id)
    scenes.step()
    view, site = scenes._open[mission_id, ""], scenes._feeds[mission_id]._runtime.site
    names = [
        *(f"/site/zone/{one.name}" for one in site.zones),
        *(f"/site/region/{one.name}" for one in site.places if one.region_m),
        *(f"/site/passage/{one.passage_id}" for one in site.passages),
        *("/robot/body", "/robot/head", "/robot/leg-fl", "/robot/leg-rr"),
    ]
    assert [name for name in names if view.server.scene.get_handle_by_name(name) is None] == []


def test_a_mission_without_poses_says_why_its_scene_is_blank(stand: Stand, scenes: Scenes) -> None:
    blank = stand.created()
    scenes.socket(blank)
    scenes.step()
    assert scenes.note(blank) == "Nothing to draw yet: no pose has been measured in this mission."


def test_only_so_many_scenes_stay_open_and_the_one_longest_unseen_goes(
    stand: Stand, scenes: Scenes, mission_id: MissionId
) -> None:
    scenes.socket(mission_id)
    first, second = stand.created(), stand.created()
    scenes.socket(first)
    scenes.socket(mission_id)
    scenes.socket(second)
    assert "when somebody looks" in scenes.note(first)
    assert "when somebody looks" not in scenes.note(mission_id)


def test_a_scene_that_nobody_watches_is_closed(stand: Stand, mission_id: MissionId) -> None:
    now_s = [0.0]
    scenes = Scenes(stand.harness.runtime, idle_s=600.0, clock=lambda: now_s[0])
    try:
        scenes.socket(mission_id)
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
        scenes.socket(MissionId("msn_none"))


def test_two_readers_look_at_two_instants_of_one_mission(stand: Stand, scenes: Scenes, mission_id: MissionId) -> None:
    entries = stand.app.state.console.histories.of(mission_id)
    begin_s, end_s = entries[0].mission_s, entries[-1].mission_s
    assert scenes.socket(mission_id, "one") != scenes.socket(mission_id, "two")
    scenes.step()
    scenes.step()
    scenes.seek(mission_id, "one", begin_s - 1.0)
    scenes.seek(mission_id, "two", (begin_s + end_s) / 2)
    first, second = (scenes._open[mission_id, view].view._drawing for view in ("one", "two"))
    assert first is not None
    assert second is not None
    assert (first._robot.visible, second._robot.visible) == (False, True)
    shown = [
        {name for name, node in drawing._nodes.items() if name.startswith("/cloud") and node.visible}
        for drawing in (first, second)
    ]
    assert shown[0] == set()
    assert shown[1]
    scenes.seek(mission_id, "three", begin_s - 1.0)
    scenes.socket(mission_id, "three")
    scenes.step()
    third = scenes._open[mission_id, "three"].view._drawing
    assert third is not None
    assert third._robot is not None
    assert not third._robot.visible


def test_what_is_drawn_up_to_an_instant_was_measured_by_then(scenes: Scenes, mission_id: MissionId) -> None:
    scenes.socket(mission_id)
    scenes.step()
    feed, view = scenes._feeds[mission_id], scenes._open[mission_id, ""].view
    middle_s = feed.track.stands[len(feed.track.stands) // 2].at_s
    view.seek(middle_s)
    drawing = view._drawing
    assert drawing is not None
    points = sum(
        len(node.points) for name, node in drawing._nodes.items() if name.startswith("/cloud") and node.visible
    )
    assert points == sum(int((seen <= middle_s).sum()) for seen in feed.cloud.seen)
    segments = sum(len(node.points) for name, node in drawing._nodes.items() if name.startswith("/trajectory"))
    assert 0 < segments <= feed.track.until(middle_s)
    view.seek(None)
    every = sum(len(node.points) for name, node in drawing._nodes.items() if name.startswith("/cloud") and node.visible)
    assert every == feed.cloud.count


def test_a_big_cloud_is_shown_coarse_first_and_then_in_full(stand: Stand, mission_id: MissionId) -> None:
    feed = Feed(stand.harness.runtime, mission_id)
    feed.step()
    grid = np.stack(np.meshgrid(np.arange(200) * 0.1, np.arange(200) * 0.1, [1.0]), axis=-1).reshape(-1, 3)
    feed.cloud.add(grid.astype(np.float32), feed.track.stands[0].at_s)
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    try:
        view = SceneView(server, feed)
        drawn = []
        for _ in range(8):
            view.step()
            assert view._drawing is not None
            nodes = {name: node for name, node in view._drawing._nodes.items() if name.startswith("/cloud")}
            drawn.append({name: len(node.points) for name, node in nodes.items()})
            if view.refined and ROUGH not in nodes:
                break
        assert list(drawn[0]) == [ROUGH]
        assert 0 < drawn[0][ROUGH] < drawn[1][ROUGH] < feed.cloud.count
        assert sum(drawn[-1].values()) == feed.cloud.count
        assert len(drawn) <= 4
    finally:
        server.stop()


def test_far_from_the_origin_points_are_still_exact() -> None:
    stand = Pose(at_s=0.0, x_m=500_000.25, y_m=4_000_000.75, yaw_rad=0.0)
    near = placed(np.array([[1.001, 2.002, 0.0]], dtype=np.float32), stand, origin_m=(500_000.0, 4_000_000.0))
    assert near[0].tolist() == pytest.approx([1.251, 2.752, 0.0], abs=1e-5)


def test_a_reader_moves_their_own_view_only_from_our_own_pages(stand: Stand, mission_id: MissionId) -> None:
    operator = stand.operator()
    assert operator.post("/missions/msn_none/scene/mine/instant?t=1").status_code == 404
    operator.get(f"/missions/{mission_id}/scene/mine/")
    assert operator.post(f"/missions/{mission_id}/scene/mine/instant?t=1").status_code == 204
    assert operator.post(f"/missions/{mission_id}/scene/mine/instant").status_code == 204
    assert operator.post(f"/missions/{mission_id}/scene/mine/instant?t=nan").status_code == 422
    assert operator.post(f"/missions/{mission_id}/scene/mine/instant?t=1", headers=FOREIGN).status_code == 403


@pytest.mark.parametrize("form", ["viser", "html"])
def test_a_mission_is_exported_as_a_recording_that_needs_nothing_else(
    stand: Stand, mission_id: MissionId, form: str
) -> None:
    answer = stand.operator().get(f"/missions/{mission_id}/scene/export.{form}")
    assert answer.status_code == 200
    assert f'filename="{mission_id}.{form}"' in answer.headers["content-disposition"]
    assert len(answer.content) > 20_000
    if form == "html":
        assert answer.text.lstrip().lower().startswith("<!doctype html")
        assert not re.search(r'(?:src|href)="https?://', answer.text)
    assert stand.operator().get(f"/missions/{mission_id}/scene/export.exe").status_code == 422
