"""Turns a person's edit of a configuration, as JSON or YAML text, into a candidate like any other.

The text is data from outside: strict, bounded and typed. Whatever cannot be read is refused, with the position in it.
"""

from harness.contracts.configuration import Configuration
from harness.contracts.errors import ContractInvalid
from harness.contracts.reasons import because
from harness.contracts.values import Positive, Value
from harness.workspace.contract_yaml import read_yaml
from rsi_reviews import contracts
from rsi_reviews.candidates import read_configuration
from rsi_reviews.errors import CandidateInvalid
from rsi_reviews.manifest import sections_changed


class Intention(Value):
    """What a person states with an edit."""

    reason: contracts.Sentence
    intended_effect: contracts.Sentence
    metric: contracts.Metric = "recovery_cost"
    smallest_effect: Positive = 0.05
    motives: tuple[contracts.Motive, ...] = ()


def edited(text: str, current: Configuration, intention: Intention, *, who: str) -> contracts.Candidate:
    """The candidate of one edit. Raises CandidateInvalid: unreadable, unchanged, or more than one section changed."""
    configuration = read_edit(text)
    changed = sections_changed(current, configuration)
    if len(changed) != 1:
        raise CandidateInvalid(
            because("edit_of_several_sections", sections=tuple(changed) or ("none",)),
            rule="other_component" if changed else "no_change",
            where="edit",
        )
    baseline = current.configuration_id
    manifest = contracts.Manifest(
        component=changed[0],
        reason=intention.reason,
        intended_effect=intention.intended_effect,
        metric=intention.metric,
        direction=contracts.BETTER[intention.metric],
        smallest_effect=intention.smallest_effect,
        baseline=baseline,
        rollback=baseline,
        author=contracts.Author(name=who, kind="person"),
        motives=intention.motives,
    )
    return contracts.Candidate(configuration=configuration, manifest=manifest, baseline=baseline)


def read_edit(text: str) -> Configuration:
    """A configuration from a person's editor: JSON if it begins with a brace, otherwise YAML."""
    if text.lstrip().startswith("{"):
        return read_configuration(text.encode())
    try:
        return read_yaml(text, Configuration, where="edit", foreign=True)
    except ContractInvalid as error:
        raise CandidateInvalid(error.what, rule="not_readable", where=error.where, do=error.do) from error
