"""Values of an incident's case: what was judged, and the recording that it can be judged by again."""

from harness.contracts.ids import ConditionId, Digest, MissionId
from harness.contracts.values import Name, Value
from harness.contracts.verdicts import Verdict


class CaseCondition(Value):
    """The verdict on one condition, with what was measured."""

    condition_id: ConditionId
    verdict: Verdict
    measured: dict[str, float]


class RecordedDrive(Value):
    """A recording and how it was read: `topics` as ROLE=TOPIC, `target` as X,Y or empty."""

    sha256: Digest
    topics: tuple[Name, ...]
    target: str


class IncidentCase(Value):
    """What a bundle is compared with later. `recorded` is None for a mission that was not a recording's."""

    mission_id: MissionId
    recorded: RecordedDrive | None
    judged: tuple[CaseCondition, ...]
