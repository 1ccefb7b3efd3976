"""The owner's API, which commands call while another process owns the data folder (D11)."""

import time
from pathlib import Path
from typing import Any

import httpx
import typer

from app.cli.api_client import Api, content
from app.cli.interruption import EXIT
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


NOT_BEGUN = ("draft", "compiled")
WAITING = ("awaiting_human", "awaiting_approval", "paused")
"""Statuses of a mission that its robot does not leave for a later one until a person has acted."""


class OwnerApi(Api):
    """A client of the console that owns a data folder."""

    def __init__(self, url: str, token: str) -> None:
        self._base, self._headers = url, {"Authorization": f"Bearer {token}"}

    @property
    def address(self) -> str:
        """Where the console answers."""
        return self._base

    def follow(self, mission_id: str, *, wait: bool = False) -> dict[str, Any]:
        """Asks for the mission until it is over or waits: the owner runs it, also after Ctrl-C."""
        try:
            return self._followed(mission_id, wait=wait)
        except KeyboardInterrupt:
            stop = f"`regen mission stop {mission_id} --reason ...` stops it"
            typer.echo(f"The console at {self._base} goes on with {mission_id}; {stop}.", err=True)
            raise typer.Exit(EXIT) from None

    def _followed(self, mission_id: str, *, wait: bool) -> dict[str, Any]:
        printed = ""
        while True:
            outcome: dict[str, Any] = self.get(f"/missions/{mission_id}")
            if outcome["status"] in LASTING:
                return outcome
            waiting = self._waiting_before(outcome) if outcome["status"] in NOT_BEGUN else ""
            if waiting and waiting != printed:
                printed = waiting
                typer.echo(waiting, err=True)
            if waiting and not wait:
                return outcome
            time.sleep(POLL_S)

    def _waiting_before(self, outcome: dict[str, Any]) -> str:
        """What a person must do before this mission's robot begins with it; empty where nobody is waited for."""
        for status in WAITING:
            for one in self.get(f"/missions?robot={outcome['robot_id']}&status={status}&order=oldest"):
                if one["mission_id"] == outcome["mission_id"]:
                    continue
                question = f"handoffs/{one['handoff_id']}" if one["handoff_id"] else f"missions/{one['mission_id']}"
                return (
                    f"Mission {one['mission_id']} waits for an answer: open {self._base}/{question}. "
                    f"{outcome['mission_id']} begins after it; --wait waits for that, "
                    f"`regen mission withdraw {outcome['mission_id']} --reason ...` takes it back."
                )
        return ""

    def finish_earlier(self, mission_id: str) -> None:
        """The owner's robots work through their missions, oldest first."""

    def observe(self, mission_id: str) -> None:
        """The owner's robots report all the time."""

    def _sent(self, method: str, path: str, body: dict[str, Any] | bytes | None, *, kind: str = "") -> httpx.Response:
        try:
            with httpx.Client(headers=self._headers, timeout=30.0, trust_env=False) as client:
                return client.request(method, f"{self._base}{path}", **content(body, kind))
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
