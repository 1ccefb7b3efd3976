"""/api/v1/candidates and /releases: everything the pages can do; decisions are made by people, on what they saw."""

from typing import Annotated, Any, Literal

from fastapi import Query

from app.acts import releases as acts
from app.console import ActorDep, ConsoleDep
from app.i18n.reasons.rendering import sentence
from app.routes import api_release_schemas as schemas
from app.routes import api_requests, candidate_evaluation
from app.routes.candidate_editor import checked, proposed
from app.routes.candidate_json import row, sheet
from app.routes.candidates import replayed
from app.routes.releases import instant_of, saved
from app.views import candidates as board
from app.views.review_replay import Decided
from app.web.security import PrincipalDep
from harness.contracts.decisions import Refused
from harness.contracts.errors import ContractInvalid, UnknownName
from harness.contracts.ids import Digest, MissionId, RobotId
from harness.contracts.reasons import because
from rsi_reviews.candidates import read_candidate
from rsi_reviews.contracts import ReleasePolicy
from rsi_reviews.difference import CandidateDifference
from rsi_reviews.release_service import SignedBy
from rsi_reviews.suite_growth import CaseAdded

router = api_requests.router("candidates")
Group = Literal[
    "", "draft", "evaluating", "accepted", "in_review", "authorised", "canary", "current", "not_accepted", "taken_back"
]


@router.get("/candidates", responses=api_requests.answers(schemas.CandidateSummary, many=True))
def listed(
    console: ConsoleDep,
    q: api_requests.Words = "",
    status: Group = "",
    limit: Annotated[int, Query(ge=1, le=500)] = 200,
) -> Any:
    """Newest first. `status` is a tab of the board."""
    params = board.CandidateListParams(words=q, group=status)
    return [row(one) for one in board.chosen(console.releases.reviews(), params)][:limit]


@router.post("/candidates", responses=api_requests.answers(schemas.CandidateResource))
def propose(console: ConsoleDep, actor: ActorDep, body: acts.ProposeCandidateAct) -> Any:
    """Put a candidate on record. What loosens anything is refused with every rule it breaks, before anything runs."""
    candidate = read_candidate(body.configuration.encode(), body.manifest.encode())
    decision = proposed(console, actor, candidate, body.supersedes)
    if isinstance(decision, Refused):
        found = [f"{one.rule}: {one.path}: {sentence(one.reason)}" for one in console.releases.refusals(candidate)]
        return api_requests.refusal(decision, do="; ".join(found[:20]) or "see the message")
    return sheet(console.releases, candidate.candidate_id)


@router.post("/candidates/check", responses=api_requests.answers(schemas.CandidateCheck))
def check(console: ConsoleDep, principal: PrincipalDep, body: acts.ProposeCandidateAct) -> Any:
    """Every rule that a candidate breaks, and what it would change against what is current. Nothing is written."""
    principal.acting("propose")
    candidate = read_candidate(body.configuration.encode(), body.manifest.encode())
    found = checked(console, candidate)
    return api_requests.plain(
        schemas.CandidateCheck(
            candidate=candidate.candidate_id,
            holds=not found.refusals,
            refusals=tuple(found.refusals),
            difference=_difference(found.difference or CandidateDifference(changes=(), raw="")),
        )
    )


@router.post("/missions/{mission_id}/case", responses=api_requests.answers(CaseAdded))
def add_case(console: ConsoleDep, actor: ActorDep, mission_id: MissionId, body: acts.AddCaseAct) -> Any:
    """A disputed or failed mission becomes a case of the regression suite: every later candidate is run on it too."""
    decision = console.releases.add_case(mission_id, SignedBy(actor, body.reason, mission_id))
    if isinstance(decision, Refused):
        return api_requests.refusal(decision)
    return api_requests.plain(next(one for one in console.releases.growth().added if one.mission_id == mission_id))


@router.get("/candidates/{candidate}", responses=api_requests.answers(schemas.CandidateResource))
def show(console: ConsoleDep, candidate: str) -> Any:
    """One candidate: manifest, clauses, what persons said, and the digest that a decision must name."""
    return sheet(console.releases, _named(candidate))


@router.get("/candidates/{candidate}/difference", responses=api_requests.answers(schemas.ConfigurationDifference))
def difference(console: ConsoleDep, candidate: str) -> Any:
    """What it changes against its baseline: by component, and raw."""
    return api_requests.plain(_difference(console.releases.diff(_named(candidate))))


@router.get("/candidates/{candidate}/results", responses=api_requests.answers(schemas.Results))
def results(console: ConsoleDep, candidate: str) -> Any:
    """Flips, paired differences with intervals, and the held-out answer with its look."""
    name = console.releases.review(_named(candidate)).candidate
    found = console.evaluated.of(name)
    if found is None:
        raise UnknownName(because("candidate_not_measured"))
    whole, text = found
    return api_requests.plain(
        schemas.Results(
            pairs=text.pairs,
            safety_pairs=text.safety_pairs,
            pass_to_fail=text.worse,
            pass_to_fail_total=text.worse_total,
            fail_to_pass=text.better,
            fail_to_pass_total=text.better_total,
            families=tuple(one.result for one in text.families),
            held_out=whole.held_out,
            seconds=whole.seconds,
        )
    )


@router.get("/candidates/{candidate}/replay", responses=api_requests.answers(schemas.Replay))
def replay(console: ConsoleDep, actor: ActorDep, candidate: str) -> Any:
    """Which decisions of the newest stored missions would have come out otherwise. No robot is touched."""
    found = replayed(console, actor, _named(candidate))
    differing = tuple(
        schemas.ReplayedMission(mission_id=one.mission_id, differences=tuple(map(_decision, one.rows)))
        for one in found.differing
    )
    return api_requests.plain(schemas.Replay(missions=found.looked, decisions=found.decisions, differing=differing))


@router.get("/candidates/{candidate}/evaluation", responses=api_requests.answers(schemas.CandidateEvaluation))
def evaluation(console: ConsoleDep, principal: PrincipalDep, candidate: str) -> Any:
    """The newest evaluation asked for here, and what one would take where none waits or runs."""
    found = candidate_evaluation.panel_of(console, principal, _named(candidate))
    return api_requests.plain(
        schemas.CandidateEvaluation(
            candidate=Digest(found.candidate), job=found.job, cost=found.cost, ahead=found.ahead, left_s=found.left_s
        )
    )


@router.post("/candidates/{candidate}/evaluate", responses=api_requests.answers(schemas.CandidateEvaluation))
def evaluate(console: ConsoleDep, principal: PrincipalDep, candidate: str, body: acts.EvaluateCandidateAct) -> Any:
    """Evaluate it in the background of this console, after those that were asked for before."""
    decision = candidate_evaluation.begin_evaluation(console, principal, _named(candidate), body)
    if isinstance(decision, Refused):
        return api_requests.refusal(decision)
    return evaluation(console, principal, candidate)


@router.post("/candidates/{candidate}/cancel-evaluation", responses=api_requests.answers(schemas.CandidateEvaluation))
def cancel_evaluation(
    console: ConsoleDep, principal: PrincipalDep, candidate: str, body: acts.CancelEvaluationAct
) -> Any:
    """End it, or take it out of the queue; what was measured is kept."""
    decision = candidate_evaluation.cancel_evaluation(console, principal, _named(candidate))
    if isinstance(decision, Refused):
        return api_requests.refusal(decision)
    return evaluation(console, principal, candidate)


def _act() -> api_requests.Handler:
    def act(console: ConsoleDep, candidate: str, body: Any) -> Any:
        name = console.releases.review(_named(candidate)).candidate
        decision = console.releases.ask(name, body)
        return api_requests.refusal(decision) if isinstance(decision, Refused) else sheet(console.releases, name)

    return act


api_requests.post_acts(router, "/candidates/{candidate}", acts.ACTS, _act, answered=schemas.CandidateResource)


@router.post("/candidates/{candidate}/request_changes", include_in_schema=False)
def request_changes(console: ConsoleDep, candidate: str, body: acts.RequestChangesAct) -> Any:
    """The address under which the act was found before."""
    return _act()(console, candidate, body)


@router.get("/releases", responses=api_requests.answers(schemas.Releases))
def releases(
    console: ConsoleDep,
    at: Annotated[str, Query(max_length=40, description="An instant: what was current then is `current_at`.")] = "",
    robot: api_requests.Facet = "",
) -> Any:
    """The pointer: where it stands, its history, what is pinned to what, quarantine, looks, uptake and the policy."""
    releases = console.releases
    pointer = releases.pointer()
    instant_s = instant_of(at) if at else None
    if at and instant_s is None:
        raise ContractInvalid(because("instant_invalid", text=at), where="at")
    then = releases.current_at(instant_s, robot_id=RobotId(robot) if robot else None) if instant_s is not None else None
    return api_requests.plain(
        schemas.Releases(
            revision=pointer.revision,
            configuration=releases.current(),
            canary=pointer.canary,
            canary_robot=pointer.robot_id,
            current_at=then,
            history=pointer.history,
            versions=releases.versions(),
            pins=releases.pins(),
            quarantined=tuple(pointer.quarantined.values()),
            looks=pointer.looks,
            uptakes=pointer.uptakes,
            policy=pointer.policy,
        )
    )


@router.post("/releases/policy", responses=api_requests.answers(ReleasePolicy))
def policy(console: ConsoleDep, actor: ActorDep, body: acts.SavePolicyAct) -> Any:
    """Say who must agree before a release. One that nobody could meet is refused now."""
    decision = saved(console, actor, body)
    if isinstance(decision, Refused):
        return api_requests.refusal(decision)
    return api_requests.plain(console.releases.pointer().policy)


def _named(candidate: str) -> str:
    """A beginning that somebody chose on purpose. Raises UnknownName for one that is too short to be that."""
    if len(candidate) < 6:
        raise UnknownName(because("unknown_candidate_prefix", candidate=candidate[:40]))
    return candidate


def _difference(found: CandidateDifference) -> schemas.ConfigurationDifference:
    return schemas.ConfigurationDifference(changes=found.changes, raw=found.raw)


def _decision(found: Decided) -> schemas.ReplayedDecision:
    return schemas.ReplayedDecision(
        position=found.position, kind=found.kind, node_id=found.node_id, before=found.before, after=found.after
    )
