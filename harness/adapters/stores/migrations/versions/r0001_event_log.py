"""Schema 1: events, records and the schema's version. No row of them is ever changed or removed."""

import sqlalchemy as sa
from alembic import op

revision = "0001"
down_revision = None

_TABLES = ("event", "record", "meta")
_NUMBER = sa.BigInteger().with_variant(sa.Integer(), "sqlite")
_TEXT = sa.Text().with_variant(sa.Text(collation="C"), "postgresql")
"""Text in the order of its code points: how `streams` finds a prefix, whatever language the database speaks."""


def upgrade() -> None:
    """Tables, and what makes them append-only."""
    op.create_table(
        "event",
        sa.Column("position", _NUMBER, primary_key=True, autoincrement=False),
        sa.Column("stream", _TEXT, nullable=False),
        sa.Column("version", _NUMBER, nullable=False),
        sa.Column("kind", _TEXT, nullable=False),
        sa.Column("body", sa.LargeBinary, nullable=False),
        sa.Column("mission_s", sa.Double, nullable=False),
        sa.Column("recorded_s", sa.Double, nullable=False),
        sa.Column("previous", _TEXT, nullable=False),
        sa.Column("digest", _TEXT, nullable=False),
        sa.UniqueConstraint("stream", "version", name="event_stream_version"),
    )
    first = sa.text("version = 1")
    op.create_index("event_first_of_stream", "event", ["stream"], sqlite_where=first, postgresql_where=first)
    op.create_table(
        "record",
        sa.Column("digest", _TEXT, primary_key=True),
        sa.Column("kind", _TEXT, nullable=False),
        sa.Column("body", sa.LargeBinary, nullable=False),
    )
    meta = op.create_table(
        "meta", sa.Column("name", _TEXT, primary_key=True), sa.Column("value", _TEXT, nullable=False)
    )
    op.bulk_insert(meta, [{"name": "schema_version", "value": "1"}])
    if op.get_bind().dialect.name == "sqlite":
        _guard_sqlite()
    else:
        _guard_postgresql()


def _guard_sqlite() -> None:
    for table in _TABLES:
        for act in ("UPDATE", "DELETE"):
            op.execute(
                f"CREATE TRIGGER {table}_refuses_{act.lower()} BEFORE {act} ON {table} "
                f"BEGIN SELECT RAISE(ABORT, '{table} rows are append-only'); END"
            )


def _guard_postgresql() -> None:
    op.execute(
        "CREATE FUNCTION regen_refuse() RETURNS trigger LANGUAGE plpgsql AS "
        "$$ BEGIN RAISE EXCEPTION '% rows are append-only', TG_TABLE_NAME; END $$"
    )
    for table in _TABLES:
        op.execute(
            f"CREATE TRIGGER {table}_refuses_change BEFORE UPDATE OR DELETE OR TRUNCATE ON {table} "
            "FOR EACH STATEMENT EXECUTE FUNCTION regen_refuse()"
        )
    op.execute(
        "CREATE FUNCTION regen_tell() RETURNS trigger LANGUAGE plpgsql AS "
        "$$ BEGIN PERFORM pg_notify('regen_event', left(NEW.position || ' ' || NEW.stream, 2000)); RETURN NULL; END $$"
    )
    op.execute("CREATE TRIGGER event_tells AFTER INSERT ON event FOR EACH ROW EXECUTE FUNCTION regen_tell()")
