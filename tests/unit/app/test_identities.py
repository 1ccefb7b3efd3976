"""Accounts of people of an identity provider, the settings of one, and the only way that leads there."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path

import pytest
from sqlalchemy import create_engine, text

from app.auth.accounts import Accounts
from app.auth.identities import Identities
from app.auth.next_url import safe_next_url
from app.auth.permissions import NotPermitted, Principal
from app.settings import ConsoleSettings
from harness.adapters.identity.openid import OpenIdProvider, Registration, secret_of
from harness.adapters.identity.wire import LARGEST_ANSWER, HttpTransport, secure
from harness.adapters.stores.accounts import SqlAccounts
from harness.contracts.errors import ConcurrencyConflict, ContractInvalid, UnknownName
from harness.contracts.identity import Claims, IssuerUnreachable, IssuerWrong, RoleMissing
from tests.builders.accounts import LITTLE_WORK
from tests.saying import raises_saying

ADMIN = Principal(name="root", roles=("admin",), source="10.0.0.9")
PASSWORD = "seven green bottles"
ISSUER = "https://id.example"


def now() -> float:
    return 1000.0


@pytest.fixture
def accounts() -> Accounts:
    made = Accounts(SqlAccounts(), clock=now, fresh=lambda: "fresh", hasher=LITTLE_WORK)
    made.add("root", roles=["admin"], password=PASSWORD, by=ADMIN)
    return made


def claims(subject: str = "1", name: str = "ada", groups: tuple[str, ...] = ()) -> Claims:
    return Claims(issuer=ISSUER, subject=subject, name=name, groups=groups)


def test_a_linked_account_keeps_its_own_roles_and_no_group_changes_them(accounts: Accounts) -> None:
    accounts.add("grace", roles=["reviewer"], password=PASSWORD, by=ADMIN)
    identities = Identities(accounts, roles={"operators": ("operator",)}, clock=now)
    identities.link("grace", issuer=ISSUER, subject="7", by=ADMIN)
    for groups in ((), ("operators",)):
        found = identities.account_of(claims("7", "whoever", groups), source="10.0.0.1")
        assert (found.name, found.roles) == ("grace", ("reviewer",))
    with pytest.raises(ConcurrencyConflict):
        identities.link("root", issuer=ISSUER, subject="7", by=ADMIN)
    with pytest.raises(RoleMissing):
        identities.account_of(Claims(issuer="https://other.example", subject="7", name="", groups=()), source="")
    assert identities.unlink("grace", by=ADMIN) == 1
    with pytest.raises(RoleMissing):
        identities.account_of(claims("7"), source="10.0.0.1")
    assert [one.kind for one in accounts.store.audit_log(kind="identity")] == ["identity.unlinked", "identity.linked"]


def test_only_an_admin_links_and_only_what_is_there(accounts: Accounts) -> None:
    identities = Identities(accounts, roles={}, clock=now)
    with pytest.raises(NotPermitted):
        identities.link("root", issuer=ISSUER, subject="7", by=Principal(name="eve", roles=("operator",)))
    with pytest.raises(UnknownName):
        identities.link("nobody", issuer=ISSUER, subject="7", by=ADMIN)
    for issuer, subject in (("", "7"), (ISSUER, ""), (ISSUER, "x" * 256)):
        with pytest.raises(ContractInvalid):
            identities.link("root", issuer=issuer, subject=subject, by=ADMIN)
    with pytest.raises(UnknownName):
        identities.unlink("root", by=ADMIN)


def test_an_account_that_a_group_made_has_no_other_way_in(accounts: Accounts) -> None:
    identities = Identities(accounts, roles={"operators": ("operator",)}, clock=now)
    made = identities.account_of(claims(groups=("operators",)), source="10.0.0.1")
    assert (made.name, made.roles, made.secret) == ("ada", ("operator",), "")
    with raises_saying(ContractInvalid, match="disable"):
        identities.unlink("ada", by=ADMIN)
    with raises_saying(ContractInvalid, match="identity provider"):
        accounts.reset_password("ada", new=PASSWORD, by=ADMIN)
    accounts.change("ada", disabled=True, by=ADMIN)


@pytest.mark.parametrize(
    ("called", "name"),
    [("Ada.Lovelace@id.example", "ada.lovelace"), ("ада", "person-"), ("../../etc", "etc"), ("x" * 60, "x" * 33),
     ("root", "root-"), ("-_.", "person-"), ("a b\nc", "a-b-c"), ("", "person-")],
)  # fmt: skip
def test_a_new_account_is_called_as_far_as_the_wish_fits(accounts: Accounts, called: str, name: str) -> None:
    identities = Identities(accounts, roles={"operators": ("operator",)}, clock=now)
    made = identities.account_of(claims(name=called, groups=("operators",)), source="")
    assert made.name.startswith(name)
    assert len(made.name) == len(name) + (6 if name.endswith("-") else 0)


@pytest.mark.parametrize("roles", [{"g": ("emperor",)}, {"g": ()}, {"g": ("admin", "emperor")}])
def test_a_mapping_to_a_role_that_does_not_exist_is_refused(
    accounts: Accounts, roles: dict[str, tuple[str, ...]]
) -> None:
    with raises_saying(ContractInvalid, match="REGEN_OIDC_ROLES"):
        Identities(accounts, roles=roles, clock=now)


def test_accounts_of_the_release_before_know_identities_from_now_on(tmp_path: Path) -> None:
    SqlAccounts(tmp_path / "accounts.db").close()
    engine = create_engine(f"sqlite:///{tmp_path / 'accounts.db'}")
    with engine.begin() as connection:
        connection.execute(text("DROP TABLE identities"))
        connection.execute(text("PRAGMA user_version=1"))
    engine.dispose()
    store = SqlAccounts(tmp_path / "accounts.db")
    assert store.identity(ISSUER, "7") is None
    store.close()


# settings -------------------------------------------------------------------------------------------------------------


def registration(issuer: str = ISSUER, client_id: str = "console", **more: object) -> Registration:
    return Registration(issuer=issuer, client_id=client_id, back="http://127.0.0.1:8000/account/oidc/back", **more)


@pytest.mark.parametrize(
    "issuer",
    ["http://id.example", "ftp://id.example", "id.example", "", "https://", "https://ada:secret@id.example",
     "https://id.example/#x", "https://id.example?x=1", "http://127.0.0.1.evil.example", "https://id.example\\@x"],
)  # fmt: skip
def test_an_issuer_is_an_https_address_or_this_machine(issuer: str) -> None:
    with raises_saying(ContractInvalid, match="REGEN_OIDC_ISSUER"):
        OpenIdProvider(registration(issuer), secret="", clock=now)
    assert secure("http://127.0.0.1:9000/realms/a")
    assert secure("https://id.example/realms/a")


def test_a_client_without_a_name_or_certificates_that_are_not_there_are_refused(tmp_path: Path) -> None:
    with raises_saying(ContractInvalid, match="REGEN_OIDC_CLIENT_ID"):
        OpenIdProvider(registration(client_id=""), secret="", clock=now)
    with raises_saying(ContractInvalid, match="REGEN_OIDC_AUTHORITY"):
        OpenIdProvider(registration(authority=tmp_path / "none.pem"), secret="", clock=now)


def test_the_secret_is_given_once_by_the_environment_or_by_a_file(tmp_path: Path) -> None:
    (tmp_path / "secret").write_text("from a file\n")
    (tmp_path / "empty").write_text("\n")
    assert secret_of("unguessable", None) == "unguessable"
    assert secret_of("", tmp_path / "secret") == "from a file"
    assert secret_of("", None) == ""
    for value, file in (("unguessable", tmp_path / "secret"), ("", tmp_path / "empty"), ("", tmp_path / "none")):
        with raises_saying(ContractInvalid, match="REGEN_OIDC_CLIENT_SECRET") as refused:
            secret_of(value, file)
        assert "unguessable" not in str(refused.value)


@pytest.mark.parametrize(
    ("name", "value"), [("ROLES", '{"g": '), ("ROLES", '["emperor"]'), ("SCOPES", "everything"), ("TITLE", "x" * 61)]
)
def test_a_setting_that_cannot_be_read_is_named_and_not_shown(
    monkeypatch: pytest.MonkeyPatch, name: str, value: str
) -> None:
    monkeypatch.setenv(f"REGEN_OIDC_{name}", value)
    with raises_saying(ContractInvalid, match=f"REGEN_OIDC_{name}") as refused:
        ConsoleSettings()
    assert value not in str(refused.value)


def test_settings_come_from_the_environment_and_the_button_is_called_by_the_issuers_host(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert ConsoleSettings().oidc.name == ""
    monkeypatch.setenv("REGEN_OIDC_ISSUER", "https://id.example/realms/robots")
    monkeypatch.setenv("REGEN_OIDC_ROLES", '{"operators": ["operator", "reviewer"]}')
    monkeypatch.setenv("REGEN_OIDC_CLIENT_SECRET", "unguessable")
    found = ConsoleSettings()
    assert found.oidc.name == "id.example"
    assert found.oidc.roles == {"operators": ("operator", "reviewer")}
    assert "unguessable" not in repr(found)


# the way there --------------------------------------------------------------------------------------------------------


@contextmanager
def answering(answer: Callable[[BaseHTTPRequestHandler], None]) -> Iterator[str]:
    """A server on loopback that does with every request what it is told."""

    class Answering(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            answer(self)

        def log_message(self, *_: object) -> None: ...

    server = HTTPServer(("127.0.0.1", 0), Answering)
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
    thread.start()
    try:
        yield f"127.0.0.1:{server.server_port}"
    finally:
        server.shutdown()
        thread.join()
        server.server_close()


def sending(status: int, body: bytes = b"", **headers: str) -> Callable[[BaseHTTPRequestHandler], None]:
    def send(request: BaseHTTPRequestHandler) -> None:
        request.send_response(status)
        for name, value in headers.items():
            request.send_header(name, value)
        request.end_headers()
        request.wfile.write(body)

    return send


@pytest.mark.parametrize(
    "answer",
    [sending(200, b"not json"), sending(200, b"[1]"), sending(503, b"{}"), sending(302, b"", Location="http://127.0.0.1:9"),
     sending(200, b"[" + b"1," * (LARGEST_ANSWER // 2) + b"1]"), sending(200, b"\xff"), sending(200, b"[" * 100_000)],
)  # fmt: skip
def test_an_answer_that_is_not_a_small_json_object_is_no_answer(
    answer: Callable[[BaseHTTPRequestHandler], None],
) -> None:
    with answering(answer) as host, pytest.raises(IssuerUnreachable) as refused:
        HttpTransport([host]).ask("GET", f"http://{host}/x?secret=1")
    assert "secret" not in str(refused.value)


def test_only_the_configured_hosts_are_asked() -> None:
    with answering(sending(200, b'{"a": 1}')) as host:
        assert HttpTransport([host]).ask("GET", f"http://{host}/x") == (200, {"a": 1})
        for elsewhere in ("127.0.0.1:9", host.replace("127.0.0.1", "localhost"), f"{host}.example", ""):
            with pytest.raises(IssuerWrong):
                HttpTransport([elsewhere]).ask("GET", f"http://{host}/x")
        for url in (f"https://{host}/x", f"http://a@{host}/x", None, 7, "/x", "http://[", f"http://{host}/x#y"):
            with pytest.raises((IssuerWrong, IssuerUnreachable)):
                HttpTransport([host]).ask("GET", url)


def test_nobody_is_followed_to_where_an_answer_points() -> None:
    asked: list[str] = []

    def elsewhere(request: BaseHTTPRequestHandler) -> None:
        asked.append(request.path)
        sending(200, b"{}")(request)

    with answering(elsewhere) as other, answering(sending(302, b"{}", Location=f"http://{other}/x")) as host:
        for hosts in ([host], [host, other]):
            assert HttpTransport(hosts).ask("GET", f"http://{host}/x") == (302, {})
    assert asked == []


def test_only_a_page_of_this_console_is_wanted() -> None:
    for page in ("/", "/missions", "/missions/m1?at=3&b=%20c", "/handoffs/h-1"):
        assert safe_next_url(page) == page
    for other in ("", "missions", "//x", "/\\x", "/a b", "/a\tb", "/\u202e", "https://x", "/api/v1/x", "/account/oidc"):
        assert safe_next_url(other) == "/"
