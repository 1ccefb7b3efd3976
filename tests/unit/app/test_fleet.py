"""What the console keeps of its robots: bounded, aged, and honest about silence."""

from app.background.presence import Presence
from app.background.robot_reports import KEPT_S, MOST_BYTES, MOST_SHOTS, PICTURE_EVERY_S, Fleet
from app.views.robots import camera_view, robot_word
from harness.contracts.errors import ProviderUnreachable, UnknownName
from harness.contracts.ids import RobotId
from harness.contracts.observations import Pose
from harness.contracts.protocol import Observations, Picture, RobotStatus
from simulator.robot import SimulatedRobot
from simulator.world import WorldSettings
from tests.saying import raises_saying

ONE = RobotId("vbot-1")
NEWEST = 987_654


class Clock:
    """Moves when told."""

    def __init__(self) -> None:
        self.now_s = 1000.0

    def __call__(self) -> float:
        return self.now_s


class Eye:
    """A camera that shows bytes of a given size, or nothing."""

    def __init__(self, size: int = 10) -> None:
        self.size, self.taken, self.broken = size, 0, False

    def picture(self) -> Picture:
        if self.broken:
            raise ProviderUnreachable("The robot did not answer", where="camera")
        self.taken += 1
        return Picture(at_s=float(self.taken), width_px=4, height_px=3, body=bytes(self.size))


class Silent(SimulatedRobot):
    """A robot whose line can be cut."""

    cut = False

    def status(self) -> RobotStatus:
        if self.cut:
            raise ProviderUnreachable("The robot did not answer", where="line")
        return super().status()


def fleet(eye: Eye, clock: Clock) -> tuple[Fleet, Silent]:
    robot = Silent(WorldSettings(seed=1))
    return Fleet({ONE: robot}, {ONE: eye}, clock), robot


class Talkative(SimulatedRobot):
    """A robot that has said where it is NEWEST times, and counts how often it is asked."""

    asked = 0

    def observations(self, after: int, limit: int = 5000) -> Observations:
        self.asked += 1
        found = tuple(pose_of(seq) for seq in range(after + 1, min(after + limit, NEWEST) + 1))
        return Observations(samples=found, next_seq=found[-1].seq if found else after, at_s=NEWEST / 10)


def pose_of(seq: int) -> Pose:
    return Pose(
        seq=seq, at_s=seq / 10, source="localiser", frame="map", map_version="site-1", x_m=seq, y_m=0.0, yaw_rad=0.0
    )


def looked(watch: Fleet, clock: Clock, times: int, *, every_s: float = PICTURE_EVERY_S) -> None:
    for _ in range(times):
        watch.shots(ONE)
        clock.now_s += every_s


def test_the_ring_holds_the_last_twenty_seconds_and_no_more() -> None:
    clock, eye = Clock(), Eye()
    watch, _ = fleet(eye, clock)
    looked(watch, clock, 60)
    kept = watch.shots(ONE).kept
    assert eye.taken >= 60 and clock.now_s - kept[0].taken_s <= KEPT_S
    assert 8 <= len(kept) <= MOST_SHOTS and [one.number for one in kept] == sorted(one.number for one in kept)
    with raises_saying(UnknownName, match="not kept any more"):
        watch.shot(ONE, 1)


def test_large_pictures_push_the_older_ones_out_before_the_bytes_run_over() -> None:
    clock, eye = Clock(), Eye(size=MOST_BYTES // 3)
    watch, _ = fleet(eye, clock)
    looked(watch, clock, 8)
    kept = watch.shots(ONE).kept
    assert len(kept) == 3 and sum(len(one.picture.body) for one in kept) <= MOST_BYTES


def test_a_camera_that_falls_silent_is_shown_old_with_the_reason() -> None:
    clock, eye = Clock(), Eye()
    watch, _ = fleet(eye, clock)
    looked(watch, clock, 2)
    eye.broken = True
    clock.now_s += 30.0
    view = camera_view(ONE, watch.shots(ONE), now_s=clock.now_s)
    assert view.stale and view.newest is not None and view.newest.age_s > 30.0
    assert "did not answer" in view.why


def test_a_robot_that_falls_silent_keeps_its_last_word_and_says_how_old_it_is() -> None:
    clock = Clock()
    watch, robot = fleet(Eye(), clock)
    assert robot_word(watch.word(ONE), now_s=clock.now_s).link == "good"
    robot.cut = True
    clock.now_s += 12.0
    word = robot_word(watch.word(ONE), now_s=clock.now_s)
    assert (word.link, word.posture) == ("lost", "standing")
    assert word.link_age_s == 12.0 and word.trouble == "The robot did not answer"


def test_an_unknown_robot_and_one_without_a_camera_are_told_apart() -> None:
    clock = Clock()
    blind = Fleet({ONE: SimulatedRobot(WorldSettings(seed=1))}, {}, clock)
    assert "no camera" in blind.shots(ONE).trouble
    with raises_saying(UnknownName, match="choose from vbot-1"):
        blind.word("vbot-7")


def test_people_are_present_as_long_as_their_page_is_open() -> None:
    presence = Presence()
    with presence.here("ada", ("mission/m1",)), presence.here("ben", ("handoff/",)):
        assert presence.people() == ("ada", "ben")
        assert presence.watching("mission/m1", "robot/vbot-1") == ("ada",)
    assert presence.people() == ()


def test_a_robot_that_nobody_looked_at_for_long_is_shown_where_it_is_now() -> None:
    robot = Talkative(WorldSettings(seed=1))
    watch = Fleet({ONE: robot}, {ONE: Eye()}, Clock())
    samples, at_s = watch.samples(ONE)
    assert (samples[-1].seq, at_s) == (NEWEST, NEWEST / 10)
    assert robot.asked < 40
    before = robot.asked
    assert watch.samples(ONE)[0][-1].seq == NEWEST and robot.asked == before + 1
    assert watch.pose(ONE)[1] == 0.0
