"""Signing in at an identity provider that runs on loopback: who comes in, in which roles, to where, and out again."""

import json
import re
from threading import current_thread

import pytest
from fastapi.testclient import TestClient

from app.auth.permissions import GRANTS, ROLES
from app.i18n.reasons.rendering import sentence
from tests.builders.consoles import BASE, FOREIGN, OWN
from tests.builders.oidc_console import RETURNING, OidcConsole, cookies, oidc_console
from tests.builders.people import PASSWORD, SETTING_UP, store_of
from tests.fakes.issuer import ACCESS_TOKEN, ADA, CLIENT_SECRET, Issuer


def test_a_person_of_a_mapped_group_comes_in_with_that_role_and_lands_where_they_wanted_to_go(
    here: OidcConsole,
) -> None:
    client = here.browser()
    refused = client.get("/missions?status=running")
    on = re.findall(r'href="(/account/sign-in[^"]*)"', refused.text)[0]
    button = re.findall(r'href="(/account/oidc[^"]*)">Sign in with Example ID<', client.get(on).text)[0]
    back = here.signed(str(client.get(button).headers["location"]))
    entered = client.get(back, headers=RETURNING)
    assert entered.status_code == 200
    assert 'http-equiv="refresh" content="0; url=/missions?status=running"' in entered.text
    own = client.get("/api/v1/account").json()
    assert (own["name"], own["roles"]) == ("ada", ["operator"])
    assert [one.kind for one in store_of(here.stand).audit_log(actor="ada")] == ["sign_in.accepted"]
    added = store_of(here.stand).audit_log(kind="account.added")[0]
    assert (added.actor, added.subject, added.source) == ("identity provider", "ada", "testclient")
    assert added.detail == f"operator, {ADA['sub']} at {here.issuer.url}"


def test_what_goes_to_the_issuer_carries_state_nonce_and_a_challenge_and_the_secret_stays_here(
    here: OidcConsole,
) -> None:
    first, second = here.away(here.browser()), here.away(here.browser())
    for one in ("state", "nonce", "code_challenge"):
        values = [re.findall(rf"[?&]{one}=([^&]+)", away)[0] for away in (first, second)]
        assert len(values[0]) == 43
        assert values[0] != values[1]
    assert "code_challenge_method=S256" in first
    assert "response_type=code" in first
    assert "secret" not in first
    assert here.issuer.asked == ["discovery", "keys"], "the issuer is not asked again for every sign-in"


def test_the_same_person_is_one_account_and_another_of_the_same_name_is_another(here: OidcConsole) -> None:
    assert here.enter(here.browser()).status_code == 200
    here.issuer.person = {**ADA, "preferred_username": "ada.lovelace"}
    again = here.browser()
    here.enter(again)
    assert again.get("/api/v1/account").json()["name"] == "ada"
    here.issuer.person = {**ADA, "sub": "another", "preferred_username": "ada"}
    other = here.browser()
    here.enter(other)
    assert re.fullmatch(r"ada-[0-9a-f]{6}", other.get("/api/v1/account").json()["name"])


def test_a_name_that_is_taken_here_leads_to_nobody_elses_account(here: OidcConsole) -> None:
    here.issuer.person = {**ADA, "preferred_username": "the-admin"}
    client = here.browser()
    here.enter(client)
    own = client.get("/api/v1/account").json()
    assert own["name"].startswith("the-admin-")
    assert own["roles"] == ["operator"]


def test_roles_follow_the_groups_at_every_sign_in_and_nobody_changes_them_here(here: OidcConsole) -> None:
    client = here.browser()
    here.enter(client)
    here.issuer.person = {**ADA, "groups": ["robot-reviewers", "others"]}
    later = here.browser()
    here.enter(later)
    assert later.get("/api/v1/account").json()["roles"] == ["viewer", "reviewer"]
    assert client.get("/").status_code == 401, "other roles end the sessions that had the old ones"
    changed = store_of(here.stand).audit_log(kind="account.changed")[0]
    assert (changed.subject, changed.detail) == ("ada", "operator before, viewer reviewer now")
    admin = here.browser()
    admin.post("/account/sign-in", data={"name": "the-admin", "password": PASSWORD})
    shown = admin.get("/account/people").text
    assert f"{ADA['sub']} at {here.issuer.url}" in shown
    assert "Save roles of ada" not in shown
    assert "Save roles of the-admin" in shown
    assert "Change your password" not in later.get("/account").text
    assert "Change your password" in admin.get("/account").text
    refused = admin.post("/account/people/ada", data={"do": "roles", "roles": ["admin"]})
    assert refused.status_code == 422
    assert "identity provider" in refused.text
    assert admin.post("/account/people/ada", data={"do": "password", "password": PASSWORD}).status_code == 422
    here.issuer.person = {**ADA, "groups": []}
    assert here.enter(here.browser()).status_code == 403
    assert later.get("/").status_code == 401, "who lost every role is out at once"


def test_a_stranger_is_told_what_to_ask_for(here: OidcConsole) -> None:
    for groups in ([], ["others"], "robot-operators ", {"robot-operators": 1}, None, [["robot-operators"]]):
        here.issuer.person = {**ADA, "groups": groups}
        client = here.browser()
        answer = here.enter(client)
        assert answer.status_code == 403
        assert "you have no role in this console" in answer.text
        assert "Ask an admin of this console for a role for one of your groups" in answer.text
        assert here.keeps_out(client)
    assert here.refusals() == ["role_missing"] * 6


SILENT = {"sub": ADA["sub"], "preferred_username": "ada"}
"""Ada where the identity token does not say a word about groups."""


def test_groups_that_the_token_lacks_are_asked_for_where_the_issuer_tells_of_people(here: OidcConsole) -> None:
    here.issuer.person = {"sub": ADA["sub"], "groups": None}
    here.issuer.said = {"sub": ADA["sub"], "preferred_username": "ada", "groups": ["robot-admins"]}
    client = here.browser()
    assert here.enter(client).status_code == 200
    own = client.get("/api/v1/account").json()
    assert (own["name"], own["roles"]) == ("ada", ["admin"])
    here.issuer.said = {"sub": ADA["sub"], "groups": ["robot-operators"]}
    again = here.browser()
    here.enter(again)
    assert again.get("/api/v1/account").json()["roles"] == ["operator"]
    assert here.issuer.asked.count("person") == 2


def test_what_the_token_says_of_groups_is_asked_of_nobody_else(here: OidcConsole) -> None:
    here.issuer.said = {"sub": ADA["sub"], "groups": ["robot-admins"]}
    client = here.browser()
    here.enter(client)
    assert client.get("/api/v1/account").json()["roles"] == ["operator"]
    here.issuer.person = {**ADA, "groups": []}
    assert here.enter(here.browser()).status_code == 403, "none is an answer, too"
    assert "person" not in here.issuer.asked


def test_who_has_an_account_by_name_comes_in_without_a_question_about_groups(here: OidcConsole) -> None:
    setting_up(here, "the-admin", subject=str(ADA["sub"]))
    here.issuer.person, here.issuer.said = SILENT, {"sub": "somebody else"}
    client = here.browser()
    assert here.enter(client).status_code == 200
    assert client.get("/api/v1/account").json()["name"] == "the-admin"
    assert "person" not in here.issuer.asked


def test_without_a_mapping_nobody_has_a_role(issuer: Issuer) -> None:
    with oidc_console(issuer, roles={}) as here:
        assert here.enter(here.browser()).status_code == 403
        assert here.refusals() == ["role_missing"]


def test_the_first_account_is_an_admins_by_this_door_too(issuer: Issuer) -> None:
    with oidc_console(issuer, settled=False) as here:
        first = here.stand.operator()
        assert here.enter(here.browser()).status_code == 403
        assert first.get("/").status_code == 200
        issuer.person = {**ADA, "groups": ["robot-admins"]}
        assert here.enter(here.browser()).status_code == 200
        assert first.get("/").status_code == 401, "one-time links let nobody in once there is an account"


def test_a_disabled_person_stays_out(here: OidcConsole) -> None:
    client = here.browser()
    here.enter(client)
    admin = here.browser()
    admin.post("/account/sign-in", data={"name": "the-admin", "password": PASSWORD})
    assert admin.post("/account/people/ada", data={"do": "disable"}).status_code == 303
    assert client.get("/").status_code == 401
    assert here.enter(client).status_code == 403
    assert here.refusals() == ["account_disabled"]


def test_who_has_no_password_signs_in_with_none(here: OidcConsole) -> None:
    here.enter(here.browser())
    for password in ("", "x", PASSWORD):
        answer = here.browser().post("/account/sign-in", data={"name": "ada", "password": password})
        assert answer.status_code == 403


def test_who_has_no_password_makes_a_token_for_a_terminal_and_acts_there_as_themselves(here: OidcConsole) -> None:
    client = here.browser()
    here.enter(client)
    assert "Make a token for a terminal" in client.get("/account").text
    assert here.browser().post("/account/terminal").status_code == 401
    made = client.post("/account/terminal")
    (token,) = re.findall(r"regen_login_[\w-]+", made.text)
    assert made.status_code == 201 and token not in client.get("/account").text
    terminal = TestClient(here.stand.app, base_url=BASE, headers={"Authorization": f"Bearer {token}"})
    assert terminal.post("/api/v1/missions", json={"template": "circuit", "robot_id": "vbot-1"}).status_code == 201
    (created,) = here.stand.harness.runtime.missions()
    events = here.stand.harness.runtime.events(created.mission_id)
    assert b'"name":"ada","role":"operator","channel":"human"' in events[0].body
    assert client.post("/account/sign-out-everywhere").status_code == 303
    assert terminal.get("/api/v1/missions").status_code == 401


def test_an_unverified_address_of_somebody_else_leads_to_nobody_elses_account(here: OidcConsole) -> None:
    unverified = {"preferred_username": None, "email": "the-admin", "email_verified": False}
    here.issuer.person = {**ADA, **unverified, "sub": "another"}
    client = here.browser()
    here.enter(client)
    own = client.get("/api/v1/account").json()
    assert (own["name"].startswith("the-admin-"), own["roles"]) == (True, ["operator"])


def test_a_session_is_fresh_and_the_one_before_is_over(here: OidcConsole) -> None:
    client = here.browser()
    client.post("/account/sign-in", data={"name": "the-admin", "password": PASSWORD})
    before = cookies(client)["regen_session_8000"]
    back = here.signed(here.away(client))
    strict = {**RETURNING, "Cookie": f"regen_sign_in_8000={cookies(client)['regen_sign_in_8000']}"}
    arriving = TestClient(here.stand.app, base_url=BASE, follow_redirects=False)
    assert arriving.get(back, headers=strict).status_code == 200, "the strict cookie is not sent on the way back"
    assert cookies(arriving)["regen_session_8000"] != before
    old = TestClient(here.stand.app, base_url=BASE, headers=OWN, cookies={"regen_session_8000": before})
    assert old.get("/").status_code == 401


def test_a_sign_in_begins_on_our_own_page_at_the_address_that_the_issuer_knows(here: OidcConsole) -> None:
    for headers in ({"Sec-Fetch-Site": "cross-site"}, {"Sec-Fetch-Site": "none"}, FOREIGN):
        answer = here.browser().get("/account/oidc", headers=headers)
        assert answer.status_code == 403
        assert "set-cookie" not in answer.headers
    silent = here.stand.stranger().get("/account/oidc")
    assert silent.status_code == 403
    local = here.browser().get("/account/oidc", headers={"Host": "localhost:8000", "Origin": "http://localhost:8000"})
    assert local.status_code == 403
    assert f"knows this console as {BASE}. Open it there." in local.text
    assert here.issuer.asked == []


ELSEWHERE = (
    "https://elsewhere.example/", "//elsewhere.example", "/\\elsewhere.example", "/a\r\nb", "/api/v1/missions",
    "/account/sign-out", "javascript:alert(1)", "/" + "x" * 600, '/"><script>',
)  # fmt: skip


def test_nobody_is_sent_anywhere_but_to_a_page_of_this_console(here: OidcConsole) -> None:
    password = {"name": "the-admin", "password": PASSWORD}
    for page in ELSEWHERE:
        assert 'content="0; url=/"' in here.enter(here.browser(), page=page).text, page
        typed = here.browser().post("/account/sign-in", data={**password, "page": page})
        assert typed.headers["location"] == "/", page
    typed = here.browser().post("/account/sign-in", data={**password, "page": "/missions?status=running"})
    assert typed.headers["location"] == "/missions?status=running"


def test_signing_out_ends_the_session_and_offers_the_issuers_own_way_out(here: OidcConsole) -> None:
    client = here.browser()
    here.enter(client)
    out = client.post("/account/sign-out")
    assert out.headers["location"] == "/account/sign-in?left=true"
    assert client.get("/").status_code == 401
    assert 'href="/account/oidc/leave"' in sentence(client.get("/account/sign-in?left=true").text)
    away = client.get("/account/oidc/leave").headers["location"]
    assert away.startswith(f"{here.issuer.url}/out?client_id=regen-console&post_logout_redirect_uri=http%3A%2F%2F")
    here.issuer.document = {"end_session_endpoint": None}
    with oidc_console(here.issuer) as other:
        assert other.browser().get("/account/oidc/leave").headers["location"] == "/account/sign-in"


def setting_up(here: OidcConsole, name: str, *, subject: str) -> None:
    identities = here.stand.app.state.console.issuer.identities
    identities.link(name, issuer=here.issuer.url, subject=subject, by=SETTING_UP)


@pytest.mark.parametrize("role", ROLES)
def test_every_role_comes_by_this_door_with_exactly_what_it_may(issuer: Issuer, role: str) -> None:
    with oidc_console(issuer, roles={"a-group": (role,)}) as here:
        issuer.person = {**ADA, "groups": ["a-group"]}
        client = here.browser()
        assert here.enter(client).status_code == 200
        assert client.get("/api/v1/account").json()["may"] == [one for one, who in GRANTS.items() if role in who]
        statuses = {path: client.get(path).status_code for path in ("/account/people", "/audit/access", "/")}
        assert statuses == {
            "/account/people": 200 if role == "admin" else 403,
            "/audit/access": 200 if role in GRANTS["trail"] else 403,
            "/": 200,
        }
        assert client.get("/account/oidc").status_code == 303
        assert client.post("/account/oidc").status_code == 405


def test_no_secret_of_a_sign_in_stands_in_a_page_the_accounts_an_event_or_a_log(
    here: OidcConsole, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(0)
    here.issuer.said = {"sub": "another", "groups": ["robot-operators"]}
    client = here.browser()
    away = here.away(client)
    under_way = cookies(client)["regen_sign_in_8000"]
    back = here.signed(away)
    verifier = next(iter(here.stand.app.state.console.issuer._under_way.values())).attempt.verifier
    code = re.findall(r"code=([^&]+)", back)[0]
    told = [client.get(back, headers=RETURNING).text, client.get("/account").text]
    here.issuer.claims = {"nonce": "another"}
    told.append(here.enter(here.browser()).text)
    here.issuer.claims, here.issuer.person = {}, {**SILENT, "sub": "another"}
    told.append(here.enter(here.browser()).text)
    assert here.issuer.asked[-1] == "person"
    secrets = [CLIENT_SECRET, ACCESS_TOKEN, verifier, code, under_way, *here.issuer.tokens, *cookies(client).values()]
    assert len(here.issuer.tokens) == 3
    assert all(len(one) > 20 for one in secrets if one)
    raw = store_of(here.stand)._engine.raw_connection()
    told.append("\n".join(raw.driver_connection.iterdump()))  # type: ignore[union-attr]
    told.append(json.dumps([repr(one) for one in here.stand.harness.runtime.log(0, 1000)]))
    said = [one.getMessage() for one in caplog.records if one.threadName != current_thread().name]
    assert any(one.startswith(f"HTTP Request: POST {here.issuer.url}/token") for one in said), "what others log is seen"
    told += [*said, repr(here.stand.app.state.console.settings)]
    for text in told:
        assert [one for one in secrets if one and one in text] == []
