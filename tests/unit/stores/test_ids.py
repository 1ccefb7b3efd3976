"""Fresh names: they sort by age, do not meet, and repeat only where a seed says so."""

import re
from collections.abc import Iterator

from harness.adapters.ids import SeededIds, SystemIds

CROCKFORD = re.compile("msn_[0-9abcdefghjkmnpqrstvwxyz]+")
IN_2026 = 1_795_000_000.0


def ticking(*instants: float) -> Iterator[float]:
    yield from instants


def test_mission_names_are_letters_that_nobody_confuses() -> None:
    names = [SystemIds().mission(), SeededIds(7).mission()]
    assert all(CROCKFORD.fullmatch(name) for name in names)
    assert [len(name) for name in names] == [16, 12]


def test_a_name_sorts_after_the_shorter_ones_of_earlier_releases_and_seconds() -> None:
    assert SystemIds(wall=lambda: IN_2026 + 10 * 86400).mission() > "msn_0txj2bre"


def test_processes_that_start_missions_in_the_same_second_draw_different_names() -> None:
    names = [SystemIds(wall=lambda: IN_2026).mission() for _ in range(3000)]
    assert len(set(names)) == 3000


def test_mission_names_sort_by_age_over_seconds_and_years() -> None:
    instants = [IN_2026, IN_2026 + 1, IN_2026 + 3600, IN_2026 + 30 * 365 * 86400]
    names = [SystemIds(wall=lambda at=at: at, chance=lambda bits: 2**bits - 1).mission() for at in instants]
    assert names == sorted(set(names))


def test_mission_names_rise_within_one_second_and_when_the_clock_steps_back() -> None:
    clock = ticking(*[IN_2026] * 3000, IN_2026 - 500, IN_2026 - 500)
    ids = SystemIds(wall=lambda: next(clock))
    names = [ids.mission() for _ in range(3002)]
    assert names == sorted(set(names))


def test_chance_parts_the_names_of_two_processes() -> None:
    one, other = (SystemIds(wall=lambda: IN_2026, chance=lambda _, n=n: n).mission() for n in (5, 6))
    assert one != other


def test_tokens_are_long_and_never_the_same() -> None:
    tokens = {SystemIds().token() for _ in range(200)}
    assert len(tokens) == 200
    assert all(re.fullmatch(r"[A-Za-z0-9_-]{43}", token) for token in tokens)


def test_the_same_seed_gives_the_same_names_in_order_and_another_seed_others() -> None:
    one, again, other = SeededIds(7), SeededIds(7), SeededIds(8)
    names = [one.mission() for _ in range(2000)]
    assert names == [again.mission() for _ in range(2000)] == sorted(set(names))
    assert not set(names) & {other.mission() for _ in range(2000)}
    tokens = [one.token() for _ in range(10)]
    assert tokens == [again.token() for _ in range(10)]
    assert len({*tokens, *(other.token() for _ in range(10))}) == 20
