"""The owner's API, for every call while another process owns the data folder (D11)."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
import msgspec

from harness.bootstrap import owner_of
from harness.contracts.errors import HarnessError, StoreOwned, UnknownName
from harness.projections.handoffs import Handoff

POLL_S = 0.5
LASTING = ("awaiting_human", "paused", "succeeded", "failed", "cancelled", "safe_stopped", "handed_off")


class OwnerApi:
    """A client of the console that owns a data folder."""

    def __init__(self, url: str, token: str) -> None:
        self._base, self._headers = f"{url}/api/v1", {"Authorization": f"Bearer {token}"}

    def get(self, path: str) -> Any:
        """Decoded JSON; raises UnknownName for 404 and HarnessError for any other refusal."""
        return self._answer("GET", path)

    def post(self, path: str, body: dict[str, Any]) -> Any:
        return self._answer("POST", path, json=body)

    def handoffs(self) -> list[Handoff]:
        """Every handoff as the owner's log has it, newest first."""
        return msgspec.convert(self.get("/handoffs"), list[Handoff])

    def follow(self, mission_id: str, watch: Callable[[dict[str, Any]], None]) -> dict[str, Any]:
        """The mission's outcome once it is over or waits for a person."""
        while True:
            outcome: dict[str, Any] = self.get(f"/missions/{mission_id}")
            watch(outcome)
            if outcome["status"] in LASTING:
                return outcome
            time.sleep(POLL_S)

    def _answer(self, method: str, path: str, **options: Any) -> Any:
        try:
            with httpx.Client(headers=self._headers, timeout=30.0, trust_env=False) as client:
                response = client.request(method, f"{self._base}{path}", **options)
        except httpx.HTTPError as error:
            raise HarnessError(
                f"The owner of this data folder does not answer ({type(error).__name__})",
                where=self._base,
                do="stop that process, or wait until it answers",
            ) from error
        if response.is_success:
            return response.json()
        problem = response.json() if "json" in response.headers.get("content-type", "") else {}
        kind = UnknownName if response.status_code in (404, 422) else HarnessError
        told = problem.get("detail") or problem.get("title") or f"The owner answered {response.status_code}"
        raise kind(told, do=problem.get("do", ""))


def owner_api(data: Path) -> OwnerApi | None:
    """The API of the process that owns this folder, or None. Raises StoreOwned for an owner without an API."""
    owner = owner_of(data)
    if owner is None:
        return None
    if not owner.url:
        raise StoreOwned(
            f"Process {owner.pid} owns this data folder and has no API",
            where=str(data),
            do="wait until it ends, or use another --data folder",
        )
    return OwnerApi(owner.url, owner.token)
