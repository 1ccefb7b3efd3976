"""Schema 3: indices that list the streams and the ended missions without reading every event."""

from alembic import op

from harness.adapters.stores.migrations.schema_version import set_schema_version

revision = "0003"
down_revision = "0002"


def upgrade() -> None:
    """Two indices that hold one entry per stream, and one per mission that ended."""
    op.execute("CREATE INDEX event_first ON event (stream, position) WHERE version = 1")
    op.execute("CREATE INDEX event_mission_ended ON event (stream) WHERE kind = 'MissionEnded'")
    set_schema_version(3)
