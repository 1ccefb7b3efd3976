"""Holds the sentences of plans, targets and recovery actions that are refused, by reason code."""

from collections.abc import Mapping

from app.i18n.catalogues import N_

SENTENCES: Mapping[str, str] = {
    "action_costs": N_("{action:word} costs {cost}, not {offered}."),
    "action_unpaid": N_("{action:word} is refused: {why}."),
    "action_unsigned": N_("{action:word} carries no signature of what would be done."),
    "another_capability": N_("{stage} is not done by “{capability}”."),
    "another_target": N_("{node_id} does not lead to the target that was chosen for it."),
    "bindings_changed": N_("A plan keeps what the contract was compiled from; {field} changed."),
    "chosen_target_changed": N_("A target that was chosen stands; a plan may add one."),
    "committed_stage_changed": N_("{node_id} is committed; what was accepted is not rewritten."),
    "completion_conditions_changed": N_("The completion conditions are those first stored; no plan changes them."),
    "constraints_loosened": N_("A plan may add a restriction, not relax one: {constraints:words}."),
    "dependency_not_planned": N_("{stage} waits for {dependencies}, which is not planned."),
    "excluded_provider": N_("{provider_id} was given up for this stage."),
    "foreign_target": N_("The target was chosen for {mission_id}, not for this mission."),
    "frame_changed": N_("The contract is stated in {frame} of map {map_version}."),
    "goal_changed": N_("A revision keeps the person's own words and its template."),
    "limits_exclude_all": N_("The limits cannot be combined: {why}."),
    "mission_budget_fixed": N_("The mission's recovery budget is {budget}; a plan cannot raise it."),
    "next_step_is": N_("The next step for {failure:word} is {expected:word}, not {action:word}."),
    "no_node_startable": N_("{node_id} may not start now; nothing may."),
    "no_step_above": N_("{action:word} is no step after the last one for {failure:word}."),
    "node_not_in_graph": N_("The graph has no stage “{node_id}”."),
    "node_not_startable": N_("{node_id} may not start now; eligible: {eligible}."),
    "nothing_to_recover": N_("Stage {node_id} has no open failure, so there is nothing to recover from."),
    "obsolete_target": N_("The target was chosen at state version {k}; this is {mission_k}."),
    "plan_invalid": N_("The contract would not be valid: {why}."),
    "reopened_without_follower": N_("{node_id} rests on a stage that begins again, so it cannot stay accepted."),
    "repeated_without_news": N_(
        "{action:word} by {provider_id} with these parameters answered {failure:word} before, and no sensor "
        "has said anything since the failure."
    ),
    "stage_budget_too_large": N_("{node_id} would bring a larger recovery budget than any stage has."),
    "stage_missing": N_("The goal requires {stages}, which the plan leaves out."),
    "stage_not_offered": N_("The template offers {offered}, not “{stage}”."),
    "stage_not_removable": N_("{node_id} is required or was begun; only an idle option may go."),
    "stage_planned_twice": N_("A stage is planned twice."),
    "stage_weakened": N_("{node_id} would ask for less: {parts:words}."),
    "stages_circular": N_("{stages} would wait for itself."),
    "stages_out_of_order": N_("{stages} would not wait for what the goal wants before it."),
    "target_given_up": N_("{at} is where an earlier target of this mission was given up."),
    "target_kept_out": N_("{at} lies where the contract forbids to enter."),
    "target_of_another_configuration": N_("The target was chosen under {configuration}, not under {pinned}."),
    "target_outside_map": N_("{at} lies outside the map {map_version}."),
    "target_outside_zones": N_("{at} lies in no zone in which the robot may be."),
    "target_too_far": N_("{at} is {way_m:.1f} m away, at most {longest_m:.1f} m per target."),
    "target_unbound": N_("No choice stands behind {nodes}."),
    "target_unreachable": N_("No known free floor leads to {at}."),
    "targets_spent": N_("The exploration's budget of targets is spent."),
    "work_left": N_("{node_id} may start, whatever the plan says of the mission."),
    "wrong_failure": N_("The proposal answers {answered:word}; the failure is {failure:word}."),
}
