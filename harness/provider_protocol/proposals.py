"""Writes a provider's proposals for the effects that its request names; what it cannot speak of it leaves out. Pure."""

from msgspec import UNSET

from harness.contracts.effects import Effect
from harness.contracts.protocol import IntendedEffect, Parameters, ProposedFact, StartRequest


def intended(request: StartRequest) -> tuple[IntendedEffect, ...]:
    """The effects that a request is for; none where the supervisor named none."""
    return () if request.intended is UNSET else request.intended


def claims(request: StartRequest, kind: type[Effect], arguments: Parameters) -> tuple[ProposedFact, ...]:
    """One proposal for each intended effect of this kind, with the provider's own figures."""
    return tuple(
        ProposedFact(name=one.effect.predicate, arguments=arguments)
        for one in intended(request)
        if isinstance(one.effect, kind)
    )
