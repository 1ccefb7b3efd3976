"""Schema 2: snapshots of folded streams. They may be replaced or lost, because the events alone are authoritative."""

import sqlalchemy as sa
from alembic import op

from harness.adapters.stores.migrations.schema_version import set_schema_version

revision = "0002"
down_revision = "0001"

_NUMBER = sa.BigInteger().with_variant(sa.Integer(), "sqlite")
_TEXT = sa.Text().with_variant(sa.Text(collation="C"), "postgresql")


def upgrade() -> None:
    """One row per stream; `event` is the digest of the stream's event at `version`, which ties it to this very log."""
    op.create_table(
        "snapshot",
        sa.Column("stream", _TEXT, primary_key=True),
        sa.Column("version", _NUMBER, nullable=False),
        sa.Column("event", _TEXT, nullable=False),
        sa.Column("fingerprint", _TEXT, nullable=False),
        sa.Column("digest", _TEXT, nullable=False),
        sa.Column("body", sa.LargeBinary, nullable=False),
    )
    set_schema_version(2)
