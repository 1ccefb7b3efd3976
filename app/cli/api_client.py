"""The API as commands use it, whichever process serves it: the console that owns the data folder, or this process."""

from abc import ABC, abstractmethod
from typing import Any

import httpx
import msgspec

from app.cli.output import ActRefused
from harness.contracts.errors import GoalNotUnderstood, HarnessError, UnknownName
from harness.contracts.readings import ReadingQuestion
from harness.projections.handoffs import Handoff


class Api(ABC):
    """Requests under /api/v1, decoded. Refusals and failures are raised as errors with what to do."""

    def get(self, path: str) -> Any:
        """Decoded JSON; raises UnknownName for 404 and HarnessError for any other refusal."""
        return self._answer("GET", path)

    def post(self, path: str, body: dict[str, Any]) -> Any:
        return self._answer("POST", path, body)

    def upload(self, path: str, body: bytes, *, kind: str) -> Any:
        """Post bytes of a media type as they are."""
        return self._decoded(self._sent("POST", f"/api/v1{path}", body, kind=kind))

    def patch(self, path: str, body: dict[str, Any]) -> Any:
        return self._answer("PATCH", path, body)

    def delete(self, path: str) -> Any:
        return self._answer("DELETE", path)

    def handoffs(self) -> list[Handoff]:
        """Every handoff as the owner's log has it, newest first."""
        return msgspec.convert(self.get("/handoffs?limit=500"), list[Handoff])

    @abstractmethod
    def follow(self, mission_id: str, *, wait: bool = False) -> dict[str, Any]:
        """The mission's outcome once it is over or waits for a person; ended by Ctrl-C, it exits with code 130.

        Where an earlier mission of the robot waits for a person, that is said at once and the outcome is that of a
        mission that has not begun; with `wait` it is waited for.
        """

    @abstractmethod
    def finish_earlier(self, mission_id: str) -> None:
        """Have the mission's robot do first what it was asked before."""

    @abstractmethod
    def observe(self, mission_id: str) -> None:
        """Have the sensors of the mission's robot report, so that an act rests on the robot as it is now."""

    @abstractmethod
    def _sent(self, method: str, path: str, body: dict[str, Any] | bytes | None, *, kind: str = "") -> httpx.Response:
        """The answer to one request; bytes are sent as they are, as `kind`."""

    def _answer(self, method: str, path: str, body: dict[str, Any] | None = None) -> Any:
        return self._decoded(self._sent(method, f"/api/v1{path}", body))

    def _decoded(self, response: httpx.Response) -> Any:
        if response.is_success:
            return response.json()
        problem = response.json() if "json" in response.headers.get("content-type", "") else {}
        if problem.get("code") == GoalNotUnderstood.code:
            question = msgspec.convert(problem["question"], ReadingQuestion)
            raise GoalNotUnderstood(problem["title"], question=question, where="goal", do=problem.get("do", ""))
        if response.status_code == 409:
            raise ActRefused(problem)
        kind = UnknownName if response.status_code in (404, 422) else HarnessError
        message = problem.get("detail") or problem.get("title") or f"The owner answered {response.status_code}"
        raise kind(message, do=problem.get("do", ""))


def content(body: dict[str, Any] | bytes | None, kind: str) -> dict[str, Any]:
    """The body of a request as httpx takes it: JSON, or bytes of a media type."""
    return {"content": body, "headers": {"content-type": kind}} if isinstance(body, bytes) else {"json": body}
