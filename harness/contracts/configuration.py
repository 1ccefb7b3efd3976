"""Configuration H_j: four sections and nothing else (R154). Its id is its digest; the gate is not in it."""

from typing import Literal

from harness.contracts.ids import Digest
from harness.contracts.tasks import TaskTemplate
from harness.contracts.values import Count, NonNegative, Positive, Share, Value, digest

FailureClass = Literal[
    "target_not_found", "no_progress", "unsafe_action", "stale_evidence", "violated", "ambiguous", "timeout",
    "provider_unavailable", "resource_conflict", "verifier_unavailable", "outcome_unknown", "cancel_unacknowledged",
    "interrupted", "precondition_unmet", "commit_rejected",
]  # fmt: skip
RecoveryAction = Literal[
    "re_perceive", "adjust_view", "retry", "local_replan", "switch_skill", "wait", "reattach", "verify_again",
    "stop", "safe_stop", "human",
]  # fmt: skip
SPENDING: tuple[RecoveryAction, ...] = ("re_perceive", "adjust_view", "retry", "local_replan", "switch_skill")


class ContextRules(Value):
    """Item budgets per role, and what may enter a context (D22)."""

    c1_items: Count
    c2_items: Count
    c2_examples: Count
    c3_items: Count
    c4_items: Count
    minimum_confidence: Share
    pose_age_s: Positive
    image_age_s: Positive


class RoutingPreferences(Value):
    """Non-negative weights of the score (R59) and the Beta prior of the history penalty (D23)."""

    success: NonNegative
    risk: NonNegative
    uncertainty: NonNegative
    latency: NonNegative
    cost: NonNegative
    history: NonNegative
    history_half_life: Positive


class RecoveryPolicy(Value):
    """Ladders by failure class. Every ladder ends in `human`; limits are the contract's."""

    ladders: dict[FailureClass, tuple[RecoveryAction, ...]]
    approval_share: Share
    wait_s: Positive


class Configuration(Value):
    """H: what a mission is pinned to from COMPILED on (D35)."""

    context_rules: ContextRules
    templates: tuple[TaskTemplate, ...]
    routing: RoutingPreferences
    recovery: RecoveryPolicy

    @property
    def configuration_id(self) -> Digest:
        return digest(self)
