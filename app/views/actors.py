"""Says who acted, and why, where a program did: people read no identifier of the harness's own rules."""

from collections.abc import Mapping

from app.i18n.catalogues import N_
from harness.contracts.actors import Actor
from harness.contracts.reasons import Explanation
from rsi_reviews.rollback import DESK

RULES: Mapping[str, str] = {DESK.name: N_("the release rules")}
"""The harness's own actors by name; every other name was given by a person."""
STEPS: Mapping[str, str] = {
    "begin": N_("The evaluation was started."),
    "results": N_("Every case was run; these are the results."),
}
"""The steps of an evaluation, which a program signs in a person's name with `evaluate: STEP`."""


def actor_name(actor: Actor) -> str:
    """The name of whoever acted, as people read it."""
    return RULES.get(actor.name, actor.name)


def is_rule(actor: Actor) -> bool:
    """Whether a rule of the harness acted, which has no role."""
    return actor.name in RULES


def signed_reason(reason: Explanation) -> Explanation:
    """The reason that somebody signed with; the words of a program as a sentence."""
    if not isinstance(reason, str):
        return reason
    program, _, step = reason.partition(": ")
    return STEPS.get(step, reason) if program == "evaluate" else reason
