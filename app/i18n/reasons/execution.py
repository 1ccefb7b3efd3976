"""Holds the sentences about how executions end: leases, stops, unanswered handoffs and replays, by reason code."""

from collections.abc import Mapping

from app.i18n.catalogues import N_

SENTENCES: Mapping[str, str] = {
    "action_was_not_possible": N_("{action:word} was not possible: {why}"),
    "asked_at_rest": N_("{failure:word}: a person is asked with the body at rest"),
    "at_rest_by_odometry": N_("at rest by odometry"),
    "body_moved_in_second": N_("the body moved {moved_m:.3f} m in a second"),
    "cancel_not_acknowledged": N_("the stop was not acknowledged"),
    "cannot_lie_down": N_("{robot_id} cannot lie down; it stays where it is"),
    "chosen_by_person": N_("a person's choice"),
    "claim_not_renewed": N_("the claim was not renewed"),
    "claim_released": N_("released by its holder"),
    "deadline_was_passed": N_("the deadline passed {late_s:.1f} s ago"),
    "declares_posture": N_("the robot declares itself {posture:word}"),
    "ended_at_rest": N_("{status:word}; {rest}"),
    "execution_not_held": N_("the execution was neither held by the robot's watchdog nor stopped"),
    "execution_not_found": N_("the execution could not be found again"),
    "failed_after": N_("after {action:word}: {reason}"),
    "holder_unaccounted_for": N_("the lease expired with its holder unaccounted for"),
    "it_was_never_sent": N_("it was never sent"),
    "lease_was_quarantined": N_("its lease was quarantined while nobody watched"),
    "map_changed": N_("the robot's map changed from {before} to {map_version}"),
    "mission_was_stopped": N_("the mission was stopped"),
    "never_sent": N_("never sent: {why}"),
    "no_stage_can_go_on": N_("No stage can go on."),
    "nobody_answered": N_("nobody answered in time"),
    "odometry_too_short": N_("less than a second of odometry was seen"),
    "paused_with_mission": N_("pause: {reason}"),
    "precondition_fails": N_("{condition:word}: {reason}"),
    "provider_cannot_be_asked": N_("{provider_id} cannot be asked whether the request arrived"),
    "provider_cannot_resume": N_("the supervisor was away and the provider cannot resume"),
    "replay_cancelled": N_("the replay was cancelled"),
    "replay_interrupted": N_("the replay was interrupted"),
    "resource_taken": N_("{resource} is {status:word} for {invocation_id}"),
    "result_accepted": N_("the gate accepted the result"),
    "result_not_accepted": N_("the gate did not accept the result"),
    "result_unknown": N_("nobody can say whether it was done"),
    "retreat_over": N_("return to the safe point: {outcome:word}"),
    "standstill_measured": N_("{displacement_m:.3f} m in the last {window_s:.0f} s by odometry"),
    "stop_shown_static": N_("the stop was acknowledged and the body is static"),
    "stopped_by_veto": N_("vetoed: {vetoes}"),
    "stopped_while_sending": N_("the harness stopped while it was being sent, and the robot knows no such request"),
    "stopped_with_mission": N_("stop: {reason}"),
    "unanswered_lies_down": N_("nobody answered in time; the robot lies down where it is"),
    "unanswered_retreats": N_(
        "nobody answered in time; the robot goes to its safe place if it can, as authorised before"
    ),
    "unanswered_stays": N_("nobody answered in time; the robot stays where it is"),
    "waiting_did_not_help": N_("waiting did not help: {obstacle}"),
}
