"""Carries questions to a model's endpoint over HTTP, bounded in time and bytes; redirects are refused."""

import time

from harness.adapters.models.chat import TransportFailed
from harness.adapters.providers.http.exchange import Exchanges
from harness.contracts.errors import ProviderFailed, ProviderUnreachable
from harness.contracts.ids import Digest
from harness.contracts.reasons import because

ANSWER_BYTES = 1 << 20
NO_KEY = "none"
"""Endpoints that want no key take any."""
WORTH_ASKING_AGAIN = frozenset({408, 409, 425, 429, 500, 502, 503, 504})
PAUSE_S = 0.5
"""Before the second attempt; never longer than the time that is left."""


class HttpChatTransport:
    """Implements `ChatTransport` for one endpoint."""

    def __init__(self, base_url: str, key: str, timeout_s: float) -> None:
        """Raises ProviderUnreachable for a text that is no address."""
        self._exchanges = Exchanges(base_url, key or NO_KEY, timeout_s)

    def send(self, body: bytes, *, recorded: Digest, within_s: float) -> bytes:
        until_s = time.monotonic() + within_s
        try:
            reply = self._exchanges.ask("POST", "/chat/completions", body, most_bytes=ANSWER_BYTES, within_s=within_s)
        except ProviderUnreachable as error:
            kind = str(error.reason.facts.get("error", ""))
            raise TransportFailed(because("model_gave_no_answer", error=kind), again=True) from error
        except ProviderFailed as error:
            reason = because("model_answer_too_large", limit_mib=ANSWER_BYTES >> 20)
            raise TransportFailed(reason, again=False) from error
        if 300 <= reply.status < 400:
            raise TransportFailed(because("model_redirects", status=reply.status), again=False)
        if reply.status != 200:
            again = reply.status in WORTH_ASKING_AGAIN
            if again:
                time.sleep(max(0.0, min(PAUSE_S, until_s - time.monotonic())))
            raise TransportFailed(because("model_answers_status", status=reply.status), again=again)
        return reply.body

    def close(self) -> None:
        self._exchanges.close()
