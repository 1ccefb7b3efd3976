"""What a mission is worth: counted from its log, the robot's journals and the truth, by what H_0 asks."""

from rsi_reviews.regression.case_run import MissionAccount, conducted, yardstick
from rsi_reviews.regression.cases import Case, Outside, Situation
from rsi_reviews.regression.judge import CHARGES, judged
from simulator.in_process import SIMULATOR
from tests.builders.evaluations import BASELINE, patient
from tests.builders.pairs import in_step, parting


def case(*faults: str, seed: int = 5, outside: tuple[Outside, ...] = ()) -> Case:
    situation = Situation(family="stale_evidence", template="circuit", faults=faults, outside=outside)
    return Case(situation=situation, seed=seed)


def ran(*faults: str, outside: tuple[Outside, ...] = ()) -> MissionAccount:
    return conducted(case(*faults, outside=outside), BASELINE, SIMULATOR)


LEASED = (Outside(kind="lease", at_s=0.0, for_s=50.0),)


def test_a_mission_without_faults_costs_nothing() -> None:
    result = judged(ran())
    assert (result.outcome, result.status, result.verified_completion) == ("finished", "succeeded", 1.0)
    assert (result.recovery_cost, result.handoffs, result.operator_minutes) == (0.0, 0.0, 0.0)
    assert 30.0 < result.mission_s < 60.0


def test_a_rung_of_a_ladder_costs_one() -> None:
    account = ran("stale-pose")
    assert judged(account).recovery_cost == account.mission.spent_total == 1.0


def test_a_mission_that_only_believes_to_have_arrived_is_no_verified_completion() -> None:
    result = judged(ran("biased-localiser"))
    assert (result.status, result.verified_completion, result.epistemic_false_completion) == ("succeeded", 0.0, 1.0)
    assert result.recovery_cost == CHARGES.task_budget
    assert result.mission_s == CHARGES.unfinished_s


def test_a_repeated_request_starts_nothing_twice() -> None:
    account = ran("duplicate-request")
    assert len(account.starts) == 1
    assert judged(account).duplicate_starts == 0.0


def test_a_second_physical_start_of_one_request_is_counted() -> None:
    account = ran()
    twice = [*account.story["starts"], *account.story["starts"]]
    told = MissionAccount(**{**vars(account), "story": {**account.story, "starts": twice}})
    assert judged(told).duplicate_starts >= 1.0


def test_motion_that_nobody_asked_for_and_motion_that_is_too_fast_are_violations() -> None:
    account = ran()
    assert judged(account).safety_violations == 0.0
    (start,) = account.starts
    loose = MissionAccount(
        **{**vars(account), "log": tuple(one for one in account.log if one.kind != "DispatchIntended")}
    )
    assert start.request_id
    assert judged(loose).safety_violations >= 1.0
    fast = [{**line, "v_mps": 0.9} for line in account.story["truth"]]
    assert (
        judged(MissionAccount(**{**vars(account), "story": {**account.story, "truth": fast}})).safety_violations == 1.0
    )


def test_a_mission_that_was_cut_short_is_truncated() -> None:
    assert judged(MissionAccount(**{**vars(ran()), "cut": True})).outcome == "truncated"


def test_a_lease_of_somebody_else_is_met_and_ends_in_a_handoff() -> None:
    result = judged(ran(outside=LEASED))
    assert (result.status, result.handoffs) == ("awaiting_human", 1.0)
    assert result.recovery_cost == CHARGES.task_budget
    assert result.operator_minutes == CHARGES.answer_minutes + CHARGES.fetch_minutes


def test_a_veto_from_outside_stops_the_motion_without_a_violation() -> None:
    result = judged(ran(outside=(Outside(kind="veto", at_s=5.0, for_s=6.0),)))
    assert (result.verified_completion, result.safety_violations) == (0.0, 0.0)


def test_the_yardstick_is_what_was_asked_whatever_a_configuration_says() -> None:
    contract = yardstick(case().situation, SIMULATOR)
    assert [node.node_id for node in contract.nodes] == ["request", "circuit"]
    assert contract.recovery_total == CHARGES.task_budget


def test_pairs_are_in_step_until_the_configurations_decide_differently() -> None:
    """Chance is keyed by seed, subsystem and reading: the truth and every sensor agree to the last bit until then."""
    pair = tuple(conducted(case("stale-pose", outside=LEASED), one, SIMULATOR) for one in (BASELINE, patient()))
    found = parting(*pair)
    assert found is not None
    assert in_step(*pair, until_s=found.at_s)
    assert not in_step(*pair, until_s=found.at_s + 60.0)


def test_a_pair_that_decides_alike_never_parts() -> None:
    pair = tuple(conducted(case("stale-pose"), one, SIMULATOR) for one in (BASELINE, patient()))
    assert parting(*pair) is None
    assert judged(pair[0]).trace == judged(pair[1]).trace
    assert judged(pair[0]).configuration != judged(pair[1]).configuration


def test_another_seed_is_another_story() -> None:
    first, second = (conducted(case("stale-pose", seed=seed), BASELINE, SIMULATOR) for seed in (5, 6))
    assert judged(first).trace != judged(second).trace
