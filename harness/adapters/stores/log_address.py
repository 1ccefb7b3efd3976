"""Opens the event log at an address: an SQLite file or a PostgreSQL database."""

from harness.adapters.stores.postgres import PostgresEventStore
from harness.adapters.stores.sql import SqlEventStore
from harness.adapters.stores.sql_log import SqlLog

_SERVERS = ("postgresql:", "postgresql+", "postgres:")


def is_server(url: str) -> bool:
    """Whether the log lies on a database server, where other hosts may append too."""
    return url.startswith(_SERVERS)


def open_log(url: str) -> SqlLog:
    """The log at sqlite:///FILE or postgresql://USER:PASSWORD@HOST/DATABASE, created or migrated if need be.

    Raises StoreNewer if a newer version wrote it, StoreUnavailable if the address is neither or cannot be used.
    """
    return PostgresEventStore(url) if is_server(url) else SqlEventStore(url)
