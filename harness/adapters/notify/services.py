"""Notifies people through external services (chat, mail, push) with Apprise; only configured ones, no redirects.

Their addresses contain secrets: they come from settings, stay in this module, and appear in no event, log or page.
"""

import logging
import socket
import warnings
from collections.abc import Collection, Mapping
from ipaddress import ip_address
from typing import Any
from urllib.parse import urlsplit

from harness.contracts.errors import ContractInvalid
from harness.contracts.notification import Notification
from harness.contracts.reasons import because

METADATA = frozenset({ip_address("fd00:ec2::254"), ip_address("100.100.100.200"), ip_address("192.0.0.192")})
"""Where clouds answer with credentials at addresses that are not link-local."""
logging.getLogger("apprise").setLevel(logging.CRITICAL)


class AppriseNotifier:
    """Implements Notifier. `addresses`: Apprise URL by service. Raises ContractInvalid for one that is none."""

    def __init__(self, addresses: Mapping[str, str]) -> None:
        self._services: dict[str, Any] = {}
        self._hosts: dict[str, tuple[str, ...]] = {}
        if not addresses:
            return
        import apprise  # noqa: PLC0415  loads for a quarter of a second, and every command would wait for it

        asset = apprise.AppriseAsset(
            app_id="RegenHarness", app_desc="RegenHarness", app_url="", http_redirects=False, image_url_mask=""
        )
        for name, address in addresses.items():
            built = apprise.Apprise(asset=asset)
            if not urlsplit(address).scheme or not _added(built, address):
                raise ContractInvalid(because("notify_address_unknown", name=name[:40]), where="REGEN_NOTIFY")
            self._services[name] = built
            self._hosts[name] = tuple(host for one in built for host in [str(getattr(one, "host", "") or "")] if host)

    @property
    def services(self) -> Collection[str]:
        """Names of the configured services."""
        return tuple(self._services)

    def send(self, service: str, message: Notification) -> str:
        """Tries once. Every failure of an address or a service is reported with our own message."""
        if any(_of_this_link(host) for host in self._hosts[service]):
            return "the service's address leads to this machine's own network link, where no service is"
        kind = "failure" if message.urgent else "warning"
        try:
            sent = self._services[service].notify(title=message.title, body=message.body, notify_type=kind)
        except (OSError, RuntimeError, TypeError, ValueError) as error:
            return f"the service failed: {type(error).__name__}"
        return "" if sent else "the service did not take it, or does not answer"


def _of_this_link(host: str) -> bool:
    """Whether a name leads to a link-local address now, as those of cloud metadata are. One that leads nowhere: no."""
    try:
        found = socket.getaddrinfo(host, None, type=socket.SOCK_STREAM)
    except (OSError, UnicodeError):
        return False
    addresses = {ip_address(str(one[4][0]).partition("%")[0]) for one in found}
    return any(one.is_link_local or one.is_multicast or one in METADATA for one in addresses)


def _added(built: Any, address: str) -> bool:
    """Whether Apprise knows the address. Its first use loads every plugin, some of which import what is deprecated."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        return bool(built.add(address))
