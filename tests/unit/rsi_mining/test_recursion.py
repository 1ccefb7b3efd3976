"""The experiment's own parts: lines of arms, the gate on one site, sites as files."""

from collections.abc import Callable
from pathlib import Path

import pytest
from msgspec.structs import replace

from harness.baseline.load import baseline
from harness.contracts.configuration import Configuration
from harness.contracts.errors import ContractInvalid, UnknownName
from harness.contracts.ids import Digest, MissionId, NodeId
from harness.contracts.regularities import HiddenSite
from rsi_reviews.contracts import Candidate, CaseResult
from rsi_reviews.generate.changes import with_ladder
from rsi_reviews.generate.interface import GenerationBudget
from rsi_reviews.generate.miner import TraceMiner
from rsi_reviews.generate.trace import HandoffTrace, MissionTrace, StageFailure, Trace, TracedStep
from rsi_reviews.held_out import Secret
from rsi_reviews.hidden_sites import hidden_site, site_file, site_names
from rsi_reviews.recursion.arms import Arm, ArmLineage, Setting, step, written_by_hand
from rsi_reviews.recursion.experiment import Terms
from rsi_reviews.recursion.gating import GateJudgement, Scale, SiteGate
from rsi_reviews.recursion.missions import Stop, everyday, suite_cases
from rsi_reviews.recursion.run import blind_digest, blind_tasks, check_blind
from rsi_reviews.regression.cases import Case
from tests.saying import raises_saying

H0 = baseline()
CALM = HiddenSite(name="calm")
STALE = with_ladder(H0, "stale_evidence", ("re_perceive", "adjust_view", "human"))
WALK = NodeId("circuit")


def struck(number: int, configuration: Configuration) -> MissionTrace:
    """A mission that asked a person after one look."""
    return MissionTrace(
        mission_id=MissionId(f"mis_{number}"), template="circuit", configuration=configuration.configuration_id,
        status="", seconds=45.0, executions=(),
        failures=tuple(
            StageFailure(node_id=WALK, failure="stale_evidence", reason="", position=7 + n, at_s=1.0) for n in range(2)
        ),
        rungs=(
            TracedStep(
                node_id=WALK, failure="stale_evidence", action="re_perceive", cost=1, position=8, at_s=1.0,
                came="failed_again",
            ),
        ),
        handoffs=(HandoffTrace(node_id=WALK, failure="stale_evidence", position=9),),
    )  # fmt: skip


class Gate:
    """Accepts what it is told to, and remembers what it was asked."""

    def __init__(self, accepts: Callable[[Candidate], bool]) -> None:
        self._accepts = accepts
        self.asked: list[Candidate] = []

    def judge(self, candidate: Candidate, current: Configuration, site: HiddenSite) -> GateJudgement:
        """One word."""
        self.asked.append(candidate)
        taken = self._accepts(candidate)
        return GateJudgement(
            candidate=candidate.candidate_id, component="recovery", reason="r", metric="recovery_cost", accepted=taken,
            clause="accepted" if taken else "metric_better:fail", sentence="s", missions=40,
        )  # fmt: skip


class Fleet:
    """Missions that ask until the ladder has a second look; counts what was recorded under which version."""

    def __init__(self) -> None:
        self.under: list[str] = []

    def recorded(self, configuration: Configuration, generation: int) -> Trace:
        """Four missions of a generation."""
        self.under.append(configuration.configuration_id)
        if "adjust_view" in configuration.recovery.ladders["stale_evidence"]:
            return Trace(missions=())
        return Trace(missions=tuple(struck(10 * generation + n, configuration) for n in range(4)))


def setting(gate: Gate, fleet: Fleet, *, generations: int = 3) -> Setting:
    return Setting(
        gate=gate, recorded=fleet.recorded, site=CALM, proposals=1, generations=generations, key="k",  # type: ignore[arg-type]
    )  # fmt: skip


def walked(arm: Arm, gate: Gate, fleet: Fleet, *, generations: int = 3) -> ArmLineage:
    line = ArmLineage(arm=arm)
    for generation in range(generations):
        step(line, generation, setting(gate, fleet, generations=generations))
    return line


# arms ----------------------------------------------------------------------------------------------------------------


@pytest.mark.ledger("R153", "R165", symbol="rsi_reviews.recursion.arms:step")
def test_missions_under_a_released_version_are_what_the_next_cycle_reads() -> None:
    gate, fleet = Gate(lambda one: True), Fleet()
    line = walked("gated", gate, fleet)
    first = gate.asked[0].configuration
    assert fleet.under == [H0.configuration_id, first.configuration_id, first.configuration_id]
    assert line.current == first and len(gate.asked) == 1
    assert gate.asked[0].manifest.baseline == H0.configuration_id


@pytest.mark.ledger("R155", symbol="rsi_reviews.recursion.arms:ArmLineage.adopt")
def test_records_belong_to_the_version_they_were_made_under() -> None:
    line = ArmLineage(arm="gated")
    line.learn(Trace(missions=(struck(1, H0),)))
    line.adopt(STALE)
    assert line.traces == [] and line.current == STALE and line.recorded_missions == 1


def test_a_refused_candidate_changes_nothing_and_does_not_come_again() -> None:
    gate, fleet = Gate(lambda one: False), Fleet()
    line = walked("gated", gate, fleet, generations=4)
    assert line.current == H0 and fleet.under == [H0.configuration_id] * 4
    identities = [one.configuration.configuration_id for one in gate.asked]
    assert len(identities) == len(set(identities)) > 1


def test_the_ungated_arm_asks_nobody_and_loosens() -> None:
    gate, fleet = Gate(lambda one: False), Fleet()
    line = walked("ungated", gate, fleet, generations=1)
    assert gate.asked == [] and line.current.context_rules.pose_age_s > H0.context_rules.pose_age_s


def test_random_search_records_nothing_and_goes_through_the_gate() -> None:
    gate, fleet = Gate(lambda one: False), Fleet()
    walked("random", gate, fleet)
    assert fleet.under == [] and len(gate.asked) == 3


def test_batch_reads_as_many_missions_of_h0_and_proposes_once_at_the_end() -> None:
    gate, fleet = Gate(lambda one: True), Fleet()
    line = walked("batch", gate, fleet)
    assert fleet.under == [H0.configuration_id] * 3 and line.recorded_missions == 12
    assert {generation for generation, _ in line.judgements} == {2}
    assert "adjust_view" in line.current.recovery.ladders["stale_evidence"]


@pytest.mark.parametrize("arm", ["frozen", "expert"])
def test_two_arms_stand_still(arm: Arm) -> None:
    gate, fleet = Gate(lambda one: True), Fleet()
    assert walked(arm, gate, fleet).current == H0 and not gate.asked and not fleet.under


def test_what_an_expert_wrote_stands_in_the_configuration() -> None:
    for name in (*site_names(), *(f"blind/{one}" for one in site_names("sites/blind"))):
        for phase in site_file(name).phases:
            by_hand = written_by_hand(phase.expert)
            assert (by_hand == H0) == (phase.expert is None)
    slow = written_by_hand(site_file("slow-start").phases[0].expert)
    assert slow.recovery.wait_s == 40.0


# the gate on one site ------------------------------------------------------------------------------------------------


def result(case: Case, configuration: Configuration, *, cost: float, trace: str, **measures: float) -> CaseResult:
    return CaseResult(
        case=case.case_id, family=case.situation.family, seed=case.seed, configuration=configuration.configuration_id,
        outcome="finished", recovery_cost=cost, verified_completion=1.0, mission_s=40.0, trace=Digest(trace),
        **measures,
    )  # fmt: skip


def judged(candidate: Candidate, cost: Callable[[Configuration, Case], float], **measures: float) -> GateJudgement:
    def run(cases: tuple[Case, ...], configuration: Configuration, stop: Stop | None) -> tuple[CaseResult, ...]:
        under = configuration == candidate.configuration
        every = tuple(
            result(one, configuration, cost=cost(configuration, one), trace=str(cost(configuration, one)),
                   **(measures if under else {}))
            for one in cases
        )  # fmt: skip
        ends = (n for n in range(1, len(every)) if stop is not None and stop(every[:n]))
        return every[: next(ends, len(every))]

    return SiteGate(run, secret=Secret(b"s" * 32), scale=Scale(), key="k").judge(candidate, H0, CALM)


def proposed(configuration: Configuration = STALE) -> Candidate:
    found = TraceMiner().propose(Trace(missions=tuple(struck(n, H0) for n in range(4))), H0, GenerationBudget())[0]
    return replace(found, configuration=configuration)


def cheaper(configuration: Configuration, case: Case) -> float:
    return 9.0 if configuration == H0 else 2.0


def test_a_candidate_that_is_better_on_the_suite_and_on_held_out_cases_is_accepted() -> None:
    answer = judged(proposed(), cheaper)
    assert answer.accepted and answer.clause == "accepted" and "held-out look 1 confirms" in answer.sentence
    assert answer.missions == 2 * (5 * Scale().per_family + 5 * Scale().held_out_per_family)


def test_a_change_that_changes_nothing_is_refused_after_the_first_missions() -> None:
    answer = judged(proposed(), lambda configuration, case: 9.0)
    assert (answer.accepted, answer.clause) == (False, "unexercised")
    assert answer.missions == 5 * Scale().per_family + Scale().first_look


def test_what_loosens_is_refused_before_anything_runs() -> None:
    loose = replace(H0, context_rules=replace(H0.context_rules, pose_age_s=60.0))
    answer = judged(proposed(loose), cheaper)
    assert answer.clause == "static:freshness" and answer.missions == 0


def test_better_on_the_suite_only_is_not_enough() -> None:
    def on_the_suite(configuration: Configuration, case: Case) -> float:
        held_out = case not in suite_cases(CALM, "k", "regression", per_family=Scale().per_family)
        return 9.0 if configuration == H0 or held_out else 2.0

    answer = judged(proposed(), on_the_suite)
    assert not answer.accepted and answer.clause == "metric_better:held_out"


def test_one_contract_false_completion_refuses_whatever_it_saves() -> None:
    answer = judged(proposed(), cheaper, contract_false_completion=1.0)
    assert not answer.accepted and answer.clause == "contracts_preserved:fail"


# sites ---------------------------------------------------------------------------------------------------------------


def test_there_are_regular_sites_one_where_nothing_recurs_and_one_that_drifts() -> None:
    kinds = [site_file(name).kind for name in site_names()]
    assert kinds.count("regular") >= 7 and "none" in kinds and "drifting" in kinds
    assert hidden_site("calm").regularities == ()
    before, after = hidden_site("moving-boxes@1.2"), hidden_site("moving-boxes@1.3")
    assert {one.name for one in before.regularities}.isdisjoint(one.name for one in after.regularities)


def test_a_site_differs_a_little_from_fleet_to_fleet_and_not_from_generation_to_generation() -> None:
    one, other = hidden_site("lagging-dock@1.0"), hidden_site("lagging-dock@2.0")
    assert one.regularities != other.regularities
    assert hidden_site("lagging-dock@1.4") == one
    assert abs(one.regularities[0].share - 0.6) <= 0.6 * 0.15


@pytest.mark.parametrize("text", ["atlantis", "calm@x.1", "calm@1", "../secrets"])
def test_a_site_that_is_not_there_is_named(text: str) -> None:
    with raises_saying(UnknownName, match="site"):
        hidden_site(text)


@pytest.mark.ledger("R166", symbol="rsi_reviews.recursion.missions:everyday")
def test_every_arm_meets_the_same_missions_and_generations_record_new_ones() -> None:
    site = hidden_site("busy-aisle@1.0")
    assert everyday(site, "1/1", "measured", count=9) == everyday(site, "1/1", "measured", count=9)
    seeds = {
        case.seed
        for key in (("1/1", "measured"), ("1/1", "recorded", 0), ("1/1", "recorded", 1), ("1/2", "measured"))
        for case in everyday(site, *key, count=50)
    }
    assert len(seeds) == 200
    faulty = [case for case in everyday(site, "x", count=400) if case.situation.faults]
    assert 30 < len(faulty) < 90


def test_the_blind_sites_are_those_that_were_hashed(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    check_blind()
    assert {task.site for task in blind_tasks(Terms(seed=1), each=2)} == {
        f"blind/{name}" for name in site_names("sites/blind")
    }
    committed = blind_digest()
    copy = tmp_path / "sites" / "blind"
    copy.mkdir(parents=True)
    for name in site_names("sites/blind"):
        source = Path("rsi_reviews/sites/blind") / f"{name}.yaml"
        (copy / source.name).write_text(source.read_text() + "\n# easier now\n")
    (tmp_path / "sites" / "blind.sha256").write_text(f"{committed}\n")
    monkeypatch.setattr("rsi_reviews.recursion.run.FOLDER_PATH", tmp_path)
    with raises_saying(ContractInvalid, match="blind"):
        check_blind()
