"""When an identity provider is asked for itself: once an hour, once more for a new key, and not at once when away."""

from collections.abc import Iterator

import pytest

from harness.adapters.identity.openid import AWAY_S, KEYS_AGAIN_S, KNOWN_S, OpenIdProvider, Registration
from harness.contracts.identity import IssuerUnreachable, SignatureBad, SignInAttempt
from tests.fakes.issuer import CLIENT_ID, CLIENT_SECRET, Issuer, issuing, new_key
from tests.saying import raises_saying

ATTEMPT = SignInAttempt(state="s" * 43, nonce="n" * 43, verifier="v" * 43)
BACK = "http://127.0.0.1:8000/account/oidc/back"


class Watch:
    """A clock that moves when told."""

    now_s = 1000.0

    def __call__(self) -> float:
        return self.now_s


@pytest.fixture
def issuer() -> Iterator[Issuer]:
    with issuing() as running:
        yield running


@pytest.fixture
def watch() -> Watch:
    return Watch()


@pytest.fixture
def provider(issuer: Issuer, watch: Watch) -> OpenIdProvider:
    known = Registration(issuer=issuer.url, client_id=CLIENT_ID, back=BACK)
    return OpenIdProvider(known, secret=CLIENT_SECRET, clock=watch)


def finish(provider: OpenIdProvider, issuer: Issuer, watch: Watch) -> str:
    """The subject of a person who comes back now."""
    challenge = dict(one.split("=", 1) for one in provider.begin(ATTEMPT).split("?", 1)[1].split("&"))["code_challenge"]
    issuer.codes["c"] = {"redirect_uri": BACK, "code_challenge": challenge, "nonce": ATTEMPT.nonce}
    issuer.claims = {"iat": int(watch.now_s), "exp": int(watch.now_s) + 300}
    return provider.finish(ATTEMPT, code="c", issuer=issuer.url, by_groups=lambda subject: True).subject


def test_what_it_says_of_itself_counts_for_an_hour(provider: OpenIdProvider, issuer: Issuer, watch: Watch) -> None:
    provider.begin(ATTEMPT)
    watch.now_s += KNOWN_S - 1
    provider.begin(ATTEMPT)
    assert issuer.asked == ["discovery", "keys"]
    watch.now_s += 1
    provider.begin(ATTEMPT)
    assert issuer.asked == ["discovery", "keys"] * 2


def test_one_that_is_away_is_asked_again_after_a_while(provider: OpenIdProvider, issuer: Issuer, watch: Watch) -> None:
    issuer.broken = True
    for _ in range(3):
        with raises_saying(IssuerUnreachable, match="503"):
            provider.begin(ATTEMPT)
    assert issuer.asked == ["discovery"]
    issuer.broken = False
    watch.now_s += AWAY_S
    assert provider.begin(ATTEMPT).startswith(f"{issuer.url}/authorize?")


def test_new_keys_are_found_and_unknown_ones_do_not_make_us_ask_on_and_on(
    provider: OpenIdProvider, issuer: Issuer, watch: Watch
) -> None:
    assert finish(provider, issuer, watch) == issuer.person["sub"]
    issuer.key = new_key("second")
    with pytest.raises(SignatureBad):
        finish(provider, issuer, watch)
    assert issuer.asked.count("keys") == 1, "the keys were only just read"
    watch.now_s += KEYS_AGAIN_S
    assert finish(provider, issuer, watch) == issuer.person["sub"]
    issuer.published, issuer.key = [issuer.key], new_key("third")
    watch.now_s += KEYS_AGAIN_S
    for _ in range(3):
        with pytest.raises(SignatureBad):
            finish(provider, issuer, watch)
    assert issuer.asked.count("keys") == 3


def test_a_code_is_exchanged_as_the_issuer_says_it_takes_credentials(
    issuer: Issuer, watch: Watch, provider: OpenIdProvider
) -> None:
    issuer.document = {"token_endpoint_auth_methods_supported": ["client_secret_post"]}
    assert finish(provider, issuer, watch) == issuer.person["sub"]
    assert issuer.credentials == "client_secret_post"
