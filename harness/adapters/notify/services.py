"""Notifies people through external services (chat, mail, push) with Apprise; only configured ones, no redirects.

Their addresses contain secrets: they come from settings, stay in this module, and appear in no event, log or page.
"""

import logging
import warnings
from collections.abc import Collection, Mapping
from typing import Any
from urllib.parse import urlsplit

from harness.adapters.connection_guard import Permits, PublicOr, addresses_of, guarded, of_this_link
from harness.contracts.errors import ContractInvalid
from harness.contracts.notification import Notification
from harness.contracts.reasons import Reason, because

NETWORKS = "REGEN_NOTIFY_NETWORKS"
logging.getLogger("apprise").setLevel(logging.CRITICAL)


class AppriseNotifier:
    """Implements Notifier. `addresses`: Apprise URL by service; `permits`: which addresses their names may lead to.

    Raises ContractInvalid for an address that is none.
    """

    def __init__(self, addresses: Mapping[str, str], *, permits: Permits | None = None) -> None:
        self._permits = permits or PublicOr((), where=NETWORKS)
        self._services: dict[str, Any] = {}
        self._hosts: dict[str, tuple[str, ...]] = {}
        if not addresses:
            return
        import apprise  # noqa: PLC0415  loads for a quarter of a second, and every command would wait for it

        asset = apprise.AppriseAsset(
            app_id="RegenHarness", app_desc="RegenHarness", app_url="", http_redirects=False, image_url_mask=""
        )
        asset.async_mode = False  # the guard holds in this thread alone
        for name, address in addresses.items():
            built = apprise.Apprise(asset=asset)
            if not urlsplit(address).scheme or not added(built, address):
                raise ContractInvalid(because("notify_address_unknown", name=name[:40]), where="REGEN_NOTIFY")
            self._services[name] = built
            self._hosts[name] = tuple(host for one in built for host in [str(getattr(one, "host", "") or "")] if host)

    @property
    def services(self) -> Collection[str]:
        """Names of the configured services."""
        return tuple(self._services)

    def send(self, service: str, message: Notification) -> Reason | None:
        """Tries once. Every failure of an address or a service is reported with a reason of our own."""
        found = [address for host in self._hosts[service] for address in addresses_of(host)]
        if any(of_this_link(address) for address in found):
            return because("notify_own_link")
        if not all(self._permits(address) for address in found):
            return because("notify_private_network", setting=NETWORKS)
        kind = "failure" if message.urgent else "warning"
        try:
            with guarded(self._permits):
                sent = self._services[service].notify(title=message.title, body=message.body, notify_type=kind)
        except (OSError, RuntimeError, TypeError, ValueError) as error:
            return because("notify_failed", error=type(error).__name__)
        return None if sent else because("notify_not_taken")


def added(built: Any, address: str) -> bool:
    """Whether Apprise knows the address. Its first use loads every plugin, some of which import what is deprecated."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        return bool(built.add(address))
