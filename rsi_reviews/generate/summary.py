"""Summarises D_j as counts and durations for a model, without any free text of a mission. Pure."""

from collections import Counter
from collections.abc import Iterable

from harness.contracts.configuration import FailureClass
from harness.contracts.values import Value
from rsi_reviews.generate.trace import Trace


class StepCount(Value):
    """How often a step was taken for a failure class, and how often the stage was accepted right after it."""

    failure: FailureClass
    action: str
    times: int
    helped: int


class ProviderCount(Value):
    """How often a provider worked at a place, how often its effect was refuted, and its longest accepted execution."""

    provider_id: str
    capability: str
    place: str
    worked: int
    refuted: int
    longest_accepted_s: float


class TraceSummary(Value):
    """What missions recorded, added up. `handoffs` and `failures` count by failure class.

    `partly` ended verified in part only: they are no finished ones.
    """

    missions: int
    finished: int
    partly: int
    mean_seconds: float
    failures: dict[str, int]
    handoffs: dict[str, int]
    rejections: dict[str, int]
    rungs: tuple[StepCount, ...]
    providers: tuple[ProviderCount, ...]


def summary(trace: Trace) -> TraceSummary:
    """Add up the records."""
    missions = trace.missions
    executions = [one for mission in missions for one in mission.executions]
    return TraceSummary(
        missions=len(missions),
        finished=sum(mission.status == "succeeded" for mission in missions),
        partly=sum(mission.status == "partly_verified" for mission in missions),
        mean_seconds=round(sum(mission.seconds for mission in missions) / max(len(missions), 1), 1),
        failures=_counted(one.failure for mission in missions for one in mission.failures),
        handoffs=_counted(one.failure for mission in missions for one in mission.handoffs),
        rejections=_counted(one.rejected_by for one in executions if one.rejected_by),
        rungs=_rungs(trace),
        providers=_providers(trace),
    )


def _counted(names: Iterable[str]) -> dict[str, int]:
    return dict(sorted(Counter(names).items()))


def _rungs(trace: Trace) -> tuple[StepCount, ...]:
    rungs = [step for mission in trace.missions for step in mission.rungs]
    times = Counter((step.failure, step.action) for step in rungs)
    helped = Counter((step.failure, step.action) for step in rungs if step.came == "committed")
    return tuple(
        StepCount(failure=key[0], action=key[1], times=count, helped=helped[key])
        for key, count in sorted(times.items())
    )


def _providers(trace: Trace) -> tuple[ProviderCount, ...]:
    executions = [one for mission in trace.missions for one in mission.executions if not one.verify_only]
    keys = sorted({(one.provider_id, one.capability, one.place) for one in executions})
    found = []
    for provider_id, capability, place in keys:
        part = [
            one
            for one in executions
            if (one.provider_id, one.capability, one.place) == (provider_id, capability, place)
        ]
        found.append(
            ProviderCount(
                provider_id=provider_id,
                capability=capability,
                place=place,
                worked=len(part),
                refuted=sum(one.verdict in ("violated", "unsafe") for one in part),
                longest_accepted_s=round(max((one.duration_s for one in part if one.committed), default=0.0), 1),
            )
        )
    return tuple(found)
