"""A slice of the comparison of exploration's proposers: what each may decide, and what is refused by which rule."""

import time

from experiments.campaigns.explorers import anywhere, explored, longest_edge, ruled, stays


def test_a_proposer_that_names_points_anywhere_is_refused_by_rule_and_the_floor_is_seen_all_the_same() -> None:
    found = explored("anywhere", lambda seed: ruled("anywhere", anywhere(seed)), seeds=(1,), until_s=time.monotonic())
    assert found.missions == found.succeeded == 1 and found.least_share >= 0.95
    assert found.asked == found.admitted + sum(found.refused.values()) and found.refused
    assert set(found.refused) <= {"outside_map", "outside_zones", "keep_out", "unreachable", "too_far"}


def test_a_proposer_that_names_edges_of_the_unknown_is_followed() -> None:
    found = explored("longest", lambda seed: ruled("longest", longest_edge), seeds=(2,), until_s=time.monotonic())
    assert found.succeeded == 1 and found.admitted == found.asked > 0 and not found.refused


def test_a_proposer_whose_targets_show_nothing_new_is_not_asked_again_and_the_floor_is_seen() -> None:
    found = explored("stays", lambda seed: ruled("stays", stays), seeds=(1,), until_s=time.monotonic())
    assert found.succeeded == 1 and found.least_share >= 0.95 and found.targets > 2
