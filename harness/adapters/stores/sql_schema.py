"""Reads which version of the log's tables a database holds, and migrates it to the version this program writes.

The tables are defined once, in `migrations/versions`, for every database: a new log runs all revisions.
"""

from pathlib import Path

from sqlalchemy import Connection, inspect

from harness.contracts.errors import StoreNewer, StoreUnavailable
from harness.contracts.reasons import because

SCHEMA_VERSION = 4
MIGRATIONS = Path(__file__).parent / "migrations"

_OF_THE_LOG = frozenset({"event", "record", "meta"})
_BY_ALEMBIC = "alembic_version"


def needs_migration(connection: Connection, *, where: str) -> bool:
    """Whether the database is empty or of an older version.

    Raises StoreNewer if a newer program wrote it, StoreUnavailable if it belongs to another program.
    """
    found = set(inspect(connection).get_table_names())
    if not found:
        return True
    if not found >= _OF_THE_LOG:
        raise StoreUnavailable(because("database_of_other_program", tables=tuple(sorted(found))), where=where)
    version = connection.exec_driver_sql("SELECT value FROM meta WHERE name = 'schema_version'").scalar_one()
    if int(version) > SCHEMA_VERSION:
        raise StoreNewer(because("log_newer", version=version, readable_version=SCHEMA_VERSION), where=where)
    return int(version) < SCHEMA_VERSION


def migrate(connection: Connection) -> None:
    """Run the revisions that are missing. The caller holds the one write transaction, and commits it."""
    from alembic import command  # noqa: PLC0415  only a database that has to change needs it
    from alembic.config import Config  # noqa: PLC0415

    config = Config()
    config.set_main_option("script_location", str(MIGRATIONS).replace("%", "%%"))
    config.attributes["connection"] = connection
    found = set(inspect(connection).get_table_names())
    if found and _BY_ALEMBIC not in found:  # schema 1 was written before there were revisions
        command.stamp(config, "0001")
    command.upgrade(config, "head")
