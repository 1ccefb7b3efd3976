"""Results of the conformance kit: what a row observed, whether it passes, and why a row was not tried."""

from collections.abc import Callable
from typing import Literal

from harness.contracts.capabilities import CapabilityCard
from harness.contracts.errors import HarnessError, ProviderFailed, ProviderUnreachable, UnknownName
from harness.contracts.ids import ProviderId
from harness.contracts.reasons import Reason, plain
from harness.contracts.values import Value

Outcome = Literal["met", "not met", "exempt"]
UNTYPED = (ArithmeticError, AssertionError, AttributeError, LookupError, OSError, RuntimeError, TypeError, ValueError)
"""What a provider in this process may raise instead of a typed error."""


class RuleObservation(Value):
    """What one row observed, as a sentence, and whether it meets the contract."""

    met: bool
    text: str


class ConformanceFinding(Value):
    """One row of one provider. `text` is what was observed, or why the row is exempt."""

    row: str
    title: str
    outcome: Outcome
    text: str


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


def judged(text: str, *wrong: str) -> RuleObservation:
    """Met with `text` if nothing is wrong, else what is."""
    found = [one for one in wrong if one]
    return RuleObservation(met=not found, text="; ".join(found) if found else text)


def unless(holds: bool, wrong: str) -> str:
    """`wrong` unless it holds."""
    return "" if holds else wrong


def refusal(act: Callable[[], object], *kinds: type[HarnessError]) -> str:
    """What is wrong with the refusal that `act` must get; empty for a typed one that gives a remedy.

    A code with facts has its remedy in the catalogue; a refusal in words of its own must bring one.
    """
    expected = kinds or (ProviderFailed, UnknownName)
    try:
        act()
    except ProviderUnreachable as error:
        return f"no answer came instead of a refusal ({plain(error.what)})"
    except expected as error:
        if isinstance(error.__cause__, ValueError):
            return f"the answer cannot be read ({plain(error.what)})"
        remedied = isinstance(error.what, Reason) or bool(error.do)
        return unless(remedied, f"the refusal does not say what to do ({plain(error.what)})")
    except HarnessError as error:
        return f"it was refused as {error.code}, not as {expected[0].code}"
    except UNTYPED as error:
        return f"it was answered with an untyped {type(error).__name__} ({error})"
    return "it was accepted"
