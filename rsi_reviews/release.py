"""Decides whether a candidate may be authorised, enter canary and become current, and answers the fourth clause (D33).
Pure.
"""

from harness.contracts.decisions import Accepted, Decision, Refused, refused
from harness.contracts.reasons import because
from harness.contracts.values import Moment
from rsi_reviews import events
from rsi_reviews.approval_policy import RELEASERS, not_a_person, signed
from rsi_reviews.canary import bound_of, outcome
from rsi_reviews.commands import AuthoriseRelease, BeginCanary, ExpireAuthorisation, PromoteCandidate
from rsi_reviews.contracts import BETTER, ClauseAnswer, ReleasePolicy
from rsi_reviews.projections import Review
from rsi_reviews.review import answered, own_word, unanswerable

FEWEST_RECENT = 20
"""Missions of the baseline on the canary's robot; below that the evaluation's own results are the comparison."""
PEOPLE = 2


def authorise(review: Review, command: AuthoriseRelease, now: Moment) -> Decision[events.CandidateEvent]:
    """Fix the release: who, until when, and the rollback version, which has just been loaded."""
    refusal = unanswerable(review, command) or not_a_person(command.actor, RELEASERS)
    if refusal:
        return refusal
    own = command.actor.name in review.authors
    if own and (refusal := own_word(review, command, command.policy, now)):
        return refusal
    if refusal := unsatisfied(review, command.policy, with_name=command.actor.name):
        return refusal
    if review.manifest is None or command.rollback != review.manifest.rollback:
        return refused("other_rollback", because("rollback_not_of_manifest"))
    if command.proven != command.rollback:
        return refused("rollback_unproven", rollback=command.rollback[:12])
    authorised = events.ReleaseAuthorised(
        cycle=review.cycle,
        subject=command.subject,
        rollback=command.rollback,
        proven_at_s=now.wall_s,
        expires_at_s=now.wall_s + command.policy.authorisation_s,
        by=signed(command, now, override=own),
    )
    return Accepted((authorised,))


def unsatisfied(review: Review, policy: ReleasePolicy, *, with_name: str) -> Refused | None:
    """Why the policy is not met: enough approvals, and two people in all among authors who acted here, approvers and
    the person who decides now (D33).

    A name that appears only in a manifest or in terms is an author's and counts as no decision.
    """
    approvers = {approval.actor.name for approval in review.approvals if not approval.override}
    if policy.kind == "single_operator":
        approvers = {approval.actor.name for approval in review.approvals}
    if len(approvers) < policy.quorum:
        return refused("no_quorum", approvals=len(approvers), quorum=policy.quorum)
    spoke = {one.by.actor.name for one in review.said if one.by.actor.channel == "human"}
    people = (spoke & review.authors) | approvers | {with_name}
    if policy.kind == "two_person" and len(people) < PEOPLE:
        return refused("one_person", people=tuple(people))
    return None


def expire(review: Review, command: ExpireAuthorisation, now: Moment) -> Decision[events.CandidateEvent]:
    """The authorisation has expired and the candidate has to be reviewed again. A no-op if another decision
    came first.
    """
    if review.status != "authorised" or review.authorised is None or now.wall_s < review.authorised.expires_at_s:
        return Accepted(())
    return Accepted((events.AuthorisationExpired(cycle=review.cycle, at_s=now.wall_s),))


def begin_canary(review: Review, command: BeginCanary, now: Moment) -> Decision[events.CandidateEvent]:
    """Release to one robot. The bound for a worse mission there is fixed before the first mission."""
    refusal = unanswerable(review, command, status="authorised") or not_a_person(command.actor, RELEASERS)
    if refusal:
        return refusal
    manifest, evaluation, authorised = review.manifest, review.evaluation, review.authorised
    if manifest is None or evaluation is None or authorised is None:
        return answered(review)
    if now.wall_s >= authorised.expires_at_s:
        return refused("authorisation_expired", at_s=authorised.expires_at_s)
    own = command.actor.name in review.authors
    if own and (refusal := own_word(review, command, command.policy, now)):
        return refusal
    if refusal := unsatisfied(review, command.policy, with_name=authorised.by.actor.name):
        return refusal
    bound, missions = evaluation.bound, evaluation.bound_missions
    if len(command.recent) >= FEWEST_RECENT:
        bound = bound_of(command.recent, manifest.canary, BETTER[manifest.metric])
        missions = len(command.recent)
    by = signed(command, now, override=own)
    return Accepted((events.CanaryBegun(robot_id=command.robot_id, bound=bound, bound_missions=missions, by=by),))


def promote(review: Review, command: PromoteCandidate, now: Moment) -> Decision[events.CandidateEvent]:
    """Make it current everywhere, once every canary mission is adjudicated and enough exercised the change."""
    if review.status != "canary":
        return refused("not_in_canary", because("candidate_is", status=review.status))
    if (stands := outcome(review)) != "passed":
        return refused("canary_not_passed", outcome=stands)
    reason = because("canary_passed", exercised=len(review.exercised))
    return Accepted((events.CandidateReleased(reason=reason, at_s=now.wall_s),))


def release_clause(review: Review) -> ClauseAnswer:
    """The fourth clause now (R160): pass only while an authorisation is valid or was used."""
    if review.authorised is not None and review.status in ("authorised", "canary", "current"):
        by = review.authorised.by
        return ClauseAnswer(
            clause="release_authorised",
            answer="pass",
            sentence=f"authorised by {by.actor.name}",
            numbers={"approvals": float(len(review.approvals)), "expires_at_s": review.authorised.expires_at_s},
        )
    over = review.status in ("rejected", "rolled_back", "withdrawn")
    return ClauseAnswer(
        clause="release_authorised",
        answer="fail" if over else "inconclusive",
        sentence=f"not authorised, {review.status}",
        numbers={"approvals": float(len(review.approvals))},
    )
