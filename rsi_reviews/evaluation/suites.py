"""Runs the two check suites of the protocol (R226). Execution: evidence, completion, dispatch identity, resource owner,
bounded recovery. RSI: difference, regression, release, rollback. Every check really performs what it checks.
"""

from collections.abc import Callable
from typing import Literal

import msgspec

from harness.bootstrap import simulated
from harness.contracts.actors import Actor
from harness.contracts.commands import AcquireLease
from harness.contracts.configuration import SPENDING, Configuration
from harness.contracts.decisions import Accepted, Refused
from harness.contracts.ids import InvocationId, MissionId, lease_stream, leased
from harness.contracts.simulation import Simulator
from harness.contracts.values import Moment, Name, Value
from harness.runtime import Start
from rsi_reviews.commands import PromoteCandidate, RollBack
from rsi_reviews.deciders import CANDIDATE
from rsi_reviews.difference import difference
from rsi_reviews.evaluation import arms
from rsi_reviews.evaluation.adjudicator import adjudicate
from rsi_reviews.evaluation.missions import condition, configuration
from rsi_reviews.projections import Review
from rsi_reviews.restrictions import loosened

Suite = Literal["execution", "RSI"]
BASE = leased(arms.ROBOT, "mobile_base")
FOREIGN = InvocationId("inv_of_somebody_else")
RELEASER = Actor(name="rita", role="releaser")
NOW = Moment(mission_s=0.0, wall_s=1_790_000_000.0)


class Check(Value):
    """One check: its claim, whether the claim holds, and what was seen."""

    suite: Suite
    name: Name
    text: str
    holds: bool
    seen: str


Seen = tuple[bool, str]


def checks(seed: int, simulator: Simulator) -> tuple[Check, ...]:
    """Both suites, with every check really performed."""
    return tuple(
        Check(suite=suite, name=name, text=text, holds=holds, seen=seen)
        for suite, name, text, check in CHECKS
        for holds, seen in [check(seed, simulator)]
    )


def evidence(seed: int, simulator: Simulator) -> Seen:
    """A success that no pose shows is refused, and accepted only once an observation has shown it."""
    went = _gated("pose-absent", seed, simulator)
    story = went.story
    refused = [one["at_s"] for one in story["rejections"]]
    claimed = [one["at_s"] for one in story["claims"] if one["node_id"] == "circuit"]
    holds = bool(refused) and bool(claimed) and min(refused) < min(claimed)
    return holds, f"refused {len(refused)} times before it was accepted"


def completion(seed: int, simulator: Simulator) -> Seen:
    """What is declared is what truly happened, where the provider speaks too soon."""
    verdict = adjudicate(_gated("success-too-soon", seed, simulator).story)
    holds = verdict["success"] and not verdict["contract_false"]
    return holds, f"declared {verdict['declared']}, truly done {verdict['truly_done']}"


def dispatch_identity(seed: int, simulator: Simulator) -> Seen:
    """The same request twice is one physical start."""
    story = _gated("request-twice", seed, simulator).story
    again = adjudicate(story)["duplicate_starts"]
    requests = {start["request_id"] for start in story["starts"]}
    return not again and len(requests) == len(story["starts"]), f"{len(story['starts'])} starts, {len(again)} repeated"


def resource_owner(seed: int, simulator: Simulator) -> Seen:
    """While somebody else holds the base, nothing moves it."""
    with simulated(arms.SIMULATED, simulator=simulator, seed=seed, configuration=configuration()) as harness:
        now_s = harness.clock.now().mission_s
        taken = AcquireLease(
            resource=BASE,
            mission_id=MissionId("mis_of_somebody_else"),
            invocation_id=FOREIGN,
            token=harness.runtime.lease(BASE).token + 1,
            expires_s=now_s + 3600.0,
        )
        held = isinstance(harness.runtime.decide([(lease_stream(BASE), taken)]), Accepted)
        harness.runtime.start(Start(actor=arms.ASKING, robot_id=arms.ROBOT, template="circuit", seed=seed))
        mission = harness.supervisor.run(harness.runtime.missions()[0].mission_id)
        moved = sum(start.moves for start in harness.starts(mission.mission_id))
        return held and not moved and mission.status != "succeeded", f"{moved} motions, mission {mission.status}"


def bounded_recovery(seed: int, simulator: Simulator) -> Seen:
    """A fault that never ends is met within the budget, and then a person is asked."""
    went = _gated("success-too-soon-always", seed, simulator)
    node = next(one for one in configuration().templates if one.name == "circuit").nodes[-1]
    total = int(node["recovery"]["total"])
    limits = {name: node["recovery"][name] for name in SPENDING}
    return went.spent <= total and went.handoffs == 1, f"{went.spent} of {total} spent of {limits}; {went.status}"


def named_difference(seed: int, simulator: Simulator) -> Seen:
    """A change is named by its path, and one that loosens is refused before anything runs."""
    first = configuration()
    changes = difference(first, _waiting(first)).changes
    rules = msgspec.structs.replace(first.context_rules, pose_age_s=first.context_rules.pose_age_s * 10)
    refusals = loosened(first, msgspec.structs.replace(first, context_rules=rules))
    named = [change.path for change in changes]
    holds = len(named) == 1 and named[0].endswith("wait_s") and bool(refusals)
    return holds, f"changed: {', '.join(named)}; refused: {', '.join(one.rule for one in refusals)}"


def matched_regression(seed: int, simulator: Simulator) -> Seen:
    """Frozen harness against a candidate on the same seeds, providers and faults: the same is the same, worse is seen.

    One candidate changes how long recovery waits, which nothing here asks; the other gives recovery up.
    """
    frozen, same, worse = (
        [_result(one, fault, seed, simulator) for fault in ("nominal", "run-interrupted")]
        for one in (
            arms.EvaluationArm("frozen", "H_0"),
            arms.EvaluationArm("candidate", "waits longer", settle=_waiting),
            arms.EvaluationArm("candidate", "no recovery", settle=arms.without_recovery),
        )
    )
    successes = [sum(success for success, _ in results) for results in (frozen, same, worse)]
    spent = [sum(cost for _, cost in results) for results in (frozen, same, worse)]
    holds = frozen == same and successes[2] < successes[0]
    return holds, f"successes {successes} and recovery spent {spent} of frozen, unchanged and worse"


def _result(chosen: arms.EvaluationArm, fault: str, seed: int, simulator: Simulator) -> tuple[bool, int]:
    case = arms.ArmCase(arm="evidence-gated", condition=condition(fault), mission="circuit", seed=seed)
    went = arms.run_under(chosen, case, simulator)
    return bool(adjudicate(went.story)["success"]), went.spent


def _waiting(first: Configuration) -> Configuration:
    waits = msgspec.structs.replace(first.recovery, wait_s=first.recovery.wait_s + 5.0)
    return msgspec.structs.replace(first, recovery=waits)


def guarded_release(seed: int, simulator: Simulator) -> Seen:
    """What was not evaluated, reviewed and tried is not promoted."""
    decision = CANDIDATE.decide(Review(version=1, status="draft"), PromoteCandidate(), NOW)
    return isinstance(decision, Refused), decision.rule if isinstance(decision, Refused) else "promoted"


def immediate_rollback(seed: int, simulator: Simulator) -> Seen:
    """A releaser's decision takes a current candidate back at once."""
    current = Review(version=1, status="current")
    decision = CANDIDATE.decide(current, RollBack(actor=RELEASER, reason="it does worse", key=f"key-{seed}"), NOW)
    if isinstance(decision, Refused):
        return False, decision.rule
    status = CANDIDATE.fold(current, decision.events).status
    return status == "rolled_back", status


def _gated(name: str, seed: int, simulator: Simulator) -> arms.CaseReport:
    return arms.run(
        arms.ArmCase(arm="evidence-gated", condition=condition(name), mission="circuit", seed=seed), simulator
    )


CHECKS: tuple[tuple[Suite, str, str, Callable[[int, Simulator], Seen]], ...] = (
    ("execution", "evidence", "no acceptance without evidence", evidence),
    ("execution", "completion", "declared only what truly happened", completion),
    ("execution", "dispatch-identity", "one request, one physical start", dispatch_identity),
    ("execution", "resource-owner", "nothing moves a base that another holds", resource_owner),
    ("execution", "bounded-recovery", "recovery ends within its budget", bounded_recovery),
    ("RSI", "difference", "changes are named, loosening is refused", named_difference),
    ("RSI", "regression", "on the same seeds a worse candidate is seen", matched_regression),
    ("RSI", "release", "no promotion without review and canary", guarded_release),
    ("RSI", "rollback", "a releaser's word takes it back at once", immediate_rollback),
)
