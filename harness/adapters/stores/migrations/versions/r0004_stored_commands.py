"""Schema 4: an event may name the record of its command. No table changes; older programs refuse to read it."""

from harness.adapters.stores.migrations.schema_version import set_schema_version

revision = "0004"
down_revision = "0003"


def upgrade() -> None:
    """The version alone: what is stored stays as it is."""
    set_schema_version(4)
