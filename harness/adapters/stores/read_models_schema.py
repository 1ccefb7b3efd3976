"""SQLite tables of the list read models, and the queries over them. Opens nothing.

Facets and words of a row are terms in a full-text index without content: an inverted index, in which any combination
of filters costs what its rarest term costs, and pages are read in the order of the rows' numbers.
"""

import re
from collections.abc import Callable, Sequence

from harness.contracts.read_models import LISTINGS, ListQuery, ListRow

SCHEMA_VERSION = 3
LONGEST_WORD = 64
SPELLINGS = 200
"""A typed word stands for at most so many words that begin with it; one that stands for more is looked up slowly."""
FIRST_IDEOGRAPH = "⺀"
TABLES = {listing: f"list_{listing}" for listing in LISTINGS}
TERMS = {listing: f"terms_{listing}" for listing in LISTINGS}
Argument = str | int | float
_SEPARATORS = re.compile(r"[^\w.]+", re.UNICODE)
_INNER = re.compile(r"[_.]+")
_DIGEST = re.compile(r"[0-9a-f]{17,}")
DIGEST_SIGNS = 16
Spellings = Callable[[str], Sequence[str]]

DROP = (
    *(f"DROP TABLE IF EXISTS {table}" for table in (*TABLES.values(), *TERMS.values())),
    "DROP TABLE IF EXISTS word",
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
        "tokenize=\"unicode61 remove_diacritics 2 tokenchars '_.=#-'\")"
        for terms in TERMS.values()
    ),
    "CREATE TABLE word (listing TEXT, word TEXT, PRIMARY KEY (listing, word)) WITHOUT ROWID",
    "CREATE TABLE tally (listing TEXT, facet TEXT, value TEXT, count INTEGER NOT NULL, "
    "PRIMARY KEY (listing, facet, value)) WITHOUT ROWID",
    "CREATE TABLE mark (fold TEXT NOT NULL, position INTEGER NOT NULL, digest TEXT NOT NULL)",
)
ADD_WORD = "INSERT OR IGNORE INTO word VALUES (?, ?)"
BEGINNING = "SELECT word FROM word WHERE listing = ? AND word >= ? AND word < ? LIMIT ?"
MARK = "SELECT fold, position, digest FROM mark"
SET_MARK = "INSERT INTO mark VALUES (?, ?, ?)"
TALLY = (
    "INSERT INTO tally VALUES (?, ?, ?, ?) "
    "ON CONFLICT (listing, facet, value) DO UPDATE SET count = count + excluded.count"
)
TALLIES = "SELECT facet, value, count FROM tally WHERE listing = ? AND count > 0 ORDER BY facet, value"


def terms_of(row: ListRow) -> str:
    """Everything a row is found by: its facets and ids whole, its words whole and in parts, ideographs one by one."""
    whole = [facet_term(name, value) for name, value in row.facets.items()]
    return " ".join((*whole, *(id_term(one) for one in row.ids), *spoken(row)))


def spoken(row: ListRow) -> list[str]:
    """The text of a row as words, whole and in parts."""
    words = words_of(row.words)
    return sorted(set(words) | {part for word in words for part in _INNER.split(word) if part})


def id_term(name: str) -> str:
    """One id as one term, to be found whole."""
    return f"#{_SEPARATORS.sub('-', name.lower())}"


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
    """One facet as one term: it begins with a character that no word contains, so that no word is mistaken for it."""
    return f"={name}={_SEPARATORS.sub('-', value.lower())}"


def page_of(query: ListQuery, match: str) -> tuple[str, tuple[Argument, ...]]:
    """The statement of one page: seq, amount and body, one row more than asked for. `match`: see `matching`."""
    table, terms = TABLES[query.listing], TERMS[query.listing]
    where = [f"t.{terms} MATCH ?"] if match else []
    arguments: list[Argument] = [match] if match else []
    if query.order == "largest":
        numbered, ordered = "l.seq", "l.amount DESC, l.seq DESC"
        if query.after is not None:
            where.append("(l.amount, l.seq) < (?, ?)")
            arguments += [query.after.amount, query.after.seq]
    else:
        numbered, newest = "t.rowid" if match else "l.seq", query.order == "newest"
        ordered = f"{numbered} {'DESC' if newest else 'ASC'}"
        if query.after is not None:
            where.append(f"{numbered} {'<' if newest else '>'} ?")
            arguments.append(query.after.seq)
    source = f"{terms} AS t CROSS JOIN {table} AS l ON l.seq = t.rowid" if match else f"{table} AS l"
    condition = f" WHERE {' AND '.join(where)}" if where else ""
    statement = f"SELECT l.seq, l.amount, l.body FROM {source}{condition} ORDER BY {ordered} LIMIT ?"
    return statement, (*arguments, query.limit + 1)


def walk_of(query: ListQuery, match: str) -> tuple[str, tuple[Argument, ...]]:
    """The statement of one page in the order of amounts, for a search that many rows answer.

    Reads the index of amounts until the page is full, where `page_of` would fetch every row that answers, to sort them.
    """
    table, terms = TABLES[query.listing], TERMS[query.listing]
    after: str = ""
    place: tuple[Argument, ...] = ()
    if query.after is not None:
        after, place = " AND (amount, seq) < (?, ?)", (query.after.amount, query.after.seq)
    statement = (
        f"SELECT seq, amount, body FROM {table} INDEXED BY {table}_amount "
        f"WHERE seq IN (SELECT rowid FROM {terms} WHERE {terms} MATCH ?){after} ORDER BY amount DESC, seq DESC LIMIT ?"
    )
    return statement, (match, *place, query.limit + 1)


def count_of(query: ListQuery, match: str, *, limit: int) -> tuple[str, tuple[Argument, ...]]:
    """The statement that counts what answers the query, up to `limit`."""
    if not match:
        return f"SELECT count(*) FROM (SELECT 1 FROM {TABLES[query.listing]} LIMIT ?)", (limit,)
    terms = TERMS[query.listing]
    return f"SELECT count(*) FROM (SELECT 1 FROM {terms} WHERE {terms} MATCH ? LIMIT ?)", (match, limit)


def matching(query: ListQuery, spellings: Spellings) -> str:
    """The full-text expression: every term quoted, so that nothing typed is read as an operator.

    `spellings` answers with the known words that begin like a typed one. A typed word means one of them or an id:
    whole terms are read as far as a page needs them, while a prefix would be collected to its end first.
    """
    parts = [f'"{facet_term(name, value)}"' for name, value in sorted(query.facets.items())]
    for typed in query.words:
        for word in words_of(typed):
            known = spellings(word)
            quoted = [f'"{one}"' for one in known] if len(known) <= SPELLINGS else [f'"{word}"*']
            parts.append(f"({' OR '.join([*quoted, _quoted_id(word)])})")
    return " AND ".join(parts)


def _quoted_id(word: str) -> str:
    """A digest is found by as many characters as its term holds."""
    return f'"{id_term(word)}"' if not _DIGEST.fullmatch(word) else f'"{id_term(word[:DIGEST_SIGNS])}"'
