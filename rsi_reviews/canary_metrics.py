"""Reads the metrics of missions from their stored events, for the canary and for the baseline it is compared with."""

from collections.abc import Iterator
from itertools import islice

import msgspec

from harness.contracts.decider import Codec
from harness.contracts.events import DispatchIntended, HandoffAnswered, HandoffRequested, MissionEvent
from harness.contracts.ids import Digest, MissionId, RobotId
from harness.contracts.proposals import CandidateSet
from harness.projections.mission import Mission
from harness.runtime import Runtime
from rsi_reviews.canary import CanaryMetrics, value_of
from rsi_reviews.contracts import Metric
from rsi_reviews.pointers import candidate_stream
from rsi_reviews.projections import Review

MOST_RECENT = 200
LOOKED_AT = 5_000
"""Among so many of the newest missions, of all robots and versions, the recent ones are looked for."""
_CODEC: Codec[MissionEvent] = Codec(MissionEvent)


def metrics_of(runtime: Runtime, mission_id: MissionId, *, duplicate_starts: int = 0) -> CanaryMetrics:
    """The canary metrics of one mission, read from the log. `duplicate_starts` comes from the robot's own journal,
    which the log does not hold.
    """
    stored = runtime.events(mission_id)
    requested_s: dict[str, float] = {}
    handoffs = choices = 0
    minutes = 0.0
    for one in stored:
        match _CODEC.decode(one):
            case HandoffRequested() as event:
                handoffs += 1
                requested_s[event.handoff_id] = one.recorded_s
            case HandoffAnswered() as event:
                minutes += (one.recorded_s - requested_s.pop(event.handoff_id, one.recorded_s)) / 60.0
            case DispatchIntended(candidates=str() as digest):
                choices += _chosen_among(runtime, digest) > 1
            case _:
                pass
    return CanaryMetrics(
        handoffs=handoffs,
        mission_s=stored[-1].mission_s - stored[0].mission_s if stored else 0.0,
        operator_minutes=minutes,
        duplicate_starts=duplicate_starts,
        choices=choices,
    )


def recent_values(runtime: Runtime, metric: Metric, configuration: Digest, robot_id: RobotId) -> tuple[float, ...]:
    """The metric in the newest finished missions of one robot under one configuration, without replays.

    At most MOST_RECENT missions, found among the LOOKED_AT newest of all.
    """
    found = (
        mission
        for mission in islice(runtime.newest_missions(), LOOKED_AT)
        if (mission.configuration, mission.robot_id) == (configuration, robot_id)
        and mission.ended
        and not mission.replay
    )
    newest = islice(found, MOST_RECENT)
    return tuple(value_of(metric, mission, metrics_of(runtime, mission.mission_id)) for mission in newest)


def canary_missions(runtime: Runtime, review: Review) -> Iterator[Mission]:
    """Missions that ended under the candidate since its canary began, in the order of their ends, without replays."""
    stored = runtime.stream(candidate_stream(review.candidate))
    began = max((one.position for one in stored if one.kind == "CanaryBegun"), default=0)
    ended = runtime.ended_under(review.configuration, after=began)
    return (mission for mission in ended if not mission.replay)


def ran(mission: Mission) -> bool:
    """Whether the mission began. One that was cancelled before anything was dispatched shows nothing."""
    return any(state.attempt for state in mission.nodes.values())


def _chosen_among(runtime: Runtime, digest: Digest) -> int:
    """How many providers passed the hard filters."""
    candidates = msgspec.json.decode(runtime.record(digest).body, type=CandidateSet).candidates
    return sum(not candidate.refused_by for candidate in candidates)
