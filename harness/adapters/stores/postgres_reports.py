"""Passes robots' reports between the processes on one PostgreSQL, through LISTEN/NOTIFY. Stores nothing.

A report that is lost is followed by the next one a second later.
"""

from collections.abc import Callable
from logging import getLogger
from threading import Lock

import msgspec
import psycopg

from harness.adapters.stores.postgres_engine import libpq_url, server_url
from harness.adapters.stores.postgres_listener import Listener
from harness.contracts.fleet import RobotReport
from harness.contracts.values import decode, encode

LOG = getLogger(__name__)
CHANNEL = "regen_report"
LARGEST = 7900
"""PostgreSQL refuses a notice of 8,000 bytes."""


class ReportListener(Listener):
    """Calls `received` with each report of any process. Raises StoreUnavailable as a Listener does."""

    def __init__(self, url: str, received: Callable[[RobotReport], None]) -> None:
        self._received = received
        super().__init__(url, self._read)

    def _connected(self) -> psycopg.Connection:
        connection = psycopg.connect(libpq_url(self._url), autocommit=True, connect_timeout=5)
        connection.execute(f"LISTEN {CHANNEL}")
        return connection

    def _tell(self, connection: psycopg.Connection) -> None:
        for notice in connection.notifies(timeout=0):
            self._changed(notice.payload)

    def _read(self, payload: str) -> None:
        try:
            report = decode(payload.encode(), RobotReport)
        except msgspec.MsgspecError as error:
            LOG.warning("report_unreadable error=%s", error)
            return
        self._received(report)


class ReportSender:
    """Tells every listener a report; what cannot be told now is dropped, and the connection is made again."""

    def __init__(self, url: str) -> None:
        self._url = server_url(url)
        self._lock = Lock()
        self._connection: psycopg.Connection | None = None

    def send(self, report: RobotReport) -> None:
        """From any thread."""
        payload = encode(report).decode()
        if len(payload.encode()) >= LARGEST:
            LOG.warning("report_too_long robot=%s bytes=%d", report.robot_id, len(payload))
            return
        with self._lock:
            try:
                if self._connection is None:
                    self._connection = psycopg.connect(libpq_url(self._url), autocommit=True, connect_timeout=5)
                self._connection.execute("SELECT pg_notify(%s, %s)", (CHANNEL, payload))
            except psycopg.Error as error:
                LOG.warning("report_not_sent robot=%s error=%s", report.robot_id, error)
                self._closed()

    def close(self) -> None:
        """Nothing is sent afterwards."""
        with self._lock:
            self._closed()

    def _closed(self) -> None:
        if self._connection is not None:
            self._connection.close()
        self._connection = None
