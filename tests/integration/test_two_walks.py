"""The two walks of docs/explanation/architecture.md are what runs: each named function is entered, in that order."""

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest
from pydantic import SecretStr

from app.auth.commit_authority import authority
from app.background.signals import SignalBroker
from app.main import create_app
from app.scene.servers import Scenes
from app.settings import ConsoleSettings
from harness.bootstrap import open_harness
from harness.contracts.decisions import Accepted
from harness.contracts.ids import HandoffId, MissionId
from harness.projections.mission import Mission
from harness.runtime import Start
from harness.settings import HarnessSettings
from rsi_reviews.candidate_queries import selected
from rsi_reviews.deciders import DECIDERS
from tests.architecture.sources import ROOT
from tests.builders.accounts import quick_accounts
from tests.builders.consoles import OWNER, Stand
from tests.builders.entered import entered
from tests.builders.missions_run import OPERATOR, ROBOT

DOCUMENT = "docs/explanation/architecture.md"
APPROVAL = "One approval, from the form to the provider's start"
PACKET = "One evidence packet, from the provider's end to the commit"
MOST_HOPS = {APPROVAL: 12, PACKET: 16}
NAMED = re.compile(r"\[`([\w/]+\.py):([\w.]+)`\]\(([^)]+)\)")
FIELDS = ("cycle", "subject", "evidence", "key", "shown")
ONCE = {
    "harness/supervisor/handoffs.py:HandoffService.answer": 1,
    "harness/supervisor/dispatch.py:Dispatcher.prepare": 1,
    "harness/gate/handoffs.py:decide": 2,
    "harness/supervisor/approvals.py:clear_to_send": 1,
}
"""How often one approval prepares and decides: once to commit, and the handoff once more just before it is sent."""


@dataclass(frozen=True)
class Walk:
    """One walk as the document tells it: its numbered lines, and what it says about their number."""

    hops: tuple[str, ...]
    hops_told: int
    modules_told: int

    @property
    def named(self) -> list[str]:
        """`path.py:Qualified.name` of every linked function, in the order of the text."""
        return [f"{path}:{name}" for hop in self.hops for path, name, _ in NAMED.findall(hop)]

    @property
    def mentioned(self) -> set[str]:
        """Further functions of a line, without their module: private ones, and methods with their class."""
        plain = NAMED.sub("", "\n".join(self.hops))
        return {name for name in re.findall(r"`(\w+(?:\.\w+)*)`", plain) if name.startswith("_") or "." in name}


def walk(title: str) -> Walk:
    """The walk under this heading."""
    text = (ROOT / DOCUMENT).read_text(encoding="utf-8").partition(f"### {title}\n")[2].partition("\n#")[0]
    told = re.search(r"^(\d+) hops; (\d+) modules", text, re.MULTILINE)
    assert told is not None, title
    return Walk(tuple(re.findall(r"^\d+\. (.*)$", text, re.MULTILINE)), int(told[1]), int(told[2]))


def first_missing(named: Sequence[str], calls: Sequence[str]) -> str | None:
    """The first function that is not entered after those that are named before it; None if all are."""
    left = iter(calls)
    return next((name for name in named if name not in left), None)


def unentered(mentioned: set[str], calls: Sequence[str]) -> set[str]:
    """Functions that a line mentions without their module, and that no call entered."""
    names = {call.partition(":")[2] for call in calls}
    return {one for one in mentioned if not any(name == one or name.endswith(f".{one}") for name in names)}


@contextmanager
def console(folder: Path) -> Iterator[Stand]:
    """A console over a data folder, with the robot as a process of its own, in virtual time."""
    settings = ConsoleSettings(port=8000, robots=("vbot-1",), owner_token=SecretStr(OWNER), password_memory_kib=19456)
    accounts = quick_accounts(settings)
    chosen = HarnessSettings(data_folder=folder, speed=0, fidelity="kinematic")
    with open_harness(chosen, deciders=DECIDERS, authority=authority(accounts), select=selected) as harness:
        scenes = Scenes(harness.runtime)
        try:
            app = create_app(
                harness.runtime,
                settings,
                SignalBroker(),
                scenes,
                accounts=accounts,
                answer=harness.supervisor.answer,
                starts=harness.starts,
            )
            yield Stand(harness, app)
        finally:
            scenes.close()


def asked(stand: Stand) -> Mission:
    """A mission that waits for the approval of its first leg."""
    each = Start(actor=OPERATOR, robot_id=ROBOT, template="circuit", autonomy="approve_each_motion")
    assert isinstance(stand.harness.runtime.start(each), Accepted)
    return stand.harness.supervisor.run(stand.harness.runtime.missions()[0].mission_id)


def approved(stand: Stand, handoff_id: HandoffId) -> list[str]:
    """What was entered while the form of an approval was taken."""
    operator = stand.operator()
    page = operator.get(f"/handoffs/{handoff_id}").text
    form = {name: re.findall(rf'name="{name}"\s+value="([^"]*)"', page)[0] for name in FIELDS}
    with entered() as calls:
        answer = operator.post(
            f"/handoffs/{handoff_id}/decision", data={**form, "decision": "approve", "reason": "the way is clear"}
        )
    assert answer.status_code == 303
    return calls


def committed(stand: Stand, mission_id: MissionId) -> list[str]:
    """What was entered in the step that ended the approved leg, which must have committed it."""
    runtime, supervisor, clock = stand.harness.runtime, stand.harness.supervisor, stand.harness.clock
    leg = runtime.mission(mission_id).invocation
    assert leg is not None and leg.intent.moves
    while runtime.mission(mission_id).invocation is not None:
        with entered() as calls:
            wake_s = supervisor.step(mission_id)
        assert wake_s is not None
        clock.wait_until(wake_s)
    assert runtime.mission(mission_id).of(leg.intent.node_id).status == "committed"
    return calls


@pytest.mark.parametrize("title", [APPROVAL, PACKET])
def test_a_walk_is_short_enough_and_counts_itself_rightly(title: str) -> None:
    told = walk(title)
    assert len(told.hops) == told.hops_told <= MOST_HOPS[title]
    assert len({name.partition(":")[0] for name in told.named}) == told.modules_told


@pytest.mark.parametrize("title", [APPROVAL, PACKET])
def test_every_hop_begins_with_a_link_to_the_file_that_it_names(title: str) -> None:
    for hop in walk(title).hops:
        assert NAMED.match(hop), hop
        for path, _, link in NAMED.findall(hop):
            assert (ROOT / DOCUMENT).parent.joinpath(link).resolve() == ROOT / path


def test_an_approval_and_an_evidence_packet_go_the_way_that_is_described(tmp_path: Path) -> None:
    with console(tmp_path / "data") as stand:
        mission = asked(stand)
        assert mission.handoff_id is not None
        calls_of = {APPROVAL: approved(stand, mission.handoff_id), PACKET: committed(stand, mission.mission_id)}
    for title, calls in calls_of.items():
        told = walk(title)
        assert first_missing(told.named, calls) is None, title
        assert unentered(told.mentioned, calls) == set(), title
    assert {name: calls_of[APPROVAL].count(name) for name in ONCE} == ONCE


def test_a_hop_in_another_order_or_never_entered_is_found() -> None:
    calls = ["a.py:one", "b.py:Two.three", "a.py:one"]
    assert first_missing(["a.py:one", "b.py:Two.three"], calls) is None
    assert first_missing(["b.py:Two.three", "b.py:Two.three"], calls) == "b.py:Two.three"
    assert first_missing(["a.py:one", "c.py:four"], calls) == "c.py:four"
    assert unentered({"Two.three", "three", "_four"}, calls) == {"_four"}
