"""Notices never go to addresses where a cloud answers with its credentials, whatever name leads there."""

import socket
from typing import Any

import pytest

from harness.adapters.notify.services import AppriseNotifier
from harness.contracts.notification import Notification

NOTICE = Notification(title="A question", body="vbot-1 waits", urgent=False)
REFUSED = "network link"


def leading(monkeypatch: pytest.MonkeyPatch, address: str) -> list[str]:
    """Every name leads to this address from now on; what was asked for."""
    asked: list[str] = []

    def found(host: str, *_: Any, **__: Any) -> list[Any]:
        asked.append(host)
        return [(socket.AF_INET, socket.SOCK_STREAM, 6, "", (address, 0))]

    monkeypatch.setattr(socket, "getaddrinfo", found)
    return asked


@pytest.mark.parametrize("address", ["169.254.169.254", "fe80::1", "fd00:ec2::254", "100.100.100.200"])
def test_a_name_that_leads_to_metadata_gets_no_notice(monkeypatch: pytest.MonkeyPatch, address: str) -> None:
    service = AppriseNotifier({"chat": "json://chat.example/hook"})
    assert leading(monkeypatch, address) == []
    assert REFUSED in service.send("chat", NOTICE)


def test_the_address_is_asked_for_each_time_a_name_may_lead_elsewhere_later(monkeypatch: pytest.MonkeyPatch) -> None:
    service = AppriseNotifier({"chat": "json://chat.example/hook"})
    asked = leading(monkeypatch, "169.254.169.254")
    service.send("chat", NOTICE)
    service.send("chat", NOTICE)
    assert asked == ["chat.example", "chat.example"]


def test_a_literal_address_of_metadata_gets_none_and_loopback_is_a_service_like_any_other() -> None:
    service = AppriseNotifier({"meta": "json://169.254.169.254/latest", "here": "json://127.0.0.1:9/hook"})
    assert REFUSED in service.send("meta", NOTICE)
    assert "did not take it" in service.send("here", NOTICE)
