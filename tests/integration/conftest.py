"""What tests of the integration room share: an identity provider on loopback, and a console that trusts it."""

from collections.abc import Iterator

import pytest

from tests.builders.oidc_console import OidcConsole, oidc_console
from tests.fakes.issuer import Issuer, issuing


@pytest.fixture
def issuer() -> Iterator[Issuer]:
    with issuing() as running:
        yield running


@pytest.fixture
def here(issuer: Issuer) -> Iterator[OidcConsole]:
    """A console with an admin, who has a password."""
    with oidc_console(issuer) as made:
        yield made
