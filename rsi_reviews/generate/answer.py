"""Reads a model's answer as one change in a closed format. Pure. Another shape, another key or prose is a typed
refusal.
"""

from typing import Annotated, Literal

import msgspec

from harness.contracts.configuration import Configuration, FailureClass, RecoveryAction
from harness.contracts.reasons import Reason, because
from harness.contracts.values import Name, NonNegative, Positive, Value
from rsi_reviews.contracts import Metric, Motive, Section, Sentence
from rsi_reviews.errors import CandidateInvalid
from rsi_reviews.generate import changes
from rsi_reviews.generate.trace import Trace

ANSWER_SHAPE = (
    '{"change": {"kind": "ladder", "failure": "...", "ladder": ["...", "human"]} or {"kind": "wait", "wait_s": 0} or '
    '{"kind": "weight", "name": "...", "value": 0} or {"kind": "timeout", "template": "...", "node_id": "...", '
    '"timeout_s": 0}, "reason": "...", "intended_effect": "...", "metric": "recovery_cost" or "mission_s", '
    '"smallest_effect": 0.05}'
)
Weight = Literal["success", "risk", "uncertainty", "latency", "cost", "history", "history_half_life"]


class NewLadder(Value, tag_field="kind", tag="ladder"):
    """Another recovery ladder for one failure class."""

    failure: FailureClass
    ladder: Annotated[tuple[RecoveryAction, ...], msgspec.Meta(min_length=1, max_length=8)]


class NewWait(Value, tag_field="kind", tag="wait"):
    """Another waiting time."""

    wait_s: Positive


class NewWeight(Value, tag_field="kind", tag="weight"):
    """Another routing weight."""

    name: Weight
    value: NonNegative


class NewTimeout(Value, tag_field="kind", tag="timeout"):
    """Another timeout of one stage."""

    template: Name
    node_id: Name
    timeout_s: Positive


class ModelAnswer(Value):
    """The whole answer."""

    change: NewLadder | NewWait | NewWeight | NewTimeout
    reason: Sentence
    intended_effect: Sentence
    metric: Metric
    smallest_effect: Positive


def change_of(answer: ModelAnswer, current: Configuration, trace: Trace) -> changes.ProposedChange:
    """The change that an answer states. Raises CandidateInvalid for a stage that no template has."""
    section, configuration = _changed(answer, current)
    return changes.ProposedChange(
        section=section,
        configuration=configuration,
        reason=answer.reason,
        intended=answer.intended_effect,
        metric=answer.metric,
        smallest_effect=answer.smallest_effect,
        worth=0.0,
        motives=_motives(answer, trace),
    )


def _changed(answer: ModelAnswer, current: Configuration) -> tuple[Section, Configuration]:
    match answer.change:
        case NewLadder(failure=failure, ladder=ladder):
            return "recovery", changes.with_ladder(current, failure, ladder)
        case NewWait(wait_s=wait_s):
            return "recovery", changes.with_wait(current, wait_s)
        case NewWeight(name=name, value=value):
            return "routing", changes.with_weight(current, **{name: value})
        case NewTimeout(template=template, node_id=node_id, timeout_s=timeout_s):
            names = {(one.name, node.get("node_id")) for one in current.templates for node in one.nodes}
            if (template, node_id) not in names:
                raise _refused(because("model_names_unknown_stage", node_id=node_id, template=template), "unknown_name")
            return "templates", changes.with_timeout(current, template=template, node_id=node_id, timeout_s=timeout_s)


def _motives(answer: ModelAnswer, trace: Trace) -> tuple[Motive, ...]:
    """The missions whose records concern what is changed; for weights and waits, the missions that failed at all."""
    match answer.change:
        case NewLadder(failure=failure):
            return changes.motives(trace, changes.failures_of(failure))
        case NewTimeout():
            return changes.motives(trace, changes.failures_of("timeout"))
        case NewWait() | NewWeight():
            return changes.motives(trace, lambda mission: [one.position for one in mission.failures])


def _refused(what: Reason, rule: str) -> CandidateInvalid:
    return CandidateInvalid(what, rule=rule, where="model's answer")
