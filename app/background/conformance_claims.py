"""Reads what a provider's shipped conformance file claims; it is a claim until the conformance kit is run."""

from app.views.providers import Conformance
from harness.conformance.conformance_file import shipped
from harness.contracts.errors import UnknownName
from harness.contracts.ids import ProviderId


def claimed(provider_id: ProviderId) -> Conformance | None:
    """None where no file ships."""
    try:
        file = shipped(provider_id)
    except UnknownName:
        return None
    return Conformance(meets=file.meets, exempt=tuple(sorted(file.exempt.items())))
