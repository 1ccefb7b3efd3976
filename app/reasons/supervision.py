"""Why the supervisor sends nothing, and how a way to a safe place ended, by code."""

from collections.abc import Mapping

from app.catalogues import N_

SENTENCES: Mapping[str, str] = {
    "approval_mission_is": N_("the mission is {status:word}"),
    "approval_of_another_version": N_("the mission is at version {k}, the approval was given for {approved_k}"),
    "approval_stop_asked": N_("a stop was asked for: {reason}"),
    "deadline_passed": N_("its deadline passed"),
    "driven_by_hand": N_("{actor} drives it by hand"),
    "hardware_stop_engaged": N_("The hardware stop is engaged"),
    "harness_stopped_under_way": N_("the harness stopped while it was under way"),
    "held_by_autonomy": N_("The mission moves only where a person approves."),
    "held_by_pause": N_("The mission was paused."),
    "lease_lost": N_("its lease was lost"),
    "localiser_and_odometry_differ": N_("localiser and odometry do not tell the same of the last metres"),
    "measured_from_place": N_("{distance_m:.2f} m from {place} by measurement"),
    "motion_vetoed": N_("{layer:word} vetoes motion: {why}"),
    "no_fresh_poses": N_("no fresh poses show where the robot stands"),
    "no_retreat_instead": N_("No retreat: {why} Instead: {instead}"),
    "nobody_can_serve": N_("Nobody can serve {node_id}. {why}"),
    "not_shown_at_rest": N_("It is not shown at rest: {why}"),
    "one_and_other": N_("{one}; {other}"),
    "retreat_ended": N_("{outcome:word}: {reason}; declared {declared}, accepted as nothing"),
    "retreat_not_sent": N_("The harness stopped before a retreat could be sent."),
    "robot_not_localised": N_("The robot is not localised"),
    "robot_on_another_map": N_("The robot is on map {robot_map}, the way on {way_map}"),
    "robot_status_old": N_("The robot's status is unknown or old"),
    "stop_not_acknowledged": N_("its stop was not acknowledged"),
    "stopped_before_sending": N_("it was stopped before it was sent: {reason}"),
    "stopped_by": N_("{actor} stopped it: {reason}"),
    "supervisor_away_too_long": N_("the supervisor was away for too long"),
}
