"""The owner's API, which commands call while another process owns the data folder (D11)."""

import time
from pathlib import Path
from typing import Any

import httpx

from app.cli.api_client import Api
from app.cli.logins import token_of
from harness.bootstrap import owner_of
from harness.contracts.errors import HarnessError, StoreOwned
from harness.contracts.reasons import because

POLL_S = 0.5
LASTING = (
    "awaiting_human",
    "paused",
    "succeeded",
    "partly_verified",
    "failed",
    "cancelled",
    "safe_stopped",
    "handed_off",
)


class OwnerApi(Api):
    """A client of the console that owns a data folder."""

    def __init__(self, url: str, token: str) -> None:
        self._base, self._headers = url, {"Authorization": f"Bearer {token}"}

    def follow(self, mission_id: str) -> dict[str, Any]:
        """Asks for the mission until it is over or waits: the owner runs it."""
        while True:
            outcome: dict[str, Any] = self.get(f"/missions/{mission_id}")
            if outcome["status"] in LASTING:
                return outcome
            time.sleep(POLL_S)

    def finish_earlier(self, mission_id: str) -> None:
        """The owner's robots work through their missions, oldest first."""

    def observe(self, mission_id: str) -> None:
        """The owner's robots report all the time."""

    def _sent(self, method: str, path: str, body: dict[str, Any] | None) -> httpx.Response:
        try:
            with httpx.Client(headers=self._headers, timeout=30.0, trust_env=False) as client:
                return client.request(method, f"{self._base}{path}", json=body)
        except httpx.HTTPError as error:
            raise HarnessError(because("owner_silent", kind=type(error).__name__), where=self._base) from error


def owner_api(data: Path) -> OwnerApi | None:
    """The API of the process that owns this folder, or None. Raises StoreOwned for an owner without an API.

    Asked as whoever signed in at this terminal, else as a user of this machine without an account.
    """
    owner = owner_of(data)
    if owner is None:
        return None
    if not owner.url:
        raise StoreOwned(because("owner_without_api", pid=owner.pid), where=str(data))
    return OwnerApi(owner.url, token_of(data) or owner.token)
