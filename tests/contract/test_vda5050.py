"""A VDA 5050 vehicle as a robot: it passes the conformance kit, and whatever broker or vehicle do, nothing is doubled
and nothing is called done that was not.

The vehicle is docs/examples/vehicle.py, written from the specification alone; time is virtual.
"""

import itertools
import json
import math
from pathlib import Path
from typing import Any

import pytest

from app.i18n.reasons.rendering import sentence
from harness.adapters.providers.vda5050.orders import route_plan
from harness.conformance.kit import check
from harness.conformance.provider_setup import fresh_name
from harness.contracts.errors import ProviderFailed, ProviderUnreachable
from harness.contracts.observations import Odometry, Pose
from harness.contracts.protocol import InvocationReport
from tests.builders.vehicles import LATENCY_S, VirtualSite, conformance, example
from tests.saying import raises_saying


@pytest.fixture
def site(tmp_path: Path) -> VirtualSite:
    return VirtualSite(journal=tmp_path / "journal.jsonl")


def begun(site: VirtualSite, name: str = "one", *, driven_s: float = 2.0) -> InvocationReport:
    """A run that has been under way for some seconds."""
    report = site.provider.start(site.request(name))
    for _ in range(int(driven_s / 0.25)):
        site.advance(0.25)
        site.provider.keepalive(report.handle)
    return report


def x_m(site: VirtualSite) -> float:
    found: float = site.vehicle.x
    return found


@pytest.mark.parametrize("version", ["2.0", "2.1", "3.0"])
def test_the_example_vehicle_meets_every_row_of_the_kit(tmp_path: Path, version: str) -> None:
    site = VirtualSite(journal=tmp_path / "journal.jsonl", version=version)
    checked = check(site.under_test, conformance(), mission_id=fresh_name())
    assert not checked.rows("not met") and len(checked.rows("met")) == 22
    assert len(site.vehicle.driven) == len(set(site.vehicle.driven)), "no order was driven twice"


def test_no_more_of_the_way_is_released_than_the_next_metres(site: VirtualSite) -> None:
    report = site.run(site.provider.start(site.request(target=(6.0, 0.0))).handle)
    assert report.status == "succeeded" and math.dist((x_m(site), site.vehicle.y), (6.0, 0.0)) < 0.1
    first, *updates = site.orders()
    assert len(updates) > 5 and [one["orderUpdateId"] for one in updates] == list(range(1, len(updates) + 1))
    released = [max(n["nodePosition"]["x"] for n in one["nodes"] if n["released"]) for one in (first, *updates)]
    assert released[0] <= 1.5 + 0.51 and released[-1] == pytest.approx(6.0)
    assert all(later - earlier <= 0.51 for earlier, later in itertools.pairwise(released)), "node by node"
    for one in (first, *updates):
        assert [n["sequenceId"] for n in one["nodes"]] == list(
            range(one["nodes"][0]["sequenceId"], one["nodes"][-1]["sequenceId"] + 1, 2)
        )
        assert all(edge["maxSpeed"] == 0.6 for edge in one["edges"])


def test_the_last_node_is_the_target_to_the_bit_wherever_the_vehicle_stands(site: VirtualSite) -> None:
    """A proposed fact that names another target, be it by a rounding, is not the one that was asked for."""
    request = site.request(target=(2.0, 0.0))
    for number in range(200):
        plan = route_plan(request, here=(-0.004 + number * 4.1e-5, 0.005 - number * 2.3e-5), base_m=1.5)
        assert plan.points[-1] == (2.0, 0.0)


def test_a_vehicle_whose_harness_died_stops_at_the_end_of_its_base(site: VirtualSite) -> None:
    begun(site)
    there_m = x_m(site)
    site.down = lambda topic, body: []
    site.advance(15.0)
    assert site.vehicle.v == 0.0 and x_m(site) - there_m < 1.5 + 0.5, "nobody extended its base"


def test_an_odd_broker_that_delivers_everything_twice_doubles_nothing(site: VirtualSite) -> None:
    site.up = site.down = lambda topic, body: [(LATENCY_S, body), (0.3, body)]
    report = site.run(site.provider.start(site.request()).handle)
    assert report.status == "succeeded"
    assert len(site.vehicle.driven) == 1 and len(site.robot.starts()) == 1
    assert site.robot.vehicle.counts.repeated > 20
    samples = site.robot.observations(0).samples
    assert len({(type(one), one.at_s) for one in samples}) == len(samples)


def test_a_vehicle_that_still_names_its_last_node_of_the_order_before_has_not_passed_any(site: VirtualSite) -> None:
    """vda-5050-lib publishes its state with a new order's nodes before it looks at the first of them."""
    assert site.run(site.provider.start(site.request()).handle).status == "succeeded"
    before, left = (site.vehicle.last_node, site.vehicle.last_sequence), iter(range(1))

    def late(topic: str, body: bytes) -> list[tuple[float, bytes]]:
        state = json.loads(body)
        if topic == "state" and state["orderId"] != before_id and next(left, None) is not None:
            state |= {"lastNodeId": before[0], "lastNodeSequenceId": before[1]}
        return [(LATENCY_S, json.dumps(state).encode())]

    before_id = site.orders()[-1]["orderId"]
    site.up = late
    report = site.run(site.provider.start(site.request("two", target=(6.0, 0.0))).handle)
    assert next(left, None) is None and (report.status, report.failure) == ("succeeded", "")


def test_messages_that_overtake_each_other_change_nothing(site: VirtualSite) -> None:
    turn = itertools.cycle((0.01, 0.7, 0.05, 0.3))
    site.up = lambda topic, body: [(next(turn), body)]
    report = site.run(site.provider.start(site.request()).handle)
    assert report.status == "succeeded" and len(site.vehicle.driven) == 1
    assert site.robot.vehicle.counts.overtaken > 5
    poses = [one.at_s for one in site.robot.observations(0).samples if isinstance(one, Pose)]
    assert poses == sorted(poses)


def test_lost_messages_are_made_good_for_and_counted(site: VirtualSite) -> None:
    up, orders = itertools.count(), itertools.count()
    site.up = lambda topic, body: [] if next(up) % 4 == 0 else [(LATENCY_S, body)]

    def lose(topic: str, body: bytes) -> list[tuple[float, bytes]]:
        """Every second order message, the first one among them."""
        lost = topic == "order" and next(orders) % 2 == 0
        return [] if lost else [(LATENCY_S, body)]

    site.down = lose
    report = site.run(site.provider.start(site.request()).handle)
    assert report.status == "succeeded"
    assert len(site.vehicle.driven) == 1 and site.robot.vehicle.counts.lost > 5
    ids = [one["orderUpdateId"] for one in site.orders()]
    assert len(ids) > len(set(ids)), "an order that no state shows is sent again under the same ids"


def test_an_order_that_never_arrives_is_a_failure_and_no_start(site: VirtualSite) -> None:
    site.down = lambda topic, body: [] if topic == "order" else [(LATENCY_S, body)]
    report = site.run(site.provider.start(site.request()).handle)
    assert (report.status, report.failure) == ("failed", "order_not_taken")
    assert "was sent 3 times" in sentence(report.message) and not site.vehicle.driven and x_m(site) == 0.0


def test_an_order_that_arrives_after_it_was_given_up_is_cancelled(site: VirtualSite) -> None:
    site.down = lambda topic, body: [(9.0 if topic == "order" else LATENCY_S, body)]
    report = site.run(site.provider.start(site.request()).handle)
    assert report.failure == "order_not_taken"
    site.advance(10.0)
    assert len(site.vehicle.driven) == 1 and not site.vehicle.nodes and site.vehicle.v == 0.0
    assert x_m(site) < 1.0, "it was stopped at once"
    assert site.provider.report(report.handle) == report, "and the result stays what it was"


@pytest.mark.ask("VDA5050#511")
def test_a_refused_order_is_a_result_with_the_vehicles_own_reason_as_vda5050_511_asks(site: VirtualSite) -> None:
    site.vehicle.wrong_order = lambda order: ("noRouteError", "the gate is shut")
    report = site.run(site.provider.start(site.request()).handle)
    assert (report.status, report.failure) == ("failed", "order_rejected")
    assert "noRouteError: the gate is shut" in sentence(report.message) and x_m(site) == 0.0
    del site.vehicle.wrong_order
    assert site.run(site.provider.start(site.request("two")).handle).status == "succeeded", (
        "an old error refuses nothing"
    )


def test_a_refused_update_ends_the_run_at_a_standstill(site: VirtualSite) -> None:
    site.vehicle.wrong_update = lambda order: ("orderUpdateError", "not now")
    report = site.run(site.provider.start(site.request()).handle)
    assert (report.status, report.failure) == ("failed", "order_rejected")
    assert site.vehicle.v == 0.0 and not site.vehicle.nodes and "cancelOrder" in site.instant()


def test_a_late_copy_of_an_old_update_that_the_vehicle_refuses_ends_nothing(site: VirtualSite) -> None:
    report = begun(site)
    site.vehicle.receive("order", site.orders()[0])
    assert any(one["errorType"] == "orderUpdateError" for one in site.vehicle.errors)
    assert site.run(report.handle).status == "succeeded"


def test_an_order_that_the_vehicle_takes_by_half_is_cancelled_and_failed(site: VirtualSite) -> None:
    take = site.vehicle.take_order

    def by_half(order: dict[str, Any]) -> None:
        take(order | {"nodes": order["nodes"][:4], "edges": order["edges"][:3]})

    site.vehicle.take_order = by_half
    report = site.run(site.provider.start(site.request()).handle)
    assert (report.status, report.failure) == ("failed", "order_differs")
    assert site.vehicle.v == 0.0 and "cancelOrder" in site.instant()


def test_an_order_that_the_vehicle_drops_under_way_is_failed(site: VirtualSite) -> None:
    report = begun(site)
    site.vehicle.nodes, site.vehicle.edges = [], []
    ended = site.run(report.handle)
    assert (ended.status, ended.failure) == ("failed", "order_incomplete") and site.vehicle.v == 0.0


def test_after_its_last_will_nothing_is_known_until_the_vehicle_speaks_again(site: VirtualSite) -> None:
    report = begun(site)
    site.up = lambda topic, body: []
    will = site.vehicle.header("connection") | {"connectionState": "CONNECTIONBROKEN"}
    site.from_vehicle("connection", will, damaged=False)
    site.advance(0.5)
    with raises_saying(ProviderUnreachable, match="Acme/0001 is not connected to its broker .CONNECTIONBROKEN"):
        site.provider.report(report.handle)
    with pytest.raises(ProviderUnreachable):
        site.robot.status()
    site.up = lambda topic, body: [(LATENCY_S, body)]
    site.advance(1.5)
    assert site.provider.report(report.handle).status == "blocked", "it was paused meanwhile"
    site.provider.resume(report.handle)
    assert site.run(report.handle).status == "succeeded" and len(site.vehicle.driven) == 1


def test_a_vehicle_that_falls_silent_is_unknown_not_fine(site: VirtualSite) -> None:
    report = begun(site)
    site.alive = False
    site.advance(5.0)
    with raises_saying(ProviderUnreachable, match="Acme/0001 sends no state"):
        site.provider.report(report.handle)


def test_a_vehicle_that_starts_again_knows_nothing_and_the_next_run_works(site: VirtualSite) -> None:
    report = begun(site)
    x, y = site.vehicle.x, site.vehicle.y
    site.boot()
    site.vehicle.x, site.vehicle.y = x, y
    ended = site.run(report.handle)
    assert (ended.status, ended.failure) == ("failed", "vehicle_restarted") and not site.vehicle.driven
    assert site.run(site.provider.start(site.request("two")).handle).status == "succeeded"


def test_an_order_is_not_sent_again_to_a_vehicle_that_started_again_and_may_have_had_it(site: VirtualSite) -> None:
    site.up = lambda topic, body: []
    report = site.provider.start(site.request())
    site.advance(0.5)
    assert len(site.vehicle.driven) == 1, "it took the order, and nobody heard of it"
    site.boot()
    site.up = lambda topic, body: [(LATENCY_S, body)]
    ended = site.run(report.handle)
    assert (ended.status, ended.failure) == ("failed", "order_not_taken")
    assert not site.vehicle.driven and len(site.orders()) == 1


def test_a_vehicle_that_starts_again_with_an_old_clock_gives_no_evidence(site: VirtualSite) -> None:
    report = begun(site)
    known = site.robot.observations(0).samples
    site.offset_s = -7200.0
    site.boot()
    site.advance(3.0)
    with raises_saying(ProviderUnreachable, match=r"The clock of Acme/0001 jumped by -72\d\d s"):
        site.provider.report(report.handle)
    assert site.robot.vehicle.observations(0, 5000).samples == known, "nothing from another time became evidence"
    site.offset_s = 0.0
    site.advance(1.0)
    ended = site.run(report.handle)
    assert (ended.status, ended.failure) == ("failed", "vehicle_restarted")
    assert site.run(site.provider.start(site.request("two")).handle).status == "succeeded"


def test_another_vehicles_words_on_its_topics_are_nobodys(site: VirtualSite) -> None:
    report = begun(site)
    other = example().Vehicle(
        lambda name, message, retained: site.from_vehicle(name, message, damaged=False),
        lambda: site.now_s,
        serial="0002",
    )
    for _ in range(20):
        other.publish_state()
        site.advance(0.05)
        site.provider.keepalive(report.handle)
    assert site.robot.vehicle.counts.of_others >= 20
    assert site.run(report.handle).status == "succeeded"
    site.alive = False
    begun_s = site.now_s
    while site.robot.vehicle.trouble() is None and site.now_s < begun_s + 10.0:
        site.robot.status()
        other.publish_state()
        site.advance(0.5)
    with raises_saying(ProviderUnreachable, match="On the topics of Acme/0001 answers Acme/0002"):
        site.robot.status()


@pytest.mark.parametrize("mode", ["MANUAL", "SERVICE", "TEACHIN", "INTERVENED", "STARTUP"])
def test_only_a_vehicle_in_an_automatic_mode_gets_an_order(site: VirtualSite, mode: str) -> None:
    site.vehicle.mode = mode
    site.vehicle.publish_state()
    site.advance(0.2)
    with raises_saying(ProviderFailed, match=f"Its operating mode is {mode}"):
        site.provider.start(site.request())
    assert not site.orders() and not site.robot.starts()


def test_a_vehicle_that_somebody_takes_over_loses_its_run(site: VirtualSite) -> None:
    report = begun(site)
    site.vehicle.mode, site.vehicle.nodes, site.vehicle.edges = "MANUAL", [], []
    ended = site.run(report.handle)
    assert ended.status == "failed" and ended.failure in ("operating_mode", "order_incomplete")


def test_a_vehicle_that_somebody_moves_for_a_while_keeps_its_run(tmp_path: Path) -> None:
    site = VirtualSite(journal=tmp_path / "journal.jsonl", version="3.0")
    report = begun(site)
    site.vehicle.mode = "INTERVENED"
    seen = site.run(report.handle, within_s=5.0)
    assert seen.status == "running" and site.vehicle.v == 0.0
    site.vehicle.mode = "AUTOMATIC"
    assert site.run(report.handle).status == "succeeded" and len(site.vehicle.driven) == 1


def test_an_emergency_stop_and_a_fatal_error_end_the_run(tmp_path: Path) -> None:
    for number, (name, said) in enumerate((("emergency_stop", "emergency stop"), ("vehicle_error", "motor is hot"))):
        site = VirtualSite(journal=tmp_path / f"{number}.jsonl")
        report = begun(site)
        if name == "emergency_stop":
            site.vehicle.stop = "MANUAL"
        else:
            error = {"errorType": "motor", "errorLevel": "FATAL", "errorDescription": "the motor is hot"}
            site.vehicle.errors.append(error)
        site.vehicle.publish_state()
        ended = site.run(report.handle)
        assert (ended.status, ended.failure) == ("failed", name) and said in sentence(ended.message)
        assert site.vehicle.v == 0.0
        assert site.robot.status().hardware_stop is (name == "emergency_stop")
        with pytest.raises(ProviderFailed):
            site.provider.start(site.request("two"))


def test_poses_on_another_map_are_poses_on_another_map(site: VirtualSite) -> None:
    report = begun(site)
    site.vehicle.map_id = "hall-2"
    ended = site.run(report.handle, within_s=8.0)
    assert (ended.status, ended.failure) == ("failed", "other_map") and "distance_m" not in ended.declared
    newest = [one for one in site.robot.observations(0).samples if isinstance(one, Pose)][-1]
    assert newest.map_version == "vda5050:hall-2" and not site.robot.status().localised
    assert site.robot.status().map_version == ""
    assert not site.vehicle.nodes, "its order was cancelled"
    with raises_saying(ProviderFailed, match="on its map hall-2"):
        site.provider.start(site.request("two"))


def test_somebody_elses_order_is_named_and_left_alone(site: VirtualSite) -> None:
    report = begun(site)
    site.vehicle.order = "of-another-control"
    seen = site.run(report.handle, within_s=6.0)
    assert (seen.status, seen.failure) == ("failed", "order_replaced") and "of-another-control" in sentence(
        seen.message
    )
    assert "cancelOrder" not in site.instant(), "what is not ours is not cancelled"


def test_a_vehicle_with_another_order_is_not_begun_with(site: VirtualSite) -> None:
    begun(site)
    site.vehicle.order = "of-another-control"
    site.advance(0.2)
    other = VirtualSite()
    other.vehicle.nodes = [{"nodeId": "n", "sequenceId": 2, "released": False}]
    other.vehicle.order = "of-another-control"
    other.vehicle.publish_state()
    other.advance(0.2)
    with raises_saying(ProviderFailed, match="an order under way: of-another-control"):
        other.provider.start(other.request())
    assert not other.orders()


def test_a_vehicle_beside_its_route_is_not_sent_across_the_floor(site: VirtualSite) -> None:
    site.vehicle.y = 3.0
    site.advance(0.5)
    with raises_saying(ProviderFailed, match=r"stands 3.0\d m beside its route|stands 2.9\d m beside its route"):
        site.provider.start(site.request())
    assert not site.orders()


def test_a_stop_is_not_acknowledged_while_the_body_moves(site: VirtualSite) -> None:
    report = begun(site)
    towards = site.vehicle.towards
    site.vehicle.paused = False
    site.vehicle.act = lambda action: None
    site.vehicle.towards = lambda node: (0.3, 0.0)
    stopped = site.provider.stop(report.handle)
    for _ in range(16):
        assert stopped.status == "stopping"
        site.advance(0.25)
        stopped = site.provider.report(report.handle)
    assert site.instant().count("cancelOrder") >= 3, "asked again and again"
    del site.vehicle.act
    site.vehicle.towards = towards
    assert site.run(report.handle).status == "cancelled" and site.vehicle.v == 0.0


def test_a_vehicle_that_drops_its_order_and_rolls_on_is_not_stopped(site: VirtualSite) -> None:
    report = begun(site)
    tick = site.vehicle.tick

    def rolls(dt: float) -> None:
        tick(dt)
        site.vehicle.v = 0.2

    site.vehicle.tick = rolls
    site.provider.stop(report.handle)
    site.advance(6.0)
    assert not site.vehicle.nodes and site.provider.report(report.handle).status == "stopping"


def test_finished_elsewhere_is_declared_with_the_distance_that_the_vehicle_itself_reports(site: VirtualSite) -> None:
    report = begun(site)
    while site.vehicle.nodes:
        site.vehicle.pass_node(site.vehicle.nodes[0])
    ended = site.run(report.handle)
    assert ended.status == "succeeded", "the vehicle's own word"
    assert ended.declared["distance_m"] > 1.0, "and beside it the distance, which is what is tested"


def test_without_a_measured_velocity_nothing_shows_standstill_and_the_kit_says_so(tmp_path: Path) -> None:
    site = VirtualSite(journal=tmp_path / "journal.jsonl", velocity_measured=False)
    checked = check(site.under_test, conformance(), mission_id=fresh_name())
    assert {"acknowledged_stop", "dead_man", "deadline", "resume"} <= set(checked.rows("not met"))
    assert not any(isinstance(one, Odometry) for one in site.robot.observations(0).samples)
    assert "odometry" not in site.provider.card.evidence and site.provider.card.sources == ("localiser",)


def test_another_process_finds_its_run_held_and_goes_on_with_it(site: VirtualSite) -> None:
    report = begun(site)
    again = site.reconnected()
    site.advance(1.0)
    found = again.find(report.identity.request_id)
    assert found is not None and (found.status, found.failure) == ("blocked", "keepalive_lost")
    assert site.vehicle.v == 0.0 and again.start(site.request(deadline_s=1.0)).handle == report.handle
    again.resume(report.handle)
    assert site.run(report.handle).status == "succeeded"
    assert len(site.vehicle.driven) == 1 and len(site.robot.starts()) == 1


GARBAGE = (b"", b"[]", b"{", b"\xff\xfe", b'{"headerId": 1}', b"[" * 50_000, b"0" * (2 << 20), b'{"headerId": NaN}')


@pytest.mark.parametrize("topic", ["state", "visualization", "connection", "factsheet"])
def test_garbage_is_counted_and_changes_nothing(site: VirtualSite, topic: Any) -> None:
    before = site.robot.status()
    for body in GARBAGE:
        site.robot.vehicle.receive(topic, body)
    whole = site.vehicle.header(topic) | {"timestamp": "yesterday", "connectionState": "ONLINE"}
    site.robot.vehicle.receive(topic, json.dumps(whole).encode())
    assert site.robot.vehicle.counts.invalid == len(GARBAGE) + 1
    assert site.robot.status() == before
