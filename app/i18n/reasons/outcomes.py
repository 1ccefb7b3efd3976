"""Holds the sentences about how a mission ended and who ended it, by reason code."""

from collections.abc import Mapping

from app.i18n.catalogues import N_

SENTENCES: Mapping[str, str] = {
    "answered_by": N_("{actor}: {reason}"),
    "condition_disputed": N_("{condition} is disputed"),
    "goal_met": N_("Goal met: {goal}. {reason}"),
    "goal_not_met": N_("All stages done, goal not met ({verdict:word}): {why}"),
    "goal_partly_verified": N_("Partly verified: {goal}. Declared by the provider, not verified: {parts}."),
    "goal_verdict_satisfied": N_("the goal verdict is satisfied"),
    "handoff_was_answered": N_("{actor} {decision:word} the handoff: {reason}"),
    "mission_over": N_("{reason:capital}"),
    "mission_stopped_by": N_("Stopped by {actor}: {reason}"),
    "no_stage_answers": N_("No stage answers for it alone, so none is opened again."),
    "not_compiled_yet": N_("not compiled yet"),
    "not_reopened": N_("{why} {again}"),
    "rests_on_word_alone": N_("only the provider declares: {parts}"),
    "stage_not_reopened": N_("{stage} is not opened again: {why}."),
    "stage_of_mission": N_("{stage:word}, {number} of {count}"),
    "stages_accepted": N_("all {count} stages accepted"),
    "stages_accepted_in_part": N_("{done} of {count} stages accepted, {declared} declared"),
    "stopped_without_rest": N_("{stopped}. No evidence shows the robot at rest: {why}"),
    "withdrawn_before_begin": N_("Withdrawn by {actor} before it began: {reason}"),
}
