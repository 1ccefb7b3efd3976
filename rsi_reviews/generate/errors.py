"""Defines the errors of a generator, as one branch of the harness's error tree.

HarnessError
└── ModelSilent     the model behind the endpoint gave no answer: unreachable, refused, late, or cut short

An answer that cannot be taken is `rsi_reviews.errors.CandidateInvalid`, with the rule it broke.
"""

from harness.contracts.errors import HarnessError


class ModelSilent(HarnessError):
    """No answer came from the model's endpoint."""

    code = "model_silent"
