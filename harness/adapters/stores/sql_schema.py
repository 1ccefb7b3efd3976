"""The tables of the event log, and what makes them append-only. Opens nothing, reads nothing."""

from sqlalchemy import Column, Double, Index, Integer, LargeBinary, MetaData, Table, Text, UniqueConstraint

SCHEMA_VERSION = 1

tables = MetaData()

event = Table(
    "event",
    tables,
    Column("position", Integer, primary_key=True, autoincrement=False),
    Column("stream", Text, nullable=False),
    Column("version", Integer, nullable=False),
    Column("kind", Text, nullable=False),
    Column("body", LargeBinary, nullable=False),
    Column("mission_s", Double, nullable=False),
    Column("recorded_s", Double, nullable=False),
    Column("previous", Text, nullable=False),
    Column("digest", Text, nullable=False),
    UniqueConstraint("stream", "version", name="event_stream_version"),
)
"""One row per event, columns in the order of `StoredEvent`'s fields."""

Index("event_first_of_stream", event.c.stream, sqlite_where=event.c.version == 1)

record = Table(
    "record",
    tables,
    Column("digest", Text, primary_key=True),
    Column("kind", Text, nullable=False),
    Column("body", LargeBinary, nullable=False),
)

meta = Table("meta", tables, Column("name", Text, primary_key=True), Column("value", Text, nullable=False))

SQLITE_TRIGGERS = tuple(
    f"CREATE TRIGGER {table}_refuses_{act.lower()} BEFORE {act} ON {table} "
    f"BEGIN SELECT RAISE(ABORT, '{table} rows are append-only'); END"
    for table in ("event", "record", "meta")
    for act in ("UPDATE", "DELETE")
)
"""No row of the log is changed or removed. A later schema drops the trigger on `meta` when it migrates."""
