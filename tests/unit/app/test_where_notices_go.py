"""Notices and sign-ins go to no address where a cloud answers with its credentials, nor into a network nobody named,
whatever name leads there and whenever."""

import socket
from collections.abc import Iterator
from contextlib import suppress
from ipaddress import ip_address
from threading import Thread
from typing import Any

import pytest

from harness.adapters.connection_guard import ConnectionForbidden, PublicOr, guarded
from harness.adapters.identity.openid import OpenIdProvider, Registration
from harness.adapters.identity.wire import HttpTransport
from harness.adapters.notify.services import NETWORKS, AppriseNotifier
from harness.adapters.providers.http.robot import HttpRobot
from harness.contracts.errors import ContractInvalid, HarnessError
from harness.contracts.identity import IssuerUnreachable
from harness.contracts.notification import Notification
from harness.contracts.reasons import because

NOTICE = Notification(title="A question", body="vbot-1 waits", urgent=False)
REFUSED = because("notify_own_link")
PRIVATE = because("notify_private_network", setting=NETWORKS)
METADATA = ("169.254.169.254", "fe80::1", "fd00:ec2::254", "100.100.100.200", "::ffff:169.254.169.254", "0.0.0.0")
INSIDE = ("127.0.0.1", "10.0.0.7", "192.168.1.1", "172.16.0.9", "::1", "fd12::1", "::ffff:10.0.0.7", "100.64.0.1")


def leading(monkeypatch: pytest.MonkeyPatch, *addresses: str, port: int = 0) -> list[str]:
    """Every name leads to these addresses in turn from now on, then to the last; what was asked for."""
    asked: list[str] = []

    def found(host: str, *_: Any, **__: Any) -> list[Any]:
        asked.append(host)
        address = addresses[min(len(asked), len(addresses)) - 1]
        family = socket.AF_INET6 if ":" in address else socket.AF_INET
        return [(family, socket.SOCK_STREAM, 6, "", (address, port))]

    monkeypatch.setattr(socket, "getaddrinfo", found)
    return asked


@pytest.fixture
def inside() -> Iterator[tuple[int, list[bytes]]]:
    """A service of this machine's: its port, and what it was sent."""
    heard: list[bytes] = []
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(5)

        def listen() -> None:
            with suppress(OSError):
                while True:
                    connection, _ = server.accept()
                    with connection:
                        heard.append(connection.recv(4096))
                        connection.sendall(b"HTTP/1.1 200 OK\r\nContent-Length: 2\r\n\r\n{}")

        thread = Thread(target=listen, daemon=True)
        thread.start()
        yield server.getsockname()[1], heard
        server.close()


@pytest.mark.parametrize("address", METADATA)
def test_a_name_that_leads_to_metadata_gets_no_notice_whatever_is_allowed(
    monkeypatch: pytest.MonkeyPatch, address: str
) -> None:
    permits = PublicOr(("0.0.0.0/0", "::/0"), where=NETWORKS)
    service = AppriseNotifier({"chat": "json://chat.example/hook"}, permits=permits)
    assert leading(monkeypatch, address) == []
    assert service.send("chat", NOTICE) == REFUSED


@pytest.mark.parametrize("address", INSIDE)
def test_a_name_that_leads_into_a_private_network_gets_none_unless_the_network_is_named(
    monkeypatch: pytest.MonkeyPatch, address: str
) -> None:
    leading(monkeypatch, address)
    assert AppriseNotifier({"chat": "json://chat.example/hook"}).send("chat", NOTICE) == PRIVATE
    assert not PublicOr(("203.0.113.0/24",), where=NETWORKS)(ip_address(address))
    assert PublicOr(("0.0.0.0/0", "::/0"), where=NETWORKS)(ip_address(address))


def test_a_name_that_leads_elsewhere_by_the_time_of_the_connection_is_caught_there(
    monkeypatch: pytest.MonkeyPatch, inside: tuple[int, list[bytes]]
) -> None:
    port, heard = inside
    service = AppriseNotifier({"chat": f"json://chat.example:{port}/hook"})
    asked = leading(monkeypatch, "8.8.8.8", "127.0.0.1", port=port)
    assert service.send("chat", NOTICE) is not None
    assert len(asked) >= 2 and heard == []


def test_a_service_of_a_named_private_network_is_notified(inside: tuple[int, list[bytes]]) -> None:
    port, heard = inside
    permits = PublicOr(("127.0.0.0/8",), where=NETWORKS)
    service = AppriseNotifier({"here": f"json://127.0.0.1:{port}/hook"}, permits=permits)
    assert service.send("here", NOTICE) is None
    assert heard


@pytest.mark.parametrize(
    "address", ["file:///etc/passwd", "gopher://127.0.0.1:70/x", "dict://127.0.0.1/x", "/etc/passwd"]
)
def test_an_address_of_another_kind_is_no_service_no_issuer_and_no_provider(address: str) -> None:
    with pytest.raises(ContractInvalid):
        AppriseNotifier({"one": address})
    with pytest.raises(ContractInvalid):
        OpenIdProvider(Registration(address, "console", "http://127.0.0.1/back"), secret="", clock=lambda: 0.0)
    with pytest.raises(HarnessError):
        HttpRobot(address, "token").status()


def test_a_network_that_is_none_is_named_at_the_start() -> None:
    with pytest.raises(ContractInvalid, match="network_invalid"):
        PublicOr(("10.0.0.0/64",), where=NETWORKS)


@pytest.mark.parametrize("address", METADATA)
def test_the_identity_provider_is_not_asked_where_its_name_leads_to_metadata(
    monkeypatch: pytest.MonkeyPatch, address: str
) -> None:
    transport = HttpTransport(("id.example",))
    leading(monkeypatch, address, port=443)
    with pytest.raises(IssuerUnreachable):
        transport.ask("GET", "https://id.example/.well-known/openid-configuration")


def test_outside_of_the_block_a_connection_is_nobodys_business(inside: tuple[int, list[bytes]]) -> None:
    port, _ = inside
    with guarded(PublicOr((), where=NETWORKS)), pytest.raises(ConnectionForbidden):
        socket.create_connection(("127.0.0.1", port), timeout=2)
    socket.create_connection(("127.0.0.1", port), timeout=2).close()
