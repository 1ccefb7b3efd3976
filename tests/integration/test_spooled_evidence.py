"""A robot on a bad link: its evidence is spooled beside it and uploaded; late, and never lost or doubled."""

from collections.abc import Callable, Sequence
from pathlib import Path
from random import Random

import pytest
from fastapi.testclient import TestClient
from msgspec.structs import replace

from harness.contracts.errors import BlobDamaged, LogDamaged, ProviderFailed, ProviderUnreachable
from harness.contracts.ids import sha256
from harness.contracts.observations import AnySample, Scan
from harness.contracts.protocol import RobotStatus
from harness.contracts.values import decode, encode
from harness.provider_protocol.evidence_receiver import EvidenceReceiver, receiver_operations
from harness.provider_protocol.forwarding import EvidenceForwarder
from harness.provider_protocol.service import provider_service
from harness.provider_protocol.spool import EvidenceSpool, SpoolBatch, SpoolHead
from simulator.robot import SimulatedRobot
from simulator.world import WorldSettings
from tests.saying import raises_saying

NAME, DOWN_FROM_S, DOWN_FOR_S, LASTS_S, EVERY_S = "vbot-1", 20.0, 60.0, 120.0, 0.5


def new_robot() -> SimulatedRobot:
    return SimulatedRobot(WorldSettings(seed=3, epoch_s=1000.0), robot_id=NAME)


class BadLink:
    """Uploads to a receiver over HTTP; down for a minute of the robot's time, and repeating and swapping before and
    after."""

    def __init__(self, robot: SimulatedRobot, receiver: EvidenceReceiver) -> None:
        self._robot, self._chance = robot, Random(7)
        turn = _NoTurn()
        service = provider_service(receiver_operations(receiver), token="t", turn=lambda: turn, title="receiver")
        self._client = TestClient(service, headers={"Authorization": "Bearer t"})
        self._held_back: list[SpoolBatch] = []
        self.refused = self.repeated = self.swapped = self.replies_lost = 0

    @property
    def down(self) -> bool:
        return DOWN_FROM_S <= self._robot.at_s - 1000.0 < DOWN_FROM_S + DOWN_FOR_S

    def upload(self, batch: SpoolBatch) -> SpoolHead:
        if self.down:
            self.refused += 1
            raise ProviderUnreachable("The link is down")
        drawn = self._chance.random()
        if drawn < 0.2 and batch.entries:
            self._held_back.append(batch)
            self.swapped += 1
            raise ProviderUnreachable("On its way for long")
        answer = self._post(replace(batch, entries=tuple(reversed(batch.entries))))
        if drawn < 0.4 and self._held_back:
            answer = self._post(self._held_back.pop(0))
        if drawn < 0.6:
            answer = self._post(batch)
            self.repeated += 1
        if drawn > 0.9:
            self.replies_lost += 1
            raise ProviderUnreachable("The reply was lost")
        return answer

    def _post(self, batch: SpoolBatch) -> SpoolHead:
        answer = self._client.post("/spool", content=encode(batch))
        assert answer.status_code == 200, answer.text
        return decode(answer.content, SpoolHead)


class _NoTurn:
    def __enter__(self) -> None: ...

    def __exit__(self, *_: object) -> None: ...


def received(receiver: EvidenceReceiver) -> list[AnySample]:
    found: list[AnySample] = []
    while batch := receiver.observations(found[-1].seq if found else 0, 700).samples:
        found += batch
    return found


def test_a_minute_without_a_link_a_killed_sidecar_and_shuffled_uploads_lose_nothing_and_double_nothing(
    tmp_path: Path,
) -> None:
    robot = new_robot()
    receiver = EvidenceReceiver(tmp_path / "near", robot_id=NAME)
    link = BadLink(robot, receiver)

    def sidecar() -> EvidenceForwarder:
        return EvidenceForwarder(robot, EvidenceSpool(tmp_path / "beside"), link.upload, robot_id=NAME)

    forwarder, killed = sidecar(), 0
    while robot.at_s < 1000.0 + LASTS_S:
        robot.advance_to(robot.at_s + EVERY_S)
        forwarder.step()
        if link.down and link.refused in (10, 60):
            newest = max((tmp_path / "beside").glob("*.jsonl"))
            newest.write_bytes(newest.read_bytes() + b'{"seq":7,"torn')
            forwarder, killed = sidecar(), killed + 1
    assert killed == 2 and link.refused > 80 and link.swapped and link.repeated and link.replies_lost
    while forwarder.behind or link.swapped == 0:
        forwarder.step()

    everything = robot.observations(0, 1_000_000).samples
    assert received(receiver) == list(everything) and receiver.skipped == 0
    again = EvidenceReceiver(tmp_path / "near", robot_id=NAME)
    assert received(again) == list(everything)
    scan = next(one for one in reversed(everything) if isinstance(one, Scan))
    assert sha256(again.blob(scan.blob)) == scan.blob


def test_evidence_that_came_late_is_as_old_as_it_is(tmp_path: Path) -> None:
    robot = new_robot()
    receiver = EvidenceReceiver(tmp_path / "near", robot_id=NAME)
    down = False

    def upload(batch: SpoolBatch) -> SpoolHead:
        if down:
            raise ProviderUnreachable("The link is down")
        return receiver.receive(batch)

    forwarder = EvidenceForwarder(robot, EvidenceSpool(tmp_path / "beside"), upload, robot_id=NAME)
    robot.advance_to(1005.0)
    forwarder.step()
    down = True
    robot.advance_to(1065.0)
    forwarder.step()
    assert receiver.observations(0).at_s == receiver.status().at_s == pytest.approx(1005.0, abs=0.1)
    down = False
    forwarder.step()
    late = received(receiver)
    assert [one.at_s for one in late] == [one.at_s for one in robot.observations(0, 1_000_000).samples]
    assert receiver.status().at_s == pytest.approx(1065.0, abs=0.1)


class ForgetfulRobot:
    """A robot whose ring holds only the newest samples."""

    def __init__(self, robot: SimulatedRobot, kept: int) -> None:
        self._robot, self._kept = robot, kept
        self.providers, self.starts = robot.providers, robot.starts

    def status(self) -> RobotStatus:
        return self._robot.status()

    def observations(self, after: int, limit: int = 5000) -> object:
        whole = self._robot.observations(after, 1_000_000)
        return replace(whole, samples=whole.samples[-self._kept :][:limit])

    def blob(self, digest: str) -> bytes:
        raise BlobDamaged("forgotten")


def test_samples_that_the_robot_forgot_before_they_were_read_are_counted_as_missing(tmp_path: Path) -> None:
    robot = new_robot()
    receiver = EvidenceReceiver(tmp_path / "near", robot_id=NAME)
    forgetful = ForgetfulRobot(robot, kept=50)
    forwarder = EvidenceForwarder(
        forgetful,  # type: ignore[arg-type]
        EvidenceSpool(tmp_path / "beside"),
        receiver.receive,
        robot_id=NAME,
    )
    robot.advance_to(1001.0)
    forwarder.step()
    before = len(received(receiver))
    robot.advance_to(1030.0)
    forwarder.step()
    held, everything = received(receiver), robot.observations(0, 1_000_000).samples
    assert len(held) == before + 50
    assert receiver.skipped == everything[-1].seq - held[before - 1].seq - 50 > 0
    with pytest.raises(BlobDamaged):
        receiver.blob(next(one.blob for one in held if isinstance(one, Scan)))


@pytest.fixture
def filled(tmp_path: Path) -> tuple[Path, EvidenceReceiver]:
    """A receiver that has everything of a spool, and the spool's folder."""
    robot = new_robot()
    receiver = EvidenceReceiver(tmp_path / "near", robot_id=NAME)
    forwarder = EvidenceForwarder(robot, EvidenceSpool(tmp_path / "beside"), receiver.receive, robot_id=NAME)
    for second in range(1, 6):
        robot.advance_to(1000.0 + second)
        forwarder.step()
    return tmp_path / "beside", receiver


def changed(folder: Path) -> SpoolBatch:
    """The last entry of a spool with another charge, under the digest it had."""
    entry = EvidenceSpool(folder).after(4)[0]
    return SpoolBatch(robot_id=NAME, entries=(replace(entry, status=replace(entry.status, charge=0.01)),))


def forked(folder: Path) -> SpoolBatch:
    """What a sidecar with a new, empty folder would upload first."""
    other = folder.with_name("other")
    robot = new_robot()
    robot.advance_to(1003.0)
    spool = EvidenceSpool(other)
    EvidenceForwarder(robot, spool, lambda batch: SpoolHead(), robot_id=NAME).step()
    return SpoolBatch(robot_id=NAME, entries=spool.after(0))


@pytest.mark.parametrize("made", [changed, forked])
def test_an_upload_that_contradicts_what_is_held_is_refused_and_changes_nothing(
    filled: tuple[Path, EvidenceReceiver], made: Callable[[Path], SpoolBatch]
) -> None:
    folder, receiver = filled
    before = received(receiver)
    if made is changed:
        receiver = EvidenceReceiver(folder.with_name("fresh"), robot_id=NAME)
        receiver.receive(SpoolBatch(robot_id=NAME, entries=EvidenceSpool(folder).after(0)[:4]))
        before = received(receiver)
    with raises_saying(ProviderFailed, match="contradicts the chain"):
        receiver.receive(made(folder))
    assert received(receiver) == before


def test_a_sidecar_whose_folder_was_lost_says_so_instead_of_uploading_nothing(
    filled: tuple[Path, EvidenceReceiver], tmp_path: Path
) -> None:
    _, receiver = filled
    robot = new_robot()
    robot.advance_to(1010.0)
    forwarder = EvidenceForwarder(robot, EvidenceSpool(tmp_path / "new"), receiver.receive, robot_id=NAME)
    forwarder.read()
    with raises_saying(ProviderFailed, match="contradicts the chain"):
        forwarder.send()


def test_another_robots_upload_is_refused(filled: tuple[Path, EvidenceReceiver]) -> None:
    with pytest.raises(ProviderFailed):
        filled[1].receive(SpoolBatch(robot_id="vbot-2"))


def test_a_damaged_spool_is_not_gone_on_with(filled: tuple[Path, EvidenceReceiver]) -> None:
    folder, _ = filled
    (file,) = folder.glob("*.jsonl")
    body = file.read_bytes()
    file.write_bytes(body.replace(b'"charge":0.9', b'"charge":0.8', 1))
    with raises_saying(LogDamaged, match="Entry"):
        EvidenceSpool(folder)


def test_nothing_is_known_of_a_robot_before_the_first_upload(tmp_path: Path) -> None:
    receiver = EvidenceReceiver(tmp_path, robot_id=NAME)
    asks: Sequence[Callable[[], object]] = (receiver.status, lambda: receiver.observations(0))
    for ask in asks:
        with raises_saying(ProviderFailed, match="Nothing of this robot"):
            ask()
    assert receiver.providers() == () and receiver.starts() == ()
