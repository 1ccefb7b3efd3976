"""Holds the sentences about providers that routing filtered out, by reason code."""

from collections.abc import Mapping

from app.i18n.catalogues import N_

SENTENCES: Mapping[str, str] = {
    "charge_too_low": N_("charge {charge:.2f} is below {bound:.2f}"),
    "given_up_for_stage": N_("given up for this stage"),
    "made_for_other_embodiments": N_("made for {embodiments}, not for {embodiment}"),
    "not_localised_now": N_("the robot is not localised"),
    "offers_another_capability": N_("offers {capability:word}, not {wanted:words}"),
    "parameter_of_another_type": N_("parameter {name} is no {type:word}"),
    "parameter_required": N_("parameter {name} is required"),
    "parameter_undeclared": N_("parameter {name} is not on the card"),
    "parameter_too_large": N_("parameter {name} = {value:g} is above {bound:g} {unit}"),
    "parameter_too_small": N_("parameter {name} = {value:g} is below {bound:g} {unit}"),
    "precondition_untestable": N_("precondition {precondition} cannot be tested"),
    "precondition_without_condition": N_("precondition {precondition}: the robot's condition is unknown"),
    "provider_filtered": N_("{provider_id}: {filter:word}, {reason}"),
    "risk_too_high": N_("risk {risk:word} exceeds the stage's {stage_risk:word}"),
    "robot_condition_old": N_("the robot's condition is {age_s:.1f} s old, at most {bound_s:.1f} s"),
    "robot_condition_unknown": N_("the robot's condition is unknown"),
    "robot_fell": N_("the robot has fallen"),
    "robot_lies_down": N_("the robot lies down"),
    "robot_moves": N_("the robot moves"),
    "no_provider_passed": N_("no provider passed the hard filter"),
    "only_provider_passed": N_("{provider_id} is the only provider that passed the hard filter"),
    "routing_decided": N_(
        "{provider_id} scores {score:.3f}, {over} {other:.3f}; most in its favour: {term:word} ({lead:+.3f})"
    ),
    "routing_decided_by_history": N_(
        "{provider_id} instead of {over}: {failed} of {judged} verified executions of {over} at {place} failed. "
        "History weighs {lead:+.3f} in its favour; the scores are {score:.3f} and {other:.3f}"
    ),
    "robot_on_other_map": N_("the robot is on map {robot_map}, the task on {task_map}"),
    "velocity_interface_armed": N_("the velocity interface is armed"),
}
