"""SQLite tables of the memory index, and the queries over them. Opens nothing."""

from harness.contracts.memory import MemoryQuery

SCHEMA_VERSION = 1
EPOCH_S = 1_750_000_000.0
"""Instants in the box tree count from here: it stores 32-bit numbers, which would round Unix time to two minutes."""
FOREVER_S = 1e30
_COLUMNS = (
    "seq", "record_id", "kind", "subject", "position", "verification", "confidence", "valid_from_s", "stated_until_s",
    "until_s", "superseded_at", "disputed_at", "mission_id", "provider_id", "capability", "place", "configuration",
    "verdict", "frame", "map_version", "body",
)  # fmt: skip

CREATE = (
    """CREATE TABLE memory (
        seq INTEGER PRIMARY KEY, record_id TEXT NOT NULL UNIQUE, kind TEXT NOT NULL, subject TEXT NOT NULL,
        position INTEGER NOT NULL, verification TEXT NOT NULL, confidence REAL NOT NULL, valid_from_s REAL NOT NULL,
        stated_until_s REAL, until_s REAL, superseded_at INTEGER, disputed_at INTEGER, mission_id TEXT NOT NULL,
        provider_id TEXT NOT NULL, capability TEXT NOT NULL, place TEXT NOT NULL, configuration TEXT NOT NULL,
        verdict TEXT NOT NULL, frame TEXT NOT NULL, map_version TEXT NOT NULL, body BLOB NOT NULL)""",
    "CREATE VIRTUAL TABLE memory_box USING rtree(seq, x_min, x_max, y_min, y_max, from_s, until_s)",
    "CREATE TABLE mark (fold TEXT NOT NULL, position INTEGER NOT NULL, digest TEXT NOT NULL)",
    "CREATE INDEX memory_current ON memory (kind, subject, seq) WHERE superseded_at IS NULL",
    "CREATE INDEX memory_subject ON memory (kind, subject, seq)",
    "CREATE INDEX memory_provider ON memory (kind, provider_id, seq) WHERE provider_id <> ''",
    "CREATE INDEX memory_setting ON memory (kind, provider_id, capability, place, configuration, seq)"
    " WHERE provider_id <> ''",
    "CREATE INDEX memory_verdict ON memory (kind, provider_id, capability, place, configuration, verdict, seq)"
    " WHERE provider_id <> ''",
    "CREATE INDEX memory_mission ON memory (mission_id, kind, seq)",
)
DROP = ("DROP TABLE IF EXISTS memory", "DROP TABLE IF EXISTS memory_box", "DROP TABLE IF EXISTS mark")

INSERT = f"INSERT INTO memory ({', '.join(_COLUMNS)}) VALUES ({', '.join('?' * len(_COLUMNS))})"
INSERT_BOX = "INSERT INTO memory_box (seq, x_min, x_max, y_min, y_max, from_s, until_s) VALUES (?, ?, ?, ?, ?, ?, ?)"
SUPERSEDE = "UPDATE memory SET superseded_at = ?, until_s = min(coalesce(until_s, ?), ?) WHERE record_id = ?"
CUT_BOX = (
    "UPDATE memory_box SET until_s = max(from_s, min(until_s, ?)) "
    "WHERE seq = (SELECT seq FROM memory WHERE record_id = ? AND frame <> '')"
)
DISPUTE = "UPDATE memory SET disputed_at = coalesce(disputed_at, ?) WHERE record_id = ?"
ANSWER = "SELECT body, verification, superseded_at, disputed_at, stated_until_s, memory.until_s FROM"
OF_SUBJECT = "memory INDEXED BY memory_current"
OF_REGION = "memory_box CROSS JOIN memory USING (seq)"
"""Ways to the rows that are said outright: SQLite, which keeps no statistics here, would choose slower ones."""
CURRENT = f"{ANSWER} {OF_SUBJECT} WHERE kind = ? AND subject = ? AND superseded_at IS NULL ORDER BY seq"
GET = f"{ANSWER} memory WHERE record_id = ?"
MARK = "SELECT fold, position, digest FROM mark"
SET_MARK = "INSERT INTO mark (fold, position, digest) VALUES (?, ?, ?)"
LAST = "SELECT coalesce(max(seq), 0) FROM memory"

Arguments = list[str | int | float]


def finding(query: MemoryQuery) -> tuple[str, tuple[str | int | float, ...]]:
    """The statement and arguments that answer a query, newest first."""
    clauses: list[str] = [f"kind IN ({', '.join('?' * len(query.kinds))})"]
    arguments: Arguments = [*query.kinds]
    for column, value in (
        ("subject", query.subject), ("mission_id", query.mission_id), ("provider_id", query.provider_id),
        ("capability", query.capability), ("configuration", query.configuration),
    ):  # fmt: skip
        if value:
            clauses.append(f"{column} = ?")
            arguments.append(value)
    if query.provider_id:
        clauses.append("provider_id <> ''")
    if query.place is not None:
        clauses.append("place = ?")
        arguments.append(query.place)
    if query.verdicts:
        clauses.append(f"verdict IN ({', '.join('?' * len(query.verdicts))})")
        arguments.extend(query.verdicts)
    if query.minimum_confidence > 0:
        clauses.append("confidence >= ?")
        arguments.append(query.minimum_confidence)
    for add in (_standing, _instant, _region):
        add(query, clauses, arguments)
    where = " AND ".join(clauses)
    return f"{ANSWER} {_way(query)} WHERE {where} ORDER BY memory.seq DESC LIMIT ?", (*arguments, query.limit)


def _way(query: MemoryQuery) -> str:
    """The table to read from, with an explicit index where one is needed."""
    if query.region is not None:
        return OF_REGION
    if query.subject and query.as_of is None and "superseded" not in query.standings:
        return OF_SUBJECT
    return "memory"


def _standing(query: MemoryQuery, clauses: list[str], arguments: Arguments) -> None:
    """Standings now, or as they were at a position of the log."""
    superseded, disputed = "superseded_at IS NOT NULL", "disputed_at IS NOT NULL"
    bounds: Arguments = []
    if query.as_of is not None:
        clauses.append("position <= ?")
        arguments.append(query.as_of)
        superseded, disputed = "coalesce(superseded_at <= ?, 0)", "coalesce(disputed_at <= ?, 0)"
        bounds.append(query.as_of)
    elif "superseded" not in query.standings:
        clauses.append("superseded_at IS NULL")
    words = [word for word in query.standings if word not in ("disputed", "superseded")]
    either = [f"(NOT {superseded} AND NOT {disputed} AND verification IN ({', '.join('?' * len(words))}))"]
    arguments.extend([*bounds, *bounds, *words])
    if "disputed" in query.standings:
        either.append(f"(NOT {superseded} AND ({disputed} OR verification = 'disputed'))")
        arguments.extend([*bounds, *bounds])
    if "superseded" in query.standings:
        either.append(superseded)
        arguments.extend(bounds)
    clauses.append(f"({' OR '.join(either)})")


def _instant(query: MemoryQuery, clauses: list[str], arguments: Arguments) -> None:
    """Only records valid at one instant; records learnt after `as_of` had not ended any interval yet."""
    if query.valid_at_s is None:
        return
    until_s = "memory.until_s"
    arguments.append(query.valid_at_s)
    if query.as_of is not None:
        until_s = "CASE WHEN superseded_at <= ? THEN memory.until_s ELSE stated_until_s END"
        arguments.append(query.as_of)
    clauses.append(f"valid_from_s <= ? AND coalesce({until_s}, {FOREVER_S}) > ?")
    arguments.append(query.valid_at_s)


def _region(query: MemoryQuery, clauses: list[str], arguments: Arguments) -> None:
    """Records that touch a region: the box tree narrows them down, and in time unless `as_of` is given."""
    region = query.region
    if region is None:
        return
    boxes = "x_min <= ? AND x_max >= ? AND y_min <= ? AND y_max >= ?"
    corners: Arguments = [region.x_max_m, region.x_min_m, region.y_max_m, region.y_min_m]
    if query.valid_at_s is not None and query.as_of is None:
        boxes += " AND from_s <= ? AND memory_box.until_s >= ?"
        corners.extend([query.valid_at_s - EPOCH_S] * 2)
    clauses.append(f"frame = ? AND map_version = ? AND {boxes}")
    arguments.extend([region.frame, region.map_version, *corners])
