"""Tables of the accounts database. Times are wall seconds; every credential is a digest or an argon2id hash."""

from sqlalchemy import Boolean, Column, Float, Index, Integer, LargeBinary, MetaData, Table, Text

VERSION = 2
METADATA = MetaData()

ACCOUNTS = Table(
    "accounts",
    METADATA,
    Column("name", Text, primary_key=True),
    Column("roles", Text, nullable=False),
    Column("secret", Text, nullable=False),
    Column("disabled", Boolean, nullable=False),
    Column("created_at_s", Float, nullable=False),
    Column("changed_at_s", Float, nullable=False),
)
IDENTITIES = Table(
    "identities",
    METADATA,
    Column("issuer", Text, primary_key=True),
    Column("subject", Text, primary_key=True),
    Column("name", Text, nullable=False, index=True),
    Column("by_groups", Boolean, nullable=False),
    Column("linked_at_s", Float, nullable=False),
)
SESSIONS = Table(
    "sessions",
    METADATA,
    Column("digest", Text, primary_key=True),
    Column("previous", Text, nullable=False, index=True),
    Column("previous_until_s", Float),
    Column("name", Text, nullable=False, index=True),
    Column("invited", Boolean, nullable=False),
    Column("began_at_s", Float, nullable=False),
    Column("seen_at_s", Float, nullable=False),
    Column("rotated_at_s", Float, nullable=False),
    Column("source", Text, nullable=False),
    Column("agent", Text, nullable=False),
)
TOKENS = Table(
    "tokens",
    METADATA,
    Column("token_id", Text, primary_key=True),
    Column("name", Text, nullable=False),
    Column("digest", Text, nullable=False, unique=True),
    Column("scopes", Text, nullable=False),
    Column("robot_id", Text, nullable=False),
    Column("created_by", Text, nullable=False),
    Column("created_at_s", Float, nullable=False),
    Column("expires_at_s", Float),
    Column("used_at_s", Float),
    Column("revoked_at_s", Float),
)
TRAIL = Table(
    "trail",
    METADATA,
    Column("number", Integer, primary_key=True),
    Column("at_s", Float, nullable=False),
    Column("kind", Text, nullable=False),
    Column("actor", Text, nullable=False),
    Column("role", Text, nullable=False),
    Column("subject", Text, nullable=False),
    Column("detail", Text, nullable=False),
    Column("source", Text, nullable=False),
    Column("previous", Text, nullable=False),
    Column("digest", Text, nullable=False),
    Index("trail_by_subject", "kind", "subject", "at_s"),
    Index("trail_by_source", "kind", "source", "at_s"),
)
ANSWERS = Table(
    "answers",
    METADATA,
    Column("caller", Text, primary_key=True),
    Column("key", Text, primary_key=True),
    Column("request", Text, nullable=False),
    Column("begun_at_s", Float, nullable=False, index=True),
    Column("status", Integer, nullable=False),
    Column("media_type", Text, nullable=False),
    Column("body", LargeBinary, nullable=False),
)
