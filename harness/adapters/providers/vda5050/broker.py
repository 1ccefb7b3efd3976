"""A connection to an MQTT broker, by paho-mqtt: it reconnects by itself, and nothing is sent while it is down."""

import threading
from collections.abc import Callable, Sequence
from typing import Any
from urllib.parse import urlsplit

from paho.mqtt import client as mqtt
from paho.mqtt.enums import CallbackAPIVersion

from harness.contracts.errors import ProviderUnreachable
from harness.contracts.reasons import because

CONNECT_S = 5.0
KEEPALIVE_S = 10
PORTS = {"mqtt": 1883, "mqtts": 8883}
AT_MOST_ONCE, AT_LEAST_ONCE = 0, 1


class BrokerLink:
    """Implements `MessageLink`. `address` is `mqtt://HOST:PORT` or, with TLS, `mqtts://HOST:PORT`.

    `authority_file` holds the broker's certificate authority, where the machine does not trust it already. The
    session is clean: messages that were queued for an earlier session never arrive. Raises ProviderUnreachable.
    """

    def __init__(
        self, address: str, *, client_id: str, user: str = "", password: str = "", authority_file: str = ""
    ) -> None:
        parts = urlsplit(address)
        self._address, self._host = address, parts.hostname or ""
        self._port = parts.port or PORTS[parts.scheme]
        self._client = mqtt.Client(CallbackAPIVersion.VERSION2, client_id=client_id, clean_session=True)
        self._client.reconnect_delay_set(min_delay=1, max_delay=5)
        if user:
            self._client.username_pw_set(user, password or None)
        if parts.scheme == "mqtts":
            self._client.tls_set(ca_certs=authority_file or None)
        self._ready, self._refused = threading.Event(), ""

    def open(self, topics: Sequence[str], receive: Callable[[str, bytes], None], lost: Callable[[], None]) -> None:
        """Connect and subscribe. Raises ProviderUnreachable, also where the broker refuses the user."""

        def connected(client: mqtt.Client, data: Any, flags: Any, code: Any, properties: Any) -> None:
            if code.is_failure:
                self._refused = str(code)
                self._ready.set()
            else:
                client.subscribe([(topic, AT_LEAST_ONCE) for topic in topics])

        def subscribed(client: mqtt.Client, data: Any, message_id: int, codes: Any, properties: Any) -> None:
            self._ready.set()

        def disconnected(client: mqtt.Client, data: Any, flags: Any, code: Any, properties: Any) -> None:
            lost()

        def message(client: mqtt.Client, data: Any, found: mqtt.MQTTMessage) -> None:
            receive(found.topic, bytes(found.payload))

        self._client.on_connect, self._client.on_subscribe = connected, subscribed
        self._client.on_disconnect, self._client.on_message = disconnected, message
        try:
            self._client.connect(self._host, self._port, keepalive=KEEPALIVE_S)
        except (OSError, ValueError) as error:
            raise ProviderUnreachable(
                because("broker_gave_no_answer", error=type(error).__name__), where=self._address
            ) from error
        self._client.loop_start()
        if not self._ready.wait(CONNECT_S) or self._refused:
            self.close()
            code = self._refused
            raise ProviderUnreachable(
                because("broker_refused", error=code) if code else because("broker_gave_no_answer", error="timeout"),
                where=self._address,
            )

    def publish(self, topic: str, body: bytes) -> None:
        """Send once, best effort, as the specification has it; nothing is kept while the broker is gone."""
        if self._client.is_connected():
            self._client.publish(topic, body, qos=AT_MOST_ONCE)

    def close(self) -> None:
        self._client.disconnect()
        self._client.loop_stop()
