"""The experiment's own parts: lines of arms, the gate on one site, sites as files, what is kept, what is said of it."""

from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import msgspec
import pytest
from msgspec.structs import replace

from harness.baseline.load import baseline
from harness.contracts.configuration import Configuration
from harness.contracts.errors import ContractInvalid, UnknownName
from harness.contracts.ids import Digest, MissionId, NodeId
from harness.contracts.regularities import HiddenSite
from harness.contracts.values import digest, encode
from rsi_reviews.contracts import Candidate, CaseResult
from rsi_reviews.errors import CandidateInvalid
from rsi_reviews.generate.changes import with_ladder, with_wait
from rsi_reviews.generate.interface import GenerationBudget
from rsi_reviews.generate.miner import TraceMiner
from rsi_reviews.generate.person import Intention, PersonsEdit, edited
from rsi_reviews.generate.trace import Failing, Handed, MissionTrace, Rung, Trace
from rsi_reviews.held_out import Secret
from rsi_reviews.hidden_sites import hidden_site, site_file, site_names
from rsi_reviews.recursion.arms import ARMS, Arm, Line, Setting, step, written_by_hand
from rsi_reviews.recursion.experiment import MEASURED, FleetOutcome, Measured, Step, Task, Terms
from rsi_reviews.recursion.gating import Judgement, Scale, SiteGate
from rsi_reviews.recursion.missions import Stop, everyday, suite_cases
from rsi_reviews.recursion.plots import plot
from rsi_reviews.recursion.publish import BEGIN, END, found, publish
from rsi_reviews.recursion.report import answers, contrasts, rows
from rsi_reviews.recursion.run import blind_digest, blind_tasks, check_blind, kept, outcomes, tasks
from rsi_reviews.regression.cases import Case

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
            Failing(node_id=WALK, failure="stale_evidence", reason="", position=7 + n, at_s=1.0) for n in range(2)
        ),
        rungs=(
            Rung(
                node_id=WALK, failure="stale_evidence", action="re_perceive", cost=1, position=8, at_s=1.0,
                came="failed_again",
            ),
        ),
        handoffs=(Handed(node_id=WALK, failure="stale_evidence", position=9),),
    )  # fmt: skip


class Gate:
    """Accepts what it is told to, and remembers what it was asked."""

    def __init__(self, accepts: Callable[[Candidate], bool]) -> None:
        self._accepts = accepts
        self.asked: list[Candidate] = []

    def judge(self, candidate: Candidate, current: Configuration, site: HiddenSite) -> Judgement:
        """One word."""
        self.asked.append(candidate)
        taken = self._accepts(candidate)
        return Judgement(
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


def walked(arm: Arm, gate: Gate, fleet: Fleet, *, generations: int = 3) -> Line:
    line = Line(arm=arm)
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


@pytest.mark.ledger("R155", symbol="rsi_reviews.recursion.arms:Line.adopt")
def test_records_belong_to_the_version_they_were_made_under() -> None:
    line = Line(arm="gated")
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


def test_what_an_expert_wrote_stands_in_the_configuration_and_passes_the_static_check() -> None:
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


def judged(candidate: Candidate, cost: Callable[[Configuration, Case], float], **measures: float) -> Judgement:
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
    with pytest.raises(UnknownName, match="site"):
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
    with pytest.raises(ContractInvalid, match="blind"):
        check_blind()


# outcomes ------------------------------------------------------------------------------------------------------------


def measured(arm: Arm, generation: int, **sums: float) -> Measured:
    values = {**dict.fromkeys(MEASURED, 0.0), "verified_completion": 10.0, "verified_s": 400.0, "unsound": 0.0, **sums}
    return Measured(arm=arm, generation=generation, missions=10, sums=values, configuration=H0.configuration_id)


def outcome(fleet: int, *, kind: str = "regular", cost: dict[Arm, float] | None = None, released: bool = False,
            false: float = 0.0) -> FleetOutcome:  # fmt: skip
    costs: dict[Arm, float] = dict.fromkeys(ARMS, 40.0) | (cost or {})
    judgement = Judgement(
        candidate="c", component="recovery", reason="r", metric="recovery_cost", accepted=released,
        clause="accepted" if released else "unexercised", sentence="s", missions=10,
    )  # fmt: skip
    return FleetOutcome(
        task=Task(terms=Terms(seed=1, generations=1), fleet=fleet, site="calm"), kind=kind, simulated=100,
        measured=tuple(
            measured(arm, generation, recovery_cost=costs[arm] + fleet % 3 if generation else 40.0,
                     contract_false_completion=false if arm == "gated" else 0.0)
            for arm in ARMS for generation in (0, 1)
        ),
        steps=(Step(arm="gated", generation=0, judgement=judgement),),
    )  # fmt: skip


BETTER: dict[Arm, float] = {"gated": 5.0, "expert": 4.0}


@pytest.mark.ledger("R169", symbol="rsi_reviews.recursion.report:rows")
def test_rows_hold_the_measures_of_the_paper_per_arm_and_generation() -> None:
    found_rows = rows([outcome(n, cost=BETTER, released=True) for n in range(1, 7)])
    assert [(row["arm"], row["generation"]) for row in found_rows] == [(arm, g) for arm in ARMS for g in (0, 1)]
    gated = next(row for row in found_rows if (row["arm"], row["generation"]) == ("gated", 1))
    assert gated["n"] == 60 and gated["fleets"] == 6 and gated["verified_completion"] == 1.0
    assert gated["recovery_cost"] == pytest.approx(0.6)
    low, high = gated["recovery_cost_ci"]
    assert low < 0.6 < high
    assert gated["false_completion"] == 0.0 and gated["false_completion_ci"] == [0.0, 0.0]
    assert (gated["proposed"], gated["accepted"], gated["gate_missions_per_release"]) == (6, 6, 10.0)
    assert gated["verified_mission_s"] == 40.0


def test_a_gain_beyond_its_interval_is_not_refuted_and_a_tie_is() -> None:
    better = {one.refutes: one.refuted for one in answers([outcome(n, cost=BETTER) for n in range(1, 9)])}
    assert not better["the gated loop does not improve on the frozen harness"]
    tie = {one.refutes: one.refuted for one in answers([outcome(n) for n in range(1, 9)])}
    assert tie["the gated loop does not improve on the frozen harness"]
    assert tie["the gated loop does not beat batch tuning: no value in recursion"]


def test_a_release_where_nothing_recurs_and_a_false_completion_refute() -> None:
    calm = [outcome(n, kind="none", released=n == 1) for n in range(1, 4)]
    by_claim = {one.refutes: one for one in answers(calm)}
    assert by_claim["worlds without regularities release more often than alpha"].refuted
    assert "1 of 9" in by_claim["worlds without regularities release more often than alpha"].sentence
    false = {one.refutes: one.refuted for one in answers([outcome(1, false=1.0)])}
    assert false["the gated loop makes contract false completions"]
    assert false["worlds without regularities release more often than alpha"] is None


def test_contrasts_are_paired_by_fleet_and_signed_so_that_more_is_better() -> None:
    costs = contrasts([outcome(n, cost=BETTER) for n in range(1, 9)])
    against = {one.against: one for one in costs if (one.measure, one.over) == ("recovery_cost", "last")}
    assert against["frozen"].gain == pytest.approx(3.5) and against["frozen"].low == pytest.approx(3.5)
    assert against["expert"].gain == pytest.approx(-0.1)


def test_a_fleet_that_was_finished_is_not_run_again_and_one_of_other_terms_is_not_taken(tmp_path: Path) -> None:
    wanted = [outcome(n).task for n in (1, 2)]
    for n in (1, 2):
        one = outcome(n)
        (tmp_path / f"fleet-{n}-{digest(one.task)[:12]}.json").write_bytes(encode(one))
    told: list[int] = []
    found_again = outcomes(wanted, folder=tmp_path, processes=1, told=lambda one, done, of: told.append(done))
    assert [one.task.fleet for one in found_again] == [1, 2] and told == []
    other = [replace(task, terms=replace(task.terms, seed=2)) for task in wanted]
    assert kept(other, folder=tmp_path) == ()


def test_ten_fleets_are_one_turn_of_the_sites() -> None:
    turn = [site_file(task.site).kind for task in tasks(Terms(seed=1), 30)]
    assert (turn.count("regular"), turn.count("none"), turn.count("drifting")) == (21, 6, 3)


def test_a_plot_names_every_arm_and_says_its_figures_in_words() -> None:
    found_rows = rows([outcome(n, cost=BETTER) for n in range(1, 4)])
    svg = plot(found_rows, measure="recovery_cost", title="Cost", unit="per mission")
    tree = ElementTree.fromstring(svg)
    texts = [one.text or "" for one in tree.iter("{http://www.w3.org/2000/svg}text")]
    assert set(ARMS) <= set(texts) and "generation" in texts
    assert "gated: 4 at generation 0" in (tree.findtext("{http://www.w3.org/2000/svg}desc") or "")
    assert "prefers-color-scheme:dark" in svg


def test_a_published_run_stands_in_the_page_in_json_and_in_plots(tmp_path: Path) -> None:
    (tmp_path / "recursion.md").write_text(f"# Before\n\n{BEGIN}\nold\n{END}\n\n# After\n")
    done = [outcome(n, cost=BETTER) for n in range(1, 4)]
    publish(found(done, (), Terms(seed=1, generations=1), fleets=3), docs=tmp_path)
    page = (tmp_path / "recursion.md").read_text()
    assert page.startswith("# Before") and page.rstrip().endswith("# After") and "old" not in page
    assert "| gated | 30 |" in page and "3 of 3 fleets" in page
    stored = msgspec.json.decode((tmp_path / "results" / "recursion.json").read_bytes())
    assert {row["arm"] for row in stored["rows"]} == set(ARMS) and stored["complete"]
    assert (tmp_path / "recursion" / "recovery-cost.svg").exists()
    (tmp_path / "recursion.md").write_text("# no place\n")
    with pytest.raises(ContractInvalid, match="no place for figures"):
        publish(found(done, (), Terms(seed=1), fleets=3), docs=tmp_path)


# a person ------------------------------------------------------------------------------------------------------------

WHY = Intention(reason="Waits are too short at the dock.", intended_effect="Fewer questions.")


def test_an_edit_in_json_becomes_a_candidate_with_the_persons_name() -> None:
    text = msgspec.json.encode(with_wait(H0, 40.0)).decode()
    (mine,) = PersonsEdit(text, WHY, who="ada").propose(Trace(missions=()), H0, GenerationBudget())
    assert mine.manifest.component == "recovery" and mine.manifest.author.name == "ada"
    assert mine.manifest.author.kind == "person" and mine.manifest.rollback == H0.configuration_id
    seen = GenerationBudget(seen=(mine.configuration.configuration_id,))
    assert PersonsEdit(text, WHY, who="ada").propose(Trace(missions=()), H0, seen) == ()


def test_an_edit_in_yaml_is_read_as_strictly() -> None:
    text = msgspec.yaml.encode(with_wait(H0, 40.0)).decode()
    assert edited(text, H0, WHY, who="ada").configuration == with_wait(H0, 40.0)
    with pytest.raises(CandidateInvalid) as caught:
        edited(f"{text}gate: {{}}\n", H0, WHY, who="ada")
    assert caught.value.rule == "not_readable"


@pytest.mark.parametrize(
    ("changed", "rule"),
    [
        (H0, "no_change"),
        (replace(with_wait(H0, 40.0), routing=replace(H0.routing, history=2.0)), "other_component"),
    ],
    ids=["nothing", "two sections"],
)
def test_an_edit_changes_exactly_one_section(changed: Configuration, rule: str) -> None:
    with pytest.raises(CandidateInvalid) as caught:
        edited(msgspec.json.encode(changed).decode(), H0, WHY, who="ada")
    assert caught.value.rule == rule
