"""Fetches JSON from the configured identity provider only: over TLS, limited in size and time, without redirects."""

import json
import ssl
import time
from collections.abc import Collection, Mapping
from ipaddress import ip_address
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import httpx

from harness.adapters.connection_guard import ConnectionForbidden, guarded, not_of_this_link
from harness.contracts.errors import ContractInvalid
from harness.contracts.identity import IssuerUnreachable, IssuerWrong
from harness.contracts.reasons import because

TIMEOUT_S, WHOLE_S, LARGEST_ANSWER = 5.0, 10.0, 1024 * 1024


class HttpTransport:
    """HTTP to `hosts` (with a port unless it is the usual one). `authority`: the certificates to trust."""

    def __init__(self, hosts: Collection[str], *, authority: Path | None = None) -> None:
        self._hosts = frozenset(host.lower() for host in hosts)
        self._trusted = _trusted(authority)

    def permits(self, url: object) -> bool:
        """Whether an address is one of the configured hosts', over TLS."""
        return isinstance(url, str) and secure(url) and urlsplit(url).netloc.lower() in self._hosts

    def allowed(self, url: object) -> str:
        """The address, if requests and browsers may be sent there. Raises IssuerWrong."""
        if not isinstance(url, str) or not self.permits(url):
            raise IssuerWrong(because("issuer_address_outside"), where=_place(url))
        return url

    def ask(
        self, method: str, url: object, *, headers: Mapping[str, str] | None = None, body: str = ""
    ) -> tuple[int, dict[str, Any]]:
        """(status, JSON object). Raises IssuerWrong before anything is sent, IssuerUnreachable for no such answer."""
        address = self.allowed(url)
        try:
            with (
                guarded(not_of_this_link),
                httpx.Client(
                    verify=self._trusted, timeout=TIMEOUT_S, trust_env=False, follow_redirects=False
                ) as client,
                client.stream(method, address, headers=dict(headers or {}), content=body or None) as answer,
            ):
                status, read = answer.status_code, _bounded(answer)
        except (httpx.HTTPError, httpx.InvalidURL, ConnectionForbidden) as error:
            raise IssuerUnreachable(
                because("issuer_unreachable", kind=type(error).__name__), where=_place(address)
            ) from None
        try:
            found = json.loads(read)
        except (ValueError, RecursionError):
            found = None
        if status >= 500 or not isinstance(found, dict):
            raise IssuerUnreachable(because("issuer_answer_unreadable", status=status), where=_place(address))
        return status, found


def secure(url: str) -> bool:
    """Whether an address is https, or http on this very machine; without user, query or fragment."""
    try:
        parts = urlsplit(url)
        host = parts.hostname or ""
    except ValueError:
        return False
    if parts.username or parts.fragment or "\\" in url:
        return False
    return bool(host) if parts.scheme == "https" else parts.scheme == "http" and _here(host)


def _here(host: str) -> bool:
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def _bounded(answer: httpx.Response) -> bytes:
    read, until_s = b"", time.monotonic() + WHOLE_S
    for piece in answer.iter_bytes():
        read += piece
        if len(read) > LARGEST_ANSWER or time.monotonic() > until_s:
            raise IssuerUnreachable(because("issuer_answer_excessive"))
    return read


def _place(url: object) -> str:
    """Scheme, host and path of an address: what follows may be secret."""
    try:
        parts = urlsplit(str(url))
    except ValueError:
        return ""
    return f"{parts.scheme}://{parts.hostname or ''}{parts.path}"[:200]


def _trusted(authority: Path | None) -> ssl.SSLContext:
    try:
        return ssl.create_default_context(cafile=authority)
    except OSError as error:
        raise ContractInvalid(
            because("authority_unreadable", error=error.strerror or type(error).__name__),
            where=f"REGEN_OIDC_AUTHORITY {authority}",
        ) from error
