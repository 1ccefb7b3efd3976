"""Results of the conformance kit: what a row observed, whether it passes, and why a row was not tried."""

from collections.abc import Callable
from typing import Literal

from harness.contracts.capabilities import CapabilityCard
from harness.contracts.errors import HarnessError, ProviderFailed, ProviderUnreachable, UnknownName
from harness.contracts.ids import ProviderId
from harness.contracts.reasons import Explanation, Reason, because, several
from harness.contracts.values import Value

Outcome = Literal["met", "not met", "exempt"]
UNTYPED = (ArithmeticError, AssertionError, AttributeError, LookupError, OSError, RuntimeError, TypeError, ValueError)
"""What a provider in this process may raise instead of a typed error."""


class RuleObservation(Value):
    """What one row observed, and whether it meets the contract."""

    met: bool
    text: Explanation


class ConformanceFinding(Value):
    """One row of one provider. `text` is what was observed, or why the row is exempt.

    The title is a reason; results of older releases hold it as text.
    """

    row: str
    title: Explanation
    outcome: Outcome
    text: Explanation


class ConformanceResult(Value):
    """The findings of one provider on all rows."""

    provider_id: ProviderId
    version: str
    card: CapabilityCard
    findings: tuple[ConformanceFinding, ...]

    @property
    def ok(self) -> bool:
        """Whether every row is met or exempt."""
        return all(finding.outcome != "not met" for finding in self.findings)

    def rows(self, outcome: Outcome) -> tuple[str, ...]:
        return tuple(finding.row for finding in self.findings if finding.outcome == outcome)


def judged(text: Reason, *wrong: Reason | None) -> RuleObservation:
    """Met with `text` if nothing is wrong, else what is."""
    found = several([one for one in wrong if one is not None])
    return RuleObservation(met=found is None, text=found or text)


def unless(holds: bool, wrong: Reason | None) -> Reason | None:
    """`wrong` unless it holds."""
    return None if holds else wrong


def refusal(act: Callable[[], object], *kinds: type[HarnessError]) -> Reason | None:
    """What is wrong with the refusal that `act` must get; None for a typed one that gives a remedy.

    A code with facts has its remedy in the catalogue; a refusal in words of its own must bring one.
    """
    expected = kinds or (ProviderFailed, UnknownName)
    try:
        act()
    except ProviderUnreachable as error:
        return because("kit_no_answer", reason=error.reason)
    except expected as error:
        if isinstance(error.__cause__, ValueError):
            return because("kit_answer_unreadable", reason=error.reason)
        remedied = isinstance(error.what, Reason) or bool(error.do)
        return unless(remedied, because("kit_refusal_without_remedy", reason=error.reason))
    except HarnessError as error:
        return because("kit_refused_otherwise", code=error.code, expected=expected[0].code)
    except UNTYPED as error:
        return because("kit_untyped", kind=type(error).__name__, error=str(error))
    return because("kit_accepted")
