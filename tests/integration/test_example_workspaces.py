"""The example workspaces: a grasp, a task-and-motion provider and a world model, each through the same lifecycle.

Each is what a team would bring: a site's folder with its own capability, a program of Python's standard library behind
the provider protocol, and a package with predicates. Nothing of them is known to the harness.
"""

import json
import re
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from app.cli.main import app
from app.cli.output import complain
from app.i18n.reasons.rendering import explained, sentence
from harness.adapters.installed_predicates import INSTALLED, LIMITS
from harness.bootstrap import read_harness
from harness.contracts.contexts import Context
from harness.contracts.errors import ContractInvalid, HarnessError
from harness.contracts.estimates import ESTIMATE, TargetEstimates
from harness.contracts.events import DispatchIntended, GoalVerified, NodePlanned, VerdictRecorded
from harness.contracts.ids import Digest, MissionId
from harness.contracts.observations import InstrumentReading
from harness.contracts.predicates import PredicateEvidence, PredicateQuestion
from harness.contracts.values import decode
from harness.gate.decide import DECIDER
from harness.settings import HarnessSettings
from tests.builders.workspaces import TOKEN, ExampleWorkspace, installed, package

CHECK = ("--allow-motion", "--stands-clear", "robot-1")


def regen(*words: str) -> tuple[int, Any, str]:
    """Exit code, the JSON answer, and what stood on standard error."""
    done = CliRunner(env={"ROBOT_TOKEN": TOKEN}).invoke(app, [*words, "--json"])
    if isinstance(done.exception, HarnessError):
        return complain(done.exception), None, explained(done.exception)
    return done.exit_code, json.loads(done.stdout) if done.stdout else None, done.stderr


def ran(site: ExampleWorkspace, mission: str, *words: str) -> tuple[int, Any, str]:
    return regen("mission", "run", mission, "--site", str(site.folder), "--speed", "0", *words)


def events(site: ExampleWorkspace, mission_id: str) -> list[Any]:
    with read_harness(HarnessSettings(data_folder=site.folder / "var", site_folder=site.folder)) as runtime:
        return [DECIDER.codec.decode(one) for one in runtime.events(MissionId(mission_id))]


def contexts(site: ExampleWorkspace, digests: Sequence[Digest | None]) -> list[Context]:
    with read_harness(HarnessSettings(data_folder=site.folder / "var", site_folder=site.folder)) as runtime:
        return [decode(runtime.record(one).body, Context) for one in digests if one is not None]


@pytest.fixture(scope="module")
def predicates(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    folder = package(tmp_path_factory.mktemp("packages"))
    with installed(folder):
        yield folder


@pytest.fixture(scope="module")
def admitted(tmp_path_factory: pytest.TempPathFactory, predicates: Path) -> dict[str, ExampleWorkspace]:
    """Each example with its folder checked and its providers admitted by the kit."""
    found: dict[str, ExampleWorkspace] = {}
    for name, providers in (("grasp", 1), ("tamp", 1), ("world-model", 2), ("dock", 1)):
        site = ExampleWorkspace(tmp_path_factory.mktemp("sites") / name, name)
        code, answer, said = regen("check", str(site.folder))
        assert (code, answer["problems"]) == (0, []), said
        with site.robot():
            code, answer, said = regen("provider", "check", "robot-1", "--site", str(site.folder), *CHECK)
        assert code == 0, (answer, said)
        assert len(answer["providers"]) == providers
        found[name] = site
    return found


@pytest.mark.ledger("R23", "R187", symbol="harness.verification.installed:installed_finding", entry="command line")
def test_a_grasp_of_a_sites_own_capability_is_accepted_on_two_instruments(
    admitted: dict[str, ExampleWorkspace],
) -> None:
    site = admitted["grasp"]
    with site.robot():
        code, outcome, said = ran(site, "pick")
    assert code == 0, said
    assert (outcome["status"], outcome["goal_verdict"]) == ("succeeded", "satisfied")
    log = events(site, outcome["mission_id"])
    (intent,) = [one for one in log if isinstance(one, DispatchIntended)]
    assert (intent.capability, set(intent.resources)) == ("acme.pick", {"mobile_base", "gripper"})
    (held,) = next(one for one in log if isinstance(one, VerdictRecorded)).verdict.results
    assert held.sources == ("gripper width", "bench scale") and (held.independence, held.required_independence) == (
        1,
        1,
    )
    assert 0.02 < held.measured["width_m"] < 0.06 and held.measured["weight_kg"] < 0.1 < held.measured["before_kg"]


@pytest.mark.ledger("R23", "R187", symbol="harness.contracts.capabilities:_differences", entry="command line")
def test_a_task_and_motion_provider_does_its_plan_of_several_steps(admitted: dict[str, ExampleWorkspace]) -> None:
    site = admitted["tamp"]
    with site.robot():
        code, outcome, said = ran(site, "tidy")
    assert code == 0, said
    assert (outcome["status"], outcome["goal_verdict"]) == ("succeeded", "satisfied")
    with read_harness(HarnessSettings(data_folder=site.folder / "var", site_folder=site.folder)) as runtime:
        mission = runtime.mission(MissionId(outcome["mission_id"]))
        (packet,) = next(iter(mission.nodes.values())).packets
        (plan,) = packet.receipts
        assert plan.blob is not None
        steps = json.loads(runtime.blob(plan.blob))
    assert [one["do"] for one in steps["planned"]] == ["drive", "grip", "drive", "release"]
    assert [one["do"] for one in steps["done"]] == ["drive", "grip", "drive", "release"]
    assert len(steps["planned"][2]["points"]) > 1, "the way leads around the table"
    changed = site.folder / "capabilities.yaml"
    text = changed.read_text()
    changed.write_text(text.replace('"receipt:plan"]', '"receipt:plan", image]'))
    with site.robot():
        code, _, said = ran(site, "tidy")
    changed.write_text(text)
    assert code == 3 and "image" in said, "a card that does not bring what its type asks for is not used"


@pytest.mark.parametrize(("name", "mission"), [("grasp", "pick"), ("tamp", "tidy")])
def test_a_provider_that_claims_what_no_instrument_shows_is_not_believed(
    admitted: dict[str, ExampleWorkspace], name: str, mission: str
) -> None:
    site = admitted[name]
    with site.robot("--slips"):
        code, outcome, said = ran(site, mission)
    assert (code, outcome["status"]) == (3, "awaiting_human"), said
    verdicts = [one.verdict for one in events(site, outcome["mission_id"]) if isinstance(one, VerdictRecorded)]
    assert [one.verdict for one in verdicts] == ["violated"]


@pytest.mark.ask("navigation2#5567", "mowglinext#486")
@pytest.mark.parametrize(("options", "code", "verdict"), [((), 0, "satisfied"), (("--no-contact",), 3, "violated")])
def test_docked_is_not_charging_only_the_current_completes_the_mission(
    admitted: dict[str, ExampleWorkspace], options: tuple[str, ...], code: int, verdict: str
) -> None:
    site = admitted["dock"]
    with site.robot(*options):
        found, outcome, said = ran(site, "charge")
    assert found == code, said
    verdicts = [one.verdict for one in events(site, outcome["mission_id"]) if isinstance(one, VerdictRecorded)]
    assert {one.verdict for one in verdicts} == {verdict}
    (charging,) = verdicts[0].results
    assert charging.sources == ("charge current",) and (charging.measured["current_a"] > 0.3) == (code == 0)


@pytest.mark.ledger("R23", "R187", symbol="harness.supervisor.estimates:TargetScores.records", entry="command line")
@pytest.mark.ledger("R42", "R65", symbol="harness.planning.estimates:by_estimate", entry="command line")
def test_a_world_model_orders_the_targets_is_recorded_and_stays_out_of_c3(
    admitted: dict[str, ExampleWorkspace],
) -> None:
    site = admitted["world-model"]
    with site.robot():
        code, outcome, said = ran(site, "visit-shelves")
    assert (code, outcome["goal_verdict"]) == (0, "satisfied"), said
    log = events(site, outcome["mission_id"])
    planned = [one for one in log if isinstance(one, NodePlanned)]
    assert [one.node_id for one in planned] == ["visit_second", "visit_first", "back"], "the nearer shelf by its model"
    assert planned[0].reason.code == "best_estimate" and "world model" in sentence(planned[0].reason)  # type: ignore[union-attr]
    (c1, *_) = contexts(site, [one.context for one in planned])
    (record,) = c1.all(ESTIMATE)
    scores = record.read(TargetEstimates).scores
    assert record.origin == "provider" and scores["visit_second"] > scores["visit_first"]  # type: ignore[index]
    judged = [one.verdict.context for one in log if isinstance(one, VerdictRecorded | GoalVerified)]
    assert len(judged) == 4
    for context in contexts(site, judged):
        assert not context.all(ESTIMATE) and "world-model" not in {one.source for one in context.records}


@pytest.mark.ledger("R65", symbol="harness.supervisor.estimates:_scores", entry="command line")
@pytest.mark.parametrize(("option", "said_of_it"), [("--without-model", ""), ("--wrong", "estimate_unusable")])
def test_the_core_runs_without_a_world_model_and_with_one_that_answers_nonsense(
    admitted: dict[str, ExampleWorkspace], option: str, said_of_it: str
) -> None:
    site = admitted["world-model"]
    with site.robot(option):
        code, outcome, said = ran(site, "visit-shelves")
    assert (code, outcome["goal_verdict"]) == (0, "satisfied"), said
    planned = [one for one in events(site, outcome["mission_id"]) if isinstance(one, NodePlanned)]
    assert [one.node_id for one in planned] == ["visit_first", "visit_second", "back"], "the order of the graph"
    found = [one.read(TargetEstimates) for one in contexts(site, [planned[0].context])[0].all(ESTIMATE)]
    assert [getattr(one.missing, "code", "") for one in found] == ([said_of_it] if said_of_it else [])


@pytest.mark.ledger("R42", symbol="harness.goals.vocabulary:_problems", entry="command line")
def test_no_stage_may_rest_on_an_estimate(tmp_path: Path, predicates: Path) -> None:
    site = ExampleWorkspace(tmp_path / "yard", "world-model")
    site.edit("missions/visit.yaml", "capabilities: [navigate]", "capabilities: [acme.score_targets]")
    code, answer, _ = regen("check", str(site.folder))
    assert code == 2
    assert {one["code"] for one in answer["problems"]} == {"capability_only_estimates"}
    site.edit("capabilities.yaml", "estimates: true", "effects: [arrival]\n    estimates: true")
    code, answer, _ = regen("check", str(site.folder))
    assert "estimates_claim_nothing" in {one["code"] for one in answer["problems"]}


BAD = [
    ("a capability that nobody declares", "missions/pick.yaml", "[acme.pick]", "[acme.grab]", "capability_undeclared"),
    (
        "a parameter that it does not have", "missions/pick.yaml",
        'thing: "${thing}"\n', "colour: red\n", "capability_without_parameter",
    ),
    (
        "an effect that it may not claim", "capabilities.yaml",
        "[acme.held, static_body]", "[static_body]", "capability_without_effect",
    ),
    ("an effect that nobody tests", "capabilities.yaml", "[acme.held,", "[acme.hold,", "effect_without_predicate"),
    ("a stage that understates its risk", "missions/pick.yaml", "risk: medium", "risk: low", "stage_risk_understated"),
    ("a name without a vendor", "capabilities.yaml", "name: acme.pick", "name: pick", "capability_not_namespaced"),
    ("a name that is none", "capabilities.yaml", "name: acme.pick", "name: Acme Pick", "field_invalid"),
    ("a vouched name that is none", "site.yaml", "vouched: [acme.held]", "vouched: [acme.hold]", "vouched_unknown"),
]  # fmt: skip


@pytest.mark.parametrize(("file", "old", "new", "code"), [one[1:] for one in BAD], ids=[one[0] for one in BAD])
def test_what_the_vocabulary_does_not_declare_is_named_with_its_file_and_line(
    tmp_path: Path, predicates: Path, file: str, old: str, new: str, code: str
) -> None:
    site = ExampleWorkspace(tmp_path / "bench", "grasp")
    site.edit(file, old, new)
    exit_code, answer, _ = regen("check", str(site.folder))
    assert exit_code == 2
    (problem, *_) = [one for one in answer["problems"] if one["code"] == code]
    assert re.match(rf"{site.folder}/[\w./-]+\.yaml:[1-9]\d*", problem["where"]), problem


def test_a_predicate_that_nobody_vouches_for_is_refused_before_anything_moves(
    tmp_path: Path, admitted: dict[str, ExampleWorkspace]
) -> None:
    site = admitted["grasp"]
    site.edit("site.yaml", "vouched: [acme.held]", "vouched: []")
    try:
        with site.robot():
            code, _, said = ran(site, "pick")
    finally:
        site.edit("site.yaml", "vouched: []", "vouched: [acme.held]")
    assert code == 2 and "acme.held" in said and "vouch" in said


def test_without_the_package_the_mission_is_refused_with_what_is_missing(
    tmp_path: Path, predicates: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "path", [one for one in sys.path if one != str(predicates)])
    site = ExampleWorkspace(tmp_path / "bench", "grasp")
    code, answer, _ = regen("check", str(site.folder))
    assert code == 2
    assert {"effect_without_predicate", "condition_names_no_predicate"} <= {one["code"] for one in answer["problems"]}


FIRST = "    width_m, weight_kg = _newest"
LAST = '    return PredicateAnswer(verdict="satisfied", why="held, and off'
BROKEN = {
    "raises": (FIRST, f'    raise RuntimeError("never")\n{FIRST}'),
    "loops": (FIRST, f"    while True:\n        pass\n{FIRST}"),
    "changes what it is shown": (FIRST, f'    effect["arguments"] = {{}}\n{FIRST}'),
    "answers at random": (LAST, f'    import random\n    measured["width_m"] = random.random()\n{LAST}'),
    "answers with a truth value": (LAST, f"    return True\n{LAST}"),
    "takes all memory": (FIRST, f"    hoard = bytearray(2**33)\n{FIRST}"),
}


@pytest.mark.parametrize("how", BROKEN)
def test_a_predicate_that_breaks_gives_no_answer(
    tmp_path: Path, predicates: Path, how: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "path", [one for one in sys.path if one != str(predicates)])
    monkeypatch.setattr("harness.adapters.installed_predicates.LIMITS", replace(LIMITS, wall_s=1.0))
    readings = {
        name: tuple(
            InstrumentReading(seq=number, at_s=float(number), source=name, value=value)
            for number, value in enumerate(values)
        )
        for name, values in (("gripper width", (0.08, 0.04)), ("bench scale", (0.5, 0.0)))
    }
    question = PredicateQuestion(
        effect={"predicate": "acme.held", "arguments": {"thing": "box"}},
        evidence=PredicateEvidence(at_s=1.0, from_s=0.0, instruments=readings),
    )
    with installed(predicates):
        assert INSTALLED.ask("acme.held", question).verdict == "satisfied", "as it ships"
    with installed(package(tmp_path / "packages", changed=BROKEN[how])), pytest.raises(ContractInvalid):
        INSTALLED.ask("acme.held", question)


def test_a_predicate_that_breaks_never_becomes_a_success(
    tmp_path: Path, admitted: dict[str, ExampleWorkspace], predicates: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    site = admitted["grasp"]
    monkeypatch.setattr(sys, "path", [one for one in sys.path if one != str(predicates)])
    changed = BROKEN["changes what it is shown"]
    with installed(package(tmp_path / "packages", changed=changed)), site.robot():
        code, outcome, said = ran(site, "pick")
        log = events(site, outcome["mission_id"])
    assert (code, outcome["status"]) == (3, "awaiting_human"), said
    verdicts = [one.verdict for one in log if isinstance(one, VerdictRecorded)]
    assert {one.verdict for one in verdicts} == {"ambiguous"} and "acme.held" in said


def test_a_mission_is_judged_again_only_by_the_predicate_it_is_pinned_to(
    tmp_path: Path, admitted: dict[str, ExampleWorkspace], predicates: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    site = admitted["grasp"]
    with site.robot():
        code, outcome, said = ran(site, "pick")
    assert code == 0, said
    code, same, said = regen("audit", "replay", outcome["mission_id"], "--data", str(site.folder / "var"))
    assert code == 0, (same, said)
    monkeypatch.setattr(sys, "path", [one for one in sys.path if one != str(predicates)])
    looser = ("FINGERS_M = (0.02, 0.06)", "FINGERS_M = (0.0, 1.0)")
    with installed(package(tmp_path / "packages", changed=looser)):
        code, _, _ = regen("audit", "replay", outcome["mission_id"], "--data", str(site.folder / "var"))
    assert code == 1, "the same version with other code judges nothing"
