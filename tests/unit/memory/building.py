"""A log written by the real gate: missions that go somewhere, look at a passage and tell, as a test wants them."""

from msgspec.structs import replace

from harness.adapters.stores.memory import MemoryEventStore
from harness.adapters.stores.memory_index import VolatileMemoryIndex
from harness.contracts.capabilities import CapabilityCard
from harness.contracts.commands import ActivateMission, CompleteNode, CreateMission
from harness.contracts.contexts import Context, ContextRecord
from harness.contracts.decisions import Accepted
from harness.contracts.effects import Condition, Relational
from harness.contracts.events import DispatchIntended
from harness.contracts.evidence import EvidenceReference
from harness.contracts.ids import (
    ConditionId,
    Digest,
    MissionId,
    NodeId,
    PlaceId,
    ProviderId,
    RobotId,
    mission_stream,
    sha256,
)
from harness.contracts.memory import FloorBox, MemoryEntry, MemoryQuery
from harness.contracts.places import Passage, Place
from harness.contracts.ports import Record
from harness.contracts.tasks import EvidencePolicy, Node, TaskContract
from harness.contracts.values import Moment, decode, encode, raw
from harness.contracts.verdicts import ConditionResult, Verdict
from harness.gate.commit import CommandEnvelope, Gate
from harness.gate.decide import DECIDER
from harness.memory.fabric import SEMANTIC, SPATIAL, MemoryFabric
from harness.projections.mission import Mission, required_contract
from tests.builders.gate import (
    CONFIGURATION,
    GO,
    LIMITS,
    OPERATOR,
    POLICY,
    contract,
    dispatch,
    packet,
    recovery,
    verdict,
)

LOOK = NodeId("look")
REPORT, FRAME = Digest("1" * 64), Digest("2" * 64)
DOCK = Place(
    place_id=PlaceId("dock"),
    name="Dock",
    frame="map",
    map_version="m1",
    approach_m=(5.0, 0.0),
    provenance="surveyed",
    verification="configured",
    region_m=((4.0, -1.0), (6.0, -1.0), (6.0, 1.0), (4.0, 1.0)),
)
PASSAGE = Passage(passage_id=PlaceId("gap"), frame="map", floor_m=((7.0, 0.0), (8.0, 0.0), (8.0, 2.0)))
EVERYTHING = (*SPATIAL, "episode", "outcome", *SEMANTIC)
EVERY_STANDING = ("configured", "observed", "verified", "disputed", "superseded")
HALL = FloorBox(frame="map", map_version="m1", x_min_m=-20.0, y_min_m=-20.0, x_max_m=20.0, y_max_m=20.0)


class HandClock:
    """Both clocks where the test puts them."""

    def __init__(self) -> None:
        self.at_s = 1000.0

    def now(self) -> Moment:
        return Moment(mission_s=self.at_s, wall_s=self.at_s + 5e8)

    def wait_until(self, mission_s: float) -> None:
        self.at_s = max(self.at_s, mission_s)


class Log:
    """An event log with its gate and its memory; every step moves the clock on by a minute."""

    def __init__(self) -> None:
        self.clock = HandClock()
        self.records: tuple[Record, ...] = ()
        self.store = MemoryEventStore()
        self.gate = Gate(store=self.store, clock=self.clock, deciders={"mission": DECIDER})
        self.index = VolatileMemoryIndex()
        self.memory = MemoryFabric(store=self.store, index=self.index)

    def commit(self, mission_id: MissionId, *commands: object, records: tuple[Record, ...] = ()) -> Mission:
        self.records += records
        for command in commands:
            decision = self.gate.commit([CommandEnvelope(mission_stream(mission_id), command, None)], records=records)
            assert isinstance(decision, Accepted), decision
        return self.mission(mission_id)

    def mission(self, mission_id: MissionId) -> Mission:
        mission: Mission = self.gate.state(mission_stream(mission_id))
        return mission

    def begin(
        self, name: str = "msn_a", *, configuration: Digest = CONFIGURATION, map_version: str = "m1", speed: float = 0.5
    ) -> MissionId:
        mission_id = MissionId(name)
        create = CreateMission(
            mission_id=mission_id,
            robot_id=RobotId("vbot-1"),
            goal="Go and look",
            template="test",
            requested_by=OPERATOR,
            configuration=configuration,
            contract=going_and_looking(map_version=map_version, speed=speed),
            policy=POLICY,
        )
        self.commit(mission_id, create, ActivateMission())
        return mission_id

    def dispatched(
        self, mission_id: MissionId, node_id: NodeId = GO, provider: str = "p1", **changes: object
    ) -> Mission:
        self.clock.at_s += 60.0
        fields = {"provider_id": ProviderId(provider), "dispatched_s": self.clock.at_s} | changes
        return self.commit(mission_id, dispatch(self.mission(mission_id), node_id, **fields))

    def shown(self, mission_id: MissionId, card: CapabilityCard) -> Mission:
        """A dispatch whose skill role was shown this card in C2."""
        mission = self.mission(mission_id)
        item = ContextRecord(kind="card", origin="configuration", source=card.provider_id, at_s=0.0, value=raw(card))
        context = Context(
            role="skill",
            mission_id=mission_id,
            node_id=GO,
            k=mission.k,
            at_s=self.clock.at_s,
            configuration=mission.configuration,
            records=(item,),
        )
        record = Record(digest=context.digest, kind="context/skill", body=encode(context))
        wanted = dispatch(
            mission, GO, provider_id=card.provider_id, context=context.digest, dispatched_s=self.clock.at_s
        )
        return self.commit(mission_id, wanted, records=(record,))

    def looked_again(self, mission_id: MissionId, node_id: NodeId = GO) -> Mission:
        """A verify-only invocation by an observer."""
        self.clock.at_s += 60.0
        fields: dict[str, object] = {"provider_id": ProviderId("observer"), "dispatched_s": self.clock.at_s}
        return self.commit(mission_id, recovery(self.mission(mission_id), "re_perceive", node_id, **fields))

    def retried(self, mission_id: MissionId, node_id: NodeId = GO, provider: str = "p1") -> Mission:
        self.clock.at_s += 60.0
        fields: dict[str, object] = {"provider_id": ProviderId(provider), "dispatched_s": self.clock.at_s}
        return self.commit(mission_id, recovery(self.mission(mission_id), "retry", node_id, **fields))

    def judged(
        self,
        mission_id: MissionId,
        word: Verdict = "satisfied",
        *,
        distance_m: float = 0.1,
        blocked: float = 1.0,
        images: tuple[EvidenceReference, ...] = (),
        **changes: object,
    ) -> Mission:
        """The open invocation ends, is judged, and the gate decides."""
        self.clock.at_s += 12.0
        mission = self.mission(mission_id)
        assert mission.invocation is not None
        left = packet(mission, after=(pose_evidence(self.clock.at_s), *images), **changes)
        node = required_contract(mission).node(mission.invocation.intent.node_id)
        results = tuple(_result(one, word, distance_m=distance_m, blocked=blocked) for one in node.success_conditions)
        return self.commit(mission_id, CompleteNode(packet=left, verdict=verdict(mission, left, word, results=results)))

    def went(
        self, mission_id: MissionId, word: Verdict = "satisfied", *, provider: str = "p1", distance_m: float = 0.1
    ) -> Mission:
        self.dispatched(mission_id, provider=provider)
        return self.judged(mission_id, word, distance_m=distance_m)

    def sighted(self, name: str, *, blocked: float, provider: str) -> None:
        """A whole mission that goes and looks at the passage."""
        mission_id = self.begin(name)
        self.went(mission_id)
        self.dispatched(mission_id, LOOK, provider)
        self.judged(mission_id, blocked=blocked)

    def found(self, *kinds: str, **changes: object) -> list[MemoryEntry]:
        """Records of these kinds, oldest first; whatever their standing unless the test says otherwise."""
        fields: dict[str, object] = {"kinds": kinds or EVERYTHING, "standings": EVERY_STANDING, "limit": 1000}
        return list(reversed(self.memory.find(MemoryQuery(**(fields | changes)))))  # type: ignore[arg-type]


def going_and_looking(*, map_version: str = "m1", speed: float = 0.5) -> TaskContract:
    """Go to the dock, then look at the passage from there."""
    base = contract()
    seen = Relational(predicate="analysis_of", relation="analysis_of", subject="look", object="go")
    look = Node(
        node_id=LOOK,
        subgoal="Look at the gap",
        success_conditions=(Condition(condition_id=ConditionId("look.seen"), text="seen", effect=seen),),
        capabilities=("analyse_passage",),
        parameters={},
        resources=(),
        evidence=EvidencePolicy(mandatory=("receipts",)),
        timeout_s=30.0,
        recovery=LIMITS,
        depends_on=(GO,),
    )
    bindings = {"destination": decode(encode(DOCK), dict), "passage": decode(encode(PASSAGE), dict)}
    constraints = replace(base.constraints, speed_cap_mps=speed)
    nodes = (base.node(GO), look)
    return replace(base, nodes=nodes, bindings=bindings, map_version=map_version, constraints=constraints)


def pose_evidence(at_s: float) -> EvidenceReference:
    """The sealed poses after an execution, of which the estimator was nine tenths sure."""
    return EvidenceReference(
        kind="after",
        origin="sensor",
        source="robot",
        from_s=at_s - 1.0,
        until_s=at_s,
        confidence=0.9,
        blob=sha256(str(at_s).encode()),
        frame="map",
        map_version="m1",
    )


def intents(log: Log, mission_id: MissionId) -> list[DispatchIntended]:
    """The intents of a mission, oldest first."""
    events = (DECIDER.codec.decode(event) for event in log.store.load(mission_stream(mission_id)))
    return [event for event in events if isinstance(event, DispatchIntended)]


def _result(condition: Condition, word: Verdict, *, distance_m: float, blocked: float) -> ConditionResult:
    if isinstance(condition.effect, Relational):
        measured = {"blocked": blocked, "obstructions": blocked, "frames": 1.0, "foreign": 0.0}
        return ConditionResult(
            condition_id=condition.condition_id,
            text=condition.text,
            verdict=word,
            reason=word,
            measured=measured,
            sources=("receipts",),
            evidence=(REPORT, FRAME),
        )
    return ConditionResult(
        condition_id=condition.condition_id,
        text=condition.text,
        verdict=word,
        reason=word,
        measured={"distance_m": distance_m, "pose_age_s": 0.1},
        bounds={"distance_m": 0.4, "pose_age_s": 1.0},
        sources=("localiser", "odometry"),
    )
