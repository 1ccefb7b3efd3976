"""An S3-compatible service on loopback, as its clients see it."""

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import count
from urllib.request import Request, urlopen

import obstore
import pytest
from moto.server import ThreadedMotoServer
from obstore.store import S3Store

NUMBERS = count(1)


class ObjectStore:
    """A service that can be stopped. `address` names a bucket of its own, with a prefix."""

    def __init__(self) -> None:
        logging.getLogger("werkzeug").setLevel(logging.ERROR)
        self._server = ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
        self._server.start()
        host, port = self._server.get_host_and_port()
        self.endpoint = f"http://{host}:{port}"

    def address(self, *, make: bool = True) -> str:
        """The address of a blob store in a new bucket; `make` false: in one that is not there."""
        bucket = f"blobs-{next(NUMBERS)}"
        if make:
            with urlopen(Request(f"{self.endpoint}/{bucket}", method="PUT")) as answer:
                assert answer.status == 200
        return f"s3://{bucket}/evidence?endpoint={self.endpoint}"

    def write(self, bucket: str, key: str, body: bytes) -> None:
        """Put an object there as anybody with the keys could."""
        store = S3Store(bucket, config={"endpoint": self.endpoint}, client_options={"allow_http": True})
        obstore.put(store, key, body)

    def stop(self) -> None:
        """From now on nothing answers at its address."""
        self._server.stop()


@contextmanager
def object_store(monkeypatch: pytest.MonkeyPatch) -> Iterator[ObjectStore]:
    """A running service, and keys for it in the environment."""
    monkeypatch.setenv("AWS_ACCESS_KEY_ID", "testing")
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", "testing")
    service = ObjectStore()
    try:
        yield service
    finally:
        service.stop()
