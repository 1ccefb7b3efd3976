"""Talks to channels' services over HTTP, and tells apart what certainly was not sent from what may have been."""

from collections.abc import Mapping
from typing import Any, TypeVar

import httpx
import msgspec

from harness.adapters.connection_guard import guarded, not_of_this_link
from harness.contracts.errors import ChannelRefused, ChannelUnreachable, DeliveryUnknown
from harness.contracts.reasons import because

T = TypeVar("T")
TIMEOUT_S = 8.0
MOST_BYTES = 2**20
BUSY = frozenset({408, 425, 429, 503})
"""Answers of a service that has done nothing yet and asks to be asked again."""


class ServiceExchange:
    """Posts to one channel's service. Redirects are not followed; at most MOST_BYTES of an answer are read.

    Every method raises ChannelUnreachable and ChannelRefused where nothing was sent, and DeliveryUnknown where nobody
    knows. No error names an address or a header: both hold secrets.
    """

    def __init__(self, channel: str, *, timeout_s: float = TIMEOUT_S) -> None:
        self._channel, self._timeout_s = channel, timeout_s

    def prepare(self, url: str, kind: type[T], *, headers: Mapping[str, str] | None = None, **body: Any) -> T:
        """As `post`, for an exchange that sends nobody anything: what is unknown of it can be tried again."""
        try:
            return self.post(url, kind, headers=headers, **body)
        except DeliveryUnknown as error:
            problem = because("channel_unreachable", channel=self._channel, error=error.reason)
            raise ChannelUnreachable(problem) from error

    def post(self, url: str, kind: type[T], *, headers: Mapping[str, str] | None = None, **body: Any) -> T:
        """The answer as `kind`. `body` is what httpx takes: `json`, `params`, `files`."""
        status, answer = self._answered(url, headers or {}, body)
        if status in BUSY:
            raise ChannelUnreachable(because("channel_busy", channel=self._channel, status=status))
        if 400 <= status < 500:
            raise ChannelRefused(because("channel_refused", channel=self._channel, answer=f"{status} {_short(answer)}"))
        if status != 200:
            raise self.unknown(f"HTTP {status}")
        try:
            return msgspec.json.decode(answer, type=kind)
        except msgspec.MsgspecError as error:
            raise self.unknown(str(error)) from error

    def unknown(self, why: str) -> DeliveryUnknown:
        """The error of a message that may have been sent."""
        return DeliveryUnknown(because("delivery_unknown", channel=self._channel, error=why[:200]))

    def _answered(self, url: str, headers: Mapping[str, str], body: Mapping[str, Any]) -> tuple[int, bytes]:
        try:
            with (
                guarded(not_of_this_link),
                httpx.Client(timeout=self._timeout_s, trust_env=False) as client,
                client.stream("POST", url, headers=dict(headers), **body) as response,
            ):
                found = bytearray()
                for part in response.iter_bytes():
                    found += part
                    if len(found) > MOST_BYTES:
                        raise self.unknown("the answer is too long")
                return response.status_code, bytes(found)
        except (httpx.ConnectError, httpx.ConnectTimeout, httpx.UnsupportedProtocol) as error:
            raise ChannelUnreachable(
                because("channel_unreachable", channel=self._channel, error=type(error).__name__)
            ) from error
        except (httpx.HTTPError, httpx.InvalidURL, httpx.StreamError) as error:
            raise self.unknown(type(error).__name__) from error


def _short(answer: bytes) -> str:
    return answer[:200].decode(errors="replace")
