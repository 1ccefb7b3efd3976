"""Defines the findings of an adjudicator about one mission: sentences by kind, of which most kinds should never
appear.
"""

from harness.contracts.values import Value


class Findings(Value):
    """Sentences, one per violation. `contract_false`: accepted although the evidence, or the lack of it, contradicted.

    `epistemic_false`: the evidence supported it and the truth differed. `breaches`: a rule of the project that is
    neither of these: budgets, leases, answers, starts without an intent, planner text before the verifier.
    """

    contract_false: tuple[str, ...] = ()
    epistemic_false: tuple[str, ...] = ()
    false_rejections: tuple[str, ...] = ()
    duplicate_starts: tuple[str, ...] = ()
    unauthorised: tuple[str, ...] = ()
    breaches: tuple[str, ...] = ()
    commits: int = 0
    rejections: int = 0
    starts: int = 0
    dispatches: int = 0

    @property
    def offences(self) -> tuple[str, ...]:
        """The violations: every finding but those that no gate can see and those that only cost time."""
        return (*self.contract_false, *self.duplicate_starts, *self.unauthorised, *self.breaches)
