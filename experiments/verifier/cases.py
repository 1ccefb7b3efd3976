"""Builds what a verifier is shown in one case, and has it judged by the shipped compiler, verifier and gate rules."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

from msgspec.structs import replace

from harness.baseline.load import baseline, site
from harness.contexts.verifier import goal_context, verifier_context
from harness.contexts.view import StateView
from harness.contracts import ids
from harness.contracts.actors import Actor
from harness.contracts.capabilities import CapabilityCard
from harness.contracts.effects import AnyEffect, Condition, Symbolic
from harness.contracts.errors import ContextOverflow
from harness.contracts.events import DispatchIntended
from harness.contracts.evidence import CommittedFact, EvidencePacket, PacketIdentity
from harness.contracts.protocol import PROTOCOL, ProposedFact
from harness.contracts.reasons import SEVERAL, Explanation, Reason
from harness.contracts.rules import CURRENT_RULES
from harness.contracts.tasks import Constraints, EvidencePolicy, Goal, Node, RecoveryLimits, TaskContract
from harness.contracts.verdicts import GoalVerdict, NodeVerdict
from harness.gate.rules import BY_RESULT, GATE_RULES, first_broken
from harness.projections.mission import Invocation, Mission, NodeState
from harness.verification.verdict import Verifier, judged, verify, verify_goal

MISSION = ids.MissionId("verifier-campaign")
CONFIGURATION = ids.Digest("c" * 64)
GOAL_TEXT = "Help me go and check the office storage area"
LIMITS = RecoveryLimits(re_perceive=2, adjust_view=2, retry=1, local_replan=2, switch_skill=1, total=4)
ROBOT = "robot vbot-1"
ORIGINS = {
    **dict.fromkeys(("localiser", "odometry", "imu", "lidar", "camera", "battery", "joints"), ROBOT),
    **dict.fromkeys(("route-follower", "careful-local-planner", "panorama-camera", "observer"), ROBOT),
    **dict.fromkeys(
        ("text-intake", "opencv-analysis", "message-outbox", "espeak-voice", "evidence-keeper", "opencv-description"),
        "harness",
    ),
}
"""As `assembly` names them for one simulated robot, with the providers beside the harness in its own process."""
STAGE = ids.NodeId("stage")
K = 3
PACKET_RULES = tuple(rule for rule in GATE_RULES[CURRENT_RULES] if rule not in BY_RESULT)
"""The gate's rules on the packet as a whole; what its single conditions need is in their results already."""
Blobs = Mapping[ids.Digest, bytes]


@dataclass(frozen=True, eq=False)
class CaseInputs:
    """A state of the harness with the packet to judge, or of the goal without one, and the bytes that it cites."""

    view: StateView
    blobs: Blobs
    packet: EvidencePacket | None = None
    card: CapabilityCard | None = None


@dataclass(frozen=True)
class VerifierCase:
    """One condition in one case. `true`: whether it holds in the simulated world; None where the truth lies so near to
    the condition's bound that the sensors cannot tell.

    `epistemic`: what was done to the evidence is the same for every source that the harness has.
    """

    predicate: str
    fault: str
    true: bool | None
    shown: CaseInputs
    condition_id: ids.ConditionId
    epistemic: bool = False


@dataclass(frozen=True)
class CaseAnswer:
    """What became of the condition: a verdict, or refused by a rule of the gate; and the codes of the reason."""

    verdict: str
    codes: tuple[str, ...]

    @property
    def satisfied(self) -> bool:
        return self.verdict == "satisfied"


@dataclass
class CaseJudge:
    """Judges cases; those that share what is shown are judged once."""

    verifier: Verifier = verify
    _shown: CaseInputs | None = field(default=None, repr=False)
    _verdict: NodeVerdict | GoalVerdict | None = field(default=None, repr=False)
    _broken: tuple[str, Reason] | None = field(default=None, repr=False)
    _overflow: bool = False

    def answer(self, case: VerifierCase) -> CaseAnswer:
        """The harness's answer on this case's condition."""
        if case.shown is not self._shown:
            self._judge(case.shown)
        if self._overflow or self._verdict is None:
            return CaseAnswer("ambiguous", ("context_overflow",))
        result = next(one for one in self._verdict.results if one.condition_id == case.condition_id)
        if result.verdict == "satisfied" and self._broken is not None:
            return CaseAnswer("refused by the gate", (self._broken[0],))
        return CaseAnswer(result.verdict, codes_of(result.reason))

    def _judge(self, inputs: CaseInputs) -> None:
        self._shown, self._verdict, self._broken, self._overflow = inputs, None, None, False
        blobs = inputs.blobs.__getitem__
        try:
            if inputs.packet is None or inputs.card is None:
                self._verdict = verify_goal(goal_context(inputs.view), blobs)
                return
            context = verifier_context(inputs.view, inputs.packet, inputs.card)
        except ContextOverflow:
            self._overflow = True
            return
        self._verdict = judged(context, blobs, verifier=self.verifier)
        self._broken = first_broken(PACKET_RULES, inputs.view.mission, inputs.packet, self._verdict)


def codes_of(reason: Explanation) -> tuple[str, ...]:
    """The codes of a reason: of several, each of them."""
    if isinstance(reason, str):
        return (reason,)
    if reason.code == SEVERAL:
        listed = reason.facts["reasons"]
        return tuple(code for one in (listed if isinstance(listed, tuple) else ()) for code in codes_of(one))
    return (reason.code,)


def goal_of(text: str = GOAL_TEXT) -> Goal:
    """A goal with the digest of its text."""
    return Goal(text=text, digest=ids.sha256(text.encode()))


def condition(effect: AnyEffect, *, of: str = STAGE) -> Condition:
    """A condition named after its stage and predicate."""
    name = ids.ConditionId(f"{of}.{effect.predicate}")
    return Condition(condition_id=name, text=f"The test {effect.predicate} holds", effect=effect)


def condition_id_of(effect: AnyEffect, of: str = STAGE) -> ids.ConditionId:
    """The id of the condition with this effect."""
    return condition(effect, of=of).condition_id


def fact(name: str, node_id: str, arguments: Mapping[str, Any], **changes: Any) -> CommittedFact:
    """An accepted fact of an earlier stage, at level 2."""
    made = CommittedFact(
        name=name,
        kind="event",
        node_id=ids.NodeId(node_id),
        condition_id=ids.ConditionId(f"{node_id}.{name}"),
        packet_id=ids.packet_id(ids.InvocationId(node_id)),
        k=K,
        at_s=0.0,
        arguments=dict(arguments),
        measured={},
        independence=2,
    )
    return replace(made, **changes)


def stage(
    *effects: AnyEffect, node_id: ids.NodeId = STAGE, depends_on: Sequence[str] = (), mandatory: Sequence[str] = ()
) -> Node:
    """One stage of medium risk with these effects as its conditions."""
    return Node(
        node_id=node_id,
        subgoal=f"Do {node_id}",
        success_conditions=tuple(condition(one, of=node_id) for one in effects),
        capabilities=("observe",),
        parameters={},
        resources=(),
        evidence=EvidencePolicy(mandatory=tuple(mandatory)),
        timeout_s=600.0,
        recovery=LIMITS,
        depends_on=tuple(ids.NodeId(one) for one in depends_on),
        risk="medium",
    )


def identity_of(card: CapabilityCard | None, node_id: ids.NodeId = STAGE, attempt: int = 1) -> PacketIdentity:
    """The identity of a stage's packet as a correct provider echoes it."""
    request = ids.request_id(MISSION, node_id, attempt)
    invocation = ids.invocation_id(request)
    return PacketIdentity(
        mission_id=MISSION,
        node_id=node_id,
        attempt=attempt,
        request_id=request,
        invocation_id=invocation,
        packet_id=ids.packet_id(invocation),
        provider_id=card.provider_id if card else ids.ProviderId("route-follower"),
        provider_version=card.version if card else "1",
    )


def packet_of(node: Node, card: CapabilityCard, *, from_s: float, until_s: float, **parts: Any) -> EvidencePacket:
    """A packet of this stage, dispatched at `from_s`, terminal and collected at `until_s`; it proposes its effects."""
    made = EvidencePacket(
        identity=identity_of(card, node.node_id),
        k_ctx=K,
        configuration=CONFIGURATION,
        dispatched_s=from_s,
        terminal_s=until_s,
        collected_s=until_s,
        terminal="succeeded",
        failure="",
        declared={},
        before=(),
        after=(),
        estimates=(),
        proposed=tuple(ProposedFact(name=one.effect.predicate, arguments={}) for one in node.success_conditions),
        protocol=PROTOCOL,
    )
    return replace(made, **parts)


def shown_packet(
    node: Node,
    packet: EvidencePacket,
    card: CapabilityCard,
    blobs: Blobs,
    *,
    facts: Sequence[CommittedFact] = (),
    goal: Goal | None = None,
    **changes: Any,
) -> CaseInputs:
    """The open invocation of a stage whose packet was just collected. `facts` are of the stages that it builds on."""
    earlier = tuple(dict.fromkeys(one.node_id for one in facts))
    node = replace(node, depends_on=tuple(dict.fromkeys((*node.depends_on, *earlier))))
    nodes = (*(_past(one) for one in node.depends_on), node)
    invocation = Invocation(intent=_intent(node, card, packet), status="succeeded")
    mission = replace(_mission(nodes, goal or goal_of(), facts), invocation=invocation)
    return CaseInputs(
        view=view_of(replace(mission, **changes), at_s=packet.collected_s), blobs=blobs, packet=packet, card=card
    )


def with_packet(inputs: CaseInputs, node: Node, packet: EvidencePacket) -> CaseInputs:
    """The same case where an earlier stage was accepted on this packet."""
    mission = inputs.view.mission
    state = replace(mission.nodes[node.node_id], status="committed", packets=(packet,))
    view = replace(inputs.view, mission=replace(mission, nodes=mission.nodes | {node.node_id: state}))
    return CaseInputs(view=view, blobs=inputs.blobs, packet=inputs.packet, card=inputs.card)


def shown_goal(
    effects: Sequence[AnyEffect],
    nodes: Sequence[Node],
    packets: Mapping[ids.NodeId, tuple[EvidencePacket, int]],
    blobs: Blobs,
    *,
    at_s: float,
    facts: Sequence[CommittedFact] = (),
    goal: Goal | None = None,
    mission: Mapping[str, Any] | None = None,
    **view: Any,
) -> CaseInputs:
    """The goal, with every stage accepted on its packet at its state version. `view` and `mission` replace fields."""
    state = _mission(
        tuple(nodes), goal or goal_of(), facts, completion=tuple(condition(one, of="goal") for one in effects)
    )
    done = {
        name: replace(state.nodes[name], status="committed", packets=(packet,), committed_k=k)
        for name, (packet, k) in packets.items()
    }
    state = replace(replace(state, nodes=state.nodes | done), **(mission or {}))
    return CaseInputs(view=replace(view_of(state, at_s=at_s), **view), blobs=blobs)


def view_of(mission: Mission, *, at_s: float) -> StateView:
    """The state as all roles' contexts are compiled from it, with the shipped rules and site."""
    return StateView(mission=mission, at_s=at_s, rules=baseline().context_rules, site=_site(), origins=ORIGINS)


@lru_cache(maxsize=1)
def _site() -> Any:
    return site()


def _past(node_id: ids.NodeId) -> Node:
    """A stage that was accepted before; only its facts matter."""
    return replace(_PAST, node_id=node_id)


def _intent(node: Node, card: CapabilityCard, packet: EvidencePacket) -> DispatchIntended:
    own = identity_of(card, node.node_id)
    return DispatchIntended(
        node_id=node.node_id,
        attempt=own.attempt,
        request_id=own.request_id,
        invocation_id=own.invocation_id,
        provider_id=card.provider_id,
        provider_version=card.version,
        capability=card.capability,
        parameters={},
        resources={},
        k_ctx=K,
        deadline_s=packet.collected_s + 600.0,
        dispatched_s=packet.dispatched_s,
        context=ids.Digest("0" * 64),
    )


def _mission(
    nodes: tuple[Node, ...], goal: Goal, facts: Sequence[CommittedFact], completion: tuple[Condition, ...] = ()
) -> Mission:
    contract = TaskContract(
        goal=goal,
        nodes=nodes,
        completion_conditions=completion or nodes[-1].success_conditions,
        constraints=Constraints(speed_cap_mps=0.5),
        recovery_total=8,
        template="campaign",
        frame="map",
        map_version="site-1",
    )
    return Mission(
        mission_id=MISSION,
        k=K,
        status="active",
        contract=contract,
        configuration=CONFIGURATION,
        rules=CURRENT_RULES,
        requested_by=Actor(name="ada", role="operator"),
        channel="command line",
        nodes={one.node_id: NodeState(node_id=one.node_id) for one in nodes},
        facts=tuple(facts),
    )


_PAST = stage(Symbolic(predicate="recorded_request", arguments={}))
