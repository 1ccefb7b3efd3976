"""The alert inbox over real missions: what raises alerts, what clears them, and what people do about them."""

import json
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread

import pytest

from app.background.alert_watch import AlertSources, AlertWatch
from app.background.alerts import Alerts
from app.background.notifications import Notices
from app.background.robot_reports import Fleet
from app.i18n.reasons.rendering import sentence
from harness.adapters.clock import SystemClock
from harness.adapters.connection_guard import PublicOr
from harness.adapters.ids import SeededIds
from harness.adapters.notify.services import NETWORKS, AppriseNotifier
from harness.adapters.stores.blobs import FileBlobStore
from harness.adapters.stores.memory import MemoryEventStore, MemorySpool
from harness.bootstrap import NullSignals, Parts, runtime_on
from harness.contracts.actors import Actor
from harness.contracts.commands import ClearVeto, RaiseVeto
from harness.contracts.decisions import Accepted
from harness.contracts.errors import ContractInvalid, ProviderUnreachable
from harness.contracts.ids import ConditionId, RobotId
from harness.contracts.protocol import PhysicalStart, RobotStatus
from harness.contracts.revision_commands import DisputeCompletion
from harness.projections.alerts import Alert, status
from harness.runtime import Runtime
from tests.builders.consoles import Stand, console_stand

ADA = Actor(name="ada", role="operator")
NOW_S = 4e9
"""A wall instant after which nothing that a shelf holds is still on it."""


class FakeRobot:
    """Says what it is told to say, or nothing."""

    def __init__(self) -> None:
        self.said: RobotStatus | None = RobotStatus(
            robot_id="vbot-9", at_s=0.0, posture="standing", armed=False, hardware_stop=False, charge=0.9,
            localised=True, map_version="m1",
        )  # fmt: skip

    def status(self) -> RobotStatus:
        if self.said is None:
            raise ProviderUnreachable("It does not answer", where="vbot-9")
        return self.said


class Watchman:
    """An alert watch with a clock, a disk and a robot that the test sets."""

    def __init__(self, runtime: Runtime) -> None:
        self.now_s, self.free, self.robot = 1e9, 10**12, FakeRobot()
        self.starts: list[PhysicalStart] = []
        self.journal_away = False
        fleet = Fleet({RobotId("vbot-9"): self.robot}, {}, lambda: self.now_s)  # type: ignore[dict-item]
        self.alerts = Alerts(runtime)
        watched = AlertSources(fleet, lambda mission_id: self._journal(), lambda: self.free, lambda: self.now_s)
        self.watch = AlertWatch(runtime, self.alerts, watched)

    def _journal(self) -> list[PhysicalStart]:
        if self.journal_away:
            raise ProviderUnreachable("It does not answer", where="vbot-9")
        return self.starts

    def seen(self, wait_s: float = 1.5) -> dict[str, Alert]:
        """Alerts by kind after one more look."""
        self.now_s += wait_s
        self.watch.step()
        return {alert.newest.kind: alert for _, alert in self.alerts.all() if alert.newest is not None}


@pytest.fixture
def stand() -> Iterator[Stand]:
    with console_stand() as made:
        yield made


@pytest.fixture
def watchman(stand: Stand) -> Watchman:
    return Watchman(stand.harness.runtime)


def test_a_question_is_an_alert_until_it_is_answered(stand: Stand) -> None:
    watch: AlertWatch = stand.app.state.alert_watch
    mission, handoff_id = stand.handed_off()
    watch.step()
    ((name, alert),) = watch.alerts.all()
    assert alert.newest is not None
    assert (alert.newest.kind, alert.newest.link) == ("handoff", f"/handoffs/{handoff_id}")
    assert alert.standing == (f"handoff {handoff_id}",)
    operator = stand.operator()
    assert operator.post(f"/missions/{mission.mission_id}/stop", data={"reason": "enough"}).status_code == 303
    stand.harness.supervisor.run(mission.mission_id)
    watch.step()
    assert watch.alerts.one(name).standing == ()
    assert status(watch.alerts.one(name), NOW_S) == "returned"


def test_what_the_log_told_is_not_told_again_after_a_restart(stand: Stand) -> None:
    stand.handed_off()
    stand.app.state.alert_watch.step()
    before = stand.harness.runtime.head()
    Watchman(stand.harness.runtime).watch.follow()
    assert stand.harness.runtime.head() == before


def test_a_veto_is_an_alert_while_it_stands_and_one_with_the_trouble_of_its_stage(stand: Stand) -> None:
    watch: AlertWatch = stand.app.state.alert_watch
    mission_id = stand.driving()
    runtime = stand.harness.runtime
    for _ in range(2):
        assert isinstance(runtime.submit(mission_id, RaiseVeto(layer="watchdog", reason="a person")), Accepted)
        watch.step()
        assert isinstance(runtime.submit(mission_id, ClearVeto(layer="watchdog", reason="gone")), Accepted)
        watch.step()
    ((_, alert),) = watch.alerts.all()
    assert (alert.count, alert.priority, alert.standing) == (2, "critical", ())


def test_a_disputed_acceptance_and_a_failed_mission_are_alerts(stand: Stand) -> None:
    watch: AlertWatch = stand.app.state.alert_watch
    mission = stand.run()
    fact = mission.facts[0].condition_id
    asked = DisputeCompletion(condition_id=ConditionId(fact), actor=ADA, reason="it was not there")
    assert isinstance(stand.harness.runtime.submit(mission.mission_id, asked), Accepted)
    watch.step()
    ((_, alert),) = watch.alerts.all()
    assert alert.newest is not None
    assert alert.newest.kind == "disputed"
    assert "it was not there" in sentence(alert.newest.text)


def test_a_silent_robot_is_one_alert_and_answers_again(watchman: Watchman) -> None:
    assert watchman.seen() == {}
    said, watchman.robot.said = watchman.robot.said, None
    assert watchman.seen(3.0) == {}
    for _ in range(3):
        lost = watchman.seen(11.0)["robot_lost"]
    assert (lost.count, lost.priority, status(lost, NOW_S)) == (1, "critical", "unacknowledged")
    watchman.robot.said = said
    assert status(watchman.seen()["robot_lost"], NOW_S) == "returned"


def test_battery_hardware_stop_and_disk_are_watched(watchman: Watchman) -> None:
    assert watchman.robot.said is not None
    good = watchman.robot.said
    watchman.robot.said = RobotStatus(**{**{f: getattr(good, f) for f in good.__struct_fields__}, "charge": 0.1})
    assert watchman.seen()["battery_low"].standing == ("battery_low",)
    watchman.robot.said = RobotStatus(**{**{f: getattr(good, f) for f in good.__struct_fields__}, "charge": 0.22})
    assert watchman.seen()["battery_low"].standing == ("battery_low",), "a reading at the bound must not flutter"
    watchman.robot.said = RobotStatus(
        **{**{f: getattr(good, f) for f in good.__struct_fields__}, "hardware_stop": True}
    )
    seen = watchman.seen()
    assert seen["battery_low"].standing == ()
    assert seen["hardware_stop"].priority == "critical"
    watchman.free = 10**6
    assert watchman.seen()["disk_low"].standing == ("disk_low",)
    watchman.free = 10**12
    assert watchman.seen()["disk_low"].standing == ()


def test_a_request_that_was_started_twice_is_an_alert(stand: Stand, watchman: Watchman) -> None:
    watchman.now_s = stand.harness.runtime.log()[-1].recorded_s if stand.harness.runtime.log() else 1e9
    mission = stand.run()
    watchman.now_s = stand.harness.runtime.log()[-1].recorded_s
    starts = list(stand.harness.starts(mission.mission_id))
    watchman.starts = [*starts, starts[0]]
    found = watchman.seen()["duplicate_start"]
    assert found.newest is not None
    assert "1 starts beyond the first" in sentence(found.newest.text)


def test_a_robot_that_keeps_its_journal_to_itself_holds_no_other_alert_up(stand: Stand, watchman: Watchman) -> None:
    mission = stand.run()
    watchman.now_s = stand.harness.runtime.log()[-1].recorded_s
    starts = list(stand.harness.starts(mission.mission_id))
    watchman.starts, watchman.journal_away = [*starts, starts[0]], True
    assert "duplicate_start" not in watchman.seen()
    stand.handed_off()
    assert "handoff" in watchman.seen()
    watchman.journal_away = False
    assert "duplicate_start" in watchman.seen()


def test_damaged_evidence_is_an_alert(tmp_path: Path) -> None:
    parts = Parts(
        store=MemoryEventStore(), blobs=FileBlobStore(tmp_path), spool=MemorySpool(), ids=SeededIds(1),
        clock=SystemClock(), signals=NullSignals(),
    )  # fmt: skip
    runtime = runtime_on(parts)
    watchman = Watchman(runtime)
    digests = [runtime.keep(f"picture {number}".encode()) for number in range(9)]
    assert all("blob_damaged" not in watchman.seen() for _ in range(6))
    (file,) = [one for one in tmp_path.rglob("*") if one.is_file() and digests[4][4:] in one.name]
    file.chmod(0o600)
    file.write_bytes(b"rotten")
    found = [watchman.seen() for _ in range(6)][-1]["blob_damaged"]
    assert found.newest is not None
    assert (found.newest.link, found.count) == (f"/evidence/{digests[4]}/about", 1)


def test_people_acknowledge_shelve_suppress_restore_and_assign_on_the_page_and_through_the_api(stand: Stand) -> None:
    watch: AlertWatch = stand.app.state.alert_watch
    stand.handed_off()
    watch.step()
    ((name, _),) = watch.alerts.all()
    operator = stand.operator()
    page = operator.get("/alerts").text
    assert f'action="/alerts/{name}/acknowledge"' in page
    assert "not acknowledged" in operator.get("/overview/rail").text
    assert operator.post(f"/alerts/{name}/acknowledge", data={"seen": "0"}).status_code == 409
    assert operator.post(f"/alerts/{name}/acknowledge", data={"seen": "1"}).status_code == 303
    assert "not acknowledged" not in operator.get("/overview/rail").text
    assert operator.post(f"/alerts/{name}/shelve", data={"for_s": "900"}).status_code == 422
    assert operator.post(f"/alerts/{name}/shelve", data={"for_s": "7", "reason": "known"}).status_code == 422
    assert operator.post(f"/alerts/{name}/shelve", data={"for_s": "900", "reason": "known"}).status_code == 303
    api = operator.get(f"/api/v1/alerts/{name}").json()
    assert (api["state"], api["put_away"]) == ("shelved", "operator: known")
    assert operator.post(f"/api/v1/alerts/{name}/restore", json={}).json()["state"] == "acknowledged"
    assert operator.post(f"/api/v1/alerts/{name}/restore", json={}).status_code == 409
    suppressed = operator.post(f"/api/v1/alerts/{name}/suppress", json={"reason": "workshop"})
    assert suppressed.json()["state"] == "suppressed"
    assert operator.post(f"/alerts/{name}/assign", data={"assignee": "eve"}).status_code == 303
    told = [one["text"] for one in operator.get(f"/api/v1/alerts/{name}").json()["history"]]
    assert told[:3] == ["operator gave it to eve", "operator suppressed it: workshop", "operator restored it."]
    assert operator.get("/alerts?status=suppressed").text.count(f'id="{name}"') == 1
    assert operator.get("/alerts/alert_none").status_code == 404


def test_who_may_not_is_refused_and_changes_nothing(stand: Stand) -> None:
    stand.handed_off()
    stand.app.state.alert_watch.step()
    ((name, alert),) = stand.app.state.alert_watch.alerts.all()
    assert stand.stranger().post(f"/alerts/{name}/acknowledge", data={"seen": "1"}).status_code in (401, 403)
    assert stand.app.state.alert_watch.alerts.one(name) == alert


@pytest.fixture
def service() -> Iterator[tuple[str, list[bytes], list[int]]]:
    """A service that takes messages: its Apprise address, what it was sent, and the answers it will give."""
    received: list[bytes] = []
    answers: list[int] = []

    class Answering(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            received.append(self.rfile.read(int(self.headers["Content-Length"])))
            self.send_response(answers.pop(0) if answers else 200)
            self.end_headers()

        def log_message(self, *args: object) -> None:
            """Nothing on the test's output."""

    server = ThreadingHTTPServer(("127.0.0.1", 0), Answering)
    Thread(target=server.serve_forever, daemon=True).start()
    yield f"json://someone:s3cr3t-word@127.0.0.1:{server.server_port}/hook", received, answers
    server.shutdown()
    server.server_close()


def notices(stand: Stand, address: str, waits_s: tuple[float, ...] = (0.0,)) -> Notices:
    here = PublicOr(("127.0.0.0/8",), where=NETWORKS)
    notifier = AppriseNotifier({"night-desk": address}, permits=here)
    made = Notices(stand.harness.runtime, notifier, lambda: 1e9, "http://127.0.0.1:8000", waits_s=waits_s)
    stand.app.state.alert_watch.tell = made.offer
    return made


def logged(stand: Stand) -> str:
    return b"".join(one.body for one in stand.harness.runtime.log(limit=100_000)).decode()


def test_a_pressing_alert_is_told_once_without_words_of_people_and_without_secrets(
    stand: Stand, service: tuple[str, list[bytes], list[int]]
) -> None:
    address, received, _ = service
    releases = notices(stand, address)
    mission, _ = stand.handed_off()
    stand.app.state.alert_watch.step()
    stand.app.state.alert_watch.step()
    assert releases.deliver() == 1
    assert releases.deliver() == 0
    (body,) = received
    said = json.loads(body)
    assert said["title"] == "vbot-1: handoff"
    assert "/alerts/alert_" in said["message"]
    assert mission.goal not in body.decode()
    assert not said["attachments"]
    ((name, alert),) = stand.app.state.alert_watch.alerts.all()
    assert [(one.service, one.outcome, one.tries) for one in alert.notified] == [("night-desk", "sent", 1)]
    page = stand.operator().get(f"/alerts/{name}").text
    assert "reports that it took the message" in page
    assert "s3cr3t-word" not in page + logged(stand)


def test_a_service_that_fails_is_tried_again_and_its_failure_is_an_alert_that_ends_when_it_works(
    stand: Stand, service: tuple[str, list[bytes], list[int]]
) -> None:
    address, received, answers = service
    releases = notices(stand, address, waits_s=(0.0, 0.0, 0.0))
    answers += [500, 503, 500]
    stand.handed_off()
    stand.app.state.alert_watch.step()
    assert releases.deliver() == 0
    assert len(received) == 3
    kinds = {one.newest.kind: one for _, one in stand.app.state.alert_watch.alerts.all() if one.newest}
    failed = kinds["notification_failed"]
    assert failed.standing == ("notification_failed",)
    assert kinds["handoff"].notified[-1].outcome == "failed"
    ((name, alert),) = [one for one in stand.app.state.alert_watch.alerts.all() if one[1] == kinds["handoff"]]
    releases._notified.clear()
    releases.offer(name, alert)
    answers += [500, 200]
    assert releases.deliver() == 1
    again = {one.newest.kind: one for _, one in stand.app.state.alert_watch.alerts.all() if one.newest}
    assert again["notification_failed"].standing == ()
    assert "s3cr3t-word" not in logged(stand)


def test_a_redirect_of_a_service_is_not_followed(stand: Stand, service: tuple[str, list[bytes], list[int]]) -> None:
    address, received, answers = service
    answers += [302]
    releases = notices(stand, address)
    stand.handed_off()
    stand.app.state.alert_watch.step()
    assert releases.deliver() == 0
    assert len(received) == 1


def test_an_address_that_no_service_has_is_refused_without_showing_it() -> None:
    with pytest.raises(ContractInvalid) as refused:
        AppriseNotifier({"night-desk": "nosuch://user:s3cr3t-word@host"})
    assert "s3cr3t-word" not in str(refused.value)
