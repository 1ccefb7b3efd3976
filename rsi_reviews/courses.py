"""What a mission's stored events say beside its state: for the canary, and for the baseline it is compared with."""

import msgspec

from harness.contracts.decider import Codec
from harness.contracts.events import DispatchIntended, HandoffAnswered, HandoffRequested, MissionEvent
from harness.contracts.ids import Digest, MissionId, RobotId
from harness.contracts.proposals import CandidateSet
from harness.projections.mission import Mission
from harness.runtime import Runtime
from rsi_reviews.canary import Course, value_of
from rsi_reviews.contracts import Metric

MOST_RECENT = 200
_CODEC: Codec[MissionEvent] = Codec(MissionEvent)


def course_of(runtime: Runtime, mission_id: MissionId, *, duplicate_starts: int = 0) -> Course:
    """Read from the log. `duplicate_starts` comes from the robot's own journal, which the log does not hold."""
    stored = runtime.events(mission_id)
    asked: dict[str, float] = {}
    handoffs = choices = 0
    minutes = 0.0
    for one in stored:
        match _CODEC.decode(one):
            case HandoffRequested() as event:
                handoffs += 1
                asked[event.handoff_id] = one.recorded_s
            case HandoffAnswered() as event:
                minutes += (one.recorded_s - asked.pop(event.handoff_id, one.recorded_s)) / 60.0
            case DispatchIntended(candidates=str() as digest):
                choices += _chosen_among(runtime, digest) > 1
            case _:
                pass
    return Course(
        handoffs=handoffs,
        mission_s=stored[-1].mission_s - stored[0].mission_s if stored else 0.0,
        operator_minutes=minutes,
        duplicate_starts=duplicate_starts,
        choices=choices,
    )


def recent_values(runtime: Runtime, metric: Metric, configuration: Digest, robot_id: RobotId) -> tuple[float, ...]:
    """The metric in the newest finished missions of one robot under one configuration, replays apart."""
    found: list[Mission] = []
    for mission in runtime.missions():
        under = mission.configuration == configuration and mission.robot_id == robot_id
        if under and mission.ended and not mission.replay:
            found.append(mission)
        if len(found) == MOST_RECENT:
            break
    return tuple(value_of(metric, mission, course_of(runtime, mission.mission_id)) for mission in found)


def _chosen_among(runtime: Runtime, digest: Digest) -> int:
    """How many providers passed the hard filters."""
    candidates = msgspec.json.decode(runtime.record(digest).body, type=CandidateSet).candidates
    return sum(not candidate.refused_by for candidate in candidates)
