"""Holds the sentences of what providers and robots report of an invocation, by reason code."""

from collections.abc import Mapping

from app.i18n.catalogues import N_

SENTENCES: Mapping[str, str] = {
    "delivery_acknowledged": N_("The channel acknowledged the text and {images} images"),
    "channel_silent_so_far": N_("The channel has not answered yet"),
    "controller_interrupted": N_("The robot's controller was interrupted"),
    "goal_reached_within": N_("The robot reports the goal as reached within {distance_m:.2f} m"),
    "happened_at": N_("{reason} ({where})"),
    "keepalive_missed": N_("No keepalive came, so the robot stopped by itself"),
    "no_frame_at_heading": N_("No image was taken near the measured heading of {heading_rad:.2f} rad"),
    "no_gap_wide_enough": N_("the lidar shows no gap wide enough"),
    "no_progress": N_("The robot made less than {progress_m:.1f} m of progress in {within_s:.0f} s"),
    "no_progress_since": N_(
        "The robot made less than {progress_m:.1f} m of progress in {within_s:.0f} s, because {reason}"
    ),
    "no_way_to_route": N_("No way on the robot's map leads to the route"),
    "observed_for": N_("The robot observed for {looked_s:.1f} s"),
    "on_way_to_route": N_("On the way to the route: {reason}"),
    "passage_hardly_in_view": N_("Only {share:.0%} of the passage is in view of the {frames} images"),
    "picture_archived": N_("The picture {image} is archived, {bytes} bytes"),
    "playback_cut_off": N_("The playback was cut off by a restart"),
    "playback_differs": N_("The speaker played other samples than were synthesised"),
    "recorded_arrival_declared": N_("{segment}: the recorded supervisor declared arrival"),
    "recorded_leg_undeclared": N_("{segment} has ended, and its recording declares nothing"),
    "recording_left": N_("{segment}: {left_s:.1f} s of the recording are left"),
    "request_taken_down": N_("The request was stored as typed"),
    "robot_restarted_under_way": N_("The robot was restarted under way; the invocation was not started again"),
    "route_closed_ahead": N_("the lidar shows the route ahead closed"),
    "samples_played": N_("{played} of {samples} samples are played"),
    "spoken_within": N_("It was spoken in {duration_s:.1f} s"),
    "stopped_on_request": N_("It was stopped on request"),
    "turn_not_completed": N_("The turn at the target was not completed"),
    "turn_photographed": N_("{frames} images were taken in one turn"),
    "under_way": N_("It is under way"),
    "vehicle_dropped_order": N_("The vehicle dropped the order after node {passed} of {last}"),
    "vehicle_emergency_stop": N_("Its emergency stop is engaged"),
    "vehicle_error": N_("It reports an error: {error}"),
    "vehicle_follows_other_order": N_("The vehicle follows another order: {order_id}"),
    "vehicle_lists_other_nodes": N_("The vehicle's state lists other nodes than its order"),
    "vehicle_map": N_("It is on its map {map_id}"),
    "vehicle_mode": N_("Its operating mode is {mode}"),
    "vehicle_reached_last_node": N_("The vehicle reports its last node as reached"),
    "vehicle_refused_order": N_("The vehicle refused the order: {error}"),
    "vehicle_restarted": N_("The vehicle was restarted and does not know the order"),
    "vehicle_silent_on_order": N_("The order was sent {sent} times, and no state shows it"),
}
