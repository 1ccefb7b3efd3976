"""Holds the sentences about failures and the recovery actions that follow them, by reason code."""

from collections.abc import Mapping

from app.i18n.catalogues import N_

SENTENCES: Mapping[str, str] = {
    "frames_taken_anew": N_("{stage} takes its frames anew, from where the robot stands"),
    "route_frees_nothing": N_("another route frees nothing that somebody else holds"),
    "seen_from_elsewhere": N_(
        "{stage} takes its frames from ({x_m:.1f}, {y_m:.1f}), {way_m:.1f} m from here, where {percent:.0f} % of the "
        "region can be seen on the map"
    ),
    "waits_aside": N_(
        "{stage} goes on after {wait_s:g} s at {place}, which is out of the way: {length_m:.1f} m from here"
    ),
    "route_revised": N_(
        "{stage} drives another route, planned on the map of this mission: {length_m:.1f} m, {corners} corners"
    ),
    "planned_from_memory": N_(
        "{plan}. This mission's own map showed no way: floor that {missions:words} saw is drawn under it"
    ),
    "action": N_("{action:word}"),
    "action_by_provider": N_("{action:word} by {provider_id}"),
    "action_impossible": N_("{action:word}: {why}"),
    "beyond_unattended_share": N_(
        "Recovery step {step} of stage {stage} goes beyond the {allowed:g} of {total} that may be taken "
        "without a person."
    ),
    "configuration_in_canary": N_("Configuration {configuration} is in canary: a person approves each of its motions."),
    "each_motion_approved": N_("The mission asks for approval of each motion."),
    "execution_over": N_("the execution ended {terminal:word}"),
    "execution_over_with_failure": N_("the execution ended {terminal:word}: {failure:word}"),
    "failure": N_("{failure:word}"),
    "failure_explained": N_("{failure:word} ({why})"),
    "given_up_for_good": N_("{failure:word}: {why}"),
    "mission_is_manual": N_("The mission is manual: a person approves every dispatch."),
    "next_step": N_(
        "{failure:capital}. Tried before: {tried:words}. Next: {following}. Recovery attempts left: {left_node} in "
        "this stage, {left_mission} in the mission."
    ),
    "no_alternative": N_("no other provider can do it"),
    "drives_no_route": N_("{stage} drives no route"),
    "look_changes_nothing": N_("the robot was measured away from where it is to be, and a look does not move it"),
    "no_detour": N_("the map shows no other way for {stage} that is wide and short enough"),
    "of_stage": N_("{stage}: {reason}"),
    "over_action_budget": N_("nothing is left for {action:word}"),
    "over_mission_budget": N_("nothing is left of the mission's recovery budget"),
    "over_node_budget": N_("nothing is left of the stage's recovery budget"),
    "person_is_asked": N_("a person is asked"),
    "repeats_without_news": N_("{action:word} answered {failure:word} before, and no sensor has spoken since"),
    "required_stage_failed": N_("A required stage failed. {reasons}"),
    "risky_motion_approved": N_(
        "The mission asks for approval of risky motion, and stage {stage} is of {risk:word} risk."
    ),
    "stage_of_high_risk": N_("Stage {stage} is of high risk."),
    "revision_refused": N_("the other way that was planned is refused: {why}"),
    "step_not_applicable": N_("{action:capital} does not apply here: {why}"),
    "step_applies": N_("{action:word} is carried out, not passed over."),
    "step_passed_over": N_("{action:word}: {why}"),
    "stopped_for_failure": N_("{failure:word}: {why}"),
}
