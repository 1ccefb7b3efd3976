"""Reports of robots reach every process on the database, and nothing of them is stored."""

from collections.abc import Callable
from contextlib import closing
from queue import Empty, SimpleQueue

import pytest
from msgspec.structs import replace

from app.background.fleet_reports import ReportedRobots, Reporter
from app.views.robots import RobotReportSeen
from harness.adapters.stores.postgres import PostgresEventStore
from harness.adapters.stores.postgres_reports import CHANNEL, ReportListener, ReportSender
from harness.bootstrap import open_reports
from harness.contracts.errors import StoreUnavailable
from harness.contracts.fleet import WorkerReport
from harness.contracts.ids import RobotId
from harness.contracts.observations import Pose
from simulator.camera import CAMERA
from tests.builders.reported_robots import moving, pose_at
from tests.saying import raises_saying
from tools.postgres import PostgresServer

pytestmark = pytest.mark.xdist_group("postgres")
NAME = RobotId("vbot-9")
STATUS, POSE = moving(NAME), pose_at(1.0, 2.0)


class OneRobot:
    """What a process hears of its one robot."""

    own = (NAME,)

    def __init__(self, seen: RobotReportSeen) -> None:
        self._seen = seen

    def word(self, robot_id: str) -> RobotReportSeen:
        return self._seen

    def pose(self, robot_id: RobotId) -> tuple[Pose | None, float]:
        return POSE, 0.25


def reporter(send: Callable[[WorkerReport], None], seen: RobotReportSeen) -> Reporter:
    return Reporter(OneRobot(seen), send, worker="w1", clock=lambda: 100.0)


def test_a_report_reaches_the_other_processes_with_its_age_and_stores_nothing(postgres: PostgresServer) -> None:
    url = postgres.database()
    with closing(PostgresEventStore(url)) as store:
        reports: SimpleQueue[WorkerReport] = SimpleQueue()
        seen = RobotReportSeen(NAME, status=STATUS, heard_s=98.5, took_s=0.2, trouble="")
        with open_reports(url, reports.put) as send:
            assert send is not None
            reporter(send, seen).step()
            told = reports.get(timeout=60)
        assert told == WorkerReport(
            worker="w1", robot_id=NAME, status=STATUS, age_s=1.5, took_s=0.2, pose=POSE, pose_age_s=0.25
        )
        assert store.head().position == 0

    here = ReportedRobots(lambda: 1000.0, worker="console")
    here.receive(told)
    newest = here.newest(NAME)
    assert here.names == (NAME,) and newest is not None
    assert here.word(newest).heard_s == 998.5, "its age counts from its arrival here"


def test_what_is_no_report_is_left_out_and_the_next_one_comes(postgres: PostgresServer) -> None:
    url = postgres.database()
    reports: SimpleQueue[WorkerReport] = SimpleQueue()
    report = WorkerReport(worker="w1", robot_id=NAME)
    with closing(PostgresEventStore(url)), closing(ReportListener(url, reports.put)), closing(ReportSender(url)) as one:
        for payload in ("", "{}", '{"worker":1}', "null"):
            postgres.execute(f"SELECT pg_notify('{CHANNEL}', '{payload}')", url=url)
        one.send(WorkerReport(worker="w1", robot_id=NAME, trouble="x" * 9000))
        one.send(report)
        assert reports.get(timeout=60) == report
        with pytest.raises(Empty):
            reports.get_nowait()


def test_reports_go_on_after_the_connections_were_cut(postgres: PostgresServer) -> None:
    url = postgres.database()
    reports: SimpleQueue[WorkerReport] = SimpleQueue()
    others = "datname = current_database() AND pid <> pg_backend_pid()"
    cut = f"SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE {others}"
    with closing(PostgresEventStore(url)), closing(ReportListener(url, reports.put)), closing(ReportSender(url)) as one:
        one.send(WorkerReport(worker="w1", robot_id=NAME, took_s=1.0))
        assert reports.get(timeout=60).took_s == 1.0
        postgres.execute(cut, url=url)
        for number in range(2, 200):
            one.send(WorkerReport(worker="w1", robot_id=NAME, took_s=float(number)))
            try:
                assert reports.get(timeout=0.5).took_s > 1.0
                return
            except Empty:
                continue
        pytest.fail("no report came again")


def test_a_log_that_is_a_file_has_nobody_to_tell() -> None:
    with open_reports("", lambda report: None) as send:
        assert send is None


def test_a_database_that_is_not_there_is_said() -> None:
    with raises_saying(StoreUnavailable, match="127.0.0.1"):
        ReportListener("postgresql://nobody@127.0.0.1:1/none", lambda report: None)


def test_a_process_does_not_hear_itself_and_a_camera_does_not_travel() -> None:
    here = ReportedRobots(lambda: 0.0, worker="w1")
    sent: list[WorkerReport] = []
    status = replace(STATUS, camera=CAMERA)
    reporter(sent.append, RobotReportSeen(NAME, status=status, trouble="x" * 2000)).step()
    (report,) = sent
    assert report.status is not None and report.status.camera is None and report.age_s is None
    assert len(report.trouble) == 500
    here.receive(report)
    assert here.names == ()
