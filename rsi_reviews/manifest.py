"""Checks whether a manifest states the purpose of a change in a testable form (R156, D31). Pure."""

import re
import unicodedata
from collections.abc import Iterator
from math import isfinite, log

from harness.contracts.configuration import Configuration
from harness.contracts.reasons import Fact, because
from harness.contracts.values import encode
from rsi_reviews import contracts

_ORDERS = re.compile(
    r"(ignore|disregard|forget|override)\b.{0,40}\b(instruction|rule|prompt|above|previous|prior)"
    r"|\b(system|assistant|developer)\s*(prompt|message)?\s*:"
    r"|\byou (are|must|should|have to|will)\b.{0,60}\b(approve|accept|pass|release|authori[sz]e|reviewer|assistant)"
    r"|\b(approve|accept|release|authori[sz]e|pass)\s+(this|the)\s+(candidate|change|configuration|release)\b"
    r"|\b(respond|answer|reply|output)\s+(only\s+)?(with|:)"
    r"|<\s*/?\s*[a-z|!]|\[/?inst\]|```",
    re.IGNORECASE | re.DOTALL,
)


def sections_changed(baseline: Configuration, candidate: Configuration) -> tuple[contracts.Section, ...]:
    """The sections whose canonical JSON differs, in the paper's order."""
    return tuple(
        name for name in contracts.SECTIONS if encode(getattr(baseline, name)) != encode(getattr(candidate, name))
    )


def unfounded(candidate: contracts.Candidate, baseline: Configuration) -> tuple[contracts.RestrictionViolation, ...]:
    """Every reason why this manifest is invalid: what changed, against what, measured how, and in which words."""
    manifest = candidate.manifest
    return (
        *_identity(candidate, baseline),
        *_component(manifest, sections_changed(baseline, candidate.configuration)),
        *_measure(manifest),
        *_words(manifest),
        *_canary(manifest.canary),
    )


def _identity(candidate: contracts.Candidate, baseline: Configuration) -> Iterator[contracts.RestrictionViolation]:
    manifest, shipped = candidate.manifest, baseline.configuration_id
    if candidate.baseline != manifest.baseline or manifest.baseline != shipped:
        yield _refusal("other_baseline", "manifest.baseline", shipped, manifest.baseline, "another_baseline")
    if manifest.rollback != manifest.baseline:
        yield _refusal(
            "rollback_target", "manifest.rollback", manifest.baseline, manifest.rollback,
            "rollback_target",
        )  # fmt: skip


def _component(
    manifest: contracts.Manifest, changed: tuple[contracts.Section, ...]
) -> Iterator[contracts.RestrictionViolation]:
    if not changed:
        yield _refusal("no_change", "configuration", "", "", "no_change")
    elif changed != (manifest.component,):
        yield _refusal(
            "other_component", "manifest.component", manifest.component, ", ".join(changed),
            "other_component",
        )  # fmt: skip


def _measure(manifest: contracts.Manifest) -> Iterator[contracts.RestrictionViolation]:
    if contracts.BETTER[manifest.metric] != manifest.direction:
        yield _refusal(
            "wrong_direction", "manifest.direction", contracts.BETTER[manifest.metric], manifest.direction,
            "wrong_direction", metric=manifest.metric, direction=contracts.BETTER[manifest.metric],
        )  # fmt: skip
    if not isfinite(manifest.smallest_effect):
        yield _refusal("not_a_number", "manifest.smallest_effect", "", "", "effect_not_finite")


def _words(manifest: contracts.Manifest) -> Iterator[contracts.RestrictionViolation]:
    texts = {"reason": manifest.reason, "intended_effect": manifest.intended_effect, "author": manifest.author.name}
    for field, text in texts.items():
        hidden = [char for char in text if unicodedata.category(char) in ("Cc", "Cf", "Co", "Cs") and char != "\n"]
        if hidden:
            yield _refusal("hidden_text", f"manifest.{field}", "", repr(hidden[0]), "hidden_text")
        if found := _ORDERS.search(unicodedata.normalize("NFKC", text)):
            yield _refusal(
                "instructs_reviewer", f"manifest.{field}", "", found.group(0)[:200],
                "instructs_reviewer",
            )  # fmt: skip


def _canary(test: contracts.CanaryTest) -> Iterator[contracts.RestrictionViolation]:
    """Rejects a test that could never end in a rollback, or that ends in one by chance too often."""
    harmless = 1.0 - test.quantile
    if not 0.0 < harmless < test.harmful_share < 1.0:
        yield _refusal(
            "canary_test", "manifest.canary", f"{harmless:g}", f"{test.harmful_share:g}",
            "canary_shares",
        )  # fmt: skip
    elif test.missions * log(test.harmful_share / harmless) < log(1.0 / test.alpha):
        yield _refusal(
            "canary_test", "manifest.canary.missions", "", test.missions,
            "canary_too_short",
        )  # fmt: skip
    if test.window < test.missions:
        yield _refusal("canary_test", "manifest.canary.window", test.missions, test.window, "canary_window_too_short")


def _refusal(
    rule: str, path: str, old: object, new: object, code: str, **facts: Fact
) -> contracts.RestrictionViolation:
    return contracts.RestrictionViolation(
        rule=rule, path=path, old=str(old), new=str(new), reason=because(code, **facts)
    )
