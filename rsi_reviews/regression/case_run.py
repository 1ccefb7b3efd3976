"""Runs one regression case on the real harness in virtual time, and reports what was recorded and what was true."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Literal

import msgspec

from harness.bootstrap import Harness, simulated
from harness.contracts import ids
from harness.contracts.actors import Actor
from harness.contracts.any_events import AnyEvent
from harness.contracts.commands import AcquireLease, ClearVeto, RaiseVeto, ReleaseLease
from harness.contracts.configuration import Configuration
from harness.contracts.decisions import Refused
from harness.contracts.errors import HarnessError
from harness.contracts.protocol import PhysicalStart
from harness.contracts.reasons import because
from harness.contracts.simulation import Simulator
from harness.contracts.stored_commands import without_command
from harness.contracts.tasks import TaskContract
from harness.contracts.values import Value
from harness.projections.mission import Mission
from harness.runtime import Start
from harness.settings import HarnessSettings
from rsi_reviews.evaluation.story import routes_of, story_of
from rsi_reviews.regression.cases import Case, Outside, Situation

ROBOT = ids.RobotId("vbot-1")
ASKING = Actor(name="regression", role="operator")
BASE = ids.leased(ROBOT, ids.ResourceId("mobile_base"))
ELSEWHERE = ids.MissionId("mis_of_somebody_else")
FOREIGN = ids.InvocationId("inv_of_somebody_else")
LAYER = "regression"
MOST_STEPS = 8000
LONGEST_S = 3600.0
EVERYTHING = 1_000_000
_DECODER: msgspec.json.Decoder[AnyEvent] = msgspec.json.Decoder(AnyEvent)


class LoggedEvent(Value):
    """One event of the log, of any stream, in order. `body` is its canonical JSON."""

    stream: ids.StreamId
    kind: str
    mission_s: float
    body: bytes

    @property
    def event(self) -> AnyEvent:
        return _DECODER.decode(self.body)


@dataclass(frozen=True)
class MissionAccount:
    """Everything a judge may need to know about one mission. `cut`: it had not ended after MOST_STEPS or LONGEST_S.

    `yardstick`: the contract that H_0 compiles for it. `story`: what was claimed and what was true, as the adjudicator
    reads it, with the yardstick's routes.
    """

    case: Case
    configuration: ids.Digest
    mission: Mission
    yardstick: TaskContract
    log: tuple[LoggedEvent, ...]
    starts: tuple[PhysicalStart, ...]
    story: Mapping[str, Any]
    begun_s: float
    ended_s: float
    cut: bool


def conducted(case: Case, configuration: Configuration, simulator: Simulator) -> MissionAccount:
    """Run the case under a configuration until it ends, waits for a person, or is cut.

    Raises HarnessError where the case itself is wrong: an unknown template, fault or site.
    """
    with _opened(case, configuration, simulator) as harness:
        mission_id = begin_mission(harness, case.situation, case.seed)
        begun_s = harness.clock.now().mission_s
        cut = stepped(harness, mission_id, case.situation.outside)
        reference = yardstick(case.situation, simulator)
        return account_of(harness, mission_id, case, yardstick=reference, begun_s=begun_s, cut=cut)


@contextmanager
def _opened(case: Case, configuration: Configuration | None, simulator: Simulator) -> Iterator[Harness]:
    settings = HarnessSettings(speed=0, fidelity="kinematic", robot_id=ROBOT)
    site = case.situation.site
    with simulated(settings, simulator=simulator, seed=case.seed, configuration=configuration, hidden=site) as harness:
        yield harness


@lru_cache(maxsize=64)
def yardstick(situation: Situation, simulator: Simulator) -> TaskContract:
    """The contract that H_0 compiles for a situation: what was asked, whatever a candidate's template says (D30)."""
    with _opened(Case(situation=situation, seed=0), None, simulator) as harness:
        return _contract(harness.runtime.mission(begin_mission(harness, situation, 0)))


def begin_mission(harness: Harness, situation: Situation, seed: int) -> ids.MissionId:
    """Create the mission of a situation; the next steps run it. Raises HarnessError if it cannot be created."""
    labels = {"faults": ",".join(situation.faults)} if situation.faults else {}
    start = Start(actor=ASKING, robot_id=ROBOT, template=situation.template, seed=seed, labels=labels)
    decision = harness.runtime.start(start)
    if isinstance(decision, Refused):
        raise HarnessError(because("case_refused", template=situation.template, reason=decision.reason))
    return harness.runtime.missions()[0].mission_id


def stepped(harness: Harness, mission_id: ids.MissionId, outside: Sequence[Outside]) -> bool:
    """Step until nothing more happens by itself; True if that took too long."""
    begun_s = harness.clock.now().mission_s
    due = _acts(outside, begun_s)
    for _ in range(MOST_STEPS):
        now_s = harness.clock.now().mission_s
        while due and due[0][0] <= now_s:
            _, name, act = due.pop(0)
            _do(harness, mission_id, name, act, until_s=begun_s + act.at_s + act.for_s)
        wake_s = harness.supervisor.step(mission_id)
        if wake_s is None:
            return False
        if wake_s - begun_s > LONGEST_S:
            return True
        harness.clock.wait_until(wake_s)
    return True


Edge = Literal["begins", "ends"]


def _acts(outside: Sequence[Outside], begun_s: float) -> list[tuple[float, Edge, Outside]]:
    edges: list[tuple[float, Edge, Outside]] = []
    for one in outside:
        edges += [(begun_s + one.at_s, "begins", one), (begun_s + one.at_s + one.for_s, "ends", one)]
    return sorted(edges, key=lambda edge: edge[0])


def _do(harness: Harness, mission_id: ids.MissionId, edge: Edge, act: Outside, *, until_s: float) -> None:
    """The beginning or end of one outside act. What the gate refuses (the base is already leased) has no effect."""
    runtime = harness.runtime
    if act.kind == "veto":
        veto = RaiseVeto(layer=LAYER, reason="somebody is in the way")
        runtime.submit(mission_id, veto if edge == "begins" else ClearVeto(layer=LAYER, reason="the way is free"))
        return
    token = runtime.lease(BASE).token + 1
    take = AcquireLease(
        resource=BASE, mission_id=ELSEWHERE, invocation_id=FOREIGN, token=token, expires_s=until_s + 10.0
    )
    give = ReleaseLease(invocation_id=FOREIGN, reason="done")
    runtime.decide([(ids.lease_stream(BASE), take if edge == "begins" else give)])


def account_of(
    harness: Harness,
    mission_id: ids.MissionId,
    case: Case,
    *,
    yardstick: TaskContract,
    begun_s: float,
    cut: bool,
    after: int = 0,
) -> MissionAccount:
    """The account of a mission that has ended or waits. `after`: the log's position before it was created.

    `yardstick` as in `MissionAccount`.
    """
    runtime = harness.runtime
    mission = runtime.mission(mission_id)
    log = tuple(
        LoggedEvent(stream=one.stream, kind=one.kind, mission_s=one.mission_s, body=without_command(one.body))
        for one in runtime.log(after, limit=EVERYTHING)
    )
    return MissionAccount(
        case=case,
        configuration=mission.configuration,
        mission=mission,
        yardstick=yardstick,
        log=log,
        starts=harness.starts(mission_id),
        story={**story_of(harness, mission), **routes_of(yardstick)},
        begun_s=begun_s,
        ended_s=harness.clock.now().mission_s,
        cut=cut,
    )


def _contract(mission: Mission) -> TaskContract:
    if mission.contract is None:
        raise HarnessError(because("case_without_contract"), where=mission.mission_id)
    return mission.contract
