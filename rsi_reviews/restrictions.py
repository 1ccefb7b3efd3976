"""Finds what a candidate would loosen, before anything runs (D30). Pure. It is an allow-list: what is not listed may
not change.

The gate, the acceptance predicate, safety limits and suites are no part of a configuration, so a candidate cannot
change them.
"""

from collections.abc import Iterator
from typing import Any, get_args

from harness.contracts import configuration
from harness.contracts.reasons import Fact, because
from harness.contracts.tasks import TaskTemplate
from rsi_reviews.contracts import RestrictionViolation
from rsi_reviews.template_restrictions import display_value, loosened_template

ITEM_CEILINGS: dict[str, int] = {"c1_items": 48, "c2_items": 24, "c2_examples": 6, "c4_items": 40}
"""Twice the context budgets of D22, in records. C3's is the verifier's and may not change at all."""
WEIGHT_CEILING = 10.0
HALF_LIFE_CEILING = 1000.0
WAIT_CEILING_S = 120.0
LOCKED_LADDERS: tuple[configuration.FailureClass, ...] = ("unsafe_action", "outcome_unknown", "cancel_unacknowledged")
"""What happens next is a safety interlock: stopping, and never sending again blindly (D13)."""
LONGEST_LADDER = 8
_STOPPING: tuple[configuration.RecoveryAction, ...] = ("reattach", "stop", "safe_stop", "human")
"""Steps that are taken at once: they cannot stay impossible for `wait_s`."""


def loosened(
    baseline: configuration.Configuration, candidate: configuration.Configuration
) -> tuple[RestrictionViolation, ...]:
    """Every loosening of the candidate against its baseline, with path, old and new value, and the rule's name."""
    return (
        *_context_rules(baseline.context_rules, candidate.context_rules),
        *_templates(baseline.templates, candidate.templates),
        *_routing(candidate.routing),
        *_recovery(baseline.recovery, candidate.recovery),
    )


def _context_rules(old: configuration.ContextRules, new: configuration.ContextRules) -> Iterator[RestrictionViolation]:
    if new.c3_items != old.c3_items:
        yield _refusal("c3_rule", "context_rules.c3_items", old.c3_items, new.c3_items, "verifier_context_fixed")
    for name, ceiling in ITEM_CEILINGS.items():
        was, would = getattr(old, name), getattr(new, name)
        if would > ceiling:
            yield _refusal("budget_ceiling", f"context_rules.{name}", was, would, "too_many_records", limit=ceiling)
    if new.minimum_confidence < old.minimum_confidence:
        yield _refusal(
            "confidence",
            "context_rules.minimum_confidence",
            old.minimum_confidence,
            new.minimum_confidence,
            "less_certain_records",
        )
    for name in ("pose_age_s", "image_age_s"):
        was, would = getattr(old, name), getattr(new, name)
        if would > was:
            yield _refusal("freshness", f"context_rules.{name}", was, would, "older_records_fresh")


def _templates(old: tuple[TaskTemplate, ...], new: tuple[TaskTemplate, ...]) -> Iterator[RestrictionViolation]:
    before, after = {template.name: template for template in old}, {template.name: template for template in new}
    for name in (template.name for template in new if template.name not in before):
        yield _refusal("template_added", f"templates.{name}", "", name, "nothing_to_compare_with")
    for name in sorted({one.name for one in new if [other.name for other in new].count(one.name) > 1}):
        yield _refusal("template_twice", f"templates.{name}", 1, 2, "template_twice")
    for name, template in before.items():
        if name not in after:
            yield _refusal("template_dropped", f"templates.{name}", name, "", "template_dropped")
        else:
            yield from loosened_template(template, after[name])


def _routing(new: configuration.RoutingPreferences) -> Iterator[RestrictionViolation]:
    for name in ("success", "risk", "uncertainty", "latency", "cost", "history"):
        weight = getattr(new, name)
        if not 0.0 <= weight <= WEIGHT_CEILING:
            yield _refusal("weight_bounds", f"routing.{name}", "", weight, "weight_out_of_bounds", limit=WEIGHT_CEILING)
    if not 0.0 < new.history_half_life <= HALF_LIFE_CEILING:
        yield _refusal(
            "weight_bounds",
            "routing.history_half_life",
            "",
            new.history_half_life,
            "half_life_out_of_bounds",
            limit=HALF_LIFE_CEILING,
        )


def _recovery(old: configuration.RecoveryPolicy, new: configuration.RecoveryPolicy) -> Iterator[RestrictionViolation]:
    if new.approval_share > old.approval_share:
        yield _refusal(
            "approval_requirement",
            "recovery.approval_share",
            old.approval_share,
            new.approval_share,
            "more_without_person",
        )
    if not 0.0 < new.wait_s <= WAIT_CEILING_S:
        yield _refusal(
            "wait_bounds", "recovery.wait_s", old.wait_s, new.wait_s, "at_most_seconds", limit_s=WAIT_CEILING_S
        )
    for failure in get_args(configuration.FailureClass):
        yield from _ladder(failure, old.ladders.get(failure, ()), new.ladders.get(failure, ()))
    yield from _postponed(old, new)


def longest_idle_s(ladder: tuple[configuration.RecoveryAction, ...], wait_s: float) -> float:
    """The longest time in which nothing is tried until this ladder asks a person, seconds of mission time (D30a).

    Every `wait` may last `wait_s`. Any other step may stay impossible that long, and then a person is asked at once: so
    one more wait counts, if there is such a step. What a step then does is bounded by its stage's timeout and budget.
    """
    return wait_s * (ladder.count("wait") + any(step not in ("wait", *_STOPPING) for step in ladder))


def _postponed(old: configuration.RecoveryPolicy, new: configuration.RecoveryPolicy) -> Iterator[RestrictionViolation]:
    """A person is asked no later than under the baseline, whatever fails: waiting is no answer to a failure."""
    by_wait: list[tuple[float, float]] = []
    for failure in get_args(configuration.FailureClass):
        before, after = old.ladders.get(failure, ()), new.ladders.get(failure, ())
        was_s, would_s = longest_idle_s(before, old.wait_s), longest_idle_s(after, new.wait_s)
        if would_s <= was_s + 1e-9:
            continue
        if after == before:
            by_wait.append((was_s, would_s))
            continue
        facts: dict[str, Fact] = {"was_s": was_s, "would_s": would_s, "failure": failure}
        yield _refusal("asks_later", f"recovery.ladders.{failure}", before, after, "person_asked_later", **facts)
    if by_wait:
        was_s, would_s = max(by_wait, key=lambda pair: pair[1])
        yield _refusal(
            "asks_later", "recovery.wait_s", old.wait_s, new.wait_s, "asked_later_by_wait", was_s=was_s, would_s=would_s
        )


def _ladder(
    failure: configuration.FailureClass,
    old: tuple[configuration.RecoveryAction, ...],
    new: tuple[configuration.RecoveryAction, ...],
) -> Iterator[RestrictionViolation]:
    path = f"recovery.ladders.{failure}"
    if failure in LOCKED_LADDERS and new != old:
        yield _refusal("safety_interlock", path, old, new, "ladder_locked")
        return
    if not new or new[-1] != "human" or "human" in new[:-1] or len(new) > LONGEST_LADDER:
        yield _refusal("ladder_end", path, old, new, "ladder_end", limit=LONGEST_LADDER)
    if old and old[0] in ("stop", "safe_stop") and new[:1] != old[:1]:
        yield _refusal("safety_interlock", path, old, new, "ladder_must_stop_first")
    after = new[new.index("switch_skill") + 1 :] if "switch_skill" in new else ()
    if any(action in configuration.SPENDING for action in after):
        yield _refusal("ladder_order", path, old, new, "ladder_order")


def _refusal(rule: str, path: str, old: Any, new: Any, code: str, **facts: Fact) -> RestrictionViolation:
    return RestrictionViolation(
        rule=rule, path=path, old=display_value(old), new=display_value(new), reason=because(code, **facts)
    )
