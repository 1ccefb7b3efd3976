"""Every way in which an identity provider is not taken at its word: refused, named in the trail, nothing changed."""

import re

import pytest
from fastapi.testclient import TestClient

from tests.builders.consoles import BASE, OWN
from tests.builders.oidc_console import RETURNING, OidcConsole, cookies, oidc_console
from tests.builders.people import PASSWORD
from tests.fakes.issuer import ADA, Issuer, new_key

WRONG: tuple[tuple[dict[str, object], str], ...] = (
    ({"iss": "https://elsewhere.example"}, "wrong_issuer"),
    ({"aud": "another-client"}, "token_invalid"),
    ({"aud": "another-client", "azp": "regen-console"}, "token_invalid"),
    ({"aud": None}, "token_invalid"),
    ({"aud": ["regen-console", "another"], "azp": "another"}, "token_invalid"),
    ({"exp": 1}, "token_expired"),
    ({"exp": None}, "token_invalid"),
    ({"iat": 9999999999}, "token_invalid"),
    ({"nonce": "another"}, "nonce_mismatch"),
    ({"nonce": None}, "nonce_mismatch"),
    ({"sub": ""}, "token_invalid"),
    ({"sub": 7}, "token_invalid"),
    ({"at_hash": "of-another-token"}, "token_invalid"),
)


def test_a_token_for_somebody_else_for_another_time_or_sign_in_is_refused(here: OidcConsole) -> None:
    for wrong, code in WRONG:
        here.issuer.claims = wrong
        client = here.browser()
        assert here.enter(client).status_code == 403, wrong
        assert here.refusals()[0] == code, wrong
        assert here.keeps_out(client), wrong
    assert len(here.refusals()) == len(WRONG)


@pytest.mark.parametrize("algorithm", ["none", "HS256"])
def test_a_token_that_no_key_of_the_issuers_own_signed_is_refused(here: OidcConsole, algorithm: str) -> None:
    here.issuer.algorithm = algorithm
    client = here.browser()
    assert here.enter(client).status_code == 403
    assert here.refusals() == ["token_unsigned"]
    assert here.keeps_out(client)


def test_a_token_signed_with_a_strangers_key_of_the_same_name_is_refused(here: OidcConsole) -> None:
    here.issuer.published = [here.issuer.key]
    here.issuer.key = new_key("first")
    client = here.browser()
    assert here.enter(client).status_code == 403
    assert here.refusals() == ["bad_signature"]
    assert here.keeps_out(client)


def test_a_way_back_works_once_in_the_browser_that_began_it_with_the_state_it_began_with(here: OidcConsole) -> None:
    client = here.browser()
    back = here.signed(here.away(client))
    elsewhere = here.browser()
    assert elsewhere.get(back, headers=RETURNING).status_code == 403
    planted = TestClient(here.stand.app, base_url=BASE, headers=OWN, cookies={"regen_sign_in_8000": "planted"})
    assert planted.get(back, headers=RETURNING).status_code == 403
    assert here.refusals() == [], "nothing began there"
    assert "regen_sign_in_8000" in cookies(client)
    assert client.get(back, headers=RETURNING).status_code == 200
    assert "regen_sign_in_8000" not in cookies(client)
    assert client.get(back, headers=RETURNING).status_code == 403
    other = here.browser()
    assert here.enter(other, changed={"state": "another"}).status_code == 403
    assert here.refusals() == ["state_mismatch"]
    assert [one.get("/").status_code for one in (elsewhere, planted, other)] == [401, 401, 401]


def test_a_code_that_was_used_is_refused(here: OidcConsole) -> None:
    client = here.browser()
    back = here.signed(here.away(client))
    assert client.get(back, headers=RETURNING).status_code == 200
    used = re.findall(r"code=([^&]+)", back)[0]
    assert here.enter(client, changed={"code": used}).status_code == 403
    assert here.refusals() == ["code_refused"]


def test_a_code_of_another_browser_lacks_its_verifier(here: OidcConsole) -> None:
    """A code that somebody stole is put into a sign-in of their own: PKCE binds it to the browser that asked."""
    stolen = re.findall(r"code=([^&]+)", here.signed(here.away(here.browser())))[0]
    thief = here.browser()
    assert here.enter(thief, changed={"code": stolen}).status_code == 403
    assert here.refusals() == ["code_refused"]
    assert thief.get("/").status_code == 401


def test_an_answer_of_another_issuer_or_none_at_all_is_refused(here: OidcConsole) -> None:
    assert here.enter(here.browser(), changed={"iss": "https://elsewhere.example"}).status_code == 403
    assert here.enter(here.browser(), changed={"iss": ""}).status_code == 403
    assert here.enter(here.browser(), changed={"error": "access_denied", "code": ""}).status_code == 403
    assert here.refusals() == ["issuer_declined", "wrong_issuer", "wrong_issuer"]
    assert "token" not in here.issuer.asked


def test_an_issuer_that_does_not_answer_is_named_and_passwords_go_on(issuer: Issuer) -> None:
    with oidc_console(issuer) as here:
        issuer.broken = True
        answer = here.browser().get("/account/oidc")
        assert answer.status_code == 502
        assert "The identity provider does not answer." in answer.text
        assert "set-cookie" not in answer.headers
    with oidc_console(issuer, issuer="http://127.0.0.1:9") as here:
        client = here.browser()
        assert client.get("/account/oidc").status_code == 502
        entered = client.post("/account/sign-in", data={"name": "the-admin", "password": PASSWORD})
        assert entered.status_code == 303


@pytest.mark.parametrize(
    "document",
    [
        {"issuer": "https://elsewhere.example"},
        {"token_endpoint": "https://elsewhere.example/token"},
        {"token_endpoint": None},
        {"jwks_uri": "http://127.0.0.1:9/keys"},
        {"jwks_uri": "file:///etc/passwd"},
        {"authorization_endpoint": "https://elsewhere.example/authorize"},
        {"authorization_endpoint": "javascript:alert(1)"},
    ],
)
def test_nobody_is_asked_and_nobody_sent_outside_of_the_configured_hosts(
    here: OidcConsole, document: dict[str, object]
) -> None:
    here.issuer.document = document
    client = here.browser()
    answer = client.get("/account/oidc")
    if answer.status_code == 303:
        answer = client.get(here.signed(str(answer.headers["location"])), headers=RETURNING)  # type: ignore[assignment]
    assert answer.status_code == 403
    assert "Another identity provider answered" in answer.text
    assert "location" not in answer.headers


def test_a_wrong_client_secret_is_the_admins_matter(issuer: Issuer) -> None:
    with oidc_console(issuer, client_secret="wrong") as here:
        assert here.enter(here.browser()).status_code == 403
        assert here.refusals() == ["client_refused"]


SILENT = {"sub": ADA["sub"], "preferred_username": "ada"}
GROUPS = {"groups": ["robot-admins"]}
TOLD: tuple[tuple[dict[str, object], dict[str, object], str], ...] = (
    ({**GROUPS, "sub": "somebody else"}, {}, "person_mismatch"),
    ({**GROUPS}, {}, "person_mismatch"),
    ({**GROUPS, "sub": [ADA["sub"]]}, {}, "person_mismatch"),
    ({**GROUPS, "sub": ADA["sub"]}, {"token_type": "mac"}, "token_invalid"),
    ({**GROUPS, "sub": ADA["sub"]}, {"access_token": None}, "token_invalid"),
    ({**GROUPS, "sub": ADA["sub"]}, {"access_token": "a\r\nX-Other: b"}, "token_invalid"),
    ({**GROUPS, "sub": ADA["sub"]}, {"access_token": "another"}, "issuer_unreachable"),
    ({"sub": ADA["sub"], "groups": {"robot-admins": 1}}, {}, "role_missing"),
    ({"sub": ADA["sub"]}, {}, "role_missing"),
)


def test_what_is_told_of_somebody_else_or_to_nobody_we_know_gives_no_role(here: OidcConsole) -> None:
    here.issuer.person = SILENT
    for said, given, code in TOLD:
        here.issuer.said, here.issuer.given = said, given
        client = here.browser()
        assert here.enter(client).status_code in (403, 502), said
        assert here.refusals()[0] == code, (said, given)
        assert here.keeps_out(client), said
    assert len(here.refusals()) == len(TOLD)


@pytest.mark.parametrize("endpoint", ["https://elsewhere.example/person", "http://127.0.0.1:9/person", 7, None])
def test_an_access_token_goes_to_no_host_that_is_not_configured(here: OidcConsole, endpoint: object) -> None:
    here.issuer.person, here.issuer.document = SILENT, {"userinfo_endpoint": endpoint}
    assert here.enter(here.browser()).status_code == 403
    assert here.refusals() == ["role_missing"]
    assert "person" not in here.issuer.asked
