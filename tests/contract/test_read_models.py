"""What every store of lists keeps: pages by key, filters that combine, tallies, and nothing half-written."""

import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import closing
from pathlib import Path

import msgspec
import pytest

from harness.adapters.stores.memory_index import EMPTY
from harness.adapters.stores.read_models import SqlReadModels
from harness.adapters.stores.read_models_schema import CREATE, walk_of
from harness.contracts.errors import ConcurrencyConflict, StoreUnavailable
from harness.contracts.ids import Digest
from harness.contracts.memory import FollowPosition
from harness.contracts.ports import ReadModels
from harness.contracts.read_models import MANY, Bookmark, ListOrder, ListQuery, ListRow
from tests.saying import raises_saying


@pytest.fixture(params=["file", "memory"])
def models(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[ReadModels]:
    url = f"sqlite:///{tmp_path / 'lists.db'}" if request.param == "file" else "sqlite://"
    with closing(SqlReadModels(url)) as made:
        yield made


def row(seq: int, *, words: str = "office storage", amount: float = 0.0, **facets: str) -> ListRow:
    return ListRow(
        listing="mission",
        seq=seq,
        key=f"msn_{seq}",
        facets=facets,
        words=words,
        amount=amount,
        body=f"body of {seq}".encode(),
    )


def mark(position: int) -> FollowPosition:
    return FollowPosition(fold="f", position=position, digest=Digest(f"{position:064x}"))


def put(models: ReadModels, rows: Sequence[ListRow]) -> None:
    before = models.mark()
    models.add(rows, after=before, upto=mark(before.position + 1))


def walked(models: ReadModels, query: ListQuery) -> list[str]:
    """Every body, page by page."""
    found: list[str] = []
    while True:
        page = models.page(query)
        found += [body.decode() for body in page.bodies]
        if page.following is None:
            return found
        query = ListQuery(
            listing=query.listing,
            facets=query.facets,
            words=query.words,
            order=query.order,
            after=page.following,
            limit=query.limit,
        )


@pytest.mark.parametrize(
    ("order", "expected"),
    [
        ("newest", [9, 8, 7, 6, 5, 4, 3, 2, 1]),
        ("oldest", [1, 2, 3, 4, 5, 6, 7, 8, 9]),
        ("largest", [8, 5, 2, 7, 4, 1, 9, 6, 3]),
    ],
)
@pytest.mark.parametrize("facets", [{}, {"status": "ended"}])
def test_pages_follow_each_other_without_a_gap_or_a_repeat(
    models: ReadModels, order: ListOrder, expected: list[int], facets: dict[str, str]
) -> None:
    put(models, [row(seq, amount=float(seq % 3), status="ended") for seq in range(1, 10)])
    query = ListQuery(listing="mission", facets=facets, order=order, limit=4)
    assert walked(models, query) == [f"body of {seq}" for seq in expected]


def test_a_search_that_many_rows_answer_comes_in_the_order_of_amounts_too(models: ReadModels) -> None:
    rows = [row(seq, amount=float(seq % 7), status="ended" if seq % 4 else "open") for seq in range(1, MANY + 600)]
    put(models, rows)
    query = ListQuery(listing="mission", facets={"status": "ended"}, order="largest", limit=400)
    assert models.count(query) > MANY
    ended = sorted((one for one in rows if one.facets["status"] == "ended"), key=lambda one: (one.amount, one.seq))
    assert walked(models, query) == [one.body.decode() for one in reversed(ended)]


def test_the_order_of_amounts_is_read_from_its_index_and_never_sorted() -> None:
    after = Bookmark(amount=3.0, seq=9)
    with closing(sqlite3.connect(":memory:")) as store:
        for statement in CREATE:
            store.execute(statement)
        for place in (None, after):
            asked = walk_of(ListQuery(listing="evidence", order="largest", after=place), '"=kind=image"')
            plan = " | ".join(line[-1] for line in store.execute(f"EXPLAIN QUERY PLAN {asked[0]}", asked[1]))
            assert "USING INDEX list_evidence_amount" in plan
            assert "ORDER BY" not in plan


def test_a_page_that_is_exactly_full_is_the_last_one(models: ReadModels) -> None:
    put(models, [row(seq) for seq in range(1, 5)])
    assert models.page(ListQuery(listing="mission", limit=4)).following is None


def test_filters_and_words_all_have_to_hold(models: ReadModels) -> None:
    put(
        models,
        [
            row(1, words="check the office storage", status="failed", robot="vbot-1"),
            row(2, words="check the corridor", status="failed", robot="vbot-2"),
            row(3, words="CHECK the Office", status="succeeded", robot="vbot-2"),
        ],
    )

    def found(*words: str, **facets: str) -> list[str]:
        return walked(models, ListQuery(listing="mission", words=words, facets=facets))

    assert found(status="failed") == ["body of 2", "body of 1"]
    assert found(status="failed", robot="vbot-2") == ["body of 2"]
    assert found("off", "CHECK") == ["body of 3", "body of 1"]
    assert found("office", status="failed") == ["body of 1"]
    assert found("ffice") == []
    assert found(status="fail") == []


@pytest.mark.parametrize(
    "typed",
    ['office" OR status=failed', "NEAR(office storage)", "office AND", "office NOT x", "'; DROP TABLE tally; office"],
)
def test_what_is_typed_is_looked_for_and_never_obeyed(models: ReadModels, typed: str) -> None:
    put(models, [row(1, status="failed"), row(2, words=f"said {typed} in the storage", status="ended")])
    assert walked(models, ListQuery(listing="mission", words=tuple(typed.split()))) == ["body of 2"]


@pytest.mark.parametrize("typed", ["status", "status=failed", "failed", "="])
def test_a_word_is_never_taken_for_a_filter(models: ReadModels, typed: str) -> None:
    put(models, [row(1, status="failed"), row(2, words="it failed in status")])
    found = walked(models, ListQuery(listing="mission", words=(typed,)))
    assert found == (["body of 2", "body of 1"] if typed == "=" else ["body of 2"])


def test_words_of_other_scripts_are_found_by_their_signs(models: ReadModels) -> None:
    put(models, [row(1, words="检查办公室仓库"), row(2, words="Geh zum Größenlager")])
    assert walked(models, ListQuery(listing="mission", words=("仓库",))) == ["body of 1"]
    assert walked(models, ListQuery(listing="mission", words=("größen",))) == ["body of 2"]


def test_a_row_takes_the_place_of_the_one_before_in_pages_filters_and_tallies(models: ReadModels) -> None:
    put(models, [row(1, status="active"), row(2, status="active")])
    put(models, [row(1, words="now something else", status="succeeded")])
    assert walked(models, ListQuery(listing="mission", facets={"status": "active"})) == ["body of 2"]
    assert walked(models, ListQuery(listing="mission", words=("office",))) == ["body of 2"]
    assert walked(models, ListQuery(listing="mission", words=("something",))) == ["body of 1"]
    counts = {(one.facet, one.value): one.count for one in models.tallies("mission")}
    assert counts == {("", ""): 2, ("status", "active"): 1, ("status", "succeeded"): 1}


def test_of_several_rows_with_one_number_the_last_counts(models: ReadModels) -> None:
    put(models, [row(1, status="active"), row(1, status="failed")])
    assert [(one.value, one.count) for one in models.tallies("mission")] == [("", 1), ("failed", 1)]


def test_an_item_is_found_by_its_key(models: ReadModels) -> None:
    put(models, [row(7)])
    assert models.body("mission", "msn_7") == b"body of 7"
    assert models.body("mission", "msn_8") is None
    assert models.body("evidence", "msn_7") is None


def test_a_count_stops_where_nobody_reads_on(models: ReadModels) -> None:
    put(models, [row(seq, status="ended") for seq in range(1, MANY + 50)])
    assert models.count(ListQuery(listing="mission", facets={"status": "ended"})) == MANY + 1
    assert models.count(ListQuery(listing="mission", facets={"status": "open"})) == 0


def test_a_follower_that_stands_elsewhere_writes_nothing(models: ReadModels) -> None:
    put(models, [row(1)])
    with pytest.raises(ConcurrencyConflict):
        models.add([row(2)], after=EMPTY, upto=mark(9))
    assert models.mark() == mark(1)
    assert walked(models, ListQuery(listing="mission")) == ["body of 1"]


def test_what_is_cleared_holds_nothing_and_begins_anew(models: ReadModels) -> None:
    put(models, [row(1, status="ended")])
    models.clear()
    assert models.mark() == EMPTY
    assert models.tallies("mission") == []
    assert walked(models, ListQuery(listing="mission", facets={"status": "ended"})) == []
    put(models, [row(1, status="ended")])
    assert walked(models, ListQuery(listing="mission", facets={"status": "ended"})) == ["body of 1"]


def test_a_file_keeps_its_rows_and_one_of_another_schema_is_emptied(tmp_path: Path) -> None:
    url = f"sqlite:///{tmp_path / 'lists.db'}"
    with closing(SqlReadModels(url)) as models:
        put(models, [row(1)])
    with closing(SqlReadModels(url)) as models:
        assert models.mark() == mark(1)
        models._opened().exec_driver_sql("PRAGMA user_version=99")
    with closing(SqlReadModels(url)) as models:
        assert models.mark() == EMPTY


def test_lists_that_cannot_be_used_say_what_to_do(tmp_path: Path) -> None:
    (tmp_path / "lists.db").write_bytes(b"not a database" * 100)
    with raises_saying(StoreUnavailable, match="delete this file"):
        SqlReadModels(f"sqlite:///{tmp_path / 'lists.db'}")


def test_closed_lists_answer_nothing(models: ReadModels) -> None:
    models.close()
    with pytest.raises(StoreUnavailable):
        models.page(ListQuery(listing="mission"))


def test_an_id_is_found_whole_and_a_digest_by_its_first_signs(models: ReadModels) -> None:
    digest = "0123456789abcdef" * 4
    named = msgspec.structs.replace(row(1), ids=("pkt_12ab", digest[:16], digest[:8]))
    put(models, [named, row(2)])
    for typed in ("pkt_12ab", "PKT_12AB", digest, digest[:16], digest[:8]):
        assert walked(models, ListQuery(listing="mission", words=(typed,))) == ["body of 1"], typed
    assert walked(models, ListQuery(listing="mission", words=("pkt_12",))) == []


def test_a_beginning_that_many_words_share_still_finds_them_all(models: ReadModels) -> None:
    put(models, [row(seq, words=f"crate{seq:04d}") for seq in range(1, 302)])
    assert models.count(ListQuery(listing="mission", words=("crate",))) == 301
    assert models.count(ListQuery(listing="mission", words=("crate00",))) == 99
