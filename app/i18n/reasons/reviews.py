"""Holds the sentences with which the review of a candidate refuses, by reason code."""

from collections.abc import Mapping

from app.i18n.catalogues import N_

SENTENCES: Mapping[str, str] = {
    "cancelled_by": N_("cancelled by {actor}"),
    "evaluation_jobs_unreadable": N_("The list of evaluations cannot be read: {error}"),
    "evaluation_process_lost": N_("the evaluating process ended before it was done; ask again to go on"),
    "no_evaluation_open": N_("No evaluation of it waits or runs."),
    "no_evaluations_here": N_("This console evaluates nothing: start it with `regen up`."),
    "alpha_overspent": N_("Look {look} spent {spent:g} of the {alpha:g} for all looks."),
    "approved_already": N_("{actor} approved it in this cycle."),
    "authorisation_ends_at_once": N_("An authorisation that ends at once could never be used."),
    "authorisation_expired": N_("The authorisation ended at {at_s:instant}."),
    "baseline_rolled_back": N_("its baseline was rolled back: {why}"),
    "canary_finding_stands": N_("{actor} found {finding:word} before you: “{reason}”."),
    "canary_hard_fault": N_("hard fault: {fault:word} in {mission_id}"),
    "canary_metric_worse": N_("{metric:word} was worse than the baseline's bound in {worse} of {exercised} missions"),
    "canary_not_exercised": N_("not exercised enough in {missions} missions"),
    "canary_not_passed": N_("The canary's result is {outcome:word}, not passed."),
    "canary_open": N_("Candidate {trial} is in canary; one at a time."),
    "canary_passed": N_("{exercised} canary missions exercised the change and each was found sound"),
    "canary_sound": N_("its canary missions were found sound"),
    "candidate_decided": N_("{actor}: {decision:word} at {at_s:instant}, “{reason}”. The candidate is {status:word}."),
    "candidate_exists": N_("This candidate exists; it is {status:word}."),
    "candidate_is": N_("The candidate is {status:word}."),
    "candidate_not_asked": N_("The candidate is {status:word}; this is not asked now."),
    "candidate_not_in_canary": N_("Candidate {candidate} is not in canary."),
    "case_known": N_("Mission {mission_id} is that very case already."),
    "case_not_a_number": N_("Case {case} has a measure that is not a number."),
    "clause_authorised": N_("{actor} authorised it at {at_s:instant}; approvals: {approvals}."),
    "clause_bounds": N_(
        "{metric:word} is better by {gain:.3g} per mission (95 % interval {low:.3g} to {high:.3g}, n = "
        "{pairs}); {declared:g} was declared"
    ),
    "clause_confirmed": N_("{bounds}; the held-out look {look} confirms it."),
    "clause_hard_fault": N_("{count} {metric:word}"),
    "clause_hard_faults": N_("In {cases} cases there were {broken}; none is allowed."),
    "clause_more_epistemic": N_(
        "{after:g} epistemic false completions, the baseline has {before:g} in the same {cases} cases."
    ),
    "clause_no_hard_fault": N_(
        "No hard fault in {cases} cases: with 95 % confidence fewer than {share_at_most:.2%} of missions "
        "would have one."
    ),
    "clause_none_worse": N_("None of {metrics:words} is worse, overall and by family."),
    "clause_not_authorised": N_("No authorisation holds. Status of the candidate: {status:word}."),
    "clause_not_confirmed": N_("{bounds}; the held-out look {look} did not confirm it."),
    "clause_not_looked": N_("{bounds}; the held-out look was not taken."),
    "clause_not_reached": N_("{bounds}, which is not reached."),
    "clause_too_few_cases": N_("Nothing was broken in {cases} cases; more are needed."),
    "clause_within_interval": N_("{bounds}, which lies within the interval."),
    "clause_worse": N_("Worse than the baseline: {worse}."),
    "clause_worse_by": N_("{metric:word} ({family:word}) by {loss:.3g} per mission"),
    "configuration_in_use": N_("{configuration} is current, in canary or what a rollback goes back to."),
    "configuration_retired": N_("{configuration} was retired; nothing selects it again."),
    "configuration_rolled_back": N_("{configuration} was rolled back at {at_s:instant}: {reason}."),
    "cooling_off_needed": N_("A single operator needs a cooling-off time above 0 s."),
    "cooling_off_until": N_("A single operator waits: not before {until_s:instant}."),
    "decision_needs_person": N_("{actor} is no person; only a {roles:or} decides this."),
    "key_reused": N_("{actor} used this key at {at_s:instant} for another decision: “{reason}”."),
    "look_counted_twice": N_("Look {look} was another candidate's."),
    "look_taken": N_("Candidate {candidate} had its one look at {at_s:instant}."),
    "missing_cases": N_("There are {results} results of {cases} cases; {expected_cases} cases need two each, once."),
    "no_canary_mission": N_("{mission_id} is no finished mission of this canary."),
    "no_candidate_to_evaluate": N_("There is no candidate to evaluate: it is {status:word}."),
    "no_held_out": N_("Nothing passes without its one look at the held-out suite."),
    "no_quorum": N_("{approvals} of {quorum} approvals are there."),
    "no_revision": N_("There is no revision {revision} yet; it is {latest}."),
    "no_such_candidate": N_("There is no such candidate."),
    "not_a_draft": N_("The candidate is {status:word}: what was answered is not asked again."),
    "not_accepted": N_("The candidate is {status:word}; only an accepted one is reviewed."),
    "not_an_author": N_("{actor} is no author of it; request changes or reject it."),
    "not_current": N_("Candidate {candidate} is neither current nor in canary."),
    "not_disputed": N_("Only a failed mission or one with a disputed completion becomes a case: dispute it first."),
    "not_evaluating": N_("The candidate is {status:word}: no evaluation was begun."),
    "one_person": N_("{people} alone did everything; a second person is needed."),
    "other_predicate": N_("Another acceptance predicate answered than the one that was fixed."),
    "other_result_set": N_("The report speaks of other results than these."),
    "own_candidate": N_("{actor} is an author of it ({parts:words}); somebody else decides."),
    "own_release": N_("{actor} released it; somebody else says what became of it."),
    "pinned_missions": N_("Unfinished missions run under it: {missions}. Let them end first."),
    "pinned_rolled_back": N_("rolled back: {why}"),
    "policy_changed": N_("The release policy is now {policy:word}. Decide again under it."),
    "policy_needs_person": N_("{actor} is no person; people say who may release."),
    "quorum_of_none": N_("At least one approval is needed."),
    "recording_not_runnable": N_("A replayed recording cannot be run again in simulation."),
    "release_changed": N_("What would be released is not what you saw. Read it again, then decide."),
    "results_of_other_terms": N_("The results were made under other terms than those that were fixed."),
    "rollback_fixed": N_("It goes back to {rollback}, fixed when it was authorised."),
    "rollback_not_of_manifest": N_("The rollback target is the one that the manifest names, and no other."),
    "rollback_unproven": N_("The rollback target did not load as {rollback}."),
    "stale_baseline": N_(
        "Its baseline {baseline} is no longer current: that is {current} since revision {revision}. Propose "
        "and evaluate the change against what is current."
    ),
    "suite_needs_person": N_("A suite grows by a person's hand."),
    "terms_differ": N_("The {field:word} was fixed as {fixed}; these results have {given}."),
    "terms_fixed": N_("It may be evaluated again, but only under the terms that were fixed."),
    "terms_name_another": N_("The {field:word} of these terms is {given}; the candidate's is {own}."),
    "too_few_people": N_(
        "{quorum} approvals and a releaser are needed; there are {reviewers} reviewers and {releasers} releasers."
    ),
    "two_people_needed": N_("Two people are needed; only {people} could decide."),
    "unfinished_case": N_("Case {case} {outcome:word}; that is no result."),
    "wrong_role": N_("{actor} is {role:word}; a {roles:or} decides this."),
}
