"""Configuration H_j: four sections and nothing else (R154), identified by its digest; the gate is not part of it."""

from typing import Annotated, Literal

from msgspec import Meta

from harness.contracts import values
from harness.contracts.ids import Digest
from harness.contracts.tasks import TaskTemplate

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


RECORDS = {"unit": "records"}
SECONDS = {"unit": "s"}
SHARE = {"unit": "share"}
WEIGHT = {"unit": "weight"}


class ContextRules(values.Value):
    """Item budgets per role, and what may enter a context (D22)."""

    c1_items: Annotated[values.Count, Meta(description="Records the planner is shown at most", extra=RECORDS)]
    c2_items: Annotated[values.Count, Meta(description="Records a skill is shown at most", extra=RECORDS)]
    c2_examples: Annotated[values.Count, Meta(description="Verified examples a skill is shown at most", extra=RECORDS)]
    c3_items: Annotated[values.Count, Meta(description="Records the verifier is shown at most", extra=RECORDS)]
    c4_items: Annotated[values.Count, Meta(description="Records recovery is shown at most", extra=RECORDS)]
    minimum_confidence: Annotated[
        values.Share, Meta(description="Confidence below which a record is withheld from every role", extra=SHARE)
    ]
    pose_age_s: Annotated[
        values.Positive, Meta(description="Age beyond which a pose is withheld as stale", extra=SECONDS)
    ]
    image_age_s: Annotated[
        values.Positive,
        Meta(description="Age beyond which an image or an analysis is withheld as stale", extra=SECONDS),
    ]


class RoutingPreferences(values.Value):
    """Non-negative weights of the score (R59) and the Beta prior of the history penalty (D23)."""

    success: Annotated[
        values.NonNegative, Meta(description="How much a declared chance of success counts", extra=WEIGHT)
    ]
    risk: Annotated[
        values.NonNegative, Meta(description="How much declared risk counts against a provider", extra=WEIGHT)
    ]
    uncertainty: Annotated[
        values.NonNegative, Meta(description="How much declared uncertainty counts against a provider", extra=WEIGHT)
    ]
    latency: Annotated[
        values.NonNegative,
        Meta(description="How much expected time over the stage's timeout counts against", extra=WEIGHT),
    ]
    cost: Annotated[
        values.NonNegative,
        Meta(description="How much cost relative to the dearest candidate counts against", extra=WEIGHT),
    ]
    history: Annotated[
        values.NonNegative,
        Meta(description="How much verified failures in the same setting count against", extra=WEIGHT),
    ]
    history_half_life: Annotated[
        values.Positive,
        Meta(description="Newer outcomes after which an outcome counts half", extra={"unit": "outcomes"}),
    ]


class RecoveryPolicy(values.Value):
    """Ladders by failure class. Every ladder ends in `human`; limits are the contract's."""

    ladders: Annotated[
        dict[FailureClass, tuple[RecoveryAction, ...]],
        Meta(description="What is tried after a failure of this class, in order", extra={"unit": "steps"}),
    ]
    approval_share: Annotated[
        values.Share,
        Meta(description="Part of a stage's recovery budget that is spent without asking a person", extra=SHARE),
    ]
    wait_s: Annotated[
        values.Positive,
        Meta(description="How long a free step waits, and a spending one may stay impossible", extra=SECONDS),
    ]


class Configuration(values.Value):
    """H: what a mission is pinned to from COMPILED on (D35)."""

    context_rules: ContextRules
    templates: tuple[TaskTemplate, ...]
    routing: RoutingPreferences
    recovery: RecoveryPolicy

    @property
    def configuration_id(self) -> Digest:
        """SHA-256 of the canonical JSON. A version read back from the log keeps the id it is stored under."""
        return values.digest(self)
