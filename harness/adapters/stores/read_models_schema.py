"""The tables of the lists in SQLite, and the questions they answer. Opens nothing.

Facets and words of a row are terms in a full-text index without content: an inverted index, in which any combination
of filters costs what its rarest term costs, and pages are read in the order of the rows' numbers.
"""

import re

from harness.contracts.read_models import LISTINGS, Listing, ListQuery, ListRow

SCHEMA_VERSION = 1
LONGEST_WORD = 64
FIRST_IDEOGRAPH = "⺀"
TABLES = {listing: f"list_{listing}" for listing in LISTINGS}
TERMS = {listing: f"terms_{listing}" for listing in LISTINGS}
Argument = str | int | float
_SEPARATORS = re.compile(r"[^\w.]+", re.UNICODE)
_INNER = re.compile(r"[_.]+")

DROP = (
    *(f"DROP TABLE IF EXISTS {table}" for table in (*TABLES.values(), *TERMS.values())),
    "DROP TABLE IF EXISTS tally",
    "DROP TABLE IF EXISTS mark",
)
CREATE = (
    *(
        f"CREATE TABLE {table} (seq INTEGER PRIMARY KEY, key TEXT NOT NULL UNIQUE, amount REAL NOT NULL, "
        "facets TEXT NOT NULL, terms TEXT NOT NULL, body BLOB NOT NULL)"
        for table in TABLES.values()
    ),
    *(f"CREATE INDEX {table}_amount ON {table} (amount, seq)" for table in TABLES.values()),
    *(
        f"CREATE VIRTUAL TABLE {terms} USING fts5(terms, content='', detail=none, columnsize=0, "
        "tokenize=\"unicode61 remove_diacritics 2 tokenchars '_.=-'\")"
        for terms in TERMS.values()
    ),
    "CREATE TABLE tally (listing TEXT, facet TEXT, value TEXT, count INTEGER NOT NULL, "
    "PRIMARY KEY (listing, facet, value)) WITHOUT ROWID",
    "CREATE TABLE mark (fold TEXT NOT NULL, position INTEGER NOT NULL, digest TEXT NOT NULL)",
)
MARK = "SELECT fold, position, digest FROM mark"
SET_MARK = "INSERT INTO mark VALUES (?, ?, ?)"
TALLY = (
    "INSERT INTO tally VALUES (?, ?, ?, ?) "
    "ON CONFLICT (listing, facet, value) DO UPDATE SET count = count + excluded.count"
)
TALLIES = "SELECT facet, value, count FROM tally WHERE listing = ? AND count > 0 ORDER BY facet, value"


def terms_of(row: ListRow) -> str:
    """Everything a row is found by: its facets whole, its words whole and in parts, ideographs one by one."""
    whole = [facet_term(name, value) for name, value in row.facets.items()]
    said = set(words_of(row.words)) | {part for word in words_of(row.words) for part in _INNER.split(word) if part}
    return " ".join((*whole, *sorted(said)))


def words_of(text: str) -> tuple[str, ...]:
    """Words as they are searched by: lower case, cut at everything that is neither letter, digit, _ nor dot."""
    found: list[str] = []
    for word in _SEPARATORS.split(text.lower()):
        if any(sign >= FIRST_IDEOGRAPH for sign in word):
            found += word
        elif word:
            found.append(word[:LONGEST_WORD])
    return tuple(found)


def facet_term(name: str, value: str) -> str:
    """One facet as one term: it begins with a sign that no word holds, so that no word is mistaken for it."""
    return f"={name}={_SEPARATORS.sub('-', value.lower())}"


def page_of(query: ListQuery) -> tuple[str, tuple[Argument, ...]]:
    """The statement of one page: seq, amount and body, one row more than asked for."""
    table = TABLES[query.listing]
    where, arguments = _matching(query)
    if query.order == "largest":
        if query.after is not None:
            where.append("(l.amount, l.seq) < (?, ?)")
            arguments += (query.after.amount, query.after.seq)
        ordered = "l.amount DESC, l.seq DESC"
    else:
        numbered = "t.rowid" if _match(query) else "l.seq"
        if query.after is not None:
            where.append(f"{numbered} {'<' if query.order == 'newest' else '>'} ?")
            arguments += (query.after.seq,)
        ordered = f"{numbered} {'DESC' if query.order == 'newest' else 'ASC'}"
    condition = f" WHERE {' AND '.join(where)}" if where else ""
    return (
        f"SELECT l.seq, l.amount, l.body FROM {_from(query, table)}{condition} ORDER BY {ordered} LIMIT ?",
        (*arguments, query.limit + 1),
    )


def count_of(query: ListQuery, *, limit: int) -> tuple[str, tuple[Argument, ...]]:
    """The statement that counts what answers the query, up to `limit`."""
    match = _match(query)
    if not match:
        return f"SELECT count(*) FROM (SELECT 1 FROM {TABLES[query.listing]} LIMIT ?)", (limit,)
    terms = TERMS[query.listing]
    return f"SELECT count(*) FROM (SELECT 1 FROM {terms} WHERE {terms} MATCH ? LIMIT ?)", (match, limit)


def _from(query: ListQuery, table: str) -> str:
    if not _match(query):
        return f"{table} AS l"
    return f"{TERMS[query.listing]} AS t CROSS JOIN {table} AS l ON l.seq = t.rowid"


def _matching(query: ListQuery) -> tuple[list[str], tuple[Argument, ...]]:
    match = _match(query)
    return ([f"t.{TERMS[query.listing]} MATCH ?"], (match,)) if match else ([], ())


def _match(query: ListQuery) -> str:
    """The full-text expression: every term quoted, so that nothing typed is read as an operator."""
    facets = [f'"{facet_term(name, value)}"' for name, value in sorted(query.facets.items())]
    words = [f'"{part}"*' for word in query.words for part in words_of(word)]
    return " ".join((*facets, *words))
