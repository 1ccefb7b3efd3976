"""One instant for a whole page: which event it stands at, what is drawn up to it, what is measured there."""

from itertools import pairwise
from math import cos, pi, sin

import pytest

from app.views.cursor import TimeCursor, cursor_of
from app.views.frames import frames
from app.views.list_params import ListParams, address, paging
from app.views.plots import MeasuredPosition, Readings, at_cursor, plots
from app.views.timeline import AROUND, Axis, TimelineEntry, around, timeline
from harness.baseline.load import baseline, site
from harness.contracts.actors import Actor
from harness.contracts.events import FailureClassified, MissionActivated, MissionCreated, MissionEvent
from harness.contracts.ids import Digest, MissionId, NodeId, RobotId
from harness.contracts.read_models import MANY, Bookmark, ListQuery
from harness.contracts.tasks import TaskContract
from harness.planning.compile import compile_contract
from harness.planning.templates import by_name

BEGIN_S = 1000.0


def entry(position: int, at_s: float, event: MissionEvent | None = None) -> TimelineEntry:
    told = event or MissionActivated()
    return TimelineEntry(
        position=position,
        version=position,
        kind=type(told).__name__,
        mission_s=BEGIN_S + at_s,
        recorded_s=0.0,
        previous="",
        digest="",
        event=told,
    )


def created() -> MissionCreated:
    return MissionCreated(
        mission_id=MissionId("m1"),
        robot_id=RobotId("vbot-1"),
        goal="look",
        template="circuit",
        requested_by=Actor(name="ada", role="operator"),
        configuration=Digest("ab" * 32),
        seed=1,
    )


HISTORY = (entry(10, 0.0, created()), entry(12, 0.0), entry(15, 4.0), entry(20, 10.0))


def at(at_event: int | None = None, t: float | None = None, now_s: float = 0.0) -> TimeCursor:
    return cursor_of(HISTORY, at=at_event, t=t, now_s=now_s)


@pytest.mark.parametrize(
    ("event", "position", "place", "elapsed_s"),
    [(10, 10, 1, 0.0), (15, 15, 3, 4.0), (17, 15, 3, 4.0), (20, 20, 4, 10.0), (99, 20, 4, 10.0), (1, 10, 1, 0.0)],
)
def test_an_instant_named_by_an_event_is_that_events(event: int, position: int, place: int, elapsed_s: float) -> None:
    found = at(event)
    assert (found.position, found.place, found.elapsed_s) == (position, place, elapsed_s)
    assert found.param == f"at={event}"


@pytest.mark.parametrize(
    ("second", "position", "place", "elapsed_s"),
    [(0.0, 12, 2, 0.0), (3.5, 12, 2, 3.5), (4.0, 15, 3, 4.0), (7.25, 15, 3, 7.25), (99.0, 20, 4, 10.0)],
)
def test_an_instant_named_by_a_second_stands_at_the_newest_event_before_it(
    second: float, position: int, place: int, elapsed_s: float
) -> None:
    found = at(t=second)
    assert (found.position, found.place, found.elapsed_s) == (position, place, elapsed_s)
    assert found.param == f"t={second:g}"


def test_without_an_instant_the_page_follows_the_head_which_is_now_while_the_mission_runs() -> None:
    found = at(now_s=BEGIN_S + 40.0)
    assert (found.position, found.param, found.total_s, found.left) == (None, "", 40.0, 99.0)
    assert at(20, now_s=BEGIN_S + 40.0).left == 24.75


def test_an_event_wins_over_a_second() -> None:
    assert at(15, t=9.0).position == 15


def test_the_axis_has_room_for_the_newest_event_and_a_mission_of_no_length() -> None:
    assert at(t=5.0).left == 49.5
    assert cursor_of(HISTORY[:1], at=None, t=None, now_s=0.0).left == 0.0


def test_ticks_that_would_cover_each_other_are_one_and_the_louder_one_stays() -> None:
    failed = FailureClassified(node_id=NodeId("go"), invocation_id=None, failure="timeout", reason="", at_s=0.0)
    crowd = tuple(entry(n, n / 100, failed) for n in range(1, 200))
    history = (entry(0, 0.0, created()), *crowd, entry(900, 1000.0))
    axis = Axis(left_of=cursor_of(history, at=None, t=None, now_s=0.0).left_of)
    drawn = timeline("m1", history, axis=axis, at_s=BEGIN_S, node="")
    recovery = next(lane for lane in drawn.lanes if lane.title == "recovery C4")
    assert len(recovery.ticks) == 1
    assert recovery.ticks[0].tone == "warn"
    assert len(drawn.marks.split()) == len(history)
    assert drawn.marks.split()[-1] == "900@1000.000"


def test_a_long_history_shows_the_events_around_the_reader() -> None:
    history = tuple(entry(n, float(n)) for n in range(1, 1000))
    shown = around(history, place=500)
    assert [one.position for one in shown] == list(range(500 - AROUND + 1, 500 + AROUND + 1))
    assert around(history, place=999)[-1].position == 999
    assert around(history, place=1)[0].position == 1


@pytest.fixture(scope="module")
def circuit() -> TaskContract:
    template = by_name("circuit", baseline().templates)
    return compile_contract(goal=template.goal, template=template, arguments={}, site=site())


def plot(contract: TaskContract, readings: Readings, name: str, t: float) -> tuple[str, int]:
    """(value at the cursor, number of lines) of one plot."""
    cursor = cursor_of(HISTORY, at=None, t=t, now_s=0.0)
    found = next(one for one in plots(contract, HISTORY, readings, cursor) if one.quantity.name == name)
    return found.value, len(found.lines)


def test_progress_on_a_circuit_begins_at_nothing_although_it_begins_at_its_goal(circuit: TaskContract) -> None:
    route = next(one.waypoints_m for one in site().routes if one.name == "circuit")
    node = next(node.node_id for node in circuit.nodes if "navigate" in node.capabilities)
    walked = [(x0 + (x1 - x0) * k / 20, y0 + (y1 - y0) * k / 20)
              for (x0, y0), (x1, y1) in pairwise(route) for k in range(20)]  # fmt: skip
    spots = tuple(MeasuredPosition(BEGIN_S + n / 20, x, y, node) for n, (x, y) in enumerate(walked))
    readings = Readings(spots=spots)
    assert plot(circuit, readings, "progress", 0.0)[0] == "0.00 %"
    assert 40 < float(plot(circuit, readings, "progress", 5.0)[0].split()[0]) < 60
    assert float(plot(circuit, readings, "progress", 10.0)[0].split()[0]) > 98


def test_a_body_that_turns_round_in_place_covers_no_route(circuit: TaskContract) -> None:
    node = next(node.node_id for node in circuit.nodes if "navigate" in node.capabilities)
    spots = tuple(
        MeasuredPosition(BEGIN_S + n / 10, 0.05 * cos(n * pi / 8), 0.05 * sin(n * pi / 8), node) for n in range(100)
    )
    assert float(plot(circuit, Readings(spots=spots), "progress", 10.0)[0].split()[0]) < 2


def test_a_line_breaks_where_nothing_was_measured(circuit: TaskContract) -> None:
    speed = (*((BEGIN_S + n / 10, 0.4) for n in range(20)), *((BEGIN_S + 8 + n / 10, 0.2) for n in range(20)))
    assert plot(circuit, Readings(speed=speed), "speed", 9.0) == ("0.20 m/s", 2)
    slow = tuple((BEGIN_S + 3.0 * n, 0.9 - n / 100) for n in range(4))
    assert plot(circuit, Readings(charge=slow), "charge", 10.0)[1] == 1


def test_a_plot_without_readings_says_so_and_keeps_its_place(circuit: TaskContract) -> None:
    cursor = cursor_of(HISTORY, at=None, t=None, now_s=0.0)
    drawn = plots(circuit, HISTORY, Readings(), cursor)
    assert [one.quantity.name for one in drawn] == ["speed", "distance", "progress", "charge", "spent"]
    assert drawn[0].blank == "no odometry reading yet"
    assert [one.quantity.name for one in plots(None, HISTORY, Readings(), cursor)] == [
        one.quantity.name for one in drawn
    ]


def test_a_series_has_no_value_before_its_first_reading() -> None:
    assert at_cursor([(5.0, 1.0), (6.0, 2.0)], 4.9) is None
    assert at_cursor([(5.0, 1.0), (6.0, 2.0)], 5.9) == 1.0


def test_a_mission_without_frames_shows_none() -> None:
    assert frames(HISTORY, at_s=BEGIN_S + 9).newest is None


def test_addresses_keep_what_was_asked_and_quote_what_was_typed() -> None:
    assert address("/missions", {"q": "a b&c=ä", "status": ""}, order="oldest") == (
        "/missions?q=a%20b%26c%3D%C3%A4&order=oldest"
    )
    assert address("/missions", {"q": "x"}, q="") == "/missions"


def test_a_list_says_how_far_it_counted() -> None:
    query = ListQuery(listing="mission", after=Bookmark(amount=1.5, seq=9))
    params = ListParams(query=query, words="", given={}, deep=True)
    page = paging("/missions", params, query, count=50, found=MANY + 1)
    assert page.found == "more than 1 000"
    assert page.following == "/missions?after=1.5~9"
    assert page.first == "/missions"
