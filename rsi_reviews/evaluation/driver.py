"""Drives the arms without the harness: it calls providers itself to carry out the legs of a contract. The harness
cannot reach it (D36). The robot, its providers and the clock are the same as for the harness.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from harness.bootstrap import Harness
from harness.contracts import protocol
from harness.contracts.errors import ProviderFailed, ProviderUnreachable
from harness.contracts.ids import NodeId, request_id
from harness.contracts.observations import AnySample, Odometry, Pose
from harness.contracts.ports import Provider
from harness.contracts.tasks import Node, order
from harness.projections.mission import Mission, required_contract
from rsi_reviews.evaluation.rules import LegExecution, Rule, first_broken, of_this_request

POLL_S = 0.5
FIRST_S = 1.5
"""Every arm watches the robot this long before it moves: what it sees then is on record."""
PATIENCE_S = 20.0
LONGEST_S = 400.0
LOOK_S = 3.0
EVERYTHING = 1_000_000


@dataclass(frozen=True)
class Policy:
    """How an arm executes a leg, and what it accepts as done.

    `providers`: which provider to ask at each attempt, so their number is the number of attempts. `looks`: how often,
    over a leg, it observes again without moving before it moves again. `keeps_requests`: after a lost acknowledgement
    it asks by request id; without it the call is made again. `bound`: evidence counts for its own execution only.
    `asks`: a person is asked at the end; otherwise the mission has failed.
    """

    rules: tuple[Rule, ...]
    providers: tuple[str, ...]
    looks: int = 0
    deadlines: bool = False
    keeps_requests: bool = False
    settle_s: float = 0.0
    bound: bool = True
    asks: bool = False


@dataclass
class ArmRecord:
    """What an arm did and claimed, for the adjudicator and the measures."""

    claims: list[dict[str, Any]] = field(default_factory=list)
    rejections: list[dict[str, Any]] = field(default_factory=list)
    declared: bool = False
    status: str = "failed"
    spent: int = 0
    handoffs: int = 0
    reason: str = ""

    def give_up(self, reason: str, *, asks: bool) -> None:
        """The mission ends without success: with a person's question, or failed."""
        self.status, self.reason = ("awaiting_human" if asks else "failed"), reason
        self.handoffs = int(asks)


class Robotics:
    """The robot as an arm's driver sees it: providers by name, everything published so far, and time."""

    def __init__(self, harness: Harness, mission: Mission) -> None:
        self.mission = mission
        self.clock = harness.clock
        self._robot = harness.robots[mission.robot_id]
        self.providers: dict[str, Provider] = {p.card.provider_id: p for p in self._robot.providers()}
        self.poses: list[Pose] = []
        self.odometry: list[Odometry] = []
        self._after = 0
        self._token = 0

    @property
    def now_s(self) -> float:
        return self.clock.now().mission_s

    def wait(self, for_s: float = POLL_S) -> None:
        """Let mission time pass, and read what was published meanwhile."""
        self.clock.wait_until(self.now_s + for_s)
        batch: Sequence[AnySample] = self._robot.observations(self._after, EVERYTHING).samples
        self.poses += [one for one in batch if isinstance(one, Pose)]
        self.odometry += [one for one in batch if isinstance(one, Odometry)]
        self._after = max((one.seq for one in batch), default=self._after)

    def request(
        self, node: Node, *, attempt: int, provider: Provider, parameters: protocol.Parameters
    ) -> protocol.StartRequest:
        """A request for one attempt of a node; every request takes a fencing token above the last."""
        self._token += 1
        card = provider.card
        return protocol.StartRequest(
            identity=protocol.InvocationIdentity(
                mission_id=self.mission.mission_id,
                node_id=node.node_id,
                attempt=attempt,
                request_id=request_id(self.mission.mission_id, node.node_id, attempt),
                provider_id=card.provider_id,
            ),
            capability=card.capability,
            parameters=parameters,
            k_ctx=0,
            configuration=self.mission.configuration,
            deadline_s=self.now_s + node.timeout_s,
            fencing=dict.fromkeys(card.resources, self._token),
        )


def legs(mission: Mission) -> Iterator[Node]:
    """The navigating nodes of a contract in their order."""
    contract = required_contract(mission)
    yield from (node for name in order(contract) if "navigate" in (node := contract.node(name)).capabilities)


def parameters_of(node: Node, *, attempt: int) -> protocol.Parameters:
    """The goal that the harness would also send to a provider for this attempt of a leg."""
    return {**node.parameters, **({"replan": True} if attempt > 1 else {})}


class Driver:
    """Walks a contract under one policy."""

    def __init__(self, robotics: Robotics, policy: Policy) -> None:
        self._robot = robotics
        self._policy = policy
        self.diary = ArmRecord()
        self._attempts: dict[NodeId, int] = {}

    def run(self) -> ArmRecord:
        """Leg after leg until all are claimed or one is given up."""
        self._robot.wait(FIRST_S)
        for node in legs(self._robot.mission):
            if why := self._leg(node):
                self.diary.give_up(f"{node.node_id}: {why}", asks=self._policy.asks)
                return self.diary
        self.diary.declared, self.diary.status = True, "succeeded"
        return self.diary

    def _leg(self, node: Node) -> str:
        """Attempts and looks until the leg is claimed; otherwise the reason of the last rejection."""
        since_s, looks = self._robot.now_s, self._policy.looks
        why = "no attempt was allowed"
        for number, name in enumerate(self._policy.providers):
            self.diary.spent += number > 0
            execution = self._attempt(node, name, since_s=since_s)
            if execution is None:
                why = "the provider did not take the request"
                continue
            why = self._judged(execution)
            while why and looks and execution.report.status == "succeeded":
                looks -= 1
                self.diary.spent += 1
                execution = self._looked(execution)
                why = self._judged(execution)
            if not why:
                break
        return why

    def _attempt(self, node: Node, name: str, *, since_s: float) -> LegExecution | None:
        provider, number = self._robot.providers[name], self._next(node)
        dispatched_s = self._robot.now_s
        request = self._robot.request(
            node, attempt=number, provider=provider, parameters=parameters_of(node, attempt=number)
        )
        start = self._started(provider, request, node)
        if start is None:
            return None
        request, first = start
        report = self._watch(provider, first, node, dispatched_s)
        self._robot.wait(max(self._policy.settle_s, POLL_S))
        return LegExecution(
            node=node,
            request_id=request.identity.request_id,
            report=report,
            dispatched_s=dispatched_s,
            since_s=since_s,
            now_s=self._robot.now_s,
            poses=self._robot.poses,
            odometry=self._robot.odometry,
            bound=self._policy.bound,
        )

    def _started(
        self, provider: Provider, request: protocol.StartRequest, node: Node
    ) -> tuple[protocol.StartRequest, protocol.InvocationReport] | None:
        """The request that was taken, and the first report on it.

        A lost acknowledgement is asked after, or the call is made again until patience ends.
        """
        until_s = self._robot.now_s + PATIENCE_S
        while True:
            try:
                return request, provider.start(request)
            except ProviderUnreachable:
                if self._policy.keeps_requests and (known := provider.find(request.identity.request_id)) is not None:
                    return request, known
            except ProviderFailed:
                pass
            if self._robot.now_s > until_s:
                return None
            self._robot.wait()
            if not self._policy.keeps_requests:
                request = self._robot.request(
                    node, attempt=self._next(node), provider=provider, parameters=request.parameters
                )

    def _watch(
        self, provider: Provider, report: protocol.InvocationReport, node: Node, dispatched_s: float
    ) -> protocol.InvocationReport:
        """Keeps the execution alive until it ends; past a deadline, where there is one, it is stopped.

        An arm that binds reports to requests takes no notice of a report on another one.
        """
        limit_s = dispatched_s + (node.timeout_s if self._policy.deadlines else LONGEST_S)
        handle, own = report.handle, report.identity.request_id
        binds = of_this_request in self._policy.rules
        while report.status not in protocol.TERMINAL or (binds and report.identity.request_id != own):
            if self._robot.now_s > limit_s:
                provider.stop(handle)
            provider.keepalive(handle)
            self._robot.wait()
            report = provider.report(handle)
        return report

    def _looked(self, before: LegExecution) -> LegExecution:
        """Look again without moving: the observer watches for LOOK_S."""
        node, observer = before.node, self._robot.providers["observer"]
        request = self._robot.request(
            node, attempt=self._next(node), provider=observer, parameters={"duration_s": LOOK_S, "frames": 0.0}
        )
        handle = observer.start(request).handle
        while observer.report(handle).status not in protocol.TERMINAL:
            self._robot.wait()
        return replace(before, now_s=self._robot.now_s)

    def _judged(self, execution: LegExecution) -> str:
        """Claim or reject by the arm's own rules; returns the reason, or empty for a claim."""
        why = first_broken(self._policy.rules, execution)
        facts = {
            "node_id": execution.node.node_id,
            "at_s": execution.now_s,
            "requests": [execution.report.identity.request_id],
        }
        if why:
            finished = execution.report.status == "succeeded"
            self.diary.rejections.append({**facts, "why": why, "finished": finished})
        else:
            self.diary.claims.append({**facts, "act": "robot"})
        return why

    def _next(self, node: Node) -> int:
        self._attempts[node.node_id] = self._attempts.get(node.node_id, 0) + 1
        return self._attempts[node.node_id]
