"""Makes one reasoned change to a configuration, and the candidate from it. Pure. What is allowed is decided later."""

from collections.abc import Callable, Iterable
from typing import Any

from msgspec.structs import replace

from harness.contracts.configuration import Configuration, FailureClass, RecoveryAction
from harness.contracts.values import Value
from rsi_reviews import contracts
from rsi_reviews.generate.trace import MissionTrace, Trace

Ladder = tuple[RecoveryAction, ...]
Positions = Callable[[MissionTrace], Iterable[int]]
"""Which events of a mission lead to a change, by their position in the log."""
LONGEST_REASON = 2000
MOST_MOTIVES = 20


class ProposedChange(Value):
    """One change: the whole configuration after it, the reason, and the expected gain.

    `worth` is the expected improvement per mission in recovery spends, whatever the metric, so that changes rank.
    """

    section: contracts.Section
    configuration: Configuration
    reason: str
    intended: str
    metric: contracts.Metric
    smallest_effect: float
    worth: float
    motives: tuple[contracts.Motive, ...] = ()


def candidate(change: ProposedChange, current: Configuration, *, author: contracts.Author) -> contracts.Candidate:
    """The candidate with its manifest; what it replaces is what a rollback returns to."""
    baseline = current.configuration_id
    manifest = contracts.Manifest(
        component=change.section,
        reason=change.reason[:LONGEST_REASON],
        intended_effect=change.intended[:LONGEST_REASON],
        metric=change.metric,
        direction=contracts.BETTER[change.metric],
        smallest_effect=change.smallest_effect,
        baseline=baseline,
        rollback=baseline,
        author=author,
        motives=change.motives[:MOST_MOTIVES],
    )
    return contracts.Candidate(configuration=change.configuration, manifest=manifest, baseline=baseline)


def with_ladder(current: Configuration, failure: FailureClass, ladder: Ladder) -> Configuration:
    """The same configuration with another ladder for one failure class."""
    recovery = replace(current.recovery, ladders={**current.recovery.ladders, failure: ladder})
    return replace(current, recovery=recovery)


def with_wait(current: Configuration, wait_s: float) -> Configuration:
    """The same configuration that waits for this many seconds on a recovery step that waits."""
    return replace(current, recovery=replace(current.recovery, wait_s=wait_s))


def with_weight(current: Configuration, **weights: float) -> Configuration:
    """The same configuration with other routing weights."""
    return replace(current, routing=replace(current.routing, **weights))


def with_items(current: Configuration, **items: int) -> Configuration:
    """The same configuration with other item budgets of contexts."""
    return replace(current, context_rules=replace(current.context_rules, **items))


def with_timeout(current: Configuration, *, template: str, node_id: str, timeout_s: float) -> Configuration:
    """The same configuration with another timeout of one stage of one template."""
    templates = tuple(
        replace(one, nodes=tuple(_timed(node, node_id, timeout_s) for node in one.nodes))
        if one.name == template
        else one
        for one in current.templates
    )
    return replace(current, templates=templates)


def _timed(node: dict[str, Any], node_id: str, timeout_s: float) -> dict[str, Any]:
    return {**node, "timeout_s": timeout_s} if node.get("node_id") == node_id else node


def failures_of(failure: FailureClass) -> Positions:
    """The log positions of a mission's failures of one class."""
    return lambda mission: [one.position for one in mission.failures if one.failure == failure]


def motives(trace: Trace, positions: Positions) -> tuple[contracts.Motive, ...]:
    """The missions that lead to a change, each with the positions of the events that caused it."""
    found = ((mission.mission_id, tuple(positions(mission))) for mission in trace.missions)
    return tuple(contracts.Motive(mission_id=mission_id, positions=where) for mission_id, where in found if where)
