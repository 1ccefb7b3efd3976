"""Notifies people through external services (chat, mail, push) with Apprise; only configured ones, no redirects.

Their addresses contain secrets: they come from settings, stay in this module, and appear in no event, log or page.
"""

import logging
import warnings
from collections.abc import Collection, Mapping
from urllib.parse import urlsplit

import apprise

from harness.contracts.errors import ContractInvalid
from harness.contracts.notification import Notification
from harness.contracts.reasons import because

logging.getLogger("apprise").setLevel(logging.CRITICAL)


class AppriseNotifier:
    """Implements Notifier. `addresses`: Apprise URL by service. Raises ContractInvalid for one that is none."""

    def __init__(self, addresses: Mapping[str, str]) -> None:
        asset = apprise.AppriseAsset(
            app_id="RegenHarness", app_desc="RegenHarness", app_url="", http_redirects=False, image_url_mask=""
        )
        self._services = {}
        for name, address in addresses.items():
            built = apprise.Apprise(asset=asset)
            if not urlsplit(address).scheme or not _added(built, address):
                raise ContractInvalid(because("notify_address_unknown", name=name[:40]), where="REGEN_NOTIFY")
            self._services[name] = built

    @property
    def services(self) -> Collection[str]:
        """Names of the configured services."""
        return tuple(self._services)

    def send(self, service: str, message: Notification) -> str:
        """Tries once. Every failure of an address or a service is reported with our own message."""
        kind = apprise.NotifyType.FAILURE if message.urgent else apprise.NotifyType.WARNING
        try:
            sent = self._services[service].notify(title=message.title, body=message.body, notify_type=kind)
        except (OSError, RuntimeError, TypeError, ValueError) as error:
            return f"the service failed: {type(error).__name__}"
        return "" if sent else "the service did not take it, or does not answer"


def _added(built: apprise.Apprise, address: str) -> bool:
    """Whether Apprise knows the address. Its first use loads every plugin, some of which import what is deprecated."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        return bool(built.add(address))
