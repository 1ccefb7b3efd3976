"""What the client of a robot makes of answers: bounded as a whole, and unknown where nobody can know what became of
a request.
"""

import json
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager

import pytest

from app.i18n.reasons.rendering import explained, sentence
from harness.adapters.clock import LockstepClock, RobotClock
from harness.adapters.providers.http.exchange import DEEPEST, nested_too_deep
from harness.adapters.providers.http.robot import HttpProvider, HttpRobot
from harness.conformance.address import addressed
from harness.conformance.hostile.proxy import Answer, Ask, LyingProxy, ProxyState, listening
from harness.conformance.motion import SampleLog
from harness.contracts.errors import BlobDamaged, ProviderFailed, ProviderUnreachable
from harness.contracts.ids import Digest, MissionId, NodeId, RequestId
from harness.contracts.protocol import InvocationIdentity, InvocationReport, Progress
from harness.contracts.reasons import Reason, because
from harness.contracts.values import encode
from harness.provider_protocol.wire import Problem
from simulator.cards import ROUTE_FOLLOWER
from tests.saying import raises_saying

UNREADABLE = (
    Answer(status=504, body=b"<html>Bad gateway</html>", content_type="text/html"),
    Answer(status=403, body=b"<html>Not from here</html>", content_type="text/html"),
    Answer(status=500, body=json.dumps({"code": "provider_failed", "what": "No"}).encode()),
    Answer(status=302, headers=(("Location", "http://127.0.0.1:9/"),)),
    Answer(body=b'{"handle": "rou'),
    Answer(body=b""),
    Answer(body=b"[" * 100_000),
    Answer(body=b"<html>Welcome</html>", content_type="text/html"),
    Answer(reset=True),
)


@contextmanager
def answering(*answers: Answer, timeout_s: float = 5.0) -> Iterator[HttpRobot]:
    """A robot that gives these answers in turn, the last of them for ever."""
    left = list(answers)

    def said(ask: Ask, forward: Callable[[Ask], Answer], seen: ProxyState) -> Answer:
        return left.pop(0) if len(left) > 1 else left[0]

    proxy = LyingProxy(lambda ask: Answer(status=404), said, moving=frozenset())
    proxy.armed = True
    with ExitStack() as stack:
        robot = HttpRobot(stack.enter_context(listening(proxy)), "token", timeout_s)
        stack.callback(robot.close)
        yield robot


def report_saying(message: str | Reason) -> InvocationReport:
    identity = InvocationIdentity(
        mission_id=MissionId("m"),
        node_id=NodeId("go"),
        attempt=1,
        request_id=RequestId("a" * 64),
        provider_id=ROUTE_FOLLOWER.provider_id,
    )
    progress = Progress(share=0.5, text=message)
    return InvocationReport(
        handle="h", identity=identity, status="failed", at_s=1.0, progress=progress, message=message
    )


@pytest.mark.parametrize(
    "slow", [Answer(body=b" " * 500, drip_s=0.1), Answer(body=b"{}", drip_s=0.1, head_drip=True), Answer(silent_s=30.0)]
)
def test_an_exchange_ends_after_its_time_however_the_bytes_are_spread(slow: Answer) -> None:
    with answering(slow, timeout_s=0.6) as robot:
        began_s = time.monotonic()
        with raises_saying(ProviderUnreachable, match="did not answer GET /robot"):
            robot.status()
        assert time.monotonic() - began_s < 5.0


@pytest.mark.parametrize("answer", UNREADABLE)
def test_only_the_protocols_own_words_refuse_a_request(answer: Answer) -> None:
    with answering(answer) as robot:
        provider = HttpProvider(robot, ROUTE_FOLLOWER)
        with pytest.raises(ProviderUnreachable):
            provider.stop("handle")


def test_a_refusal_in_the_protocols_words_is_one_and_speaks_of_the_robot_alone() -> None:
    for code in ("provider_failed", "store_unavailable", "log_damaged", "unknown_name"):
        said = json.dumps({"code": code, "what": "Not now", "where": "here", "do": "wait"}).encode()
        with answering(Answer(status=409, body=said)) as robot:
            with raises_saying(ProviderFailed, match="Not now") as refused:
                HttpProvider(robot, ROUTE_FOLLOWER).stop("handle")
            assert not isinstance(refused.value, ProviderUnreachable)


@pytest.mark.parametrize(
    ("reason", "shown"),
    [
        (because("base_held", handle="h-1"), "调用 h-1"),
        (because("base_held", handle=7), "Not now"),
        (because("base_held", handle="h-1", more="x"), "Not now"),
        (because("base_held", handle="h" * 3000), "Not now"),
        (because("handoff_was_answered", decision="approved"), "Not now"),
    ],
)
def test_a_robots_reason_is_shown_in_the_readers_language_and_any_that_it_may_not_give_as_its_text(
    reason: Reason, shown: str
) -> None:
    problem = Problem(code="provider_failed", what="Not now", reason=reason)
    with answering(Answer(status=409, body=encode(problem))) as robot:
        with pytest.raises(ProviderFailed) as refused:
            HttpProvider(robot, ROUTE_FOLLOWER).stop("handle")
        assert shown in explained(refused.value, "zh-Hans")


@pytest.mark.parametrize(
    ("message", "shown"),
    [
        ("Stuck at the door.", "Stuck at the door."),
        (because("on_way_to_route", reason=because("no_way_to_route")), "机器人的地图上没有通往路线的路"),
        (because("no_progress", progress_m=0.2, within_s=10.0), "机器人在 10 s 内前进不足 0.2 m"),
        (because("no_progress", progress_m="0.2", within_s=10.0), "no_progress (progress_m 0.2, within_s 10.0)"),
        (because("on_way_to_route", reason=because("goal_met")), "on_way_to_route (reason goal_met)"),
        (because("on_way_to_route", reason="Goal met"), "on_way_to_route (reason Goal met)"),
        (because("goal_met"), "goal_met"),
    ],
)
def test_what_a_report_says_is_shown_in_the_readers_language_if_a_robot_may_say_it_and_as_text_if_not(
    message: str | Reason, shown: str
) -> None:
    with answering(Answer(body=encode(report_saying(message)))) as robot:
        seen = HttpProvider(robot, ROUTE_FOLLOWER).report("h")
    assert shown in sentence(seen.message, "zh-Hans")
    assert seen.progress.text == seen.message
    assert isinstance(seen.message, str) or seen.message == message


def test_a_message_without_end_is_no_message() -> None:
    endless = because("vehicle_error", error="x" * 20_000)
    with (
        answering(Answer(body=encode(report_saying(endless)))) as robot,
        raises_saying(ProviderFailed, match="message"),
    ):
        HttpProvider(robot, ROUTE_FOLLOWER).report("h")


def test_a_request_never_came_only_if_the_robot_says_so_itself() -> None:
    said = json.dumps({"code": "unknown_name", "what": "Never came"}).encode()
    request = RequestId("a" * 64)
    with answering(Answer(status=404, body=said)) as robot:
        assert HttpProvider(robot, ROUTE_FOLLOWER).find(request) is None
    with (
        answering(Answer(status=404, body=b"<html>", content_type="text/html")) as robot,
        pytest.raises(ProviderFailed),
    ):
        HttpProvider(robot, ROUTE_FOLLOWER).find(request)


def test_figures_that_no_sensor_has_and_lists_that_are_too_long_break_the_protocol() -> None:
    sample = '{"kind":"battery","seq":%s,"at_s":%s,"source":"battery","charge":0.5}'
    for seq, at_s in (("1", "NaN"), ("1", "1e300"), ("1", "1e999"), ("9" * 30, "1.0")):
        body = f'{{"samples":[{sample % (seq, at_s)}],"next_seq":1,"at_s":1.0}}'.encode()
        with answering(Answer(body=body)) as robot, pytest.raises(ProviderFailed):
            robot.observations(0)
    many = ",".join([sample % ("1", "1.0")] * 6)
    with (
        answering(Answer(body=f'{{"samples":[{many}],"next_seq":1,"at_s":1.0}}'.encode())) as robot,
        raises_saying(ProviderFailed, match="more than 5 samples"),
    ):
        robot.observations(0, 5)


def test_bytes_of_another_digest_are_no_blob() -> None:
    other = Answer(body=b"other", content_type="application/octet-stream")
    with answering(other) as robot, raises_saying(BlobDamaged, match="other bytes"):
        robot.blob(Digest("0" * 64))


def test_nesting_is_counted_outside_the_parser_and_not_within_text() -> None:
    assert nested_too_deep(b"[" * (DEEPEST + 1) + b"]" * (DEEPEST + 1))
    assert not nested_too_deep(b"[" * DEEPEST + b"]" * DEEPEST)
    assert not nested_too_deep(b'{"text":"' + b"[" * 500 + b'\\""}')


def test_a_check_of_a_robot_is_bounded_too() -> None:
    sample = '{"kind":"battery","seq":%d,"at_s":1.0,"source":"battery","charge":0.5}'
    newest = iter(range(1, 10**9))

    def endless(after: int, limit: int) -> object:
        body = ",".join(sample % next(newest) for _ in range(limit))
        with answering(Answer(body=f'{{"samples":[{body}],"next_seq":1,"at_s":1.0}}'.encode())) as robot:
            return robot.observations(after, limit)

    with raises_saying(ProviderFailed, match="do not end"):
        SampleLog(endless)  # type: ignore[arg-type]
    with raises_saying(ProviderUnreachable, match="no address of a robot"), addressed("http://[", "x"):
        pass


def test_time_passes_where_a_robots_clock_stands_or_runs_away() -> None:
    for reached_s in (0.0, 1e18):
        clock = LockstepClock(lambda until_s, reached_s=reached_s: reached_s, at_s=100.0)  # type: ignore[misc]
        clock.wait_until(101.0)
        assert clock.now().mission_s == 101.0

    def gone(until_s: float) -> float:
        raise ProviderFailed("no clock here")

    silent = LockstepClock(gone, at_s=100.0)
    silent.wait_until(102.0)
    assert silent.now().mission_s == 102.0
    readings = iter([5.0])
    follower = RobotClock(lambda: next(readings), speed=1.0)
    assert follower.now().mission_s >= 5.0
