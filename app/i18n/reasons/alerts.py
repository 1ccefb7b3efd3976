"""What an alert says, by code."""

from collections.abc import Mapping

from app.i18n.catalogues import N_

SENTENCES: Mapping[str, str] = {
    "alert_answered": N_("{actor} ({channel}): {decision:word}"),
    "alert_at_robot": N_("{robot_id}: {title}"),
    "alert_battery_low": N_("battery is low"),
    "alert_disputed": N_("an acceptance at {stage:word} is disputed"),
    "alert_duplicate_start": N_("{robot_id}: a request was started twice"),
    "alert_handoff": N_("waits for a person at {stage:word}"),
    "alert_hardware_stop": N_("hardware stop is engaged"),
    "alert_mission_ended": N_("mission ended {status:word}"),
    "alert_no_answer_not_done": N_("nobody answered, and “{action:word}” is not shown to be done"),
    "alert_not_at_rest": N_("stopped, but not shown at rest"),
    "alert_of_robot": N_("{robot_id} {title}"),
    "alert_robot_lost": N_("does not answer"),
    "alert_unclaimed": N_("a question waits unclaimed at {stage:word}"),
    "alert_unsafe": N_("unsafe at {stage:word}"),
    "alert_veto": N_("{layer} vetoes motion"),
    "alert_with_goal": N_("{text}. Goal: {goal}"),
    "by_robots_word": N_("as reported by the robot"),
    "charge_left": N_("{charge:.0%} left"),
    "last_answered": N_("last answered {age_s:.0f} s ago"),
    "never_answered": N_("never answered"),
    "no_reason_given": N_("no reason given"),
    "said_by": N_("{actor}: {reason}"),
    "silent_with_trouble": N_("{age}. {trouble}"),
    "starts_beyond_first": N_("{starts} starts beyond the first of a request, by the robot's own journal"),
    "the_mission_ended": N_("the mission ended"),
    "unclaimed_for_minute": N_("nobody took it for a minute"),
    "unclaimed_for_three_minutes": N_("nobody took it for three minutes"),
}
