"""Builds small missions for tests of the gate: two nodes, and the commands that take one from start to end."""

from harness.contracts.actors import Actor
from harness.contracts.commands import (
    ActivateMission,
    AuthoriseDispatch,
    CompleteNode,
    CreateMission,
)
from harness.contracts.configuration import RecoveryPolicy
from harness.contracts.decisions import Accepted
from harness.contracts.effects import Condition, Metric, Symbolic
from harness.contracts.events import DispatchIntended
from harness.contracts.evidence import EvidencePacket, PacketIdentity
from harness.contracts.ids import (
    ConditionId,
    Digest,
    MissionId,
    NodeId,
    ProviderId,
    ResourceId,
    RobotId,
    invocation_id,
    packet_id,
    request_id,
    sha256,
)
from harness.contracts.proposals import RecoveryProposal, Signature
from harness.contracts.tasks import Constraints, EvidencePolicy, Goal, Node, RecoveryLimits, TaskContract
from harness.contracts.values import Moment, digest
from harness.contracts.verdicts import ConditionResult, GoalVerdict, NodeVerdict, Verdict
from harness.gate.decide import DECIDER
from harness.projections.mission import Mission, required_contract

MISSION = MissionId("msn_test")
GO, TELL = NodeId("go"), NodeId("tell")
OPERATOR = Actor(name="ada", role="operator")
CONFIGURATION = Digest("c" * 64)
NOW = Moment(mission_s=1000.0, wall_s=2000.0)
LIMITS = RecoveryLimits(re_perceive=2, adjust_view=2, retry=1, local_replan=2, switch_skill=1, total=4)
POLICY = RecoveryPolicy(
    ladders={
        "violated": ("re_perceive", "retry", "switch_skill", "human"),
        "ambiguous": ("re_perceive", "adjust_view", "human"),
        "stale_evidence": ("re_perceive", "human"),
        "interrupted": ("retry", "switch_skill", "human"),
        "precondition_unmet": ("wait", "human"),
        "commit_rejected": ("re_perceive", "human"),
        "unsafe_action": ("safe_stop", "human"),
        "timeout": ("stop", "switch_skill", "human"),
        "outcome_unknown": ("reattach", "human"),
    },
    approval_share=0.5,
    wait_s=20.0,
)


def contract() -> TaskContract:
    """A contract with two nodes: go somewhere, then send a message."""
    arrival = Metric(predicate="arrival", frame="map", map_version="m1", target_m=(5.0, 0.0), tolerance_m=0.4)
    go = Node(
        node_id=GO,
        subgoal="Go",
        success_conditions=(
            Condition(condition_id=ConditionId("go.arrival"), text="there", effect=arrival, fact="state"),
            Condition(condition_id=ConditionId("go.again"), text="there too", effect=arrival),
        ),
        capabilities=("navigate",),
        parameters={"target": (5.0, 0.0), "frame": "map", "tolerance_m": 0.4},
        resources=(ResourceId("mobile_base"),),
        evidence=EvidencePolicy(mandatory=("trajectory",)),
        timeout_s=100.0,
        recovery=LIMITS,
        risk="medium",
    )
    told = Condition(
        condition_id=ConditionId("tell.told"), text="told", effect=Symbolic(predicate="noted", arguments={})
    )
    tell = Node(
        node_id=TELL,
        subgoal="Tell",
        success_conditions=(told,),
        capabilities=("deliver_message",),
        parameters={"text": "hello"},
        resources=(),
        evidence=EvidencePolicy(mandatory=("receipts",)),
        timeout_s=30.0,
        recovery=LIMITS,
        depends_on=(GO,),
    )
    linked = Condition(
        condition_id=ConditionId("goal.linked"),
        text="both",
        effect=Symbolic(predicate="linked", arguments={"told": "tell"}),
    )
    text = "Go and tell"
    return TaskContract(
        goal=Goal(text=text, digest=sha256(text.encode())),
        nodes=(go, tell),
        completion_conditions=(linked,),
        constraints=Constraints(speed_cap_mps=0.5),
        recovery_total=8,
        template="test",
        frame="map",
        map_version="m1",
    )


def creation(mission_id: MissionId = MISSION, **changes: object) -> CreateMission:
    """The request for a mission with this site's contract."""
    return CreateMission(
        mission_id=mission_id,
        robot_id=RobotId("vbot-1"),
        goal="Go and tell",
        template="test",
        requested_by=OPERATOR,
        configuration=CONFIGURATION,
        contract=contract(),
        policy=POLICY,
        **changes,  # type: ignore[arg-type]
    )


def created(**changes: object) -> Mission:
    """An active mission that has done nothing yet."""
    return after(Mission(), creation(**changes), ActivateMission())  # type: ignore[arg-type]


def after(mission: Mission, *commands: object) -> Mission:
    """The mission after these commands were accepted; fails on the first refusal."""
    for command in commands:
        decision = DECIDER.decide(mission, command, NOW)  # type: ignore[arg-type]
        assert isinstance(decision, Accepted), decision
        mission = DECIDER.fold(mission, decision.events)
    return mission


def intent(mission: Mission, node_id: NodeId = GO, **changes: object) -> DispatchIntended:
    """The intent of the next attempt at a node."""
    node = required_contract(mission).node(node_id)
    attempt = mission.of(node_id).attempt + 1
    request = request_id(mission.mission_id, node_id, attempt)
    fields: dict[str, object] = {
        "node_id": node_id,
        "attempt": attempt,
        "request_id": request,
        "invocation_id": invocation_id(request),
        "provider_id": ProviderId("p1"),
        "provider_version": "1",
        "capability": node.capabilities[0],
        "parameters": node.parameters,
        "resources": {},
        "k_ctx": mission.k,
        "deadline_s": NOW.mission_s + node.timeout_s,
        "dispatched_s": NOW.mission_s,
        "context": Digest("d" * 64),
        "moves": node_id == GO,
    }
    return DispatchIntended(**(fields | changes))  # type: ignore[arg-type]


def dispatch(mission: Mission, node_id: NodeId = GO, **changes: object) -> AuthoriseDispatch:
    return AuthoriseDispatch(intent=intent(mission, node_id, **changes))


def recovery(mission: Mission, action: str, node_id: NodeId = GO, **changes: object) -> AuthoriseDispatch:
    """A recovery step that costs one, signed, as C4 would propose it."""
    failure = mission.of(node_id).failure
    assert failure is not None
    verify_only = action in ("re_perceive", "adjust_view")
    fields = {"verify_only": verify_only, "moves": not verify_only, "action": action} | changes
    if verify_only:
        fields |= {"capability": "observe", "parameters": {}}
    wanted = intent(mission, node_id, **fields)
    proposal = RecoveryProposal(
        action=action,  # type: ignore[arg-type]
        failure=failure.failure,
        provider_id=None,
        cost=1,
        reason="test",
    )
    signature = Signature(
        action=action,  # type: ignore[arg-type]
        provider_id=wanted.provider_id,
        provider_version=wanted.provider_version,
        parameters=digest(wanted.parameters),
        failure=failure.failure,
    )
    return AuthoriseDispatch(intent=wanted, recovery=proposal, signature=signature, recovery_context=Digest("e" * 64))


def packet(mission: Mission, *, identity: dict[str, object] | None = None, **changes: object) -> EvidencePacket:
    """The packet of the open invocation, as a correct provider leaves it."""
    assert mission.invocation is not None
    opened = mission.invocation.intent
    who: dict[str, object] = {
        "mission_id": mission.mission_id,
        "node_id": opened.node_id,
        "attempt": opened.attempt,
        "request_id": opened.request_id,
        "invocation_id": opened.invocation_id,
        "packet_id": packet_id(opened.invocation_id),
        "provider_id": opened.provider_id,
        "provider_version": opened.provider_version,
    }
    fields: dict[str, object] = {
        "identity": PacketIdentity(**(who | (identity or {}))),  # type: ignore[arg-type]
        "k_ctx": opened.k_ctx,
        "configuration": mission.configuration,
        "dispatched_s": opened.dispatched_s,
        "terminal_s": opened.dispatched_s + 10.0,
        "collected_s": opened.dispatched_s + 12.0,
        "terminal": "succeeded",
        "failure": "",
        "declared": {},
        "before": (),
        "after": (),
        "estimates": (),
        "proposed": (),
        "verify_only": opened.verify_only,
    }
    return EvidencePacket(**(fields | changes))  # type: ignore[arg-type]


def verdict(mission: Mission, judged: EvidencePacket, word: Verdict = "satisfied", **changes: object) -> NodeVerdict:
    """A verdict over every declared condition, all with the value `word`."""
    nodes = required_contract(mission).nodes
    node = next((one for one in nodes if one.node_id == judged.identity.node_id), nodes[0])
    results = tuple(
        ConditionResult(condition_id=c.condition_id, text=c.text, verdict=word, reason=f"it is {word}")
        for c in node.success_conditions
    )
    fields: dict[str, object] = {
        "packet_id": judged.identity.packet_id,
        "verdict": word,
        "results": results,
        "reason": word,
        "verifier": "test",
        "context": Digest("f" * 64),
        "at_s": judged.collected_s,
    }
    return NodeVerdict(**(fields | changes))  # type: ignore[arg-type]


def complete(mission: Mission, word: Verdict = "satisfied", **changes: object) -> CompleteNode:
    judged = packet(mission, **changes)  # type: ignore[arg-type]
    return CompleteNode(packet=judged, verdict=verdict(mission, judged, word))


def goal_verdict(mission: Mission, word: Verdict = "satisfied") -> GoalVerdict:
    results = tuple(
        ConditionResult(condition_id=c.condition_id, text=c.text, verdict=word, reason=f"it is {word}")
        for c in required_contract(mission).completion_conditions
    )
    return GoalVerdict(
        mission_id=mission.mission_id,
        verdict=word,
        results=results,
        reason=word,
        verifier="test",
        context=Digest("a" * 64),
        at_s=NOW.mission_s,
    )
